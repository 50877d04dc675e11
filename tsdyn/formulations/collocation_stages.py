"""The tangent form for collocation methods: Newton's method for all stages of a step at once."""

import math

from ..errors import Status
from ..jit.kernels import ANY, callback, complex_vector, data_of, kernel, vector
from ..jit.simd import add, four, lanes, put
from ..maths.dense_linalg import copy
from ..methods.collocation import parts_of
from ..rows.interface import clear_rates, factorise_complex_saddle, factorise_saddle, solve_complex_saddle, solve_saddle
from ..workspaces import load
from . import tolerances as limits
from .charts import factorise_normal, turn_accelerations
from .implicit_tangent import add_to, find_imbalance, find_normal_part, spread_normal
from .saddle_point import add_blocks, turned_back, write_rows
from .tangent import weighted_square

# Newton's method for all stages of a collocation method at once, in the tangent form.
#
# The equations of each stage are those of implicit_tangent.py. A correction e_i of the accelerations of stage i changes
# the velocities of all stages j by h a_ji e_i, and their positions by h^2 (A^2)_ji e_i. With one K and C for all of
# them the eigenvectors of A uncouple the stages (methods/collocation.py): for each eigenvalue there is one matrix
#
#     [ M - g C_b - g^2 K_b    H^T ]
#     [ H                      0   ],        g = h times the eigenvalue, real for one of them, complex for the others
#
# Of each stage, u, z and lam are kept in `SaddleWorkspace.stages`. In the memory of a step the accelerations k_i of
# stage i = 0, 1, ... are at (2 i + 5) n, as those of any Runge-Kutta method with an explicit first stage.

OK, SINGULAR = int(Status.SUCCESS), int(Status.SINGULAR)
KERNELS = "take_stage", "balance_stage", "factorise_stages", "solve_stages"


@callback("pi")
def take_stage(context, i):
    """Go on with u, z and lam of stage i."""
    c = load(context)
    s, m = c.saddle, c.saddle.z.size
    copy(s.stages[i, :m], c.work.u)
    copy(s.stages[i, m : 2 * m], s.z)
    copy(s.stages[i, 2 * m :], s.multipliers)
    return OK


@callback("pip")
def balance_stage(context, i, k):
    """After `residual` at stage i, its accelerations being k: the right-hand side of Newton's equations. Status."""
    c = load(context)
    f, l, s, graph, m = c.tangent, c.chart, c.saddle, c.graph, c.saddle.z.size
    # a = (rdd, omega'd) of k, its normal part n = -Y0 N^-1 (H a + gamma)
    turn_accelerations(graph, l, f.poses, vector(k, l.x.size - 8), s.a)
    find_normal_part(c)
    copy(f.b, s.normal[i])
    # F - M (a + C n) - H^T lam
    if not find_imbalance(c, limits.REACTIONS_LEFT_COUPLED):
        return SINGULAR
    copy(s.x, s.right[i])
    # What the correction of this stage needs once all stages are solved
    copy(l.d, s.turns[i])
    copy(c.work.u, s.stages[i, :m])
    copy(s.z, s.stages[i, m : 2 * m])
    copy(s.multipliers, s.stages[i, 2 * m :])
    return OK


@callback("pdpi")
def factorise_stages(context, h, tableau, i):
    """Factors of the matrix of pair i of eigenvalues at the present H, K and C, then of the real one. Status.

    Called for i = 0, 1, ...: between the calls Ctrl-C is answered.
    """
    c, tableau = load(context), vector(tableau, ANY)
    f, s, graph, shifts = c.tangent, c.saddle, c.graph, tableau[parts_of(tableau).shifts :]
    # M, H and H^T are common to all eigenvalues
    if i == 0:
        c.work.counters.iteration_matrices += 1
        write_rows(c)
        add_blocks(graph, s, s.upper, s.lower, 0.0, True)
    # The real eigenvalue comes last, since its factors take the place of the common part
    if i == s.complex_upper.shape[0]:
        add_blocks(graph, s, s.upper, s.lower, h * shifts[0], False)
        if f.b.size > 0 and not factorise_normal(graph, c.work, f, c.chart):
            return SINGULAR
        return OK if factorise_saddle(s) else SINGULAR
    # A complex eigenvalue: the common part, then - g C_b - g^2 K_b
    size = s.graph.pattern.shape[1]
    lower, upper = complex_vector(data_of(s.complex_lower[i]), size), complex_vector(data_of(s.complex_upper[i]), size)
    for e in range(size):
        lower[e], upper[e] = s.lower[e], s.upper[e]
    add_blocks(graph, s, upper, lower, complex(h * shifts[1 + 2 * i], h * shifts[2 + 2 * i]), False)
    return OK if factorise_complex_saddle(s, i) else SINGULAR


@callback("pdpp", "d")
def solve_stages(context, h, tableau, memory):
    """Correct k, u, z and lam of all stages; the size of the change in the error norm, of all stages.

    s.e is then the change of the last stage's positions.
    """
    c, tableau, memory = load(context), vector(tableau, ANY), vector(memory, ANY)
    p = parts_of(tableau)
    s, n, m, stages = c.saddle, c.chart.x.size - 8, c.saddle.z.size, c.saddle.stages.shape[0]
    # [e_i, dlam_i] of all stages
    _solve(s, tableau, p)
    for i in range(stages):
        # k_i += e_i + n_i
        k = memory[(2 * i + 5) * n :][:n]
        _take_correction(c, i, k)
        spread_normal(c, s.normal[i])
        for j in range(n):
            k[j] += s.r[j]
        if c.graph.rates.size > 0:  # which don't take off what n_i moves along them: it counts
            add_to(s.r, s.changes[i])
        for j in range(stages):  # what the normal parts of accelerations have moved is taken off again
            a = h * tableau[p.a + stages * i + j]
            for e in range(m):
                s.stages[i, m + e] -= a * s.normal[j, e]
    # Of positions what rows on positions forbid
    for j in range(stages):
        clear_rates(c.graph, s.normal[j])
        for i in range(stages):
            square = h * h * tableau[p.square + stages * i + j]
            for e in range(m):
                s.stages[i, e] -= square * s.normal[j, e]
    return _size(c, h, tableau, p)


@kernel
def _combine(weights, rows, out):
    """out = sum_i weights_i rows_i."""
    for e in range(out.size):
        out[e] = 0.0
    for i in range(rows.shape[0]):
        for e in range(out.size):
            out[e] += weights[i] * rows[i, e]


@kernel
def _solve(s, tableau, p):
    """s.right <- the solutions of Newton's equations for the right-hand sides s.right."""
    stages = s.right.shape[0]
    # Coefficients of the real eigenvector
    _combine(tableau[p.there :], s.right, s.x)
    solve_saddle(s)
    copy(s.x, s.solved[0])
    for pair in range(s.complex_upper.shape[0]):
        # Those of one eigenvector of each conjugate pair
        x, row = complex_vector(data_of(s.complex_x), s.x.size), 1 + 2 * pair
        real, imaginary = s.solved[row], s.solved[row + 1]
        _combine(tableau[p.there + stages * row :], s.right, real)
        _combine(tableau[p.there + stages * (row + 1) :], s.right, imaginary)
        for e in range(x.size):
            x[e] = complex(real[e], imaginary[e])
        solve_complex_saddle(s, pair)
        for e in range(x.size):
            real[e], imaginary[e] = x[e].real, x[e].imag
    # Back to the stages
    for i in range(stages):
        _combine(tableau[p.back + stages * i :], s.solved, s.right[i])


@kernel
def _take_correction(c, i, k):
    """Add the correction s.right[i] to k and lam of stage i; s.changes[i] is that of k."""
    s, graph, l, m = c.saddle, c.graph, c.chart, c.saddle.z.size
    copy(s.right[i], s.x)
    copy(s.turns[i], l.d)
    # lam_i += dlam_i
    for e in range(m):
        if s.graph.row_at[e] >= 0:
            s.stages[i, 2 * m + e] += s.x[s.graph.row_at[e]]
    # k_i += (rhodd, C^-1 times the rotation)
    for b in range(graph.bodies.shape[0]):
        at, o = s.graph.body_at[b], 8 * b
        put(s.changes[i], o, lanes(s.x[at], s.x[at + 1], s.x[at + 2]))
        put(k, o, add(four(k, o), four(s.changes[i], o)))
        if graph.bodies[b, 1] == 7:
            put(s.changes[i], o + 4, turned_back(l, b, s, at + 3))
            put(k, o + 4, add(four(k, o + 4), four(s.changes[i], o + 4)))


@kernel
def _size(c, h, tableau, p):
    """The error norm of what s.changes changes of positions and velocities, root mean square of the stages."""
    w, s, graph, l, numbers, total = c.work, c.saddle, c.graph, c.chart, c.linear.numbers, 0.0
    stages, now = s.stages.shape[0], c.linear.now
    # Stage i moves by h^2 sum_j (A^2)_ij e_j, its velocities change by h sum_j a_ij e_j
    for i in range(stages):
        _combine(tableau[p.square + stages * i :], s.changes, s.e)
        _combine(tableau[p.a + stages * i :], s.changes, s.r)
        for e in range(s.e.size):
            s.e[e] *= h * h
            s.r[e] *= h
        total += weighted_square(graph, l, s.e, w.q, now[0], 0, numbers.rtol, numbers.atol)
        total += weighted_square(graph, l, s.r, w.qd, now[1], 0, numbers.rtol, numbers.atol)
    return math.sqrt(total / (2 * w.q.size * stages))
