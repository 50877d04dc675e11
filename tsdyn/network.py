"""The graph of a scene for the basis-free forms: which rows meet at which bodies, and where their products go.

Normalisation rows are no part of it: in terms of (dr, dpi') every body's is fulfilled (see body_loops). What is left
of Phi_q W Phi_q^T, S = H W H^T, couples rows that share a body; its blocks, their order of elimination and all places
are found once for a scene.
"""

from typing import NamedTuple

import numpy as np

from .attachment import address
from .blocks import Pattern, analyse
from .body_loops import BODY, INTS, MASK, ROW
from .errors import InvalidConstraint

# columns of Network.kinds: addresses of the loops, then where a kind's instances are
REDUCED, VALUES, BIAS, DRIFT, N_COUNT, N_REALS, N_FIRST_INT, N_FIRST_REAL, N_COLUMNS = range(9)
# columns of Network.products
P_LEFT, P_ROWS, P_RIGHT, P_COLUMNS, P_TARGET, P_STRIDE, P_SAME, P_WIDTH = range(8)  # SAME: with itself, both sides
W_MASS, W_ROTATION, WEIGHTS = 0, 4, 16
THIN = 1e-12  # of the largest principal inertia: what is less is none


class Network(NamedTuple):
    """Rows are in order of elimination; sides are (row, a or b), each 8 floats of H."""

    bodies: np.ndarray  # int64 (nb, 2): where q_i begins, its length 7 or 3
    kinds: np.ndarray  # int64 (kinds, N_COLUMNS)
    table: np.ndarray  # int64: body_loops.INTS for each instance
    sides: np.ndarray  # int64 (m, 2): the bodies of a row; nb is the ground
    row: np.ndarray  # int64 (m,): its place among the rows of Phi
    products: np.ndarray  # int64 (products, P_WIDTH): rows of sides that meet at a body, and where their product goes
    inverse: np.ndarray  # ((nb + 1) 16,): 1 / m and three zeros, columns of J'^-1; zero for the ground
    mass: np.ndarray  # ((nb + 1) 16,): m and three zeros, columns of J'
    spins: np.ndarray  # int64 (nb,): whether omega' x J' omega' is ever other than zero
    pattern: Pattern  # of S
    normals: np.ndarray  # int64 (nb,): the row of Phi that normalises a body's p, or -1


def thin(packed):
    """Which bodies' inertias have no inverse: about an axis they have none; bool (nb,)."""
    system, result = packed.system, np.zeros(len(packed.bodies), bool)
    rigid = system.bodies[:, 1] == 7
    principal = np.linalg.eigvalsh(system.inertia[rigid].reshape(-1, 3, 3))
    result[rigid] = ~(principal[:, 0] > THIN * principal[:, 2])
    return result


def is_regular(packed):
    """Whether all inertias can be inverted; a body without inertia about an axis needs D^T M D."""
    return not thin(packed).any()


def _inverses(J, mass):
    """Of inertias (k, 3, 3); of one that has none, with as much as lets it serve as a metric."""
    size, axes = np.linalg.eigh(J)
    thin = ~(size[:, 0] > THIN * size[:, 2])
    least = np.where(size[:, 2] > 0.0, 0.1 * size[:, 2], mass)
    size = np.maximum(size, least[:, None])
    result = (axes / size[:, None, :]) @ axes.transpose(0, 2, 1)
    result[~thin] = np.linalg.inv(J[~thin])
    return result


def network_of(packed, *columns):
    """The network of a packed scene with the addresses of these loops, made and loaded once."""
    kept = packed.shared
    if columns not in kept:
        if "network" not in kept:
            kept["network"] = build(packed)
        kept[columns] = with_loops(*kept["network"], *columns)
    return kept[columns]


def no_network():
    """The network of nothing, for its type."""
    none, pattern = np.zeros(0, np.int64), analyse([], [])[1]
    pairs = np.zeros((0, 2), np.int64)
    kinds, products = np.zeros((0, N_COLUMNS), np.int64), np.zeros((0, P_WIDTH), np.int64)
    return Network(pairs, kinds, none, pairs, none, products, np.zeros(16), np.zeros(16), none, pattern, none)


def build(packed):
    """The network of a packed scene, with the addresses of the loops still zero, and the classes of its kinds."""
    system = packed.system
    bodies = {id(body): i for i, body in enumerate(packed.bodies)}
    nb = len(bodies)
    joints, row, normals = [], 0, np.full(nb, -1, np.int64)
    for constraint in packed.constraints:
        if constraint.normalises:
            normals[bodies[id(constraint.a)]] = row
        else:
            pair = tuple(bodies.get(id(body), nb) for body in (constraint.a, constraint.b))
            joints.append((constraint, pair, row))
        row += constraint.rows
    nodes, sizes, inside = {}, [], []
    for constraint, pair, _ in joints:
        node = nodes.setdefault(tuple(sorted(pair)), len(nodes))
        if node == len(sizes):
            sizes.append(0)
        inside.append((node, sizes[node]))
        sizes[node] += constraint.rows
    cliques = [[] for _ in range(nb)]
    for pair, node in nodes.items():
        for body in set(pair) - {nb}:
            cliques[body].append(node)
    starts, pattern, where = analyse(sizes, cliques)

    m = sum(sizes)
    firsts = [int(starts[node]) + offset for node, offset in inside]
    sides, places = np.zeros((m, 2), np.int64), np.zeros(m, np.int64)
    at_body, products = [[] for _ in range(nb)], []
    for i, (constraint, pair, row) in enumerate(joints):
        e = np.arange(firsts[i], firsts[i] + constraint.rows)
        sides[e], places[e] = pair, np.arange(row, row + constraint.rows)
        for side, body in enumerate(pair):
            if body < nb:
                at_body[body].append((i, side))

    def product(i, side, j, other):
        (node, r), (other_node, c) = inside[i], inside[j]
        target, stride, _ = where(node, other_node)
        left, right = 16 * firsts[i] + 8 * side, 16 * firsts[j] + 8 * other
        rows, columns = joints[i][0].rows, joints[j][0].rows
        products.append((left, rows, right, columns, target + r * stride + c, stride, int(i == j)))

    for i in range(len(joints)):
        product(i, 0, i, 0)
    for found in at_body:
        for i, side in found:
            for j, other in found:
                if firsts[i] < firsts[j]:
                    product(i, side, j, other)

    index = {id(constraint): i for i, (constraint, _, _) in enumerate(joints)}
    classes = dict.fromkeys(type(constraint) for constraint in packed.constraints)
    kinds, table, used = [], [], []
    for kind, packed_kind in zip(classes, system.kinds, strict=True):
        if kind.normalises:
            continue
        first = len(table)
        for constraint in (c for c in packed.constraints if type(c) is kind):
            i = index[id(constraint)]
            entry = [0] * INTS
            entry[BODY : BODY + 2], entry[ROW], entry[MASK] = joints[i][1], firsts[i], 0
            table += entry
        _, _, _, phi_t, count, stride, _, first_real, _ = packed_kind
        kinds.append([0, 0, 0, int(phi_t != 0), count, stride, first, first_real])
        used.append(kind)

    inverse, mass = np.zeros((nb + 1, WEIGHTS)), np.zeros((nb + 1, WEIGHTS))
    spins = np.zeros(nb, np.int64)
    inverse[:nb, W_MASS], mass[:nb, W_MASS] = 1.0 / system.mass, system.mass
    rigid = np.flatnonzero(system.bodies[:, 1] == 7)
    J = system.inertia[rigid].reshape(-1, 3, 3)
    spins[rigid] = (J[:, :1, :1] * np.eye(3) != J).any(axis=(1, 2))
    for weights, matrices in ((inverse, _inverses(J, system.mass[rigid])), (mass, J)):
        weights[rigid, W_ROTATION:] = np.pad(matrices, ((0, 0), (0, 0), (0, 1))).reshape(-1, 12)
    network = Network(
        bodies=system.bodies,
        kinds=np.array(kinds, np.int64).reshape(-1, N_COLUMNS),
        table=np.array(table, np.int64),
        sides=sides,
        row=places,
        products=np.array(products, np.int64).reshape(-1, P_WIDTH),
        inverse=inverse.ravel(),
        mass=mass.ravel(),
        spins=spins,
        pattern=pattern,
        normals=normals,
    )
    return network, tuple(used)


def with_loops(network, kinds, *columns):
    """The network with the addresses of these loops, which are loaded now."""
    names = {REDUCED: "reduced", VALUES: "values", BIAS: "bias", DRIFT: "drift"}
    table = network.kinds.copy()
    for row, kind in zip(table, kinds, strict=True):
        for column in columns:
            if column != DRIFT or row[DRIFT] != 0:
                row[column] = address(kind.kernels, names[column], kind.__name__, InvalidConstraint)
    return network._replace(kinds=table)
