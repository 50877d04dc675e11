"""Choice of the default method: Taylor; DOP853 where a part of the scene has no series; implicit where it is stiff.

Taylor steps with sharp forces are shorter, and no quicker than those of DOP853 in scenes without constraints. Where
series fail, the run begins again with DOP853. Where the motion is found stiff, the implicit method goes on: turns.py.
"""

from functools import partial

from ..errors import Status
from ..integrators import DOP853, Taylor
from ..methods.integrator import frozen
from ..runs.arguments import adaptive
from .turns import Turns


def first_method(options, prepared):
    """Return the method that a run of these `RunOptions` begins with."""
    method = options.method
    if method is None:
        series = options.may_use_series and not prepared.refusal and prepared.pays
        method = adaptive(Taylor if series else DOP853, options.rtol, options.atol)
    return method if options.max_step is None else frozen(method.bounded(options.max_step))


def reason(options, prepared):
    """Say why a run of these `RunOptions` begins with its first method."""
    if options.method is not None:
        return "as asked."
    if not options.may_use_series:
        return "series serve the tangent form alone, and make their charts themselves."
    if prepared.refusal:
        return prepared.refusal
    if not prepared.pays:
        return "a force changes sharply, and without constraints series are no quicker."
    return "every constraint and force has a series. Radau takes over where the motion is found stiff."


def turns_of(scene, prepared, method, form, span, within):
    """What makes the `Turns` of a run by the default method; None in a form that no implicit method serves."""
    return None if form.first_order else partial(Turns, scene, prepared, method, form, span, within)


def instead(task, status):
    """Return the method that begins a run of the default method again; None if its `status` stands.

    A law that is not analytic somewhere, as |v| at rest, may end series where stages go on.
    """
    failed = status in (Status.STEP_COLLAPSED, Status.NOT_FINITE)
    if failed and task.choose is not None and isinstance(task.method, Taylor) and task.prepared.sharp:
        return DOP853(task.method.rtol, task.method.atol, max_step=task.method.max_step)
    return None
