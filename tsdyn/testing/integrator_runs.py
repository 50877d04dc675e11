"""Runs of an integrator under check: made, finished, at rounding on the constraints, reproducible."""

import numpy as np

from ..errors import CheckFailed, InvalidArgument
from ..formulations.registry import FORMULATIONS
from ..methods.integrator import Integrator
from ..observables.diagnostics import ConstraintError, constraint_error
from ..simulation.simulate import simulate
from .instances import demand_kind
from .tolerances import (
    EPS,
    LEVELS,
)


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
        zip(ConstraintError._fields, found, (s.q, s.qd, s.qdd), LEVELS, strict=True)
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
    if not all(_same(a, b) for a, b in zip(_bits(first), _bits(again), strict=True)):
        raise CheckFailed(f"{where}: {method!r} is not reproducible: a second run gives other numbers.")
    other = run_case(case, make(), form, t_eval=case.inner, dense_output=True)
    if not (_same(first.steps.t, other.steps.t) and _same(first.steps.h, other.steps.h)):
        raise CheckFailed(f"{where}: {method!r} takes other steps when output between the steps is requested.")
    if not (_same(first.state.q, other.state.q) and _same(first.state.qd, other.state.qd)):
        raise CheckFailed(f"{where}: {method!r} ends elsewhere when output between the steps is requested.")


def _bits(solution):
    return solution.t, solution.q, solution.qd, solution.qdd, solution.steps.t, solution.steps.h


def _same(a, b):
    return np.array_equal(a, b)
