"""`check_integrator`: properties required of every integration method, tested on scenes with known solutions."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..errors import CheckFailed, InvalidArgument, StepFailure
from ..formulations.registry import FORMULATIONS
from ..maths.tolerances import EPS
from ..methods.integrator import Integrator
from ..observables.diagnostics import ConstraintError, constraint_error
from ..runs.tolerances import STRETCH
from ..simulation.prepared_run import simulate
from . import tolerances as limits
from .integrator_scenes import GRID, cases, distance
from .series_checks import demand_kind


def mean_distance(found, expected):
    """The same in the root mean square, which zero crossings of one component leave smooth."""
    return np.sqrt(np.mean((found - expected) ** 2)) / (1.0 + np.sqrt(np.mean(expected**2)))


# Runs of an integrator under check: made, finished, at rounding on the constraints, reproducible.


def make_method(method, **settings):
    """An instance with these settings."""
    demand_kind(method, Integrator)
    if not callable(method):
        raise InvalidArgument(
            f"check_integrator needs an Integrator class or a callable that makes one, got {method!r}."
        )
    try:
        made = method(**settings)
    except TypeError as error:
        raise InvalidArgument(
            f"check_integrator calls {getattr(method, '__name__', method)!s} with {', '.join(settings)}: {error}."
        ) from error
    if not isinstance(made, Integrator):
        raise InvalidArgument(f"check_integrator needs what makes a ts.Integrator; {method!r} made {made!r}.")
    return made


def run_case(case, method, form, **options):
    """Return the solution of a case."""
    return simulate(case.scene, (0.0, case.end), integrator=method, formulation=form, **options)


def finished(solution, where):
    """The solution, if it has reached its end."""
    if not solution.success:
        raise CheckFailed(f"{where}: {solution.method} ended early. {solution.message}")
    return solution


def serves(case, method, form):
    """Return True if the method takes this formulation."""
    try:
        run_case(case, method, form, max_steps=1)
    except InvalidArgument:
        return False
    return True


def demand_levels(solution, where, state=None):
    """Refuse constraint errors above rounding."""
    s = solution if state is None else state
    found = constraint_error(solution.packed, s.t, s.q, s.qd, s.qdd)
    first = int(FORMULATIONS[solution.formulation].first_order)  # Maggi/Kane drifts in position
    for name, level, values, factor in list(
        zip(ConstraintError._fields, found, (s.q, s.qd, s.qdd), limits.LEVELS, strict=True)
    )[first:]:
        excess = level / (EPS * (1.0 + np.abs(values).max(axis=1)))
        worst = int(np.argmax(excess))
        if not excess[worst] <= factor:
            raise CheckFailed(
                f"{where}: the {name} constraint error is {level[worst]:.2g} at t = {s.t[worst]:g} s, "
                f"{excess[worst]:.0f} eps of the size of the values; {factor:.0f} are allowed."
            )


def demand_repeatable(make, case, form, where):
    """The same bits again, and the same steps whatever is put out."""
    method = make()
    first = finished(run_case(case, method, form), where)
    again = run_case(case, make(), form)
    if not all(np.array_equal(a, b) for a, b in zip(_bits(first), _bits(again), strict=True)):
        raise CheckFailed(f"{where}: {method!r} is not reproducible: a second run gives other numbers.")
    other = run_case(case, make(), form, t_eval=case.inner, dense_output=True)
    if not (np.array_equal(first.steps.t, other.steps.t) and np.array_equal(first.steps.h, other.steps.h)):
        raise CheckFailed(f"{where}: {method!r} takes other steps when output between the steps is requested.")
    if not (np.array_equal(first.state.q, other.state.q) and np.array_equal(first.state.qd, other.state.qd)):
        raise CheckFailed(f"{where}: {method!r} ends elsewhere when output between the steps is requested.")


def _bits(solution):
    return solution.t, solution.q, solution.qd, solution.qdd, solution.steps.t, solution.steps.h


# The order of a method and of its dense output, fitted to the errors of runs with fixed steps.


def fixed_steps(method, case, form, order, where):
    """Runs of more and more steps: their numbers, and errors at the ends of steps and between.

    There are more than MOST steps only where the order observed falls short of `order` and still changes.
    """
    steps, off, between, count = [], [], [], limits.FEWEST
    while (number := GRID * round(count)) <= limits.FINEST:
        if number > limits.MOST and not (steps and _falls_short(steps, off, order, case.trusted)):
            break
        count *= limits.RATIO
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
        raise CheckFailed(f"{where}: no run of up to {limits.MOST} steps reached the end of {case.end:g} s: {failure}")
    return np.array(steps), np.array(off), np.array(between)


def _floor(trusted):
    return max(limits.ROUNDING, 100.0 * trusted)


def _error(q, qd, q_expected, qd_expected):
    return np.hypot(mean_distance(q, q_expected), mean_distance(qd, qd_expected))


def _fits(steps, off, trusted):
    """Orders fitted to the errors of the finest steps above rounding; none for less than three."""
    steps, off = np.array(steps), np.array(off)
    good = (off > _floor(trusted)) & (off < limits.COARSEST)
    steps, off = np.log(steps[good]), np.log(off[good])
    return [-np.polyfit(steps[-n:], off[-n:], 1)[0] for n in limits.POINTS] if good.sum() > 2 else []


def _falls_short(steps, off, order, trusted):
    """Whether the order observed is too low, and changes with the number of steps."""
    slopes = _fits(steps, off, trusted)
    return not slopes or (max(slopes) < order - slack(order) and np.ptp(slopes) > limits.SETTLED)


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
    return limits.ORDER_TOLERANCE if order <= limits.HIGH_ORDER else limits.HIGH_TOLERANCE


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
    if found < order - limits.DENSE_TOLERANCE:
        raise CheckFailed(
            f"{where}: dense output has the observed order {found:.2f} and should have {order} (error {off[-1]:.1e} "
            f"between {steps[-1]} steps)."
        )
    return found


# Checks of adaptive steps: errors follow the tolerance, rejections leave no trace, bounds are kept.


def check_tolerances(method, case, form, where, order):
    """Check that errors follow the tolerance, and steps the order of the estimate."""
    tolerances, found, asked, steps = limits.BY_ORDER[order >= 4], [], [], []
    for tol in tolerances:
        made = make_method(method, rtol=tol, atol=tol)
        at = f"{where}, tolerance {tol:g}"
        solution = finished(run_case(case, made, form, t_eval=case.grid), at)
        demand_levels(solution, at)
        _history(solution, at)
        found.append(max(distance(solution.q, case.q), distance(solution.qd, case.qd)))
        asked.append(made.step_tolerances()[0])
        steps.append(solution.stats.steps)
        if found[-1] > limits.FACTOR * tol + 10.0 * case.trusted:
            raise CheckFailed(
                f"{at}: the error is {found[-1]:.2g}, {found[-1] / tol:.0f} times the tolerance; {limits.FACTOR:.0f} "
                "times are allowed. The error estimate is too small, or the method's `safety` factor."
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
    bold = make_method(method, rtol=limits.REJECTED, atol=limits.REJECTED)
    bold.first_step = case.end / 10.0
    after = run_case(case, bold, form, max_steps=1)
    if not after.stats.steps:
        raise CheckFailed(f"{where}: after a first step of {bold.first_step:g} s: {after.message}")
    if not after.stats.rejected:
        raise CheckFailed(
            f"{where}: a first step of {bold.first_step:g} s is accepted at a tolerance of {limits.REJECTED:g}."
        )
    plain = make_method(method, rtol=limits.REJECTED, atol=limits.REJECTED)
    plain.first_step = float(after.steps.h[after.steps.accepted][0])
    before = run_case(case, plain, form, max_steps=1)
    if before.stats.rejected:
        raise CheckFailed(f"{where}: a step of {plain.first_step:g} s is accepted after a rejection, and not at once.")
    gap = max(distance(after.state.q, before.state.q), distance(after.state.qd, before.state.qd))
    left = limits.ITERATION_TRACE * max(bold.step_tolerances()) if bold.implicit else limits.NO_TRACE
    if not gap < left:
        raise CheckFailed(f"{where}: rejected steps leave a trace of {gap:.1e} in the step that is accepted.")


def check_bounds(method, case, form, where):
    """Check that first_step and max_step are respected."""
    made = make_method(method, rtol=limits.BOUNDED, atol=limits.BOUNDED)
    made.first_step, made.max_step = case.end / 1000.0, case.end / 400.0
    steps = finished(run_case(case, made, form), where).steps
    if steps.h[0] != made.first_step:
        raise CheckFailed(f"{where}: the first step is {steps.h[0]:g} s, not the first_step of {made.first_step:g} s.")
    if steps.h.max() > made.max_step * (1.0 + 2.0 * STRETCH):  # the last one may be stretched, to end on time
        raise CheckFailed(f"{where}: a step of {steps.h.max():g} s is longer than the max_step of {made.max_step:g} s.")


FORMS = ("tangent", "maggi-kane")


class SceneFinding(NamedTuple):
    """Results of a method on one scene."""

    scene: str
    formulation: str
    order: float
    dense_order: float
    errors: tuple  # (tolerance, error) of an adaptive method


def check_integrator(
    method: type[Integrator] | Callable[..., Integrator], *, order: int | None = None, dense_order: int | None = None
) -> tuple[SceneFinding, ...]:
    """Check an integration method on scenes with known solutions; raise naming what failed and by how much.

    Parameters
    ----------
    method : Integrator subclass, or callable
        Called with step=, s, and, where its instances have an `embedded_order`, with rtol= and atol=. A method of
        variable order needs one: lambda **settings: Taylor(order=8, **settings).
    order : int, optional
        Of the error at fixed time; default what the method declares.
    dense_order : int, optional
        Of the error between the steps; default the smaller of `order` and its interpolant's.

    Returns
    -------
    tuple of Finding
        For each scene and formulation that the method serves: orders observed, errors at each tolerance.

    Raises
    ------
    CheckFailed
        If one of the notes' demands is not met.
    InvalidArgument
        If `method` doesn't make integrators.

    Notes
    -----
    On a sliding top, a two-body pendulum in space and a pendulum of driven length, in every formulation that the method
    doesn't refuse with InvalidArgument:

    - observed order within 0.2 of the declared one, a new chart being made every step; up to 100,000 steps are tried
      where it falls short and still changes, and an eighth of the span for order one. Below it on no scene; above it
      not on all of them, since leading error terms may be small on one. For orders above 6 it is 0.75: such methods
      are at rounding before higher powers of the step have died out;
    - the same between the steps, by dense output, up to 0.5 below;
    - constraint errors at most 50, 500, 5000 eps (1 + largest |q|, |qd|, |qdd|) in position, velocity and acceleration
      at every output and between (in position not for Maggi/Kane, which drifts);
    - adaptive methods: errors below 100 tolerances, that follow the tolerance; number of steps that grows as the order
      of the estimate says; first_step and max_step; rejected steps leave no trace;
    - output times change no step, and a run repeated gives the same bits.

    Examples
    --------
    >>> import tsdyn as ts
    >>> class Boaster(ts.integrators.RK45):
    ...     order = 6
    >>> try:
    ...     ts.testing.check_integrator(Boaster)
    ... except ts.testing.CheckFailed:
    ...     print("refused")
    refused
    """
    kind = make_method(method, step=1e-2)
    adaptive = kind.embedded_order > 0
    order = order or kind.order
    if not order > 0:
        raise InvalidArgument(f"{type(kind).__name__}: order must say the method's order, got {order!r}.")
    findings = []
    for case in cases(type(kind), order):
        for form in FORMS:
            if not serves(case, kind, form):
                continue
            where = f"{type(kind).__name__}, {case.name}, formulation {form!r}"
            interpolant = kind.interpolant(FORMULATIONS[form].first_order)
            steps, off, between = fixed_steps(method, case, form, order, where)
            demand_repeatable(lambda: make_method(method, step=case.end / 500.0), case, form, where)  # noqa: B023
            found = observed_order(steps, off, order, where, case.trusted)
            wanted = min(order, interpolant.order) if dense_order is None else dense_order
            dense = observed_dense_order(steps, between, wanted, where, case.trusted)
            errors = ()
            if adaptive:
                errors = check_tolerances(method, case, form, where, order)
                demand_repeatable(
                    lambda: make_method(method, rtol=limits.REPEATED, atol=limits.REPEATED), case, form, where
                )
                if kind.driver == "steps":  # series know a step's error before it is made
                    check_rejections(method, case, form, where)
                check_bounds(method, case, form, where)
            findings.append(SceneFinding(case.name, form, found, dense, errors))
    if not findings:
        raise CheckFailed(f"{type(kind).__name__} serves none of the formulations {', '.join(map(repr, FORMS))}.")
    if (least := min(finding.order for finding in findings)) > order + slack(order):
        raise CheckFailed(
            f"{type(kind).__name__}: the observed order is {least:.2f} or more on every scene, {order} is declared; "
            "declare what it is."
        )
    return tuple(findings)
