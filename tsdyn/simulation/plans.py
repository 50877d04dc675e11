"""Plans of earlier calls of `simulate`, by the values and types of their arguments.

They belong to a packed scene (`scene_cache.Prepared`) and are gone after any change of it. An object that can change is
never taken for what it was: a method is told by its attributes, times and states by their numbers.
"""

from __future__ import annotations

from functools import wraps
from inspect import unwrap
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from ..errors import TsdynError
from ..methods.integrator import is_plain
from ..runs.arguments import kind_named
from .plan import Plan, Unfinished
from .scene import Scene

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..hints import Function

MOST = 16  # plans of a scene
_values = itemgetter(
    "rtol", "atol", "formulation", "constraint_tol", "initial_tol", "redundancy", "dense_output", "events", "max_steps",
    "max_step", "history", "store", "checkpoint", "progress", "chart_interval",
)  # fmt: skip


def planned(go_on: Callable[..., Any]) -> Callable[[Function], Function]:
    """Decorate `simulate`: a call with the arguments of an earlier one is run by its plan.

    `go_on(given, unfinished)` completes a run that is longer than its first slice.
    """

    def decorate(function):
        defaults = unwrap(function).__kwdefaults__

        @wraps(function)
        def call(*arguments, **keywords):
            found = None
            if 0 < len(arguments) < 3 and isinstance(arguments[0], Scene):
                given = {**defaults, **keywords}
                t_span = arguments[1] if len(arguments) == 2 else given.pop("t_span", None)
                if len(given) == len(defaults):
                    found = _run(arguments[0], t_span, given)
            if found is None:
                return function(*arguments, **keywords)
            if type(found) is Unfinished:
                return go_on({"scene": arguments[0], "t_span": t_span, **given}, found)
            return found

        return call

    return decorate


def _run(scene, t_span, given):
    """As of `Plan.run`; None also where there is no plan."""
    if scene._waiting or given["events"] is not None or given["store"] is not None:
        return None
    if scene._users:
        scene.refresh()
    kept = scene._prepared
    if kept is None or not kept.plans:
        return None
    try:
        plan = kept.plans.get(_key(given))
        return plan.run(scene, t_span, given["t_eval"], given["state"]) if plan is not None and plan.serves else None
    except (TsdynError, TypeError):  # the ordinary way says what is wrong
        return None


def _key(given):
    """What tells a call from others, its times and state aside; TypeError if an argument may change unseen."""
    values = _values(given)
    return _key_of(given["integrator"]), values, (*map(type, values),)


def _key_of(method):
    if method is None:
        return None
    if type(method) is str:
        return method, kind_named(method)
    known = vars(method)
    values = (*known.values(),)
    return type(method), (*known,), values, (*map(type, values),)


def keep(given, task, kind, options, solution):
    """Keep the plan of a call whose run has ended well within its first slice."""
    if not is_plain(task.method) or isinstance(given["integrator"], type):
        return
    try:
        kept, key = task.prepared, _key(given)
        plan = kept.plans.get(key)
    except TypeError:
        return
    if plan is None or not plan.serves:
        plan = Plan(task, kind, options, solution)
        others = [*kept.plans.items()][-MOST + 1 :]
        kept.plans = {**dict(others), key: plan}  # and not written to: other threads may be reading
    plan.learn(options.within)
