"""Choice of the default method: Taylor; DOP853 where a part of the scene has no series; SDIRK54 where it is stiff.

Taylor steps with sharp forces are shorter, and no quicker than those of DOP853 in scenes without constraints. Where
series fail, the run begins again with DOP853.

The two explicit methods monitor stiffness: DOP853 by its stability limit, Taylor by the number of steps in which the
motion is negligible. When stiffness is detected, a pilot run of SDIRK54 continues from that state, and the numbers of
evaluations per second of simulated time are compared.
"""

from types import SimpleNamespace

import numpy as np

from ..errors import Status, TsdynError
from ..integrators import DOP853, SDIRK54, Taylor
from ..runs.arguments import adaptive
from .tolerances import COST, PILOT, SHARP_COST


def explicit(prepared, rtol, atol, series):
    """Return the initial method; series: True if Taylor is admissible."""
    return adaptive(Taylor if series and not prepared.refusal and prepared.pays else DOP853, rtol, atol)


def implicit(method):
    """Return the implicit method of the same tolerances."""
    return SDIRK54(method.rtol, method.atol)


def instead(task, status):
    """Return the method that begins a run of the default method again; None if its `status` stands.

    A law that is not analytic somewhere, as |v| at rest, may end series where stages go on.
    """
    if status is Status.SUCCESS:
        return None
    if status is Status.STIFF:
        return implicit(task.method)
    failed = status in (Status.STEP_COLLAPSED, Status.NOT_FINITE)
    if failed and task.choose is not None and isinstance(task.method, Taylor) and task.prepared.sharp:
        return DOP853(task.method.rtol, task.method.atol, max_step=task.method.max_step)
    return None


def implicit_is_faster(simulate, given, method, end, run):
    """Return True if a run by a method that is found stiff had better go on by an implicit one, until the end.

    `given` are the arguments of the run, by name.
    """
    start, same = float(run.clock.t), {name: given[name] for name in ("constraint_tol", "initial_tol", "max_step")}
    state = SimpleNamespace(q=run.now[0], qd=run.now[1], memory=run.remembered[len(run.joints) :].copy())
    pilot = {**same, "integrator": implicit(method), "max_steps": PILOT, "state": state}
    try:
        pilot = simulate(given["scene"], (start, end), **pilot)
    except TsdynError:  # the run itself goes on
        return False
    if pilot.status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    if pilot.status not in (Status.SUCCESS, Status.MAX_STEPS):
        return False
    sharp = isinstance(method, Taylor) and any(force.sharp for force in given["scene"].forces)
    h = pilot.steps.h[pilot.steps.accepted]
    stages = COST * pilot.stats.evaluations / pilot.stats.steps
    return stages / np.mean(h[h.size // 2 :]) < (SHARP_COST if sharp else 1.0) * method.stages / run.clock.h
