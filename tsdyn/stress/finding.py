"""What a law of a run has found."""

from typing import NamedTuple

import numpy as np


class Finding(NamedTuple):
    """What a law found."""

    law: str
    size: float
    limit: float
    where: str = ""

    @property
    def broken(self):
        """True if the size exceeds the limit, or is no number."""
        return not self.size <= self.limit

    def __str__(self):
        where = f" ({self.where})" if self.where else ""
        return f"{self.law}: {self.size:.2e}, at most {self.limit:.2e}{where}"


def some(count, most):
    """Return indices of the first, the last, and some between, `most` at most."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))
