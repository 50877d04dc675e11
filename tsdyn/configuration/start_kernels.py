"""Kernels of initial conditions: residuals, projection, selection of independent rows, motion to a place near by.

Rows are compared in the metric of lengths, and projected in that of kinetic energy.
"""

import math
from typing import NamedTuple

import numpy as np

from ..elements.loops.constraint_rows import move_bodies, place_bodies, write_positions, write_velocities
from ..elements.tolerances import UNDIRECTED
from ..formulations.projection import UNHELD, factorise, find_drift, gather_speeds, land, land_velocities, move_by
from ..jit.kernels import callback, entry, integers, kernel, loader, vector
from ..maths.dense_linalg import copy, is_finite, largest
from ..maths.tolerances import HALF_DIGITS, LAST_PLACE
from ..model.equations import set_time
from ..model.packed import POINT_SIZE
from ..rows.interface import (
    DYNAMICS,
    METRIC,
    evaluate_rows,
    factorise_selected_rows,
    keep_every_row,
    multiply_rows,
    project,
    rates_hold_along,
    restore_selection,
    select_rows,
    singularity_indicator,
)
from ..workspaces import Parts, no_parts

# In place of a row that depends on others: there is none; rounding may hide one.
NONE, DOUBTFUL = -1, -2
HOLDS = -3  # there is none, and all rows hold
PLAIN, LANDED = 1, 2  # what `take_start` has done


class StartParts(NamedTuple):
    """What the kernels of a start find by one address: the same parts twice, but for the metric of their graphs."""

    own: Parts
    lengths: Parts  # length_metric.by_lengths
    unequal: np.ndarray  # int64 (1,): length_metric.are_unequal


load_start = loader(StartParts(no_parts(), no_parts(), np.zeros(1, np.int64)))


@entry("pvvdviwd")
def evaluate_start(context, q, qd, t, velocity, every, at, tol):
    """f.b = Phi, velocity = Phi_q qd + Phi_t, H of the graph's rows; the first row that depends on others.

    With every = 1 of every row, with 0 without the redundant ones. Where no row depends on others, NONE; DOUBTFUL, with
    every = 1, if a pivot is so small that the rounding errors it causes may hide a redundant row. HOLDS in place of
    NONE if Phi and its rate hold to tol (1 + max |q|) and tol (1 + max |qd|), and H is finite; at: where the Euler
    parameters of the rigid bodies begin.
    """
    c = load_start(context).lengths
    found = _evaluate(c, q, qd, t, velocity, every)
    if found == NONE and _hold(c.tangent.b, velocity, c.tangent.rows.H, q, qd, at, tol) == 1:
        return HOLDS
    return found


@kernel
def _evaluate(c, q, qd, t, velocity, every):
    graph, system, f = c.graph, c.system, c.tangent
    set_time(system, t)
    place_bodies(graph.bodies, q, f.poses)
    move_bodies(graph.bodies, q, qd, f.poses)
    count = keep_every_row(f) if every == 1 else -1
    evaluate_rows(graph, system, f, f.rows, t)
    gather_speeds(graph, f)
    find_drift(graph, system, f, t)
    multiply_rows(graph, f.rows, f.Z, velocity)
    for e in range(velocity.size):
        velocity[e] += f.gamma[e]
    failed = factorise_selected_rows(graph, f, f.rows, METRIC)
    if every == 1:
        restore_selection(f, count)
        if failed < 0 and singularity_indicator(graph, f.rows) < HALF_DIGITS:
            return DOUBTFUL
    return failed


@kernel
def _hold(b, velocity, H, q, qd, at, tol):
    """Return 1 if Phi, b, and its rate hold, and H is finite; else 0."""
    far, fast, size = 0.0, 0.0, 0.0
    for i in range(q.size):
        far, fast = max(far, abs(q[i])), max(fast, abs(qd[i]))
    near, slow = tol * (1.0 + far), tol * (1.0 + fast)
    for e in range(b.size):
        if not (abs(b[e]) <= near and abs(velocity[e]) <= slow):
            return 0
    for i in at:
        square, rate = -1.0, 0.0
        for j in range(i, i + 4):
            square += q[j] * q[j]
            rate += q[j] * qd[j]
        if not (abs(0.5 * square) <= near and abs(rate) <= slow):
            return 0
    for i in range(H.size):
        size += H[i]
    return 1 if size - size == 0.0 else 0


@entry("pd")
def land_start(context, t):
    """Project w.q and w.qd onto the constraint manifold. Status."""
    return _land(load_start(context).own, t)


@kernel
def _land(c, t):
    graph, system, w, f = c.graph, c.system, c.work, c.tangent
    set_time(system, t)
    place_bodies(graph.bodies, w.q, f.poses)
    move_bodies(graph.bodies, w.q, w.qd, f.poses)
    status = land(graph, system, w, f, t)
    if status != 0:
        return status
    write_positions(graph.bodies, f.poses, w.q)
    find_drift(graph, system, f, t)
    land_velocities(graph, f, True)
    write_velocities(graph.bodies, f.poses, w.qd)
    return 0


@entry("pdd")
def select_redundant(context, t, share):
    """Select redundant rows at the poses, those with pivots below a share; return their number, or -1."""
    c = load_start(context).lengths
    graph, f = c.graph, c.tangent
    count = select_rows(graph, c.system, f, t, share)
    return count if factorise_selected_rows(graph, f, f.rows, METRIC) < 0 else -1


@entry("pvd")
def failing_row(context, q, t):
    """Return the row at which S = H W H^T of the kept rows turns out singular at q, or -1.

    That of a massless axis: rotation about it is free. Any other, if rows are independent: masses are too unequal.
    """
    return _failing_row(load_start(context).own, q, t)


@kernel
def _failing_row(c, q, t):
    graph, f = c.graph, c.tangent
    set_time(c.system, t)
    place_bodies(graph.bodies, q, f.poses)
    evaluate_rows(graph, c.system, f, f.rows, t)
    failed = factorise_selected_rows(graph, f, f.rows, DYNAMICS)
    return failed if failed >= 0 else factorise_selected_rows(graph, f, f.rows, METRIC)


@callback("pppppidd")
def take_start(context, q, qd, velocity, at, count, t, tol):  # eight: addresses
    """Make q and qd consistent, in place, as `initial_conditions.consistent` does where all rows are independent.

    The workspace is as `StartWorkspace.enter` leaves it. Return PLAIN if q and qd were at rounding, LANDED if they have
    been projected, and 0 if the start needs further checks.
    """
    parts = load_start(context)
    c = parts.own
    w, f, n = c.work, c.tangent, c.work.q.size
    x, xd, at = vector(q, n), vector(qd, n), integers(at, count)
    rates = vector(velocity, c.graph.row.shape[0])
    _set_floor(w.control, x, at)
    if _evaluate(parts.lengths, x, xd, t, rates, 1) != NONE:
        return 0
    if (c.graph.axes.rows.shape[0] > 0 or parts.unequal[0] != 0) and _failing_row(c, x, t) >= 0:
        return 0
    if _hold(f.b, rates, f.rows.H, x, xd, at, min(LAST_PLACE, tol)) == 1:
        return PLAIN
    far, fast = _residuals(c, rates, x, xd, at)
    whole, rate = 1.0 + largest(x), 1.0 + largest(xd)
    if not (far <= tol * whole and fast <= tol * rate and is_finite(f.rows.H)):
        return 0
    if far > LAST_PLACE * whole:
        for i in at:
            length = math.sqrt(x[i] * x[i] + x[i + 1] * x[i + 1] + x[i + 2] * x[i + 2] + x[i + 3] * x[i + 3])
            for j in range(i, i + 4):
                x[j] /= length
    elif fast <= LAST_PLACE * rate:
        return PLAIN
    copy(x, w.q)
    copy(xd, w.qd)
    if _land(c, t) != 0:
        return 0
    copy(w.q, x)
    copy(w.qd, xd)
    return LANDED


@kernel
def _set_floor(control, q, at):
    """As `StartWorkspace.enter` sets it."""
    far, scale = largest(q), 1.0
    if 0.0 < control.size < POINT_SIZE:
        far, scale, last = 0.0, control.size, 0
        for i in range(q.size):
            turns = last < at.size and i >= at[last]
            far = max(far, abs(q[i]) * scale if turns else abs(q[i]))
            if turns and i == at[last] + 3:
                last += 1
    control.floor = LAST_PLACE * (control.size + far)


@kernel
def _residuals(c, rates, q, qd, at):
    """The largest residual of positions and of velocities; inf if one is not finite."""
    far, fast, row, b = 0.0, 0.0, c.graph.row, c.tangent.b
    for e in range(row.shape[0]):
        if row[e] >= 0:
            if not (abs(b[e]) < math.inf and abs(rates[e]) < math.inf):
                return math.inf, math.inf
            far, fast = max(far, abs(b[e])), max(fast, abs(rates[e]))
    for i in at:
        square, rate = 0.0, 0.0
        for j in range(i, i + 4):
            square += q[j] * q[j]
            rate += q[j] * qd[j]
        far, fast = max(far, abs(0.5 * (square - 1.0))), max(fast, abs(rate))
    return far, fast


@entry("pdvd")
def go_near_by(context, t, way, far):
    """Move along the manifold, at most by `far` (rad, or share of the scene's size), and project. Status.

    way (bodies, 8) is any direction; its tangent part is taken.
    """
    c = load_start(context).lengths
    graph, f = c.graph, c.tangent
    status = factorise(graph, c.system, c.work, f, t)
    if status != 0:
        return status
    for i in range(f.Z.size):
        f.Z[i] = way[i]
    wanted = _farthest(c)
    for _ in range(2):
        project(graph, f.rows, f.Z, f.b)
    # Without freedom what is left of the way is rounding, and says nothing
    found = _farthest(c)
    free = found > UNDIRECTED * wanted
    if free and not rates_hold_along(graph, f, f.Z):
        return UNHELD
    scale = far / found if free else 0.0
    for i in range(f.Z.size):
        f.Z[i] *= scale
    move_by(graph, f, True)
    return land(graph, c.system, c.work, f, t)


@kernel
def _farthest(c):
    """Return the largest entry of Z: rotations, and displacements as shares of the scene's size."""
    Z, part, found = c.tangent.Z, 1.0 / max(c.work.control.size, POINT_SIZE), 0.0
    for b in range(c.graph.bodies.shape[0]):
        for i in range(3):
            found = max(found, max(abs(Z[8 * b + i]) * part, abs(Z[8 * b + 4 + i])))
    return found
