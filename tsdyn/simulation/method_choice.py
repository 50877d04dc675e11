"""Choice of the default method: Taylor; DOP853 where a part of the scene has no series; SDIRK54 where it is stiff.

The two explicit methods monitor stiffness: DOP853 by its stability limit, Taylor by a count of steps in which nothing
moves far. When stiffness is detected, a pilot run of SDIRK54 continues from there, and the numbers of evaluations per
second of motion decide.
"""

from types import SimpleNamespace

import numpy as np

from ..errors import Status, TsdynError
from ..integrators import DOP853, SDIRK54, Taylor
from ..runs.arguments import tolerances
from ..runs.run_state import H, T
from .tolerances import COST, LARGEST_PILOT, PILOT


def explicit(prepared, rtol, atol, series):
    """The method that a run begins with; series: whether Taylor may be it."""
    given, known = (rtol, atol, series), prepared.explicit
    if not all(value is None or type(value) is float for value in given[:2]) or given not in known:
        kind = Taylor if series and not prepared.refusal else DOP853
        known.clear()
        known[given] = kind(**tolerances(rtol, atol))
    return known[given]


def implicit(method):
    """The method that takes over, to the same tolerances."""
    return SDIRK54(method.rtol, method.atol)


def chooser(simulate, scene, method, end, options):
    """Make the function that the driver asks when the motion of a run is found stiff: whether to change."""

    def choose(run):
        if run.now.shape[1] > LARGEST_PILOT:
            return False
        start = float(run.clock[T])
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
        return stages / np.mean(h[h.size // 2 :]) < method.stages / run.clock[H]

    return choose
