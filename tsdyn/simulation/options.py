"""The arguments of `simulate`, checked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..errors import InvalidArgument
from ..formulations.registry import formulation as find_formulation
from ..methods.integrator import registered
from ..runs.arguments import interval, method_of, output_times
from ..runs.events import prepare
from ..runs.task import between
from ..validation import one_of, positive, whole
from .progress import reporter


class Options(NamedTuple):
    """Options of a run; None where the scene decides."""

    span: tuple  # start and end, s
    method: Any  # Integrator, or None
    default: tuple  # rtol, atol of the default method, and whether it may be Taylor
    form: Any
    constraint_tol: float
    initial_tol: float
    drop: bool  # redundant rows
    times: np.ndarray  # output times, s; empty for every step
    dense_output: bool
    events: Any  # as prepared, or None
    max_steps: int | None
    max_step: float | None  # s
    history: bool
    report: Callable[..., Any]
    chart_interval: int | None

    @property
    def within(self):
        """True if output between the ends of steps is requested."""
        return self.dense_output or self.events is not None or between(self.times, self.span)


def checked(given):
    """The `Options` of the arguments of `simulate`, by name; raises InvalidArgument."""
    span, form = interval(given["t_span"]), find_formulation(given["formulation"])
    history = given["store"] is None if given["history"] is None else given["history"]
    for name, value in (("dense_output", given["dense_output"]), ("history", history)):
        if not isinstance(value, (bool, np.bool_)):
            raise InvalidArgument(f"{name} must be True or False, got {value!r}.")
    chart_interval, longest = whole(given["chart_interval"], "chart_interval"), given["max_step"]
    return Options(
        span=span,
        method=_method(given["integrator"], given["rtol"], given["atol"], form),
        default=(given["rtol"], given["atol"], form.name == "tangent" and chart_interval is None),
        form=form,
        constraint_tol=positive(given["constraint_tol"], "constraint_tol"),
        initial_tol=positive(given["initial_tol"], "initial_tol"),
        drop=one_of(given["redundancy"], ("drop", "refuse"), "redundancy") == "drop",
        times=output_times(given["t_eval"], *span),
        dense_output=bool(given["dense_output"]),
        events=prepare(given["events"]),
        max_steps=whole(given["max_steps"], "max_steps"),
        max_step=None if longest is None else positive(longest, "max_step (s)"),
        history=bool(history),
        report=reporter(given["progress"]),
        chart_interval=chart_interval,
    )


def _method(integrator, rtol, atol, form):
    """Return the requested method, None for the default."""
    if integrator is None:
        return None
    method = method_of(integrator, rtol, atol)
    if method.implicit and form.first_order:
        others = ", ".join(repr(name) for name, kind in registered().items() if not kind.implicit)
        raise InvalidArgument(
            f"{type(method).__name__} solves its stages in the tangent-space form only; formulation={form.name!r} is "
            f"served by {others}."
        )
    return method
