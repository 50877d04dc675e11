"""What all figures share: axes, and curves of many points."""

from __future__ import annotations

import inspect
from functools import wraps
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting
from ..drawing import demand_matplotlib
from ..errors import InvalidArgument

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..hints import Function

ZERO = 1e-17  # what an error of exactly zero is drawn as: below any other
SHOWN = {  # first argument: what it must be
    "solution": "a Solution, which ts.simulate returns",
    "linearisation": "a Linearisation, which scene.linearise() returns",
    "ensemble": "an Ensemble, which ts.ensemble returns",
}
POINTS = 400  # stretches of time, the largest error of each of which is drawn


def axes_of(ax: Any, rows: int = 1, columns: int = 1, **options: Any) -> Any:
    """The caller's axes, or new ones of pyplot's: one, or an array (rows, columns) where there are several."""
    demand_matplotlib()
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots(rows, columns, layout="constrained", **options)[1]


def figure_of(*needed: str) -> Callable[[Function], Function]:
    """Decorate what draws: a wrong call is refused, as is a first argument without the attributes that it needs."""

    def decorate(draw):
        name = next(iter(inspect.signature(draw).parameters))

        @wraps(draw)
        def checked(*arguments, **keywords):
            given = arguments[:1] or [keywords[name] for _ in range(name in keywords)]
            for shown in given:  # by `dir`, since `hasattr` computes properties
                if not {*needed} <= {*dir(shown)} or isinstance(shown, type):
                    raise InvalidArgument(f"{draw.__name__}: {name} must be {SHOWN[name]}, got {shown!r}.")
            return draw(*arguments, **keywords)

        return fitting(checked)

    return decorate


def bare(ax: Any) -> None:
    """Without the frame above and to the right, with a faint grid."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(True, color="#dddddd", linewidth=0.6)


def largest(t: Any, error: Any) -> tuple[Any, Any]:
    """Points of a curve: the largest error of each stretch of time, zeros lifted to where a log axis has them."""
    size = max(1, -(-t.size // POINTS))
    at = [start + int(error[start : start + size].argmax()) for start in range(0, t.size, size)]
    return t[at], np.maximum(error[at], ZERO)
