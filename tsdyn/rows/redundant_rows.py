"""Redundant rows: a row that holds wherever the rows hold that it depends on.

It is dropped: its row of H and its right-hand sides are zero and its diagonal entry of S and N is one, so its
multiplier is zero and every sparsity pattern is unchanged.
"""

from ..jit.kernels import kernel
from ..jit.simd import put, splat
from .tolerances import HELD


@kernel
def clear_redundant(f, b):
    """Zero the right-hand sides of redundant rows."""
    for i in range(f.dropped[0]):
        b[f.dropped[1 + i]] = 0.0


@kernel
def clear_redundant_rows(f, Phi, H):
    """Zero the redundant rows of Phi and H."""
    for i in range(f.dropped[0]):
        at = 16 * f.dropped[1 + i]
        for c in range(0, 16, 4):
            put(H, at + c, splat(0.0))
    clear_redundant(f, Phi)


@kernel
def leave_redundant_rows(f, Phi, H):
    """Zero the redundant rows of Phi and H, after recording the largest |Phi| of these."""
    worst = 0.0
    for i in range(f.dropped[0]):
        size = abs(Phi[f.dropped[1 + i]])
        if not size <= worst:
            worst = size
    f.selection.unheld = worst
    clear_redundant_rows(f, Phi, H)


@kernel
def set_redundant_diagonal(graph, f, values):
    """Set ones on the diagonal of S, or of one of the parts of N, at redundant rows."""
    for i in range(f.dropped[0]):
        values[graph.diagonal[f.dropped[1 + i]]] = 1.0


@kernel
def keep_every_row(f):
    """Drop no row for now; returns what `restore_selection` takes."""
    count = f.dropped[0]
    f.dropped[0] = 0
    return count


@kernel
def restore_selection(f, count):
    """Drop the redundant rows again, after `keep_every_row`."""
    f.dropped[0] = count


@kernel
def save_selection(f):
    """Save the selection of redundant rows before a passing one."""
    for i in range(f.dropped[0] + 1):
        f.saved[i] = f.dropped[i]


@kernel
def return_to_selection(f):
    """Return to the saved selection of redundant rows."""
    for i in range(f.saved[0] + 1):
        f.dropped[i] = f.saved[i]


@kernel
def redundant_rows_hold(f, floor):
    """Return True if the redundant rows hold on the manifold, by the residuals of the last evaluation."""
    return f.dropped[0] == 0 or f.selection.unheld <= HELD * floor


@kernel
def list_redundant(graph, f, out):
    """out[0] = number of redundant rows, then their places among the rows of Phi."""
    out[0] = f.dropped[0]
    for i in range(f.dropped[0]):
        out[1 + i] = graph.row[f.dropped[1 + i]]


@kernel
def mark_redundant(graph, f, value, out):
    """out[i] = value for the redundant rows i of Phi."""
    for i in range(f.dropped[0]):
        out[graph.row[f.dropped[1 + i]]] = value
