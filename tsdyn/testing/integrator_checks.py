"""`check_integrator`: properties required of every integration method, tested on scenes with known solutions."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from ..errors import CheckFailed, InvalidArgument
from ..formulations.registry import FORMULATIONS
from ..methods.integrator import Integrator
from .adaptive_checks import check_bounds, check_rejections, check_tolerances
from .integrator_runs import demand_repeatable, make_method, serves
from .integrator_scenes import cases
from .observed_order import fixed_steps, observed_dense_order, observed_order, slack
from .tolerances import REPEATED

if TYPE_CHECKING:
    from collections.abc import Callable

FORMS = ("tangent", "maggi-kane")


class Finding(NamedTuple):
    """Results of a method on one scene."""

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
                demand_repeatable(lambda: make_method(method, rtol=REPEATED, atol=REPEATED), case, form, where)
                if kind.driver == "steps":  # series know a step's error before it is made
                    check_rejections(method, case, form, where)
                check_bounds(method, case, form, where)
            findings.append(Finding(case.name, form, found, dense, errors))
    if not findings:
        raise CheckFailed(f"{type(kind).__name__} serves none of the formulations {', '.join(map(repr, FORMS))}.")
    if (least := min(finding.order for finding in findings)) > order + slack(order):
        raise CheckFailed(
            f"{type(kind).__name__}: the observed order is {least:.2f} or more on every scene, {order} is declared; "
            "declare what it is."
        )
    return tuple(findings)
