"""The null-space form of a scene with rows on velocities: v for positions, w for velocities (Haug 2018, Eqs. 17-29).

With K = [Phi_q; A] and beta = [Phi_t; b] of the rows Phi = 0 and A qd + b = 0:

    q   = q0 + V v - U u,    u from Phi(q) = 0                           Eqs. 19-22
    qd  = D_K w - U_K B_K beta,    vd = V^T P0 qd                        Eqs. 18, 27
    D_K^T M D_K wd = D_K^T (M U_K B_K gamma_K + Q_A + Q_v)               Eq. 17

U, V, B, D are those of Phi_q, and with the index K those of K: V spans the n - m directions that Phi leaves free, V_K
the n - m - r that r rows on velocities leave of them. For r = 0 these are Eqs. 23-26, for m = 0 Maggi's equations.
"""

import math
from typing import NamedTuple

import numpy as np

from ..jit.kernels import callback, kernel, loader, vector
from ..maths.dense_linalg import transposed_times
from ..methods.explicit import ACCELERATE, NORM, NORMAL, PLACE
from ..model.equations import set_time
from ..model.packed import System
from ..rows.constraint_graph import ConstraintGraph
from ..rows.interface import TangentWorkspace, redundant_rows_hold
from ..workspaces import ChartWorkspace, ImplicitWorkspace, SaddleWorkspace, Work, allocate, plain_context
from .accelerations import SOLVE_FRICTION
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
    evaluate_dense_rows,
    form_normal_matrix,
    invert_normal_matrix,
    map_tangent,
    new_chart,
    set_bases,
)

__all__ = ["accelerate", "check", "complete", "error_norm", "place", "solve_friction", "start_chart"]

# The workspace: that of positions where other forms have theirs, and behind it that of velocities.


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


def mixed_context(context, of_rates, redundant):
    """A `MixedContext`; redundant: how many rows of K are."""
    own, bodies = context.work, context.system.mass.size
    inertias = own.inertia_bias.size
    rates = allocate(own.q.size, own.u.size, bodies, 1.0, redundant=redundant, inertias=inertias)
    shared = {name: getattr(own, name) for name in ("q", "qd", "qdd", "control", "counters")}
    return MixedContext(*context, rates._replace(**shared), of_rates.astype(np.int64))


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
