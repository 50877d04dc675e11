"""The order of a method and of its dense output, fitted to the errors of runs with fixed steps."""

import numpy as np

from ..errors import CheckFailed, StepFailure
from .integrator_runs import demand_levels, make_method, run_case
from .integrator_scenes import GRID, mean_distance
from .tolerances import (
    COARSEST,
    DENSE_TOLERANCE,
    FEWEST,
    FINEST,
    HIGH_ORDER,
    HIGH_TOLERANCE,
    MOST,
    ORDER_TOLERANCE,
    POINTS,
    RATIO,
    ROUNDING,
    SETTLED,
)


def fixed_steps(method, case, form, order, where):
    """Runs of more and more steps: their numbers, and errors at the ends of steps and between.

    There are more than MOST steps only where the order observed falls short of `order` and still changes.
    """
    steps, off, between, count = [], [], [], FEWEST
    while (number := GRID * round(count)) <= FINEST:
        if number > MOST and not (steps and _falls_short(steps, off, order, case.trusted)):
            break
        count *= RATIO
        if steps and number == steps[-1]:
            continue
        try:
            solution = run_case(
                case, make_method(method, step=case.end / number), form, chart_interval=1, dense_output=True
            ).raise_if_failed()
        except StepFailure as error:
            failure = str(error)
            continue  # too long a step for the scene
        state = solution.at(case.inner)
        demand_levels(solution, f"{where}, {number} steps")
        demand_levels(solution, f"{where}, {number} steps, between them", state)
        ends = slice(None, None, number // GRID)
        steps.append(number)
        off.append(_error(solution.q[ends], solution.qd[ends], case.q, case.qd))
        between.append(_error(state.q, state.qd, case.q_inner, case.qd_inner))
        if off[-1] < _floor(case.trusted):
            break
    if not steps:
        raise CheckFailed(f"{where}: no run of up to {MOST} steps reached the end of {case.end:g} s: {failure}")
    return np.array(steps), np.array(off), np.array(between)


def _floor(trusted):
    return max(ROUNDING, 100.0 * trusted)


def _error(q, qd, q_expected, qd_expected):
    return np.hypot(mean_distance(q, q_expected), mean_distance(qd, qd_expected))


def _fits(steps, off, trusted):
    """Orders fitted to the errors of the finest steps above rounding; none for less than three."""
    steps, off = np.array(steps), np.array(off)
    good = (off > _floor(trusted)) & (off < COARSEST)
    steps, off = np.log(steps[good]), np.log(off[good])
    return [-np.polyfit(steps[-n:], off[-n:], 1)[0] for n in POINTS] if good.sum() > 2 else []


def _falls_short(steps, off, order, trusted):
    """Whether the order observed is too low, and changes with the number of steps."""
    slopes = _fits(steps, off, trusted)
    return not slopes or (max(slopes) < order - slack(order) and np.ptp(slopes) > SETTLED)


def _slopes(steps, off, trusted, where):
    """The fitted orders; refuse errors that show none."""
    if slopes := _fits(steps, off, trusted):
        return slopes
    raise CheckFailed(
        f"{where}: the errors of {steps[0]} to {steps[-1]} steps go from {off[0]:.1e} to {off[-1]:.1e}: they do not "
        "converge to the solution, or too fast for an order to be seen."
    )


def slack(order):
    """Return by how much an observed order may fall short."""
    return ORDER_TOLERANCE if order <= HIGH_ORDER else HIGH_TOLERANCE


def observed_order(steps, off, order, where, trusted):
    """The fitted order nearest to the declared one; too low a one is refused."""
    slopes = _slopes(steps, off, trusted, where)
    found = min(slopes, key=lambda slope: abs(slope - order))
    if found < order - slack(order):
        raise CheckFailed(
            f"{where}: the observed order is {found:.2f}, {order} is declared (errors {off[-1]:.1e} with {steps[-1]} "
            f"steps, {off[-2]:.1e} with {steps[-2]})."
        )
    return found


def observed_dense_order(steps, off, order, where, trusted):
    """Return the fitted order of dense output; refuse one that is too low."""
    found = max(_slopes(steps, off, trusted, f"{where}, between the steps"))
    if found < order - DENSE_TOLERANCE:
        raise CheckFailed(
            f"{where}: dense output has the observed order {found:.2f} and should have {order} (error {off[-1]:.1e} "
            f"between {steps[-1]} steps)."
        )
    return found
