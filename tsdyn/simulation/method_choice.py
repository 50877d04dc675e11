"""Choice of the default method: Taylor; DOP853 where a part of the scene has no series; SDIRK54 where it is stiff.

Taylor steps with sharp forces are shorter, and no quicker than those of DOP853 in scenes without constraints. Where
series fail, the run begins again with DOP853.

The two explicit methods monitor stiffness: DOP853 by its stability limit, Taylor by the number of steps in which the
motion is negligible. When stiffness is detected, a pilot run of SDIRK54 continues from that state, and the numbers of
evaluations per second of simulated time are compared.
"""

from types import SimpleNamespace

from ..errors import Status, TsdynError
from ..integrators import DOP853, SDIRK54, Taylor
from ..runs.arguments import adaptive
from .tolerances import COST, PILOTS, SERIES_COST, SHARP_COST, STEP_EVALUATIONS


def explicit(prepared, rtol, atol, series):
    """Return the initial method; series: True if Taylor is admissible."""
    return adaptive(Taylor if series and not prepared.refusal and prepared.pays else DOP853, rtol, atol)


def reason(prepared):
    """Return the initial method, and why, in words."""
    if prepared.refusal:
        return f"DOP853. {prepared.refusal}"
    if not prepared.pays:
        return "DOP853: a force changes sharply, and without constraints series are no quicker."
    return "Taylor: every constraint and force has a series. SDIRK54 takes over where the motion is found stiff."


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

    `given` are the arguments of the run, by name. A short pilot settles clear cases, a longer one the others. None is
    made where the rest of the run costs no more.
    """
    start, sharp = float(run.clock.t), any(force.sharp for force in given["scene"].forces)
    series = isinstance(method, Taylor)
    cost = SERIES_COST if series else COST
    ours = (SHARP_COST if series and sharp else 1.0) * method.stages / run.clock.h  # a second of the motion
    for steps, gain in PILOTS:
        if ours * (end - start) < cost * steps * STEP_EVALUATIONS:
            return False
        pilot = _pilot(simulate, given, implicit(method), end, run, steps)
        if pilot is None:
            return False
        h = pilot.steps.h[pilot.steps.accepted]
        theirs = cost * pilot.stats.evaluations / pilot.stats.steps / h[h.size * 3 // 4 :].max()  # steps grow
        if theirs * gain < ours:
            return True
        if pilot.status == Status.SUCCESS:
            return theirs < ours
    return False


def _pilot(simulate, given, method, end, run, steps):
    """A run of so many steps from where a run is, or None where it fails."""
    same = {name: given[name] for name in ("constraint_tol", "initial_tol", "max_step")}
    state = SimpleNamespace(q=run.now[0], qd=run.now[1], memory=run.remembered[len(run.joints) :].copy())
    span = float(run.clock.t), end
    try:
        pilot = simulate(given["scene"], span, **same, integrator=method, max_steps=steps, state=state)
    except TsdynError:  # the run itself goes on
        return None
    if pilot.status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    return pilot if pilot.status in (Status.SUCCESS, Status.MAX_STEPS) else None
