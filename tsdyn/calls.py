"""Calls of public functions and classes: a wrong call is refused with the nearest match.

`fitting` wraps a function and costs nothing for a valid call; `Placing` is the descriptor of `.at`, which gives every
class its own signature.
"""

from __future__ import annotations

import inspect
from functools import wraps
from types import FunctionType, MethodType
from typing import TYPE_CHECKING, Any

from .errors import InvalidCall
from .validation import nearest

if TYPE_CHECKING:
    from collections.abc import Callable

    from .hints import Class, Function

PLACES = "places"  # the open parameter of an `__init__` that passes marker coordinates on
KEYWORD, OPEN = inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.VAR_KEYWORD
BY_POSITION = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)


def unknown_argument(title, name, known):
    """Return the error of an unknown keyword."""
    return InvalidCall(f"{title}() has no argument {name}{nearest(name, known)} It has {', '.join(known)}.")


def fitting(function: Function, then: Callable[[Any], None] | None = None) -> Function:
    """Wrap a public function, or an `__init__`: a call that doesn't fit its signature raises InvalidCall.

    `then` is called with an instance after the `__init__` of its own class.
    """

    @wraps(function)
    def call(*arguments, **keywords):
        try:
            if then is None:
                return function(*arguments, **keywords)
            function(*arguments, **keywords)
            if type(arguments[0]).__init__ is call:
                then(arguments[0])
            return None
        except TypeError as error:
            if isinstance(error, InvalidCall):
                raise
            title, known = function.__qualname__, inspect.signature(call)
            if function.__name__ == "__init__":
                title = getattr(arguments[0], "_kind", lambda: type(arguments[0]).__name__)()
            misfit = misfit_of(title, known, arguments, keywords)
            if misfit is None:
                raise
        raise misfit

    return call


def fitting_methods(cls: Class) -> Class:
    """Decorate a class: `fitting` for the public methods that it defines."""
    for name, value in list(vars(cls).items()):
        if isinstance(value, FunctionType) and not name.startswith("_") and not hasattr(value, "__wrapped__"):
            setattr(cls, name, fitting(value))
    return cls


def fitting_constructor(cls: Class) -> Class:
    """Decorate a dataclass: `fitting` for its `__init__`."""
    cls.__init__ = fitting(cls.__init__)
    return cls


def misfit_of(title, signature, arguments, keywords):
    """Return the InvalidCall of a call that doesn't fit a signature, or None."""
    try:
        signature.bind(*arguments, **keywords)
        return None
    except TypeError as error:
        reason = str(error)
    known = [p for p in signature.parameters.values() if p.name not in ("self", "cls") and p.kind != OPEN]
    names = [p.name for p in known]
    for name in keywords:
        if name not in names:
            return unknown_argument(title, name, names)
    places = [p.name for p in known if p.kind in BY_POSITION]
    given = len(arguments) - (len(places) < sum(p.kind in BY_POSITION for p in signature.parameters.values()))
    if given > len(places):
        others = ", ".join(f"{p.name}=" for p in known if p.kind == KEYWORD)
        first = f"takes {', '.join(places)} by position" if places else "takes nothing by position"
        return InvalidCall(f"{title}() {first}, got {given} arguments there; name the others: {others or 'none'}.")
    return InvalidCall(f"{title}(): {reason}. Its arguments are {', '.join(names)}.")


def complete_signature(cls):
    """Return the signature of a class; parameters passed on by **keywords are those of its bases.

    `**places` stands for the arguments that place the markers of the class, and for `name`.
    """
    signature = inspect.signature(cls.__init__)
    parameters = dict(signature.parameters)
    for base in cls.__mro__[1:]:
        opened = [name for name, p in parameters.items() if p.kind == OPEN]
        if not opened or opened[0] == PLACES:
            break
        if "__init__" in vars(base) and base is not object:
            del parameters[opened[0]]
            for name, p in inspect.signature(base.__init__).parameters.items():
                if p.kind in (KEYWORD, OPEN) and name != PLACES:
                    parameters.setdefault(name, p)
    if PLACES in parameters and cls.markers:
        del parameters[PLACES]
        placing = {marker.argument: marker.parameter() for marker in cls.markers if marker.placed}
        name = parameters.pop("name", inspect.Parameter("name", KEYWORD, default="", annotation="str"))
        own = {n: parameters.pop(n) for n in [*parameters] if parameters[n].kind == KEYWORD}
        parameters |= {**placing, **own, "name": name}
    order = sorted(parameters.values(), key=lambda p: p.kind)  # stable
    return signature.replace(parameters=order)


class Placing:
    """Decorate `at`: a classmethod with the arguments of the class that it is called on.

    A point or an axis is given once, as `point` for `point_a` and `point_b`, or by the name that it has on one body.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function, self._made = function, {}
        self.__doc__ = function.__doc__

    def __get__(self, instance: object, owner: type) -> Any:
        if owner not in self._made:
            self._made[owner] = self._of(owner)
        return MethodType(self._made[owner], owner)

    def _of(self, owner):
        @wraps(self.function)
        def at(cls, *arguments, **keywords):
            try:
                return self.function(cls, *arguments, **keywords)
            except TypeError:
                misfit = misfit_of(f"{cls._kind()}.at", at.__signature__, (cls, *arguments), keywords)
                if misfit is None:
                    raise
            raise misfit

        del at.__wrapped__
        at.__qualname__ = f"{owner.__qualname__}.at"
        at.__signature__ = self._signature(owner)
        return at

    def _signature(self, owner):
        own = inspect.signature(self.function).parameters
        whole = complete_signature(owner).parameters
        first = [inspect.Parameter("cls", BY_POSITION[1])]
        first += [p for name, p in whole.items() if name != "self" and p.kind in BY_POSITION]
        keywords = {name: p for name, p in own.items() if p.kind == KEYWORD}
        markers = [marker.argument for marker in owner.markers if marker.argument in whole]
        for name in markers:
            if name.endswith(("_a", "_b")) and name[:-2] not in whole:
                given = inspect.Parameter(name[:-2], KEYWORD, default=None, annotation=whole[name].annotation)
                keywords.setdefault(given.name, given)
        keywords |= {name: p for name, p in whole.items() if p.kind in (KEYWORD, OPEN) and name not in keywords}
        return inspect.Signature([*first, *sorted(keywords.values(), key=lambda p: p.kind)])
