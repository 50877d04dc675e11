"""Applied loads, the base of PointForce and Torque: constant, f(t) or f(t, state), in the ground or body frame."""

from __future__ import annotations

import math
from typing import Any, Self

from ..errors import InvalidForce
from ..jit.kernels import kernel, specialised, stack
from ..maths.euler_parameters import rotate
from ..maths.recurrences import rotated, rotation
from ..motions.signals import Signal
from ..validation import one_of
from .user_functions import STATE, ByState, arguments_of, fill_state, fill_state_series, variant

function = None  # filled in by `GivenByState`
FIRST = 0


class Given:
    """Mixed into forces of one vector, the attribute `given`, conjugate to their first marker.

    Parameters
    ----------
    frame : {"ground", "body"}
        The axes in which the vector is given.

    Raises
    ------
    InvalidForce
        If the vector is not three finite numbers or a function of t or of (t, state), is zero, or the frame is unknown.
    InvalidBody
        If a torque is on a point mass.
    """

    given, positive = "", ()

    def __new__(cls, *others: Any, frame: str = "ground", **more: Any) -> Self:
        """Choose the kernel by frame and by the sort of the vector."""
        if arguments_of(more.get(cls.given)) == 2:
            cls = variant(cls, GivenByState)
        elif isinstance(frame, str) and frame == "body":
            cls = variant(cls, GivenInBody)
        return super().__new__(cls)

    def take(self, value: Any, frame: str, hint: str) -> None:
        """Take the vector over, and the frame that it is in; hint is how to write it, with its unit."""
        self.frame = one_of(frame, ("ground", "body"), f"{self.name}: frame", InvalidForce)
        if value is None:
            raise InvalidForce(f"{self.name}: no {self.given} given; set {self.given}={hint}, or a function of time.")
        setattr(self, self.given, value)

    def parameters(self) -> tuple[Any, ...]:
        """The vector."""
        return Signal.places(getattr(self, self.given))

    @staticmethod
    def law(x, xd, par, t, out):
        """The vector as it is."""
        for i in range(3):
            out[i] = par[i] + 0.0 * x[i]

    @staticmethod
    def series(x, xd, par, k, s, out):
        """The vector at order zero."""
        if k == 0:
            for i in range(3):
                out[i] = par[i]

    @staticmethod
    def driven_series(x, xd, par, k, s, out):
        """The vector's."""
        for i in range(3):
            out[i] = s[i, k]


class GivenInBody:
    """Mixed in before `Given`, with the markers' Parameters second: in axes of the body."""

    slots = 13

    @staticmethod
    def law(x, xd, par, t, out):
        """A(p_a) times the vector."""
        rotate(x[3:], par, out)
        for i in range(4):
            out[3 + i] = 0.0 * x[3 + i]

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of A(p) times the vector; rows of p, then of A."""
        for i in range(4):
            s[i, k] = x[3 + i]
        rotation(s, 0, 4, k)
        for i in range(3):
            out[i] = s[4 + i, k] * par[0] + s[7 + i, k] * par[1] + s[10 + i, k] * par[2]

    @staticmethod
    def driven_series(x, xd, par, k, s, out):
        """Of A(p) times the vector, in rows 13 to 15."""
        for i in range(4):
            s[i, k] = x[3 + i]
        rotation(s, 0, 4, k)
        out[0], out[1], out[2] = rotated(s, 4, 13, k)


@kernel
def given_series(x, par, k, s):
    """Coefficient k, a tuple of three, of the vector in rows 0 to 2 of s, turned where par says so; p is x[3:7]."""
    if par[0] == 0.0:
        return s[0, k], s[1, k], s[2, k]
    for i in range(4):
        s[3 + i, k] = x[3 + i]
    rotation(s, 3, 7, k)
    return rotated(s, 7, 0, k)


class GivenByState(ByState):
    """Mixed in before `Given`, with the markers Point, Parameters, Turn: a function of time and state.

    `first` is where in out the vector goes: 0 for a force, 7 for a torque.
    """

    first = 0
    arguments, given_numbers, slots, begin = (1, STATE), 3, 16, 1

    @staticmethod
    def results(function, t, state):
        """Three numbers."""
        return function(t[0], state)

    @staticmethod
    def inputs(x, xd, par, k, first, s):
        """The state."""
        fill_state_series(x, xd, 0, k, first, s)
        for i in range(1, par.size):
            s[first + STATE - 1 + i, k] = par[i] if k == 0 else 0.0

    @staticmethod
    def series(x, xd, par, k, s, out):
        """The vector in rows 0 to 2, a force; rows of p, then of A."""
        out[0], out[1], out[2] = given_series(x, par, k, s)

    def parameters(self):
        """One flag: the vector is given in the body frame; then the numbers of the function."""
        return (float(self.frame == "body"), *super().parameters())

    @classmethod
    def _wrap(cls, inner, owner, **others):
        """The kernel of a user's function; others: as of `specialised`."""
        name = f"{owner.__qualname__}.{cls.given}"
        return specialised(_law, name, owner, function=inner, FIRST=cls.first, **others)


def _law(x, xd, par, t, out):
    state, given = stack(13), stack(3)
    fill_state(x, xd, 0, state)
    try:
        value = function(t, state, par)
        given[0], given[1], given[2] = value[0], value[1], value[2]
    except Exception:
        given[0], given[1], given[2] = math.nan, math.nan, math.nan
    for i in range(10):
        out[i] = 0.0
    if par[0] == 0.0:
        for i in range(3):
            out[FIRST + i] = given[i]
    else:
        rotate(x[3:], given, out[FIRST:])
