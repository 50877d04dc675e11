"""A force on a point of one body: constant, a function of time, or of time and state.

f = F             frame="ground"     (1)  [N], conjugate to x_a
f = A(p_a) F      frame="body"       (2)
"""

import math
from types import MappingProxyType

from .._kernel import specialised, stack
from ..errors import InvalidForce
from ..force import Force, vector_load
from ..markers import Parameters, Point, Turn
from ..rotation import rotate
from ..signal import Signal
from ..state_function import ByState, arguments_of, fill_state, state_load


class PointForce(Force):
    """Push a point of a body.

    Parameters
    ----------
    a : Body
        A rigid body or a point mass.
    point_a : array_like (3,), m
        The point, body frame.
    force : array_like (3,), ts.Table, or function of t or of (t, state); N
        A function returns a tuple of three; state (13,) is the position of the point (m), Euler parameters, velocity of
        the point (m/s) and angular velocity (rad/s), ground frame.
    frame : {"ground", "body"}
        The axes in which the force is given.
    name : str, optional

    Raises
    ------
    InvalidForce
        If the force is not three finite numbers or such a function, is zero, or the frame is unknown.

    Notes
    -----
    Its power is applied power. Whether it is a function of state is settled when it is made; a new function of the same
    sort may be set.
    """

    markers = (Point("a"),)
    quantities = MappingProxyType({"force": vector_load})
    loads = ("force",)

    def __new__(cls, a=None, *, force=None, frame="ground", **others):
        """Choose the kernel by frame and by the sort of the force."""
        if cls is PointForce and arguments_of(force) == 2:
            cls = _StatePointForce
        elif cls is PointForce and frame == "body":
            cls = _BodyPointForce
        return super().__new__(cls)

    def __init__(self, a, *, force=None, point_a=(0.0, 0.0, 0.0), frame="ground", name=""):
        super().__init__(a, None, (point_a, *[None] * (len(self.markers) - 1)), name)
        check_frame(self, frame)
        self.frame = frame
        if force is None:
            raise InvalidForce(f"{self.name}: no force given; set force=(Fx, Fy, Fz) in N, or a function of time.")
        self.force = force
        self.check()

    def check(self):
        """It must do something."""
        self.demand_any("force")

    def parameters(self):
        """The force."""
        return Signal.places(self.force)

    @staticmethod
    def law(x, xd, par, t, out):
        """Eq. (1)."""
        for i in range(3):
            out[i] = par[i] + 0.0 * x[i]

    @classmethod
    def example(cls, rng, a, b):
        """A random force."""
        return cls(a, point_a=rng.normal(size=3), force=rng.normal(size=3))


def check_frame(item, frame):
    """Refuse an unknown frame."""
    if not isinstance(frame, str) or frame not in ("ground", "body"):
        raise InvalidForce(f"{item.name}: frame must be 'ground' or 'body', got {frame!r}.")


class _BodyPointForce(PointForce):
    """The same in axes of the body."""

    markers = (Point("a"), Parameters("a"))

    @staticmethod
    def law(x, xd, par, t, out):
        """Eq. (2)."""
        rotate(x[3:], par, out)
        for i in range(4):
            out[3 + i] = 0.0 * x[3 + i]


class _StatePointForce(ByState, PointForce):
    """A function of time and state."""

    markers = (Point("a"), Parameters("a"), Turn("a"))
    particles = True
    quantities = MappingProxyType({"force": state_load})
    given = "force"

    def parameters(self):
        """Whether the force is in axes of the body."""
        return (float(self.frame == "body"),)

    @staticmethod
    def law(x, xd, par, t, out):
        """Of no function: what instances replace."""
        for i in range(10):
            out[i] = math.nan

    @staticmethod
    def wrap(inner, owner):
        """The kernel of a user's function."""
        return specialised(_law, f"{owner.__qualname__}.point_force", owner, function=inner)


function = None  # filled in by `wrap`


def _law(x, xd, par, t, out):
    state, given = stack(13), stack(3)
    fill_state(x, xd, 0, state)
    try:
        value = function(t, state)
        given[0], given[1], given[2] = value[0], value[1], value[2]
    except Exception:
        given[0], given[1], given[2] = math.nan, math.nan, math.nan
    for i in range(3, 10):
        out[i] = 0.0
    if par[0] == 0.0:
        for i in range(3):
            out[i] = given[i]
    else:
        rotate(x[3:], given, out)
