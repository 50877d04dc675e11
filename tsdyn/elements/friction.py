"""Coulomb friction: exact and regularised laws, in proportion to a reaction or of given magnitude; their series."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Never, Self

import numpy as np

from ..calls import fitting, unknown_argument
from ..errors import InvalidForce
from ..jit.kernels import kernel
from ..jit.predicates import some
from ..maths.recurrences import cross, dot, exponential, inverse_root, product, quotient, root, scaled, square
from ..maths.tolerances import PIVOT_ROUNDING, TINY
from ..validation import label, not_negative, positive, shown_for_handle
from .markers import TURN, Marker, Point, Turn, Vector
from .tolerances import LEAST_SLIP, LEAST_SQUARE, SLIP

if TYPE_CHECKING:
    from ..hints import AnyBody, ArrayLike, Attachment, BodyLike, Callable, Floats, Mapping, Random


# Common parts of friction laws: slip velocity of a's point over b, reaction on both bodies, friction coefficient.
#
# Markers: Point a, Turn a, Point b, Turn b.


@kernel
def coefficient(vv, par):
    """mu(|v|) / |v| of Coulomb's law with Stribeck's peak, smooth at rest; vv = |v|^2, par = (mu, mu_s, v_s, v_0, ...).

    mu(v) = (mu + (mu_s - mu) exp(-(v / v_s)^2)) v / sqrt(v^2 + v_0^2)
    """
    return (par[0] + (par[1] - par[0]) * np.exp(-vv / (par[2] * par[2]))) / np.sqrt(vv + par[3] * par[3])


# The exact law: while bodies slide, the friction has the direction against v, and mu(|v|) has no regularisation. Where
# they stick, it has none: rows hold them (phase_scenes.py), and the numbers of the direction are zero.


@kernel
def sliding(vv, par):
    """mu(|v|) of the exact law; vv = |v|^2, par = (mu, mu_s, v_s, ...). Without a Stribeck velocity, v_s = 0, it is mu.

    mu(v) = mu + (mu_s - mu) exp(-(v / v_s)^2)
    """
    if par[2] == 0.0:
        return par[0] + 0.0 * vv
    return par[0] + (par[1] - par[0]) * np.exp(-vv / (par[2] * par[2]))


@kernel
def heading(v0, v1, v2, d, v_0):
    """e = v / |v| while v is within 90 degrees of d (3,), along d where |v| is far below D = v_0 |d|; zero where d is.

    u = d d.d + (v d.d - d d.v) d.d v.v / ((v.v + D^2) sqrt((d.v)^2 + D^2 d.d)),  e = u / |u|:  analytic at v = 0, and
    constant where v has the direction of d, whatever its sign. From D on it is against what v has across d, whatever
    v has along it: a slip that begins across d gets the direction of its friction, and passes no 90 degrees.
    """
    a, b = v0 * d[0] + v1 * d[1] + v2 * d[2], d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    vv = v0 * v0 + v1 * v1 + v2 * v2
    c = vv / (vv + v_0 * v_0 * b + TINY) / np.sqrt(a * a + v_0 * v_0 * b * b + TINY)
    u0, u1, u2 = d[0] + c * (b * v0 - a * d[0]), d[1] + c * (b * v1 - a * d[1]), d[2] + c * (b * v2 - a * d[2])
    size = np.sqrt(u0 * u0 + u1 * u1 + u2 * u2 + TINY)
    return u0 / size, u1 / size, u2 / size


@kernel
def tangential(n0, n1, n2, e0, e1, e2):
    """e less its part along n, of length one; zero where e is."""
    off = n0 * e0 + n1 * e1 + n2 * e2
    e0, e1, e2 = e0 - off * n0, e1 - off * n1, e2 - off * n2
    size = np.sqrt(e0 * e0 + e1 * e1 + e2 * e2 + TINY)
    return e0 / size, e1 / size, e2 / size


@kernel
def slip(x, xd):
    """xd_a - xd_b - omega_b x (x_a - x_b)."""
    d0, d1, d2 = x[0] - x[6], x[1] - x[7], x[2] - x[8]
    return (
        xd[0] - xd[6] - (xd[10] * d2 - xd[11] * d1),
        xd[1] - xd[7] - (xd[11] * d0 - xd[9] * d2),
        xd[2] - xd[8] - (xd[9] * d1 - xd[10] * d0),
    )


@kernel
def act(x, F0, F1, F2, N0, N1, N2, out):
    """F at x_a and N on a, the opposite on b at the same place."""
    d0, d1, d2 = x[0] - x[6], x[1] - x[7], x[2] - x[8]
    out[0], out[1], out[2], out[3], out[4], out[5] = F0, F1, F2, N0, N1, N2
    out[6], out[7], out[8] = -F0, -F1, -F2
    out[9] = -N0 - (d1 * F2 - d2 * F1)
    out[10] = -N1 - (d2 * F0 - d0 * F2)
    out[11] = -N2 - (d0 * F1 - d1 * F0)


@kernel
def slip_series(x, xd, k, s):
    """Coefficient k of x_a - x_b, omega_b and the slip velocity, in rows 0 to 8 of s."""
    for i in range(3):
        s[i, k] = x[i] - x[6 + i]
        s[3 + i, k] = xd[9 + i]
    w0, w1, w2 = cross(s, 3, 0, k)
    s[6, k] = -(w0 - xd[0] + xd[6])
    s[7, k] = -(w1 - xd[1] + xd[7])
    s[8, k] = -(w2 - xd[2] + xd[8])


@kernel
def direction_series(s, v, first, v_0, k):
    """Coefficient k, a tuple of three, of v / sqrt(v.v + v_0^2); v in rows v to v + 2 of s, two rows are its own."""
    s[first, k] = dot(s, v, v, k) + (v_0 * v_0 if k == 0 else 0.0)
    s[first + 1, k] = inverse_root(s[first], s[first + 1], k)
    return scaled(s, v, first + 1, k)


HEADING_ROWS = 15


@kernel
def heading_series(s, v, first, d, v_0, k):
    """Coefficient k, a tuple of three, of `heading`; v in rows v to v + 2 of s, HEADING_ROWS rows are its own."""
    # Rows of d.v, (d.v)^2 + D^2 d.d and its inverse root (0), u (3), v d.d - d d.v (6), u.u and its inverse root (9),
    # d.d over the first root, v.v + D^2, their quotient (11), and the factor of the rows from 6 on in u (14)
    a, u, zero = first, first + 3, 1.0 if k == 0 else 0.0
    b = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    least = v_0 * v_0 * b + TINY
    s[a, k] = s[v, k] * d[0] + s[v + 1, k] * d[1] + s[v + 2, k] * d[2]
    s[a + 1, k] = square(s[a], k) + (v_0 * v_0 * b * b + TINY) * zero
    s[a + 2, k] = inverse_root(s[a + 1], s[a + 2], k)
    s[first + 11, k] = b * s[a + 2, k]
    s[first + 12, k] = dot(s, v, v, k) + least * zero
    s[first + 13, k] = quotient(s[first + 11], s[first + 12], s[first + 13], k)
    s[first + 14, k] = s[first + 11, k] - least * s[first + 13, k]
    for i in range(3):
        s[first + 6 + i, k] = b * s[v + i, k] - s[a, k] * d[i]
        s[u + i, k] = b * d[i] * zero + product(s[first + 6 + i], s[first + 14], k)
    s[first + 9, k] = dot(s, u, u, k) + TINY * zero
    s[first + 10, k] = inverse_root(s[first + 9], s[first + 10], k)
    return scaled(s, u, first + 10, k)


TANGENTIAL_ROWS = 9


@kernel
def tangential_series(s, n, e0, e1, e2, first, k):
    """Coefficient k, a tuple of three, of `tangential`; n in rows n to n + 2 of s, TANGENTIAL_ROWS rows are its own."""
    s[first, k], s[first + 1, k], s[first + 2, k] = e0, e1, e2
    s[first + 3, k] = dot(s, n, first, k)
    off = scaled(s, n, first + 3, k)
    for i in range(3):
        s[first + 4 + i, k] = s[first + i, k] - off[i]
    s[first + 7, k] = dot(s, first + 4, first + 4, k) + (TINY if k == 0 else 0.0)
    s[first + 8, k] = inverse_root(s[first + 7], s[first + 8], k)
    return scaled(s, first + 4, first + 8, k)


@kernel
def act_series(s, f, k, out):
    """Coefficient k of what the force F in rows f to f + 2 of s is to a and b; x_a - x_b is in rows 0 to 2."""
    n0, n1, n2 = cross(s, 0, f, k)
    for i in range(3):
        out[i] = s[f + i, k]
        out[6 + i] = -s[f + i, k]
    out[9] -= n0
    out[10] -= n1
    out[11] -= n2


@kernel
def size(square):
    """sqrt(square), exact to first order in an imaginary part; where it is zero, so is its derivative."""
    return (square.real + 0.5 * (square - square.real)) * (1.0 / np.sqrt(square.real + LEAST_SQUARE))


@kernel
def along_and_across(x, f):
    """Sizes of the parts of a force f[0:3] and of a torque f[3:6] along the axis x[12:15], then of those across it."""
    n0, n1, n2 = x[12], x[13], x[14]
    along, turn = n0 * f[0] + n1 * f[1] + n2 * f[2], n0 * f[3] + n1 * f[4] + n2 * f[5]
    f0, f1, f2 = f[0] - along * n0, f[1] - along * n1, f[2] - along * n2
    t0, t1, t2 = f[3] - turn * n0, f[4] - turn * n1, f[5] - turn * n2
    across, tilt = size(f0 * f0 + f1 * f1 + f2 * f2), size(t0 * t0 + t1 * t1 + t2 * t2)
    return size(along * along), size(turn * turn), across, tilt


def slip_velocity(value, what, error):
    """A velocity of regularisation; zero, or None, for the exact law."""
    return 0.0 if value is None else not_negative(value, what, error)


def optional(check):
    """The check of a value that may be None."""
    return lambda value, what, error: None if value is None else check(value, what, error)


def slip_of(given):
    """The slip velocity of a regularised law, m/s or rad/s: as given, no less than rounding resolves; SLIP for zero."""
    return max(given, LEAST_SLIP) if given > 0.0 else SLIP


class Sliding(NamedTuple):
    """Where a friction of the exact law sticks or slides: a unit of the phases of a run.

    A run sets its numbers among those that the force has taken: of the direction in which it slides, zero while it
    sticks; then of the rows that hold it.
    """

    turns: bool  # whether bodies turn on one another; else a point of a slides over b
    directions: int  # numbers of the direction: 1 along axis_a, 3 else
    freedom: int  # rows that hold it, at most: 1 along axis_a, 2 across normal_b, 3 where nothing is known

    @property
    def row_numbers(self) -> int:
        """Numbers of a row: a direction of each body, or one of b; and its value."""
        return 7 if self.turns else 4

    @property
    def count(self) -> int:
        """Its numbers."""
        return self.directions + self.freedom * self.row_numbers


PIN, GUIDE, PLANE = Sliding(True, 1, 1), Sliding(False, 1, 1), Sliding(False, 3, 2)
POINT_OF_BODY, ORIENTATION = Sliding(False, 3, 3), Sliding(True, 3, 3)


class BodyFriction:
    """Mixed in before `Force`: friction between two bodies, by a force at a point of a and by a torque.

    The first of `sources` scales the force, the second the torque.

    Parameters
    ----------
    a, b : Body or ground
        Two different bodies of one scene. b is the ground or a rigid body, a may be a point mass.
    point_a : array_like (3,), m
        Where the force acts, body frame of a.

    Raises
    ------
    InvalidForce
        If a number is negative or not finite, a velocity of regularisation is zero, both force and torque are zero, or
        a torque would act on a point mass.
    """

    markers = (Point("a"), Turn("a"), Point("b"), Turn("b"))
    particles = True
    sources: tuple[str, ...] = ()

    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = (0.0, 0.0, 0.0),
        name: str = "",
        **quantities: Any,
    ) -> None:
        for unknown in quantities.keys() - self.quantities.keys():
            raise TypeError(f"unknown argument {unknown}")  # answered with the arguments that there are, see calls.py
        super().__init__(a, b, point_a=point_a, name=name)
        for key, value in quantities.items():
            setattr(self, key, value)

    def parameters(self) -> tuple[Any, ...]:
        """The quantities, in their order."""
        return tuple(getattr(self, key) for key in self.quantities)

    def check(self) -> None:
        """Refuse a friction without effect, and a torque on a point mass."""
        super().check()
        torque = self.sources[1]
        if self.b.dimension == 3 or (self.a.dimension == 3 and getattr(self, torque) != 0.0):
            body = self.b if self.b.dimension == 3 else self.a
            hint = "make it a, and the other body b" if body is self.b else f"set {torque}=0"
            raise self.error(f"{self.name}: the point mass {body.name!r} can't take the torque of it; {hint}.")


# Series of friction coefficients, and of normal loads in bearings and guides.
#
#     mu(v) / v = (mu + (mu_s - mu) exp(-v^2 / v_s^2)) / sqrt(v^2 + v_0^2)                (1)
#     N = N_0 + |F - n n.F| + w |n.G| + l |T - n n.T|     G: the force F, or the torque T  (2)
#
# A part of N that is negligible at order zero has no series: its coefficients are rounding. Where it is not negligible
# later, the series are not those of the law, and the step ends before (loops/law_check.py).

COEFFICIENT_ROWS, BEARING_ROWS = 5, 21
F, T, ALONG, TURNING, F_ACROSS, T_ACROSS, SQUARES, ROOTS, PART, LOAD, LAST = 0, 3, 6, 7, 8, 11, 14, 16, 18, 19, 20


@kernel
def sliding_series(s, square, first, par, k):
    """Coefficient k of `sliding`; v^2 is in row `square` of s, COEFFICIENT_ROWS rows are its own."""
    if par[2] == 0.0:
        return par[0] if k == 0 else 0.0
    s[first, k] = -s[square, k] / (par[2] * par[2])
    s[first + 1, k] = exponential(s[first], s[first + 1], k)
    return (par[1] - par[0]) * s[first + 1, k] + (par[0] if k == 0 else 0.0)


@kernel
def coefficient_series(s, square, first, par, k):
    """Coefficient k of `coefficient`, Eq. (1); v^2 is in row `square` of s, COEFFICIENT_ROWS rows are its own."""
    s[first, k] = s[square, k] + (par[3] * par[3] if k == 0 else 0.0)
    s[first + 1, k] = inverse_root(s[first], s[first + 1], k)
    s[first + 2, k] = -s[square, k] / (par[2] * par[2])
    s[first + 3, k] = exponential(s[first + 2], s[first + 3], k)
    s[first + 4, k] = (par[1] - par[0]) * s[first + 3, k] + (par[0] if k == 0 else 0.0)
    return product(s[first + 4], s[first + 1], k)


@kernel
def magnitude(s, a, k, counts):
    """Coefficient k of |a|, a in a row of s; zero beyond order zero unless it counts."""
    if k == 0:
        return abs(s[a, 0])
    return 0.0 if not counts else (s[a, k] if s[a, 0] > 0.0 else -s[a, k])


@kernel
def _length(s, v, squares, r, k, counts):
    """Write coefficient k of |v| into row r of s, v in rows v to v + 2."""
    s[squares, k] = dot(s, v, v, k)
    s[r, k] = root(s[squares], s[r], k) if k == 0 or counts else 0.0


@kernel
def _counts(s, r, weight, load, k):
    """Whether a part of N counts: the part of order zero is in row r, N in row `load`."""
    return k > 0 and weight * abs(s[r, 0]) > PIVOT_ROUNDING * s[load, 0]


@kernel
def _part_along(f, k, s, n, v, along):
    """Write coefficient k of f into rows v to v + 2 of s, and that of n.f into row `along`."""
    for i in range(3):
        s[v + i, k] = f[i]
    s[along, k] = dot(s, n, v, k)


@kernel
def _split(f, k, s, n, v, along, across):
    """The same, and f - n n.f in rows `across` to across + 2."""
    _part_along(f, k, s, n, v, along)
    off = scaled(s, n, along, k)
    for i in range(3):
        s[across + i, k] = f[i] - off[i]


@kernel
def _move(f, k, s, n, v, along, across, squares, r, counts):  # ten: as of `_split` and `_length`
    """`_split` and `_length` for another f of order k: each row changes in proportion to f."""
    d0, d1, d2 = f[0] - s[v, k], f[1] - s[v + 1, k], f[2] - s[v + 2, k]
    a = s[n, 0] * d0 + s[n + 1, 0] * d1 + s[n + 2, 0] * d2
    s[v, k], s[v + 1, k], s[v + 2, k] = f[0], f[1], f[2]
    s[along, k] += a
    d0, d1, d2 = d0 - a * s[n, 0], d1 - a * s[n + 1, 0], d2 - a * s[n + 2, 0]
    s[across, k], s[across + 1, k], s[across + 2, k] = s[across, k] + d0, s[across + 1, k] + d1, s[across + 2, k] + d2
    change = s[across, 0] * d0 + s[across + 1, 0] * d1 + s[across + 2, 0] * d2
    s[squares, k] += 2.0 * change
    if counts:
        s[r, k] += change / s[r, 0]


@kernel
def bearing_series(f, k, s, n, first, preload, turns, weight, tilt):  # nine: the rows, and the numbers of Eq. (2)
    """Coefficient k of N, Eq. (2), from that of the reaction f; n is in rows n to n + 2 of s.

    G is the torque where `turns`; BEARING_ROWS rows from `first` on are its own.
    """
    along, turn, load = first + ALONG, first + TURNING, first + LOAD
    across, tilted, part, axial = first + ROOTS, first + ROOTS + 1, first + PART, turn if turns else along
    pushed, tilts = _counts(s, across, 1.0, load, k), _counts(s, tilted, tilt, load, k)
    if k > 0 and not some(s[first + LAST, 0] - k):  # once more for this order
        _move(f, k, s, n, first + F, along, first + F_ACROSS, first + SQUARES, across, pushed)
        if turns or tilt != 0.0:
            _move(f[3:], k, s, n, first + T, turn, first + T_ACROSS, first + SQUARES + 1, tilted, tilts)
    else:
        s[first + LAST, 0] = float(k)
        _split(f, k, s, n, first + F, along, first + F_ACROSS)
        _length(s, first + F_ACROSS, first + SQUARES, across, k, pushed)
        s[tilted, k] = 0.0
        if tilt != 0.0:
            _split(f[3:], k, s, n, first + T, turn, first + T_ACROSS)
            _length(s, first + T_ACROSS, first + SQUARES + 1, tilted, k, tilts)
        elif turns:
            _part_along(f[3:], k, s, n, first + T, turn)
    s[part, k] = magnitude(s, axial, k, _counts(s, axial, weight, load, k))
    s[load, k] = s[across, k] + weight * s[part, k] + tilt * s[tilted, k] + (preload if k == 0 else 0.0)
    return s[load, k]


# Base of joint friction: laws in proportion to the reaction of their own joint or contact.
#
#     friction on a   = par[-1] times `law` for unit normal load
#     par[-1]         = normal_load(x, f, par), f (6,) the force and torque that the constraint exerts
#
# The normal load depends on the multipliers and they on the friction: both are solved for together (accelerations.py).
# Taylor series take two more kernels: `series`, of `law` for par[-1] = 1, and normal_series(x, f, par, k, s), which
# returns coefficient k of the normal load from coefficients k of x and f. It may be called twice for an order, each
# time with all lower orders known; what it leaves out as negligible, it does so by order zero (friction.py).

AXIS = (Point("a"), Turn("a"), Point("b"), Turn("b"), Vector("a"))


class JointFriction:
    """Mixed in before `Force`: friction that follows from the reaction of a constraint.

    Set `joints` and `markers` (Point a, Turn a, Point b, Turn b, then what the law needs, all of them arguments of the
    constraint), write `law`, linear in par[-1], and `normal_load`, in one file of your own.

    Parameters
    ----------
    joint : constraint
        A joint or contact of the scene; it determines where the friction acts.
    kinetic : float
        Coefficient of friction while sliding.
    static : float, optional
        Coefficient at rest, at least the kinetic one (default): the joint sticks while its friction is within static
        times the normal load.
    slip_velocity : float, m/s
        0 (default) for the exact, set-valued law: the joint sticks or slides, and changes at events. A velocity asks
        for the regularised law, with 71% of the friction there, and creep in place of sticking; less than 1e-11 m/s
        acts as 1e-11 m/s. Explicit methods that are asked for by name, and the Maggi/Kane form, need steps in
        proportion to it where the joint comes to rest: give 1e-3 m/s for them.
    stribeck_velocity : float, m/s, optional
        Velocity at which the excess of the static over the kinetic coefficient has fallen to 37%. By default the
        kinetic coefficient acts as soon as the joint slides; with a slip velocity it is ten times that.
    preload : float, N
        Normal load in addition to the reaction.
    name : str, optional

    Raises
    ------
    InvalidForce
        If the joint is of another class or isn't in its scene, or a number is negative, not finite or impossible.
    RedundantConstraints
        At the start of a run, if the reaction is not unique.

    Attributes
    ----------
    joints : tuple of classes
        The constraints whose friction it can be.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> block = scene.add_point_mass(mass=1.0)
    >>> table = scene.add(ts.constraints.PlaneContact(block, scene.ground, normal_b=(0, 0, 1), name="table"))
    >>> friction = scene.add(ts.forces.ContactFriction(table, kinetic=0.2, static=0.3))
    >>> isinstance(friction, ts.JointFriction), friction
    (True, <ContactFriction 'ContactFriction(table)'>)
    """

    joints: tuple[type, ...] = ()
    sources = ("kinetic", "static")
    markers: tuple[Marker, ...] = ()
    particles = True
    sharp = True  # where a part of the normal load passes zero
    place: Sliding | None = None  # of an exact law, where `law` has one
    quantities: Mapping[str, Callable[..., Any]] = MappingProxyType(
        {
            "kinetic": not_negative,
            "static": optional(not_negative),
            "slip_velocity": slip_velocity,
            "stribeck_velocity": optional(positive),
            "preload": not_negative,
        }
    )

    @fitting
    def __init__(
        self,
        joint: Attachment,
        *,
        kinetic: float,
        static: float | None = None,
        slip_velocity: float = 0.0,
        stribeck_velocity: float | None = None,
        preload: float = 0.0,
        name: str = "",
        **geometry: Any,
    ) -> None:
        kind = self._kind()
        name = label(name, kind, InvalidForce)
        if not isinstance(joint, self.joints):
            names = " or ".join(cls.__name__ for cls in self.joints)
            raise InvalidForce(f"{name or kind}: joint must be a {names} of the scene, got {shown_for_handle(joint)}.")
        for unknown in geometry.keys() - self.quantities.keys():
            raise unknown_argument(kind, unknown, [*self.quantities, "name"])
        self.__dict__["joint"] = joint
        super().__init__(joint.a, joint.b, self.coordinates, name)
        self.kinetic, self.static, self.preload = kinetic, static, preload
        self.slip_velocity, self.stribeck_velocity = slip_velocity, stribeck_velocity
        for key, value in geometry.items():
            setattr(self, key, value)

    def _untitled(self, bodies):
        return f"{self._kind()}({self.joint.name})"

    @property
    def coordinates(self) -> tuple[Floats, ...]:
        """Where the markers are, (3,) each: where the joint's are."""
        return tuple(
            np.zeros(3) if marker.code == TURN else getattr(self.joint, marker.argument) for marker in self.markers
        )

    def __setattr__(self, name: str, value: Never) -> None:
        """Set an attribute, checked; where it acts is the joint's."""
        if name == "coordinates":
            return
        if name == "joint" or name in [marker.argument for marker in self.markers if marker.code != TURN]:
            raise self.error(f"{self.name}: {name} is that of its joint {self.joint.name!r}; set it there.")
        super().__setattr__(name, value)

    def check(self) -> None:
        """A joint that the scene has and that doesn't open, and friction no smaller at rest than sliding."""
        self._demand_added(self.joint)
        if getattr(self.joint, "unilateral", False):
            raise self.error(
                f"{self.name}: {self.joint.name!r} opens and closes, and has friction of its own: set kinetic and "
                "static there, and leave this one out."
            )
        if self.__dict__.get("static") is not None and self.static < self.kinetic:
            raise self.error(
                f"{self.name}: static must be at least kinetic = {self.kinetic:g}, got {self.static:g}; leave it out "
                "where they are the same."
            )

    def parameters(self) -> tuple[Any, ...]:
        """(mu, mu_s, v_s, v_0, preload), then the geometry."""
        static = self.kinetic if self.static is None else self.static
        slip = 0.0 if self.slides else slip_of(self.slip_velocity)
        stribeck = 10.0 * slip if self.stribeck_velocity is None else self.stribeck_velocity
        return self.kinetic, static, stribeck, slip, self.preload, *self.geometry()

    @property
    def slips(self) -> bool:
        """Whether the law is regularised."""
        return not self.slides

    @property
    def slides(self) -> tuple[Sliding, ...]:
        """Where it sticks or slides by the exact law."""
        return (self.place,) if self.place is not None and self.slip_velocity == 0.0 else ()

    @property
    def taken(self) -> int:
        """Numbers of par that a run sets: those of its slides."""
        return sum(each.count for each in self.slides)

    def geometry(self) -> tuple[float, ...]:
        """What `law` and `normal_load` need besides, floats."""
        return ()

    def __getattr__(self, name: str) -> Any:
        """The body-frame coordinates of a marker, by its argument: those of the joint."""
        if name in [marker.argument for marker in self.markers] and "joint" in self.__dict__:
            return getattr(self.joint, name)
        return super().__getattr__(name)

    @classmethod
    def example(cls, rng: Random, a: AnyBody, b: AnyBody) -> Self:
        """A random one, on a joint that is added to the scene, regularised over the velocities of a test."""
        kind = cls.joints[0]
        places = {m.argument: rng.normal(size=3) for m in cls.markers if m.code != TURN}
        places |= {m.argument: rng.normal(size=3) for m in kind.markers if m.argument.startswith("axis")}
        joint = a.scene.add(kind(a, b, **places))
        (mu, more), (v0, vs) = rng.uniform(0.5, 1.0, 2), rng.uniform(4.0, 6.0, 2)
        return cls(joint, kinetic=mu, static=mu + more, slip_velocity=v0, stribeck_velocity=vs, **cls.sizes(rng))

    @classmethod
    def sizes(cls, rng: Random) -> dict[str, float]:
        """Random arguments of the geometry, for tests."""
        return {}
