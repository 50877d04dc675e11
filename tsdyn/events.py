"""Events as a user gives them: functions of time and state, with the attributes that SciPy's solve_ivp knows."""

import math
from typing import NamedTuple

import numpy as np

from . import reactions
from .checks import number
from .errors import InvalidArgument


class Event(NamedTuple):
    """One of a user's functions."""

    function: object
    name: str
    limit: float  # occurrences that end the run; inf for never
    direction: float  # of the changes that count; 0 for both

    def value(self, t, instant):
        """The function's value; raises `Failed`."""
        try:
            given = self.function(t, instant)
        except Exception as error:
            raise Failed(f"{self.name} raised {type(error).__name__} at t = {t:.9g} s: {error}.", t) from error
        value = number(given)
        if not math.isfinite(value):
            raise Failed(f"{self.name} must return a finite number; at t = {t:.9g} s it gave {given!r}.", t)
        return value


class Failed(Exception):
    """An event function raised, or gave no finite number; t is when, s."""

    def __init__(self, message, t):
        super().__init__(message)
        self.t = t


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


class Instant:
    """What an event function is given: t, q, qd, qdd as of a `State`, with multipliers made when asked for."""

    __slots__ = ("_memory", "_packed", "q", "qd", "qdd", "t")

    def __init__(self, packed, memory, t, state):
        self._packed, self._memory, self.t = packed, memory, t
        self.q, self.qd, self.qdd = state.copy()  # the function may keep or change it

    @property
    def memory(self):
        """What forces remember, for a run from here."""
        return self._memory

    @property
    def multipliers(self):
        """Multipliers (m,)."""
        parts = (part[None] for part in (self.q, self.qd, self.qdd))
        return reactions.multipliers(self._packed, np.array([self.t]), *parts, self._memory[None])[0]

    def __iter__(self):
        return iter((self.t, self.q, self.qd, self.qdd, self.multipliers))

    def __len__(self):
        return 5

    def __getitem__(self, i):
        return tuple(self)[i]
