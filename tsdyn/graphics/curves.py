"""Figures of a solution: histories, channels, phase portraits, mode shapes."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from ..drawing import BLUE, GREEN, GREY, VERMILION, axes_of, bare, figure_of, largest, save
from ..elements.bodies import rotation_matrix
from ..errors import InvalidArgument, StepFailure
from ..model.kinematics import Anchor
from ..observables.channels import channels_of, values_of
from ..observables.reactions import multipliers
from ..observables.state import RememberingState
from ..observables.tolerances import AT_REST, NO_TORQUE, RESOLVED
from .run_data import intervals, quintic, ranges
from .symbols import attached, joint_points

if TYPE_CHECKING:
    from ..hints import ArrayLike, ItemLike, Linearisation, Sequence, Solution

# Quantities over time: energies, reactions, lengths of steps, condition of charts.

COLOURS = (BLUE, VERMILION, GREEN)
MARKERS = "os^Dv"


@figure_of("kinetic_energy", "potential_energy")
def energy(solution: Solution, ax: Any = None) -> Any:
    """Draw kinetic, potential and total energy over time, J. Arguments and errors as for `constraint_error`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> stone = (scene := ts.Scene()).add_point_mass(mass=1.0)
    >>> from matplotlib.figure import Figure
    >>> axes = ts.plots.energy(ts.simulate(scene, (0, 1)), Figure().subplots())
    >>> axes.get_ylabel()
    'energy (J)'
    """
    ax = axes_of(ax)
    for name, values, colour in (
        ("kinetic", solution.kinetic_energy, BLUE),
        ("potential", solution.potential_energy, GREEN),
        ("total", solution.energy, "black"),
    ):
        ax.plot(solution.t, values, color=colour, linewidth=1.3, label=name)
    return finished(ax, "energy (J)")


@figure_of("reaction")
def reaction(solution: Solution, item: ItemLike, axes: Any = None) -> Any:
    """Draw force (N) and torque (N m) that a constraint, joint or force exerts, in the ground frame, over time.

    Parameters
    ----------
    solution : Solution
    item : constraint, force, or name of one
    axes : sequence of two matplotlib Axes, optional
        Where to draw force and torque; default new axes of pyplot's.

    Returns
    -------
    ndarray (2,) of matplotlib Axes

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    InvalidConstraint
        If the item isn't in the solution's scene.

    Examples
    --------
    >>> import tsdyn as ts
    >>> bob = (scene := ts.Scene()).add_point_mass(mass=1.0, position=(1, 0, 0))
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> from matplotlib.figure import Figure
    >>> force, torque = ts.plots.reaction(ts.simulate(scene, (0, 1)), "rod", Figure().subplots(2))
    >>> force.get_ylabel(), torque.get_ylabel()
    ('force (N)', 'torque (N m)')
    """
    loads = solution.reaction(item)
    axes = np.atleast_1d(axes_of(axes, 2, sharex=True))
    for ax, values, label in zip(axes, loads, ("force (N)", "torque (N m)"), strict=True):
        for i, component in enumerate("xyz"):
            ax.plot(solution.t, values[:, i], color=COLOURS[i], linewidth=1.3, label=component)
        ax.plot(solution.t, np.linalg.norm(values, axis=1), color="black", linewidth=1.0, label="norm")
        finished(ax, label)
    axes[0].set_title(f"{getattr(item, 'name', item)}, on one body, ground frame", loc="left", fontsize=11)
    return axes


@figure_of("steps", "charts")
def steps(solution: Solution, ax: Any = None) -> Any:
    """Draw the length of every step over time, s; rejected steps are crosses. Arguments as for `constraint_error`.

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    InvalidArgument
        If the run kept no histories.

    Examples
    --------
    >>> import tsdyn as ts
    >>> stone = (scene := ts.Scene()).add_point_mass(mass=1.0)
    >>> from matplotlib.figure import Figure
    >>> ts.plots.steps(ts.simulate(scene, (0, 1)), Figure().subplots()).get_ylabel()
    'step (s)'
    """
    history = solution.steps
    ax, taken = axes_of(ax), history.accepted.astype(bool)
    ax.plot(history.t[taken], history.h[taken], ".-", color=BLUE, linewidth=0.8, markersize=3, label="accepted")
    if not taken.all():
        ax.plot(history.t[~taken], history.h[~taken], "x", color=VERMILION, markersize=5, label="rejected")
    ax.set_yscale("log")
    return finished(ax, "step (s)")


@figure_of("steps", "charts")
def charts(solution: Solution, ax: Any = None) -> Any:
    """Draw the condition of every chart at its end, by the reason of the chart. As for `steps`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> bob = (scene := ts.Scene()).add_point_mass(mass=1.0, position=(1, 0, 0))
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground))
    >>> from matplotlib.figure import Figure
    >>> ts.plots.charts(ts.simulate(scene, (0, 1)), Figure().subplots()).get_ylabel()
    'condition of the chart (1)'
    """
    history = solution.charts
    ax, reasons = axes_of(ax), np.array(history.reason)
    for i, reason in enumerate(dict.fromkeys(history.reason)):
        at = reasons == reason
        look = {"marker": MARKERS[i % len(MARKERS)], "color": (*COLOURS, "black", GREY)[i % 5]}
        ax.plot(history.t[at], history.condition[at], linestyle="", markersize=3, label=f"{reason}: {at.sum()}", **look)
    if (np.nan_to_num(history.condition) > 0.0).any():
        ax.set_yscale("log")
    return finished(ax, "condition of the chart (1)")


@figure_of("phases", "impulses")
def contacts(solution: Solution, ax: Any = None) -> Any:
    """Draw when contacts, stops and ropes are closed, a bar for each, with its impacts; what sticks, in blue.

    Arguments as for `energy`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ball = (scene := ts.Scene()).add_point_mass(mass=1.0, position=(0, 0, 1))
    >>> floor = scene.add(
    ...     ts.constraints.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1), unilateral=True, name="floor")
    ... )
    >>> from matplotlib.figure import Figure
    >>> ax = ts.plots.contacts(ts.simulate(scene, (0, 1)), Figure().subplots())
    >>> [label.get_text() for label in ax.get_yticklabels()]
    ['floor']
    """
    ax, bars, hits = axes_of(ax), {}, {}
    for phase in solution.phases:
        for name in phase.names:
            mine, colour, start = bars.setdefault(name, []), BLUE if name in phase.sticking else GREEN, phase.start
            if mine and mine[-1][1:] == (start, colour):  # it stays as it is
                start, *_ = mine.pop()
            mine.append((start, phase.end, colour))
    for t, name, _ in solution.impulses:
        hits.setdefault(name, []).append(t)
    names = list(dict.fromkeys([*hits, *bars]))
    for i, name in enumerate(names):
        mine = bars.get(name, [])
        spans, colours = [(start, end - start) for start, end, _ in mine], [colour for *_, colour in mine]
        ax.broken_barh(spans, (i - 0.3, 0.6), color=colours or GREEN)
        ax.plot(mine := hits.get(name, []), [i] * len(mine), "|", color=VERMILION, markersize=9)
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(-1.0, max(len(names), 3.0))
    ax.set_xlabel("time (s)")
    ax.set_title("closed (bars; blue: sticks), impacts (ticks)", loc="left", fontsize="small")
    bare(ax)
    return ax


def finished(ax: Any, label: str) -> Any:
    """Label the axes of a quantity over time."""
    ax.set_xlabel("time (s)")
    ax.set_ylabel(label)
    bare(ax)
    if ax.lines:
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False, fontsize="small")
    return ax


# Constraint errors over time.

LEVELS = {"position": ("m", BLUE), "velocity": ("m/s", VERMILION), "acceleration": ("m/s²", GREEN)}


@figure_of("constraint_error")
def constraint_error(solution: Solution, ax: Any = None) -> Any:
    """Draw the constraint errors of a solution over time: position, velocity and acceleration, log scale.

    Of a long run the largest error in each of 400 intervals of time is drawn; zeros are drawn at 1e-17.

    Parameters
    ----------
    solution : Solution
    ax : matplotlib Axes, optional
        Where to draw; default new axes of pyplot's.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.

    Examples
    --------
    The errors of a pendulum, in the axes of a figure made for them:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> from matplotlib.figure import Figure
    >>> figure = Figure()
    >>> axes = ts.plots.constraint_error(ts.simulate(scene, (0, 1)), figure.subplots())
    >>> axes.get_yscale()
    'log'
    """
    ax = axes_of(ax)
    for level, (unit, colour) in LEVELS.items():
        error = getattr(solution.constraint_error, level)
        label = f"{level}\nup to {error.max():.1e} {unit}"
        ax.plot(*largest(solution.t, error), color=colour, linewidth=1.3, label=label)
    ax.set_yscale("log")
    ax.set_xlabel("time (s)")
    ax.set_ylabel("constraint error, maximum norm (m, m/s, m/s²)")
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, fontsize="small", columnspacing=1.2)
    return ax


# `solution.plot()`: constraint errors, energies and steps of a run, and its contacts, or charts where it has none.

SIZE = 11.0, 7.5  # inches


def overview(solution: Solution, path: Any = None) -> Any:
    """What `Solution.plot` does."""
    axes = axes_of(None, 2, 2, figsize=SIZE, sharex=True)
    constraint_error(solution, axes[0, 0])
    energy(solution, axes[0, 1])
    for ax, draw in ((axes[1, 0], steps), (axes[1, 1], charts if solution._phases is None else contacts)):
        try:
            draw(solution, ax)
        except InvalidArgument:  # no histories
            ax.text(0.5, 0.5, "no history kept", color=GREY, ha="center", transform=ax.transAxes)
            ax.set_xlabel("time (s)")
    axes[0, 0].figure.suptitle(f"{solution.method}, formulation {solution.formulation}", x=0.01, ha="left")
    if path is not None:
        save(axes[0, 0].figure, path)
    return axes


# Time histories of channels: "hinge.angle", "arm.position.z" and so on.
#
# A curve has points within each step: of the dense output where the run kept one, else of the quintic with the
# positions, velocities and accelerations of the outputs on both sides. Between outputs that are too far apart for that
# there is no curve; they are dots.

WIDTH, HEIGHT, LABEL = 8.0, 2.2, 26  # of a panel, inches; characters of a line of its label
POINTS, FEWEST = 2000, 3  # of a curve at least, and of each step
MOST = 20_000  # steps that are drawn
AT_ONCE = 1 << 19  # coordinates of states that are evaluated together
INSIDE = 1e-9  # of a step: so near its ends are its first and last points, so that jumps between steps are upright


def time_histories(solution: Solution, names: str | Sequence[str], path: Any = None) -> Any:
    """What `Solution.plot` does with channels, and raises."""
    if not solution.t.size:
        raise InvalidArgument("plot: the solution has no outputs, so there is nothing to show.")
    channels = channels_of(solution.packed, names, solution._lacks)
    times, values, lost = _within_steps(solution, channels) or _between_outputs(solution, channels)
    values[np.isin(intervals(solution.t, times)[0], lost)] = np.nan
    dots = np.unique([lost, lost + 1]) if solution.t.size > 1 else np.zeros(1, int)
    ends = values_of(solution._picked(dots), channels) if dots.size else None
    panels = {}
    for i, channel in enumerate(channels):
        panels.setdefault(channel.unit, []).append(i)
    size = WIDTH, HEIGHT * max(len(panels), 1.5)
    axes = axes_of(None, len(panels), 1, figsize=size, sharex=True, squeeze=False)[:, 0]
    for ax, (unit, some) in zip(axes, panels.items(), strict=True):
        for i in some:
            (line,) = ax.plot(times, values[:, i], linewidth=1.3, label=channels[i].name)
            if ends is not None:
                ax.plot(solution.t[dots], ends[:, i], ".", color=line.get_color(), markersize=4)
        quantities = ", ".join(dict.fromkeys(channels[i].quantity for i in some))
        finished(ax, fill(f"{quantities} ({unit})", LABEL))
        if unit == "N m":
            force = np.nanmax(np.abs(values[:, panels.get("N", [])]), initial=0.0)
            low, high, least = *ax.get_ylim(), NO_TORQUE * force * solution.packed.size
            ax.set_ylim(min(low, -least), max(high, least))
    for ax in axes[:-1]:
        ax.set_xlabel("")
    if path is not None:
        save(axes[0].figure, path)
    return axes


def _times(edges):
    """Times (k,) within the steps between edges."""
    steps = np.column_stack((edges[:-1], edges[1:]))[:: max(len(edges) // MOST, 1)]
    share = np.linspace(INSIDE, 1.0 - INSIDE, max(FEWEST, POINTS // max(len(steps), 1)))
    return (steps[:, :1] + (steps[:, 1:] - steps[:, :1]) * share).ravel()


def _values(ask, times, channels, n):
    """Values (k, channels) at times, of the states that `ask` gives, of n coordinates, some at once."""
    parts = np.array_split(times, max(times.size * n // AT_ONCE, 1))
    return np.concatenate([values_of(ask(part), channels) for part in parts])


def _within_steps(solution, channels):
    """Times and values of the dense output, and no interval without; None where there is no dense output."""
    if solution._trajectory is None or solution.t.size == 1:
        return None
    start, end = solution.t[[0, -1]]
    edges = solution._trajectory.edges
    times = _times(np.unique([start, *edges[(start < edges) & (edges < end)], end]))
    try:
        return times, _values(solution.at, times, channels, solution.q.shape[1]), np.zeros(0, int)
    except StepFailure:  # of a run that ended early, close to its end
        return None


def _between_outputs(solution, channels):
    """Times and values of the quintic, and the intervals between outputs that are too long for it."""
    t, levels = solution.t, (solution.q, solution.qd, solution.qdd)

    def state(times):
        i, _, _ = intervals(t, times)
        q, qd, qdd = quintic(t, levels, times)
        memory = solution._remembers[i]
        lam = np.zeros((times.size, 0)) if solution._lacks else multipliers(solution.packed, times, q, qd, qdd, memory)
        anchor = Anchor(solution.anchor.angles[i], times - t[i], (levels[0][i], levels[1][i]))
        return RememberingState.of(solution.packed, memory, anchor, times, q, qd, qdd, lam)

    times = _times(np.unique(t))
    return times, _values(state, times, channels, levels[0].shape[1]), _unresolved(t, *levels)


def _unresolved(t, q, qd, qdd):
    """Numbers of the intervals where cubic and quintic differ: by a 64th of the sum of these at half the interval."""
    h = np.diff(t)[:, None]
    d, v, w = np.diff(q, axis=0), h * qd[:-1], h * qd[1:]
    ends = h * h * qdd[:-1] - 6.0 * d + 4.0 * v + 2.0 * w, h * h * qdd[1:] + 6.0 * d - 2.0 * v - 4.0 * w
    size = np.maximum(ranges(q), AT_REST * np.abs(q).max(initial=0.0))
    return np.flatnonzero((np.maximum(*map(np.abs, ends)) > 32.0 * RESOLVED * size).any(axis=1))


# Phase portraits and Poincare sections of a joint coordinate.

KINDS = {"angle": "rad", "displacement": "m"}


@figure_of("handles")
def phase_portrait(solution: Solution, joint: ItemLike, ax: Any = None, *, wrap: bool = False) -> Any:
    """Draw the rate of a joint's angle (rad) or displacement (m) over it; the start is a dot.

    Parameters
    ----------
    solution : Solution
    joint : joint, or name of one
        One that has an angle, or else a displacement; of several angles the first.
    ax : matplotlib Axes, optional
        Where to draw; default new axes of pyplot's.
    wrap : bool
        Whether to show angles modulo a turn, from -pi to pi.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    InvalidConstraint
        If the joint has neither, or isn't in the solution's scene.

    Examples
    --------
    >>> import tsdyn as ts
    >>> bar = (scene := ts.Scene()).add_body(**ts.shapes.rod(1.0, axis="x", mass=3.0), position=(0.5, 0, 0))
    >>> hinge = ts.constraints.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge")
    >>> hinge = scene.add(hinge)
    >>> from matplotlib.figure import Figure
    >>> axes = ts.plots.phase_portrait(ts.simulate(scene, (0, 1)), "hinge", Figure().subplots())
    >>> axes.get_xlabel(), axes.get_ylabel()
    ('angle of hinge (rad)', 'rate (rad/s)')
    """
    ax, (x, rate, kind) = axes_of(ax), coordinate_of(solution, joint)
    if wrap and kind == "angle":
        x = wrapped(x)
        jumps = np.flatnonzero(np.abs(np.diff(x)) > np.pi) + 1
        x, rate = np.insert(x, jumps, np.nan), np.insert(rate, jumps, np.nan)
    ax.plot(x, rate, color=BLUE, linewidth=1.0)
    ax.plot(x[:1], rate[:1], "o", color=VERMILION, markersize=4)
    return _labelled(ax, solution, joint, kind)


@figure_of("handles", "at")
def poincare_section(
    solution: Solution, joint: ItemLike, times: ArrayLike, ax: Any = None, *, wrap: bool = True
) -> Any:
    """Draw a joint's angle (rad) or displacement (m) and its rate at some times: a section of the motion.

    Parameters
    ----------
    solution : Solution
        Of a run with dense_output=True.
    times : array_like (k,), s
        The periods of an excitation, such as np.arange(0.0, 500.0, period), or `solution.t_events[i]`, when an event
        was crossed.
    joint, ax, wrap
        As for `phase_portrait`.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    InvalidArgument
        If the run kept no dense output, or a time is outside of it.
    InvalidConstraint
        If the joint has neither, or isn't in the solution's scene.

    Examples
    --------
    >>> import numpy as np
    >>> import tsdyn as ts
    >>> bar = (scene := ts.Scene()).add_body(**ts.shapes.rod(1.0, axis="x", mass=3.0), position=(0.5, 0, 0))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0)))
    >>> from matplotlib.figure import Figure
    >>> solution = ts.simulate(scene, (0, 5), dense_output=True)
    >>> axes = ts.plots.poincare_section(solution, hinge, np.arange(0.0, 5.0, 0.5), Figure().subplots())
    >>> len(axes.lines[0].get_xdata())
    10
    """
    times = np.atleast_1d(np.asarray(times, float))
    if not times.size:
        raise InvalidArgument("poincare_section: times is empty; no event was crossed, or there is no period.")
    ax, (x, rate, kind) = axes_of(ax), coordinate_of(solution.at(times), joint)
    ax.plot(wrapped(x) if wrap and kind == "angle" else x, rate, ".", color=BLUE, markersize=4)
    return _labelled(ax, solution, joint, kind)


def coordinate_of(states: Any, joint: ItemLike) -> tuple[Any, Any, str]:
    """Coordinate and rate (k,) of a joint along a run, and which it is: "angle" or "displacement"."""
    item = states.handles.item(joint)
    kinds = {type(one).__name__.lower() for one in getattr(item, "joint_coordinates", ())}
    kind = "displacement" if kinds == {"displacement"} else "angle"
    x, rate = (getattr(states, name)(item) for name in (kind, f"{kind}_rate"))
    return (x, rate, kind) if x.ndim == 1 else (x[:, 0], rate[:, 0], kind)


def wrapped(angle: Any) -> Any:
    """An angle from -pi to pi."""
    return np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi


def _labelled(ax, solution, joint, kind):
    name, unit = solution.handles.item(joint).name, KINDS[kind]
    ax.set_xlabel(f"{kind} of {name} ({unit})")
    ax.set_ylabel(f"rate ({unit}/s)")
    bare(ax)
    return ax


# Mode shapes: bodies and joints at rest, and displaced by each mode.

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
