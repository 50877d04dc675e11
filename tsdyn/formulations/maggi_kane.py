"""The Maggi/Kane equations, the baseline that drifts: a first-order system in (w, q) (Haug 2018, Eqs. 17-18).

    D^T M D wd = D^T (M U B gamma + Q_A + Q_v),   qd = D w - U B Phi_t

q is integrated directly, without projection onto Phi(q) = 0. D, B, V and U are those of the null-space form.
"""

import math

from ..jit.kernels import callback, vector
from ..maths.dense_linalg import copy
from ..methods.explicit import ACCELERATE, NORM, PLACE
from ..model.equations import set_time
from ..workspaces import load
from .null_space import (
    check_validity,
    complete,
    frictional_acceleration,
    project,
    reduced_mass,
    solve_friction,
    velocities,
    weighted_square,
)
from .null_space_chart import NOT_FINITE, OK, new_chart, tangent_map

__all__ = ["accelerate", "check", "complete", "error_norm", "place", "solve_friction", "start_chart"]


@callback(PLACE)
def place(context, t, x):
    """Set positions x = q without projection: Phi_q, B, D and the factor of D^T M D. Status."""
    c = load(context)
    system, w = c.system, c.work
    w.counters.placements += 1
    c.chart.state.time = t
    if not set_time(system, t):
        return NOT_FINITE
    copy(vector(x, w.q.size), w.q)
    # B and D of Eqs. 7 and 9 at a q that need not satisfy Eq. 1
    status = tangent_map(system, w, t)
    return reduced_mass(system, w) if status == OK else status


@callback(ACCELERATE)
def accelerate(context, t, velocity, wd, xd):
    """Set kinematic velocities w at the current position: wd, and xd = qd. Status."""
    c = load(context)
    system, w = c.system, c.work
    velocities(system, w, t, vector(velocity, w.v.size))
    status = frictional_acceleration(context, c, w, t, vector(wd, w.v.size))
    copy(w.qd, vector(xd, w.q.size))
    return status


@callback("p")
def check(context):
    """Reason to choose a new V, or zero."""
    return check_validity(load(context))


@callback(NORM, "d")
def error_norm(context, eq, ew, old, rtol, atol):
    """Root mean square of the errors eq of q and V ew of qd, over atol + rtol times the larger end of the step."""
    w = load(context).work
    n, k = w.q.size, w.v.size
    eq, old = vector(eq, n), vector(old, 3 * n)
    # w is an error of velocities, qd = D w; V w at the base point
    total = weighted_square(w, w.qd, n, vector(ew, k), old, rtol, atol)
    for i in range(n):
        x = eq[i] / (atol + rtol * max(abs(w.q[i]), abs(old[i])))
        total += x * x
    return math.sqrt(total / (2 * n))


@callback("pdpppp")
def start_chart(context, t, x, velocity, wd, xd):
    """Make new bases U and V at the present x = q, xd = qd; w = V^T P0 qd, wd = V^T P0 qdd. Status."""
    c = load(context)
    system, w = c.system, c.work
    set_time(system, t)
    status = new_chart(c.graph, system, w, c.tangent, c.chart, t)
    copy(w.q, vector(x, w.q.size))
    copy(w.qd, vector(xd, w.q.size))
    project(w, vector(velocity, w.v.size), vector(wd, w.v.size))
    return status
