"""Arrays and records cut from one block of memory."""

import ctypes
import math

import numpy as np


def carve(shapes, **records):
    """Records of these classes and arrays of these shapes, by name, all zero, cut in this order from one block.

    The block is the `base` of each array.
    """
    sizes = {name: math.prod(shape) for name, shape in shapes.items()}
    words = {name: ctypes.sizeof(kind) // 8 for name, kind in records.items()}
    block, found, at = np.zeros(sum(words.values()) + sum(sizes.values())), {}, 0
    for name, kind in records.items():
        found[name] = kind.from_buffer(block, 8 * at)
        at += words[name]
    for name, shape in shapes.items():
        found[name] = block[at : at + sizes[name]].reshape(shape)
        at += sizes[name]
    return found


def divided(block, *parts):
    """A block in two: the records and arrays that it begins with, and the rest."""
    at = sum(part.size if isinstance(part, np.ndarray) else ctypes.sizeof(part) // 8 for part in parts)
    return block[:at], block[at:]


def words(record):
    """The numbers of a record as an array of words, which is copied and cleared in less time."""
    return np.frombuffer(record, np.int64)


def arrays_of(value):
    """The arrays of named tuples, and their records as arrays of words."""
    if isinstance(value, np.ndarray):
        return [value]
    return [array for part in value for array in arrays_of(part)] if isinstance(value, tuple) else [words(value)]
