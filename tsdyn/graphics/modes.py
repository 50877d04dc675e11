"""Mode shapes: bodies and joints at rest, and displaced by each mode."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..drawing import GREY, VERMILION, axes_of, figure_of
from ..elements.bodies import rotation_matrix
from ..errors import InvalidArgument
from .symbols import attached, joint_points

if TYPE_CHECKING:
    from ..hints import Linearisation

SHOWN = 0.25  # largest displacement, per extent of the scene
NO_EXTENT = 1.0  # m, of a scene that is a point


@figure_of("modes")
def mode_shapes(linearisation: Linearisation, count: int = 4) -> Any:
    """Draw the first modes of a linearisation: centroids and joints at rest in grey, and displaced by each mode.

    Displacements are scaled to a quarter of the scene's extent; a complex shape is drawn at the phase where its largest
    coordinate is real.

    Parameters
    ----------
    linearisation : Linearisation
        What `scene.linearise()` returns, before a change of the scene.
    count : int
        Of modes at most, in order of |lambda|.

    Returns
    -------
    ndarray of matplotlib Axes, one a mode
        Three-dimensional, m.

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    InvalidArgument
        If there are no modes, or count isn't positive.

    Examples
    --------
    >>> import matplotlib
    >>> import tsdyn as ts
    >>> matplotlib.use("agg")
    >>> mass = (scene := ts.Scene()).add_point_mass(mass=1.0, position=(0, 0, -1))
    >>> spring = scene.add(ts.forces.Spring(mass, scene.ground, stiffness=100.0, free_length=0.9019))
    >>> axes = ts.plots.mode_shapes(scene.linearise())
    >>> axes.shape, axes[0].get_xlabel()
    ((3,), 'x (m)')
    """
    if not isinstance(count, int) or count < 1:
        raise InvalidArgument(f"mode_shapes: count must be a whole number, 1 or more, got {count!r}.")
    modes = linearisation.modes()
    shown = range(min(count, len(modes)))
    rest, turned = _skeleton(linearisation)
    low = np.min([body.min(axis=0) for body in rest], axis=0)
    extent = float((np.max([body.max(axis=0) for body in rest], axis=0) - low).max()) or NO_EXTENT
    axes = np.atleast_1d(axes_of(None, 1, len(shown), figsize=(4.2 * len(shown), 4.2), subplot_kw={"projection": "3d"}))
    for j, ax in zip(shown, axes, strict=True):
        moves = []
        for body, arms in zip(linearisation.bodies, turned, strict=True):
            twist = modes.twist(body)[j].real
            moves.append(twist[:3] + np.cross(twist[3:], arms))
        scale = SHOWN * extent / (max(float(np.abs(move).max()) for move in moves) or 1.0)
        for at, move in zip(rest, moves, strict=True):
            _draw(ax, at, GREY)
            _draw(ax, at + scale * move, VERMILION)
        _label(ax, modes.eigenvalues[j], modes.motions[j])
    return axes


def _skeleton(linearisation):
    """For each body, points (1 + j, 3): its centroid and joints, in the ground frame; and arms from the centroid."""
    packed = linearisation.bodies[0].scene.packed
    constraints, forces = attached(packed)
    rest, turned, at = [], [], 0
    for body, points in zip(packed.bodies, joint_points([*constraints, *forces], len(packed.bodies)), strict=True):
        q = linearisation.q[at : at + body.dimension]
        arms = np.array([np.zeros(3), *points])
        if body.dimension == 7:
            arms = arms @ rotation_matrix(q[3:]).T
        rest.append(q[:3] + arms)
        turned.append(arms)
        at += body.dimension
    return rest, turned


def _draw(ax, points, colour):
    """Rods from the centroid, the first point, to the others."""
    ax.plot(*points.T, "o", color=colour, markersize=3)
    for point in points[1:]:
        ax.plot(*np.array([points[0], point]).T, color=colour, linewidth=1.8)


def _label(ax, value, motion):
    frequency, ratio = abs(value) / (2.0 * np.pi), -value.real / abs(value) if value else 0.0
    ax.set_title(f"{frequency:.4g} Hz, damping ratio {ratio:.3g}\n{motion}", fontsize=10)
    ax.set(xlabel="x (m)", ylabel="y (m)", zlabel="z (m)")
    ax.set_aspect("equal", adjustable="datalim")
