"""`scene.kinematics`: positions, velocities, accelerations and reactions of a driven scene, without integration."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..calls import fitting
from ..validation import counted, finite_times
from .given_motion import GivenMotion, follow

if TYPE_CHECKING:
    from ..hints import ArrayLike, Scene, State

REMEDY = "Drive them by motors or drivers, such as RotationMotor.of(joint, angle=...), or integrate with ts.simulate."


class KinematicAnalysis(GivenMotion):
    """What `scene.kinematics` returns: a `Solution` whose motion follows from the constraints alone.

    Positions, reactions, power, constraint errors and energies are asked for as of a run. Steps are those between the
    times asked for; there are no charts, events and interpolants.
    """

    _method = "kinematic analysis"

    def _more(self):
        return f", {counted(self.stats.steps, 'step')}"


@fitting
def kinematics(scene: Scene, t: ArrayLike, state: State | None = None) -> KinematicAnalysis:
    """Analyse the motion of a scene without freedom: positions, velocities, accelerations and reactions at times t.

    Parameters
    ----------
    t : array_like (k,), s
        Times in any order; they are visited in the order given.
    state : State, optional
        Configuration to start from, at its time; default: the poses of the bodies, at t[0] if they are consistent then,
        else at t = 0.

    Returns
    -------
    KinematicAnalysis
        A `Solution`: `.position(body)`, `.angle(joint)`, `.reaction(motor)`, `.power_of(motor)` and all others but
        interpolants and events. Partial if a singular position ends the analysis: see `.success` and `.message`.

    Raises
    ------
    InvalidArgument
        If degrees of freedom are left, which are named, or t is not finite.
    InconsistentState
        If the start violates a constraint by more than 1e-9.
    SingularConfiguration
        If Phi_q loses rank at the start.
    InvalidConstraint, InvalidForce
        If a motion has a jump, or wrong derivatives; if a load is sampled.

    Notes
    -----
    Phi(q, t) = 0, Phi_q qd = -Phi_t and Phi_q qdd = -gamma are solved at each time, to rounding. Between the times the
    branch is followed in steps that are predicted from velocities and accelerations, and halved where positions or
    velocities come out far from that: so angles count turns, and the mechanism stays on its branch. Redundant rows are
    dropped as in a run. The cost is O(N) for chains and trees. Driving forces and torques are reactions of the motors.
    Velocities of the start don't matter.

    Examples
    --------
    A crank at 2 rad/s drives a slider; the stroke is between 0.2 and 0.6 m:

    >>> import numpy as np
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, 0))
    >>> crank = scene.add_body(**ts.shapes.rod(0.2, axis="x", mass=1.0), position=(0.1, 0, 0), name="crank")
    >>> rod = scene.add_body(**ts.shapes.rod(0.4, axis="x", mass=2.0), position=(0.4, 0, 0), name="rod")
    >>> slider = scene.add_body(**ts.shapes.box((0.1, 0.1, 0.1), mass=3.0), position=(0.6, 0, 0), name="slider")
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, crank, point=(0, 0, 0), axis=(0, 0, 1)))
    >>> pin = scene.add(ts.constraints.Revolute.at(crank, rod, point=(0.2, 0, 0), axis=(0, 0, 1)))
    >>> end = scene.add(ts.constraints.Revolute.at(rod, slider, point=(0.6, 0, 0), axis=(0, 0, 1)))
    >>> rail = scene.add(ts.constraints.Translational.at(scene.ground, slider, point=(0, 0, 0), axis=(1, 0, 0)))
    >>> motor = scene.add(ts.constraints.RotationMotor.of(hinge, angle=2.0 * ts.motions.time))
    >>> turn = scene.kinematics(np.linspace(0.0, np.pi, 5))
    >>> turn.position(slider)[:, 0].round(4)
    array([0.6   , 0.3464, 0.2   , 0.3464, 0.6   ])
    >>> turn.acceleration(slider)[:, 0].round(3)
    array([-1.2  ,  0.462,  0.4  ,  0.462, -1.2  ])
    """
    from ..statics.smoothness import demand_continuous  # imported here: a run needs none of it

    times = finite_times(t, "t")
    demand_continuous(scene.packed)
    return KinematicAnalysis(scene, times.size, *follow(scene, times, state, "kinematics", REMEDY))
