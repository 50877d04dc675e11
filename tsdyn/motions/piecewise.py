"""Piecewise polynomials in time: data of splines, and their values in Python.

On piece i the value is sum_k c[i, k] (t - knots[i])^k. At a knot the piece to its right holds, as in SciPy.
`motion_program` evaluates the same data in a run.
"""

import numpy as np

from ..errors import InvalidArgument
from ..maths.power_series import Truncated

HEAD = 7  # numbers before the knots: pieces, coefficients of each, period, beyond, piece, shift, held
NEXT_AFTER = 4  # neighbours tried where a knot of a later period is rounded into the piece before


class Pieces:
    """A piecewise polynomial of time.

    Parameters
    ----------
    knots : ndarray (n + 1,), s
        Increasing.
    c : ndarray (n, k)
        Coefficients of each piece about its first knot, the constant one first.
    beyond : bool or "periodic"
        Outside the knots: no value, extrapolation of the end pieces, or periodic continuation.
    """

    def __init__(self, knots, c, beyond=False):
        self.knots, self.c, self.beyond = np.ascontiguousarray(knots), np.ascontiguousarray(c), beyond
        if not (np.isfinite(self.knots).all() and np.isfinite(self.c).all()):
            raise InvalidArgument("a piecewise motion needs finite times and coefficients.")
        if not (np.diff(self.knots) > 0.0).all():
            raise InvalidArgument("a piecewise motion needs times that increase.")

    @property
    def period(self):
        """The period, s; 0 if there is none."""
        return self.knots[-1] - self.knots[0] if self.beyond == "periodic" else 0.0

    @property
    def covers(self):
        """First and last time with a value, s."""
        return (self.knots[0], self.knots[-1]) if self.beyond is False else (-np.inf, np.inf)

    def find(self, t, left=False):
        """Return the piece at times t, and the shift of its knots; left: at a knot, the piece that ends there."""
        first, last, period = self.knots[0], self.knots.size - 2, self.period
        shift = np.floor((t - first) / period) * period if period else np.zeros_like(t)
        if left and period:
            shift = np.where(t - shift <= first, shift - period, shift)
        i = np.searchsorted(self.knots, t - shift, side="left" if left else "right") - 1
        return np.clip(i, 0, last), shift

    def value(self, t, left=False):
        """Return the value for time of any numeric type."""
        at = np.asarray((t.c[0] if isinstance(t, Truncated) else t).real, float)
        i, shift = self.find(at, left)
        x, c = (t - shift) - self.knots[i], self.c[i]
        low, high = self.covers
        total = 0.0 * x + np.where((at >= low) & (at <= high), c[..., -1], np.nan)
        for k in range(self.c.shape[1] - 2, -1, -1):
            total = total * x + c[..., k]
        return total

    def joints(self, t0, t1):
        """The knots in (t0, t1] at which a piece ends and another begins."""
        if not self.period:
            inner = self.knots[1:-1]
            return inner[(inner > t0) & (inner <= t1)]
        turns = np.arange(np.floor((t0 - self.knots[0]) / self.period), (t1 - self.knots[0]) / self.period + 1.0)
        times = (self.knots[:-1] + (turns * self.period)[:, None]).ravel()
        piece = np.tile(np.arange(self.knots.size - 1), turns.size)
        for _ in range(NEXT_AFTER):
            times = np.where(self.find(times)[0] == piece, times, np.nextafter(times, np.inf))
        return times[(times > t0) & (times <= t1)]

    def numbers(self):
        """Return the numbers of the piece for `motion_program`, a list of floats."""
        head = [self.c.shape[0], self.c.shape[1], self.period, self.beyond is not False, 0, 0, 0]
        return [*map(float, head), *self.knots.tolist(), *self.c.ravel().tolist()]

    def __repr__(self):
        return f"<{len(self.c)} pieces, {self.knots[0]:g} to {self.knots[-1]:g} s>"
