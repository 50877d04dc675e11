"""Loads that other engines can have."""

import numpy as np


def is_constant(value):
    """Whether a load is finite numbers, not a function of time or state."""
    try:
        return bool(np.isfinite(np.asarray(value, float)).all())
    except (TypeError, ValueError):
        return False
