"""What has kept the steps of a run short, where it isn't the motion: a `max_step`, or rounding of the forces.

A last digit of the positions, dq, changes accelerations by da, which vary at the rate w = sqrt(da / dq). Over their own
time 1 / w velocities change by da / w. Where that is more than the tolerance, no step of a size that shows the motion
is accepted, and steps are shorter than 1 / w by far.
"""

from typing import NamedTuple

import numpy as np

from ..errors import Status, TsdynError
from ..maths.root_isolation import EPS
from ..observables.generalised_forces import applied_loads
from ..runs.tolerances import AT_LONGEST
from .tolerances import CLEAR, COARSE, LEAST, SHORTENED, TRIALS


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
    with np.errstate(all="ignore"):
        said = _rounding(solution, method) if min(method.rtol, method.atol) < COARSE else ""
    if said:
        return StepLimit(None, said)
    return StepLimit(None, "Raise max_steps, or loosen rtol and atol." if status is Status.MAX_STEPS else None)


def _mean(solution):
    """The mean step, s."""
    return (solution._reached - solution.span[0]) / max(solution.stats.steps, 1)


def _rounding(solution, method):
    """Say that rounding of the forces is above the tolerances; "" where it isn't."""
    packed, h = solution.packed, _mean(solution)
    t, (q, qd, qdd) = solution._reached, solution._last
    if not (len(packed.system.forces) and h > 0.0 and np.isfinite((q, qd, qdd)).all()):
        return ""
    bodies = packed.system.bodies
    at = np.repeat(np.arange(len(bodies)), bodies[:, 1])
    dq = EPS * np.maximum.reduceat(np.abs(q), bodies[:, 0])[at]
    near = q + np.random.default_rng(0).choice((-1.0, 1.0), (TRIALS, q.size)) * dq

    def compared(da):
        """Rates w (n,), and changes of velocities da / w over the tolerances (n,)."""
        rates = np.sqrt(da / np.maximum(dq, LEAST))
        own = np.where(rates > 0.0, rates, np.inf)
        return rates, da / own / (method.atol + method.rtol * np.hypot(qd, qdd / own))

    if _norm(compared(_of_loads(solution, t, q, qd, near))[1]) < 1.0:  # without constraints: most are told apart by it
        return ""
    da = _of_motion(solution, t, q, qd, near)
    rates, ratios = compared(da)
    worst, share = int(ratios.argmax()), _norm(ratios)
    if not 1.0 <= share < np.inf or h * rates[worst] > SHORTENED:
        return ""
    return (
        "The tolerances are below what rounding of the forces allows: a last digit of the positions changes the "
        f"acceleration of {packed.bodies[at[worst]].name} by {da[worst]:.1e}, and steps are {h:.1e} s long. Loosen to "
        f"rtol={CLEAR * share * method.rtol:.0e} and atol={CLEAR * share * method.atol:.0e}, or soften the forces."
    )


def _norm(ratios):
    """Of ratios of velocities, those of positions being zero."""
    return float(np.sqrt((ratios * ratios).mean() / 2.0))


def _of_loads(solution, t, q, qd, near):
    """The largest changes of accelerations (n,) of bodies without joints."""
    system, count = solution.packed.system, len(near) + 1
    places, rates = np.concatenate((q[None], near)), np.tile(qd, (count, 1))
    Q = applied_loads(system, np.full(count, t), places, rates, np.tile(solution._remembered, (count, 1)))
    least = [
        np.repeat((mass, 4.0 * np.linalg.eigvalsh(J.reshape(3, 3))[0]), (3, length - 3))
        for (_, length), mass, J in zip(system.bodies, system.mass, system.inertia, strict=True)
    ]
    return np.abs(Q[1:] - Q[0]).max(axis=0) / np.maximum(np.concatenate(least), LEAST)


def _of_motion(solution, t, q, qd, near):
    """The same with the constraints; zero where accelerations can't be found."""
    from ..statics.motion import Motion  # imported here: few runs end early

    packed, slots = solution.packed, solution._remembered
    try:
        here = Motion(packed, slots, t, q, qd).qdd
        return np.max([np.abs(Motion(packed, slots, t, place, qd).qdd - here) for place in near], axis=0)
    except (TsdynError, ArithmeticError):
        return np.zeros(q.size)
