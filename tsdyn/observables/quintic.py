"""States between outputs: the quintic with positions, velocities and accelerations of both.

Where the acceleration jumps at the later output, which has that behind the jump, the quartic without it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..maths.tolerances import TINY
from .tolerances import JUMP, OTHERWISE, SMALL_RANGE

if TYPE_CHECKING:
    from ..hints import Floats


def quintic(t: Floats, levels: tuple[Floats, Floats, Floats], times: Floats) -> tuple[Floats, Floats, Floats]:
    """Positions, velocities and accelerations (k, n) at times (k,), from those (outputs, n) at outputs t."""
    q, qd, qdd = levels
    i, s, h = intervals(t, times)
    j, s, h = np.minimum(i + 1, t.size - 1), s[:, None], h[:, None]
    size = np.maximum(h * h * ranges(qdd), TINY)
    d, v, w, a, b = q[j] - q[i], h * qd[i], h * qd[j], h * h * qdd[i], h * h * qdd[j]
    quartic, cubic = 6.0 * (v + w) - 12.0 * d + a, 6.0 * d - 4.0 * v - 2.0 * w  # accelerations at j, and at i
    off, bend = ((np.abs(x) / size).max(axis=1, initial=0.0) for x in (b - quartic, a - cubic))
    b = np.where((off > JUMP + OTHERWISE * bend)[:, None], quartic, b)
    c3 = 10.0 * d - 6.0 * v - 4.0 * w - 1.5 * a + 0.5 * b
    c4 = -15.0 * d + 8.0 * v + 7.0 * w + 1.5 * a - b
    c5 = 6.0 * d - 3.0 * (v + w) - 0.5 * (a - b)
    rate = v + s * (a + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    second = a + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
    with np.errstate(invalid="ignore", divide="ignore"):
        return (
            q[i] + s * (v + s * (0.5 * a + s * (c3 + s * (c4 + s * c5)))),
            np.where(h > 0.0, rate / h, qd[i]),
            np.where(h > 0.0, second / (h * h), qdd[i]),
        )


def intervals(t: Floats, times: Floats) -> tuple[Floats, Floats, Floats]:
    """For each time the output before it, and where it is in the interval from there, 0 to 1, of length h, s."""
    i = np.clip(np.searchsorted(t, times, side="right") - 1, 0, max(t.size - 2, 0))
    h = t[np.minimum(i + 1, t.size - 1)] - t[i]
    s = np.divide(times - t[i], h, out=np.zeros_like(times), where=h > 0.0)
    return i, np.clip(s, 0.0, 1.0), h


def ranges(values: Floats) -> Floats:
    """The range (n,) of each column of values (outputs, n); of those that hardly change, a share of the largest."""
    found = np.ptp(values, axis=0)
    return np.maximum(found, SMALL_RANGE * found.max(initial=0.0))
