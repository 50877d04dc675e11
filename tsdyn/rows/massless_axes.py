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
from ..jit.kernels import Record, records
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
    """The largest distance of a constraint's point from each body's centroid."""
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
