"""States of contacts: whether a plane pushes on its point, or holds it back, where a one-sided contact would open."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..constraints import PlaneContact
from .frames import Frames
from .sizes import Attached

OPEN, HOLDS_BACK, PUSHES = 0, 1, 2  # as the page colours them
NONE = 1e-6  # of the largest force of the contact: below it there is none


def contact_states(frames: Frames, constraints: list[Attached]) -> list[Any]:
    """The states (k,) of each PlaneContact at the frames."""
    return [_states(frames, each.item) for each in constraints if isinstance(each.item, PlaneContact)]


def _states(frames, item):
    """From the sign of the multiplier: the force along the normal is -lam; NaN, of a dropped row, is none."""
    lam = np.nan_to_num(frames.interpolated(frames.run.multipliers[:, frames.run.rows(item).start]))
    none = NONE * np.abs(lam).max(initial=0.0)
    return np.where(np.abs(lam) <= none, OPEN, np.where(lam < 0.0, PUSHES, HOLDS_BACK))
