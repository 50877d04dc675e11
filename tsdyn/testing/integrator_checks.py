"""`check_integrator`: properties required of every integration method, tested on scenes with known solutions."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import CheckFailed, InvalidArgument, StepFailure
from ..formulations.registry import FORMULATIONS
from ..methods.integrator import Integrator
from ..observables.diagnostics import ConstraintError, constraint_error
from ..simulation.simulate import simulate
from .integrator_scenes import GRID, cases, distance, mean_distance
from .tolerances import (
    BOUNDED,
    BY_ORDER,
    COARSEST,
    DENSE_TOLERANCE,
    EPS,
    FACTOR,
    FEWEST,
    HIGH_ORDER,
    HIGH_TOLERANCE,
    ITERATION_TRACE,
    LEVELS,
    MOST,
    NO_TRACE,
    ORDER_TOLERANCE,
    POINTS,
    RATIO,
    REJECTED,
    REPEATED,
    ROUNDING,
    STRETCHED,
)

if TYPE_CHECKING:
    from collections.abc import Callable

FORMS = ("tangent", "maggi-kane")


class Finding(NamedTuple):
    """What was observed of a method on one scene."""

    scene: str
    formulation: str
    order: float
    dense_order: float
    errors: tuple  # (tolerance, error) of an adaptive method


def check_integrator(
    method: type[Integrator] | Callable[..., Integrator], *, order: int | None = None, dense_order: int | None = None
) -> tuple[Finding, ...]:
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

    - observed order within 0.2 of the declared one, a new chart being made every step. Below it on no scene; above it
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
    kind = _make(method, step=1e-2)
    adaptive = kind.embedded_order > 0
    order = order or kind.order
    if not order > 0:
        raise InvalidArgument(f"{type(kind).__name__}: order must say the method's order, got {order!r}.")
    findings = []
    for case in cases(type(kind)):
        for form in FORMS:
            if not _serves(case, kind, form):
                continue
            where = f"{type(kind).__name__}, {case.name}, formulation {form!r}"
            interpolant = kind.interpolant(FORMULATIONS[form].first_order)
            steps, off, between = _fixed_steps(method, case, form, where)
            _repeats(lambda: _make(method, step=case.end / 500.0), case, form, where)  # noqa: B023
            found = _order(steps, off, order, where, case.trusted)
            wanted = min(order, interpolant.order) if dense_order is None else dense_order
            dense = _dense_order(steps, between, wanted, where, case.trusted)
            errors = ()
            if adaptive:
                errors = _tolerances(method, case, form, where, order)
                _repeats(lambda: _make(method, rtol=REPEATED, atol=REPEATED), case, form, where)
                if kind.driver == "steps":  # series know a step's error before it is made
                    _rejections(method, case, form, where)
                _bounds(method, case, form, where)
            findings.append(Finding(case.name, form, found, dense, errors))
    if not findings:
        raise CheckFailed(f"{type(kind).__name__} serves none of the formulations {', '.join(map(repr, FORMS))}.")
    if (least := min(finding.order for finding in findings)) > order + _slack(order):
        raise CheckFailed(
            f"{type(kind).__name__}: the observed order is {least:.2f} or more on every scene, {order} is declared; "
            "declare what it is."
        )
    return tuple(findings)


def _make(method, **settings):
    """An instance with these settings."""
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


def _run(case, method, form, **options):
    return simulate(case.scene, (0.0, case.end), integrator=method, formulation=form, **options)


def _finished(solution, where):
    """The solution, if it has reached its end."""
    if not solution.success:
        raise CheckFailed(f"{where}: {solution.method} ended early. {solution.message}")
    return solution


def _serves(case, method, form):
    """Return True if the method takes this formulation."""
    try:
        _run(case, method, form, max_steps=1)
    except InvalidArgument:
        return False
    return True


def _fixed_steps(method, case, form, where):
    """Runs of more and more steps: their numbers, and errors at the ends of steps and between."""
    steps, off, between, count = [], [], [], FEWEST
    while GRID * round(count) <= MOST:
        number = GRID * round(count)
        count *= RATIO
        if steps and number == steps[-1]:
            continue
        try:
            solution = _run(
                case, _make(method, step=case.end / number), form, chart_interval=1, dense_output=True
            ).raise_if_failed()
        except StepFailure as error:
            failure = str(error)
            continue  # too long a step for the scene
        state = solution.at(case.inner)
        _levels(solution, f"{where}, {number} steps")
        _levels(solution, f"{where}, {number} steps, between them", state)
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


def _slopes(steps, off, trusted, where):
    """Orders fitted to the errors of the finest steps above rounding."""
    good = (off > _floor(trusted)) & (off < COARSEST)
    if good.sum() < 3:
        raise CheckFailed(
            f"{where}: the errors of {steps[0]} to {steps[-1]} steps go from {off[0]:.1e} to {off[-1]:.1e}: they do "
            "not converge to the solution, or too fast for an order to be seen."
        )
    steps, off = np.log(steps[good]), np.log(off[good])
    return [-np.polyfit(steps[-n:], off[-n:], 1)[0] for n in POINTS]


def _slack(order):
    return ORDER_TOLERANCE if order <= HIGH_ORDER else HIGH_TOLERANCE


def _order(steps, off, order, where, trusted):
    """The fitted order nearest to the declared one; too low a one is refused."""
    slopes = _slopes(steps, off, trusted, where)
    found = min(slopes, key=lambda slope: abs(slope - order))
    if found < order - _slack(order):
        raise CheckFailed(
            f"{where}: the observed order is {found:.2f}, {order} is declared (errors {off[-1]:.1e} with {steps[-1]} "
            f"steps, {off[-2]:.1e} with {steps[-2]})."
        )
    return found


def _dense_order(steps, off, order, where, trusted):
    found = max(_slopes(steps, off, trusted, f"{where}, between the steps"))
    if found < order - DENSE_TOLERANCE:
        raise CheckFailed(
            f"{where}: dense output has the observed order {found:.2f} and should have {order} (error {off[-1]:.1e} "
            f"between {steps[-1]} steps)."
        )
    return found


def _levels(solution, where, state=None):
    """Refuse constraint errors above rounding."""
    s = solution if state is None else state
    found = constraint_error(solution.packed, s.t, s.q, s.qd, s.qdd)
    first = int(FORMULATIONS[solution.formulation].first_order)  # Maggi/Kane drifts in position
    for name, level, values, factor in list(
        zip(ConstraintError._fields, found, (s.q, s.qd, s.qdd), LEVELS, strict=True)
    )[first:]:
        excess = level / (EPS * (1.0 + np.abs(values).max(axis=1)))
        worst = int(np.argmax(excess))
        if not excess[worst] <= factor:
            raise CheckFailed(
                f"{where}: the {name} constraint error is {level[worst]:.2g} at t = {s.t[worst]:g} s, "
                f"{excess[worst]:.0f} eps of the size of the values; {factor:.0f} are allowed."
            )


def _repeats(make, case, form, where):
    """The same bits again, and the same steps whatever is put out."""
    method = make()
    first = _finished(_run(case, method, form), where)
    again = _run(case, make(), form)
    if not all(_same(a, b) for a, b in zip(_bits(first), _bits(again), strict=True)):
        raise CheckFailed(f"{where}: {method!r} is not reproducible: a second run gives other numbers.")
    other = _run(case, make(), form, t_eval=case.inner, dense_output=True)
    if not (_same(first.steps.t, other.steps.t) and _same(first.steps.h, other.steps.h)):
        raise CheckFailed(f"{where}: {method!r} takes other steps when output between the steps is requested.")
    if not (_same(first.state.q, other.state.q) and _same(first.state.qd, other.state.qd)):
        raise CheckFailed(f"{where}: {method!r} ends elsewhere when output between the steps is requested.")


def _bits(solution):
    return solution.t, solution.q, solution.qd, solution.qdd, solution.steps.t, solution.steps.h


def _same(a, b):
    return np.array_equal(a, b)


def _tolerances(method, case, form, where, order):
    """Errors that follow the tolerance, steps that follow the order of the estimate."""
    tolerances, found, asked, steps = BY_ORDER[order >= 4], [], [], []
    for tol in tolerances:
        made = _make(method, rtol=tol, atol=tol)
        at = f"{where}, tolerance {tol:g}"
        solution = _finished(_run(case, made, form, t_eval=case.grid), at)
        _levels(solution, at)
        _history(solution, at)
        found.append(max(distance(solution.q, case.q), distance(solution.qd, case.qd)))
        asked.append(made.step_tolerances()[0])
        steps.append(solution.stats.steps)
        if found[-1] > FACTOR * tol + 10.0 * case.trusted:
            raise CheckFailed(
                f"{at}: the error is {found[-1]:.2g}, {found[-1] / tol:.0f} times the tolerance; {FACTOR:.0f} times "
                "are allowed. The error estimate is too small, or the method's margin."
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
    """Accepted steps that follow on each other, and all steps counted."""
    h = solution.steps
    t, accepted = h.t[h.accepted], h.h[h.accepted]
    gap = np.abs(t[:-1] + accepted[:-1] - t[1:]).max(initial=0.0)
    if gap > 4.0 * EPS * solution.span[1] or h.accepted.sum() != solution.stats.steps:
        raise CheckFailed(f"{where}: accepted steps leave gaps of up to {gap:.1g} s.")
    if (~h.accepted).sum() != solution.stats.rejected:
        raise CheckFailed(f"{where}: {solution.stats.rejected} rejections are counted, {(~h.accepted).sum()} recorded.")


def _rejections(method, case, form, where):
    """The first accepted step after a rejection ends where it ends when it is tried at once."""
    bold = _make(method, rtol=REJECTED, atol=REJECTED)
    bold.first_step = case.end / 10.0
    after = _run(case, bold, form, max_steps=1)
    if not after.stats.steps:
        raise CheckFailed(f"{where}: after a first step of {bold.first_step:g} s: {after.message}")
    if not after.stats.rejected:
        raise CheckFailed(f"{where}: a first step of {bold.first_step:g} s is accepted at a tolerance of {REJECTED:g}.")
    plain = _make(method, rtol=REJECTED, atol=REJECTED)
    plain.first_step = float(after.steps.h[after.steps.accepted][0])
    before = _run(case, plain, form, max_steps=1)
    if before.stats.rejected:
        raise CheckFailed(f"{where}: a step of {plain.first_step:g} s is accepted after a rejection, and not at once.")
    gap = max(distance(after.state.q, before.state.q), distance(after.state.qd, before.state.qd))
    left = ITERATION_TRACE * max(bold.step_tolerances()) if bold.implicit else NO_TRACE
    if not gap < left:
        raise CheckFailed(f"{where}: rejected steps leave a trace of {gap:.1e} in the step that is accepted.")


def _bounds(method, case, form, where):
    """first_step and max_step are kept."""
    made = _make(method, rtol=BOUNDED, atol=BOUNDED)
    made.first_step, made.max_step = case.end / 1000.0, case.end / 400.0
    steps = _finished(_run(case, made, form), where).steps
    if steps.h[0] != made.first_step:
        raise CheckFailed(f"{where}: the first step is {steps.h[0]:g} s, not the first_step of {made.first_step:g} s.")
    if steps.h.max() > made.max_step * STRETCHED:  # the last one may be stretched by a thousandth, to end on time
        raise CheckFailed(f"{where}: a step of {steps.h.max():g} s is longer than the max_step of {made.max_step:g} s.")
