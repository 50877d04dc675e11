"""Lengths of a scene: in a small one positions are held to rounding of these, not of the pure numbers beside them."""

import numpy as np

from ..elements.markers import POINT

SMALL = 1e-3  # m: a scene without longer lengths; rounding of one is 1e-12 of it


def is_small(size):
    """Return True for the size of a scene in which pure numbers, such as the coordinates of axes, are no lengths."""
    return 0.0 < size < SMALL


def has_lengths(primitive):
    """Return True if the rows of a primitive are lengths, or depend on them; False if they are pure numbers."""
    return any(marker.code == POINT for marker in primitive.markers)


def size_of(primitives, coordinates):
    """Size of a scene: the largest number among the coordinates of markers; of a small one, the largest length, m."""
    return size_of_reaches([reaches_of(*pair) for pair in zip(primitives, coordinates, strict=True)])


def reaches_of(primitive, places):
    """The largest numbers among the coordinates of points, and of all markers, of a primitive."""
    sizes = [(marker.code, float(np.abs(s).max())) for marker, s in zip(primitive.markers, places, strict=True)]
    return max((size for code, size in sizes if code == POINT), default=0.0), max((s for _, s in sizes), default=0.0)


def size_of_reaches(reaches):
    """The same as `size_of`, from those of each primitive."""
    length = max((each[0] for each in reaches), default=0.0)
    return length if is_small(length) else max((each[1] for each in reaches), default=0.0)
