"""Uniqueness of reactions among redundant constraints: reactions to which no self-stress contributes.

A redundant row gives a self-stress z, H^T z = 0. Any multiple of z may be added to the multipliers without effect on
the motion. The reaction of a constraint is unique if no self-stress loads a body through it.
"""

import math

import numpy as np

from ..jit.kernels import entry, long_kernel, resident
from ..model.packed import index_of
from ..rows.interface import Rows, count_self_stresses, evaluate_every_row, redundancy, self_stress
from ..sparse.constraint_graph import REDUCED
from ..sparse.constraint_graphs import graph_of
from ..workspaces.workspace import load_parts, parts
from .factorised_rows import factorise_at
from .tolerances import LEAST_DIVISOR, NO_STRESS


@long_kernel
def find_rows(graph, s, f, q, t, whole):
    """H at q without redundant rows and, in `whole`, with them, and the factors of S; False if S is singular."""
    regular = factorise_at(graph, s, f, t, q)
    evaluate_every_row(graph, s, f, Rows(whole, f.rows.Y, f.rows.S), t)
    return regular


@entry
def free_loads(context, t, q, rows, sides, whole, out):
    """out (k,): the largest load on a body by these rows in a unit self-stress, relative to their size."""
    c = load_parts(context)
    graph, s, f = c.graph, c.system, c.tangent
    for k in range(t.size):
        out[k] = 0.0 if find_rows(graph, s, f, q[k], t[k], whole) else math.inf
        for d in range(count_self_stresses(f)):
            largest, size = self_stress(graph, f, whole, d), 0.0
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
    graph = graph_of(solution.packed, REDUCED)
    if not redundancy(graph):
        return np.ones(solution.t.size, bool)
    wanted = np.flatnonzero((graph.row >= rows.start) & (graph.row < rows.stop))
    sides = np.where(graph.sides[wanted, 0] == index_of(solution.packed, body), 0, 1)
    system = solution.system._replace(reals=solution.system.reals.copy())
    context, *_keep = resident(parts(system, graph, solution.q.shape[1]))
    out = np.zeros(solution.t.size)
    free_loads(context, solution.t, solution.q, wanted, sides, np.zeros(16 * len(graph.row)), out)
    return out < NO_STRESS
