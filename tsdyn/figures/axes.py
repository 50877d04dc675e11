"""What all figures share: axes, and curves of many points."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..drawing import demand_matplotlib

ZERO = 1e-17  # what an error of exactly zero is drawn as: below any other
POINTS = 400  # stretches of time, the largest error of each of which is drawn


def axes_of(ax: Any, rows: int = 1, columns: int = 1, **options: Any) -> Any:
    """The caller's axes, or new ones of pyplot's: one, or an array (rows, columns) where there are several."""
    demand_matplotlib()
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots(rows, columns, layout="constrained", **options)[1]


def bare(ax: Any) -> None:
    """Without the frame above and to the right, with a faint grid."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(True, color="#dddddd", linewidth=0.6)


def largest(t: Any, error: Any) -> tuple[Any, Any]:
    """Points of a curve: the largest error of each stretch of time, zeros lifted to where a log axis has them."""
    size = max(1, -(-t.size // POINTS))
    at = [start + int(error[start : start + size].argmax()) for start in range(0, t.size, size)]
    return t[at], np.maximum(error[at], ZERO)
