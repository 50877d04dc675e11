"""Checks of adaptive steps: errors follow the tolerance, rejections leave no trace, bounds are kept."""

import numpy as np

from ..errors import CheckFailed
from .integrator_runs import demand_levels, finished, make_method, run_case
from .integrator_scenes import distance
from .tolerances import (
    BOUNDED,
    BY_ORDER,
    EPS,
    FACTOR,
    ITERATION_TRACE,
    NO_TRACE,
    REJECTED,
    STRETCHED,
)


def check_tolerances(method, case, form, where, order):
    """Check that errors follow the tolerance, and steps the order of the estimate."""
    tolerances, found, asked, steps = BY_ORDER[order >= 4], [], [], []
    for tol in tolerances:
        made = make_method(method, rtol=tol, atol=tol)
        at = f"{where}, tolerance {tol:g}"
        solution = finished(run_case(case, made, form, t_eval=case.grid), at)
        demand_levels(solution, at)
        _history(solution, at)
        found.append(max(distance(solution.q, case.q), distance(solution.qd, case.qd)))
        asked.append(made.step_tolerances()[0])
        steps.append(solution.stats.steps)
        if found[-1] > FACTOR * tol + 10.0 * case.trusted:
            raise CheckFailed(
                f"{at}: the error is {found[-1]:.2g}, {found[-1] / tol:.0f} times the tolerance; {FACTOR:.0f} times "
                "are allowed. The error estimate is too small, or the method's `safety` factor."
            )
    if not (np.diff(found) < 0.0).all():
        pairs = ", ".join(f"{off:.1e} at {tol:g}" for tol, off in zip(tolerances, found, strict=True))
        raise CheckFailed(f"{where}: the error does not decrease with the tolerance: {pairs}.")
    growth = np.log(steps[-1] / steps[-2]) / np.log(asked[-2] / asked[-1])
    wanted = 1.0 / (made.embedded_order + 1)
    if growth > 1.3 * wanted + 0.02:
        raise CheckFailed(
            f"{where}: the number of steps grows as tolerance^-{growth:.2f}, for an error estimate of order "
            f"{made.embedded_order} it should be ^-{wanted:.2f}: the estimate has a lower order than is declared."
        )
    return tuple(zip(tolerances, found, strict=True))


def _history(solution, where):
    """Check that accepted steps are contiguous, and all steps counted."""
    h = solution.steps
    t, accepted = h.t[h.accepted], h.h[h.accepted]
    gap = np.abs(t[:-1] + accepted[:-1] - t[1:]).max(initial=0.0)
    if gap > 4.0 * EPS * solution.span[1] or h.accepted.sum() != solution.stats.steps:
        raise CheckFailed(f"{where}: accepted steps leave gaps of up to {gap:.1g} s.")
    if (~h.accepted).sum() != solution.stats.rejected:
        raise CheckFailed(f"{where}: {solution.stats.rejected} rejections are counted, {(~h.accepted).sum()} recorded.")


def check_rejections(method, case, form, where):
    """Check that the step after a rejection is the step without one."""
    bold = make_method(method, rtol=REJECTED, atol=REJECTED)
    bold.first_step = case.end / 10.0
    after = run_case(case, bold, form, max_steps=1)
    if not after.stats.steps:
        raise CheckFailed(f"{where}: after a first step of {bold.first_step:g} s: {after.message}")
    if not after.stats.rejected:
        raise CheckFailed(f"{where}: a first step of {bold.first_step:g} s is accepted at a tolerance of {REJECTED:g}.")
    plain = make_method(method, rtol=REJECTED, atol=REJECTED)
    plain.first_step = float(after.steps.h[after.steps.accepted][0])
    before = run_case(case, plain, form, max_steps=1)
    if before.stats.rejected:
        raise CheckFailed(f"{where}: a step of {plain.first_step:g} s is accepted after a rejection, and not at once.")
    gap = max(distance(after.state.q, before.state.q), distance(after.state.qd, before.state.qd))
    left = ITERATION_TRACE * max(bold.step_tolerances()) if bold.implicit else NO_TRACE
    if not gap < left:
        raise CheckFailed(f"{where}: rejected steps leave a trace of {gap:.1e} in the step that is accepted.")


def check_bounds(method, case, form, where):
    """Check that first_step and max_step are respected."""
    made = make_method(method, rtol=BOUNDED, atol=BOUNDED)
    made.first_step, made.max_step = case.end / 1000.0, case.end / 400.0
    steps = finished(run_case(case, made, form), where).steps
    if steps.h[0] != made.first_step:
        raise CheckFailed(f"{where}: the first step is {steps.h[0]:g} s, not the first_step of {made.first_step:g} s.")
    if steps.h.max() > made.max_step * STRETCHED:  # the last one may be stretched by a thousandth, to end on time
        raise CheckFailed(f"{where}: a step of {steps.h.max():g} s is longer than the max_step of {made.max_step:g} s.")
