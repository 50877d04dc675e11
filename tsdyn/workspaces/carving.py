"""Arrays cut from one block of memory."""

import math

import numpy as np


def carve(shapes):
    """Arrays of zeros of these shapes, by name, cut from one block, which is the `base` of each."""
    sizes = {name: math.prod(shape) for name, shape in shapes.items()}
    block = np.zeros(sum(sizes.values()))
    arrays, at = {}, 0
    for name, shape in shapes.items():
        arrays[name] = block[at : at + sizes[name]].reshape(shape)
        at += sizes[name]
    return arrays
