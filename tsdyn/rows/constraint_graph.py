"""The constraint graph of a scene for the basis-free forms: rows, bodies, products; the metric of lengths."""

from typing import NamedTuple

import numpy as np

from ..jit.kernels import Record, records
from ..model.packed import FrictionPlace
from .massless_axes import AXIS_OWN, MasslessAxes, levers, no_axes
from .symbolic import Pattern, analyse
from .tolerances import LEAST_SHARE, UNEQUAL_MASSES

# The constraint graph of a scene for the basis-free forms: rows, bodies, and the addresses of their products.
#
# It has no normalisation rows: displacements (dr, dpi') satisfy them (constraint_rows.py). The Schur complement S = H W
# H^T couples rows that share a body; its blocks, their elimination order and all addresses are determined once for a
# scene.

REDUCED, VALUES, BIAS, DRIFT = LOOPS = "reduced", "values", "bias", "drift"  # those of a `RowKind`


class RowKind(Record):
    """Instances of one class of primitive without a gap."""

    reduced: int  # addresses of the loops of constraint_rows.py; zero where they aren't needed or there is none
    values: int
    bias: int
    drift: int  # 1 for a moving kind until it is loaded
    count: int  # instances
    stride: int  # reals of each
    table: int  # where the entries of the first begin in ConstraintGraph.table
    reals: int  # and in System.reals


class Product(Record):
    """H Y^T of two constraints at a body; of one with itself, at both."""

    left: int  # where the sides of the two constraints begin in H, and how many rows they have
    rows: int
    right: int
    columns: int
    target: int  # where the product goes in S
    stride: int  # length of a row there
    same: int  # 1 for a constraint with itself; 2 for a later term of a sum with itself


class PartProduct(Record):
    """The same at a part of a split body."""

    left: int
    rows: int
    right: int
    columns: int
    target: int
    stride: int
    kind: int
    body: int


ROWS, ROWS_WELD, WELD_ROWS, WELDS = range(4)  # kinds
W_MASS, W_ROTATION, WEIGHTS = 0, 4, 16


class ConstraintGraph(NamedTuple):
    """Rows are in order of elimination; sides are (row, a or b), each 8 floats of H, which are zero where row is -1.

    A row that is a sum has a pair of sides for each of its terms: that of the first in its own place, those of the
    others behind the pairs of all rows.
    """

    bodies: np.ndarray  # int64 (nb, 2): where q_i begins, its length: 7, 3, or poses.STILL of what never turns
    kinds: np.ndarray  # RowKind (kinds,); more than one of a class where instances between them are left out
    table: np.ndarray  # int64: constraint_rows.INTS for each instance
    sides: np.ndarray  # int64 (m + tails, 2): the bodies of a row; nb is the ground
    sums: np.ndarray  # int64 (sums,): rows that several instances add to
    tails: np.ndarray  # int64 (tails,): the row of each pair of sides behind those of all rows
    row: np.ndarray  # int64 (m,): its place among the rows of Phi; -1 for a weld's or an axis's
    products: np.ndarray  # Product (products,): rows of sides that meet at a body, and where their product goes
    inverse: np.ndarray  # ((nb + 1) 16,): 1 / m and three zeros, columns of J'^-1; zero for the ground
    mass: np.ndarray  # ((nb + 1) 16,): m and three zeros, columns of J'
    spins: np.ndarray  # int64 (nb,): whether omega' x J' omega' is ever other than zero
    pattern: Pattern  # of S
    turns: np.ndarray  # (m,): one for rows that are pure numbers, such as those of axes; of no size but in small scenes
    rates: np.ndarray  # int64 (rows on velocities,): which rows of the graph they are, in order of elimination
    normals: np.ndarray  # int64 (nb,): the row of Phi that normalises a body's p, or -1
    parts: np.ndarray  # PartProduct (products,): the products at the parts of hubs, see graph_builder.py
    scales: np.ndarray  # (products,): what they are multiplied by
    welds: np.ndarray  # int64 (rows of welds, 2): which row, of which body
    diagonal: np.ndarray  # int64 (m,): where the diagonal entry of a row is in a value array of the pattern
    dropped: np.ndarray  # int64: rows that follow from the others, as chosen at the first start; see row_selection.py
    frictions: np.ndarray  # (frictions,) of FrictionPlace: those that follow from reactions
    friction_rows: np.ndarray  # int64 (rows of their joints, 2): which row, and on which side its reaction is taken
    friction_solver: np.ndarray  # int64 (1,): address of what solves for them, as the form needs it
    axes: MasslessAxes  # rows of bodies with next to no inertia about an axis


def no_graph():
    """The graph of nothing, for its type."""
    none, pattern = np.zeros(0, np.int64), analyse([], [])[1]
    pairs = np.zeros((0, 2), np.int64)
    kinds, products, parts = records(RowKind), records(Product), records(PartProduct)
    return ConstraintGraph(
        pairs, kinds, none, pairs, none, none, none, products, np.zeros(16), np.zeros(16), none, pattern, np.zeros(0),
        none, none, parts, np.zeros(0), pairs, none, none, records(FrictionPlace), pairs, np.zeros(1, np.int64),
        no_axes(),
    )  # fmt: skip


# The metric of lengths, in which the rank of constraint rows is judged: geometry alone, whatever the masses.
#
#     |x|^2 = sum |dr|^2 + L^2 |w'|^2
#
# L is the longest arm of a body's joints, m.

MASS_REMEDY = "Give light bodies that carry heavy ones more mass, or make them one body with what they carry."


def arms(packed):
    """L of each body, (bodies,), m: no less than a share of the longest; one in a scene without arms."""
    found = levers(packed)
    longest = found.max(initial=0.0)
    return np.maximum(found, LEAST_SHARE * longest) if longest > 0.0 else np.ones(found.size)


def coordinate_scales(packed):
    """Factors (n,) that make columns of Phi_q those of dr and of 2 L dp, whose length is that of L w'."""
    bodies, L = packed.system.bodies, arms(packed)
    scales = np.ones(int(bodies[:, 1].sum()))
    rigid = bodies[:, 1] == 7
    scales[bodies[rigid, :1] + np.arange(3, 7)] = 0.5 / L[rigid, None]
    return scales


def by_lengths(packed, graph):
    """The constraint graph with the inverse of this metric for W, and without axis rows but in name."""
    inverse, values = np.zeros((len(graph.bodies) + 1, WEIGHTS)), np.zeros_like(graph.axes.values)
    inverse[:-1, W_MASS] = 1.0
    rigid = np.flatnonzero(graph.bodies[:, 1] == 7)
    inverse[rigid[:, None], W_ROTATION + np.array([0, 5, 10])] = arms(packed)[rigid, None] ** -2.0
    values[:, AXIS_OWN] = -1.0
    return graph._replace(inverse=inverse.ravel(), axes=graph.axes._replace(values=values))


def are_unequal(system):
    """Whether heavy bodies may load light ones: the factors of S, and accelerations, lose digits to their ratio."""
    largest = np.abs(system.inertia).max(axis=1)  # zero for a point mass
    return any(x.max() > UNEQUAL_MASSES * x.min() for x in (system.mass, largest[largest > 0.0]) if x.size)


def mass_ratio(packed, least=0.0):
    """The lightest and the heaviest body by mass or inertia, for messages; empty where their ratio is below `least`."""
    system, bodies = packed.system, np.arange(len(packed.bodies))
    rigid = bodies[system.bodies[:, 1] == 7]
    found = [(bodies, system.mass, "kg"), (rigid, np.abs(system.inertia[rigid]).max(axis=1), "kg m^2")]
    which, sizes, unit = min((each for each in found if each[0].size), key=lambda each: each[1].min() / each[1].max())
    light, heavy = sizes.argmin(), sizes.argmax()
    if sizes[heavy] < least * sizes[light]:
        return ""
    one, other = (f"{packed.bodies[which[i]].name} ({sizes[i]:.3g} {unit})" for i in (light, heavy))
    return f"the mass ratio of these bodies is too large for accelerations in double precision: {one} beside {other}"
