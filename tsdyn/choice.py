"""The method for a motion that none was named for: DOP853, or SDIRK54 where the motion is stiff and that pays.

DOP853 begins and watches for steps at its limit of stability. When it has found enough of them, a pilot of SDIRK54
goes on from there, and the evaluations that both need for a second of motion decide.
"""

from types import SimpleNamespace

import numpy as np

from .errors import Status, TsdynError
from .integrators import DOP853, SDIRK54
from .run_state import H, T

PILOT = 60  # steps
COST = 1.5  # of an evaluation in an implicit stage, its share of matrices included, against an explicit one


def explicit(rtol, atol):
    """The method that a run begins with; tolerances default to 1e-8."""
    return DOP853(rtol=1e-8 if rtol is None else rtol, atol=1e-8 if atol is None else atol)


def implicit(method):
    """The method that takes over, to the same tolerances."""
    return SDIRK54(method.rtol, method.atol)


def chooser(simulate, scene, method, end, options):
    """Make the function that the driver asks when the motion of a run is found stiff: whether to change."""

    def choose(run):
        start = float(run.clock[T])
        state = SimpleNamespace(q=run.now[0], qd=run.now[1], memory=run.remembered.copy())
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
        return stages / np.mean(h[h.size // 2 :]) < len(method.tableau.c) / run.clock[H]

    return choose
