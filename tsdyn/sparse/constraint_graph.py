"""The constraint graph of a scene for the basis-free forms: rows, bodies, and the addresses of their products.

It has no normalisation rows: displacements (dr, dpi') satisfy them (see body_loops). The Schur complement S = H W H^T
couples rows that share a body; its blocks, their elimination order and all addresses are determined once for a scene.
"""

from typing import NamedTuple

import numpy as np

from ..elements.element import address
from ..elements.loops.body_poses import STILL
from ..elements.loops.constraint_rows import BODY, INTS, MASK, ROW
from ..errors import InvalidConstraint
from ..model.packed_friction import FR_COLUMNS, frictions_of
from .body_splitting import cut
from .massless_axes import Axes, Share, axes_of, inverses, lean_bodies, no_axes
from .symbolic import Pattern, analyse

# columns of Network.kinds: addresses of the loops, then where a kind's instances are
REDUCED, VALUES, BIAS, DRIFT, N_COUNT, N_REALS, N_FIRST_INT, N_FIRST_REAL, N_COLUMNS = range(9)
# columns of Network.products
P_LEFT, P_ROWS, P_RIGHT, P_COLUMNS, P_TARGET, P_STRIDE, P_SAME, P_WIDTH = range(8)  # SAME: with itself, both sides
# columns of Network.parts; kinds of products
H_LEFT, H_ROWS, H_RIGHT, H_COLUMNS, H_TARGET, H_STRIDE, H_KIND, H_BODY, H_WIDTH = range(9)
ROWS, ROWS_WELD, WELD_ROWS, WELDS = range(4)
W_MASS, W_ROTATION, WEIGHTS = 0, 4, 16
DROPPED = "dropped"  # in Packed.shared: the rows of a network of its own that are redundant


class Network(NamedTuple):
    """Rows are in order of elimination; sides are (row, a or b), each 8 floats of H, which are zero where row is -1."""

    bodies: np.ndarray  # int64 (nb, 2): where q_i begins, its length: 7, 3, or poses.STILL of what never turns
    kinds: np.ndarray  # int64 (kinds, N_COLUMNS); more than one of a kind where instances between them are left out
    table: np.ndarray  # int64: body_loops.INTS for each instance
    sides: np.ndarray  # int64 (m, 2): the bodies of a row; nb is the ground
    row: np.ndarray  # int64 (m,): its place among the rows of Phi; -1 for a weld's or an axis's
    products: np.ndarray  # int64 (products, P_WIDTH): rows of sides that meet at a body, and where their product goes
    inverse: np.ndarray  # ((nb + 1) 16,): 1 / m and three zeros, columns of J'^-1; zero for the ground
    mass: np.ndarray  # ((nb + 1) 16,): m and three zeros, columns of J'
    spins: np.ndarray  # int64 (nb,): whether omega' x J' omega' is ever other than zero
    pattern: Pattern  # of S
    normals: np.ndarray  # int64 (nb,): the row of Phi that normalises a body's p, or -1
    parts: np.ndarray  # int64 (products, H_WIDTH): the products at the parts of hubs, see body_splitting.py
    scales: np.ndarray  # (products,): what they are multiplied by
    welds: np.ndarray  # int64 (rows of welds, 2): which row, of which body
    diagonal: np.ndarray  # int64 (m,): where the diagonal entry of a row is in a value array of the pattern
    dropped: np.ndarray  # int64: rows that follow from the others, as chosen at the first start; see selection.py
    frictions: np.ndarray  # int64 (frictions, FR_COLUMNS): those that follow from reactions; see packed_friction.py
    friction_rows: np.ndarray  # int64 (rows of their joints, 2): which row, and on which side its reaction is taken
    rub: np.ndarray  # int64 (1,): address of what solves for them, as the form needs it
    axes: Axes  # rows of bodies with next to no inertia about an axis


def network_of(packed, *columns):
    """The network of a packed scene with the addresses of these loops, made and loaded once."""
    kept = packed.shared
    if columns not in kept:
        if "network" not in kept:
            kept["network"] = build(packed)
        kept[columns] = with_loops(*kept["network"], *columns)
    return kept[columns]


def drop(packed, rows):
    """Have the networks of a scene made anew, with these rows of them redundant, int64 (k,); None where none are.

    Hubs are left whole then: elimination may end with the row of a weld, which can't be left out.
    """
    for key in [key for key in packed.shared if key == "network" or isinstance(key, tuple)]:
        del packed.shared[key]
    if rows is None:
        packed.shared.pop(DROPPED, None)
    else:
        packed.shared[DROPPED] = rows


def no_network():
    """The network of nothing, for its type."""
    none, pattern = np.zeros(0, np.int64), analyse([], [])[1]
    pairs = np.zeros((0, 2), np.int64)
    kinds, products = np.zeros((0, N_COLUMNS), np.int64), np.zeros((0, P_WIDTH), np.int64)
    parts = np.zeros((0, H_WIDTH), np.int64)
    return Network(
        pairs, kinds, none, pairs, none, products, np.zeros(16), np.zeros(16), none, pattern, none, parts, np.zeros(0),
        pairs, none, none, np.zeros((0, FR_COLUMNS), np.int64), pairs, np.zeros(1, np.int64),
        no_axes(),
    )  # fmt: skip


def build(packed, still=None):
    """The network of a packed scene, with the addresses of the loops still zero, and the classes of its kinds.

    With `still`, a `locked_orientations.Still`, without the rotations of those bodies and the rows that hold them.
    """
    system, omitted, rows = packed.system, (), packed.system.bodies
    if still is not None:
        omitted, rows = still.omitted, rows.copy()
        rows[still.bodies, 1] = STILL
    bodies = {id(body): i for i, body in enumerate(packed.bodies)}
    nb = len(bodies)
    joints, row, normals = [], 0, np.full(nb, -1, np.int64)
    for i, constraint in enumerate(packed.constraints):
        if constraint.normalises:
            normals[bodies[id(constraint.a)]] = row
        elif i not in omitted:
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
    degrees = np.where(rows[:, 1] == 7, 6, 3).tolist()
    whole = DROPPED in packed.shared or packed.system.normals.size  # frictions couple the rows of a hub as they are
    parts = [] if whole else cut([tuple(body if body < nb else -1 for body in pair) for pair in nodes], sizes, degrees)
    hubs, cliques = {part.body for part in parts}, [[] for _ in range(nb)]
    for pair, node in nodes.items():
        for body in set(pair) - hubs - {nb}:
            cliques[body].append(node)
    cliques += [[*part.nodes, *(weld for weld, _ in part.welds)] for part in parts]
    lean = {body: one for body, one in lean_bodies(packed).items() if rows[body, 1] == 7}
    held = [(body, body, 1.0, None, []) for body in sorted(lean.keys() - hubs)]  # body, clique, scale, nodes, welds
    held += [
        (part.body, nb + i, part.scale, part.nodes, part.welds) for i, part in enumerate(parts) if part.body in lean
    ]
    for i, (_, clique, *_) in enumerate(held):
        cliques[clique].append(len(sizes) + i)
    sizes += [len(lean[body].axes) for body, *_ in held]
    starts, pattern, where = analyse(sizes, cliques, len(held))

    m = sum(sizes)
    firsts = [int(starts[node]) + offset for node, offset in inside]
    sides, places = np.full((m, 2), nb, np.int64), np.full(m, -1, np.int64)
    at_body, at_node, products = [[] for _ in range(nb)], [[] for _ in nodes], []
    for i, (constraint, pair, row) in enumerate(joints):
        e = np.arange(firsts[i], firsts[i] + constraint.rows)
        sides[e], places[e] = pair, np.arange(row, row + constraint.rows)
        at_node[inside[i][0]].append(i)
        for side, body in enumerate(pair):
            if body < nb and body not in hubs:
                at_body[body].append((i, side))

    def product(i, side, j, other):
        (node, r), (other_node, c) = inside[i], inside[j]
        target, stride, _ = where(node, other_node)
        left, right = 16 * firsts[i] + 8 * side, 16 * firsts[j] + 8 * other
        return left, joints[i][0].rows, right, joints[j][0].rows, target + r * stride + c, stride

    for i in range(len(joints)):
        products.append((*product(i, 0, i, 0), 1))
    for found in at_body:
        for i, side in found:
            for j, other in found:
                if firsts[i] < firsts[j]:
                    products.append((*product(i, side, j, other), 0))

    def at_part(body, nodes):
        return [(i, joints[i][1].index(body)) for node in nodes for i in at_node[node]]

    welded, scales, welds = [], [], []
    for part in parts:
        found = at_part(part.body, part.nodes)
        for i, side in found:
            for j, other in found:
                if firsts[i] <= firsts[j]:
                    welded.append((*product(i, side, j, other), ROWS, part.body))
                    scales.append(part.scale - (i == j))  # the whole hub's is among the products
        for weld, sign in part.welds:
            count = sizes[weld]
            for i, side in found:
                node, r = inside[i]
                target, stride, after = where(node, weld)
                to, kind = (target + r, WELD_ROWS) if after else (target + r * stride, ROWS_WELD)
                left = 16 * firsts[i] + 8 * side
                welded.append((left, joints[i][0].rows, 0, count, to, stride, kind, part.body))
                scales.append(sign * part.scale)
            for other, other_sign in part.welds:
                target, stride, after = where(weld, other)
                if not after:
                    welded.append((0, count, 0, count, target, stride, WELDS, part.body))
                    scales.append(sign * other_sign * part.scale)
            if sign > 0:
                welds += [(int(starts[weld]) + r, part.body) for r in range(count)]

    shares = [
        Share(body, scale, at_body[body] if nodes is None else at_part(body, nodes), welds, len(sizes) - len(held) + i)
        for i, (body, _, scale, nodes, welds) in enumerate(held)
    ]
    axes = axes_of(shares, lean, [part.rows for part, _, _ in joints], inside, starts, where)
    sides[axes.rows[:, 0], 0] = axes.rows[:, 1]

    index = {id(constraint): i for i, (constraint, _, _) in enumerate(joints)}
    classes = dict.fromkeys(type(constraint) for constraint in packed.constraints)
    kinds, table, used = [], [], []
    for kind, packed_kind in zip(classes, system.kinds, strict=True):
        if kind.normalises:
            continue
        _, _, _, phi_t, _, stride, _, first_real, _ = packed_kind
        last = None  # the instance before, where it is not left out
        for at, constraint in enumerate(c for c in packed.constraints if type(c) is kind):
            i = index.get(id(constraint))
            if i is None:
                continue
            if last is None or last != at - 1:
                kinds.append([0, 0, 0, int(phi_t != 0), 0, stride, len(table), first_real + at * stride])
                used.append(kind)
            last = at
            kinds[-1][N_COUNT] += 1
            entry = [0] * INTS
            entry[BODY : BODY + 2], entry[ROW], entry[MASK] = joints[i][1], firsts[i], 0
            table += entry

    inverse, mass = np.zeros((nb + 1, WEIGHTS)), np.zeros((nb + 1, WEIGHTS))
    spins = np.zeros(nb, np.int64)
    inverse[:nb, W_MASS], mass[:nb, W_MASS] = 1.0 / system.mass, system.mass
    rigid = np.flatnonzero(rows[:, 1] == 7)
    J = system.inertia[rigid].reshape(-1, 3, 3)
    spins[rigid] = (J[:, :1, :1] * np.eye(3) != J).any(axis=(1, 2))
    for weights, matrices in ((inverse, inverses(J, [lean.get(i) for i in rigid])), (mass, J)):
        weights[rigid, W_ROTATION:] = np.pad(matrices, ((0, 0), (0, 0), (0, 1))).reshape(-1, 12)
    frictions, friction_rows = frictions_of(
        packed, bodies, lambda part: range(firsts[index[id(part)]], firsts[index[id(part)]] + part.rows), sides
    )
    dropped = np.array(packed.shared.get(DROPPED, ()), np.int64)
    if still is not None:
        dropped = np.flatnonzero(np.isin(places, still.dropped))
    network = Network(
        bodies=rows,
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
        parts=np.array(welded, np.int64).reshape(-1, H_WIDTH),
        scales=np.array(scales, float),
        welds=np.array(welds, np.int64).reshape(-1, 2),
        diagonal=_diagonal(pattern),
        dropped=dropped,
        frictions=frictions,
        friction_rows=friction_rows,
        rub=np.zeros(1, np.int64),
        axes=axes,
    )
    return network, tuple(used)


def _diagonal(pattern):
    """Where the diagonal entries are, in the order of the eliminated vector."""
    sizes = np.diff(pattern.starts)
    within = np.arange(pattern.shape[0]) - np.repeat(pattern.starts[:-1], sizes)
    return np.repeat(pattern.heads, sizes) + within * (np.repeat(pattern.widths, sizes) + 1)


def with_loops(network, kinds, *columns):
    """The network with the addresses of these loops, which are loaded now."""
    names = {REDUCED: "reduced", VALUES: "values", BIAS: "bias", DRIFT: "drift"}
    table = network.kinds.copy()
    for row, kind in zip(table, kinds, strict=True):
        for column in columns:
            if column != DRIFT or row[DRIFT] != 0:
                row[column] = address(kind.kernels, names[column], kind.__name__, InvalidConstraint)
    return network._replace(kinds=table, rub=np.zeros(1, np.int64))
