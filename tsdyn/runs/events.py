"""Events: users' functions of time and state, and their zeros inside every step, on states of the manifold."""

import math
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from ..elements.bodies import largest_of_kind, turning
from ..errors import InvalidArgument, Status
from ..jit.interrupts import deferred_interrupts
from ..jit.kernels import resident, twin
from ..maths.root_isolation import LARGEST, Search, TooFast
from ..maths.tolerances import EPS, MOST_SCALED
from ..model.handles import handles_of
from ..model.joint_turns import find_counted_angles
from ..observables.state import EventInstant
from ..validation import demand, demand_arguments, demand_numbers, is_count, number
from . import tolerances as limits
from .event_groups import Group, GroupMember, States
from .run_memory import Memory, end_run, is_at_stop

# Users' event functions of time and state, with the attributes `terminal` and `direction` of SciPy's solve_ivp.


class Event(NamedTuple):
    """One of a user's functions."""

    function: object
    name: str
    limit: float  # occurrences that end the run; inf for never
    direction: float  # of the changes that count; 0 for both
    exact: bool = False  # whether a value at the start that is positive is no rounding of zero
    falls: bool = False  # of a `GroupMember`: whether it may begin at zero within rounding, and fall at once
    action: object = None  # a function of a `Change` that each occurrence calls, or None
    goes_on: bool = False  # whether the run has begun before, and a zero at the start has been counted
    length: float = 0.0  # m: rounding of positions is relative to it, too

    def value(self, t, instant):
        """The function's value; raises `EventFailed`."""
        try:
            given = self.function(t, instant)
        except Exception as error:
            raise EventFailed(
                f"{self.name} raised {type(error).__name__} at t = {t:.9g} s: {str(error).rstrip('.')}.", t
            ) from error
        value = number(given)
        if not math.isfinite(value):
            raise EventFailed(f"{self.name} must return a finite number; at t = {t:.9g} s it gave {given!r}.", t)
        return value


class EventFailed(Exception):
    """An event function raised, or gave no finite number; t is when, s, and status how the run ends."""

    def __init__(self, message, t, status=Status.EVENT_FAILED):
        super().__init__(message)
        self.t, self.status = t, status


def prepare(events):
    """Check a user's events; a list of `Event`, or None."""
    if events is None:
        return None
    if callable(events):
        events = [events]
    if not isinstance(events, (list, tuple)):
        raise InvalidArgument(f"events must be a function f(t, state), or a list of them, got {events!r}.")
    found = []
    for i, function in enumerate(events):
        name = f"event {i} ({getattr(function, '__name__', type(function).__name__)})"
        if not callable(function):
            raise InvalidArgument(f"events must be functions f(t, state); events[{i}] is {function!r}.")
        terminal, direction = getattr(function, "terminal", None), getattr(function, "direction", 0.0)
        limit = 0.0 if terminal is None else float(terminal) if isinstance(terminal, bool) else number(terminal)
        if not (limit >= 0.0 and limit == math.floor(limit) < math.inf):
            raise InvalidArgument(
                f"{name}: terminal must be True, False or a number of occurrences, 0 or more, got {terminal!r}."
            )
        if math.isnan(number(direction)):
            raise InvalidArgument(f"{name}: direction must be a number, of which the sign counts, got {direction!r}.")
        action = getattr(function, "action", None)
        if action is not None and not callable(action):
            raise InvalidArgument(f"{name}: action must be a function action(change), got {action!r}.")
        if action is not None:
            demand_arguments(action, f"{name}: action", ("change",))
        found.append(Event(function, name, limit or math.inf, number(direction), action=action))
    return found


UNSEARCHED, UNBEGUN, NOT_BEGUN = 1, 2, 3  # how flights end: a step isn't searched, a run is to begin again, or can't

# States inside the last step of a run, for event location.

ROOM = 64  # states that are kept
at_stop = twin(is_at_stop)


class Inside:
    """States within the step that a run has just made."""

    def __init__(self, reader, run, log, start, spins):
        (self.t0, before, self.near), self.t1, self._spins = start, run.clock.t, spins
        self.memory = run.remembered[self.near.size :]
        self.just = math.nextafter(self.t1, self.t0) if at_stop(run, log) else self.t1
        t0 = self.t0
        self.reader, self.steps = reader, (run.block, log.charts, log.points)
        self.known = {t0: before, self.t1: run.now.copy()}

    @cached_property
    def turning(self):
        """The fastest turn of a body, rad/s, at both ends."""
        rates = np.array([self.known[t][1] for t in (self.t0, self.t1)]).take(self._spins, axis=1)
        rates *= rates
        return 2.0 * math.sqrt(rates.sum(axis=2).max(initial=0.0))

    def before_stop(self, times):
        """Times (k,), but just before the end where loads may jump there: the step is that of those before."""
        return np.minimum(times, self.just)

    def states(self, times):
        """States (3, n) at times (k,), None where there is none."""
        times, known = times.tolist(), self.known
        # States that are known already are not read again
        missing = [t for t in times if t not in known]
        if missing:
            found = dict(zip(missing, self._read(np.array(missing)), strict=True))
            if len(known) > ROOM:
                return [found[t] if t in found else known[t] for t in times]
            known.update(found)
        return [known[t] for t in times]

    def levels(self, times):
        """The same (k, 3, n), NaN where there is none; accelerations may be missing; not kept."""
        rows = np.zeros(times.size, int)
        found, status = self.reader(times, rows, self.steps[0][None], *self.steps[1:], False)
        if status != Status.SUCCESS:
            none = np.full_like(self.known[self.t0], np.nan)
            return np.reshape([none if state is None else state for state in self.states(times)], (-1, *none.shape))
        if times.size and times[-1] == self.t1:
            found[-1] = self.known[self.t1]
        return found

    def _read(self, times):
        rows = np.zeros(times.size, int)
        states, status = self.reader(times, rows, self.steps[0][None], *self.steps[1:])
        if status == Status.SUCCESS:
            return states
        return [self._read(times[i : i + 1])[0] for i in range(times.size)] if times.size > 1 else [None]

    def at(self, t, whole=True):
        """The state (3, n) at t; unless it is to be whole, accelerations may be missing."""
        state = self.known.get(t)
        if state is None:
            (state,) = (self.states if whole else self.levels)(np.array([t]))
        if state is None:
            raise EventFailed(f"there is no state at t = {t:.9g} s to evaluate events at.", t)
        return state


# Event location: zeros of users' functions inside every step, on states of the manifold.
#
# The driver is called one step at a time and is unaware of events, so events change no step. Functions are sampled on
# the dense output of the step, as finely as each requires (root_isolation.py), and Brent's method locates the zeros. A
# sign change is an event. A zero value is an event, too: exact at a sampled time, or within rounding where the function
# touches zero without a sign change. A touch counts once, in either direction.


class Occurrence(NamedTuple):
    """An event found."""

    t: float
    index: int
    state: np.ndarray  # (3, n)


@cache
def _signs(n):
    """Random signs (3, 3, n)."""
    return np.random.default_rng(0).choice([-1.0, 1.0], (3, 3, n))


class Track:
    """What is known of one function up to the last step's end."""

    def begin(self, t, value, has_sign):
        """Take the value at t, the start of a run; has_sign: whether it is no rounding of zero where it is positive."""
        self.value = self.end = value  # at that time, and at the end of the present step
        self.sign = 0.0  # the last it had; 0 for none yet
        self.significant = None  # time and value at which it had that sign
        if has_sign and value != 0.0:
            self.sign, self.significant = math.copysign(1.0, value), (t, value)
        self.zero = None  # time of the last zero, if it has had no sign since
        self.passed = self.pending = False  # that zero is a start within rounding; may become an event on being left
        self.noise = 0.0  # rounding error of the values, once measured
        self.degree = 0  # that the last step needed


class Watch:
    """The events of one run: what is known of the functions, and what has been found.

    `resume` has

        resume(t, run, numbers)         whether the run goes on after events of these numbers, with other velocities
        flights(groups, memory, reader) the `Flights` of a memory, in which Python has nothing to do; None for none
        land(flights)                   takes the impacts of the last flight

    Attributes
    ----------
    t : float, s
        The time up to which events have been searched.
    """

    def __init__(self, events, packed, reader, start, resume=None):
        self.events, self.packed, self.resume, self.begins_again = events, packed, resume, False
        self.start = self.t = start
        self.state = self.memory = None  # at t, and what is remembered of it: joints' angles, and what forces do
        self.angles = handles_of(packed).count
        self._resident = (None,)  # a run, its address, and what keeps that
        self.beside = None  # the start of the present step, for `EventInstant`
        self.tracks = None
        self.list = [[] for _ in events]
        rigid = packed.system.bodies[packed.system.bodies[:, 1] == 7, 0]
        self._p = rigid[:, None] + np.arange(3, 7)
        self._n = int(packed.system.bodies[:, 1].sum())
        groups = {}  # numbers of events, by the function that evaluates them together
        for i, event in enumerate(events):
            if isinstance(event.function, GroupMember):
                groups.setdefault(event.function.over, []).append(i)
        self._groups = [Group(over, events, numbers, self._p, self._n, self.angles) for over, numbers in groups.items()]
        self._group_of = {i: group for group in self._groups for i in group.numbers}
        self._members = list(self._group_of)
        self._single = [i for i in range(len(events)) if i not in self._group_of]
        self.read_by(reader)

    def read_by(self, reader):
        """Take a reader of the steps that are watched from now on."""
        none, self.reader, self.flies = np.empty(0), reader, None
        reader(none, none.astype(int), np.empty((0, 0)), np.empty((0, 0)), np.empty((0, 0)))  # loads the kernel

    def found(self, n):
        """Times, positions and velocities of each event."""
        times = [np.array([each.t for each in found]) for found in self.list]
        states = [np.array([each.state for each in found]).reshape(-1, 3, n) for found in self.list]
        return times, *([np.ascontiguousarray(state[:, i]) for state in states] for i in (0, 1))

    def advance(self, memory, log, most):
        """As `Memory.advance`; the Status, and what there is to say of it."""
        run = memory.run
        # The first call begins the run and takes the values at its start
        if not run.numbers.begun:
            status = memory.advance(log, -1)
            if not run.numbers.begun:
                return status, ""
            try:
                self._begin(run, self.tracks is None)
            except EventFailed as failure:
                if failure.status is Status.CONTACT_FAILED or any(event.goes_on for event in self.events):
                    return failure.status, str(failure)
                raise InvalidArgument(f"events: {failure}") from failure.__cause__
        stiff, answer = run.numbers.stiff, getattr(memory, "answer", None)  # of sampled loads
        if self.flies is None:
            self.flies = self._flights(memory)
        # One step at a time, searched before the next one
        while most > 0:
            if self.begins_again:
                status, reason = self._begin_again(memory, log)
                if status != Status.SLICE_DONE:
                    return status, reason
                most -= 1
                continue  # it has written an output
            done = run.numbers.steps
            if self.flies:
                with deferred_interrupts():
                    status, rows, unsearched = self._fly(run, log, most)
            else:
                status, rows = memory.advance(log, 1) if answer is None else memory.step(log), 1
                unsearched = run.numbers.steps > done
            most -= rows
            if unsearched:
                try:
                    last = self._search_step(run, log)
                except EventFailed as failure:
                    return failure.status, str(failure)
                if last is not None and not self._is_resumed(memory, last):
                    ends = (i for i in self._single if self._ends(i) and not self.events[i].action)
                    which = next(ends, last.index)
                    return Status.EVENT, f"It was {self.events[which].name} at t = {last.t:.9g} s."
                status = Status.SLICE_DONE if self.begins_again else status
                if self.begins_again and log.t_eval.size:  # outputs of the slice may have to be taken back
                    status, reason = self._begin_again(memory, log)
                    if status != Status.SLICE_DONE:
                        return status, reason
            if answer is not None and status == Status.SLICE_DONE:
                status = answer(log)
            if unsearched and status == Status.SLICE_DONE and not self.begins_again and at_stop(run, log):
                try:
                    last = self._cross_stop(run, log)
                except EventFailed as failure:
                    return failure.status, str(failure)
                if last is not None and not self._is_resumed(memory, last):
                    return Status.EVENT, f"It was {self.events[last.index].name} at t = {last.t:.9g} s."
            full = run.numbers.chart_rows + 2 >= len(log.charts)
            if status != Status.SLICE_DONE or full or run.numbers.stiff != stiff:  # stiffness ends the call
                return status, ""
        return status, ""

    def _flights(self, memory):
        """The `Flights` of a memory; False where there are none."""
        if self.resume is None or self._single or not self._groups or not isinstance(memory, Memory):
            return False
        return self.resume.flights(self._groups, memory, self.reader) or False

    def _fly(self, run, log, most):
        """Make steps and impacts; the Status, how many rows of the log that took, whether a step is to be searched."""
        flights, numbers = self.flies, self.flies.numbers
        status = flights.advance(log, most)
        if numbers.impacts:
            self.resume.land(flights)
            self.start = numbers.last
        self.begins_again, unsearched = numbers.ended == UNBEGUN, numbers.ended == UNSEARCHED
        if unsearched:
            for group, result in zip(flights.groups[: numbers.searched], flights.parts.results.tolist(), strict=False):
                group.kernel.result = result
            self.t, self.state, self.memory = numbers.t0, flights.parts.before.copy(), flights.parts.remembered.copy()
        else:
            self.t, self.state, self.memory = run.clock.t, run.now.copy(), run.remembered.copy()
        if numbers.ended == NOT_BEGUN:
            if run.numbers.begun:
                for group in flights.groups:
                    self._at_start(group)  # says why
            run.numbers.begun = 1  # there is a run so far
        return status, numbers.used, unsearched

    def _begin(self, run, anew):
        """Take the values at the start of a run, or where it begins `anew` after a jump."""
        self.state, self.memory = run.now.copy(), run.remembered.copy()
        self._note_start()
        if not anew:
            return
        again = self.tracks is not None
        self.tracks = self.tracks or [Track() for _ in self.events]
        for group in self._groups:
            group.begin(self._at_start(group))
        for i in self._single:
            track = self.tracks[i]
            track.begin(self.t, self._value(i, self.t, self.state), False)
            if (again or self.events[i].goes_on) and abs(track.value) <= self._shaken(i, self.t, lambda _: self.state):
                track.zero, track.passed = self.t, True

    def _is_resumed(self, memory, last):
        """Whether the run goes on from the event that ends it, in the same memory, with other velocities."""
        run, is_member = memory.run, isinstance(self.events[last.index].function, GroupMember)
        if self.resume is None or not is_member or not memory.begins_again or last.t >= run.clock.t_end:
            return False
        if any(self.list[i] and (self.events[i].action or self._ends(i)) for i in self._single):
            return False
        self.begins_again = self.resume.resume(last.t, run, [i for i in self._members if self.list[i]])
        return self.begins_again

    def _ends(self, i):
        """Whether event i has occurred as often as ends the run."""
        return len(self.list[i]) >= self.events[i].limit

    def _begin_again(self, memory, log):
        """Begin the run again where it is; the Status, and what there is to say of it."""
        run, t = memory.run, memory.run.clock.t
        self.begins_again, self.start = False, t
        for i in self._members:
            self.list[i].clear()
        status = memory.begin_again(log)
        if not run.numbers.begun:
            run.numbers.begun = 1  # there is a run so far
            return status, ""
        try:
            self._begin(run, True)
        except EventFailed as failure:
            return failure.status, str(failure)
        return status, ""

    def saved(self):
        """What is known and found between two steps: numbers, and arrays by name."""
        for group in self._groups:
            group.lend_all(self.tracks, self.t)
        found = [each for mine in self.list for each in mine]
        numbers = {"t": self.t, "tracks": [vars(track) for track in self.tracks], "found": [each[:2] for each in found]}
        numbers |= {"start": self.start, "begins_again": self.begins_again}
        states = np.array([each.state for each in found]).reshape(-1, *self.state.shape)
        return numbers, {"watch.state": self.state, "watch.memory": self.memory, "watch.found": states}

    def restore(self, numbers, arrays):
        """As it was when it was saved."""
        self.t, self.state, self.memory = numbers["t"], arrays["watch.state"], arrays["watch.memory"]
        self.start, self.begins_again = float(numbers["start"]), bool(numbers["begins_again"])
        demand(self.state.shape == (3, self._n) and len(self.memory) >= self.angles, "the state of events")
        self.tracks = [Track() for _ in self.events]
        for track, known in zip(self.tracks, numbers["tracks"], strict=True):
            track.begin(0.0, 0.0, False)
            if known["significant"] is not None:
                t, value = map(float, known["significant"])
                known = known | {"significant": (t, value)}
            demand_numbers(known | {"significant": None}, vars(track), ("significant", "zero"))
            vars(track).update(known)
        for group in self._groups:
            group.take_all(self.tracks)
        self.list = [[] for _ in self.events]
        for (t, index), state in zip(numbers["found"], arrays["watch.found"], strict=True):
            demand(is_count(index), "the number of an event")
            self.list[index].append(Occurrence(float(t), index, state))

    def go_back(self, run, log):
        """Let the run end where events were searched last."""
        if self.state is not None and run.clock.t > self.t:
            run.remembered[:] = self.memory
            self._end(run, log, self.t, self.state, self.t)

    def _note_start(self):
        self.beside = self.t, self.state, self.memory[: self.angles]

    def _instant(self, t, state):
        return EventInstant(self.packed, self.memory[self.angles :], self.beside, t, state)

    def _counted(self, times, levels):
        """Counted angles (k, angles) at times t (k,) within the step, levels (k, 3, n)."""
        t0, state, near = self.beside
        joints, out = handles_of(self.packed), np.empty((times.size, self.angles))
        rows = levels.reshape(times.size, 3 * self._n)
        find_counted_angles(joints.joints.ravel(), joints.frames, state, near, times - t0, rows, out)
        return out

    def _value(self, i, t, state):
        event = self.events[i]
        if isinstance(event.function, GroupMember):
            over, which = event.function.over, event.function.which
            return self._finite(i, t, float(over(self._states(np.array([t]), state[None]))[0, which]))
        return event.value(t, self._instant(t, state))

    def _finite(self, i, t, value):
        """The value of a member of a group; raises `EventFailed`."""
        if not math.isfinite(value):
            text = f"The reaction of {self.events[i].name} isn't determined at t = {t:.9g} s: the state is singular."
            raise EventFailed(text, t, Status.CONTACT_FAILED)
        return value

    def _states(self, times, levels):
        """What groups are given: times t (k,), levels (k, 3, n)."""
        memory = self.memory[self.angles :]
        return States(times, levels, memory, lambda: self._counted(times, levels), self.beside)

    def _sample(self, group, times, levels):
        """Values (k, members) of a group."""
        return group.over(self._states(times, levels))[:, group.which]

    def _at_start(self, group):
        """Values (members,) of a group where it begins."""
        finite = False
        if group.kernel is not None:
            values, finite = group.kernel.at(*self.beside, self.memory[self.angles :])
        if not finite:  # as where dependent rows share reactions, which a kernel doesn't know of
            group.kernel = None
            values = self._sample(group, np.array([self.t]), self.state[None])[0]
            finite = np.isfinite(values).all()
        if not finite:
            for i, value in zip(group.numbers, values, strict=True):
                self._finite(i, self.t, value)
        return values

    def _search_step(self, run, log):
        """Look at the step just made; the `Occurrence` that ends the run, or None."""
        self._note_start()
        known = self.t, self.state, self.memory
        self.memory = run.remembered.copy()
        try:
            return self._locate(run, log, Inside(self.reader, run, log, self.beside, self._p))
        except KeyboardInterrupt:
            self.memory = known[2]
            raise
        except EventFailed:
            if self._groups:  # beyond a failure nobody looks for the ends of a phase
                self.t, self.state, self.memory = known
                self.go_back(run, log)
            raise

    def _locate(self, run, log, step):
        found, failure, end = [], None, step.t1
        members = {}
        for group in self._groups:
            first, alone = group.search_by_kernel(step) or self._search_group(group, step)
            if first is not None:
                i, t = first
                if not self.events[i].exact:
                    shift = self._least_time(step, step.t0, end) + limits.ROOT * abs(t)
                    t = self._beyond(i, step, t, shift, end, self.events[i].direction)
                found.append(Occurrence(t, i, step.at(t)))
                end = min(end, t)
            for i in alone:
                members[group.numbers[i]] = group, i
                group.lend(self.tracks[group.numbers[i]], i, step.t0)
        for i in sorted([*self._single, *members]) if members else self._single:
            # Times that bracket the zeros of event i. Of a member beyond the end, too, where it can be followed: gaps
            # that close at one instant are searched for a change of sign, not for rounding of zero
            beyond = step.t1 if i in members else end
            points, failed = self._points(i, step, beyond)
            if failed is not None and beyond > end:
                points, failed = self._points(i, step, end)
            if failed is not None:
                failure, end = failed, min(end, failed.t)
            try:
                # Events among them
                mine = self._walk(i, step, points)
            except EventFailed as failed:
                mine, failure, end = [], failed, min(end, failed.t)
            found += mine
            if i in members:
                members[i][0].take_back(self.tracks[i], members[i][1])
            # The run ends with the event that reaches its limit
            last = self.events[i].limit - len(self.list[i])
            if len(mine) >= last:
                end = min(end, mine[int(last) - 1].t)
        # Events in order of time, up to the one that ends the run or the first failure
        for each in sorted(found, key=lambda each: each.t):
            if failure is not None and each.t >= failure.t:
                break
            self.list[each.index].append(each)
            if self._ends(each.index):
                self._add_beside(step, each)
                if self.angles:
                    run.remembered[: self.angles] = self._counted(np.array([each.t]), each.state[None])[0]
                self._end(run, log, each.t, each.state, step.t0)
                self.t, self.state = each.t, each.state
                return each
        self.t, self.state = step.t1, step.at(step.t1)
        if failure is not None:
            raise failure
        return None

    def _cross_stop(self, run, log):
        """Take the values of groups with the loads after a stop; the `Occurrence` that ends the run there, or None.

        The output of a run that ends has the loads before: the next one begins with those after.
        """
        before, self.state, self.memory = (self.state, self.memory), run.now.copy(), run.remembered.copy()
        self._note_start()
        found = None
        for group in self._groups:
            for i in group.cross(self._at_start(group)):
                found = Occurrence(self.t, i, self.state)
                self.list[i].append(found)
        row = log.out[run.numbers.rows - 1]
        if found is not None and run.numbers.rows > 0 and row[0] == self.t:
            row[1:] = np.concatenate([each.ravel() for each in before])
        return found

    def _search_group(self, group, step):
        """As `Group.search`."""
        sample = lambda times: self._sample(group, step.before_stop(times), step.levels(times))  # noqa: E731
        degree = lambda time: self._degree(step.turning * time, limits.SLOW_SMOOTH_TURN, limits.FAST_SMOOTH_TURN)  # noqa: E731
        return group.search(step, sample, degree)

    def _add_beside(self, step, last):
        """Add the events that occur at the instant of the last one, to rounding of value and time.

        Of those without an action, where the run goes on: nobody finds them afterwards.
        """
        self._add_members(step, last)
        just = max(last.t - limits.NOISE * limits.ROOT * abs(last.t), step.t0)
        goes_on = last.index not in self._single or self.events[last.index].action
        for i in self._single:
            event = self.events[i]
            if i == last.index or not (event.action or goes_on):
                continue
            value = self._at(i, step, last.t)
            noise = max(self._shaken(i, last.t, step.at), limits.NOISE * abs(value - self._at(i, step, just)))
            if abs(value) > noise:
                continue
            # Another zero than that of the step's start, and than the last one: the function is off zero before
            since = max([step.t0, *(each.t for each in self.list[i][-1:])])
            before = self._at(i, step, last.t - limits.SHORTLY * (last.t - since))
            if abs(before) > noise and event.direction * before <= 0.0:
                self.list[i].append(Occurrence(last.t, i, last.state))

    def _add_members(self, step, last):
        """The same, of events of the group of the last one: by how fast their values fall."""
        group = self._group_of.get(last.index)
        if group is None or len(group.numbers) == 1:
            return
        falls = group.beside
        if falls is None:
            before = last.t - limits.SHORTLY * (last.t - step.t0)
            times = np.array([before, last.t])
            first, value = self._sample(group, step.before_stop(times), step.levels(times))
            falls = (value < first) & (value * (last.t - before) <= limits.SAME_INSTANT * abs(last.t) * (first - value))
        for i, also in zip(group.numbers, falls.tolist(), strict=True):
            if also and i != last.index:
                self.list[i].append(Occurrence(last.t, i, last.state))

    def _points(self, i, step, end):
        """Times up to `end`, and values of event i, between which its sign changes once at most; what `EventFailed`."""
        track, good, failure = self.tracks[i], [step.t0], None
        is_member = isinstance(self.events[i].function, GroupMember)
        most, status = (limits.MOST_OF_MEMBER, Status.CONTACT_FAILED) if is_member else (None, Status.EVENT_FAILED)

        def sample(times):
            values, function = np.full(times.size, np.nan), self.events[i].function
            if is_member:
                return function.over(self._states(step.before_stop(times), step.levels(times)))[:, function.which]
            states = step.states(times)
            for k, (t, state) in enumerate(zip(times.tolist(), states, strict=True)):
                if state is not None:
                    values[k] = self._value(i, t, state)
                    good.append(t)
            return values

        # A function that fails at some time is searched up to the last time before
        while end > step.t0:
            least = self._group_of[i].least_noise(i) if is_member else 0.0
            search = Search(sample, lambda t: self._shaken(i, t, step.at), track.noise, most, least)
            try:
                degree = max(self._degree(step.turning * (step.t1 - step.t0)), track.degree // 2)
                track.degree, track.end = search.run(step.t0, track.value, end, degree)
                track.noise = search.noise
                return search.points, failure
            except EventFailed as failed:
                failure, end = failed, max(t for t in good if t < failed.t)
            except TooFast:
                text = (
                    f"{self.events[i].name} changes too fast to be followed: {search.spent} values between "
                    f"t = {step.t0:.9g} and {end:.9g} s were not enough. Give a max_step, or a smoother function."
                )
                return [(step.t0, track.value)], EventFailed(text, step.t0, status)
        return [(step.t0, track.value)], failure

    def _degree(self, turn, slow=limits.SLOW_TURN, fast=limits.FAST_TURN):
        """The degree that the interpolant and the turn of a body, rad, ask for."""
        return LARGEST if turn > fast else self.reader.degree if turn > slow else self.reader.degree // 2

    def _walk(self, i, step, points):
        """The occurrences of event i among these points."""
        track, direction, found = self.tracks[i], self.events[i].direction, []
        (before, value), *rest = points
        # A value near zero at the start of the run is a zero there, within rounding
        if track.sign == 0.0 and track.zero is None:  # the run's first step
            if 0.0 < abs(track.value) <= limits.START_ZERO * max(abs(value) for _, value in points):
                track.zero, track.passed, track.pending = before, value != 0.0, value == 0.0
            else:
                rest = points
        for t, value in rest:
            sign = float(value > 0.0) - float(value < 0.0)
            # A zero: an event at once, or when it is left, if the direction counts
            if value == 0.0:
                if track.zero is None or track.passed:
                    late = track.sign == 0.0 and t > self.start  # the start's own zero, within rounding
                    track.passed, track.pending = False, late or (direction != 0.0 and direction * track.sign >= 0.0)
                    if not track.pending:
                        found.append(self._zero(i, step, t, before))
                track.zero = t
            # A sign: leaves a zero, or changes
            elif abs(value) > track.noise:
                if track.zero is not None:
                    if track.pending and direction * sign >= 0.0:
                        found.append(self._leave(i, step, max(track.zero, step.t0), (t, value)))
                    track.zero, track.passed, track.pending = None, False, False
                elif sign == -track.sign and direction * sign >= 0.0:
                    found += self._root(i, step, t, value)
                track.sign, track.significant = sign, (t, value)
            before = t
        track.value = track.end
        return found

    def _shaken(self, i, t, state_at):
        """By how much the value of event i at t changes with rounding errors of the state, a function of t."""
        try:
            # Rounding of the state, in three random directions
            state = state_at(t)
            value, size = self._value(i, t, state), largest_of_kind(self.packed.system.bodies, state)
            np.maximum(size[0], self.events[i].length, out=size[0], where=~turning(self.packed.system.bodies, self._n))
            size *= limits.SHAKEN
            shaken = [self._value(i, t, state + size * sign) for sign in _signs(self._n)]
        except EventFailed:
            return 0.0
        return limits.NOISE * max(abs(each - value) for each in shaken)

    def _zero(self, i, step, t, other):
        """The `Occurrence` at a zero, or at the end next to another time of the zeros around it."""
        if t != other and self._at(i, step, t) == 0.0:
            # Bisection for the end of an interval of zeros
            while t != (middle := 0.5 * (t + other)) != other:
                if self._at(i, step, middle) == 0.0:
                    t = middle
                else:
                    other = middle
        return Occurrence(t, i, step.at(t))

    def _leave(self, i, step, t, last):
        """The `Occurrence` where event i leaves a zero: that at t, or one that is so within rounding."""
        value = self._at(i, step, t)
        if value != 0.0 and (value < 0.0) != (last[1] < 0.0):
            t = self._between(i, step, (t, value), last)
            return Occurrence(t, i, step.at(t))
        return self._zero(i, step, t, last[0])

    def _root(self, i, step, t1, b):
        """The change of sign up to t1, where event i has the value b; none if it is that of the run's start."""
        track = self.tracks[i]
        # From the last value with a sign, or from the step's start
        t0, a = max(track.significant, (step.t0, track.value))
        if a == 0.0 or (a < 0.0) == (b < 0.0):
            return [Occurrence(t0, i, step.at(t0))]
        root = self._between(i, step, (t0, a), (t1, b))
        at_start = not self.events[i].exact and self._is_start(i, step, root, (t0, a))
        return [] if at_start else [Occurrence(root, i, step.at(root))]

    def _is_start(self, i, step, t, before):
        """Whether a zero at t is that of the run's start: by rounding of the time, or of the value before, there."""
        if t - self.start <= limits.START_ZERO * max(abs(self.start), step.t1 - step.t0):
            return True
        return before[0] == self.start and abs(before[1]) <= self._shaken(i, self.start, step.at)

    def _between(self, i, step, first, last):
        """Where event i changes its sign between two times with values."""
        from scipy.optimize import brentq  # takes a while to import

        # Values of order one, by a power of two
        known, (t0, a), (t1, b) = dict((first, last)), first, last
        unit = math.ldexp(1.0, min(-math.frexp(max(abs(a), abs(b)))[1], MOST_SCALED))

        def value(t):  # of size one: Brent's method multiplies three of them
            return unit * (known[t] if t in known else self._at(i, step, t))

        # Brent's method, as near as numbers of this size allow
        least = self._least_time(step, t0, t1)
        root = brentq(value, t0, t1, xtol=least, rtol=limits.ROOT, maxiter=1000)
        return self._beyond(i, step, root, least + limits.ROOT * abs(root), t1, b)

    @staticmethod
    def _least_time(step, t0, t1):
        """By how much times between t0 and t1 differ at least, s: never zero."""
        return max(EPS * abs(step.t0), EPS * EPS * (t1 - t0), limits.LEAST_TIME)

    def _beyond(self, i, step, root, shift, t1, b):
        """A root, or a time after it up to t1 where event i has the sign of b.

        A run that continues from a terminal event must not find it again.
        """
        ends, side = self.events[i].limit < math.inf and not self.events[i].exact, math.copysign(1.0, b)
        while ends and root + shift < t1 and side * self._at(i, step, root) <= 0.0:
            root, shift = root + shift, 2.0 * shift
        return root

    def _at(self, i, step, t):
        return self._value(i, t, step.at(t, not isinstance(self.events[i].function, GroupMember)))

    def _end(self, run, log, t, state, start):
        """Let the run end at t, within the step that began at `start`."""
        if self._resident[0] is not run:
            self._resident = run, *resident(run)
        end_run(self._resident[1], t, start, state, log)
