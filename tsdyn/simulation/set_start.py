"""`scene.set_start`: a state as the start of a scene, or the velocity of the scene as a whole."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..calls import fitting
from ..elements.bodies import rotation_matrix, transform_g
from ..errors import InvalidArgument
from ..model.handles import counts, handles_of
from ..observables.state import remembered
from ..runs.arguments import state_arrays
from ..validation import number, vector3
from .analyses import INITIAL_TOL
from .scene_cache import prepared

if TYPE_CHECKING:
    from ..hints import ArrayLike, Equilibrium, Scene, Solution, State


@fitting
def set_start(
    scene: Scene,
    state: State | Equilibrium | Solution | None = None,
    *,
    velocity: ArrayLike | None = None,
    angular_velocity: ArrayLike | None = None,
) -> None:
    """Set the positions and velocities of all bodies at the start: those of a state, or of a rigid motion.

    Parameters
    ----------
    state : State, Equilibrium or Solution, optional
        Positions and velocities, and the turns that the joints have made: of `solution.state`, `solution.at(t)`, an
        equilibrium, or the end of a run. By default the positions remain.
    velocity : array_like (3,), m/s, optional
        Of the centre of mass of the scene, ground frame. With it, or with angular_velocity, all bodies move as one
        rigid body, and velocities of the state are replaced; the one that isn't given is zero.
    angular_velocity : array_like (3,), rad/s, optional
        Of the scene about its centre of mass, ground frame.

    Raises
    ------
    InvalidArgument
        If nothing is given, the state is not of this scene, or a number is not finite.
    InconsistentState
        If a constraint doesn't admit the positions, at the time of the state, or the velocities; a hinge on the ground,
        for instance, the velocity of the whole. The scene is unchanged.

    Notes
    -----
    Constraints are satisfied to rounding, by the smallest correction, of residuals up to 1e-9. Motions of time are
    those at the time of the state, or t = 0: a run begins there. What forces remember otherwise than by turns, such as
    the load since the last sampling time, is not part of a start; `simulate(..., state=state)` goes on with it.

    Examples
    --------
    A dumbbell hangs at rest, is let go, and is thrown:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> one = scene.add_point_mass(mass=1.0, position=(-1, 0, 0), name="one")
    >>> two = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="two")
    >>> rod = scene.add(ts.constraints.Distance(one, two, name="rod"))
    >>> scene.set_start(velocity=(3, 0, 5), angular_velocity=(0, 2, 0))
    >>> print(one.velocity, two.velocity)
    [3. 0. 7.] [3. 0. 3.]
    >>> scene.set_start(ts.simulate(scene, (0, 1)))
    >>> print(((one.position + two.position) / 2).round(6) + 0.0)
    [3. 0. 0.]
    """
    if state is None and velocity is None and angular_velocity is None:
        raise InvalidArgument("set_start: nothing is given; give a state, velocity= or angular_velocity=.")
    kept = prepared(scene)
    state = getattr(state, "state", state)
    q, qd = scene._initial() if state is None else state_arrays(state, kept.n)
    t = 0.0 if state is None else number(getattr(state, "t", 0.0))
    memory = remembered(state, kept, t, q)
    if velocity is not None or angular_velocity is not None:
        given = {"velocity (m/s)": velocity, "angular_velocity (rad/s)": angular_velocity}
        V, Omega = (
            np.zeros(3) if value is None else vector3(value, f"set_start: {what}", InvalidArgument)
            for what, value in given.items()
        )
        qd = _rigid(kept.packed.system, q, V, Omega)
    q, qd = kept.start(scene, (q, qd), t, INITIAL_TOL, memory, True)
    scene.place(q.copy(), qd.copy())
    if state is None:
        return
    scene.touch()  # makes the scene's own joints of a scene with other parameters
    for row in handles_of(scene.packed).rows:
        if row.angles and not counts(row.item):
            row.item.__dict__["angle_near"] = tuple(memory[row.first : row.first + len(row.angles)].tolist())
    scene.touch()


def _rigid(system, q, V, Omega):
    """Velocities qd (n,) of all bodies as of one: V of the centre of mass, and Omega about it, ground frame."""
    qd, at = np.zeros_like(q), system.bodies[:, 0]
    r = q[at[:, None] + np.arange(3)]
    centre = system.mass @ r / system.mass.sum()
    for first, dimension in system.bodies.tolist():
        qd[first : first + 3] = V + np.cross(Omega, q[first : first + 3] - centre)
        if dimension == 7:
            p = q[first + 3 : first + 7]
            qd[first + 3 : first + 7] = 0.5 * transform_g(p).T @ (rotation_matrix(p).T @ Omega)
    return qd
