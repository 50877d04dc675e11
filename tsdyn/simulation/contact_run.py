"""Runs of scenes with unilateral constraints: phases between events, impacts, openings."""

from __future__ import annotations

from contextlib import suppress
from copy import copy
from dataclasses import replace
from functools import cache

import numpy as np

from ..ahead import compile_ahead
from ..analyses import contact_rows, friction_units
from ..analyses.contact_problem import closed_gaps
from ..analyses.friction_problem import immobile
from ..analyses.frictions import Frictions, Hold, hold_of
from ..analyses.tolerances import RESTS, STOPPED
from ..configuration.initial_conditions import DependentRows
from ..elements.unilateral import contacts_of
from ..errors import (
    InconsistentState,
    InvalidArgument,
    InvalidForce,
    SingularConfiguration,
    Status,
    TsdynError,
)
from ..integrators import DOP853
from ..jit.compiled import clock
from ..jit.interrupts import deferred_interrupts
from ..maths.tolerances import EPS, NEGLIGIBLE
from ..model.handles import handles_of
from ..observables import diagnostics
from ..observables.reactions import singular_place
from ..observables.state import remembered
from ..observables.tolerances import LARGE
from ..runs.driver import Failed, Sampling
from ..runs.event_groups import GroupMember
from ..runs.events import Event
from ..runs.events import prepare as prepared_events
from ..runs.run_log import ChartLog, RunEnd, StepLog
from ..runs.task import Outcome, interval, output_times, state_arrays
from ..runs.tolerances import START_ZERO
from ..validation import counted, listed
from . import contact_events, flights, hybrid, unit_events
from .checkpoints import Checkpoints
from .contact_events import Halting, Reactions
from .grips import items_of
from .phase_scenes import NAMED, dependent, gaps_of, inactive_of, phase_of, with_own_parts
from .phases import Impulse, PhasePieces, Phases, Pinned, UnitModes
from .run_options import RunCall, RunOptions
from .scene_cache import prepared, prepared_numbers
from .segments import summed
from .shared_friction import SharedFriction
from .termination import reporter, silent
from .tolerances import PENETRATION
from .transitions import Transitions
from .unit_events import Breaking, Closing, Slowing

# A run with contacts is a sequence of phases. A scene has units: gaps, each open or closed. A phase is a run of the
# scene with the units in their modes, the closed gaps as bilateral rows, and ends at the first zero of what a unit
# watches: of an open gap, from above, or of the reaction of a closed one. Then velocities jump by the impulses of an
# impact, where gaps close; those that are closed and at rest stay so as the complementarity problem of accelerations
# says; and the next phase begins. Closed gaps whose rows depend on others, such as that of a fourth leg, are left out
# of the rows: the others hold them. They may do so to first order alone, as the ends of an edge on a face that tips: a
# gap that falls ends the run. Where those that stick need it, all share their reactions, see `UnitModes.spread`; points
# that slide on one plane do, and have friction by their shares, see analyses/shared_loads.py.
#
# `UnitModes` has all that a phase follows from, beside t, q, qd and what the run remembers: a checkpoint needs no more.


def demand_apart(gaps, values, length, tol, able=None):
    """Raise InconsistentState where gaps are below zero, of those that are able to close: by default, at the start.

    values (count,): the gaps; length: of the scene, m.
    """
    if able is None:
        able = [i for i, gap in enumerate(gaps.list) if gap.contact.active]
    allowed = -tol * gaps.lengths(length)
    deep = [i for i in able if values[i] < allowed[i]]
    if deep:
        found = listed([f"{gaps.names[i]} {gaps.list[i].contact.excess} by {-values[i]:.3g}" for i in deep], NAMED)
        raise InconsistentState(
            f"at the start (m, or rad): {found}. Move the bodies, or have scene.assemble() close these gaps."
        )


# What a phase raises that can't begin, after others
FAILURES = {
    InvalidForce: Status.SAMPLING_FAILED,
    SingularConfiguration: Status.SINGULAR,
}


@cache
def _compile_once(slides):
    """Have compiled what events need; slides: whether there is exact friction of joints."""
    modules = contact_rows, contact_events, flights, *((friction_units, unit_events) if slides else ())
    compile_ahead(tuple(kernel for module in modules for kernel in module.KERNELS))


class _ContactRun(Transitions, Checkpoints):
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
    archive : Archive, optional
        What outputs and histories go to.
    """

    def __init__(self, scene, options, call, run_of=None, run_task=None, instead=None, archive=None):
        phase = getattr(call.state, "phase", None)
        self._take_scene(scene, *(() if phase is None else phase[:2]))
        self.options, self.call, self.archive = options, call, archive
        self.run_of, self.run_task, self.instead = run_of, run_task, instead
        self.span = interval(call.t_span)
        self.times = output_times(call.t_eval, *self.span)
        self.per_step, self.taken = self.times.size == 0, 0
        kept = prepared(free := phase_of(scene, []))
        self._demand_served(kept)
        self.t = self.span[0]
        self.q, self.qd = scene._initial() if call.state is None else state_arrays(call.state, kept.n)
        self.qdd, self.ended = np.zeros(kept.n), None  # before the present transition; velocities there
        self.remembered = remembered(call.state, kept, self.t, self.q)
        start = (self.q, self.qd), self.t, options.initial_tol, self.remembered
        kept.start(free, *start, options.redundancy == "drop")  # finds redundant bilateral rows
        # Whether phases of frictions that stick and slide are packed once, with the rows of all: see `phase_of`
        self.regular = free.packed.derived.redundant is None
        self.switches = run_task is not None and self.regular
        apart, length = self.gaps.at(self.q, self.remembered[: self.count]), self.gaps.extent(self.q)
        demand_apart(self.gaps, apart, length, options.initial_tol, self.able)
        self.length = max(length, np.abs(apart[self.gaps.lengths(0.0) == 0.0]).max(initial=0.0))
        self.users = prepared_events(options.events) or []
        self.rest = self.t
        self.kinds, self.parts, self.found, self.report = [], [], [[] for _ in self.users], reporter(call.progress)
        self.phases, self.counts, self.steps = Phases(scene.packed, self.gaps), [0] * len(self.users), 0
        self.reason, self.methods, self.at_once, self.judged = "", [], 0, (self.t, 0)
        self.sampling, self.end, self.totals = None, None, None  # of the last phase; counts of those in the archive
        self.replaced, self.written = False, {}  # whether another method runs the phase; rows in the archive before it
        self.lowered = set()  # times of impacts at which less than the coefficients of restitution acts
        self.first = self.known = None  # how the run of the phase began; how a checkpoint has it
        self.halting, self.known_fast = None, {}  # of the phase: `Halting`; what a checkpoint has of it
        self.slowing = None  # and `Slowing`
        self.hits = {}  # of gaps after impacts: the time, and the largest rate since and just before

    def _take_scene(self, scene, inactive=None, values=None):
        """What follows from the scene alone, and makes the scenes of its phases.

        inactive, values: names and parameters of what actions have changed, by default nothing.
        """
        _compile_once(any(getattr(force, "slides", ()) for force in scene._forces))
        with_own_parts(scene)
        self.base, self.count, self.modes, self.acted = scene, handles_of(scene.packed).count, UnitModes(), False
        at_first = tuple(item.name for item in inactive_of(scene))
        self.switched = set(at_first)
        self.change(at_first if inactive is None else inactive, values or {})

    def change(self, inactive, values):
        """Take these parts as inactive, by name, and these parameters."""
        self.inactive, self.values = inactive, values
        self.switched |= set(inactive)
        self.scene = hybrid.with_values(self.base, values)
        parts = {each.name: each for each in (*self.scene._added, *self.scene._forces)}
        for name in inactive:
            if name not in parts:
                raise InvalidArgument(f"the state is of a scene with {name!r}, which this one lacks.")
        self.without = dependent(self.scene, [parts[name] for name in inactive])
        self.gaps = gaps_of(self.scene, self.without)
        self.frictions = Frictions(self.scene, self._scene_of([], []).packed.loads)
        self.held_gaps = {}  # the same where frictions stick, by the rows that hold these
        off = {id(item) for item in self.without}
        self.able = [i for i, gap in enumerate(self.gaps.list) if id(gap.contact) not in off]
        self.off = [i for i, unit in enumerate(self.frictions.units) if id(unit.force) in off]
        self.every = [hold_of(unit) for i, unit in enumerate(self.frictions.units) if i not in self.off]

    def _scene_of(self, rows, holds, every=()):
        return phase_of(self.scene, rows, holds, self.without, every)

    def _demand_served(self, kept):
        rough = [load.force.title for load in kept.packed.loads if load.normal >= 0 and load.force.slips]
        if rough and contacts_of(self.scene._added):
            raise InvalidArgument(
                f"regularised friction that depends on reactions ({', '.join(rough)}) doesn't serve scenes with "
                "contacts: leave out slip_velocity, for the exact law."
            )

    def run(self):
        """Run to the end; the `Task` of the last phase, of the whole scene, and the `Outcome` of all."""
        began, task, status = clock(), None, None if self.known else self.begin()
        try:
            while status is None:
                task, outcome = self._phase()
                with deferred_interrupts():
                    status = self._after(outcome)
                if outcome.interrupted and status is None:
                    raise KeyboardInterrupt
        except KeyboardInterrupt:
            if self.end is None:
                raise
            status = Status.INTERRUPTED
        except OSError as error:
            if self.end is None or self.archive is None:
                raise
            status, self.reason = Status.STORE_FAILED, f"{error.strerror or error}."
        except TsdynError as error:
            if self.end is None:
                raise
            status = Status.ACTION_FAILED if self.acted else FAILURES.get(type(error), Status.CONTACT_FAILED)
            self.reason = str(error)
        finally:
            self.report(None)
        if self.end is None:
            self.refuse(status)
        return self._whole(task or self._first_task()), self._outcome(status, began)

    def _whole(self, task):
        """A task as that of the whole run."""
        return task._replace(prepared=prepared_numbers(self.base), span=self.span)

    def begin(self):
        """Impact and closed contacts at the start; the Status if there is no way on, else None."""
        if self.run_task is not None:
            self._ask()
        touching = closed_gaps(self.gaps, self.q, self.remembered[: self.count], self.options.initial_tol)
        self.gap = self.gaps.at(self.q, self.remembered[: self.count])
        touching = [i for i in touching if i in self.able]
        parts = [part for i in touching for part in self.gaps.list[i].parts]
        if place := singular_place(self.scene.packed, self.q, parts):
            raise SingularConfiguration(f"{place}: a singular configuration. Start from another one.")
        return self._settle(touching, (), ())

    def check(self):
        """Raise what a run raises before its first step; its `Task`, of the whole scene."""
        status = self.begin()
        if status is not None:
            self.refuse(status)
        return self._whole(self._first_task())

    def _first_task(self):
        run, call = self._run_of(self._scene())
        return run._new_task(call, (self.q, self.qd), self.remembered)

    def refuse(self, status):
        """Raise that nothing can begin."""
        raise InconsistentState(f"{status.sentence} {self.reason} {status.remedy}")

    # One phase

    def _phase(self):
        """Run the next phase: its task and outcome."""
        known, tol = self.known, self._tol()
        phase, run, call, task = self._begin_phase(tol)
        names, still = self._names(), self._still(phase)
        if still.size == self.q.size and self.options.method is None:
            run = run._with_method(DOP853(run.method.rtol, run.method.atol, max_step=self.options.max_step))
            task = run._new_task(call, (self.q, self.qd), self.remembered, tol)
        run._prepare_kernels(True)
        self._enter_archive()
        while True:
            if known is not None:  # the checkpoint is of an event later on
                self.t, self.q, self.qd, self.remembered = known
            other, resting = self.instead(task, Status.STEP_COLLAPSED), task.q if self.end is None else self.first[1]
            task = task._replace(
                events=self._events(phase), within=True, report=self._reporting(), times=self._times(),
                max_steps=self._steps_left(), resume=self, archive=self.archive,
                sampling=self._sampling(task.prepared),
            )  # fmt: skip
            self.names, self.packed, self.decided, self.again, self.known = names, phase.packed, None, [], None
            self.is_sure = other is None  # whether no other method can take the phase over, from its start
            self.kind = None  # of the phase, as `Phases` has it
            if self.archive is not None:
                self.archive.resting = still, resting[still]
            if not (other and self.replaced):
                outcome = self.run_task(task, phase, tol)
                other = self.instead(task, outcome.status)
            if other is None:
                if outcome.status is Status.CONTACT_FAILED and outcome.end.reached == self.t and self.end is not None:
                    raise InconsistentState(outcome.reason)  # the run ends with the phase before
                outcome = pinned(outcome, resting, still)
                if self.decided is None:
                    self._end_phase(outcome.end.reached)
                said = (outcome.method or repr(task.method)).split(" and ")
                self.methods += [method for method in said if method not in self.methods]
                return task, outcome
            run, self.replaced = run._with_method(other), True
            task = run._new_task(call, (self.q, self.qd), self.remembered, tol)
            if self.archive is not None and self.archive.resumed is None:
                self.archive.go_back(self.written)

    def _begin_phase(self, tol):
        """The scene of the next phase, its `Run`, the call of it, and its task, which has the start on its rows.

        Where that takes open gaps below zero, as rounding can, these close first.
        """
        for _ in range(self.gaps.count + 1):
            phase = self._scene(tol)
            run, call = self._run_of(phase)
            task = run._new_task(call, (self.q, self.qd), self.remembered, tol)
            sunk = [] if self.known is not None else self._sunk(task.q)
            if not sunk:
                break
            self.q, self.qd = task.q, task.qd
            self.ended = self.qd
            if self._transit(sunk, sunk=sunk) is not None:
                raise InconsistentState(self.reason)
        return phase, run, call, task

    def _sunk(self, q):
        """Open gaps that are below zero at q, but those that have just opened with a rate."""
        values, modes = self.gaps.at(q, self.remembered[: self.count]), self.modes
        for i, (_, first, rate, rounding) in modes.opened.items():
            values[i] = rate or values[i] - first + rounding
        if not (values < 0.0).any():
            return []
        held = {*modes.closed, *modes.idle, *modes.lifted, *self.gaps.following}
        return [i for i in self.able if values[i] < 0.0 and i not in held]

    def _tol(self):
        """Of the start of a phase: velocities after an impact have the rounding of those before it, and of its time."""
        last = self.qd if self.ended is None else self.ended
        before, after = (1.0 + np.abs(qd).max() for qd in (last, self.qd))
        rounding = RESTS * EPS * abs(self.t) * np.abs(self.qdd).max()
        return max(self.options.initial_tol * max(1.0, before / after), rounding / after)

    def _enter_archive(self):
        """Note how the run of a phase begins; let the archive know, and readers, and write a checkpoint that is due."""
        archive = self.archive
        if self.known is None:
            self.first, self.halting = (self.t, self.q, self.qd, self.remembered), None
        if archive is None:
            return
        archive.before = self.saved
        if archive.resumed is None:
            archive.shift, archive.skips, archive.passed = 0.0, False, []
            self.written = dict(archive.counts)
            archive.look_up(lambda: ({"t": self.t, "between": True}, {}))

    def _sampling(self, kept):
        """The sampled loads of a phase, which go on from those of the one before."""
        if kept.sampled:
            goes_on = self.known is not None or self.call.state is not None
            self.sampling = self.sampling.of(kept) if self.sampling else Sampling(kept, goes_on)
        return self.sampling

    def _ask(self):
        """Ask sampled functions that are due before contacts open or close: that depends on their values."""
        kept = prepared(self._scene_of([], []))
        if kept.sampled:
            self.remembered = self.remembered.copy()
            try:
                self._sampling(kept).take(self.remembered, self.t, self.q, self.qd)
            except Failed as failure:
                raise InvalidForce(str(failure)) from failure.__cause__

    def _run_of(self, phase):
        """The `Run` of a phase, and the call of it."""
        call = RunCall((self.t, self.span[1]))
        return self.run_of(phase, replace(self.options, events=None), call), call

    def _end_phase(self, t):
        if self.kind is None:
            self.kind = self.phases.kind(self.packed, self._record, self.scene.packed, self.gaps)
        self.phases.add(self.kind, self.t, self.rest, t, self.names, (self.inactive, self.values))

    def resume(self, t, run, numbers):
        """As of `Watch`, after events of these numbers: whether the run of the phase goes on, with other velocities.

        It does where the same gaps are closed as before.
        """
        if not self.is_sure:
            return False
        self._end_phase(t)
        before = self.modes
        self.t, (self.q, self.qd, self.qdd), self.remembered = t, run.now.copy(), run.remembered.copy()
        self.ended = self.qd
        remembered = self.remembered
        self.decided = (self._transit([self.watched[i] for i in numbers]),)
        remembers = self.remembered is remembered or np.array_equal(self.remembered, remembered)
        if self.decided[0] is not None or not (remembers and self.modes.same(before)):
            return False
        run.now[1], self.decided = self.qd, None
        self.closing.open(self._starts())
        if self.halting is not None:
            self.halting.since[:] = np.inf  # slips that have turned have their directions from here
        self.again.append(t)
        return True

    def flights(self, groups, memory, reader):
        """As of `Watch`."""
        if not flights.Flights.serve(memory, groups):
            return None
        bounce = self.gaps.restitution[self.able].any() and not self.gaps.rough[self.able].all()
        plain = bounce and not self.frictions.count and self.is_sure and memory.begins_again
        return flights.Flights(self, groups, memory, reader, plain)

    def land(self, flown):
        """As of `Watch`."""
        impacts = flown.impacts()
        for t, i, *_, p, energy in impacts:
            self._end_phase(t)
            self.t = self.rest = t
            self.phases.impulses.append((t, self.gaps.names[int(i)], Impulse(p)))
            self.hits[int(i)] = tuple(flown.parts.hits[int(i)].tolist())
            self.phases.gain(energy)
            self.again.append(t)
        i, *opened = impacts[-1][1:5]
        self.modes, self.at_once = replace(self.modes, opened={int(i): (self.t, *opened)}), 0
        self.q, self.ended, self.qdd, self.qd = flown.parts.struck.copy()
        self.remembered = flown.parts.noted.copy()
        self.judged = self.judged[0], self.judged[1] + flown.numbers.impacts

    def _scene(self, tol=None):
        """The scene of the present modes; tol: as of `_tol`, by default of the present velocities."""
        if self.every and ((self.modes.sharing and self.regular) or (self.switches and not self.modes.grips)):
            phase, start = self._phase_of_modes(self.every), (self.q, self.qd)
            with suppress(DependentRows):
                prepared(phase).start(phase, start, self.t, tol or self._tol(), self.remembered, True)
                return phase
        return self._phase_of_modes()

    def _phase_of_modes(self, every=()):
        holds = [self._hold(i, rank) for i, rank in self.modes.sticking.items()]
        phase = self._scene_of(self._items(), holds, every)
        if self.modes.sharing:
            phase.packed.derived.shares = SharedFriction(self.frictions, self.gaps)
        return phase

    def holds(self):
        """Whether each friction sticks, or is held by what sticks."""
        held = {*self.modes.sticking, *self.modes.blocked}
        return len(held) == self.frictions.count and all(map(self.modes.sticks, self.modes.grips))

    def filled(self):
        """The same, with what the run remembers among its packed numbers."""
        phase = self._scene()
        system = phase.packed.system._replace(reals=phase.packed.system.reals.copy())
        system.reals[system.memory] = self.remembered[self.count :]
        derived = copy(phase.packed.derived)  # without what is of the system
        derived.holds, derived.places = phase.packed.derived.holds, phase.packed.derived.places
        packed = phase.packed._replace(system=system, derived=derived)
        filled = object.__new__(type(phase))
        vars(filled).update(vars(phase), _packed=packed, _prepared=None)
        return filled

    def _items(self):
        return items_of(self.gaps, self.modes)

    def _hold(self, i, rank):
        """The rows that hold a friction, with the numbers that the run remembers."""
        unit = self.frictions.units[i]
        places = [self.count + np.array(unit.held(k)) for k in range(rank)]
        return Hold(unit, rank, self.remembered[np.array(places, int)])

    def _names(self):
        """Names of the units whose rows hold; those that stick stand there twice."""
        held = sorted([*self.modes.closed, *self.modes.idle])
        closed = [self.gaps.names[i] for i in held]
        gripping = [self.gaps.names[i] for i in held if self.modes.sticks(i)]
        frictions = [self.frictions.names[i] for i in sorted([*self.modes.sticking, *self._idle_frictions()])]
        return *dict.fromkeys([*closed, *frictions]), *dict.fromkeys([*gripping, *frictions])

    def _idle_frictions(self):
        """Frictions that others hold, or a motor, without a force."""
        memory, units, off = self.remembered[self.count :], self.frictions.units, {*self.off}
        return [i for i in self.modes.blocked if i not in off and not memory[units[i].way].any()]

    def _events(self, phase):
        """Events of a phase: the user's, then one for each of the units `watched`."""
        pairs = zip(self.users, self.counts, strict=True)
        goes_on = self.end is not None
        found = [
            event._replace(limit=1.0 if event.action else event.limit - count, goes_on=goes_on, length=self.length)
            for event, count in pairs
        ]
        watches = list(self._watches(phase))
        self.watched = [None] * len(found) + [unit for unit, _ in watches]
        return found + [event for _, event in watches]

    def _watches(self, phase):
        """Yield the units that may end a phase, gaps and then frictions, each with its event."""
        gaps, frictions, modes, packed, self.halting = self.gaps, self.frictions, self.modes, phase.packed, None
        if modes.grips:
            yield from self._rubbing(packed)
        else:
            leaving = Reactions(gaps, modes, packed).over
        self.closing = Closing(gaps, self._starts(), modes.lifted)
        for i in self.able:
            if (i in modes.idle and i in gaps.following) or (modes.grips and i in modes.closed):
                continue
            is_open = i not in modes.closed
            function = GroupMember(self.closing.over, i) if is_open else GroupMember(leaving, modes.closed.index(i))
            yield i, Event(function, gaps.names[i], 1.0, -1.0, is_open, not is_open)
        if not frictions.count:
            return
        sticking = list(modes.sticking)
        light = [i for i in modes.limits if i not in modes.sticking]
        loaded, units = [*sticking, *light], [[frictions.units[i] for i in some] for some in (sticking, light)]
        shares = packed.derived.shares if modes.sharing else None
        breaking = Breaking(packed, *units, np.array([modes.limits[i] for i in loaded]), shares).over
        starting, idle = {}, self._idle_frictions()
        if idle:
            _, rates, paces = self._slip_terms_of_frictions()
            starting = {i: 2.0 * STOPPED * paces[i] for i in idle}
        else:
            rates = frictions.sizes(self.q, self.qdd, self.length)
        self.slowing = Slowing(frictions, modes.begun, starting, rates, modes.turning)
        for i in range(frictions.count):
            if i in modes.blocked and i not in starting:
                continue
            function = GroupMember(breaking, loaded.index(i)) if i in loaded else GroupMember(self.slowing.over, i)
            yield gaps.count + i, Event(function, frictions.names[i], 1.0, -1.0)

    def _starts(self):
        """`Closing.open` of the phase: idle gaps count from the depth on that no event leaves."""
        deep = PENETRATION * self.gaps.lengths(self.length)
        return {**self.modes.opened, **{i: (self.t, 0.0, 0.0, deep[i]) for i in self.modes.idle}}

    def _still(self, phase):
        """Coordinates of the bodies that rest where frictions stick."""
        sticks = self.modes.sticking or any(map(self.modes.sticks, self.modes.grips))
        if not sticks or self.q.size > LARGE:
            return np.zeros(0, int)
        return immobile(phase.packed, self.t, self.q, self.qd, self.remembered[self.count :])

    def _rubbing(self, packed):
        """The same of closed contacts where there is friction: their reactions, their bounds, their slips."""
        gaps, modes = self.gaps, self.modes
        pushing, grips = Reactions(gaps, modes, packed), gaps.count + self.frictions.count
        for k, i in enumerate([*pushing.closed, *(grips + i for i in (*pushing.sticks, *pushing.light))]):
            yield i, Event(GroupMember(pushing.over, k), gaps.names[i % grips], 1.0, -1.0, False)
        slides = [i for i in modes.closed if modes.slides(i)]
        known = {} if self.known is None else self.known_fast
        self.halting = Halting(gaps, slides, NEGLIGIBLE * self._slip_terms(slides), modes.rising, known)
        for k, i in enumerate(slides):
            yield grips + i, Event(GroupMember(self.halting.over, k), gaps.names[i], 1.0, -1.0, False)

    def _slip_terms(self, which):
        """Sizes (k,) of the terms of slips at the present velocities."""
        rows = self.gaps.slopes(self.t, self.q, which) if which else np.zeros((0, 2, self.q.size))
        return np.abs(rows).max(axis=1) @ np.abs(self.qd)

    def _times(self):
        left = self.times[self.taken :]
        return left if left.size or self.per_step else np.array([np.inf])  # an empty array would ask for every step

    def _steps_left(self):
        most = self.options.max_steps if self.archive is None else self.archive.most_steps
        return None if most is None else max(most - self.steps, 0)

    def _reporting(self):
        if self.report is silent:
            return silent
        (start, end), t, done = self.span, self.first[0], self.steps

        def report(fraction, at=0.0, steps=0):
            if fraction is not None:
                self.report((t + fraction * (end - t) - start) / (end - start), at, done + steps)

        return report

    # What a phase ends with

    def _after(self, outcome):
        """Take the end of a phase; the Status of the run, None if it goes on."""
        self.end, archive, self.replaced = outcome.end, self.archive, False
        end = self.end
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
        count = len(outcome.rows) if archive is None else archive.counts["outputs"] - self.written["outputs"]
        if not self.per_step and goes_on and count and self.times[self.taken + count - 1] == end.reached:
            count -= 1  # the output of the next phase counts
        self.taken += count
        if archive is None:
            if self.again and outcome.trajectory is not None:
                outcome.trajectory.begin_at(self.again)
            self.parts.append(outcome._replace(rows=outcome.rows[:count]))
            self.kinds.append(self.phases.of[-1])
        else:
            archive.go_back({**archive.counts, "outputs": self.written["outputs"] + count})
            self.totals = summed([end.counts] if self.totals is None else [self.totals, end.counts])
        if self.decided is not None:  # within the run of the phase
            return self.decided[0]
        self.t, self.remembered = end.reached, end.remembered
        self.q, self.qd, self.qdd = (x.copy() for x in end.last)
        self.ended = self.qd
        self.reason = outcome.reason
        self.acted = goes_on and bool(acting)
        if goes_on:
            return self._act(acting, fired, end.last) if acting else self._transit(fired)
        if self._is_deep():
            return Status.CONTACT_FAILED
        if not ends:
            return outcome.status
        self.reason = ""  # which told what ends the phase
        return Status.SUCCESS

    def _is_deep(self, sunk=()):
        """Whether contacts penetrate, but those that a start has taken below zero; says so.

        Notes the gaps, and which are zero within rounding, or below.
        """
        self.gap, lengths = self.gaps.at(self.q, self.remembered[: self.count]), self.gaps.lengths(self.length)
        self.near = (self.gap <= START_ZERO * lengths).nonzero()[0].tolist()
        deep = [i for i in self.near if self.gap[i] < -PENETRATION * lengths[i] and i in self.able and i not in sunk]
        if deep:
            found = listed([self.gaps.names[i] for i in deep], NAMED)
            self.reason = f"Penetration was not noticed: {found}. Give a max_step."
        return bool(deep)

    def _act(self, events, fired, last):
        """Carry out the actions of events; the Status if there is no way on, else None. last: the state (3, n)."""
        change = hybrid.ask(self, events, last)
        if change is None or change._ends:
            return Status.ACTION_FAILED if change is None else Status.EVENT
        before = self._energy(self.packed)
        jump = hybrid.carry_out(self, change)
        if jump is None:
            return Status.ACTION_FAILED
        if (self.qd != jump.qd).any():  # ratchets don't take hold as they would have
            fired = [i for i in fired if i not in self.gaps.following]
        self._ask()
        status = self._transit(fired, False)
        hybrid.report(self, jump)
        if status is None:
            self.phases.gain(self._energy(self._scene().packed) - before)
        return status

    def _energy(self, packed):
        """Kinetic and potential energy, J, of a phase at the present state."""
        t, q, qd, memory = np.array([self.t]), self.q[None], self.qd[None], self.remembered[None, self.count :]
        energy = diagnostics.kinetic_energy(packed.system, q, qd) + diagnostics.potential_energy(packed.system, q)
        for load in packed.loads:
            if getattr(load.force, "potential", None) or hasattr(load.force, "powers"):
                energy = energy + diagnostics.load_powers(packed, load, t, q, qd, memory)[0]
        return float(energy[0])

    # The whole

    def _outcome(self, status, began):
        parts = [each for each in (*self.base._added, *self.base._forces) if each.name in self.switched]
        if named := [each for each in parts if not getattr(each, "unilateral", False)]:
            self.phases.name_switched(named)
        parts, end, archive, events = self.parts, self.end, self.archive, None
        ends = [part.end for part in parts]
        logs = self.options.history is not False and archive is None
        if self.options.events is not None:
            columns = [list(zip(*known, strict=True)) for known in self.found]
            events = tuple([np.concatenate(column[k]) for column in columns] for k in range(3))
        reason = self.reason
        if self.lowered:
            reason += (
                f" Restitution was lowered at {counted(len(self.lowered), 'impact')}, the first at t = "
                f"{min(self.lowered):.9g} s: with friction they would have added energy, or have no solution."
            )
        return Outcome(
            status, reason.strip(),
            range(archive.counts["outputs"]) if archive else np.concatenate([part.rows for part in parts]),
            RunEnd(
                end.reached, end.last, end.remembered, self.totals or summed([end.counts for end in ends]),
                StepLog([end.steps for end in ends]) if logs else None,
                ChartLog([end.charts for end in ends]) if logs else None,
            ),
            PhasePieces([part.trajectory for part in parts], self.kinds) if self.options.dense_output else None,
            events, began, " and ".join(self.methods), self.phases,
        )  # fmt: skip


def pinned(outcome, q, still):
    """The outcome of a phase with bodies that rest at q (n,), to the last bit; still: their coordinates."""
    if not still.size:
        return outcome
    n, last = q.size, outcome.end.last
    if isinstance(outcome.rows, np.ndarray):  # else the archive has done so
        outcome.rows[:, 1 + still] = q[still]
        outcome.rows[:, 1 + n + still] = outcome.rows[:, 1 + 2 * n + still] = 0.0
    last[0, still], last[1:, still] = q[still], 0.0
    trajectory = outcome.trajectory and Pinned(outcome.trajectory, q, still)
    return outcome._replace(trajectory=trajectory)


def begun(scene, t, state=None):
    """A `_ContactRun` from a state (None for the start) at t, with the contacts that stay closed there.

    Raises
    ------
    InconsistentState
        If contacts penetrate, or no reactions keep them from penetrating.
    """
    run = _ContactRun(scene, RunOptions(), RunCall((t, t + 1.0), state=state))
    status = run.begin()
    if status is not None:
        run.refuse(status)
    return run


def first_task(scene, options, call, run_of):
    """The `Task` of a run of the scene, with what `run_contacts` raises before the first step."""
    return _ContactRun(scene, options, call, run_of).check()


def run_contacts(scene, options, call, run_of, run_task, instead, archive=None):
    """The `Task` and the `Outcome` of a run of a scene with contacts; the functions are those of `prepared_run`."""
    run = _ContactRun(scene, options, call, run_of, run_task, instead, archive)
    if archive is not None and archive.known is not None:
        run.restore(*archive.known)
    return run.run()


def phases_of(scene, numbers, arrays):
    """The `Phases` of a file, of a run of this scene; raises KeyError, TypeError or ValueError if they are none."""
    run = object.__new__(_ContactRun)
    run._take_scene(scene)
    return run.restored_phases(numbers, arrays)
