"""Whether redundant rows hold: their residuals at three levels, relative to the sizes of their terms.

    position        |Phi|               |H_r| |r| + |H_pi'|
    velocity        |H y + Phi_t|       sum_i |H_i y_i| + |Phi_t|
    acceleration    |H yd + gamma|      sum_i |H_i yd_i| + |H_pi'| |2 p.pdd| + |gamma|

2 p.pdd is the centripetal part of 2 pdd, which cancels in gamma.

A row that depends on others wherever these hold is satisfied by them. If it depends on them at some configurations
only, or nearly, the motion violates it, however well the other rows hold.
"""

import math

from ..elements.loops.body_poses import POSE, R
from ..jit.kernels import kernel
from ..jit.predicates import most
from .redundant_rows import length, square
from .singularity import is_near_singular
from .tolerances import FAINT, HELD, NO_RATE, RESTING


@kernel
def has_redundant_rows(f):
    """Return True if rows are dropped."""
    return f.dropped[0] > 0


@kernel
def redundant_rows_hold(graph, f, floor):
    """Return True if the redundant rows hold on the manifold, by the residuals of the last evaluation."""
    return f.dropped[0] == 0 or f.selection.excess <= floor + HELD * FAINT * _extent(graph, f)


@kernel
def rates_hold(graph, f, q, qd, size):
    """Return True if they hold for velocities, by H and Phi_t of the last evaluation; size that of the scene, m."""
    if f.dropped[0] == 0 or f.redundant.H.size == 0:
        return True
    # Velocities of a scene at rest are compared with those of a fall through its extent
    speed, spin = _largest(graph, qd)
    far = _reach(graph, f, size)
    speed = max(speed, RESTING * math.sqrt(f.selection.push * far) + NO_RATE * far)
    return _hold(graph, f, f.redundant.drift, q, qd, speed + far * spin, spin + speed / far)


@kernel
def accelerations_hold(graph, f, q, qd, qdd, size):
    """Return True if they hold for accelerations, as `rates_hold`, by gamma of the last evaluation.

    Near a singular configuration accelerations have too few digits to judge the redundant rows.
    """
    if f.dropped[0] == 0 or f.redundant.H.size == 0 or is_near_singular(f, f.indicator.start):
        return True
    # Terms: accelerations of bodies, of free fall, and centripetal ones
    push, twist = _largest(graph, qdd)
    speed, spin = _largest(graph, qd)
    far = _reach(graph, f, size)
    push = max(push, f.selection.push) + spin * (speed + far * spin) + NO_RATE * far
    twist = max(twist, f.selection.twist) + spin * spin
    return _hold(graph, f, f.redundant.gamma, q, qdd, push + far * twist, twist + push / far)


@kernel
def note_loads(f):
    """Record the largest |W F| of a body, in Z; only redundant rows are judged by it."""
    if f.dropped[0] == 0:
        return
    push = twist = 0.0  # squares
    for i in range(0, f.Z.size, 8):
        push, twist = max(push, square(f.Z, i)), max(twist, square(f.Z, i + 4))
    f.selection.push, f.selection.twist = math.sqrt(most(push)), math.sqrt(most(twist))


@kernel
def _extent(graph, f):
    """The largest distance of a body from the first one, m."""
    most = 0.0
    for b in range(1, graph.bodies.shape[0]):
        at, distance = b * POSE + R, 0.0
        for c in range(3):
            distance += (f.poses[at + c] - f.poses[R + c]) ** 2
        most = max(most, distance)
    return math.sqrt(most)


@kernel
def _reach(graph, f, size):
    """The same, or else the size of the numbers in the constraints, or one: what rates are made comparable by."""
    far = _extent(graph, f)
    if far > 0.0:
        return far
    return size if size > 0.0 else 1.0


@kernel
def _largest(graph, rates):
    """The largest |rd| and |omega'| of a body, or |rdd| and 2 |pdd|."""
    speed = spin = 0.0  # squares
    for b in range(graph.bodies.shape[0]):
        i = graph.bodies[b, 0]
        speed = max(speed, square(rates, i))
        if graph.bodies[b, 1] == 7:
            spin = max(spin, rates[i + 3] ** 2 + square(rates, i + 4))
    return math.sqrt(speed), 2.0 * math.sqrt(spin)


@kernel
def _terms(H, at, x, y, z):
    """Sum of the absolute terms of a row of H times a vector."""
    return abs(H[at] * x) + abs(H[at + 1] * y) + abs(H[at + 2] * z)


@kernel
def _hold(graph, f, known, q, rates, most, fastest):
    """Return True if H (rd, omega') + known of all redundant rows is small; `rates` are qd, or qdd.

    A body whose rates are below FAINT of the largest, `most` and `fastest`, counts as one with these.
    """
    H = f.redundant.H
    for i in range(f.dropped[0]):
        # |H (rd, omega') + known| against the sum of its absolute terms
        residual, terms = known[i], abs(known[i])
        for side in range(2):
            b, at = graph.sides[f.dropped[1 + i], side], 16 * i + 8 * side
            if b == graph.bodies.shape[0]:
                continue
            # H_r rd
            k = graph.bodies[b, 0]
            residual += H[at] * rates[k] + H[at + 1] * rates[k + 1] + H[at + 2] * rates[k + 2]
            terms += _terms(H, at, rates[k], rates[k + 1], rates[k + 2]) + FAINT * most * length(H, at)
            if graph.bodies[b, 1] == 7:
                # H_pi' omega'
                e0, e1, e2, e3 = q[k + 3], q[k + 4], q[k + 5], q[k + 6]
                d0, d1, d2, d3 = rates[k + 3], rates[k + 4], rates[k + 5], rates[k + 6]
                x = -e1 * d0 + e0 * d1 + e3 * d2 - e2 * d3  # 2 (x, y, z) = omega'
                y = -e2 * d0 - e3 * d1 + e0 * d2 + e1 * d3
                z = -e3 * d0 + e2 * d1 - e1 * d2 + e0 * d3
                residual += 2.0 * (H[at + 4] * x + H[at + 5] * y + H[at + 6] * z)
                spin = 2.0 * math.sqrt(d0 * d0 + square(rates, k + 4))
                terms += length(H, at + 4) * (spin + FAINT * fastest)
        if not abs(residual) <= HELD * terms:
            return False
    return True
