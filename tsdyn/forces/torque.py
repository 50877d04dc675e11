"""A torque on one body: constant, a function of time, or of time and state.

n = N             frame="ground"     (1)  [N m], conjugate to the turning of a
n = A(p_a) N      frame="body"       (2)
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
from .point_force import check_frame


class Torque(Force):
    """Turn a body.

    Parameters
    ----------
    a : Body
        A rigid body.
    torque : array_like (3,), ts.Table, or function of t or of (t, state); N m
        A function returns a tuple of three; state (13,) is the position of the centroid (m), Euler parameters, velocity
        (m/s) and angular velocity (rad/s), ground frame.
    frame : {"ground", "body"}
        The axes in which the torque is given.
    name : str, optional

    Raises
    ------
    InvalidForce
        If the torque is not three finite numbers or such a function, is zero, or the frame is unknown.
    InvalidBody
        If a is a point mass.

    Notes
    -----
    Its power is applied power. Whether it is a function of state is settled when it is made; a new function of the same
    sort may be set.
    """

    markers = (Turn("a"),)
    quantities = MappingProxyType({"torque": vector_load})
    loads = ("torque",)

    def __new__(cls, a=None, *, torque=None, frame="ground", **others):
        """Choose the kernel by frame and by the sort of the torque."""
        if cls is Torque and arguments_of(torque) == 2:
            cls = _StateTorque
        elif cls is Torque and frame == "body":
            cls = _BodyTorque
        return super().__new__(cls)

    def __init__(self, a, *, torque=None, frame="ground", name=""):
        places = [(0.0, 0.0, 0.0) if marker.code == Point.code else None for marker in self.markers]
        super().__init__(a, None, places, name)
        check_frame(self, frame)
        self.frame = frame
        if torque is None:
            raise InvalidForce(f"{self.name}: no torque given; set torque=(Nx, Ny, Nz) in N m, or a function of time.")
        self.torque = torque
        self.check()

    def check(self):
        """It must do something."""
        self.demand_any("torque")

    def parameters(self):
        """The torque."""
        return Signal.places(self.torque)

    @staticmethod
    def law(x, xd, par, t, out):
        """Eq. (1)."""
        for i in range(3):
            out[i] = par[i] + 0.0 * x[i]

    @classmethod
    def example(cls, rng, a, b):
        """A random torque."""
        return cls(a, torque=rng.normal(size=3))


class _BodyTorque(Torque):
    """The same in axes of the body."""

    markers = (Turn("a"), Parameters("a"))

    @staticmethod
    def law(x, xd, par, t, out):
        """Eq. (2)."""
        rotate(x[3:], par, out)
        for i in range(4):
            out[3 + i] = 0.0 * x[3 + i]


class _StateTorque(ByState, Torque):
    """A function of time and state."""

    markers = (Point("a"), Parameters("a"), Turn("a"))
    quantities = MappingProxyType({"torque": state_load})
    given = "torque"

    def parameters(self):
        """Whether the torque is in axes of the body."""
        return (float(self.frame == "body"),)

    @staticmethod
    def law(x, xd, par, t, out):
        """Of no function: what instances replace."""
        for i in range(10):
            out[i] = math.nan

    @staticmethod
    def wrap(inner, owner):
        """The kernel of a user's function."""
        return specialised(_law, f"{owner.__qualname__}.torque", owner, function=inner)


function = None  # filled in by `wrap`


def _law(x, xd, par, t, out):
    state, given = stack(13), stack(3)
    fill_state(x, xd, 0, state)
    try:
        value = function(t, state)
        given[0], given[1], given[2] = value[0], value[1], value[2]
    except Exception:
        given[0], given[1], given[2] = math.nan, math.nan, math.nan
    for i in range(7):
        out[i] = 0.0
    if par[0] == 0.0:
        for i in range(3):
            out[7 + i] = given[i]
    else:
        rotate(x[3:], given, out[7:])
