"""Force and torque between two bodies as a function of time and both states.

    function(t, a, b, par, out)   a, b (13,): point, Euler parameters, velocity of the point, angular velocity
                                  out (6,): force on a at x_a, torque on a
    f = [F, 0, T; -F, 0, -T - (x_a - x_b) x F]    conjugate to x_a, p_a, rotation of a; x_b, p_b, rotation of b   (1)

so that the opposite force acts on b at x_a. All components are in the ground frame.
"""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..plugins import (
    STATE,
    Action,
    ByState,
    Force,
    Parameters,
    Point,
    SceneLaw,
    Turn,
    arguments_of,
    cross,
    fill_state,
    fill_state_series,
    floats,
    numbers_of,
    shown,
    stack,
    variant,
)

if TYPE_CHECKING:
    from ..hints import ArrayLike, BodyLike, Callable, PointMass


def _numbers(value, what, error):
    result = floats(value)
    if result.ndim != 1 or result.size != np.size(value) or not np.isfinite(result).all():
        raise error(f"{what} must be a list of finite numbers, got {shown(value)}.")
    result.setflags(write=False)
    return result


function = None  # filled in by `ByState`


def _law(x, xd, par, t, out):
    a, b, load = stack(13), stack(13), stack(6)
    fill_state(x, xd, 0, a)
    fill_state(x, xd, 10, b)
    for i in range(6):
        load[i] = 0.0
    try:
        function(t, a, b, par, load)
    except Exception:
        load[0] = math.nan
    d0, d1, d2 = x[0] - x[10], x[1] - x[11], x[2] - x[12]
    for i in range(3):
        out[i], out[7 + i], out[10 + i] = load[i], load[3 + i], -load[i]
    out[17] = -load[3] - (d1 * load[2] - d2 * load[1])
    out[18] = -load[4] - (d2 * load[0] - d0 * load[2])
    out[19] = -load[5] - (d0 * load[1] - d1 * load[0])


class UserForce(ByState, Force):
    """Force and torque on a, and the opposite on b, as a function of time and of both states.

    Parameters
    ----------
    a : Body
    b : Body or ground, optional
        Default: the ground.
    function : callable (t, a, b, par, out), or (t, state, par, out)
        A plain Python function. The one of four arguments gets the state of the scene, as for `Control`. The one of
        five is compiled by Numba: a and b are arrays (13,): position of the point (m), Euler
        parameters, velocity of the point (m/s), angular velocity (rad/s), all in the ground frame; those of the ground
        are point_b, (1, 0, 0, 0) and zeros. It writes out (6,): force on a at point_a (N), torque on a (N m), ground
        frame. It may compare and allocate; an exception or a NaN ends the run.
    parameters : array_like, optional
        The numbers par of the function; `force.values` changes them.

    Raises
    ------
    InvalidForce
        If the function is no plain function of four or five arguments, or a number is not finite.

    Notes
    -----
    The opposite force acts on b at x_a, so momentum is conserved. On a point mass the force alone acts, and the Euler
    parameters are (1, 0, 0, 0). The power is applied power.

    Examples
    --------
    Gravity of a planet at the origin, G M = par[0], on a moon:

    >>> import numpy as np
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, 0))
    >>> moon = scene.add_point_mass(mass=1.0, position=(2, 0, 0), velocity=(0, 2, 0))
    >>> def attraction(t, a, b, par, out):
    ...     r = np.sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2)
    ...     for i in range(3):
    ...         out[i] = -par[0] * a[i] / r**3
    >>> force = scene.add(ts.forces.UserForce(moon, function=attraction, parameters=(8.0,)))
    >>> force.values = (9.0,)  # from the next run on; nothing is compiled again
    >>> print(force.values)
    [9.]
    """

    markers = (Point("a"), Parameters("a"), Turn("a"), Point("b"), Parameters("b"), Turn("b"))
    particles = True
    loads = ("function",)
    given, count = "function", 5
    template = staticmethod(_law)
    arguments, has_numbers, given_numbers, slots = (1, STATE, STATE), True, 6, 9
    quantities = MappingProxyType({"values": _numbers})

    def __new__(cls, *bodies: Any, function: Any = None, **others: Any) -> Self:
        """Choose the kernel by the arguments of the function."""
        return super().__new__(variant(cls, SceneLaw) if arguments_of(function) == 4 else cls)

    def __init__(
        self,
        a: PointMass | str,
        b: BodyLike | None = None,
        *,
        function: Callable[..., object],
        parameters: ArrayLike = (),
        **places: Any,
    ) -> None:
        if b is None:
            b = getattr(getattr(a, "scene", None), "ground", None)
        super().__init__(a, b, **places)
        self.values = _numbers(parameters, f"{self.name}: parameters", self.error)
        self.function = function

    def check(self):
        """Refuse all but plain functions of five arguments."""
        if arguments_of(self.function) != self.count or numbers_of(self.function):
            raise self.error(
                f"{self.name}: function must be a plain Python function of five arguments (t, a, b, par, out), or one "
                f"of four (t, state, par, out), got {self.function!r}. Numbers that vary are parameters=, which it "
                "gets as par; make a new force to change between the two."
            )

    def parameters(self):
        """The numbers par."""
        return tuple(self.values)

    @staticmethod
    def results(function, t, a, b, par):
        """Six numbers."""
        out = np.zeros(6, a.dtype)
        function(t[0], a, b, par, out)
        return out

    @staticmethod
    def inputs(x, xd, par, k, first, s):
        """Both states, and par."""
        fill_state_series(x, xd, 0, k, first, s)
        fill_state_series(x, xd, 10, k, first + 13, s)
        for i in range(par.size):
            s[first + 26 + i, k] = par[i] if k == 0 else 0.0

    @staticmethod
    def series(x, xd, par, k, s, out):
        """Of Eq. (1); rows of F, T and x_a - x_b."""
        for i in range(3):
            s[6 + i, k] = x[i] - x[10 + i]
        n = cross(s, 6, 0, k)
        for i in range(3):
            out[i], out[7 + i], out[10 + i] = s[i, k], s[3 + i, k], -s[i, k]
            out[17 + i] = -s[3 + i, k] - n[i]

    @classmethod
    def example(cls, rng, a, b):
        """A drag that depends on all arguments."""
        return cls(a, b, function=_example, point_a=rng.normal(size=3), point_b=rng.normal(size=3), parameters=(0.7,))


class _SceneUserForce(SceneLaw, UserForce):
    """By a function of the state of the scene."""

    count = 4
    parameters = UserForce.parameters

    def results(self, function, t, state, numbers):
        """Six numbers."""
        out = np.zeros(6, object)
        function(t, state, np.asarray(numbers), out)
        return list(out)

    def actions(self):
        """Three components of the force, and of the torque."""
        point, axes = tuple(self.point_a.tolist()), [tuple(e) for e in np.eye(3).tolist()]
        return [Action(turns, self.a, self.b, None, e, point) for turns in (False, True) for e in axes]


def _example(t, a, b, par, out):
    for i in range(3):
        out[i] = -par[0] * (a[7 + i] - b[7 + i]) + np.sin(t) * a[4 + i]
        out[3 + i] = a[i] * b[3] - b[10 + i] * a[10 + i]
