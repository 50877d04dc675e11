"""Whether a run could begin: all that `simulate` refuses before it runs anything."""

import inspect

from . import method_choice
from .options import checked
from .scene_cache import prepared
from .simulate import _request, simulate


def demand_startable(scene, given):
    """Raise what `simulate(scene, **given)` raises before a run."""
    defaults = {name: parameter.default for name, parameter in inspect.signature(simulate).parameters.items()}
    options = checked({**defaults, "t_span": (0.0, 1.0), **given})
    kept = prepared(scene)
    method = options.method or method_choice.explicit(kept, given.get("rtol"), given.get("atol"), options.series)
    _request(scene, kept, method, options, None, None)
