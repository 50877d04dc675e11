"""The arguments of `simulate`, checked."""

from __future__ import annotations

from collections.abc import Callable
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from ..errors import InvalidArgument
from ..formulations.registry import formulation as find_formulation
from ..methods.integrator import frozen, registered
from ..runs.arguments import interval, method_of, output_times
from ..runs.events import prepare
from ..runs.task import between
from ..validation import checked_once, one_of, positive, whole
from .progress import reporter


class Settings(NamedTuple):
    """Options that are numbers, names and flags; None where the scene decides."""

    form: Any
    constraint_tol: float
    initial_tol: float
    drop: bool  # redundant rows
    dense_output: bool
    max_steps: int | None
    max_step: float | None  # s
    history: bool | None
    chart_interval: int | None


class Options(NamedTuple):
    """Options of a run."""

    span: tuple  # start and end, s
    method: Any  # Integrator, or None
    times: np.ndarray  # output times, s; empty for every step
    events: Any  # as prepared, or None
    report: Callable[..., Any]
    history: bool
    within: bool  # whether output between the ends of steps is requested
    settings: Settings
    series: bool  # whether the default method may be Taylor


_of_settings = itemgetter(
    "formulation", "constraint_tol", "initial_tol", "redundancy", "dense_output", "max_steps", "max_step", "history",
    "chart_interval",
)  # fmt: skip


def checked(given):
    """The `Options` of the arguments of `simulate`, by name; raises InvalidArgument."""
    span, settings, integrator = interval(given["t_span"]), _settings(*_of_settings(given)), given["integrator"]
    times, events = output_times(given["t_eval"], *span), prepare(given["events"])
    return Options(
        span,
        None if integrator is None else _method(integrator, given["rtol"], given["atol"], settings.form),
        times,
        events,
        reporter(given["progress"]),
        given["store"] is None if settings.history is None else settings.history,
        settings.dense_output or events is not None or between(times, span),
        settings,
        settings.form.name == "tangent" and settings.chart_interval is None,
    )


def demand_arguments_of_file(given):
    """Raise InvalidArgument unless arguments of a file, without functions, are such as `simulate` takes."""
    named = "taylor" if given["integrator"] is None else given["integrator"]  # the tolerances are checked with it
    checked({**given, "integrator": named, "events": None, "progress": None})


@checked_once
def _settings(  # nine: each is an argument of `simulate`
    formulation, constraint_tol, initial_tol, redundancy, dense_output, max_steps, max_step, history, chart_interval
):
    for name, value in (("dense_output", dense_output), ("history", history)):
        if not (isinstance(value, (bool, np.bool_)) or (value is None and name == "history")):
            raise InvalidArgument(f"{name} must be True or False, got {value!r}.")
    return Settings(
        form=find_formulation(formulation),
        constraint_tol=positive(constraint_tol, "constraint_tol"),
        initial_tol=positive(initial_tol, "initial_tol"),
        drop=one_of(redundancy, ("drop", "refuse"), "redundancy") == "drop",
        dense_output=bool(dense_output),
        max_steps=whole(max_steps, "max_steps"),
        max_step=None if max_step is None else positive(max_step, "max_step (s)"),
        history=None if history is None else bool(history),
        chart_interval=whole(chart_interval, "chart_interval"),
    )


def _method(integrator, rtol, atol, form):
    """Return the requested method."""
    method = frozen(method_of(integrator, rtol, atol))
    if (method.implicit and form.first_order) or (method.coupled and not form.basis_free):
        kinds = {name: kind for name, kind in registered().items() if not kind.coupled}
        others = ", ".join(repr(name) for name, kind in kinds.items() if not (kind.implicit and form.first_order))
        raise InvalidArgument(
            f"{type(method).__name__} solves its stages in the tangent-space form only; formulation={form.name!r} is "
            f"served by {others}."
        )
    return method
