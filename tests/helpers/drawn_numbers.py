"""Random numbers that hypothesis draws, behind the methods of numpy.random.Generator that random scenes use.

A failure is shrunk: towards few bodies, the first of the kinds, equal numbers.
"""

import numpy as np
from hypothesis import strategies as st
from scipy.special import ndtri

WHOLE = 1 << 32
UPPER_QUARTILE = 0.75  # what normal numbers shrink to: a scene of zeros would be none


class DrawnNumbers:
    """As `numpy.random.Generator`, each number from a strategy."""

    def __init__(self, data):
        self.data = data

    def _many(self, one, size):
        return one() if size is None else np.array([one() for _ in range(size)])

    def integers(self, low, high=None, size=None):
        low, high = (0, low) if high is None else (low, high)
        return self._many(lambda: self.data.draw(st.integers(low, high - 1)), size)

    def random(self):
        return self.integers(WHOLE) / WHOLE

    def uniform(self, low, high, size=None):
        return self._many(lambda: low + (high - low) * self.random(), size)

    def normal(self, size=None):
        return self._many(lambda: float(ndtri(((UPPER_QUARTILE + self.random()) % 1.0) or UPPER_QUARTILE)), size)

    def choice(self, values, size=None, replace=True, p=None):
        values = list(values)
        if not replace:
            return [values.pop(self.integers(len(values))) for _ in range(size)]
        if size is not None:
            return self._many(lambda: self.choice(values, p=p), size)
        if p is None:
            return values[self.integers(len(values))]
        return values[int(np.searchsorted(np.cumsum(p), self.random(), side="right"))]
