"""Uniqueness of reactions among redundant constraints: reactions to which no self-stress contributes.

A dropped row h of H gives a self-stress z, H^T z = 0, with z = 1 for h and -(H W H^T)^-1 H W h^T for the kept rows. Any
multiple of z may be added to the multipliers without effect on the motion. The reaction of a constraint is unique if no
self-stress loads a body through it.
"""

import math

import numpy as np

from ..jit.kernels import entry, kernel, long_kernel, resident
from ..model.packed import index_of
from ..rows.evaluation import run_loops
from ..rows.schur_complement import gather, weigh
from ..sparse.constraint_graph import REDUCED
from ..sparse.constraint_graphs import network_of
from ..sparse.factorisation import solve
from ..workspaces.workspace import load_parts, parts
from .factorised_rows import factorise_at
from .tolerances import LEAST_DIVISOR, NO_STRESS


@kernel
def find_stress(network, f, whole, dropped):
    """b = z of a dropped row, of H whole; its largest entry."""
    for i in range(f.Z.size):
        f.Z[i] = 0.0
    for side in range(2):
        body = network.sides[dropped, side]
        if body < network.bodies.shape[0]:
            weigh(network.inverse, body, whole, 16 * dropped + 8 * side, f.Z, 8 * body)
    gather(network, f.H, f.Z, f.b)
    solve(network.pattern, f.S, f.b)
    largest = 1.0
    for e in range(f.b.size):
        f.b[e] = -f.b[e]
        largest = max(largest, abs(f.b[e]))
    f.b[dropped] = 1.0
    return largest


@long_kernel
def find_rows(network, s, f, q, t, whole):
    """H at q without dropped rows and, in `whole`, with them, and the factors of S; False if S is singular."""
    regular = factorise_at(network, s, f, t, q)
    count = f.dropped[0]
    f.dropped[0] = 0
    run_loops(network, s.reals, REDUCED, f, t, f.b, whole)
    f.dropped[0] = count
    return regular


@entry
def free_loads(context, t, q, rows, sides, whole, out):
    """out (k,): the largest load that a self-stress of size one has these rows put on a body, by their own size."""
    c = load_parts(context)
    network, s, f = c.network, c.system, c.free
    for k in range(t.size):
        out[k] = 0.0 if find_rows(network, s, f, q[k], t[k], whole) else math.inf
        for d in range(f.dropped[0]):
            largest, size = find_stress(network, f, whole, f.dropped[1 + d]), 0.0
            for c in range(8):
                load = 0.0
                for i in range(rows.size):
                    h = whole[16 * rows[i] + 8 * sides[i] + c]
                    size = max(size, abs(h))
                    load += f.b[rows[i]] * h
                f.Z[c] = load
            for c in range(8):
                out[k] = max(out[k], abs(f.Z[c]) / max(largest * size, LEAST_DIVISOR))


def unique(solution, rows, body):
    """Determine whether the reaction of these rows, a slice, on a body is unique: bool (k,)."""
    network = network_of(solution.packed, REDUCED)
    if not network.dropped.size:
        return np.ones(solution.t.size, bool)
    wanted = np.flatnonzero((network.row >= rows.start) & (network.row < rows.stop))
    sides = np.where(network.sides[wanted, 0] == index_of(solution.packed, body), 0, 1)
    system = solution.system._replace(reals=solution.system.reals.copy())
    context, *_keep = resident(parts(system, network, solution.q.shape[1]))
    out = np.zeros(solution.t.size)
    free_loads(context, solution.t, solution.q, wanted, sides, np.zeros(16 * len(network.row)), out)
    return out < NO_STRESS
