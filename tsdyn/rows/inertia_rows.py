"""Axes of bodies with negligible inertia: an axis row for each keeps the mass matrix invertible and the motion exact.

The moment of inertia j about such an axis e is raised to J. A multiplier lam_e removes the added inertia c^2 = J - j
from the equation of motion:

    (J' + c^2 e e^T) omega'd = tau' - H^T lam - c e lam_e,        c e . omega'd + lam_e = 0

The motion is that of J' for any J. The second equation is an axis row of S: products of c e with the other rows at the
body, and -j / J on the diagonal. It is eliminated after those rows. Its pivot is minus the part of J that these rows
and j account for, so S needs no pivoting wherever the constraints hold the axis, and is as well conditioned as with
inertia J. A body that is small compared with its lever arms has three such axes.

So has a light body that carries heavy ones: the pivots of S at the joints of these are as small as the ratio of
inertias, and J is the mean of the two by logarithms. About an axis that nothing holds as many digits are at stake.
"""

from typing import NamedTuple

import numpy as np

from ..elements.markers import POINT
from ..jit.kernels import Record, kernel, records
from ..jit.simd import fma, four, get, let, put, splat, times, total
from ..maths.tolerances import SUM_ROUNDING
from .tolerances import MASSLESS, ONE_DIGIT, RAISED, THIN


class Axis(Record):
    """An axis row."""

    row: int  # in order of elimination
    body: int


class AxisProduct(Record):
    """Product of an axis row with another row at its body."""

    axis: int
    side: int  # where the row's side begins in H, or -1 - component of a weld
    target: int  # where the product goes in S


# columns of Axes.values: c e; (J' + j e e^T)^-1 c e; the diagonal entry
AXIS_H, AXIS_Y, AXIS_OWN, AXIS_WIDTH = 0, 4, 8, 12


class MasslessAxes(NamedTuple):
    """The axis rows of a graph."""

    rows: np.ndarray  # Axis (axes,)
    values: np.ndarray  # (axes, AXIS_WIDTH)
    products: np.ndarray  # AxisProduct (products,)
    scales: np.ndarray  # (products,): what a product is multiplied by


class Lean(NamedTuple):
    """The axes of one body about which it has next to no inertia."""

    axes: np.ndarray  # (k, 3), body frame
    true: np.ndarray  # (k,): j
    given: float  # J


def lean_bodies(packed):
    """The `Lean` of each body that has such axes, by its number."""
    system = packed.system
    rigid = np.flatnonzero(system.bodies[:, 1] == 7)
    size, axes = np.linalg.eigh(system.inertia[rigid].reshape(-1, 3, 3))
    # Inertia is small beside the largest one of the body, or beside m l^2
    whole = np.maximum(size[:, 2], system.mass[rigid] * levers(packed)[rigid] ** 2)
    most, found = whole.max(initial=0.0), {}
    # Bodies far lighter than others matter only where they carry these
    light = np.where(size[:, 0] < THIN * whole, ONE_DIGIT * whole, size[:, 0]) < MASSLESS * most
    carries = np.isin(rigid, _carriers(packed, set(rigid[light].tolist()))) if light.any() else light
    least = np.where(carries, RAISED * most, THIN * whole)
    given = np.where(carries, np.sqrt(whole * most), ONE_DIGIT * whole)
    # Axes below their limit; what is rounding of zero counts as zero
    for i in np.flatnonzero(size[:, 0] < least):
        few = size[i] < least[i]
        true = np.where(size[i, few] > SUM_ROUNDING * size[i, 2], size[i, few], 0.0)
        found[int(rigid[i])] = Lean(axes[i].T[few], true, given[i])
    return found


def _carriers(packed, light):
    """Which of some light bodies join others to each other or to the ground, by themselves or together."""
    number, near, found = {id(body): i for i, body in enumerate(packed.bodies)}, {i: set() for i in light}, []
    for constraint in packed.constraints:
        ends = {number.get(id(constraint.body_of(marker)), -1) for marker in constraint.markers}
        for i in ends & light:
            near[i] |= ends - {i}
    # Connected sets of light bodies; one with two neighbours outside carries something
    left = set(light)
    while left:
        together, queue = set(), [left.pop()]
        while queue:
            together.add(i := queue.pop())
            queue += near[i] & left
            left -= near[i]
        if len(set().union(*(near[i] for i in together)) - together) > 1:
            found += together
    return found


def levers(packed):
    """The largest distance of a constraint's point from each body's centroid, (bodies,), m; found once."""
    if packed.derived.levers is None:
        packed.derived.levers = _levers(packed)
    return packed.derived.levers


def _levers(packed):
    bodies, far = {id(body): i for i, body in enumerate(packed.bodies)}, np.zeros(len(packed.bodies))
    for constraint, coordinates in zip(packed.constraints, packed.coordinates, strict=True):
        for marker, s in zip(constraint.markers, coordinates, strict=True):
            i = bodies.get(id(constraint.body_of(marker))) if marker.code == POINT else None
            if i is not None:
                far[i] = max(far[i], float(s @ s))
    return np.sqrt(far)


def inverses(J, lean):
    """Of inertias (k, 3, 3), with what is given to those of `lean`, a list of `Lean` or None."""
    whole = J.copy()
    for i, one in enumerate(lean):
        if one is not None:
            whole[i] += np.einsum("a,ai,aj->ij", one.given - one.true, one.axes, one.axes)
    return np.linalg.inv(whole)


class Share(NamedTuple):
    """A lean body, or a part of it where it is cut as a hub."""

    body: int
    scale: float  # of the body's mass over its own
    sides: list  # pairs: the place of a constraint in the graph's joints, its side
    welds: list  # pairs: the node of a weld, its sign
    node: int  # of its axis rows


def no_axes():
    """The `MasslessAxes` of a graph without lean bodies."""
    return MasslessAxes(records(Axis), np.zeros((0, AXIS_WIDTH)), records(AxisProduct), np.zeros(0))


def axis_of(axes, row):
    """The body and the axis, body frame, that a row in order of elimination belongs to."""
    i = int(np.flatnonzero(axes.rows["row"] == row)[0])
    h = axes.values[i, AXIS_H : AXIS_H + 3]
    return int(axes.rows[i].body), h / np.linalg.norm(h)


def axes_of(shares, lean, counts, pairs, inside, where, starts):
    """The `MasslessAxes` of these shares.

    Parameters
    ----------
    shares : list of Share
    lean : dict
        As `lean_bodies` returns it.
    counts, pairs, inside : list
        Of each constraint its rows' count; its first pair of sides; its node, and where its rows begin there.
    where, starts : callable, ndarray of int64
        As `symbolic.analyse` returns them.
    """
    rows, values, products, scales = [], [], [], []
    for share in shares:
        one = lean[share.body]
        for a, (axis, true) in enumerate(zip(one.axes, one.true, strict=True)):
            k, c = len(rows), np.sqrt((one.given - true) / share.scale)
            rows.append((int(starts[share.node]) + a, share.body))
            values.append([*c * axis, 0.0, *c / one.given * axis, 0.0, -true / one.given, 0.0, 0.0, 0.0])
            for i, side in share.sides:
                node, first = inside[i]
                target, stride, _ = where(node, share.node)
                for r in range(counts[i]):
                    products.append((k, 16 * (pairs[i] + r) + 8 * side, target + (first + r) * stride + a))
                    scales.append(share.scale)
            for weld, sign in share.welds:
                target, stride, _ = where(weld, share.node)
                for r in range(3):
                    products.append((k, -1 - r, target + (3 + r) * stride + a))
                    scales.append(sign * share.scale)
    return MasslessAxes(
        records(Axis, rows),
        np.array(values, float).reshape(-1, AXIS_WIDTH),
        records(AxisProduct, products),
        np.array(scales, float),
    )


# Inertia rows: inertia of a joint coordinate c, such as that of a geared rotor, beside that of the bodies.
#
# The kinetic energy cd^2 / 2 adds h^T h to the mass matrix, with h = c_q. Bodies stay apart if the force on the
# coordinate is an unknown mu beside the multipliers:
#
#     M a = F - H^T lam - h^T mu,        h a + gamma_h - mu = 0
#
# The second equation is an inertia row of S: products of h with the other rows, and one more on the diagonal. It holds
# for accelerations alone. Projections of positions and the chart leave it out: it is zero in H, and one on the diagonal
# of N. Projections by the factors of S are those in the metric of M + h^T h.
#
# floats of a row in Rows.h: h of both bodies, gamma_h
BIAS, WIDTH = 16, 20


@kernel
def inner(H, h, Y, y):
    """Return the product of two rows at one body."""
    return total(fma(four(H, h), four(Y, y), times(four(H, h + 4), four(Y, y + 4))))


@kernel
def set_rows_aside(graph, rows):
    """Move the inertia rows from H to h."""
    for i in range(graph.inertias.size):
        for c in range(0, 16, 4):
            put(rows.h, WIDTH * i + c, four(rows.H, 16 * graph.inertias[i] + c))
    clear_rows(graph, rows)


@kernel
def put_rows_back(graph, rows):
    """Write h into H, for products of rows."""
    for i in range(graph.inertias.size):
        for c in range(0, 16, 4):
            put(rows.H, 16 * graph.inertias[i] + c, four(rows.h, WIDTH * i + c))


@kernel
def clear_rows(graph, rows):
    """H = 0 of inertia rows."""
    for i in range(graph.inertias.size):
        for c in range(0, 16, 4):
            put(rows.H, 16 * graph.inertias[i] + c, splat(0.0))


@kernel
def clear_entries(graph, out):
    """out = 0 of inertia rows."""
    for i in range(graph.inertias.size):
        out[graph.inertias[i]] = 0.0


@kernel
def keep_bias(graph, rows, gamma):
    """gamma_h of the inertia rows, from gamma."""
    for i in range(graph.inertias.size):
        let(rows.h, WIDTH * i + BIAS, gamma[graph.inertias[i]])


@kernel
def leave_diagonal(graph, values):
    """One on the diagonal of rows that are zero."""
    for i in range(graph.inertias.size):
        let(values, graph.diagonal[graph.inertias[i]], 1.0)


@kernel
def raise_diagonal(graph, values):
    """h W h^T + 1 on the diagonal."""
    for i in range(graph.inertias.size):
        at = graph.diagonal[graph.inertias[i]]
        let(values, at, get(values, at) + 1.0)


@kernel
def residuals(graph, rows, Z, out):
    """out = h Z + gamma_h of inertia rows."""
    for i in range(graph.inertias.size):
        e, h = graph.inertias[i], WIDTH * i
        product = inner(rows.h, h, Z, 8 * graph.sides[e, 0]) + inner(rows.h, h + 8, Z, 8 * graph.sides[e, 1])
        out[e] = product + get(rows.h, h + BIAS)


@kernel
def multiply(graph, rows, places, Z, out):
    """out[places[e]] = h Z of inertia row e."""
    for i in range(graph.inertias.size):
        e, h = graph.inertias[i], WIDTH * i
        out[places[e]] = inner(rows.h, h, Z, 8 * graph.sides[e, 0]) + inner(rows.h, h + 8, Z, 8 * graph.sides[e, 1])


@kernel
def unbalance(graph, rows, places, mu, out):
    """out[places[e]] <- mu - gamma_h - out[places[e]]."""
    for i in range(graph.inertias.size):
        e = graph.inertias[i]
        out[places[e]] = mu[e] - get(rows.h, WIDTH * i + BIAS) - out[places[e]]


@kernel
def subtract_multipliers(graph, mu, out):
    """out -= mu of inertia rows."""
    for i in range(graph.inertias.size):
        e = graph.inertias[i]
        out[e] -= mu[e]


@kernel
def take_reactions(graph, rows, mu, F):
    """F <- F - h^T mu, loads on bodies."""
    for i in range(graph.inertias.size):
        e, f = graph.inertias[i], splat(-mu[graph.inertias[i]])
        for k in range(2):
            at, z = WIDTH * i + 8 * k, 8 * graph.sides[e, k]
            put(F, z, fma(four(rows.h, at), f, four(F, z)))
            put(F, z + 4, fma(four(rows.h, at + 4), f, four(F, z + 4)))
