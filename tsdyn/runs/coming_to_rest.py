"""Where friction brings a joint to rest: there its force changes at once, and an implicit step is to end just before.

With Q the generalised forces of a friction for unit normal load, -Q . qd = mu |v|. From velocity and deceleration,

    t_rest = |v| / -d|v|/dt

Each step to LANDING of it leaves a tenth of the velocity, until friction at rest is resolved.
"""

import math

from ..formulations.friction_loads import body_of, unit_friction
from ..jit.kernels import kernel, stack
from ..maths.dense_linalg import copy
from .tolerances import LANDING, LITTLE, SLIDES


@kernel
def _friction_power(c, friction, r, scale, ahead):
    """-Q . qd of a friction at scale qd + ahead qdd."""
    graph, qd, Q, power = c.graph, c.work.qd, stack(14), 0.0
    # Power of friction for unit normal load at scaled velocities
    for i in range(qd.size):
        qd[i] = scale * r.now[1, i] + ahead * r.now[2, i]
    unit_friction(c.system, friction, r.now[0], qd, r.clock.t, Q)
    for k in range(2):
        # -Q.qd, body by body
        b = body_of(friction, k)
        if b < graph.bodies.shape[0]:
            at = graph.bodies[b, 0]
            for j in range(graph.bodies[b, 1]):
                power -= Q[7 * k + j] * qd[at + j]
    return power


@kernel
def until_rest(c, r, h):
    """The step h, or less of it: to just before the first joint comes to rest. Counts those at rest in r.numbers.still.

    c.work.qd is that of r.now after it.
    """
    if c.graph.frictions.shape[0] == 0:
        return h
    r.numbers.still = 0
    for i in range(c.graph.frictions.shape[0]):
        friction = c.graph.frictions[i]
        # mu |v| now
        now = _friction_power(c, friction, r, 1.0, 0.0)
        # At rest, friction grows faster than in proportion to velocity
        if not _friction_power(c, friction, r, 2.0, 0.0) < SLIDES * now:
            r.numbers.still += 1
        elif now < math.inf:
            # Deceleration by a small part of the step: rest is at h now / slowing parts from here
            slowing = now - _friction_power(c, friction, r, 1.0, LITTLE * h)
            if slowing > LITTLE * now:
                h = min(h, LANDING * LITTLE * h * now / slowing)
    copy(r.now[1], c.work.qd)
    return h
