"""Types of tables whose columns have names, which kernels and Python share."""

import numpy as np


def record_type(*names):
    """Return the NumPy type of a row of 64-bit integers with these names: `table[i].name`."""
    return np.dtype((np.record, [(name, np.int64) for name in names]))
