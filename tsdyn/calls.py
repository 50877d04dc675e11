"""Calls of public functions and classes: a wrong one is refused with the nearest match; docstrings; discovery."""

from __future__ import annotations

import collections.abc
import inspect
import os
import pkgutil
import re
import sys
import types
import typing
from functools import cache, wraps
from importlib import import_module
from types import FunctionType, MethodType
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InvalidArgument, InvalidCall, TsdynError, UnknownAttribute
from .validation import close, floats, nearest, shown

if TYPE_CHECKING:
    from .hints import Callable, Class, Function, Iterable


# Names that other programs have for what tsdyn has under another name: hints of error messages.

CLASSES = {  # of constraints, forces and integrators, in small letters and without "joint"
    "hinge": "constraints.Revolute",
    "pin": "constraints.Revolute",
    "prismatic": "constraints.Translational",
    "slider": "constraints.Translational",
    "weld": "constraints.Fixed",
    "rigid": "constraints.Fixed",
    "ball": "constraints.Spherical",
    "ballandsocket": "constraints.Spherical",
    "cardan": "constraints.Universal",
    "helical": "constraints.Screw",
    "rod": "constraints.Distance",
    "motor": "constraints.RotationMotor",
    "pointonplane": "constraints.PlaneContact",
    "mimic": "constraints.Coupler",
    "cam": "constraints.Coupler",
    "differential": "constraints.Coupler",
    "jointequality": "constraints.Coupler",
    "damper": "forces.Spring, with damping=",
    "springdamper": "forces.Spring",
    "tsda": "forces.Spring",
    "linearspring": "forces.Spring",
    "rsda": "forces.TorsionalSpring",
    "torsionspring": "forces.TorsionalSpring",
    "force": "forces.PointForce",
    "actuator": "forces.JointTorque, ts.forces.JointForce or ts.forces.Control",
    "controller": "forces.Control",
    "friction": "forces.RevoluteFriction, ts.forces.TranslationalFriction or ts.forces.CoulombFriction",
    "gravity": "Scene(gravity=(0, 0, -9.81))",
    "rk4": "integrators.Nystrom4",
    "rungekutta4": "integrators.Nystrom4",
    "dopri5": "integrators.RK45",
    "bdf": "integrators.Radau",
    "radauiia": "integrators.Radau",
    "world": "Scene",
    "system": "Scene",
    "model": "Scene",
    "multibodyplant": "Scene",
    "rigidbody": "Scene().add_body(...)",
    "particle": "Scene().add_point_mass(...)",
    "simulation": "simulate(scene, t_span)",
    "solve": "simulate(scene, t_span)",
    "solve_ivp": "simulate(scene, t_span)",
    "run": "prepare(scene, ...), which returns a ts.Run, or ts.simulate(scene, t_span)",
}
PUBLIC = {name: name for name in ("Scene", "Solution", "Ensemble", "State")} | {"SceneState": "State"}  # and subclasses
RUNS = "simulate", "run", "solve"  # what a scene has in other programs
ATTRIBUTES = {  # of scenes, solutions, ensembles and states; what an object has of these is named
    "add_rigid_body": ("add_body(...)",),
    "add_particle": ("add_point_mass(...)",),
    "add_joint": ("add(joint)",),
    "add_constraint": ("add(constraint)",),
    "add_force": ("add(force)",),
    "joints": ("constraints", "scene.constraints"),
    "dof": ("mobility().degrees_of_freedom", "scene.mobility().degrees_of_freedom"),
    "bodies": ("scene.bodies",),
    "x": ("q", "position(body)", "case(i).position(body)"),
    "y": ("q", "qd"),
    "time": ("t",),
    "times": ("t",),
    "sol": ("at(t)",),
    "y_events": ("q_events", "qd_events"),
    "nfev": ("stats.evaluations",),
    "njev": ("stats.jacobians",),
    "position": ("case(i).position(body)",),
    "positions": ("q", "position(body)", "case(i).position(body)"),
    "pos": ("q", "position(body)", "case(i).position(body)"),
    "v": ("qd", "velocity(body)"),
    "vel": ("qd", "velocity(body)"),
    "velocity": ("qd", "case(i).velocity(body)"),
    "velocities": ("qd", "velocity(body)"),
    "a": ("qdd", "acceleration(body)"),
    "acc": ("qdd", "acceleration(body)"),
    "accelerations": ("qdd", "acceleration(body)"),
    "dq": ("qd",),
    "qdot": ("qd",),
    "ddq": ("qdd",),
    "qddot": ("qdd",),
    "quaternion": ("orientation(body)",),
    "omega": ("angular_velocity(body)",),
    "lam": ("multipliers",),
    "lambda_": ("multipliers",),
    "forces": ("reaction(item)",),
    "reactions": ("reaction(item)",),
    "errors": ("constraint_error",),
    "animate": ("view()",),
    "to_pandas": ("to_dataframe()",),
}
ARGUMENTS = {
    "method": "integrator",
    "solver": "integrator",
    "t_end": "t_span",
    "tspan": "t_span",
    "tol": "rtol",
    "k": "stiffness",
    "c": "damping",
    "d": "damping",
    "l0": "free_length",
    "rest_length": "free_length",
    "m": "mass",
    "J": "inertia",
    "I": "inertia",
    "pos": "position",
    "quat": "orientation",
    "rotation": "orientation",
    "omega": "angular_velocity",
    "mu": "kinetic",
    "friction": "kinetic",
}


ELSEWHERE = {}  # of calls by their title: arguments that another call takes, and which; entered where both are known


def hint(where, name, known):
    """Return the end of a sentence on a name that is not in ts, or in a module of it: what may have been meant."""
    plain = name.lower().replace("_", "") if name.lower() not in CLASSES else name.lower()
    found = CLASSES.get(plain.removesuffix("joint").removesuffix("constraint") or plain)
    if found is not None:
        return f"; here it is ts.{found}."
    near = close(name, known)
    return f"; did you mean {' or '.join(f'{where}.{word}' for word in near)}?" if near else f"; see dir({where})."


def _kind(owner):
    """The name of an object's class, as users know it."""
    kinds = [cls.__name__ for cls in type(owner).__mro__]
    return next((PUBLIC[kind] for kind in kinds if kind in PUBLIC), kinds[0])


def _method(owner, function):
    """The name by which a class, or a base of it, has a function as a method, decorated or not; None if it hasn't."""
    held = (item for cls in owner.__mro__ for item in vars(cls).items())
    return next((name for name, value in held if inspect.unwrap(value, stop=lambda f: f is function) is function), None)


def lacking(owner, name):
    """Return the error of an attribute that an object of ours lacks, for `__getattr__`.

    Raises the own error of a property that has failed: Python asks `__getattr__` then, too.
    """
    kinds, kind = type(owner).__mro__, _kind(owner)
    said = f"{kind!r} object has no attribute {name!r}"
    if name.startswith("_"):  # of a protocol
        return AttributeError(said)
    if hasattr(kinds[0], name):
        return object.__getattribute__(owner, name)
    known = {*dir(owner), *(word for cls in kinds for word in inspect.get_annotations(cls))}
    here = [f"{kind.lower()}.{word}" for word in ATTRIBUTES.get(name, ()) if re.match(r"\w+", word)[0] in known]
    if kind == "Scene" and name in RUNS:
        here = ["ts.simulate(scene, t_span)"]
    near = nearest(name, [word for word in known if not word.startswith("_")])
    near = f"; see dir({kind.lower()})." if near == "." else near
    return UnknownAttribute(said + (f"; here it is {' or '.join(here)}." if here else near))


def argument(name, known):
    """Return what an argument is called here, or None."""
    here = ARGUMENTS.get(name)
    return here if here in known else None


def line_of_user() -> int:
    """Return the `stacklevel` with which a warning of the caller names the line of the user's file."""
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and frame.f_globals.get("__name__", "").split(".")[0] == __package__:
        frame, level = frame.f_back, level + 1
    return level


# Calls of public functions and classes: a wrong call is refused with the nearest match.
#
# `fitting` wraps a function and costs nothing for a valid call: a call is compared with its signature, and its
# arguments with their annotations, once it has raised what is no TsdynError. `Placing` is the descriptor of `.at`,
# which gives every class its own signature.

PLACES = "places"  # the open parameter of an `__init__` that passes marker coordinates on
KEYWORD, OPEN = inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.VAR_KEYWORD
BY_POSITION = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)


def unknown_argument(title, name, known):
    """Return the error of an unknown keyword."""
    here = argument(name, known)
    said = f"; here it is {here}=." if here else nearest(name, known)
    if {f"{name}_a", f"{name}_b", "a", "b"} <= {*known}:
        said = f"; {title}.at(a, b, {name}=...) takes one for both bodies, in the ground frame."
    if name in ELSEWHERE.get(title, ()):
        said = f"; it is given to {ELSEWHERE[title][name]}."
    return InvalidCall(f"{title}() has no argument {name}{said} It has {', '.join(known)}.")


def fitting(function: Function, then: Callable[[Any], None] | None = None) -> Function:
    """Wrap a public function, or an `__init__`: a call that doesn't fit its signature raises InvalidCall.

    An argument of another kind than its annotation says raises InvalidArgument. `then` is called with an instance after
    the `__init__` of its own class. Of a class with `_made_by`, the call that makes its instances is named.
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
        except TsdynError:
            raise
        except Exception:
            title, known = function.__qualname__.removesuffix(".__new__"), inspect.signature(call)
            if function.__name__ == "__init__":
                title = getattr(arguments[0], "_kind", lambda: type(arguments[0]).__name__)()
            elif arguments and (method := _method(type(arguments[0]), call)):
                title = f"{_kind(arguments[0])}.{method}"
                known = known.replace(parameters=list(known.parameters.values())[1:])
                arguments = arguments[1:]
            misfit = misfit_of(title, known, arguments, keywords) or _unfit(title, function, known, arguments, keywords)
            made_by = getattr(arguments[0], "_made_by", None) if function.__name__ == "__init__" else None
            if misfit is not None and made_by:
                misfit = InvalidCall(f"{title}: make one by {made_by}, not by a call of the class.")
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


class Numbers:
    """Stands for ArrayLike: real numbers in an array, or what NumPy makes one of."""


class FilePath:
    """Stands for Place: the path of a file."""


LONGEST = 255  # bytes of a part of a path, in most file systems
WORDS = {
    Numbers: "numbers",
    FilePath: "the path of a file (parts of at most 255 bytes)",
    bool: "True or False",
    int: "a whole number",
    float: "a number",
    str: "text",
    type(None): "None",
}


def _unfit(title, owner, signature, arguments, keywords):
    """Return the InvalidArgument of the first argument that isn't what its annotation says, or None."""
    given = signature.bind(*arguments, **keywords).arguments
    for name, value in given.items():
        if signature.parameters[name].kind in (OPEN, inspect.Parameter.VAR_POSITIONAL):
            continue
        hint = _hint(owner.__module__, signature.parameters[name].annotation)
        if name not in ("self", "cls") and hint is not None and not _fits(value, hint):
            return InvalidArgument(f"{title}(): {name} must be {_words(hint)}, got {shown(value)}.")
    return None


@cache
def _hint(module, annotation):
    """Return the type that an annotation of a module names; None if it isn't known."""
    if not isinstance(annotation, str):
        return None
    hints = vars(import_module(".hints", __package__))  # by name: all of tsdyn stands below it
    try:
        known = {
            **vars(collections.abc),
            **vars(sys.modules[module]),
            **hints,
            "ArrayLike": Numbers,
            "Floats": Numbers,
            "Place": FilePath,
        }
        return eval(annotation, known)  # the source's own, as typing.get_type_hints evaluates it
    except (KeyError, NameError, TypeError, AttributeError):
        return None


def _fits(value, hint):
    """Whether a value is of a type; True where that isn't known."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return any(_fits(value, part) for part in parts)
    if origin is typing.Literal:
        return isinstance(value, str) and value in parts
    if origin is type:
        return isinstance(value, type)
    if hint in (Numbers, float):
        numbers = floats(value)
        return numbers.shape == () if hint is float else bool(numbers.size)
    if hint is FilePath:
        return _is_path(value)
    if hint is int:
        return isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if hint is bool:
        return isinstance(value, (bool, np.bool_))
    if origin is collections.abc.Sequence:
        return not isinstance(value, str) and isinstance(value, origin)
    if origin in (collections.abc.Callable, collections.abc.Mapping):
        return isinstance(value, origin)
    closed = isinstance(hint, type) and hint is not Any and not getattr(hint, "_is_protocol", False)
    return isinstance(value, hint) if closed else True


def _is_path(value):
    if not isinstance(value, (str, os.PathLike)):
        return False
    path = os.fspath(value)
    return bool(path) and "\0" not in path and all(len(os.fsencode(part)) <= LONGEST for part in path.split(os.sep))


def _words(hint):
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(dict.fromkeys(map(_words, parts)))
    if origin is typing.Literal:
        return " or ".join(map(repr, parts))
    if hint in WORDS:
        return WORDS[hint]
    kind = getattr(origin or hint, "__name__", str(hint))
    known = {"Callable": "a function", "Mapping": "a mapping", "Sequence": "a sequence", "type": "a class"}
    return known.get(kind, f"{'an' if kind[0] in 'AEIOU' else 'a'} {kind}")


def complete_signature(cls):
    """Return the signature of a class; parameters passed on by **keywords are those of its bases.

    `**places` stands for the arguments that place the markers of the class, and for `name`.
    """
    signature = inspect.signature(inspect.unwrap(cls.__init__))  # an inherited one has that of the base by now
    parameters = dict(signature.parameters)
    if parameters.pop("coordinates", None) and cls.markers:  # the base's own: the class has no `__init__`
        del parameters["name"]
        if any(marker.body == "b" for marker in cls.markers):
            parameters["b"] = parameters["b"].replace(default=inspect.Parameter.empty, annotation="BodyLike")
        else:
            del parameters["b"]
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
            except Exception as error:
                if isinstance(error, TsdynError) and not isinstance(error, InvalidCall):
                    raise
                title, whole, known = f"{cls._kind()}.at", (cls, *arguments), at.__signature__
                misfit = misfit_of(title, known, whole, keywords)
                if misfit is None and not isinstance(error, TsdynError):
                    misfit = _unfit(title, owner, known, whole, keywords)
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


# Docstrings of public classes, completed from their bases: an argument is described once, where it belongs.
#
# A class describes the arguments that are its own. Descriptions of the others, and of the errors raised, come from the
# docstrings of its bases; arguments that place markers are described by their markers.

SECTION = re.compile(r"^(\w+)\n-+\n", flags=re.MULTILINE)


def complete_docstring(cls: type, standard: Iterable[str] = (), raises: str = "") -> None:
    """Complete the sections Parameters and Raises of a class that has a docstring of its own.

    `standard` has further entries of Parameters, `raises` is the section Raises of a class none of whose bases has one.
    """
    if not vars(cls).get("__doc__"):
        return
    head, sections = _split(cls.__doc__)
    bases = [_split(base.__doc__ or "")[1] for base in cls.__mro__[1:]]
    entries = [entry for known in (sections, *bases) for entry in _entries(known.get("Parameters", ""))]
    parameters = "\n".join(_in_order([*entries, *standard], inspect.signature(cls.__init__).parameters))
    raises = next((known["Raises"] for known in (sections, *bases) if "Raises" in known), raises)
    first = {"Parameters": parameters, "Raises": raises}
    sections = first | {title: text for title, text in sections.items() if title not in first}
    shown = [f"{title}\n{'-' * len(title)}\n{text}" for title, text in sections.items() if text]
    cls.__doc__ = "\n\n".join([head, *shown])


def entries_of(texts: Iterable[str], arguments: Iterable[str]) -> list[str]:
    """The entries of arguments, in order, in the sections Parameters of some docstrings."""
    entries = [entry for text in texts for entry in _entries(_split(text)[1]["Parameters"])]
    return _in_order(entries, list(arguments))


@cache  # a base is asked by each of its subclasses, at import
def _split(text: str) -> tuple[str, dict[str, str]]:
    """Return the text before the first section, and the sections by title."""
    head, *parts = SECTION.split(inspect.cleandoc(text))
    titles, bodies = parts[::2], parts[1::2]
    return head.strip(), {title: body.strip() for title, body in zip(titles, bodies, strict=True)}


def _entries(section: str) -> list[str]:
    """Return the entries of a section: a line of names, with the indented lines after it."""
    return [entry for entry in re.split(r"\n(?=\S)", section) if entry]


def _in_order(entries: list[str], arguments: Iterable[str]) -> list[str]:
    """Return the first entry of each argument, in order, without repetition; entries of other names are left out."""
    named = [(entry, re.findall(r"\w+", entry.split("\n")[0].split(" :")[0])) for entry in entries]
    found = []
    for argument in arguments:
        naming = [entry for entry, names in named if argument in names and {*names} <= {*arguments}]
        found += [entry for entry in naming[:1] if entry not in found]
    return found


# Import every module of a folder and export the public classes that it defines.


def export_all(package, path, namespace, *bases):
    """Put into `namespace` each class of the package's modules that descends from a class named in `bases`."""
    names = []
    for module in pkgutil.iter_modules(path):
        content = import_module(f"{package}.{module.name}")
        for name, value in vars(content).items():
            own = isinstance(value, type) and value.__module__ == content.__name__ and not name.startswith("_")
            if own and any(ancestor.__name__ in bases for ancestor in value.__mro__[1:]):
                namespace[name] = value
                names.append(name)
    return names


def refusing(where, known, *inner):
    """Make the `__getattr__` of a module: what is missing is refused with what may have been meant, also of `inner`."""

    def __getattr__(name):
        if name.startswith("_"):
            raise AttributeError(f"{where} has no {name}")
        for module in inner:
            if name in module.__all__:
                raise UnknownAttribute(
                    f"{where} has no {name}; here it is {where}.{module.__name__.split('.')[-1]}.{name}."
                )
        raise UnknownAttribute(f"{where} has no {name}{hint(where, name, known)}")

    return __getattr__


def listing(known, kind, example):
    """Make the public function that returns every class of a kind; `known` returns them by name."""

    def registered():
        return tuple(known().values())

    registered.__annotations__["return"] = f"tuple[type[{kind}], ...]"
    registered.__doc__ = f"""Return every class of {kind} known, built in or plugged in.

    Examples
    --------
    >>> import tsdyn as ts
    >>> {example}
    True
    """
    return registered
