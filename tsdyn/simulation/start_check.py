"""Whether a run could begin: all that `simulate` refuses before it runs anything."""

from .prepared_run import Run
from .run_options import from_names


def demand_startable(scene, given):
    """Raise what `simulate(scene, **given)` raises before a run."""
    options, call = from_names({"t_span": (0.0, 1.0), **given})
    Run(scene, options)._check(call)
