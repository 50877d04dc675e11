"""The rows of the saddle-point matrix of implicit methods, its factors and solves (sparse/saddle_graph.py).

s is a `SaddleWorkspace`; the blocks of bodies are added by the caller.
"""

from ..jit.kernels import complex_vector, data_of, kernel, stack
from ..jit.simd import let
from ..sparse.elimination import factor_lu, solve_lu
from .schur_complement import more
from .tolerances import SADDLE_PIVOT


@kernel
def write_saddle_rows(graph, f, s):
    """Set the matrix to H and H^T at the present H, axis rows, and ones on the diagonal of redundant rows."""
    # Zeros for fill
    for i in range(s.graph.pattern.shape[1]):
        let(s.upper, i, 0.0)
        let(s.lower, i, 0.0)
    _write_rows(graph, f, s)
    _write_axes(s)


@kernel
def _write_rows(graph, f, s):
    """H and H^T in the places of the factors; one on the diagonal of redundant rows."""
    H = f.rows.H
    for e in range(graph.sides.shape[0]):
        for k in range(2):
            # H of one side of the row; step is 1 along a row of the block and its width along a column
            base, step = s.graph.sides[e, k, 0], s.graph.sides[e, k, 1]
            if base >= 0:
                for c in range(6 if graph.bodies[graph.sides[e, k], 1] == 7 else 3):
                    x = H[16 * e + 8 * k + c + c // 3]
                    let(s.upper, base + step * c, x)
                    let(s.lower, base + step * c, x)
    # A dropped row has a zero multiplier
    for i in range(f.dropped[0]):
        at = s.graph.diagonal[f.dropped[1 + i]]
        s.upper[at] = s.lower[at] = 1.0


@kernel
def _write_axes(s):
    """Axis rows, and the inertia that they take back."""
    axis = stack(3)
    for i in range(s.graph.axes.shape[0]):
        one = s.graph.axes[i]
        # c e beside the block of the body, and - c^2 e e^T of the raised inertia taken back: J' + c^2 e e^T
        axis[0], axis[1], axis[2] = one.x, one.y, one.z
        for r in range(3):
            let(s.upper, one.first + one.step * r, axis[r])
            let(s.lower, one.first + one.step * r, axis[r])
            for c in range(3):
                more(s.upper, one.target + one.stride * r + c, axis[r] * axis[c])
                more(s.lower, one.target + one.stride * r + c, axis[r] * axis[c])
        let(s.upper, one.own, 1.0)
        let(s.lower, one.own, 1.0)


@kernel
def factorise_saddle(s):
    """Factorise the saddle-point matrix; return True if it is nonsingular."""
    return factor_lu(s.graph.pattern, s.lower, s.upper, SADDLE_PIVOT) < 0


@kernel
def solve_saddle(s):
    """s.x <- the solution for the right-hand side s.x."""
    solve_lu(s.graph.pattern, s.lower, s.upper, s.x)


@kernel
def factorise_complex_saddle(s, pair):
    """Factorise the matrix of a pair of eigenvalues; return True if it is nonsingular."""
    size = s.graph.pattern.shape[2]
    lower = complex_vector(data_of(s.complex_lower[pair]), size)
    upper = complex_vector(data_of(s.complex_upper[pair]), size)
    return factor_lu(s.graph.pattern, lower, upper, SADDLE_PIVOT) < 0


@kernel
def solve_complex_saddle(s, pair):
    """s.complex_x <- the solution for the right-hand side s.complex_x, real and imaginary parts in turn."""
    size, x = s.graph.pattern.shape[2], complex_vector(data_of(s.complex_x), s.x.size)
    lower = complex_vector(data_of(s.complex_lower[pair]), size)
    upper = complex_vector(data_of(s.complex_upper[pair]), size)
    solve_lu(s.graph.pattern, lower, upper, x)
