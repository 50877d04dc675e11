"""Arrays that begin where a line of the cache does, so that no four floats of theirs are in two."""

import numpy as np

LINE = 64  # bytes


def zeros(count):
    """So many floats, zero."""
    room = np.zeros(count + LINE // 8)
    first = -room.ctypes.data % LINE // 8
    return room[first : first + count]
