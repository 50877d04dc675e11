"""Arrays aligned to cache lines, so that no vector of four floats straddles two lines."""

import numpy as np

LINE = 64  # bytes


def zeros(count):
    """So many floats, zero."""
    room = np.zeros(count + LINE // 8)
    first = -room.ctypes.data % LINE // 8
    return room[first : first + count]
