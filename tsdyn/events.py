"""Events: changes of sign of a user's function along a run, found on the manifold, by the rules of SciPy's solve_ivp.

The driver is called one step at a time and never learns of them, so they change no step. A step's ends are looked at;
where the sign has changed, Brent's method asks the step's dense output for states.
"""

import math
from typing import NamedTuple

import numpy as np

from . import reactions
from .checks import number
from .dense import B_END
from .errors import InvalidArgument, Status
from .handles import handles_of
from .kinematics import Anchor, Kinematics
from .run_state import BEGUN, BLOCKS, CHART_ROWS, DENSE, ROWS, STEPS, STORED, T

EPS = float(np.finfo(float).eps)


class Event(NamedTuple):
    """One of a user's functions."""

    function: object
    name: str
    limit: float  # occurrences that end the run; inf for never
    direction: float  # of the changes that count; 0 for both


class Occurrence(NamedTuple):
    """An event found."""

    t: float
    index: int
    state: np.ndarray  # (3, n)


class Failed(Exception):
    """An event function raised, or gave no finite number."""


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
        found.append(Event(function, name, limit or math.inf, number(direction)))
    return found


class Instant(Kinematics):
    """What an event function is given: a `State`, with multipliers made when asked for."""

    __slots__ = ("_beside", "_packed", "q", "qd", "qdd", "t")

    def __init__(self, packed, beside, t, state):
        self._packed, self._beside, self.t = packed, beside, t
        self.q, self.qd, self.qdd = state.copy()  # the function may keep or change it

    @property
    def handles(self):
        """The scene's `Handles`."""
        return handles_of(self._packed)

    @property
    def anchor(self):
        """The end of the step that it is in."""
        t, state, remembered = self._beside
        angles = remembered[: self.handles.count]
        return Anchor(angles) if t == self.t else Anchor(angles, self.t - t, tuple(state[:2]))

    @property
    def memory(self):
        """What forces remember, for a run from here."""
        return self._beside[2][self.handles.count :]

    @property
    def multipliers(self):
        """Multipliers (m,)."""
        parts = (part[None] for part in (self.q, self.qd, self.qdd))
        return reactions.multipliers(self._packed, np.array([self.t]), *parts, self.memory[None])[0]

    def __iter__(self):
        return iter((self.t, self.q, self.qd, self.qdd, self.multipliers))

    def __len__(self):
        return 5

    def __getitem__(self, i):
        return tuple(self)[i]


class Watch:
    """The events of one run: the functions' last values, and what has been found."""

    def __init__(self, events, packed, reader, start):
        self.events, self.packed = events, packed
        self.t, self.state, self.values = start, None, None  # at the last step's end
        self.memory = None  # angles of joints and what forces remember of it
        self.list = [[] for _ in events]
        self.read_by(reader)

    def read_by(self, reader):
        """Take a reader of the steps that are watched from now on."""
        none, self.reader = np.empty(0), reader
        reader(none, none.astype(int), np.empty((0, 0)), np.empty((0, 0)), np.empty((0, 0)))  # loads the kernel

    def found(self, n):
        """Times, positions and velocities of each event."""
        times = [np.array([each.t for each in found]) for found in self.list]
        states = [np.array([each.state for each in found]).reshape(-1, 3, n) for found in self.list]
        return times, *([np.ascontiguousarray(state[:, i]) for state in states] for i in (0, 1))

    def advance(self, memory, record, most):
        """As `Memory.advance`; the Status, and what there is to say of it."""
        run = memory.run
        if not run.numbers[BEGUN]:
            status = memory.advance(record, -1)
            if not run.numbers[BEGUN]:
                return status, ""
            self.state, self.memory = run.now.copy(), run.remembered.copy()
            try:
                self.values = [self._value(i, self.t, self.state) for i in range(len(self.events))]
            except Failed as failure:
                raise InvalidArgument(f"events: {failure}") from failure.__cause__
        for _ in range(most):
            done = run.numbers[STEPS]
            status = memory.advance(record, 1)
            if run.numbers[STEPS] > done:
                try:
                    last = self._step(run, record)
                except Failed as failure:
                    return Status.EVENT_FAILED, str(failure)
                if last is not None:
                    return Status.EVENT, f"It was {self.events[last.index].name} at t = {last.t:.9g} s."
            if status != Status.SLICE_DONE or run.numbers[CHART_ROWS] + 2 >= len(record.charts):
                return status, ""
        return status, ""

    def _value(self, i, t, state):
        event = self.events[i]
        try:
            given = event.function(t, Instant(self.packed, (self.t, self.state, self.memory), t, state))
        except Exception as error:
            raise Failed(f"{event.name} raised {type(error).__name__} at t = {t:.9g} s: {error}.") from error
        value = number(given)
        if not math.isfinite(value):
            raise Failed(f"{event.name} must return a finite number; at t = {t:.9g} s it gave {given!r}.")
        return value

    def _step(self, run, record):
        """Look at the step just made; the `Occurrence` that ends the run, or None."""
        t0, t1 = self.t, float(run.clock[T])
        before, now = self.state, run.now.copy()
        values = self.values
        self.t, self.state, self.memory = t1, now, run.remembered.copy()
        self.values = [self._value(i, t1, now) for i in range(len(self.events))]
        found = []
        for i, (a, b) in enumerate(zip(values, self.values, strict=True)):
            direction = self.events[i].direction
            rises, falls = a <= 0.0 <= b and direction >= 0.0, a >= 0.0 >= b and direction <= 0.0
            if not (rises or falls) or (a == 0.0 and self.list[i] and self.list[i][-1].t == t0):
                continue  # a zero at the end of the step before has been reported
            if b == 0.0 and a != 0.0:
                found.append(Occurrence(t1, i, now))
            elif a == 0.0:
                found.append(Occurrence(t0, i, before))
            else:
                found.append(self._root(run, record, i, t0, a, t1, b))
        for each in sorted(found, key=lambda each: each.t):
            self.list[each.index].append(each)
            if len(self.list[each.index]) >= self.events[each.index].limit:
                self._end(run, record, each, t0)
                return each
        return None

    def _root(self, run, record, i, t0, a, t1, b):
        """Where event i is zero within the step, being a at its start and b, of the other sign, at its end."""
        from scipy.optimize import brentq  # takes a while to import

        def value(t):
            return a if t == t0 else b if t == t1 else self._value(i, t, self._at(run, record, t))

        root = brentq(value, t0, t1, xtol=4.0 * EPS, rtol=4.0 * EPS, maxiter=1000)
        shift = 4.0 * EPS * max(abs(root), 1.0)
        # a run that goes on from a terminal event had better find it behind itself
        while self.events[i].limit < math.inf and root + shift < t1 and value(root) * b < 0.0:
            root, shift = root + shift, 2.0 * shift
        return Occurrence(root, i, self.state if root == t1 else self._at(run, record, root))

    def _at(self, run, record, t):
        rows = np.zeros(1, int)
        states, status = self.reader(np.array([t]), rows, run.block[None], record.charts, record.points)
        if status != Status.SUCCESS:
            raise Failed(f"there is no state at t = {t:.9g} s to evaluate it at. {status.sentence}")
        return states[0]

    def _end(self, run, record, last, t0):
        """Let the run end at an event."""
        run.now[:] = last.state
        run.clock[T] = last.t
        if record.t_eval.size > 0:
            while run.numbers[ROWS] > 0 and record.out[run.numbers[ROWS] - 1, 0] > last.t:
                run.numbers[ROWS] -= 1
        elif last.t > t0:
            record.out[run.numbers[ROWS] - 1] = [last.t, *last.state.ravel(), *run.remembered]
        else:
            run.numbers[ROWS] -= 1
        if run.numbers[DENSE] == STORED:
            record.blocks[run.numbers[BLOCKS] - 1, B_END] = last.t
