"""`scene.kinematics`: positions, velocities, accelerations and reactions of a driven scene, without integration."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from ..calls import fitting, fitting_methods
from ..errors import InvalidArgument, Status
from ..observables.state import remembered
from ..runs.arguments import state_arrays
from ..runs.task import Outcome
from ..validation import counted, finite_times
from .scene_cache import prepared
from .solution import Solution
from .termination import suspect

if TYPE_CHECKING:
    from ..hints import ArrayLike, Floats, Scene, State

INITIAL_TOL = 1e-9  # of residuals of a start, as in `simulate`
REMEDY = "Drive them by motors or drivers, such as RotationMotor.of(joint, angle=...), or integrate with ts.simulate."


@fitting_methods
class KinematicAnalysis(Solution):
    """What `scene.kinematics` returns: a `Solution` whose motion follows from the constraints alone.

    Positions, reactions, power, constraint errors and energies are asked for as of a run. Steps are those between the
    times asked for; there are no charts, events and interpolants.
    """

    def __init__(self, scene: Scene, kept: Any, times: Floats, followed: Any) -> None:
        task = SimpleNamespace(
            prepared=kept,
            method=None,
            form=SimpleNamespace(name="constraints alone"),
            span=(float(times[0]), float(times[-1])),
            q=followed.last[0],
        )
        counts = {name: getattr(followed, name) for name in ("steps", "rejected", "factorizations")}
        counts |= {
            "newton_iterations": followed.newton,
            "charts": 0,
            "evaluations": 0,
            "steps_near_singular": 0,
            "stiff": False,
        }
        outcome = Outcome(
            followed.status, "", followed.rows, None, None, followed.reached, followed.last, followed.remembered,
            counts, None, None, 0.0,
        )  # fmt: skip
        super().__init__(scene, task, outcome, {"run": followed.seconds})
        self._message = _account(self, scene, times.size)

    @property
    def method(self) -> str:
        """Kinematic analysis."""
        return "kinematic analysis"

    def at(self, t: ArrayLike) -> NoReturn:
        """Refused: no interpolants are kept; pass the times to `scene.kinematics`."""
        raise InvalidArgument("a kinematic analysis has the times that were asked for: pass t to scene.kinematics(t).")

    def _facts(self):
        s = self.stats
        return {
            "ended": f"{self.status.name.lower()} at t = {self._reached:g} s, {counted(self.t.size, 'output')}",
            "method": self.method,
            "steps": f"{s.steps}, {s.rejected} rejected, {counted(s.newton_iterations, 'Newton sweep')}",
            "time": f"{s.seconds['run']:.3g} s",
        }

    def __str__(self) -> str:
        return super().__str__().replace("Solution", "KinematicAnalysis", 1)

    def __repr__(self) -> str:
        return (
            f"<KinematicAnalysis: {self.status.name.lower()} at t = {self._reached:g} s: "
            f"{counted(self.t.size, 'output')}, {counted(self.stats.steps, 'step')}>"
        )


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
    from ..inverse.analysis import analyse  # imported here: a run needs none of it
    from ..inverse.freedom import demand_driven, driven_rates
    from ..statics.smoothness import demand_continuous

    times = finite_times(t, "t")
    kept = prepared(scene)
    demand_continuous(kept.packed)
    given = scene._initial() if state is None else state_arrays(state, kept.n)
    t0 = _start_time(kept, given[0], times) if state is None else float(state.t)
    every = np.append(times, t0)
    stops = kept.stops(every.min(), every.max())[:, 0]
    memory = remembered(state, kept, t0, given[0])
    q, _ = kept.start(scene, (given[0], driven_rates(kept.packed, t0, given[0])), t0, INITIAL_TOL, memory, True)
    demand_driven(kept.packed, memory[kept.handles.count :], t0, q.copy(), "kinematics", REMEDY)
    return KinematicAnalysis(scene, kept, times, analyse(kept.packed, t0, q, memory, times, stops))


def _start_time(kept, q, times):
    """t[0] where the poses are consistent then; else 0, or the time nearest to it that data cover."""
    from ..configuration.kinetic_metric import Metric

    Phi = Metric(kept.packed, None, float(times[0])).arrays(q)[0]
    if np.abs(Phi).max(initial=0.0) <= INITIAL_TOL * (1.0 + np.abs(q).max()):
        return float(times[0])
    return max((motion.origin for motion in kept.motions if hasattr(motion, "origin")), key=abs, default=0.0)


def _account(solution, scene, wanted):
    """The message of an analysis."""
    status = solution.status
    if solution.success:
        return f"Kinematic analysis at {counted(wanted, 'time')}."
    where = f"It stopped at t = {solution.reached:.9g} s, with {solution.t.size} of {counted(wanted, 'time')}."
    if status is Status.INTERRUPTED:
        return f"The analysis was interrupted. {where}"
    found = suspect(solution, scene)
    if found or status in (Status.SINGULAR, Status.CHART_LOST, Status.NEWTON_FAILED):
        remedy = "Beyond it the mechanism has no position, or several: drive another coordinate, or end before it."
        return " ".join(part for part in ("The motion can't be followed any further.", where, found, remedy) if part)
    return f"{status.sentence} {where} {status.remedy}"
