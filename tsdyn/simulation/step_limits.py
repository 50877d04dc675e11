"""What has kept the steps of a run short, where it isn't the motion: a `max_step`, or rounding of the forces.

A last digit of the positions, dq, changes accelerations by da, which vary at the rate w = sqrt(da / dq). Over their own
time 1 / w velocities change by da / w. Where that is more than the tolerance, no step of a size that shows the motion
is accepted, and steps are shorter than 1 / w by far.
"""

from typing import NamedTuple

import numpy as np

from ..errors import Status, TsdynError
from ..maths.root_isolation import EPS
from ..runs.tolerances import AT_LONGEST
from .tolerances import CLEAR, SHORTENED, TRIALS


class StepLimit(NamedTuple):
    """What is said in place of the sentence and the remedy of a status, None where these stand."""

    sentence: str | None
    remedy: str | None


def step_limit(solution):
    """The `StepLimit` of a solution that ended early."""
    method, status = solution._method, solution.status
    adapts = getattr(method, "embedded_order", 0) > 0 and method.step is None
    if not adapts or status not in (Status.STEP_COLLAPSED, Status.MAX_STEPS, Status.INTERRUPTED):
        return StepLimit(None, None)
    longest = method.max_step
    if longest is not None and status is not Status.INTERRUPTED and _mean(solution) >= AT_LONGEST * longest:
        if status is Status.MAX_STEPS:
            return StepLimit(None, "Raise max_steps, or give a longer max_step.")
        sentence = f"The steps are as long as max_step={longest:g} s allows."
        return StepLimit(sentence, "Give a longer max_step, or leave it out: the tolerances choose the steps then.")
    said = _rounding(solution, method)
    if said:
        return StepLimit(None, said)
    return StepLimit(None, "Raise max_steps, or loosen rtol and atol." if status is Status.MAX_STEPS else None)


def _mean(solution):
    """The mean step, s."""
    return (solution._reached - solution.span[0]) / max(solution.stats.steps, 1)


def _rounding(solution, method):
    """Say that rounding of the forces is above the tolerances; "" where it isn't."""
    from ..statics.motion import Motion  # imported here: few runs end early

    packed, h = solution.packed, _mean(solution)
    t, (q, qd, qdd), slots = solution._reached, solution._last, solution._remembered
    at = np.repeat(np.arange(len(packed.bodies)), packed.system.bodies[:, 1])
    dq = EPS * np.maximum.reduceat(np.abs(q), packed.system.bodies[:, 0])[at] if q.size else q
    if not (h > 0.0 and np.isfinite((q, qd, qdd)).all()):
        return ""
    rng, da = np.random.default_rng(0), np.zeros(q.size)
    try:
        before = Motion(packed, slots, t, q, qd).qdd
        for _ in range(TRIALS):
            near = Motion(packed, slots, t, q + rng.choice((-1.0, 1.0), q.size) * dq, qd).qdd
            da = np.maximum(da, np.abs(near - before))
    except (TsdynError, ArithmeticError):
        return ""
    if not (da.any() and np.isfinite(da).all()):
        return ""
    rates = np.sqrt(np.where(dq > 0.0, da / np.where(dq > 0.0, dq, 1.0), 0.0))
    own = np.where(rates > 0.0, rates, np.inf)
    sizes = np.hypot(qd, qdd / own)
    ratios = da / own / (method.atol + method.rtol * sizes)
    worst, share = int(ratios.argmax()), float(np.sqrt((ratios * ratios).mean() / 2.0))
    if share < 1.0 or h * rates[worst] > SHORTENED:
        return ""
    return (
        "The tolerances are below what rounding of the forces allows: a last digit of the positions changes the "
        f"acceleration of {packed.bodies[at[worst]].name} by {da[worst]:.1e}, and steps are {h:.1e} s long. Loosen to "
        f"rtol={CLEAR * share * method.rtol:.0e} and atol={CLEAR * share * method.atol:.0e}, or soften the forces."
    )
