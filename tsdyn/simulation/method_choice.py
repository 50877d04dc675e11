"""Choice of the default method: Taylor; DOP853 where a part of the scene has no series; implicit where it is stiff.

Taylor steps with sharp forces are shorter, and no quicker than those of DOP853 in scenes without constraints. Where
series fail, the run begins again with DOP853. Where the motion is found stiff, the implicit method goes on: turns.py.
"""

from ..errors import Status
from ..integrators import DOP853, Taylor
from ..runs.arguments import adaptive
from .turns import Turns


def explicit(prepared, rtol, atol, series):
    """Return the initial method; series: True if Taylor is admissible."""
    return adaptive(Taylor if series and not prepared.refusal and prepared.pays else DOP853, rtol, atol)


def reason(prepared):
    """Return the initial method, and why, in words."""
    if prepared.refusal:
        return f"DOP853. {prepared.refusal}"
    if not prepared.pays:
        return "DOP853: a force changes sharply, and without constraints series are no quicker."
    return "Taylor: every constraint and force has a series. Radau takes over where the motion is found stiff."


def turns_of(scene, prepared, method, options):
    """The `Turns` of a run by the initial method; None in a form that no implicit method serves."""
    return None if options.settings.form.first_order else Turns(scene, prepared, method, options)


def instead(task, status):
    """Return the method that begins a run of the default method again; None if its `status` stands.

    A law that is not analytic somewhere, as |v| at rest, may end series where stages go on.
    """
    failed = status in (Status.STEP_COLLAPSED, Status.NOT_FINITE)
    if failed and task.choose is not None and isinstance(task.method, Taylor) and task.prepared.sharp:
        return DOP853(task.method.rtol, task.method.atol, max_step=task.method.max_step)
    return None
