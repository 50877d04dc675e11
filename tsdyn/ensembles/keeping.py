"""What is kept of each run: its last state, the states at t_eval, or what a user's function makes of the solution."""

from collections.abc import Mapping

import numpy as np

from ..errors import InvalidArgument
from ..validation import floats, shown
from .user_functions import called

FINAL, TIMES = "final", "t_eval"


def demand_keep(keep, times):
    """Raise InvalidArgument unless `keep` is one of the ways, and there are times for it."""
    if not (callable(keep) or (isinstance(keep, str) and keep in (FINAL, TIMES))):
        raise InvalidArgument(f"keep must be 'final', 't_eval' or a function of the Solution, got {keep!r}.")
    if keep == TIMES and not times.size:
        raise InvalidArgument("keep='t_eval' keeps the states at the times of t_eval=; give them.")


def record_of(keep, outcome, n, times):
    """Arrays of a run by name: t, q, qd."""
    end = outcome.end
    if keep != TIMES:
        return {"t": end.reached, "q": end.last[0], "qd": end.last[1]}
    q = np.full((2, times.size, n), np.nan)
    rows = outcome.rows
    q[:, : len(rows)] = rows[:, 1 : 1 + 2 * n].reshape(-1, 2, n).swapaxes(0, 1)
    return {"t": end.reached, "q": q[0], "qd": q[1]}


def reduced(keep, solution):
    """What a user's function makes of a solution: arrays by name; "" stands for one without a name."""
    found = called(keep, "keep", solution)
    found = dict(found) if isinstance(found, Mapping) else {"": found}
    arrays = {}
    for name, value in found.items():
        array = np.asarray(value, float) if isinstance(value, (bool, np.bool_)) else floats(value)
        if array.dtype != float or array.size == 0:
            raise InvalidArgument(
                f"keep must return numbers, arrays of numbers or a mapping of them, got {shown(value)}."
            )
        arrays[f"kept {name}".rstrip()] = array
    return arrays
