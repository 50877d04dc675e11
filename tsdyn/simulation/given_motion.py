"""Motions that are given, as solutions: `scene.kinematics` and `scene.inverse_dynamics`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NoReturn, Self

import numpy as np

from ..analyses.tolerances import CONSISTENT
from ..calls import fitting, fitting_methods
from ..configuration.tolerances import INITIAL_TOL
from ..drawing import Drawn, new_figure
from ..elements.force import Force
from ..errors import InvalidArgument, Status
from ..formulations.registry import FORMULATIONS
from ..integrators import DOP853
from ..jit.compiled import clock
from ..maths.tolerances import NEGLIGIBLE
from ..model.handles import has_rates
from ..observables import diagnostics, reactions
from ..observables.reactions import acted
from ..observables.state import remembered
from ..runs.run_log import NAMES, RunEnd
from ..runs.step_engine import StepEngine
from ..runs.task import Outcome, Task, state_arrays
from ..validation import counted, finite_times, floats, unknown_name
from .phase_scenes import has_contacts, phase_of
from .scene_cache import prepared
from .segments import run_segments
from .solution import Solution
from .termination import silent, suspect

if TYPE_CHECKING:
    from ..hints import ArrayLike, BodyLike, Floats, GivenMotions, ItemLike, Scene, State


@fitting_methods
class GivenMotion(Solution):
    """A `Solution` whose motion follows from constraints alone, or was given."""

    _method = ""  # what it is the result of

    def __init__(self, scene: Scene, wanted: int, kept: Any, followed: Any, message: str = "") -> None:
        _turn_frictions(scene, kept, followed)
        span = (float(followed.rows[0, 0]), followed.reached) if len(followed.rows) else (followed.reached,) * 2
        form = SimpleNamespace(name="constraints alone")
        task = SimpleNamespace(prepared=kept, method=None, form=form, span=span, q=followed.last[0])
        counts = dict.fromkeys(NAMES, 0) | {
            name: getattr(followed, name) for name in ("steps", "rejected", "factorizations", "newton_iterations")
        }
        end = RunEnd(followed.reached, followed.last, followed.remembered, counts, None, None)
        outcome = Outcome(followed.status, "", followed.rows, end, None, None, 0.0)
        super().__init__(scene, task, outcome, {"prepare": 0.0, "run": followed.seconds})
        self._method, self._message = type(self)._method, message or _account(self, scene, wanted)

    def at(self, t: ArrayLike) -> NoReturn:
        """Refused: there are no interpolants; ask for the times."""
        raise InvalidArgument(f"a result of {self._method} has no interpolants: ask for these times in the call.")

    def _integrated(self, part):
        raise InvalidArgument(
            f"work is integrated over dense output, and a result of {self._method} has none: integrate `.power` or "
            "`.power_of(item)` over its times, by scipy.integrate.simpson for example."
        )

    def _facts(self):
        s = self.stats
        facts = {"ended": f"{self.status.name.lower()} at t = {self._reached:g} s, {counted(self.t.size, 'output')}"}
        if s.steps:
            facts["steps"] = f"{s.steps}, {s.rejected} rejected, {counted(s.newton_iterations, 'Newton sweep')}"
        return facts | {"time": f"{s.seconds['run']:.3g} s"}

    def __str__(self) -> str:
        lines = [f"  {name:{max(map(len, self._facts()))}}  {fact}" for name, fact in self._facts().items()]
        return "\n".join([type(self).__name__, *lines, *([] if self.success else ["  " + self.message])])

    def _repr_html_(self) -> str:
        return super()._repr_html_().replace("Solution", type(self).__name__, 1)

    def __repr__(self) -> str:
        status, outputs = self.status.name.lower(), counted(self.t.size, "output")
        return f"<{type(self).__name__}: {status} at t = {self._reached:g} s: {outputs}{self._more()}>"

    def _more(self):
        return ""


def _turn_frictions(scene, kept, followed):
    """Write the directions in which frictions of the exact law slide into what a motion remembers."""
    if any(getattr(force, "slides", ()) for force in scene._forces):
        from ..analyses.frictions import Frictions

        frictions, rows, count = Frictions(scene), followed.rows, kept.handles.count
        levels = rows[:, 1 : 1 + 3 * kept.n].reshape(-1, 3, kept.n)
        frictions.turn(rows[:, 0], levels, rows[:, 1 + 3 * kept.n + count :])
        frictions.turn(np.array([followed.reached]), followed.last[None], followed.remembered[None, count:])


def follow(scene, times, state, who, remedy):
    """Follow the branch of a scene without freedom to times (k,); its `Prepared`, and how far it came, a `Followed`."""
    from ..analyses.kinematic_analysis import (  # imported here: a run needs none of it
        analyse,
        demand_driven,
        driven_rates,
    )

    scene = phase_of(scene, []) if has_contacts(scene) else scene  # a copy, with friction of the exact law
    kept = prepared(scene)
    given = scene._initial() if state is None else state_arrays(state, kept.n)
    t0 = _start_time(kept, given[0], times) if state is None else float(state.t)
    every = np.append(times, t0)
    stops = kept.stops(every.min(), every.max())[:, 0]
    memory = remembered(state, kept, t0, given[0])
    _demand_consistent(scene, kept, given[0], t0)
    q, qd = kept.start(scene, (given[0], driven_rates(scene, t0, given[0], who)), t0, INITIAL_TOL, memory, True)
    demand_driven(kept.packed, memory[kept.handles.count :], t0, q.copy(), who, remedy)
    if has_rates(kept.packed):
        return kept, _rolled(kept, times, t0, q.copy(), qd.copy(), memory, who)
    return kept, analyse(kept.packed, t0, q, memory, times, stops)


def _rolled(kept, times, t0, q, qd, memory, who):
    """The motion of a scene without freedom of velocities: with rows on velocities it is integrated, as `Followed`."""
    from ..analyses.kinematic_analysis import Followed

    if not (np.diff(times) > 0.0).all() or not times[0] >= t0:
        raise InvalidArgument(
            f"{who}: t must increase from the start, t = {t0:g} s: with rows on velocities (rolling, knife edges) "
            "positions follow from the motion before."
        )
    span, method, form = (
        (t0, max(float(times[-1]), np.nextafter(t0, np.inf))),
        DOP853(NEGLIGIBLE, NEGLIGIBLE),
        FORMULATIONS["tangent"],
    )
    own = method, form, span, q, qd, memory, times, True, False, None, NEGLIGIBLE, None, 0, silent, False, None
    found = run_segments(Task(kept, *own, kept.stops(*span)), engine=StepEngine)
    end, counts = found.end, (found.end.counts[name] for name in ("steps", "rejected", "newton_iterations"))
    return Followed(found.status, found.rows, end.reached, end.last, end.remembered, *counts, 0, clock() - found.began)


def _demand_consistent(scene, kept, q, t):
    """Refuse positions that violate the constraints, before velocities are solved for."""
    from ..configuration.continuation import Metric
    from ..configuration.motor_starts import demand_small

    demand_small(
        scene,
        Metric(kept.packed, None, t).arrays(q)[0],
        INITIAL_TOL * (1.0 + np.abs(q).max()),
        "position",
        "Phi",
        (t, q),
    )


def _start_time(kept, q, times):
    """t[0] where the poses are consistent then; else 0, or the time nearest to it that data cover."""
    from ..configuration.continuation import Metric

    Phi = Metric(kept.packed, None, float(times[0])).arrays(q)[0]
    if np.abs(Phi).max(initial=0.0) <= INITIAL_TOL * (1.0 + np.abs(q).max()):
        return float(times[0])
    return max((motion.origin for motion in kept.motions if hasattr(motion, "origin")), key=abs, default=0.0)


def _account(solution, scene, wanted):
    """The message of a result."""
    status = solution.status
    if solution.success:
        return f"Every one of {counted(wanted, 'time')} was reached."
    where = f"It stopped at t = {solution.reached:.9g} s, with {solution.t.size} of {counted(wanted, 'time')}."
    if status is Status.INTERRUPTED:
        return f"The analysis was interrupted. {where}"
    found = suspect(solution, scene)
    if found or status in (Status.SINGULAR, Status.CHART_LOST, Status.NEWTON_FAILED):
        remedy = "Beyond it the mechanism has no position, or several: drive another coordinate, or end before it."
        return " ".join(part for part in ("The motion can't be followed any further.", where, found, remedy) if part)
    return f"{status.sentence} {where} {status.remedy}"


# `scene.kinematics`: positions, velocities, accelerations and reactions of a driven scene, without integration.

DRIVE = "Drive them by motors or drivers, such as RotationMotor.of(joint, angle=...), or integrate with ts.simulate."


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
        Times in any order, visited in the order given; increasing ones in a scene with rows on velocities.
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
    Velocities of the start don't matter. With rows on velocities (rolling, knife edges) that leave the velocities no
    freedom, positions follow from the motion before: velocities are integrated, to a tolerance of 1e-12.

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
    from ..analyses.equilibrium import demand_continuous  # imported here: a run needs none of it

    times = finite_times(t, "t")
    demand_continuous(scene.packed)
    return KinematicAnalysis(scene, times.size, *follow(scene, times, state, "kinematics", DRIVE))


# The result of `scene.inverse_dynamics`: loads of actuators beside all that a solution has.


@fitting_methods
class InverseDynamics(Drawn, GivenMotion):
    """What `scene.inverse_dynamics` returns: a `Solution` of the motion, driven by loads of actuators.

    Reactions, multipliers and power are those under these loads. The reaction of a joint that is an actuator is without
    the actuator's load.

    Attributes
    ----------
    actuators : tuple of str
    loads : dict of ndarray (k,), N or N m
        By the names of the actuators; `units` has their units.
    residual : ndarray (k,)
        Largest acceleration that the actuators can't give, over the largest accelerations of the loads.
    """

    _method = "inverse dynamics"

    def __init__(self, scene: Scene, wanted: int, kept: Any, followed: Any, every: Any, message: str = "") -> None:
        from ..analyses.actuator_loads import demand_produced, find_loads  # imported here: a run needs none of it

        super().__init__(scene, wanted, kept, followed, message)
        started = clock()
        found = find_loads(self.packed, self.t, self.q, self.qd, self.qdd, self._remembers, every)
        self.residual: Floats = demand_produced(self, every, found)
        self.actuators: tuple[str, ...] = tuple(one.name for one in every)
        self.units: dict[str, str] = {one.name: one.unit for one in every}
        self.loads: dict[str, Floats] = {one.name: u for one, u in zip(every, found.u.T, strict=True)}
        self._seconds = {"prepare": 0.0, "run": followed.seconds + clock() - started}
        self._every, self.multipliers, self._normals = every, found.multipliers, found.normals

    def __getitem__(self, part: slice) -> Self:
        """Return the result at some of the times, `result[a:b]`."""
        other = super().__getitem__(part)
        other.multipliers, other._normals, other.residual = (
            each[part] for each in (self.multipliers, self._normals, self.residual)
        )
        other.loads = {name: u[part] for name, u in self.loads.items()}
        other._every = [one._replace(loads=one.loads[part]) for one in self._every]
        return other

    @cached_property
    def _memory(self):
        return np.hstack((self._remembers, self._normals))

    def load(self, actuator: ItemLike) -> Floats:
        """Load of an actuator, by handle or name: (k,), N or N m; (k, c) of one with c components or coordinates."""
        values = np.stack([self.loads[one.name] for one in self._of(actuator, True)], axis=1)
        return values[:, 0] if values.shape[1] == 1 else values

    def power_of(self, item: ItemLike) -> Floats:
        """Power (k,), W, supplied by an actuator, or by a constraint or force, as `Solution.power_of`."""
        found = self._of(item)
        own = 0.0 if found and self._replaced(found[0]) else super().power_of(found[0].item if found else item)
        return own + sum((self._gain(one) * one.rate(self.qd) for one in found), np.zeros(self.t.size))

    def reaction(self, item: ItemLike, on: BodyLike | None = None) -> tuple[Floats, Floats]:
        """Force (N) and torque (N m) that a constraint, a joint or a force exerts: (k, 3) each, as of a `Solution`."""
        item = self.handles.item(item)
        load, found = reactions.loads_of(self.packed).get(id(item)), [one for one in self._every if one.item is item]
        if load is None or not found:
            return super().reaction(item, on)
        body = acted(self.packed, item, on)
        at, dimension = self.handles.where(body)
        whole = np.zeros_like(self.q)
        for one in found:
            whole[:, one.columns] += self._gain(one)[:, None] * one.loads
        parts = [reactions.at_first_point(self, body, whole[:, at : at + dimension], item, load.coordinates)]
        if not self._replaced(found[0]):
            parts.append(reactions.force_reaction(self, load, body))
        return tuple(np.sum(each, axis=0) for each in zip(*parts, strict=True))

    @cached_property
    def _force_powers(self):
        replaced = {id(one.item) for one in self._every if self._replaced(one)}
        total = diagnostics.ForcePowers(*np.zeros((3, self.t.size)))
        for load in self.packed.loads:
            if id(load.force) not in replaced:
                parts = diagnostics.load_powers(self.packed, load, self.t, self.q, self.qd, self._memory)
                for sum_, part in zip(total, parts, strict=True):
                    sum_ += part
        for one in self._every:
            total.applied[:] += self._gain(one) * one.rate(self.qd)
        return total

    def _replaced(self, one):
        """Whether the load takes the place of a force's law; a spring keeps its stiffness and damping."""
        return isinstance(one.item, Force) and not hasattr(one.item, "stiffness")

    def _gain(self, one):
        """The load of an actuator, less what the force exerts by itself."""
        load = reactions.loads_of(self.packed).get(id(one.item))
        from ..analyses.actuator_loads import tension_given

        given = 0.0 if load is None or self._replaced(one) else tension_given(load, self.t)
        return self.loads[one.name] - given

    def _of(self, item, required=False):
        """The actuators of a handle or a name; with `required` there is one."""
        name, own = item if isinstance(item, str) else None, self.handles.own(item)
        found = [one for one in self._every if one.item is own or name in (one.name, one.item.name)]
        if not found and required:
            raise unknown_name("actuator", item, self.actuators)
        return found

    def _facts(self):
        facts = super()._facts()
        for name, u in self.loads.items():
            if u.size:
                facts[name] = f"{u.min():.6g} to {u.max():.6g} {self.units[name]}"
        return facts

    def figure(self) -> Any:
        """Loads over time, a panel for each unit; a matplotlib Figure."""
        units = list(dict.fromkeys(self.units.values()))
        with new_figure(6.0, 1.0 + 2.2 * len(units)) as figure:
            for unit, ax in zip(units, np.atleast_1d(figure.subplots(len(units), sharex=True)), strict=True):
                for name, u in self.loads.items():
                    if self.units[name] == unit:
                        ax.plot(self.t, u, label=name)
                ax.set_ylabel("force (N)" if unit == "N" else "torque (N m)")
                ax.legend(frameon=False, fontsize="small")
            ax.set_xlabel("time (s)")
        return figure


# `scene.inverse_dynamics`: forces and torques of actuators that drive a given motion.

WHO = "inverse_dynamics"
GIVE_MOTIONS = "Give their motions, too; or integrate with ts.simulate, and give the Solution as the motion."


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
    and trees. Exact friction is kinetic, against the given motion, by the reactions of this motion; zero where the slip
    rate is zero, as static friction doesn't follow from a motion.

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
    from ..analyses.actuator_loads import actuators_of  # imported here: a run needs none of it
    from ..analyses.equilibrium import demand_continuous

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
    if not every:
        raise InvalidArgument("actuators: give one at least: a force, or a joint with an angle or a displacement.")
    demand_continuous(kept.packed, [one.item for one in every])
    wanted = np.size(given.t) if t is None else np.size(t)
    followed = followed._replace(seconds=clock() - started)
    return InverseDynamics(scene, wanted, kept, followed, every, message)


def _of_coordinates(scene, motion, t):
    """A scene's motion by those of some coordinates, and what there is to say of it."""
    from ..analyses.kinematic_analysis import drive, driven_copy, way_to_start

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
    driving, followed = follow(copied, times, state, WHO, GIVE_MOTIONS)
    message = "" if followed.status is Status.SUCCESS else GivenMotion(copied, times.size, driving, followed).message
    return kept, followed, message


def _at_start(scene, copied, way, t):
    """The state at the start of a motion, reached from the poses; None where motors of the scene move meanwhile."""
    if copied.packed.system.rheonomic[0]:
        return None
    for driver in way:
        copied.add(driver)
    kept, found = follow(copied, np.array([0.0, 1.0]), None, WHO, GIVE_MOTIONS)
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
    from ..analyses.kinematic_analysis import demand_consistent, given

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
