"""What `simulate` was asked, as numbers and arrays: what a checkpoint begins with. Functions and code are left out."""

from __future__ import annotations

import inspect
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InvalidArgument
from ..jit.code_hash import is_ours
from ..methods.integrator import is_own, registered
from ..observables.kinematics import Anchor
from ..observables.state import RememberingState, State, remembered
from ..runs.arguments import state_arrays
from .outlines import outline_of
from .scene_cache import prepared

if TYPE_CHECKING:
    from ..hints import Scene

PASSED_AGAIN = ("events", "progress")  # arguments that are functions
OWN = ("scene", "store", "checkpoint", "state", "integrator", *PASSED_AGAIN)  # arguments that are kept apart
STATE = "q", "qd", "qdd", "multipliers", "memory", "angles"


def request_of(given: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Numbers (for JSON) and arrays of the arguments of a run, and its scene where a file can hold that.

    Raises
    ------
    InvalidArgument
        If the method is one of the user's own.
    """
    from ..files import scene_text  # takes a while to import

    scene, method, state = given["scene"], given["integrator"], given["state"]
    rest = {name: np.asarray(value).tolist() if value is not None else None
            for name, value in given.items() if name not in OWN}  # fmt: skip
    numbers = {"options": json.loads(json.dumps(rest)), "method": method, "lacks": ""}
    arrays = {}
    if method is not None and not isinstance(method, str):
        try:
            numbers["method"] = method_record(method() if isinstance(method, type) else method)
        except TypeError as error:
            raise InvalidArgument(
                f"a run by a method of your own can't go on from a file, which keeps no code: {error}."
            ) from None
    if state is not None:
        q, qd = state_arrays(state, scene._initial()[0].size)
        found = {"q": q, "qd": qd} | {name: getattr(state, name, None) for name in STATE[2:5]}
        found["angles"] = state.angles if getattr(state, "anchor", None) is not None else None
        arrays |= {f"state.{name}": np.asarray(array, float) for name, array in found.items() if array is not None}
        numbers["t"] = float(getattr(state, "t", given["t_span"][0]))
    foreign = {type(item) for item in (*scene._added, *scene.forces) if not is_ours(type(item).__module__)}
    numbers["lacks"] = ", ".join(sorted(f"{kind.__module__}.{kind.__qualname__}" for kind in foreign))
    if not foreign:
        try:
            arrays["scene"] = np.frombuffer(scene_text.write(scene, type(scene)).encode(), np.uint8)
        except InvalidArgument as error:
            numbers["lacks"] = str(error)
    if "scene" not in arrays:
        found, text = outline_of(scene, prepared(scene).packed)
        numbers, arrays = numbers | found, arrays | text
    return numbers, arrays


def arguments_of(numbers: dict[str, Any], arrays: dict[str, Any], scene: Scene) -> dict[str, Any]:
    """The arguments of `simulate` for a scene, by name; KeyError, TypeError or ValueError where they are none."""
    method = numbers["method"]
    given = {**numbers["options"], "state": None}
    given["integrator"] = method if method is None or isinstance(method, str) else method_of(method)
    found = {name: arrays.get(f"state.{name}") for name in STATE}
    if found["q"] is not None:
        nothing = np.empty(0)
        q, qd, qdd, lam = (nothing if found[name] is None else found[name] for name in STATE[:4])
        parts = numbers["t"], q, qd, qdd, lam
        anchor, kept = None if found["angles"] is None else Anchor(found["angles"]), prepared(scene)
        bare = found["memory"] is None and anchor is None
        state = State(*parts) if bare else RememberingState.of(kept.handles, found["memory"], anchor, *parts)
        given["state"], start = state, state_arrays(state, kept.n)
        remembered(state, kept, float(numbers["t"]), start[0])
    return given


def method_record(method: Any) -> list[Any]:
    """The class and the settings of a method; raises TypeError for one that numbers don't tell."""
    if not isinstance(method, tuple(registered().values())) or not is_own(type(method)) or "driver" in vars(method):
        raise TypeError(f"{type(method).__module__}.{type(method).__qualname__}")
    return own_record(method)


def own_record(method: Any) -> list[Any]:
    """As `method_record`, of any registered class."""
    settings = {name: value.item() if isinstance(value, np.generic) else value for name, value in vars(method).items()}
    if not all(value is None or isinstance(value, (bool, int, float, str)) for value in settings.values()):
        raise TypeError(f"the settings of {method!r} are not numbers")
    return [type(method).__name__.lower().replace("_", ""), settings]


def method_of(record: list[Any]) -> Any:
    """The method of a record: made by its class, which checks its settings.

    Raises
    ------
    KeyError
        If it is a plug-in that isn't known here.
    ValueError
        If the class makes another method of the settings.
    """
    name, settings = record
    kind = registered()[name]
    if not is_own(kind):  # what the arguments of its constructor are, its author alone knows
        method = kind.__new__(kind)
        vars(method).update(settings)
        return method
    known = {name: settings[name] for name in inspect.signature(kind).parameters if name in settings}
    if "fixed" in settings:
        known["order"] = settings["fixed"]
    method = kind(**known)
    for name, value in settings.items():
        if name not in vars(method) and type(getattr(kind, name)) is type(value) is float:
            setattr(method, name, value)
    if vars(method) != settings:
        raise ValueError(f"{kind.__name__} has no such settings")
    return method
