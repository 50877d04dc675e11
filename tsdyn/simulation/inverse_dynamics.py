"""`scene.inverse_dynamics`: forces and torques of actuators that drive a given motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting
from ..errors import InvalidArgument, Status
from ..jit.compiled import clock
from ..validation import finite_times, floats
from .given_motion import GivenMotion, follow
from .inverse_result import InverseDynamics
from .scene_cache import prepared

if TYPE_CHECKING:
    from ..hints import ArrayLike, GivenMotions, Scene

WHO = "inverse_dynamics"
CONSISTENT = 1e-6  # of residuals of a given motion
REMEDY = "Give their motions, too; or integrate with ts.simulate, and give the Solution as the motion."


@fitting
def inverse_dynamics(
    scene: Scene, motion: GivenMotions, actuators: Sequence[Any], t: ArrayLike | None = None
) -> InverseDynamics:
    """Find the forces and torques of actuators that drive a given motion, in trees and in closed loops.

    Parameters
    ----------
    motion : dict, Solution or State
        A dict has coordinates and their motions: joints with one coordinate, names of coordinates ("pin.angle",
        "slide.displacement", "ball.x"), with a motion each, as `length=` and `value=` take one; bodies and pairs (body,
        point in the body frame), with a path of three. The others must follow from the constraints. A Solution or a
        State has t, q, qd and qdd, and so may any other object.
    actuators : sequence of handles or names
        As inputs of `scene.linearise`: JointTorque, JointForce (the load, N m or N); PointForce, Torque (components in
        their frame, "push.x" for one); Spring (tension of its actuator); joints (torque or force along their
        coordinates). Their present laws don't count.
    t : array_like (k,), s
        Times, with a dict; with a solution that keeps dense output, times other than its own.

    Returns
    -------
    InverseDynamics
        `.loads` by the names of the actuators, `.units`, `.power_of(actuator)`, and all that a `Solution` has: q, qd,
        qdd, reactions, energies.

    Raises
    ------
    InvalidArgument
        If the actuators can't produce the motion, degrees of freedom are left, or an argument is not of this scene.
    InconsistentState
        If the motion violates constraints.
    SingularConfiguration
        If Phi_q loses rank at an instant.
    InvalidForce
        If a load, other than an actuator, is sampled.

    Notes
    -----
    The motion of coordinates is made a motion of the scene by `scene.kinematics`: the branch is that of the bodies'
    poses, which are moved to the start of the motion first. Loads solve M qdd + Phi_q^T lam = Q_A + Q_v + B u; where
    they aren't unique, the sum of their squares is the least, in SI units. The cost of an instant is O(N) for chains
    and trees.

    Examples
    --------
    The torque that swings a rod of 1 m by sin(2 t):

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -9.0))
    >>> rod = scene.add_body(**ts.shapes.rod(1.0, axis="z", mass=3.0), position=(0, 0, -0.5), name="rod")
    >>> pin = scene.add(ts.constraints.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 1, 0), name="pin"))
    >>> found = scene.inverse_dynamics({pin: ts.motions.Sine(1.0, 2.0)}, [pin], t=[0.0, 0.5])
    >>> print(found.loads["pin.angle"].round(3), found.units["pin.angle"])
    [0.  6.7] N m
    """
    from ..inverse.actuators import actuators_of  # imported here: a run needs none of it
    from ..statics.smoothness import demand_continuous

    started = clock()
    given = motion if hasattr(motion, "qdd") else None
    message = ""
    if given is not None:
        kept, followed = _of_state(scene, given, t)
    else:
        kept, followed, message = _of_coordinates(scene, motion, t)
    rows, n = followed.rows, kept.n
    if len(rows):
        start, angles = rows[0, 1 : 1 + n].copy(), kept.handles.count
        memory = rows[0, 1 + 3 * n : 1 + 3 * n + angles + kept.packed.system.memory.size].copy()
        kept.start(scene, (start, rows[0, 1 + n : 1 + 2 * n].copy()), float(rows[0, 0]), CONSISTENT, memory, True)
    every = actuators_of(scene, kept.handles, actuators, rows[:, 1 : 1 + n].copy())
    demand_continuous(kept.packed, [one.item for one in every])
    wanted = np.size(given.t) if t is None else np.size(t)
    followed = followed._replace(seconds=clock() - started)
    return InverseDynamics(scene, wanted, kept, followed, every, message)


def _of_coordinates(scene, motion, t):
    """A scene's motion by those of some coordinates, and what there is to say of it."""
    from ..inverse.drivers import drive, driven_copy, way_to_start

    copied, driven = driven_copy(scene, motion)
    if t is None:
        raise InvalidArgument(f"{WHO}: give the times of the motion, t=np.linspace(0, 1, 101) for one.")
    times = finite_times(t, f"{WHO}: t")
    kept = prepared(scene)
    way, state = way_to_start(copied, driven, float(times[0])), None
    if way is not None:
        state = _at_start(scene, copied, way, float(times[0]))
    drive(copied, driven)
    if way is not None and state is None:
        copied.assemble(t=float(times[0]))
    driving, followed = follow(copied, times, state, WHO, REMEDY)
    message = "" if followed.status is Status.SUCCESS else GivenMotion(copied, times.size, driving, followed).message
    return kept, followed, message


def _at_start(scene, copied, way, t):
    """The state at the start of a motion, reached from the poses; None where motors of the scene move meanwhile."""
    if copied.packed.system.rheonomic[0]:
        return None
    for driver in way:
        copied.add(driver)
    kept, found = follow(copied, np.array([0.0, 1.0]), None, WHO, REMEDY)
    if found.status is not Status.SUCCESS:
        raise InvalidArgument(
            f"{WHO}: the scene can't be moved from its poses to the start of the motion: {found.reached:.0%} of the "
            "way is possible. Place the bodies nearer to it, by scene.set or scene.assemble."
        )
    state = GivenMotion(copied, 2, kept, found).state
    for driver in way:
        copied.remove(driver)
    return state._replace(t=t)


def _of_state(scene, motion, t):
    """A motion that has t, q, qd and qdd; checked."""
    from ..inverse.analysis import given
    from ..inverse.freedom import demand_consistent

    if t is not None:
        if not hasattr(motion, "at"):
            raise InvalidArgument(f"{WHO}: t goes with a dict of motions, or with a Solution; this motion has its own.")
        motion = motion.at(np.atleast_1d(t))
    kept = prepared(scene)
    times = finite_times(motion.t, f"{WHO}: motion.t")
    arrays = []
    for name in ("q", "qd", "qdd"):
        array = np.atleast_2d(floats(getattr(motion, name, None)))
        if array.shape != (times.size, kept.n) or not np.isfinite(array).all():
            raise InvalidArgument(
                f"{WHO}: motion.{name} must be finite numbers of shape ({times.size}, {kept.n}), a row for each time "
                f"and a column for each coordinate of this scene; it has {np.shape(getattr(motion, name, None))}."
            )
        arrays.append(array)
    demand_consistent(scene, kept.packed, times, *arrays)
    return kept, given(kept.packed, times, arrays, motion)
