"""Choice of the default method: Taylor; DOP853 where a part of the scene has no series; SDIRK54 where it is stiff.

The two explicit methods monitor stiffness: DOP853 by its stability limit, Taylor by the number of steps in which the
motion is negligible. When stiffness is detected, a pilot run of SDIRK54 continues from that state, and the numbers of
evaluations per second of simulated time are compared.
"""

from types import SimpleNamespace

import numpy as np

from ..errors import Status, TsdynError
from ..integrators import DOP853, SDIRK54, Taylor
from ..runs.arguments import tolerances
from .tolerances import COST, PILOT


def explicit(prepared, rtol, atol, series):
    """Return the initial method; series: True if Taylor is admissible."""
    kind = Taylor if series and not prepared.refusal else DOP853
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


def chooser(simulate, scene, method, end, options):
    """Return the function that decides, when the motion is found stiff, whether to change to an implicit method."""

    def choose(run):
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
        return stages / np.mean(h[h.size // 2 :]) < method.stages / run.clock.h

    return choose
