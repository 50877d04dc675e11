"""Runs of scenes with unilateral constraints: phases between events, impacts, openings; `ts.impact`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analyses.contact_problem import LAWS, Gaps, Inertia, NoSolution, closed_gaps, impulses, settle
from ..calls import fitting
from ..errors import (
    InconsistentState,
    InvalidArgument,
    InvalidConstraint,
    InvalidForce,
    SingularConfiguration,
    Status,
    TsdynError,
)
from ..jit.compiled import clock
from ..jit.interrupts import deferred_interrupts
from ..maths.tolerances import EPS
from ..observables import reactions
from ..observables.state import RememberingState, remembered
from ..runs.arguments import interval, output_times, state_arrays
from ..runs.driver import Sampling
from ..runs.events import Event
from ..runs.events import prepare as prepared_events
from ..runs.run_log import ChartLog, RunEnd, StepLog
from ..runs.task import Outcome
from ..validation import damaged, demand, floats, listed
from .phase_scenes import NAMED, has_contacts, phase_of
from .phases import PhasePieces, Phases
from .progress import reporter, silent
from .run_options import RunCall, RunOptions
from .scene_cache import prepared, prepared_numbers
from .segments import summed
from .tolerances import CREEPING, ENDLESS, EVENTS_JUDGED, MOST_AT_AN_INSTANT, PENETRATION, ROUNDED, TOUCHING

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
    """The gap of an open contact, as an event function.

    The gap of a contact that has just opened, with a rate, is divided by the time since: so its next zero is found
    however soon it comes.

    Parameters
    ----------
    gaps : Gaps
    i : int
    start : tuple
        Time, gap and rate where the contact has opened with a rate; else empty.
    """

    def __init__(self, gaps, i, start):
        self.gaps, self.i, self.start = gaps, i, start

    def over(self, states):
        """Values (k,) of states at k times."""
        return self(states.t, states)

    def __call__(self, t, state):
        """The value at a state, or values at several."""
        gap = self.gaps.value(self.i, state.q, state.angles if self.gaps.are_counted else None)
        if not self.start:
            return gap
        begun, first, rate = self.start
        since = np.where(t > begun, t - begun, 1.0)
        return np.where(t > begun, (gap - first) / since, rate)


class _Leaving:
    """The reaction of a closed contact, positive where it pushes, as an event function.

    Parameters
    ----------
    packed : Packed
        Of the phase.
    row : int
    sign : float
        Of the gap over Phi.
    seen : dict
        What is shared with the other contacts of the phase.
    """

    def __init__(self, packed, row, sign, seen):
        self.packed, self.row, self.sign, self.seen = packed, row, sign, seen

    def over(self, states):
        """Values (k,) of states at k times."""
        key = states.t.tobytes(), states.q.tobytes()
        if key not in self.seen:  # those of other contacts at the same times are found with it
            self.seen.clear()
            memory = np.tile(states.memory, (states.t.size, 1))
            levels = states.t, states.q, states.qd, states.qdd, memory
            self.seen[key] = reactions.multipliers(self.packed, *levels)
        return -self.sign * self.seen[key][:, self.row]

    def __call__(self, t, state):
        """The value at one state."""
        return -self.sign * state.multipliers[self.row]


def demand_apart(gaps, q, angles, tol):
    """Raise InconsistentState where contacts penetrate."""
    values = gaps.at(q, angles)
    deep = np.flatnonzero(values < -tol * (1.0 + np.abs(q).max()))
    if deep.size:
        found = listed([f"{gaps.names[i]} by {-values[i]:.3g}" for i in deep], NAMED)
        raise InconsistentState(
            f"contacts penetrate at the start (m, or rad): {found}. Move the bodies apart, or have scene.assemble() "
            "close these contacts."
        )


@dataclass
class Modes:
    """The modes of the units of a scene: numbers of gaps."""

    closed: list = field(default_factory=list)  # independent rows, with reactions
    idle: list = field(default_factory=list)  # closed by what others hold
    opened: dict = field(default_factory=dict)  # time, gap and rate where a contact has just opened with a rate

    def saved(self):
        """Lists of numbers, for JSON: one for each field, of a dict its items."""
        return [list(value.items()) if isinstance(value, dict) else value for value in vars(self).values()]

    @classmethod
    def of(cls, record):
        """As it was when it was saved."""
        pairs = zip(vars(cls()).items(), record, strict=True)
        return cls(*(dict(known) if isinstance(value, dict) else known for (_, value), known in pairs))


# Numbers of a run that a checkpoint holds as they are, and the names of its arrays
KEPT = "t", "rest", "counts", "steps", "taken", "at_once", "judged", "methods", "again", "written", "totals"
PREFIX = "phase "
# What a phase raises that can't begin, after others: whose fault it is
FAILURES = {
    InvalidArgument: Status.EVENT_FAILED, InvalidForce: Status.SAMPLING_FAILED, SingularConfiguration: Status.SINGULAR,
}  # fmt: skip


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
    archive : Archive, optional
        What outputs and histories go to.
    """

    def __init__(self, scene, options, call, run_of=None, run_task=None, instead=None, archive=None):
        self._take_scene(scene)
        self.options, self.call, self.archive = options, call, archive
        self.run_of, self.run_task, self.instead = run_of, run_task, instead
        self.span = interval(call.t_span)
        self.times = output_times(call.t_eval, *self.span)
        self.per_step, self.taken = self.times.size == 0, 0
        kept = prepared(phase_of(scene, []))
        self._demand_served(kept)
        gaps, self.count = self.gaps, kept.handles.count
        self.t = self.span[0]
        self.q, self.qd = scene._initial() if call.state is None else state_arrays(call.state, kept.n)
        self.remembered = remembered(call.state, kept, self.t, self.q)
        self.length = max(scene.packed.size, float(np.abs(self.q).max()))
        demand_apart(gaps, self.q, self.remembered[: self.count], options.initial_tol)
        self.users = prepared_events(options.events) or []
        self.rest = self.t
        self.parts, self.found, self.report = [], [[] for _ in self.users], reporter(call.progress)
        self.phases, self.counts, self.steps = Phases(scene.packed), [0] * len(self.users), 0
        self.reason, self.methods, self.at_once, self.judged = "", [], 0, (self.t, 0)
        self.sampling, self.end, self.totals = None, None, None  # of the last phase; counts of those in the archive
        self.goes_on = False  # whether a checkpoint is gone on with
        self.again, self.written = False, {}  # whether the phase is by the other method; rows in the archive before it

    def _take_scene(self, scene):
        """What follows from the scene alone, and makes the scenes of its phases."""
        self.scene, self.gaps, self.modes = scene, Gaps(scene.packed), Modes()

    def _demand_served(self, kept):
        if kept.rough:
            raise InvalidArgument(
                f"friction that depends on reactions ({', '.join(kept.rough)}) doesn't serve scenes with contacts yet: "
                "use friction of given magnitude, such as ViscousFriction."
            )

    def run(self):
        """Run to the end; the `Task` of the last phase, of the whole scene, and the `Outcome` of all."""
        began, task, status = clock(), None, None if self.goes_on else self.begin()
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
        except TsdynError as error:
            if self.end is None:
                raise
            status, self.reason = FAILURES.get(type(error), Status.CONTACT_FAILED), str(error)
        finally:
            self.report(None)
        if self.end is None:
            self.refuse(status)
        return self._whole(task or self._first_task()), self._outcome(status, began)

    def _whole(self, task):
        """A task as that of the whole run."""
        return task._replace(prepared=prepared_numbers(self.scene), span=self.span)

    def begin(self):
        """Impact and closed contacts at the start; the Status if there is no way on, else None."""
        touching = closed_gaps(self.gaps, self.q, self.remembered[: self.count], self.options.initial_tol)
        return self._settle(touching, ())

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
        phase, names = self._scene(), self._names()
        kind = self.phases.kind(phase.packed, self.modes.saved())
        run, call = self._run_of(phase)
        run._prepare_kernels(True)
        self._enter_archive()
        while True:
            task = run._new_task(call, (self.q, self.qd), self.remembered)
            task = task._replace(
                events=self._events(phase), within=True, report=self._reporting(), times=self._times(),
                max_steps=self._steps_left(), archive=self.archive, sampling=self._sampling(task.prepared),
            )  # fmt: skip
            other = self.instead(task, Status.STEP_COLLAPSED) if self.again else None
            if other is None:
                outcome = self.run_task(task, phase, self.options.initial_tol)
                other = self.instead(task, outcome.status)
            if other is None:
                self.phases.add(kind, self.t, self.rest, outcome.end.reached, names)
                said = (outcome.method or repr(task.method)).split(" and ")
                self.methods += [method for method in said if method not in self.methods]
                return task, outcome
            run, self.again = run._by(other), True
            if self.archive is not None and self.archive.resumed is None:
                self.archive.go_back(self.written)

    def _enter_archive(self):
        """Let the archive know that a phase begins; readers, and a checkpoint that is due."""
        archive = self.archive
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
            known = self.sampling
            self.sampling = known.of(kept) if known else Sampling(kept, self.goes_on or self.call.state is not None)
        return self.sampling

    def _run_of(self, phase):
        """The `Run` of a phase, and the call of it."""
        call = RunCall((self.t, self.span[1]))
        return self.run_of(phase, replace(self.options, events=None), call), call

    def _scene(self):
        """The scene of the present modes."""
        return phase_of(self.scene, [self.gaps.list[i].side.row for i in self.modes.closed])

    def scene_of(self, record):
        """The scene of modes as they are saved."""
        present, self.modes = self.modes, Modes.of(record)
        scene, self.modes = self._scene(), present
        return scene

    def _names(self):
        """Names of the units whose rows hold."""
        held = sorted([*self.modes.closed, *self.modes.idle])
        return tuple(dict.fromkeys(self.gaps.names[i] for i in held))

    def _events(self, phase):
        """Events of a phase: the user's, then one for each of the units `watched`."""
        pairs = zip(self.users, self.counts, strict=True)
        found = [event._replace(limit=event.limit - count) for event, count in pairs]
        watches = list(self._watches(phase.packed))
        self.watched = [None] * len(found) + [unit for unit, _ in watches]
        return found + [event for _, event in watches]

    def _watches(self, packed):
        """Yield the units that may end a phase, each with its event."""
        gaps, modes, pushes = self.gaps, self.modes, {}
        first = {id(member.constraint): member.rows.start for member in packed.members}
        for i in range(gaps.count):
            if i in modes.idle:
                continue
            row, sign = gaps.list[i].side.row, gaps.list[i].side.sign
            if i in modes.closed:
                event = _Leaving(packed, first[id(row)], sign, pushes)
            else:
                event = _Closing(gaps, i, modes.opened.get(i, ()))
            yield i, Event(event, gaps.names[i], 1.0, -1.0, i not in modes.closed)

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
        self.end, gaps = outcome.end, self.gaps
        end, archive, self.reason, self.again = self.end, self.archive, outcome.reason, False
        self.steps += end.counts["steps"]
        times, *states = outcome.events
        for i, mine in enumerate(list(zip(times, *states, strict=True))[: len(self.users)]):
            self.found[i].append(mine)
            self.counts[i] += len(mine[0])
        self.t, (self.q, self.qd, _) = end.reached, (x.copy() for x in end.last)
        self.remembered = end.remembered
        fired = [i for i, at in zip(self.watched, times, strict=True) if i is not None and at.size]
        goes_on = outcome.status is Status.EVENT and fired and self.t < self.span[1]
        count = len(outcome.rows) if archive is None else archive.counts["outputs"] - self.written["outputs"]
        if not self.per_step and goes_on and count and self.times[self.taken + count - 1] == self.t:
            count -= 1  # the output of the next phase counts
            outcome = outcome._replace(rows=outcome.rows[:count])
            if archive is not None:
                archive.go_back({**archive.counts, "outputs": self.written["outputs"] + count})
        self.taken += count
        self.phases.rows.append(count)
        if archive is None:
            self.parts.append(outcome)
        else:
            self.totals = summed([end.counts] if self.totals is None else [self.totals, end.counts])
        values = gaps.at(self.q, self.remembered[: self.count])
        deep = [i for i in range(gaps.count) if values[i] < -PENETRATION * self.length]
        if deep:
            self.reason = (
                f"Penetration was not noticed: {listed([gaps.names[i] for i in deep], NAMED)}. Give a max_step."
            )
            return Status.CONTACT_FAILED
        if not goes_on:
            return Status.SUCCESS if outcome.status is Status.EVENT and fired else outcome.status
        self.reason = ""
        if self._is_stuck():
            return Status.CONTACT_FAILED
        near = [i for i in range(gaps.count) if values[i] <= TOUCHING * self.length]
        return self._settle(sorted({*near, *fired, *self.modes.closed, *self.modes.idle}), fired)

    def _is_stuck(self):
        """Whether events no longer let time go on; says so."""
        since, count = self.judged
        length = self.t - self.phases.starts[-1]
        self.at_once = self.at_once + 1 if length <= 16.0 * EPS * max(abs(self.t), EPS) else 0
        self.judged = since, count + 1
        if self.at_once > MOST_AT_AN_INSTANT + self.gaps.count:
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
        slots, values = self.remembered[self.count :], self.gaps.at(self.q, self.remembered[: self.count])
        before, self.modes, self.rest = self.modes, Modes(), self.t
        if not touching:
            return None
        try:
            inertia = Inertia(self.gaps, self.t, self.q, self.qd, slots)
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
        p = impulses(inertia, touching, before, e)
        return p, *jumped(inertia, self.qd if qd is None else qd, touching, before, e, p)

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
        parts, end, archive, events = self.parts, self.end, self.archive, None
        ends = [part.end for part in parts]
        logs = self.options.history is not False and archive is None
        if self.options.events is not None:
            columns = [list(zip(*known, strict=True)) for known in self.found]
            events = tuple([np.concatenate(column[k]) for column in columns] for k in range(3))
        return Outcome(
            status, self.reason,
            range(archive.counts["outputs"]) if archive else np.concatenate([part.rows for part in parts]),
            RunEnd(
                end.reached, end.last, end.remembered, self.totals or summed([end.counts for end in ends]),
                StepLog([end.steps for end in ends]) if logs else None,
                ChartLog([end.charts for end in ends]) if logs else None,
            ),
            PhasePieces([part.trajectory for part in parts]) if self.options.dense_output else None,
            events, began, " and ".join(self.methods), (self.phases, self.phases.of_rows),
        )  # fmt: skip

    # Checkpoints: what a run goes on with, where its present phase begins

    def saved(self):
        """Numbers and arrays by name."""
        phases, arrays = self.phases.saved()
        numbers = {name: getattr(self, name) for name in KEPT} | {"modes": self.modes.saved(), "phases": phases}
        arrays |= {"q": self.q, "qd": self.qd, "remembered": self.remembered}
        if self.end is not None:
            arrays |= {"last": self.end.last, "ended": self.end.remembered}
            numbers["reached"] = self.end.reached
        for i, found in enumerate(self.found):
            columns = zip(*found, strict=True) if found else (np.empty(0), *2 * [np.empty((0, self.q.size))])
            for name, column in zip(("t", "q", "qd"), columns, strict=True):
                arrays[f"event {i}.{name}"] = np.concatenate(column) if found else column
        return {"phases": numbers}, {f"{PREFIX}{name}": array for name, array in arrays.items()}

    def restore(self, numbers, arrays):
        """As it was when it was saved."""
        with damaged("the checkpoint"):
            known, n, self.goes_on = numbers["phases"], self.q.size, True
            arrays = _own(arrays)
            vars(self).update({name: known[name] for name in KEPT})
            self.modes = Modes.of(known["modes"])
            self.phases.restore(known["phases"], arrays, self.scene_of)
            shapes, self.q, self.qd = (n,), arrays["q"], arrays["qd"]
            demand(self.q.shape == self.qd.shape == shapes, "the start of a phase")
            demand(arrays["remembered"].shape == self.remembered.shape, "what is remembered")
            self.remembered = arrays["remembered"]
            if "reached" in known:
                demand(arrays["last"].shape == (3, n), "the end of a phase")
                self.end = RunEnd(known["reached"], arrays["last"], arrays["ended"], self.totals, None, None)
            for i, found in enumerate(self.found):
                found.append(tuple(arrays[f"event {i}.{name}"] for name in ("t", "q", "qd")))


def jumped(inertia, qd, which, before, e, p, law="newton"):
    """Velocities (n,) after impulses p (k,) of the gaps `which`, and the rates (count,) of all gaps then."""
    change = inertia.free(inertia.J[which].T @ p)
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


def recorded(numbers, arrays):
    """Numbers and arrays of the `Phases` in a checkpoint."""
    return numbers["phases"]["phases"], _own(arrays)


def _own(arrays):
    return {name.removeprefix(PREFIX): array for name, array in arrays.items() if name.startswith(PREFIX)}


def phases_of(scene, numbers, arrays):
    """The `Phases` of a file, of a run of this scene; raises KeyError, TypeError or ValueError if they are none."""
    run, phases = object.__new__(_ContactRun), Phases(scene.packed)
    run._take_scene(scene)
    phases.restore(numbers, arrays, run.scene_of)
    return phases


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
    gaps, kept = Gaps(scene.packed), prepared(phase_of(scene, []))
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
    inertia = Inertia(gaps, t, q, qd, slots)
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
