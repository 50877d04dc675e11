"""Outputs of a driver: the records of accepted states."""

from ..jit.kernels import long_kernel
from ..maths.dense_linalg import copy
from ..model.joint_turns import angle_after


@long_kernel
def record(r, log, t, q, qd, qdd):
    """Record one output, at the last accepted state or inside the step."""
    n, i = q.size, r.numbers.rows
    # t, q, qd, qdd, angles of joints and memories of forces
    row = log.out[i]
    row[0] = t
    for j in range(n):
        row[1 + j], row[1 + n + j], row[1 + 2 * n + j] = q[j], qd[j], qdd[j]
    for j in range(r.remembered.size):
        row[1 + 3 * n + j] = r.remembered[j]
    # Within a step angles are extrapolated from its start
    if t != r.clock.t:
        for j in range(r.joints.shape[0]):
            row[1 + 3 * n + j] = angle_after(r, j, q, qd, t - r.clock.t)
    r.numbers.rows = i + 1


@long_kernel
def store_now(w, r):
    """q, qd, qdd as those of the last accepted point."""
    copy(w.q, r.now[0])
    copy(w.qd, r.now[1])
    copy(w.qdd, r.now[2])


@long_kernel
def restore_now(w, r):
    """Put them back."""
    copy(r.now[0], w.q)
    copy(r.now[1], w.qd)
    copy(r.now[2], w.qdd)
