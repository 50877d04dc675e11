"""Users' event functions of time and state, with the attributes `terminal` and `direction` of SciPy's solve_ivp."""

import math
from typing import NamedTuple

import numpy as np

from ..errors import InvalidArgument
from ..observables import reactions
from ..observables.exerted import Exerting
from ..observables.kinematics import Anchor, Kinematics
from ..validation import number


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
            raise Failed(
                f"{self.name} raised {type(error).__name__} at t = {t:.9g} s: {str(error).rstrip('.')}.", t
            ) from error
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


class Instant(Exerting, Kinematics):
    """What an event function is given: a `State`, with multipliers made when asked for.

    Parameters
    ----------
    packed : Packed
    memory : ndarray (slots,)
        What forces remember.
    beside : tuple
        The start of its step, or itself: t, state (3, n) and the joints' angles there.
    t : float, s
    state : ndarray (3, n)
    """

    __slots__ = ("_beside", "memory", "packed", "q", "qd", "qdd", "t")

    def __init__(self, packed, memory, beside, t, state):
        self.packed, self.memory, self._beside, self.t = packed, memory, beside, t
        self.q, self.qd, self.qdd = state.copy()  # the function may keep or change it

    @property
    def anchor(self):
        """What its angles are counted from."""
        t, state, angles = self._beside
        return Anchor(angles) if t == self.t else Anchor(angles, self.t - t, (state[0], state[1]))

    @property
    def multipliers(self):
        """Multipliers (m,)."""
        parts = (part[None] for part in (self.q, self.qd, self.qdd))
        return reactions.multipliers(self.packed, np.array([self.t]), *parts, self.memory[None])[0]

    def __iter__(self):
        return iter((self.t, self.q, self.qd, self.qdd, self.multipliers))

    def __len__(self):
        return 5

    def __getitem__(self, i):
        return tuple(self)[i]
