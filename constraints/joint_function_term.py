"""Term of a function of several joint coordinates: the share of one of them in its derivatives.

    Phi   = -f(q_1, ..., q_k)                                  of the first term, 0 of others              (1)
    Phi_x = -f_i q_i,x                                         f_i the derivative by q_i                   (2)
    gamma = -(f_i q_i'' + sum_j f_ij q_i' q_j')                q_i'' at xdd = 0                            (3)

The terms of all q_i add up to the row. Term i is on the bodies of joint i, and reads those of the others. A coordinate
has three markers: f, g, h of an angle as in AngleTerm, or e and two points as in DisplacementTerm. The own coordinate
of a term comes first. Singular where a direction h is along its axis f x g.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from ..plugins import (
    COORDINATE_SLOPE_ROWS,
    MOST_COORDINATES,
    JointFunction,
    Point,
    Primitive,
    Vector,
    angle,
    angle_near,
    dot,
    joint_function,
    joint_slope,
    kernel,
    product,
    quotient,
    scaled,
    square,
)
from .angle_driver import sine_cosine_rates

if TYPE_CHECKING:
    from ..hints import AnyBody

FUNCTION, COUNT, NEAR, OTHERS = 0, 4, 5, 5 + MOST_COORDINATES  # places among the parameters


@kernel
def _coordinate(x, par, j):
    """Coordinate j, zero beyond the last."""
    if j >= par[COUNT]:
        return 0.0 * x[0]
    b, near = 9 * j, int(par[NEAR + j])
    if near < 0:
        return x[b] * (x[b + 6] - x[b + 3]) + x[b + 1] * (x[b + 7] - x[b + 4]) + x[b + 2] * (x[b + 8] - x[b + 5])
    E = x[b] * x[b + 6] + x[b + 1] * x[b + 7] + x[b + 2] * x[b + 8]
    F = x[b + 3] * x[b + 6] + x[b + 4] * x[b + 7] + x[b + 5] * x[b + 8]
    return angle_near(F, E, par[near])


@kernel
def _derivatives(x, par):
    """f of Eq. (1), f_i, and f_ij for each j."""
    one, two, three = _coordinate(x, par, 0), _coordinate(x, par, 1), _coordinate(x, par, 2)
    return joint_function(par, FUNCTION, (one, two, three, _coordinate(x, par, 3), _coordinate(x, par, 4)))


@kernel
def _motion(x, xd, par, j):
    """q_jd, and q_jdd at xdd = 0."""
    b = 9 * j
    if par[NEAR + j] < 0:
        sd, sdd = 0.0 * x[0], 0.0 * x[0]
        for i in range(b, b + 3):
            d, dd = x[6 + i] - x[3 + i], xd[6 + i] - xd[3 + i]
            sd += xd[i] * d + x[i] * dd
            sdd += 2.0 * xd[i] * dd
        return sd, sdd
    E, F, Ed, Fd, Edd, Fdd = sine_cosine_rates(x[b:], xd[b:], 6)
    S = E * E + F * F
    rate = (E * Fd - F * Ed) / S
    return rate, (E * Fdd - F * Edd) / S - 2.0 * (E * Ed + F * Fd) * rate / S


class _JointFunctionTerm(Primitive):
    """A term of a function of several joint coordinates; made by Coupler, of a class for each sequence of kinds."""

    rows = 1
    markers = (Vector("a", "reference_0"), Vector("a", "across_0"), Vector("b", "direction_0"))
    memory = 1
    summed = True
    others_at = OTHERS

    def __init__(
        self, a: AnyBody, b: AnyBody, *, others: tuple[AnyBody, ...], function: JointFunction, places: Any
    ) -> None:
        self.__dict__.update(others=others, function=function)
        super().__init__(a, b, **dict(zip((marker.argument for marker in self.markers), places, strict=True)))

    def parameters(self):
        """(f, count, where each angle is remembered or -1, places of the others); what is remembered are the angles."""
        at, near = OTHERS + 3 * len(self.others), [-1.0] * MOST_COORDINATES
        for j, marker in enumerate(self.markers[2::3]):
            if isinstance(marker, Vector):
                near[j], at = float(at), at + 1
        count = len(self.markers) // 3
        return *self.function.places, count, *near, *[0.0] * (3 * len(self.others))

    @staticmethod
    def phi(x, par, t, out):
        """Eq. (1)."""
        out[0] = -_derivatives(x, par)[0]

    @staticmethod
    def jacobian(x, par, t, out):
        """By Eq. (2)."""
        factor = -_derivatives(x, par)[1]
        if par[NEAR] < 0:
            for i in range(3):
                out[0, i] = factor * (x[6 + i] - x[3 + i])
                out[0, 3 + i] = -factor * x[i]
                out[0, 6 + i] = factor * x[i]
        else:
            E, F = x[0] * x[6] + x[1] * x[7] + x[2] * x[8], x[3] * x[6] + x[4] * x[7] + x[5] * x[8]
            factor = factor / (E * E + F * F)
            for i in range(3):
                out[0, i] = -factor * F * x[6 + i]
                out[0, 3 + i] = factor * E * x[6 + i]
                out[0, 6 + i] = factor * (E * x[3 + i] - F * x[i])

    @staticmethod
    def gamma(x, xd, par, t, out):
        """By Eq. (3)."""
        found, (rate, second) = _derivatives(x, par), _motion(x, xd, par, 0)
        total = found[1] * second
        for j in range(int(par[COUNT])):
            total += found[2 + j] * rate * _motion(x, xd, par, j)[0]
        out[0] = -total

    @staticmethod
    def remember(x, par, t):
        """The angles."""
        last = 0.0
        for j in range(int(par[COUNT])):
            near = int(par[NEAR + j])
            if near >= 0:
                last = _coordinate(x, par, j)
                par[near] = last
        return last

    @staticmethod
    def series(x, par, k, s, out):
        """Of Eq. (2); rows: 12 of each coordinate, x and E, F, S or d; 4 of the own one; the q_j, f_i, operations."""
        count = int(par[COUNT])
        first, own = 12 * count + 4, 12 * count
        for j in range(count):
            c, near = 12 * j, int(par[NEAR + j])
            for i in range(9):
                s[c + i, k] = x[9 * j + i]
            if near < 0:
                for i in range(3):
                    s[c + 9 + i, k] = x[9 * j + 6 + i] - x[9 * j + 3 + i]
                s[first + j, k] = dot(s, c, c + 9, k)
            else:
                s[c + 9, k], s[c + 10, k] = dot(s, c, c + 6, k), dot(s, c + 3, c + 6, k)
                s[c + 11, k] = square(s[c + 9], k) + square(s[c + 10], k)
                if k == 0:
                    s[first + j, k] = angle_near(s[c + 10, 0], s[c + 9, 0], par[near])
                else:
                    s[first + j, k] = angle(s[c + 10], s[c + 9], s[c + 11], s[first + j], k)
        slope = joint_slope(par, FUNCTION, s, first, count, k)
        if par[NEAR] < 0:
            f0, f1, f2 = scaled(s, 9, slope, k)
            e0, e1, e2 = scaled(s, 0, slope, k)
            out[0, 0], out[0, 1], out[0, 2] = -f0, -f1, -f2
            out[0, 3], out[0, 4], out[0, 5] = e0, e1, e2
            out[0, 6], out[0, 7], out[0, 8] = -e0, -e1, -e2
        else:
            s[own, k] = quotient(s[9], s[11], s[own], k)
            s[own + 1, k] = quotient(s[10], s[11], s[own + 1], k)
            s[own + 2, k], s[own + 3, k] = product(s[own], s[slope], k), product(s[own + 1], s[slope], k)
            f0, f1, f2 = scaled(s, 6, own + 3, k)
            g0, g1, g2 = scaled(s, 6, own + 2, k)
            out[0, 0], out[0, 1], out[0, 2] = f0, f1, f2
            out[0, 3], out[0, 4], out[0, 5] = -g0, -g1, -g2
            for i in range(3):
                out[0, 6 + i] = product(s[i], s[own + 3], k) - product(s[3 + i], s[own + 2], k)


@cache
def joint_function_term(kinds: str) -> type[_JointFunctionTerm]:
    """The class of terms of coordinates of these kinds, "a" for an angle, "d" for a displacement, the own one first."""
    markers = []
    for j, kind in enumerate(kinds):
        bodies = ("a", "a", "b") if j == 0 else (2 * j, 2 * j, 2 * j + 1)
        sorts = (Vector, Vector, Vector) if kind == "a" else (Vector, Point, Point)
        words = f"reference_{j}", f"across_{j}", f"direction_{j}"
        markers += [sort(body, word) for sort, body, word in zip(sorts, bodies, words, strict=True)]
    memory, name = kinds.count("a"), f"_JointFunctionTerm_{kinds}"
    own = {"markers": tuple(markers), "memory": memory, "slots": 12 * len(kinds) + 4 + COORDINATE_SLOPE_ROWS}
    own |= {"__module__": __name__, "__qualname__": name} | ({} if memory else {"remember": None})
    return type(name, (_JointFunctionTerm,), own)


def __getattr__(name):
    """A class of terms, which pickles name."""
    base = f"{_JointFunctionTerm.__name__}_"
    if name.startswith(base):
        return joint_function_term(name.removeprefix(base))
    raise AttributeError(name)
