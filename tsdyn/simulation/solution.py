"""The result of a run: trajectory, termination, statistics, balances, figures and animation."""

from __future__ import annotations

import time
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from ..calls import fitting, fitting_methods
from ..drawing import html_table
from ..errors import InvalidArgument, InvalidForce, Status, StepFailure
from ..formulations.charts import REASONS
from ..methods.integrator import is_plain
from ..model.kinematics import Anchor, Kinematics
from ..observables import diagnostics, reactions
from ..observables.generalised_forces import law_values
from ..observables.reactions import acted, exerted, member, with_normal_loads
from ..observables.state import RememberingState
from ..validation import counted, floats
from .balances import Balances, by_phase, energy_error, gathered
from .records import Records
from .stored_runs import RunOutputs
from .termination import account, cause_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from ..hints import ArrayLike, BodyLike, Bools, ConstraintError, Floats, Integers, ItemLike, Scene
    from .phases import RunPhase


# What shows a run: an animation, and figures.


@fitting_methods
class Showing:
    """Mixed into `Solution`; what draws is loaded when it is asked for."""

    def view(
        self,
        path: str | Path | None = None,
        *,
        shapes: Mapping[Any, Any] | None = None,
        trails: Sequence[Any] | None = None,
        camera: ArrayLike | None = None,
        follow: BodyLike | None = None,
    ) -> Any:
        """Show the run as an interactive 3-D animation: one HTML page, which works offline; or as a GIF.

        Parameters
        ----------
        path : str or Path, optional
            The file to write, of suffix .html if it has none; .gif writes a GIF. By default a notebook shows the page
            inline; elsewhere it is written to a temporary file, which the web browser opens.
        shapes : dict, optional
            Body, ground or name -> what to draw for it: one of `ts.shapes` (`Box`, `Sphere`, `Cylinder`, `Capsule`,
            `Mesh`, or a shape with mass) or a list of them, in the frame of the body; an empty list draws nothing.
            Other bodies are drawn by `body.shape`, or as the uniform solid with their inertia, and rods to their
            joints.
        trails : sequence, optional
            Whose ways are shown: bodies, for their centroids, or pairs (body, point), point (3,) in the body frame, m.
            By default the centroids of up to eight bodies.
        camera : array_like (3,) or (2, 3), optional
            Direction from the mechanism to the camera, ground frame; or the camera's place and the point that it looks
            at, m. With a direction, the distance is fitted to the mechanism.
        follow : Body or str, optional
            The body that the camera goes with. By default it goes with the mechanism where that travels far.

        Returns
        -------
        Path, or View in a notebook

        Raises
        ------
        InvalidArgument
            If there are no outputs, a shape, trail or camera is none, or the file can't be written.
        MissingDependency
            If matplotlib is not installed, which draws GIFs.
        InvalidBody
            If a key of shapes, or what should leave a trail, is not a body of this solution's scene.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> import tsdyn as ts
        >>> bob = (scene := ts.Scene()).add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
        >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
        >>> solution = ts.simulate(scene, (0, 2))
        >>> with TemporaryDirectory() as folder:
        ...     page = solution.view(Path(folder) / "pendulum", shapes={"bob": ts.shapes.Sphere(0.1, colour="red")})
        ...     print(page.name)
        pendulum.html
        """
        from ..graphics.run_data import run_data
        from ..graphics.view import show

        return show(run_data(self, shapes=shapes, trails=trails, camera=camera, follow=follow), path)

    def plot(self, channels: str | Sequence[str] | Path | None = None, path: str | Path | None = None) -> Any:
        """Draw time histories of channels, such as "hinge.angle"; without any, an overview of the run.

        Parameters
        ----------
        channels : str or sequence of str, optional
            Names of channels, see below. By default constraint errors, energies, steps and charts are drawn; of a run
            with contacts, when they are closed in place of charts.
        path : str or Path, optional
            A file to write the figure to, in the format of its suffix. A lone text that ends like a file of a picture,
            such as "run.png", is a path.

        Returns
        -------
        ndarray (panels,) of matplotlib Axes
            A panel for each unit; of the overview (2, 2).

        Raises
        ------
        MissingDependency
            If matplotlib is not installed.
        InvalidArgument
            If a name is that of no channel, or the file can't be written.
        StorageError
            If a channel needs parts of the scene that the solution of a file lacks.

        Notes
        -----
        A channel is a quantity of an object, and of a vector a component, after dots:

        - body: position, velocity, acceleration (ground frame), angular_velocity, angular_acceleration (body frame),
          each with x, y, z; orientation, with e0 to e3;
        - joint, motor, spring of a joint: angle or displacement, rate, acceleration; of a joint with both, angle_rate
          and so on; of several angles "angle 1" and "angle 2";
        - constraint, joint, force: force and torque, each with x, y, z, as of `reaction`; where there is one joint
          coordinate, torque.axis or force.axis, which is the load along it, on b from a;
        - Spring, Distance: length and tension, positive where it pulls;
        - Control: actuation, one for each actuator by its name, "regulator.actuation.rail".

        A vector without component stands for all of them. An object alone stands for position, velocity and angular
        velocity of a body, coordinates with rates, force and torque of a joint, length and tension of a spring,
        actuations of a Control.

        Curves are smooth within steps: from dense output, where the run kept it, else from the quintic through
        positions, velocities and accelerations of the outputs, which is not exact, and rounds off jumps of loads.
        Outputs that are too far apart for it are drawn as dots.

        Examples
        --------
        >>> import matplotlib
        >>> import tsdyn as ts
        >>> matplotlib.use("agg")
        >>> scene = ts.Scene()
        >>> bar = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=3.0), position=(0.5, 0, 0), name="bar")
        >>> hinge = ts.constraints.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge")
        >>> hinge = scene.add(hinge)
        >>> axes = ts.simulate(scene, (0, 1), dense_output=True).plot(["hinge.angle", "bar.position.z"])
        >>> [ax.get_ylabel() for ax in axes]
        ['angle (rad)', 'position (m)']
        """
        from ..drawing import is_picture

        if path is None and is_picture(channels):
            channels, path = None, channels
        if channels is None:
            from ..graphics.curves import overview

            return overview(self, path)
        from ..graphics.curves import time_histories

        return time_histories(self, channels, path)


# The result of a run: trajectory, termination, statistics and derived quantities.

SUCCESSES = Status.SUCCESS, Status.EVENT


class Steps(NamedTuple):
    """Every attempted step: its start, s, its length, s, and whether it was accepted."""

    t: Floats
    h: Floats
    accepted: Bools


class Charts(NamedTuple):
    """Every chart: its time, s, its reason, and condition, contraction and number of steps at its end."""

    t: Floats
    reason: tuple[str, ...]
    condition: Floats
    contraction: Floats
    steps: Integers


@fitting_methods
class Solution(RunOutputs, Balances, Records, Showing, Kinematics["Floats"]):
    """The result of `simulate`; k outputs, n coordinates, m constraint rows.

    Attributes
    ----------
    t : ndarray (k,), s
    q, qd, qdd : ndarray (k, n)
        7 coordinates a rigid body (r, then p) and 3 a point mass, in the order added.
    multipliers : ndarray (k, m)
        M qdd + Phi_q^T lam = Q_A + Q_v; rows in the order added, then the normalisations in body order. NaN for rows
        that were dropped as redundant, see `reaction_unique`.
    success : bool
        Whether the run reached the end of the interval, or a terminal event.
    status : Status
    message : str
        What happened, where, and the remedy.
    t_events : list of ndarray (k_i,), s, or None
        Times of each event; q_events and qd_events are lists of (k_i, n).
    stats : SimpleNamespace
        steps, rejected, evaluations, placements, newton_iterations, b_iterations, charts, factorizations, seconds; for
        implicit methods also jacobians, iteration_matrices, stage_iterations; stiff: whether an explicit adaptive
        method was limited by stability. Skipped work: solves_skipped, position solves that start at rounding;
        checks_skipped, checks after a correction known to suffice; factorizations_skipped, where older factors still
        serve; gyroscopic_skipped, gyroscopic torques of bodies with spherical inertia, rotations_skipped, rotations of
        bodies with locked orientation, and forces_skipped, forces of scenes without any, each counted once an
        evaluation; columns_skipped, series of constant columns, counted once an order. For Taylor runs near singular
        configurations: steps_near_singular; largest_landing, the largest displacement (m, rad) of a body by the
        projection at the end of such a step; energy_error, the largest change of energy relative to the largest
        kinetic energy, None where energy isn't constant.

    Examples
    --------
    >>> import tsdyn as ts
    >>> bob = (scene := ts.Scene(gravity=(0, 0, -10))).add_point_mass(mass=1.0, position=(1, 0, 0))
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> solution = ts.simulate(scene, (0, 1), dense_output=True)
    >>> solution.success, solution.message
    (True, 'The run reached the end of the interval.')
    >>> print(f"z = {solution.at(0.5).position(bob)[2]:.6f} m, tension {solution.multipliers[-1, 0]:.3f} N")
    z = -0.928200 m, tension 4.450 N
    """

    status: Status
    t_events: list[Floats] | Any  # None without events
    q_events: list[Floats] | Any
    qd_events: list[Floats] | Any
    _made_by = "ts.simulate(scene, t_span), or read one by ts.load(path)"

    @fitting
    def __init__(self, scene: Scene, task: Any, outcome: Any, seconds: dict[str, float], goes_on: str = "") -> None:
        self.scene, self.packed = scene, task.prepared.packed
        self.formulation, self.span = task.form.name, task.span
        self._method, self._turned = task.method if is_plain(task.method) else repr(task.method), outcome.method
        self.system = self.packed.system
        self.status, self._trajectory = outcome.status, outcome.trajectory
        self.t_events, self.q_events, self.qd_events = outcome.events or (None, None, None)
        self.handles = task.prepared.handles
        self._phases = outcome.phases
        self._take(outcome.rows, task.q.size)
        self._seconds, self._energy_error, self._end = seconds, None, outcome.end
        if outcome.end.near_steps and self._phases is None:
            self._energy_error = energy_error(self, task)
        redundant = self.packed.derived.redundant
        self._redundant = 0 if redundant is None else len(redundant)
        self._reason, self._message, self._made = outcome.reason, None, time.time()
        if outcome.status not in SUCCESSES:
            self._message = account(self, scene, self._reason, goes_on)  # written now, since the scene may change

    def __setstate__(self, state):
        """Restore a pickled solution; the packed scene finds its kernels again."""
        self.__dict__.update(state, system=state["packed"].system)

    @property
    def _lacks(self):
        """What is to be passed before the scene can be run; "" but for an `Outline`."""
        return self.scene._lacks

    @property
    def method(self) -> str:
        """The method with its settings; the methods of a run that turned, that of most of the motion first."""
        return self._turned or (self._method if isinstance(self._method, str) else repr(self._method))

    @cached_property
    def stats(self) -> SimpleNamespace:
        """Counts of the run, see `Solution`."""
        return SimpleNamespace(**self._counts, seconds=self._seconds, energy_error=self._energy_error)

    @property
    def message(self) -> str:
        """What happened, where, and the remedy."""
        if self._message is None:
            self._message = account(self, self.scene, self._reason)
        return self._message

    @property
    def success(self) -> bool:
        """True if the run reached the end of the interval, or a terminal event."""
        return self.status in SUCCESSES

    def raise_if_failed(self) -> Self:
        """Raise StepFailure, with this solution as `.solution`, if the run ended early; return self otherwise."""
        if not self.success:
            raise StepFailure(self.message, self) from cause_of(self)
        return self

    @property
    def reached(self) -> float:
        """The time reached by the run, s."""
        return self._reached

    @property
    def state(self) -> RememberingState:
        """The last state reached, to continue from: simulate(scene, (state.t, t_end), state=state)."""
        q, qd, qdd = (a.copy() for a in self._last)
        t, memory = np.array([self._reached]), self._remembered[None]
        lam = self._multipliers_at(t, q[None], qd[None], qdd[None], memory)[0]
        remembered = self.packed, self._remembered.copy(), Anchor(self._angles)
        return self._in_phase(RememberingState.of(*remembered, self._reached, q, qd, qdd, lam))

    def at(self, t: ArrayLike) -> RememberingState:
        """Return the state at any time of a run with dense_output=True, on the constraint manifold.

        Parameters
        ----------
        t : float or array_like (k,), s
            Between the start and the time reached, in any order.

        Returns
        -------
        State
            t, q (n,), qd, qdd and multipliers (m,), with a leading dimension (k,) for a vector of times. Between steps
            they are of the interpolant's order, at the ends of steps those of the steps, to rounding.

        Raises
        ------
        InvalidArgument
            If the run kept no dense output, or t isn't finite, one time or a vector of them, or is outside the run.
        StepFailure
            If the constraints can't be solved there.

        Examples
        --------
        >>> import tsdyn as ts
        >>> scene = ts.Scene(gravity=(0, 0, -10))
        >>> stone = scene.add_point_mass(mass=1.0)
        >>> solution = ts.simulate(scene, (0, 1), dense_output=True)
        >>> print(solution.at([0.25, 0.75]).position(stone)[:, 2])
        [-0.3125 -2.8125]
        """
        if self._trajectory is None:
            raise InvalidArgument("at(t) needs the steps' interpolants: simulate(..., dense_output=True) keeps them.")
        times, start, end = floats(t), self._trajectory.start, self._trajectory.end
        if times.ndim > 1 or (times.ndim == 1 and np.size(t) != times.size) or not np.isfinite(times).all():
            raise InvalidArgument(f"t must be a finite time in s, or a vector of them, got {t!r}.")
        if times.size and (times.min() < start or times.max() > end):
            raise InvalidArgument(f"t must lie within the run, from {start!r} to {end!r} s, got {t!r}.")
        every = np.atleast_1d(times)
        states, memory, status = self._trajectory(every)
        if status != Status.SUCCESS:
            raise StepFailure(f"no state could be found at some t in {t!r}. {status.sentence} {status.remedy}", self)
        q, qd, qdd = (np.ascontiguousarray(states[:, i]) for i in range(3))
        parts = q, qd, qdd, self._multipliers_at(every, q, qd, qdd, memory)
        anchor = self._anchor_of(every)
        if times.ndim:
            return self._in_phase(RememberingState.of(self.packed, memory, anchor, every, *parts))
        angles, h, levels = anchor
        anchor = Anchor(angles[0], h[0], tuple(level[0] for level in levels))
        parts = (part[0] for part in parts)
        return self._in_phase(RememberingState.of(self.packed, memory[0], anchor, float(times), *parts))

    def _in_phase(self, state):
        """A state, or several, with what actions have changed before."""
        if self._phases is not None:
            state.phase = self._phases.phase_at(state.t)
        return state

    def _anchor_of(self, t):
        """Return the turn counts at times t (k,): those at the starts of their steps."""
        start, angles = self._trajectory.anchors(t)
        if not angles.size:
            return Anchor(angles, np.zeros(t.size))
        starts, back = np.unique(start, return_inverse=True)
        states, _, _ = self._trajectory(starts)
        return Anchor(angles, t - start, (states[back, 0], states[back, 1]))

    @property
    def phases(self) -> list[RunPhase]:
        """The phases of the run: (start, end, names) of each, in s, with names of what holds only in some.

        These are closed contacts, frictions that stick, and those active of the parts that come and go by actions. A
        phase ends, too, where a closed contact begins or ends to stick: `phase.sticking` has the names of those that
        stick. `print(solution.phases)` shows a table.
        """
        if self._phases is None:
            from .phases import PhaseList, RunPhase

            return PhaseList([RunPhase(self.span[0], self.reached, ())])
        return self._phases.merged()

    @property
    def impulses(self) -> list[tuple[float, str, float]]:
        """Time (s), name and impulse of contacts at impacts, of parts that become active, of impulses on bodies.

        N s, or N m s of an angle. Of a contact a float, the normal impulse, whose `tangential` (3,) is the impulse of
        its friction on a, ground frame; negative, about the square root of rounding, where an impact elsewhere lifts
        the contact by less than rounding: it stays closed. Of a constraint of several rows an array (rows,) as of
        `multipliers`, of a body an array (3,) in the ground frame. `print(solution.impulses)` shows a table.
        """
        from .phases import ImpulseList

        return ImpulseList([] if self._phases is None else self._phases.impulses)

    @property
    def steps(self) -> Steps:
        """History of the steps, a `Steps`; raises InvalidArgument if the run kept none."""
        return Steps(*self._kept(self._step_log).arrays())

    @property
    def charts(self) -> Charts:
        """History of the charts, a `Charts`; raises InvalidArgument if the run kept none."""
        t, reasons, condition, contraction, steps = self._kept(self._chart_log).arrays()
        return Charts(t, tuple(REASONS[int(i)] for i in reasons.tolist()), condition, contraction, steps.astype(int))

    @staticmethod
    def _kept(log):
        if log is None:
            raise InvalidArgument("the run kept no histories of steps and charts; history=True keeps them.")
        return log

    @cached_property
    def _memory(self):
        """Memory of forces and normal loads of joint friction, (k, ...)."""
        own = self._before_jumps
        motion = own.t, own.q, own.qd, own.qdd, own._remembers
        return self._with_normal_loads(*motion, self._phase_of_rows)

    def _with_normal_loads(self, t, q, qd, qdd, memory, numbers=None):
        """Memory of forces and normal loads of joint friction, (k, ...), at times of the run."""
        if self._phases is None or not self.system.normals.size:
            return with_normal_loads(self.packed, t, q, qd, qdd, memory)
        numbers = self._phases.at(t) if numbers is None else numbers
        return self._phases.with_normal_loads(numbers, t, q, qd, qdd, memory)

    @cached_property
    def multipliers(self) -> Floats:
        """Multipliers (k, m), computed on first access."""
        own = self._before_jumps
        return self._multipliers_at(own.t, own.q, own.qd, own.qdd, own._memory, self._phase_of_rows)

    def _multipliers_at(self, t, q, qd, qdd, memory, numbers=None):
        """Multipliers (k, m) at times of the run; with contacts in their phases, by number or by time."""
        if self._phases is None:
            return reactions.multipliers(self.packed, t, q, qd, qdd, memory)
        numbers = self._phases.at(t) if numbers is None else numbers
        return self._phases.multipliers(numbers, len(self.system.segments), t, q, qd, qdd, memory)

    def _losses(self):
        """Power (k, contacts), W, that contacts with friction dissipate."""
        own = self._before_jumps
        return self._losses_at(own.t, own.q, own.qd, own.qdd, own._memory, self._phase_of_rows)

    def _losses_at(self, t, q, qd, qdd, memory, numbers=None):
        """The same at times of the run, by number or by time of their phases."""
        if self._phases is None or not self._phases.gaps.rough.any():
            return np.zeros((t.size, 0 if self._phases is None else self._phases.gaps.count))
        numbers = self._phases.at(t) if numbers is None else numbers
        lam = self._multipliers_at(t, q, qd, qdd, memory, numbers)
        return self._phases.losses(numbers, lam, t, q, qd)

    def _losses_of(self, part, losses):
        """The part (k,) of losses (k, contacts) that is of a constraint or force, or of no force of packed scenes."""
        if part is None:  # where packed scenes of phases are asked, friction of contacts is among their forces
            return 0.0 if self._phases is not None and self._phases.varies else losses.sum(axis=1)
        mine = [] if self._phases is None else self._phases.gaps.of_contact(part)
        return losses[:, mine].sum(axis=1)

    @cached_property
    def constraint_error(self) -> ConstraintError:
        """Maximum norms of Eqs. 1-3 at every output, recomputed independently of the solver."""
        motion = self.t, self.q, self.qd, self.qdd, self._memory
        if self._phases is not None:
            return self._phases.constraint_error(self._phase_of_rows, *motion)
        return diagnostics.constraint_error(self.packed, *motion)

    def actuation(self, control: ItemLike) -> Floats:
        """The values (k, actuators) of the function of a Control at the outputs; those held if it has a period.

        Of a PointForce, Torque or UserForce by a function of the scene's state its components. Units are those of the
        actuators: N, N m.

        Raises
        ------
        InvalidForce
            If it is none of these.
        """
        return by_phase(self, lambda part: part._actuation(control))

    def _actuation(self, control):
        item = self.handles.item(control)
        if reactions.is_idle(self.packed, item):
            return np.zeros((self.t.size, len(getattr(item, "actuators", "xyz"))))
        load = reactions.loads_of(self.packed).get(id(item))
        if load is None or load.law is None:
            raise InvalidForce(f"actuation: {control!r} is no Control of this scene, nor a load by the scene's state.")
        return law_values(self, load, self._memory)

    def reaction(self, item: ItemLike, on: BodyLike | None = None) -> tuple[Floats, Floats]:
        """Force (N) and torque (N m) that a constraint, a joint as a whole, or a force exerts: (k, 3) each.

        Parameters
        ----------
        item : constraint, force, or name of one
        on : Body or str, optional
            The body on which force and torque act; by default a, or b if a is the ground (`item.on`).

        Returns
        -------
        force, torque : ndarray (k, 3)
            In the ground frame; the torque is about the item's first point on that body (`point_a`), or the centroid
            where it has none; of rolling and sliding surfaces about the contact point.

        Examples
        --------
        >>> import tsdyn as ts
        >>> shelf = (scene := ts.Scene(gravity=(0, 0, -10))).add_body(mass=2.0, inertia=(1, 1, 1), position=(1, 0, 0))
        >>> bracket = scene.add(ts.constraints.Fixed.at(shelf, scene.ground, point=(0, 0, 0), name="bracket"))
        >>> force, torque = ts.simulate(scene, (0, 1)).reaction("bracket", on=shelf)
        >>> print(force[-1].round(6) + 0.0, torque[-1].round(6) + 0.0)
        [ 0.  0. 20.] [  0. -20.   0.]
        """
        load = reactions.loads_of(self.packed).get(id(self.handles.item(item)))
        ask = gathered if self._phases is not None and load is not None and load.slides else by_phase
        return ask(self, lambda part: exerted(part, item, on), load is None)

    def sticking(self, friction: ItemLike) -> Bools:
        """Whether a friction of the exact law sticks: (k,).

        Of several that hold one coordinate, those whose reaction is at their bound count as sliding, though nothing
        moves: the others stick.

        Parameters
        ----------
        friction : friction or contact, or name of one
            A joint friction or CoulombFriction whose slip velocity is zero, or a unilateral contact with friction,
            which sticks where it is closed and doesn't slip.

        Raises
        ------
        InvalidForce
            If it is none of these.

        Examples
        --------
        A block of 2 kg comes to rest after 0.5 s:

        >>> import tsdyn as ts
        >>> scene = ts.Scene(gravity=(0, 0, 0))
        >>> block = scene.add_point_mass(mass=2.0, velocity=(1, 0, 0))
        >>> brake = scene.add(ts.forces.CoulombFriction(block, scene.ground, force=4.0, name="brake"))
        >>> solution = ts.simulate(scene, (0, 1), t_eval=[0.25, 0.75])
        >>> print(solution.sticking("brake"), [names for _, _, names in solution.phases])
        [False  True] [(), ('brake',)]
        """
        item = self.handles.item(friction)
        mine = [] if self._phases is None else self._phases.gaps.of_contact(item)
        if mine and self._phases.gaps.rough[mine].any():
            return self._phases.sticking(self._phase_of_rows, mine[0])
        load = reactions.loads_of(self.packed).get(id(item))
        if load is None or not load.slides:
            raise InvalidForce(
                f"sticking: {friction!r} is no friction of the exact law: RevoluteFriction, TranslationalFriction, "
                "ContactFriction and CoulombFriction are, with slip_velocity=0, and unilateral contacts with kinetic."
            )
        slot, rests = load.slot + item.memory, np.ones(self.t.size, bool)
        for slide in load.slides:
            rests &= ~self._memory[:, slot : slot + slide.directions].any(axis=1)
            slot += slide.count
        return rests & self._phases.active(item, self._phase_of_rows)

    def contact_point(self, constraint: ItemLike) -> Floats:
        """Where a surface touches that rolls or slides, (k, 3), m, ground frame: its path on the plane.

        Parameters
        ----------
        constraint : RollingDisc, RollingBall, RollingEllipsoid, RollingBallOnCylinder, contact with friction, or name

        Raises
        ------
        InvalidConstraint
            If the constraint has no contact point.

        Examples
        --------
        >>> import tsdyn as ts
        >>> ball = (scene := ts.Scene()).add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(1, 2, 0.5))
        >>> contact = scene.add(ts.constraints.RollingBall(ball, scene.ground, radius=0.5, normal_b=(0, 0, 1)))
        >>> print(ts.simulate(scene, (0, 1)).contact_point(contact)[-1].round(9) + 0.0)
        [1. 2. 0.]
        """
        return by_phase(self, lambda part: reactions.contact_point(part, constraint), True)

    def friction_demand(self, constraint: ItemLike) -> Floats:
        """Tangential over normal force at a contact, (k,): the coefficient of friction that rolling needs at least.

        Infinite where the surfaces would have to pull, zero where they are apart, or where both forces are rounding
        beside those of other contacts. Contacts that share a load in many ways, such as the lateral forces of two
        wheels on one axle, share it with the least sum of squares of their forces. Arguments and errors as of
        `contact_point`.

        Examples
        --------
        A ball needs 2/7 of the friction of a block at rest to roll down a slope of 45 degrees:

        >>> import tsdyn as ts
        >>> ball = (scene := ts.Scene()).add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0, 0, 0.5 * 2**0.5))
        >>> contact = scene.add(ts.constraints.RollingBall(ball, scene.ground, radius=0.5, normal_b=(1, 0, 1)))
        >>> print(f"{ts.simulate(scene, (0, 1)).friction_demand(contact)[-1]:.6f}")
        0.285714
        """
        return by_phase(self, lambda part: reactions.friction_demand(part, constraint), True)

    def reaction_unique(self, item: ItemLike, on: BodyLike | None = None) -> Bools:
        """Return True where `reaction` is unique, at each output: bool (k,).

        Redundant constraints can share their load in many ways without a change of motion; `reaction` is then the
        solution whose multipliers of redundant rows (NaN in `multipliers`) are zero.
        """
        item = self.handles.item(item)
        body = acted(self.packed, item, on)
        if id(item) in reactions.loads_of(self.packed):
            return np.ones(self.t.size, bool)
        return reactions.unique(self, member(self.packed, item).rows, body)

    def rows(self, constraint: ItemLike) -> slice:
        """Return the columns of `multipliers` of a constraint, as a slice."""
        return member(self.packed, self.handles.item(constraint)).rows

    def _facts(self):
        s = self.stats
        sweeps = f", {counted(s.newton_iterations, 'Newton sweep')}" if s.newton_iterations else ""
        if sweeps and s.placements:  # series place none
            sweeps = f", {s.newton_iterations / s.placements:.1f} Newton sweeps a placement"
        known = self._phases
        phases = f"{counted(len(self.phases), 'phase')}, {counted(len(known.impulses), 'impulse')}" if known else ""
        return {
            "ended": f"{self.status.name.lower()} at t = {self._reached:g} s, {counted(self._length(), 'output')}",
            **({"phases": phases} if phases else {}),
            "method": f"{self.method}, formulation {self.formulation}",
            "steps": f"{s.steps}, {s.rejected} rejected, {counted(s.charts, 'chart')}",
            "work": f"{counted(s.evaluations, 'evaluation')}, {counted(s.placements, 'placement')}{sweeps}",
            "time": f"{s.seconds['run']:.3g} s, {s.seconds['prepare']:.2g} s to prepare",
        }

    def __str__(self) -> str:
        lines = [f"  {name:8}{fact}" for name, fact in self._facts().items()]
        return "\n".join(["Solution", *lines, *([] if self.success else ["  " + self.message])])

    def _repr_html_(self) -> str:
        """Return the text as a table, for notebooks."""
        facts = self._facts() | ({} if self.success else {"message": self.message})
        return html_table(facts.items(), "Solution", named=True)

    def __repr__(self) -> str:
        s = self.stats
        return (
            f"<Solution: {self.status.name.lower()} at t = {self._reached:g} s by {self.method}, {self.formulation}: "
            f"{counted(s.steps, 'step')}, {counted(s.evaluations, 'evaluation')}, {counted(s.charts, 'chart')}, "
            f"{s.seconds['run']:.3g} s>"
        )
