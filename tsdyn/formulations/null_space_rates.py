"""The null-space form of a scene with rows on velocities: v for positions, w for velocities (Haug 2018, Eqs. 17-29).

With K = [Phi_q; A] and beta = [Phi_t; b] of the rows Phi = 0 and A qd + b = 0:

    q   = q0 + V v - U u,    u from Phi(q) = 0                           Eqs. 19-22
    qd  = D_K w - U_K B_K beta,    vd = V^T P0 qd                        Eqs. 18, 27
    D_K^T M D_K wd = D_K^T (M U_K B_K gamma_K + Q_A + Q_v)               Eq. 17

U, V, B, D are those of Phi_q, and with the index K those of K: V spans the n - m directions that Phi leaves free, V_K
the n - m - r that r rows on velocities leave of them. For r = 0 these are Eqs. 23-26, for m = 0 Maggi's equations.

Implicit methods need the derivatives of (vd, wd). With dq = D dv, G1 = (K qd + beta)_q and G2 = (K qdd + gamma_K)_q,

    dqd = D_K dw - Y D dv,                          Y = U_K B_K G1,   so dvd = L^T dqd
    D_K^T M D_K dwd = C_hat dw - K_hat dv,          C_hat = D_K^T C* D_K,   K_hat = D_K^T K* D
    C* = Q_A,qd + Q_v,qd + M U_K B_K gamma_K,qd     K* as in linearisation.py

gamma_K,qd is 2 G1 in rows of positions. In rows on velocities gamma_K is quadratic in qd, too: differences are exact.
"""

import math
from typing import NamedTuple

import numpy as np

from ..jit.kernels import callback, kernel, loader, vector
from ..maths.dense_linalg import (
    add_transposed_product,
    clear_matrix,
    copy,
    largest,
    lu,
    lu_solve,
    multiply,
    transposed_times,
)
from ..methods.explicit import ACCELERATE, NORM, NORMAL, PLACE
from ..model.equations import set_time
from ..model.packed import System
from ..rows.constraint_graph import ConstraintGraph
from ..rows.interface import TangentWorkspace, redundant_rows_hold
from ..workspaces import ChartWorkspace, ImplicitWorkspace, SaddleWorkspace, Work, allocate, carve, plain_context
from .accelerations import SOLVE_FRICTION
from .linearisation import (
    Displacements,
    add_mass_times,
    curvatures,
    in_body_frames,
    keep_in_body_frames,
    mass_matrix,
    project_derivatives,
    times_mass,
)
from .null_space import (
    UNHELD,
    add_friction,
    check,
    find_accelerations,
    frictional_acceleration,
    project,
    put_normal,
    reduced_mass,
    refine_velocities,
    set_positions,
    velocities,
    weighted_square,
)
from .null_space_chart import (
    OK,
    SINGULAR,
    evaluate_dense_bias,
    evaluate_dense_rows,
    form_normal_matrix,
    invert_normal_matrix,
    map_tangent,
    new_chart,
    set_bases,
)

__all__ = ["accelerate", "check", "complete", "error_norm", "place", "solve_friction", "start_chart"]
__all__ += ["factorise", "linearise", "recall", "reduce", "soften", "solve"]

# The workspace: that of positions where other forms have theirs, and behind it that of velocities.


class MixedLinear(NamedTuple):
    """What implicit methods need besides `ImplicitWorkspace`, whose k is that of w; of no size for explicit ones."""

    F: np.ndarray  # (l, nx)  D in body frames, l as of `ImplicitWorkspace`
    X: np.ndarray  # (n, nx)  scratch
    X2: np.ndarray  # (n, nx)  scratch
    K_hat: np.ndarray  # (k, nx)
    J_v: np.ndarray  # (nx, nx)  vd by v
    J_w: np.ndarray  # (nx, k)  vd by w
    P: np.ndarray  # (nx + k, nx + k)  LU factors of [I - g J_v, -g J_w; g K_hat, A - g C_hat]
    b: np.ndarray  # (nx + k,)  scratch
    pivots: np.ndarray  # int64 (nx + k,)  row exchanges of P


class MixedContext(NamedTuple):
    """A `Context`, whose `work` is that of positions, and what else the kernels below use."""

    system: System
    work: Work  # of Phi
    linear: ImplicitWorkspace
    graph: ConstraintGraph
    tangent: TangentWorkspace
    chart: ChartWorkspace
    saddle: SaddleWorkspace
    rates: Work  # of K; q, qd, qdd and records are those of `work`
    of_rates: np.ndarray  # int64 (m + r,)  1 for rows of K that are rows on velocities
    mixed: MixedLinear


def mixed_context(context, of_rates, redundant):
    """A `MixedContext`; redundant: how many rows of K are."""
    own, bodies = context.work, context.system.mass.size
    inertias = own.inertia_bias.size
    rates = allocate(own.q.size, own.u.size, bodies, 1.0, redundant=redundant, inertias=inertias)
    shared = {name: getattr(own, name) for name in ("q", "qd", "qdd", "control", "counters")}
    (n, k), nx, l = context.linear.X.shape, own.v.size * (context.linear.X.size > 0), len(context.linear.F)
    shapes = {"F": (l, nx), "X": (n, nx), "X2": (n, nx), "K_hat": (k, nx), "J_v": (nx, nx), "J_w": (nx, k)}
    shapes |= {"P": (nx + k, nx + k), "b": (nx + k,)}
    mixed = MixedLinear(**carve(shapes), pivots=np.zeros(nx + k, np.int64))
    return MixedContext(*context, rates._replace(**shared), of_rates.astype(np.int64), mixed)


load_mixed = loader(mixed_context(plain_context(), np.zeros(1, bool), 0))


@kernel
def _take_selection(c):
    """Drop rows on velocities from those of positions, beside the rows of K that are redundant."""
    own, rates, count = c.work.redundant, c.rates.redundant, 0
    for e in range(c.of_rates.size):
        if c.of_rates[e] == 1 and count + 1 < own.size:
            count += 1
            own[count] = e
    for i in range(rates[0]):
        if c.of_rates[rates[1 + i]] == 0 and count + 1 < own.size:
            count += 1
            own[count] = rates[1 + i]
    own[0] = count


@kernel
def _map_velocities(c, t):
    """D_K, B_K and the factor of D_K^T M D_K at q; B_K is made afresh, and depends on q alone. Status."""
    system, w = c.system, c.rates
    evaluate_dense_rows(system, w, t)
    form_normal_matrix(system, w)
    if not invert_normal_matrix(w):
        return SINGULAR
    status = map_tangent(system, w)
    return reduced_mass(system, w) if status == OK else status


@callback(PLACE)
def place(context, t, v):
    """Set positions from v: q, then D_K, B_K and the factor of D_K^T M D_K. Status."""
    c = load_mixed(context)
    status = set_positions(c, t, v)  # B and T are those with which the next solve starts
    return _map_velocities(c, t) if status == OK else status


@callback(NORMAL)
def normal(context, t, vd, out):
    """As of the null-space form."""
    c = load_mixed(context)
    put_normal(c, t, vector(vd, c.work.v.size), vector(out, 2 * c.work.u.size))
    return OK


@callback(ACCELERATE)
def accelerate(context, t, velocity, wd, vd):
    """Set velocities w at the current position: qd, wd and vd. Status."""
    c = load_mixed(context)
    system, w = c.system, c.rates
    velocities(system, w, t, vector(velocity, w.v.size))
    refine_velocities(system, w)
    transposed_times(c.work.L, w.qd, vector(vd, c.work.v.size))
    return frictional_acceleration(context, c, w, t, vector(wd, w.v.size))


@callback("pp")
def complete(context, wd):
    """Accelerations qdd after `accelerate`."""
    c = load_mixed(context)
    find_accelerations(c.system, c.rates, vector(wd, c.rates.v.size))
    return OK


@callback(SOLVE_FRICTION)
def solve_friction(context, t, wd):
    """Add joint friction to wd. Status."""
    c = load_mixed(context)
    return add_friction(c.graph, c.system, c.rates, c.tangent, t, vector(wd, c.rates.v.size))


@callback(NORM, "d")
def error_norm(context, ev, ew, old, rtol, atol):
    """Root mean square of the errors V ev of q and V_K ew of qd, over atol + rtol times the larger end of the step."""
    c = load_mixed(context)
    n, old = c.work.q.size, vector(old, 3 * c.work.q.size)
    total = weighted_square(c.work, c.work.q, 0, vector(ev, c.work.v.size), old, rtol, atol)
    total += weighted_square(c.rates, c.work.qd, n, vector(ew, c.rates.v.size), old, rtol, atol)
    return math.sqrt(total / (2 * n))


@callback("pdpppp")
def start_chart(context, t, v, velocity, wd, vd):
    """Make a chart at the present q: v = 0, vd = V^T P0 qd, and w, wd likewise by V_K. Status."""
    c = load_mixed(context)
    system, w, l = c.system, c.work, c.chart
    set_time(system, t)
    status = new_chart(c.graph, system, c.rates, c.tangent, l, t)
    _take_selection(c)
    if status == OK:
        status = set_bases(c.graph, system, w, l, t, True)
    v = vector(v, w.v.size)
    for j in range(v.size):
        v[j] = 0.0
    transposed_times(w.L, w.qd, vector(vd, v.size))
    project(c.rates, vector(velocity, c.rates.v.size), vector(wd, c.rates.v.size))
    return UNHELD if status == OK and not redundant_rows_hold(c.graph, c.tangent, w.control.floor) else status


# The linearisation for implicit methods.


@callback("pdp")
def linearise(context, t, wd):
    """Set K_body and C_body at the last accelerations wd. Status."""
    c = load_mixed(context)
    system, w, linear = c.system, c.rates, c.linear
    curvatures(system, w, linear, t, vector(wd, w.v.size))
    _bias_slopes(c, t)
    # C* += M U_K B_K (gamma_K,qd - 2 G1)
    multiply(linear.UB, linear.G2, linear.Q_q)
    add_mass_times(system, w, 1.0, linear.Q_q, linear.C)
    return keep_in_body_frames(system, w, linear)


@kernel
def _bias_slopes(c, t):
    """G2 <- gamma_K,qd - 2 G1 in rows on velocities, 0 in others."""
    system, w, linear = c.system, c.rates, c.linear
    step = 1.0 + largest(w.qd)
    clear_matrix(linear.G2)
    for j in range(w.qd.size):
        now = w.qd[j]
        for sign in (1.0, -1.0):
            w.qd[j] = now + sign * step
            evaluate_dense_bias(system, w, t)
            for e in range(c.of_rates.size):
                if c.of_rates[e] == 1:
                    linear.G2[e, j] += sign * (0.5 / step) * w.gamma[e] - linear.G1[e, j]
        w.qd[j] = now
    evaluate_dense_bias(system, w, t)


@callback("pd")
def reduce(context, t):
    """Set K_hat, C_hat, J_v and J_w at the current state."""
    c = load_mixed(context)
    w, linear, mixed, D, L = c.rates, c.linear, c.mixed, c.work.D, c.work.L
    in_body_frames(c.system, w.q, w.D, linear.F)
    in_body_frames(c.system, w.q, D, mixed.F)
    project_derivatives(c.system, w, linear, t, Displacements(D, mixed.F, mixed.X, mixed.X2, mixed.K_hat))
    # J_v = -L^T Y D,    J_w = L^T D_K
    clear_matrix(mixed.J_v)
    clear_matrix(mixed.J_w)
    multiply(linear.Y, D, mixed.X)
    add_transposed_product(-1.0, L, mixed.X, mixed.J_v)
    add_transposed_product(1.0, L, w.D, mixed.J_w)
    return OK


@callback("pd")
def factorise(context, g):
    """LU factors of [I - g J_v, -g J_w; g K_hat, A - g C_hat], A = D_K^T M D_K. Status."""
    c = load_mixed(context)
    w, C_hat, mixed, P = c.rates, c.linear.C_hat, c.mixed, c.mixed.P
    nx, k = mixed.J_w.shape
    mass_matrix(w, P[nx:, nx:])
    for i in range(k):
        for j in range(k):
            P[nx + i, nx + j] -= g * C_hat[i, j]
        for j in range(nx):
            P[nx + i, j] = g * mixed.K_hat[i, j]
    for i in range(nx):
        for j in range(k):
            P[i, nx + j] = -g * mixed.J_w[i, j]
        for j in range(nx):
            P[i, j] = (1.0 if i == j else 0.0) - g * mixed.J_v[i, j]
    w.counters.iteration_matrices += 1
    return OK if lu(P, mixed.pivots, nx + k) else SINGULAR


@kernel
def _solve(c, rho):
    """rho <- (I - g J)^-1 rho, J the Jacobian of (vd, wd)."""
    times_mass(c.rates, c.linear, rho[c.work.v.size :])
    lu_solve(c.mixed.P, c.mixed.pivots, rho, rho.size)


@callback("pp")
def solve(context, rho):
    """rho <- (I - g J)^-1 rho, rho = (vd, wd)."""
    c = load_mixed(context)
    _solve(c, vector(rho, c.mixed.b.size))
    return OK


@callback("ppdp")
def soften(context, ex, g, ey):
    """(ex, ey) <- (I - g J)^-1 (ex, ey), g being that of the factors; as linearisation.soften."""
    c = load_mixed(context)
    b, nx = c.mixed.b, c.work.v.size
    ex, ey = vector(ex, nx), vector(ey, b.size - nx)
    copy(ex, b)
    copy(ey, b[nx:])
    _solve(c, b)
    copy(b[:nx], ex)
    copy(b[nx:], ey)
    return OK


@callback("ppp")
def recall(context, vd, wd):
    """vd and wd in this chart at the point before."""
    c = load_mixed(context)
    before = c.linear.before
    transposed_times(c.work.L, before[1], vector(vd, c.work.v.size))
    transposed_times(c.rates.L, before[2], vector(wd, c.rates.v.size))
    return OK
