"""The options of a run, each once: default, unit, check, and what it means.

`RunOptions` has what belongs to a `Run`, `RunCall` what each call of it gives. Tables of scene files, the JSON
Schema, the command line, ensembles and docstrings are derived from these two; a test holds the signatures of `simulate`
and `prepare` equal to them.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import entries_of, fitting_constructor
from ..errors import InvalidArgument
from ..formulations.registry import formulation as find_formulation
from ..methods.integrator import registered
from ..runs.events import prepare
from ..runs.task import interval, method_of, output_times
from ..validation import one_of, positive, whole

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ..hints import (
        ArrayLike,
        Event,
        Formulation,
        Function,
        ImpactLaw,
        Integrator,
        Method,
        Place,
        Progress,
        Redundancy,
        Span,
        State,
    )


def _positive(value, name):
    return value if type(value) is float and 0.0 < value < math.inf else positive(value, name)


def _seconds(value, name):
    return positive(value, f"{name} (s)")


def _flag(value, name):
    if not isinstance(value, (bool, np.bool_)):
        raise InvalidArgument(f"{name} must be True or False, got {value!r}.")
    return bool(value)


def _form(value, name):
    return find_formulation(value).name


def _choice(value, name):
    return one_of(value, ("drop", "refuse"), name)


def _law(value, name):
    return one_of(value, LAWS, name)


def _events(value, name):
    prepare(value)
    return value if callable(value) else tuple(value)


def _any(value, name):
    return value


CHECKS = {  # of values that are not the default; each returns the value as it is kept
    "integrator": _any,
    "rtol": _positive,
    "atol": _positive,
    "formulation": _form,
    "constraint_tol": _positive,
    "initial_tol": _positive,
    "redundancy": _choice,
    "dense_output": _flag,
    "events": _events,
    "max_steps": whole,
    "max_step": _seconds,
    "history": _flag,
    "chart_interval": whole,
    "law": _law,
}
LAWS = "newton", "poisson"  # of impact


@fitting_constructor
@dataclass(frozen=True, repr=False)
class RunOptions:
    """The options of a run; not to be changed. Two are equal if they ask for the same.

    Parameters
    ----------
    integrator : Integrator or str, optional
        A method, or its name ("nystrom4", "rk45", "dop853", "taylor", ...). By default Taylor; DOP853 if a part of the
        scene has no series, or series fail where a law is not analytic. Where the motion is found stiff Radau (SDIRK54
        in the null-space form) goes on from there, as long as it needs less work; `solution.message` says so.
    rtol, atol : float, optional
        Tolerances of the default method, or of an adaptive method given by name; default 1e-8. An instance has its own
        tolerances; rtol or atol beside an instance is refused.
    formulation : {"tangent", "null-space", "maggi-kane"}
        "tangent": the tangent-space ODE without a basis, in O(N) for chains and trees; "null-space": Eq. 26, as in the
        paper; "maggi-kane": Eqs. 17-18, the baseline that drifts off the constraints. Implicit methods work in
        either of the first two, with dense matrices in the second.
    constraint_tol : float
        u_tol and B_tol of Eqs. 28-29: bound on |Phi| (m) and on |Phi_q U B - I|.
    initial_tol : float
        Largest residual of a start, relative to 1 + max |q| or 1 + max |qd|, that is accepted; the start is then
        projected onto the constraints.
    redundancy : {"drop", "refuse"}
        Treatment of redundant constraint rows: "drop" removes them from the equations if they hold wherever the others
        hold (the selection is renewed when the kept rows come close to dependence); "refuse" raises
        RedundantConstraints.
    dense_output : bool
        Keep the interpolant of every step, for `solution.at(t)` at any time.
    events : callable or list of callables, optional
        f(t, state) -> float with a `State`. All zeros inside every step are located on the manifold and recorded in
        `solution.t_events`: sign changes, and touches of zero within rounding, which count once. Events never change
        the steps. As for scipy.integrate.solve_ivp, an attribute `direction` > 0 or < 0 selects rising or falling
        zeros, and `terminal` = True, or a number of occurrences, ends the run. An attribute `action`, a function of a
        `Change`, changes the scene at each occurrence: parts come and go, parameters are set, bodies are hit. A
        function that raises, or returns no finite number, ends the run with success=False.
    max_steps : int, optional
        Largest number of steps; the run ends there.
    max_step : float, s, optional
        Longest step, for every method; a longer fixed step is reduced to it. Changes of functions of time within a
        thousandth of t_span are found without it; for shorter ones give half of their duration.
    history : bool, optional
        Keep `solution.steps` and `solution.charts`: 8 bytes per step, 16 to 40 more per rejected step and chart. By
        default they are kept, but for runs with a store, whose histories go to the store if they are asked for.
    chart_interval : int, optional
        Number of steps after which a new chart is made regardless of the criteria; for experiments. If it is given,
        explicit methods place every stage on the manifold in the tangent form, too, as the paper does.
    law : {"newton", "poisson"}
        Law of impact of unilateral constraints. "newton", in Moreau's form: gd+ = -e gd- where a contact pushes.
        "poisson": the impulse of restitution is e times that of compression. They differ where several contacts are
        hit at once.

    Attributes
    ----------
    method : Integrator or None
        The method that integrator, rtol and atol ask for, as it was then; None for the default one.

    Raises
    ------
    InvalidArgument
        If one of them is inadmissible.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.RunOptions(rtol=1e-10, dense_output=True)
    RunOptions(rtol=1e-10, dense_output=True)
    """

    integrator: Method | None = None
    rtol: float | None = None
    atol: float | None = None
    formulation: Formulation = "tangent"
    constraint_tol: float = 1e-12
    initial_tol: float = 1e-9
    redundancy: Redundancy = "drop"
    dense_output: bool = False
    events: Event | Sequence[Event] | None = None
    max_steps: int | None = None
    max_step: float | None = None
    history: bool | None = None
    chart_interval: int | None = None
    law: ImpactLaw = "newton"
    method: Integrator | None = field(init=False)

    def __post_init__(self) -> None:
        """Check what isn't a default, and find the method."""
        put, given = object.__setattr__, vars(self)
        for name, default, check in _NOT_DEFAULT:
            if given[name] is not default:
                put(self, name, check(given[name], name))
        method = None
        if self.integrator is not None:
            method = method_of(self.integrator, self.rtol, self.atol)
            _demand_served(method, self.form)
            if not isinstance(self.integrator, str):
                put(self, "integrator", method)
        put(self, "method", method)

    @property
    def form(self) -> Any:
        """The formulation, as the solver knows it."""
        return find_formulation(self.formulation)

    @property
    def may_use_series(self) -> bool:
        """Whether the default method may be Taylor."""
        return self.formulation == "tangent" and self.chart_interval is None

    @property
    def acts(self) -> bool:
        """Whether an event has an action."""
        events = self.events if isinstance(self.events, tuple) else (self.events,)
        return any(getattr(event, "action", None) is not None for event in events)

    def __repr__(self) -> str:
        given = [f"{name}={vars(self)[name]!r}" for name, default in OF_RUN.items() if vars(self)[name] != default]
        return f"RunOptions({', '.join(given)})"


@dataclass(slots=True)
class RunCall:
    """What each call of a run gives: the arguments as they are given.

    Parameters
    ----------
    t_span : (float, float), s
        Start and end, start < end.
    t_eval : array_like, s, optional
        Increasing output times within t_span, from dense output on the manifold; they never change the steps. None
        gives every accepted step and both ends.
    store : str or PathLike, optional
        Stream the outputs to a file while the run goes on, in constant memory; by its suffix Zarr (.zarr) or HDF5 (.h5,
        .hdf5, .nc), with dimensions, coordinates and units as xarray reads them (needs `tsdyn[data]`). The solution
        reads from it.
    checkpoint : float, s, optional
        With a store: write a state at least so often, in real time, from which `resume(store)` goes on to the bit.
    progress : bool or callable, optional
        True shows a bar (needs tqdm); a callable receives the fraction done, 0 to 1. An exception that it raises ends
        the run with a RuntimeWarning that shows its traceback; the solution so far is returned.
    state : State, optional
        Positions and velocities to start from instead of those of the bodies, such as `solution.state`.
    """

    t_span: Span
    t_eval: ArrayLike | None = None
    store: Place | None = None
    checkpoint: float | None = None
    progress: Progress | None = None
    state: State | None = None


OF_RUN = {option.name: option.default for option in fields(RunOptions) if option.init}
OF_CALL = {option.name: option.default for option in fields(RunCall) if option.name != "t_span"}
OPTIONS = OF_RUN | OF_CALL  # of `simulate`: defaults by name
_NOT_DEFAULT = [(name, OF_RUN[name], check) for name, check in CHECKS.items()]


def by_name(options: RunOptions, call: RunCall) -> dict[str, Any]:
    """The arguments of `simulate` but for the scene, by name."""
    return {name: getattr(options, name) for name in OF_RUN} | {
        name: getattr(call, name) for name in ("t_span", *OF_CALL)
    }


def from_names(given: dict[str, Any]) -> tuple[RunOptions, RunCall]:
    """The options and the call that arguments of `simulate`, by name, ask for; raises InvalidArgument."""
    options = {name: value for name, value in given.items() if name in OF_RUN}
    return RunOptions(**options), RunCall(**{name: value for name, value in given.items() if name not in OF_RUN})


def demand_arguments_of_file(given: dict[str, Any]) -> None:
    """Raise InvalidArgument unless arguments of a file, without functions, are such as `simulate` takes."""
    named = "dop853" if given["integrator"] is None else given["integrator"]  # the tolerances are checked with it
    _, call = from_names({**given, "integrator": named, "events": None})
    output_times(call.t_eval, *interval(call.t_span))


def documented(*names: str) -> Callable[[Function], Function]:
    """Decorate a function: put the entries of these options, by default all, where its docstring has {options}."""

    def decorate(thing):
        if thing.__doc__ is not None:  # as it is under python -OO
            indent = re.search("( *){options}", thing.__doc__)[1]
            text = "\n".join(entries_of((RunOptions.__doc__, RunCall.__doc__), names or OPTIONS))
            thing.__doc__ = thing.__doc__.replace("{options}", text.replace("\n", f"\n{indent}"))
        return thing

    return decorate


def _serves(method, form):
    """Whether a method, or a class of methods, runs scenes in a form."""
    if method.coupled or method.driver == "series":
        return form.basis_free
    return not (method.implicit and form.first_order)


def _demand_served(method, form):
    """Refuse a method that runs scenes in another form only."""
    if not _serves(method, form):
        others = ", ".join(repr(name) for name, kind in registered().items() if _serves(kind, form))
        why = f"{type(method).__name__} solves its stages in the tangent and the null-space form only"
        if method.coupled:
            why = f"{type(method).__name__} solves its stages all at once, by sparse matrices of the tangent form only"
        if method.driver == "series":
            why = "Taylor series are of the motion itself and need no other form than 'tangent'"
        raise InvalidArgument(f"{why}; formulation={form.name!r} is served by {others}.")
