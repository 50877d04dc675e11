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
from ..runs.arguments import tolerances
from .tolerances import COST, LARGEST_PILOT, PILOT, SHARP_COST


def explicit(prepared, rtol, atol, series):
    """Return the initial method; series: True if Taylor is admissible."""
    kind = Taylor if series and not prepared.refusal and prepared.pays else DOP853
    given, known = (rtol, atol, series), prepared.explicit
    if not all(value is None or type(value) is float for value in given[:2]):  # the method checks them
        return kind(**tolerances(rtol, atol))
    if given not in known:
        known.clear()
        known[given] = kind(**tolerances(rtol, atol))
    return known[given]


def implicit(method):
    """Return the implicit method of the same tolerances."""
    return SDIRK54(method.rtol, method.atol)


def instead(task, status):
    """Return the method that begins a run of the default method again; None if its `status` stands.

    A law that is not analytic somewhere, as |v| at rest, may end series where stages go on.
    """
    if status == Status.STIFF:
        return implicit(task.method)
    failed = status in (Status.STEP_COLLAPSED, Status.NOT_FINITE)
    if failed and task.choose is not None and isinstance(task.method, Taylor) and task.prepared.sharp:
        return DOP853(task.method.rtol, task.method.atol, max_step=task.method.max_step)
    return None


def chooser(simulate, scene, method, end, options):
    """Return the function that decides, when the motion is found stiff, whether to change to an implicit method."""
    share = SHARP_COST if isinstance(method, Taylor) and any(force.sharp for force in scene.forces) else 1.0

    def choose(run):
        if run.now.shape[1] > LARGEST_PILOT:
            return False
        start = float(run.clock.t)
        state = SimpleNamespace(q=run.now[0], qd=run.now[1], memory=run.remembered[len(run.joints) :].copy())
        try:
            pilot = simulate(scene, (start, end), integrator=implicit(method), max_steps=PILOT, state=state, **options)
        except TsdynError:  # the run itself goes on
            return False
        if pilot.status == Status.INTERRUPTED:
            raise KeyboardInterrupt
        if pilot.status not in (Status.SUCCESS, Status.MAX_STEPS):
            return False
        h = pilot.steps.h[pilot.steps.accepted]
        stages = COST * pilot.stats.evaluations / pilot.stats.steps
        return stages / np.mean(h[h.size // 2 :]) < share * method.stages / run.clock.h

    return choose
