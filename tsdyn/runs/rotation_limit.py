"""Rotation limit of a step in driven scenes.

A prescribed coordinate is exact for any step length, so an error estimate never limits the step; and after a full turn
a body is back in its orientation, so a chart doesn't either.
"""

import math

from ..jit.kernels import kernel
from .tolerances import MOST_TURN, TOO_FAR


@kernel
def longest_step(bodies, now):
    """The step in which nothing turns by more than MOST_TURN; now (3, n) is q, qd, qdd."""
    longest = math.inf
    for b in range(bodies.shape[0]):
        if bodies[b, 1] == 7:
            # |pd| and |pdd| of the Euler parameters
            speed, gain = 0.0, 0.0
            for c in range(bodies[b, 0] + 3, bodies[b, 0] + 7):
                speed += now[1, c] * now[1, c]
                gain += now[2, c] * now[2, c]
            gain = 2.0 * math.sqrt(max(gain - speed * speed, 0.0))  # pdd is pd.pd along p, alpha / 2 across
            speed = 2.0 * math.sqrt(speed)
            # MOST_TURN = speed h + gain h^2 / 2, solved for h without cancellation
            fast = speed + math.sqrt(speed * speed + 2.0 * gain * MOST_TURN)
            if fast > 0.0:
                longest = min(longest, 2.0 * MOST_TURN / fast)
    return longest


@kernel
def too_far(bodies, now, qd, h):
    """Whether a body has turned by more than TOO_FAR, from its speeds at both ends."""
    for b in range(bodies.shape[0]):
        if bodies[b, 1] == 7:
            # Mean speed of both ends times h
            one, other = 0.0, 0.0
            for c in range(bodies[b, 0] + 3, bodies[b, 0] + 7):
                one += now[1, c] * now[1, c]
                other += qd[c] * qd[c]
            if (math.sqrt(one) + math.sqrt(other)) * h > TOO_FAR:
                return True
    return False
