"""Runs of scenes with unilateral constraints: phases between events, impacts, openings; `ts.impact`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analyses.contact_problem import Inertia, NoSolution, closed_gaps, impulses, settle
from ..analyses.friction_problem import Frictions, Hold, NoRest, RestProblem, free_motions, immobile, values_of
from ..analyses.tolerances import AT_REST, STOPPED
from ..calls import fitting
from ..elements.force import Force
from ..elements.unilateral import contacts_of
from ..errors import InconsistentState, InvalidArgument, InvalidConstraint, Status, TsdynError
from ..integrators import DOP853
from ..jit.compiled import clock
from ..maths.tolerances import EPS
from ..model.handles import handles_of
from ..model.packed import first_rows
from ..observables import diagnostics, reactions
from ..observables.state import RememberingState, StatePhase, remembered
from ..runs.arguments import interval, output_times, state_arrays
from ..runs.dense_output import StepPieces
from ..runs.events import Event, Member
from ..runs.events import prepare as prepared_events
from ..runs.run_log import ChartLog, RunEnd, StepLog
from ..runs.task import Outcome
from ..validation import floats, listed
from . import hybrid
from .phase_scenes import NAMED, dependent, first_row_of, gaps_of, has_contacts, inactive_of, phase_of
from .progress import reporter, silent
from .run_options import LAWS, RunCall
from .scene_cache import Prepared, prepared
from .segments import summed
from .tolerances import (
    CREEPING,
    ENDLESS,
    EVENTS_JUDGED,
    MOST_AT_AN_INSTANT,
    MOST_PINNED,
    PENETRATION,
    ROUNDED,
    TOUCHING,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..hints import ItemLike, Scene

# A run with contacts is a sequence of phases. A scene has units: gaps, each open or closed. A phase is a run of the
# scene with the units in their modes, the closed gaps as bilateral rows, and ends at the first zero of what a unit
# watches: of an open gap, from above, or of the reaction of a closed one. Then velocities jump by the impulses of an
# impact, where gaps close; those that are closed and at rest stay so as the complementarity problem of accelerations
# says; and the next phase begins. Closed gaps whose rows depend on others, such as that of a fourth leg, are left out
# of the rows: the others hold them.
#
# `Modes` has all that a phase follows from, beside t, q, qd and what the run remembers: a checkpoint needs no more.


class _Closing:
    """The gaps of open contacts, as event functions.

    The gap of a contact that has just opened, with a rate, is divided by the time since: so its next zero is found
    however soon it comes.

    Parameters
    ----------
    gaps : Gaps
    opened : dict
        Of contacts that have opened with a rate: time, gap and rate there, by their numbers.
    """

    def __init__(self, gaps, opened):
        self.gaps = gaps
        self.open(opened)

    def open(self, opened):
        """Take other contacts that have just opened."""
        self.which = list(opened)
        self.start = np.array(list(opened.values())).reshape(-1, 3).T

    def over(self, states):
        """Values (k, count) of states at k times."""
        values = self.gaps.values(states.t, states.q, states.angles if self.gaps.are_counted else None)
        if self.which:
            begun, first, rate = self.start
            since = states.t[:, None] - begun
            later = since > 0.0
            divided = (values[:, self.which] - first) / np.where(later, since, 1.0)
            values[:, self.which] = np.where(later, divided, rate)
        return values


class _Loads:
    """Multipliers and normal loads of a phase, shared by its events."""

    def __init__(self, packed):
        self.packed, self._last = packed, (None, None)

    def at(self, states):
        """Multipliers (k, m), NaN of redundant rows, and normal loads (k, frictions) of one state or of several."""
        t, q, qd, qdd = np.atleast_1d(states.t), *map(np.atleast_2d, (states.q, states.qd, states.qdd))
        key, (last, found) = (t.tobytes(), q.tobytes()), self._last
        if key != last:
            memory = np.tile(states.memory, (t.size, 1))
            wide = reactions.with_normal_loads(self.packed, t, q, qd, qdd, memory)
            found = reactions.multipliers(self.packed, t, q, qd, qdd, wide), wide[:, memory.shape[1] :]
            self._last = key, found
        return found


class _Leaving:
    """The reactions of closed contacts, positive where they push, as event functions.

    Parameters
    ----------
    packed : Packed
        Of the phase.
    rows : list of int
    signs : list of float
        Of the gaps over Phi.
    """

    def __init__(self, packed, rows, signs):
        self.packed, self.rows, self.signs = packed, rows, np.array(signs)

    def over(self, states):
        """Values (k, closed) of states at k times."""
        memory = np.tile(states.memory, (states.t.size, 1))
        lam = reactions.multipliers(self.packed, states.t, states.q, states.qd, states.qdd, memory)
        return -self.signs * lam[:, self.rows]


class _Breaking:
    """What the reactions of frictions that stick are below their bounds, as event functions.

    Parameters
    ----------
    packed : Packed
        Of the phase.
    units : list of friction_problem.Unit
    """

    def __init__(self, packed, units):
        self.packed, self.units = packed, units

    def over(self, states):
        """Values (k, units) of states at k times."""
        memory = np.tile(states.memory, (states.t.size, 1))
        motion = states.t, states.q, states.qd, states.qdd
        wide = reactions.with_normal_loads(self.packed, *motion, memory)
        lam = reactions.particular(reactions.multipliers(self.packed, *motion, wide))
        values = np.zeros((states.t.size, len(self.units)))
        for unit, value in zip(self.units, values.T, strict=True):
            share, bound = unit.bound
            value += bound - np.linalg.norm(lam[:, self.packed.derived.holds[unit.slot]], axis=1)
            if share:
                value += share * wide[:, memory.shape[1] + unit.load.normal]
        return values


class _Slowing:
    """The velocities of frictions that slide, along their directions, as event functions.

    In a plane half of the speed is taken off: where the direction has turned by 60 degrees, it is taken anew. The
    velocity of one that has just begun to slide is divided by the time since.

    Parameters
    ----------
    frictions : Frictions
    which : list of int
    begun : dict
        Of those that have just begun to slide: time and acceleration there, by their numbers.
    """

    def __init__(self, frictions, which, begun):
        self.frictions, self.which, self.begun = frictions, which, begun

    def over(self, states):
        """Values (k, which) of states at k times."""
        values = np.empty((states.t.size, len(self.which)))
        for i, value in zip(self.which, values.T, strict=True):
            value[:] = self.frictions.speed(i, states.q, states.qd, states.memory)
            if i in self.begun:
                begun, first = self.begun[i]
                later = states.t > begun
                value[:] = np.where(later, value / np.where(later, states.t - begun, 1.0), first)
        return values


class Phases:
    """The phases of a run that has ended: when, with which gaps closed, and where their rows are in those of the scene.

    Attributes
    ----------
    list : list of (float, float, tuple of str)
        Start, end (s) and names of the closed contacts.
    impulses : list of (float, str, float)
        Time (s), name, impulse (N s, or N m s of an angle).
    changes : list of (tuple, dict)
        The parts that are inactive in each, and the parameters that have been set before.
    varies : bool
        Whether forces or numbers differ between them, not rows alone.
    """

    def __init__(self):
        self.list, self.impulses, self.starts, self.of = [], [], [], []
        self.packed, self._columns = [], []  # of each set of closed gaps
        self._kinds, self.changes, self.varies = {}, [], False

    def add(self, begin, rest, end, packed, names, wholes, changes):
        """Add the next phase: from `begin`, s, or as `list` has it from `rest`, when flights below rounding end.

        wholes: the packed scene, and that with the parameters of the phase, whose rows are the same.
        """
        kind = self._kinds.setdefault(id(packed), len(self.packed))
        if kind == len(self.packed):
            of_whole, own = _rows_of(wholes[1]), _rows_of(packed)
            pairs = [(of_whole[part] + i, own[part] + i) for part, i in _numbered(packed) if part in of_whole]
            self.packed.append(packed)
            self._columns.append(np.array(pairs, int).reshape(-1, 2).T)
        if self.list:
            self.list[-1] = (self.list[-1][0], rest, self.list[-1][2])
        self.starts.append(begin)
        self.of.append(kind)
        self.changes.append(changes)
        self.varies = self.varies or wholes[0] is not wholes[1] or any(isinstance(item, Force) for item in changes[0])
        self.list.append((rest, max(rest, end), names))

    def at(self, t):
        """Numbers of the phases at times t (k,); where one begins, the later one."""
        return np.maximum(np.searchsorted(self.starts, t, side="right") - 1, 0)

    def of_outputs(self, t):
        """Numbers of the phases of outputs at times t (k,): of several at one time each is of a phase of its own."""
        same = np.searchsorted(t, t, side="right") - 1 - np.arange(t.size)
        return np.maximum(self.at(t) - same, 0)

    def multipliers(self, numbers, m, *arrays):
        """Multipliers (k, m) of all rows of the scene: zero of open contacts; arrays as of `reactions.multipliers`."""
        out = np.zeros((len(numbers), m))
        for kind, mine, some in self._gathered(numbers, arrays):
            rows, columns = self._columns[kind]
            out[np.ix_(mine, rows)] = reactions.multipliers(self.packed[kind], *some)[:, columns]
        return out

    def constraint_error(self, numbers, *arrays):
        """The `ConstraintError` of the rows that hold."""
        out = np.zeros((3, len(numbers)))
        for kind, mine, some in self._gathered(numbers, arrays):
            out[:, mine] = diagnostics.constraint_error(self.packed[kind], *some)
        return diagnostics.ConstraintError(*out)

    def packed_at(self, t):
        """Yield each packed scene of phases at times t (k,), and which times are its."""
        for kind, mine, _ in self._gathered(self.at(t), ()):
            yield self.packed[kind], mine

    def phase_at(self, t):
        """The `StatePhase` at t, s, or of several times; None where actions have changed nothing."""
        if not any(inactive or values for inactive, values in self.changes):
            return None
        numbers = np.unique(self.at(np.atleast_1d(t))).tolist() or [0]
        inactive, values = self.changes[numbers[-1]]
        kinds = {self.of[number] for number in numbers}
        one = kinds.pop() if len(kinds) == 1 else None
        found = (None, None) if one is None else (self.packed[one], self._columns[one])
        return StatePhase(tuple(item.name for item in inactive), values, *found)

    def parts(self, solution):
        """Yield the outputs of a solution by packed scenes, each as a solution of that scene, and which they are."""
        for kind, mine, _ in self._gathered(solution._phase_of_rows, ()):
            part = solution._picked(mine)
            packed = self.packed[kind]
            part.packed, part.system, part.handles, part._phases = packed, packed.system, handles_of(packed), None
            yield part, mine

    def active(self, item, numbers):
        """Whether a part is active in the phases of these numbers (k,)."""
        return np.array([all(item is not each for each in inactive) for inactive, _ in self.changes])[numbers]

    def name_switched(self, parts):
        """Name in each phase which of these parts, that come and go, are active in it."""
        for k, (inactive, _) in enumerate(self.changes):
            active = [item.name for item in parts if all(item is not each for each in inactive)]
            self.list[k] = (*self.list[k][:2], (*self.list[k][2], *active))

    def _gathered(self, numbers, arrays):
        """Yield each set of closed gaps, the entries (j,) of arrays in its phases, and these parts of the arrays."""
        kinds = np.array(self.of)[numbers]
        for kind in np.unique(kinds).tolist():
            mine = np.flatnonzero(kinds == kind)
            yield kind, mine, [None if array is None else array[mine] for array in arrays]


def _rows_of(packed):
    """The first row of each primitive, by its id."""
    return {id(part): first for part, first in first_rows(packed.constraints)}


def _numbered(packed):
    """Yield the id of the primitive of each row, and which of its rows it is."""
    for part in packed.constraints:
        yield from ((id(part), i) for i in range(part.all_rows))


class _Pieces(StepPieces):
    """Dense output of phases: where one begins, its own."""

    side = "right"


def demand_apart(gaps, able, q, angles, tol):
    """Raise InconsistentState where gaps, of those that are able to close, are below zero."""
    values = gaps.at(q, angles)
    deep = [i for i in able if values[i] < -tol * (1.0 + np.abs(q).max())]
    if deep:
        found = listed([f"{gaps.names[i]} {gaps.list[i].contact.excess} by {-values[i]:.3g}" for i in deep], NAMED)
        raise InconsistentState(
            f"at the start (m, or rad): {found}. Move the bodies, or have scene.assemble() close these gaps."
        )


@dataclass
class Modes:
    """The modes of the units of a scene: numbers of gaps, and of frictions. All others are open, or slide."""

    closed: list = field(default_factory=list)  # independent rows, with reactions
    idle: list = field(default_factory=list)  # closed by what others hold
    opened: dict = field(default_factory=dict)  # time, gap and rate where a contact has just opened with a rate
    sticking: dict = field(default_factory=dict)  # frictions that stick: how many rows hold each
    blocked: list = field(default_factory=list)  # frictions without motion that others hold
    begun: dict = field(default_factory=dict)  # time and acceleration where a friction has begun to slide

    def same(self, other):
        """Whether the units are in the same modes, whatever has just opened."""
        return replace(self, opened={}) == replace(other, opened={})


class _ContactRun:
    """One run in the making.

    Parameters
    ----------
    scene : Scene
        With contacts.
    options : RunOptions
    call : RunCall
    run_of : function of a scene, options and a call
        Returns the `Run` of a phase.
    run_task : function of a task, a scene and the tolerance of its start
    instead : function of a task and a status
        Returns the method that begins again, or None.
    """

    def __init__(self, scene, options, call, run_of, run_task, instead):
        self.scene, self.options, self.call = scene, options, call
        self.run_of, self.run_task, self.instead = run_of, run_task, instead
        self.span = interval(call.t_span)
        self.times = output_times(call.t_eval, *self.span)
        self.per_step, self.taken = self.times.size == 0, 0
        kept = prepared(phase_of(scene, []))
        self._demand_served(kept)
        self.base, self.count = scene, kept.handles.count
        self.inactive, self.values, self.acted = inactive_of(scene), {}, False
        self.switched = {id(item): item for item in self.inactive}
        phase = getattr(call.state, "phase", None)
        if phase is not None:
            self.inactive, self.values = tuple(scene[name] for name in phase.inactive), phase.values
        self.configure()
        self.t = self.span[0]
        self.q, self.qd = scene._initial() if call.state is None else state_arrays(call.state, kept.n)
        self.remembered = remembered(call.state, kept, self.t, self.q)
        self.length = max(scene.packed.size, float(np.abs(self.q).max()))
        demand_apart(self.gaps, self.able, self.q, self.remembered[: self.count], options.initial_tol)
        self.users = prepared_events(options.events) or []
        self.modes, self.rest = Modes(), self.t
        self.parts, self.found, self.report = [], [[] for _ in self.users], reporter(call.progress)
        self.phases, self.counts, self.steps = Phases(), [0] * len(self.users), 0
        self.reason, self.method, self.at_once, self.judged = "", "", 0, (self.t, 0)

    def _demand_served(self, kept):
        names = [gap for gap, given in (("store", self.call.store), ("checkpoint", self.call.checkpoint)) if given]
        if names:
            raise InvalidArgument(f"{names[0]} doesn't serve scenes with contacts yet: keep the outputs in memory.")
        if kept.sampled:
            raise InvalidArgument(
                "sampled controllers don't serve scenes with contacts yet: leave out period, for a continuous one."
            )
        rough = [load.force.title for load in kept.packed.loads if load.normal >= 0 and load.force.slips]
        if rough and contacts_of(self.scene._added):
            raise InvalidArgument(
                f"regularised friction that depends on reactions ({', '.join(rough)}) doesn't serve scenes with "
                "contacts: leave out slip_velocity, for the exact law."
            )

    def run(self):
        """Run to the end; the `Task` of the first phase and the `Outcome` of all."""
        began, first = clock(), None
        touching = closed_gaps(self.gaps, self.q, self.remembered[: self.count], self.options.initial_tol)
        self.gap = self.gaps.at(self.q, self.remembered[: self.count])
        touching = [i for i in touching if i in self.able]
        status = self._settle(touching, ()) or self._settle_frictions(Modes(), ())
        while status is None:
            try:
                task, outcome = self._phase()
            except TsdynError as error:
                if not self.parts:
                    raise
                status, self.reason = Status.ACTION_FAILED if self.acted else Status.SINGULAR, str(error)
                break
            first = first or task
            status = self._after(outcome)
        if first is None:  # nothing could begin
            raise InconsistentState(f"{status.sentence} {self.reason} {status.remedy}")
        self.report(None)
        return first._replace(prepared=Prepared(self.base, self.base.packed), span=self.span), self._outcome(
            status, began
        )

    # One phase

    def _phase(self):
        """Run the next phase: its task and outcome."""
        end = self.span[1]
        phase, names = self._scene(), self._names()
        call, plain = RunCall((self.t, end)), replace(self.options, events=None)
        run, still = self.run_of(phase, plain, call), self._still(phase)
        if still.size == self.q.size and self.options.method is None:
            run = run._by(DOP853(run.method.rtol, run.method.atol, max_step=self.options.max_step))
        run._prepare_kernels(True)
        while True:
            task = run._new_task(call, (self.q, self.qd), self.remembered)
            task = task._replace(
                events=self._events(phase), within=True, report=self._reporting(), times=self._times(),
                max_steps=self._steps_left(), resume=self._resume,
            )  # fmt: skip
            self.names, self.packed, self.settled, self.again = names, phase.packed, None, []
            outcome = self.run_task(task, phase, self.options.initial_tol)
            other = self.instead(task, outcome.status)
            if other is None:
                outcome = pinned(outcome, self.q if self.parts else task.q, still)
                if self.settled is None:
                    self._end_phase(outcome.end.reached)
                return task, outcome
            run = run._by(other)

    def _end_phase(self, t):
        wholes, changes = (self.base.packed, self.scene.packed), (self.inactive, self.values)
        self.phases.add(self.t, self.rest, t, self.packed, self.names, wholes, changes)

    def _resume(self, t, run, numbers):
        """After events of these numbers: whether the run of the phase goes on, with other velocities.

        It does where the same gaps are closed as before.
        """
        self._end_phase(t)
        before = self.modes
        self.t, (self.q, self.qd, _), self.remembered = t, run.now.copy(), run.remembered.copy()
        remembered = self.remembered
        self.settled = (self._transit([self.watched[i] for i in numbers]),)
        changed = not (self.modes.same(before) and np.array_equal(self.remembered, remembered))
        if self.settled[0] is not None or changed:
            return False
        run.now[1], self.settled = self.qd, None
        self.closing.open(self.modes.opened)
        self.again.append(t)
        return True

    def configure(self):
        """Take the scene of the present parameters, and the units that are active."""
        self.scene = hybrid.with_values(self.base, self.values)
        self.switched |= {id(item): item for item in self.inactive}
        inactive = self.inactive if self.scene is self.base else [self.scene[item] for item in self.inactive]
        self.without = dependent(self.scene, inactive)
        self.gaps, self.frictions = gaps_of(self.scene, self.without), Frictions(self.scene)
        off = {id(item) for item in self.without}
        self.able = [i for i, gap in enumerate(self.gaps.list) if id(gap.contact) not in off]
        self.off = [i for i, unit in enumerate(self.frictions.units) if id(unit.force) in off]

    def _scene_of(self, rows, holds):
        return phase_of(self.scene, rows, holds, self.without)

    def _scene(self):
        """The scene of the present modes."""
        return self._scene_of(self._closed_rows(), [self._hold(i, r) for i, r in self.modes.sticking.items()])

    def _closed_rows(self):
        return [self.gaps.list[i].side.row for i in self.modes.closed]

    def _hold(self, i, rank):
        """The rows that hold a friction, with the numbers that the run remembers."""
        unit = self.frictions.units[i]
        places = [self.count + np.array(unit.held(k)) for k in range(rank)]
        return Hold(unit, rank, self.remembered[np.array(places, int)])

    def _names(self):
        """Names of the units whose rows hold."""
        held = sorted([*self.modes.closed, *self.modes.idle])
        names = [self.gaps.names[i] for i in held] + [self.frictions.names[i] for i in sorted(self.modes.sticking)]
        return tuple(dict.fromkeys(names))

    def _events(self, phase):
        """Events of a phase: the user's, then one for each of the units `watched`."""
        pairs = zip(self.users, self.counts, strict=True)
        goes_on = bool(self.parts)
        found = [
            event._replace(limit=1.0 if event.action else event.limit - count, goes_on=goes_on)
            for event, count in pairs
        ]
        watches = list(self._watches(phase))
        self.watched = [None] * len(found) + [unit for unit, _ in watches]
        return found + [event for _, event in watches]

    def _watches(self, phase):
        """Yield the units that may end a phase, gaps and then frictions, each with its event."""
        gaps, frictions, modes, packed = self.gaps, self.frictions, self.modes, phase.packed
        first = first_row_of(packed)
        sides = [gaps.list[i].side for i in modes.closed]
        leaving = _Leaving(packed, [first[id(side.row)] for side in sides], [side.sign for side in sides]).over
        self.closing = _Closing(gaps, modes.opened)
        for i in self.able:
            if i in modes.idle:
                continue
            is_open = i not in modes.closed
            function = Member(self.closing.over, i) if is_open else Member(leaving, modes.closed.index(i))
            yield i, Event(function, gaps.names[i], 1.0, -1.0, is_open)
        sticking = list(modes.sticking)
        sliding = [i for i in range(frictions.count) if i not in sticking and i not in modes.blocked]
        breaking = _Breaking(packed, [frictions.units[i] for i in sticking]).over
        slowing = _Slowing(frictions, sliding, modes.begun).over
        for function, which in ((breaking, sticking), (slowing, sliding)):
            for k, i in enumerate(which):
                yield gaps.count + i, Event(Member(function, k), frictions.names[i], 1.0, -1.0)

    def _still(self, phase):
        """Coordinates of the bodies that rest where frictions stick."""
        if not self.modes.sticking or self.q.size > MOST_PINNED:
            return np.zeros(0, int)
        return immobile(phase.packed, self.t, self.q, self.remembered[self.count :])

    def _times(self):
        left = self.times[self.taken :]
        return left if left.size or self.per_step else np.array([np.inf])  # an empty array would ask for every step

    def _steps_left(self):
        most = self.options.max_steps
        return None if most is None else max(most - self.steps, 0)

    def _reporting(self):
        if self.report is silent:
            return silent
        (start, end), t, done = self.span, self.t, self.steps

        def report(fraction, at=0.0, steps=0):
            if fraction is not None:
                self.report((t + fraction * (end - t) - start) / (end - start), at, done + steps)

        return report

    # What a phase ends with

    def _after(self, outcome):
        """Take the end of a phase; the Status of the run, None if it goes on."""
        end, part = outcome.end, outcome
        self.method = outcome.method or self.method
        self.steps += end.counts["steps"]
        times, *states = outcome.events
        for i, mine in enumerate(list(zip(times, *states, strict=True))[: len(self.users)]):
            self.found[i].append(mine)
            self.counts[i] += len(mine[0])
        fired = [i for i, at in zip(self.watched, times, strict=True) if i is not None and at.size]
        acting = [event for event, at in zip(self.users, times, strict=False) if event.action and at.size]
        ended = any(count >= event.limit for event, count in zip(self.users, self.counts, strict=True))
        ends = outcome.status is Status.EVENT and not ended
        goes_on = ends and end.reached < self.span[1]
        if not self.per_step and goes_on and len(part.rows) and part.rows[-1, 0] == end.reached:
            part = part._replace(rows=part.rows[:-1])  # that of the next phase counts
        if self.again and part.trajectory is not None:
            part.trajectory.begin_at(self.again)
        self.parts.append(part)
        self.taken += len(part.rows)
        if self.settled is not None:  # within the run of the phase
            return self.settled[0]
        self.t, (self.q, self.qd, _), self.remembered = end.reached, (x.copy() for x in end.last), end.remembered
        self.reason = outcome.reason
        if goes_on:
            return self._act(acting, fired, end.last) if acting else self._transit(fired)
        if self._is_deep():
            return Status.CONTACT_FAILED
        return Status.SUCCESS if ends else outcome.status

    def _is_deep(self):
        """Whether contacts penetrate; says so."""
        self.gap = self.gaps.at(self.q, self.remembered[: self.count])
        deep = [i for i in self.able if self.gap[i] < -PENETRATION * self.length]
        if deep:
            found = listed([self.gaps.names[i] for i in deep], NAMED)
            self.reason = f"Penetration was not noticed: {found}. Give a max_step."
        return bool(deep)

    def _act(self, events, fired, last):
        """Carry out the actions of events; the Status if there is no way on, else None. last: the state (3, n)."""
        change = hybrid.ask(self, events, last)
        if change is None or change.ends:
            return Status.ACTION_FAILED if change is None else Status.EVENT
        self.acted = True
        jump = hybrid.carry_out(self, change)
        if jump is None:
            return Status.ACTION_FAILED
        status = self._transit(fired)
        hybrid.report(self, jump)
        return status

    def _transit(self, fired):
        """From one phase to the next one, after events of the units `fired`; the Status if there is no way on."""
        self.reason = ""
        if self._is_deep() or self._is_stuck():
            return Status.CONTACT_FAILED
        near = np.flatnonzero(self.gap <= TOUCHING * self.length).tolist()
        count, before = self.gaps.count, self.modes
        hit = [i for i in fired if i < count]
        touching = {*near, *hit, *before.closed, *before.idle}.intersection(self.able)
        status = self._settle(sorted(touching), hit)
        return status or self._settle_frictions(before, [i - count for i in fired if i >= count])

    def _is_stuck(self):
        """Whether events no longer let time go on; says so."""
        since, count = self.judged
        length = self.t - self.phases.starts[-1]
        self.at_once = self.at_once + 1 if length <= 16.0 * EPS * max(abs(self.t), EPS) else 0
        self.judged = since, count + 1
        if self.at_once > MOST_AT_AN_INSTANT + self.gaps.count + self.frictions.count:
            self.reason = f"There are {self.at_once} events at t = {self.t:.9g} s."
            return True
        if count + 1 >= EVENTS_JUDGED:
            if (self.span[1] - self.t) > CREEPING * (self.t - since):
                self.reason = f"The last {count + 1} events took {self.t - since:.3g} s: they accumulate."
                return True
            self.judged = self.t, 0
        return False

    def _settle(self, touching, fired):
        """Impact, then which gaps stay closed; the Status if there is no way on, else None."""
        slots, values = self.remembered[self.count :], self.gap
        before, self.modes, self.rest = self.modes, Modes(), self.t
        if not touching:
            return None
        try:
            inertia = Inertia(self.gaps, self.t, self.q, slots)
            rates = inertia.rates(self.qd)
            noise = [i for i in fired if i not in before.closed and rates[i] > 0.0]
            if noise:  # a gap that closes with a rate of rounding
                self.qd, rates = held(inertia, self.qd, noise, rates)
            if (rates[touching] < 0.0).any():
                rates = self._hit(inertia, touching, rates)
            resting = [i for i in touching if rates[i] == 0.0]
            opened = {i: (self.t, values[i], rates[i]) for i in touching if rates[i] > 0.0}
            leaving = [i for i in fired if i in before.closed]
            stay = settle(inertia, resting, self.qd, leaving)[:2] if resting else ([], [])
            self.modes = Modes(*stay, opened)
        except NoSolution:
            names = listed(list(dict.fromkeys(self.gaps.names[i] for i in touching)), NAMED)
            self.reason = f"No reactions keep these contacts from penetrating at t = {self.t:.9g} s: {names}."
            return Status.CONTACT_FAILED
        return None

    def _settle_frictions(self, before, fired):
        """Which frictions stick; the Status if there is no way on, else None."""
        frictions, memory = self.frictions, self.remembered[self.count :].copy()
        resting, guess = [], {}
        for i, unit in enumerate(frictions.units):
            if i in self.off:
                continue
            v, size = frictions.velocity(i, self.q[None], self.qd[None])
            speed, single = np.linalg.norm(v[0]), unit.slide.directions == 1
            if i in before.blocked and memory[unit.way].any():
                guess[i] = frictions.read(i, self.q, memory)
            if speed <= max(AT_REST * size[0], 0.0 if single else STOPPED) or (single and i in fired):
                resting.append(i)
                memory[unit.way] = 0.0
            else:
                memory[unit.way] = frictions.written(i, self.q, v[0] / speed)
        self.remembered = np.concatenate((self.remembered[: self.count], memory))
        self.modes.blocked = self.off
        if not resting:
            return None
        try:
            rest, ranks = self._rest(before, resting, {i: way for i, way in guess.items() if i in resting}, fired)
        except NoRest as error:
            names = listed(list(dict.fromkeys(frictions.names[i] for i in error.units)), NAMED)
            self.reason = f"No reactions are consistent with the friction at t = {self.t:.9g} s: {names}."
            return Status.CONTACT_FAILED
        for i, way in rest.ways.items():
            unit = frictions.units[i]
            self.remembered[self.count + unit.slot : self.count + unit.way.stop] = frictions.written(i, self.q, way)
        self.modes.sticking = {i: ranks[i] for i in rest.sticking}
        self.modes.blocked = sorted([*self.off, *rest.blocked, *(i for i in resting if not ranks[i])])
        self.modes.begun = {i: (self.t, rest.rates[i]) for i in rest.ways}
        return None

    def _rest(self, before, resting, guess, fired):
        """The `Rest` of the frictions that are at rest, and how many rows hold each."""
        frictions, ranks = self.frictions, {}
        for i in resting:
            if i in before.sticking:
                ranks[i] = before.sticking[i]
                continue
            basis = frictions.basis(i, self.q, self._motions_of)
            ranks[i] = len(basis)
            numbers = frictions.numbers(i, self.q, basis)
            for k in range(len(basis)):
                self.remembered[self.count + np.array(frictions.units[i].held(k))] = numbers[k]
        free = [i for i in resting if ranks[i]]
        phase = self._scene_of(self._closed_rows(), [self._hold(i, ranks[i]) for i in free])
        rows = {i: phase.packed.derived.holds[frictions.units[i].slot] for i in free}
        memory = self.remembered[self.count :]
        fresh = [i for i in free if i not in before.sticking]
        if fresh:  # their rows hold to the last bit where they are
            Phi = values_of(phase.packed, self.t, self.q, memory)
            for i in fresh:
                for k, row in enumerate(rows[i]):
                    memory[frictions.units[i].held(k)[-1]] = Phi[row]
        bases = {i: frictions.directions(i, self.q, self._hold(i, ranks[i]).numbers) for i in free}
        problem = RestProblem(frictions, phase.packed, rows, bases, self.t, self.q, self.qd, memory)
        sticking = [i for i in free if i not in guess]
        return problem.settle(sticking, guess, fired), ranks

    def _motions_of(self, i):
        """Velocities (3, motions) of a friction, ground frame, of the motions that bilateral and closed rows leave."""
        frictions, unit = self.frictions, self.frictions.units[i]
        hold = Hold(unit, 3, frictions.numbers(i, self.q, np.eye(3)))
        phase = self._scene_of(self._closed_rows(), [hold])
        memory = self.remembered[self.count :].copy()
        for k in range(3):
            memory[np.array(unit.held(k))] = hold.numbers[k]
        return free_motions(phase.packed, self.t, self.q, memory, phase.packed.derived.holds[unit.slot])

    def _hit(self, inertia, touching, rates):
        """Jump of velocities at an impact; the rates (count,) afterwards."""
        e, before = self.gaps.restitution[touching].copy(), rates[touching]
        p, qd, after = self._jump(inertia, touching, before, e)
        # Impacts that are followed by flights below rounding are the last ones
        a = self._lowering(inertia, touching, qd, after)
        last = [k for k, i in enumerate(touching) if a[i] > 0.0 and p[k] > 0.0 and e[k] > 0.0]
        if last:
            flights = [2.0 * after[touching[k]] / (a[touching[k]] * (1.0 - e[k])) for k in last if e[k] < 1.0]
            self.rest = float(max([self.rest, *(self.t + T for T in flights)]))
            e[last] = 0.0
            p, qd, after = self._jump(inertia, touching, before, e)
            a = self._lowering(inertia, touching, qd, after)
        # Contacts that another impact lifts by less than rounding stay closed
        for _ in touching:
            if not a.any():
                break
            qd, after = held(inertia, qd, [i for i in touching if a[i] > 0.0 or after[i] == 0.0], after)
            if (after[touching] < 0.0).any():
                more, qd, after = self._jump(inertia, touching, after[touching], np.zeros(len(touching)), qd)
                p = p + more
            a = self._lowering(inertia, touching, qd, after)
        self.qd = qd
        named = zip(touching, p, strict=True)
        self.phases.impulses += [(self.t, self.gaps.names[i], float(x)) for i, x in named if x > 0.0]
        return after

    def _jump(self, inertia, touching, before, e, qd=None):
        """Impulses (k,) of an impact, velocities (n,) and rates (count,) after it."""
        law = self.options.law
        p = impulses(inertia, touching, before, e, law)
        return p, *jumped(inertia, self.qd if qd is None else qd, touching, before, e, p, law)

    def _lowering(self, inertia, touching, qd, rates):
        """Decelerations (count,) of the gaps that open and close again within rounding of the gap; zero of others."""
        opening = [i for i in touching if rates[i] > 0.0]
        if not opening:
            return np.zeros(self.gaps.count)
        a = -settle(inertia, [i for i in touching if rates[i] == 0.0], qd).accelerations
        rounding = EPS * np.maximum(self.length, ROUNDED * (np.abs(inertia.J) @ np.abs(self.q)))
        rounding[self.gaps.restitution == 1.0] = ENDLESS * self.length  # flights that would never get lower
        mine = np.isin(np.arange(a.size), opening)
        return np.where(mine & (a > 0.0) & (rates * rates < 2.0 * a * rounding), a, 0.0)

    # The whole

    def _outcome(self, status, began):
        switched = [item for item in self.switched.values() if not getattr(item, "unilateral", False)]
        self.phases.name_switched(switched)
        parts = self.parts
        ends = [part.end for part in parts]
        last = ends[-1]
        logs = self.options.history is not False
        rows = np.concatenate([part.rows for part in parts])
        events = None
        if self.options.events is not None:
            columns = [list(zip(*known, strict=True)) for known in self.found]
            events = tuple([np.concatenate(column[k]) for column in columns] for k in range(3))
        return Outcome(
            status, self.reason, rows,
            RunEnd(
                last.reached, last.last, last.remembered,
                summed([end.counts for end in ends]),
                StepLog([end.steps for end in ends]) if logs else None,
                ChartLog([end.charts for end in ends]) if logs else None,
            ),
            _Pieces([part.trajectory for part in parts]) if self.options.dense_output else None,
            events, began, self.method, (self.phases, self.phases.of_outputs(rows[:, 0])),
        )  # fmt: skip


def jumped(inertia, qd, which, before, e, p, law="newton"):
    """Velocities (n,) after impulses p (k,) of the gaps `which`, and the rates (count,) of all gaps then."""
    change = inertia.pushed(which, p)
    after = inertia.rates(qd + change, np.abs(qd) + np.abs(change))
    after[which] = np.maximum(after[which], 0.0)  # but for rounding
    if law == "newton":  # without rounding where the impact acts
        for k, i in enumerate(which):
            if p[k] > 0.0:
                after[i] = -e[k] * min(before[k], 0.0)
    return qd + change, after


def held(inertia, qd, which, rates):
    """Velocities (n,) and rates (count,) after the least change, by kinetic energy, that ends some rates."""
    change = inertia.hold(which, rates[which])
    after = inertia.rates(qd + change, np.abs(qd) + np.abs(change))
    after[which] = 0.0
    return qd + change, after


class _Pinned:
    """A trajectory with bodies that rest: to the last bit."""

    def __init__(self, trajectory, q, still):
        self.trajectory, self.q, self.still = trajectory, q, still
        self.start, self.end, self.edges, self.anchors = (
            trajectory.start, trajectory.end, trajectory.edges, trajectory.anchors,
        )  # fmt: skip

    def __call__(self, t):
        """As of a `Trajectory`."""
        states, memory, status = self.trajectory(t)
        states[:, 0, self.still], states[:, 1:, self.still] = self.q[self.still], 0.0
        return states, memory, status


def pinned(outcome, q, still):
    """The outcome of a phase with bodies that rest at q (n,), to the last bit; still: their coordinates."""
    if not still.size:
        return outcome
    n, last = q.size, outcome.end.last
    outcome.rows[:, 1 + still] = q[still]
    outcome.rows[:, 1 + n + still] = outcome.rows[:, 1 + 2 * n + still] = 0.0
    last[0, still], last[1:, still] = q[still], 0.0
    trajectory = outcome.trajectory and _Pinned(outcome.trajectory, q, still)
    return outcome._replace(trajectory=trajectory)


def run_contacts(scene, options, call, run_of, run_task, instead):
    """The `Task` and the `Outcome` of a run of a scene with contacts; the functions are those of `prepared_run`."""
    return _ContactRun(scene, options, call, run_of, run_task, instead).run()


@fitting
def impact(
    scene: Scene,
    state: Any,
    contacts: Sequence[ItemLike] | None = None,
    restitution: float | Mapping[Any, float] | None = None,
    law: str = "newton",
) -> tuple[RememberingState, dict[str, float]]:
    """Return the state after an impact of all closed contacts at once, in the metric of kinetic energy.

    Parameters
    ----------
    scene : Scene
        With unilateral constraints.
    state : State
        At the impact, such as `solution.state`; its positions are kept.
    contacts : sequence of unilateral constraints or names, optional
        Those that are closed; by default those whose gap is zero at the state, to 1e-9.
    restitution : float, or mapping of contacts or names to floats, optional
        Coefficients in place of those of the contacts.
    law : {"newton", "poisson"}
        Newton's law in Moreau's form, gd+ = -e gd- where a contact pushes; or Poisson's law: the impulse of restitution
        is e times that of compression. Both keep or lower the energy.

    Returns
    -------
    state : State
    impulses : dict of str to float
        By names of the contacts; N s, or N m s of an angle.

    Raises
    ------
    InvalidArgument
        If law, state or a coefficient is inadmissible, or the scene has no contacts.
    InvalidConstraint
        If a contact is none of the scene.
    InconsistentState
        If no impulses keep the contacts from penetrating.

    Notes
    -----
    The bilateral constraints hold during the impact. With 0 <= v+ + e v-, 0 <= p complementary, v+ is unique; the
    impulses p of redundant contacts are one of the possible solutions.

    Examples
    --------
    The first of three equal balls in contact is hit; plastic impacts leave all with the same velocity:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, 0))
    >>> balls = [scene.add_point_mass(mass=1.0, position=(0.1 * i, 0, 0), name=f"ball {i}") for i in range(3)]
    >>> balls[0].velocity = (1, 0, 0)
    >>> for i in range(2):
    ...     gap = ts.constraints.SphereContact(balls[i], balls[i + 1], radius_a=0.05, radius_b=0.05, name=f"gap {i}")
    ...     _ = scene.add(gap)
    >>> q, qd = scene.start
    >>> after, impulses = ts.impact(scene, ts.State(0.0, q, qd), restitution=0.0)
    >>> print(after.qd[::3].round(6), {name: round(p, 6) for name, p in impulses.items()})
    [0.333333 0.333333 0.333333] {'gap 0': 0.666667, 'gap 1': 0.333333}
    """
    if law not in LAWS:
        raise InvalidArgument(f"law must be 'newton' or 'poisson', got {law!r}.")
    if not has_contacts(scene):
        raise InvalidArgument("impact: the scene has no unilateral constraints, such as PlaneContact(unilateral=True).")
    gaps, kept = gaps_of(scene), prepared(phase_of(scene, []))
    q, qd = state_arrays(state, kept.n)
    t = float(getattr(state, "t", 0.0))
    memory = remembered(state, kept, t, q)
    angles, slots = memory[: kept.handles.count], memory[kept.handles.count :]
    near = closed_gaps(gaps, q, angles)
    which = near if contacts is None else _chosen(gaps, contacts, near)
    e = gaps.restitution.copy()
    if isinstance(restitution, dict):
        for item, value in restitution.items():
            e[_chosen(gaps, [item], None)] = _coefficient(value)
    elif restitution is not None:
        e[:] = _coefficient(restitution)
    inertia = Inertia(gaps, t, q, slots)
    before = inertia.rates(qd)[which]
    try:
        p = impulses(inertia, which, before, e[which], law)
    except NoSolution as error:
        names = listed(list(dict.fromkeys(gaps.names[i] for i in which)), NAMED)
        raise InconsistentState(f"impact: no impulses keep these contacts from penetrating: {names}.") from error
    after, _ = jumped(inertia, qd, which, before, e[which], p, law)
    found = {gaps.names[i]: 0.0 for i in which}
    for i, x in zip(which, p, strict=True):
        found[gaps.names[i]] += float(x)
    anchor = getattr(state, "anchor", None)
    levels = np.zeros(kept.n), np.zeros(len(scene.packed.system.segments))
    return RememberingState.of(scene.packed, slots, anchor, t, q.copy(), after, *levels), found


def _chosen(gaps, items, near):
    """Numbers of the gaps of some contacts; of a stop with two bounds the one that is near."""
    found = []
    for item in items:
        mine = [i for i, gap in enumerate(gaps.list) if item is gap.contact or item == gap.contact.name]
        if not mine:
            raise InvalidConstraint(f"impact: {item!r} is no unilateral constraint of the scene.")
        found += mine if near is None or len(mine) == 1 else [i for i in mine if i in near]
    return sorted(set(found))


def _coefficient(value):
    e = floats(value)
    if e.shape != () or not 0.0 <= e <= 1.0:
        raise InvalidArgument(f"impact: restitution must be from 0 to 1, got {value!r}.")
    return float(e)
