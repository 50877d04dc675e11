"""Self-stresses: multipliers z with H^T z = 0, one for each redundant row.

z = 1 for the redundant row h, and -(H W H^T)^-1 H W h^T for the kept rows H.
"""

from ..jit.kernels import kernel
from .schur_complement import multiply_rows, solve_rows, weigh


@kernel
def count_self_stresses(f):
    """Return the number of self-stresses."""
    return f.dropped[0]


@kernel
def self_stress(graph, f, H, i):
    """b = z of redundant row i, H being of every row; return the largest |z|. f.rows are factorised."""
    row = f.dropped[1 + i]
    for c in range(f.Z.size):
        f.Z[c] = 0.0
    # W h^T of the dropped row h
    for side in range(2):
        body = graph.sides[row, side]
        if body < graph.bodies.shape[0]:
            weigh(graph.inverse, body, H, 16 * row + 8 * side, f.Z, 8 * body)
    # z = -S^-1 H W h^T for the kept rows
    multiply_rows(graph, f.rows, f.Z, f.b)
    solve_rows(graph, f.rows, f.b)
    largest = 1.0
    for e in range(f.b.size):
        f.b[e] = -f.b[e]
        largest = max(largest, abs(f.b[e]))
    f.b[row] = 1.0
    return largest
