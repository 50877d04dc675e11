"""The types that a scene file may name, by the registries that plug-ins use; their arguments, by signature."""

import inspect
import sys
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

from .. import shapes
from ..constraints.euler_normalization import EulerNormalization
from ..elements import force, joint, primitive
from ..elements.bodies import Body, PointMass
from ..elements.element import Attachment
from ..validation import close
from . import values
from .expressions import Misread

BODIES, OWN = ("a", "b"), ("name", "self", "scene")
BUILT_IN = ("tsdyn.constraints.", "tsdyn.forces.")
SHAPES = {name: getattr(shapes, name) for name in ("box", "sphere", "cylinder", "rod", "from_mesh")}
BODY_TYPES = {"Body": "add_body", "PointMass": "add_point_mass"}  # by the methods of a scene
ENUMERATIONS = {  # by the aliases of hints.py
    "Frame": ("ground", "body"),
    "Folds": ("keep", "free"),
    "Axis": ("x", "y", "z"),
    "Formulation": ("tangent", "null-space", "maggi-kane"),
    "Redundancy": ("drop", "refuse"),
}

NUMBER, WHOLE, FLAG, TEXT, ARRAY, MOTION, VECTOR, FUNCTION, REFERENCE, NAMES, ANY = (
    "number", "integer", "boolean", "text", "array", "motion", "vector", "function", "reference", "names", "any",
)  # fmt: skip
KINDS = {
    "float": NUMBER,
    "int": WHOLE,
    "bool": FLAG,
    "str": TEXT,
    "ArrayLike": ARRAY,
    "Floats": ARRAY,
    "Orientation": ARRAY,
    "Prescribed": MOTION,
    "Load": MOTION,
    "VectorLoad": VECTOR,
    "Path": VECTOR,
    "JointLaw": FUNCTION,
}


class Argument(NamedTuple):
    """An argument of a class or method, as its signature describes it."""

    name: str
    kind: str
    options: tuple  # of a text
    required: bool
    default: Any
    place: bool  # whether it places a marker

    def decode(self, value, names):
        """The value of plain data; raises `Misread`."""
        return _DECODERS[self.kind](value, names, self)


def arguments_of(function, markers=()):
    """The `Argument`s of a class or a method of a scene, by name; bodies and the name are left out."""
    placing, found = {marker.argument for marker in markers}, {}
    for name, parameter in inspect.signature(function).parameters.items():
        if name in (*BODIES, *OWN) or parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            continue
        kind, options = _kind_of(parameter)
        required, default = parameter.default is parameter.empty, parameter.default
        found[name] = Argument(name, kind, options, required, None if required else default, name in placing)
    return found


def _kind_of(parameter):
    """The kind of an argument, and the options of a text, by its annotation; else by how it is passed."""
    annotation = parameter.annotation
    words = annotation if isinstance(annotation, str) else getattr(annotation, "__name__", str(annotation))
    word = next(iter(part for part in words.split(" | ") if part != "None"), "")
    if word in ENUMERATIONS:
        return TEXT, ENUMERATIONS[word]
    if word in KINDS:
        return KINDS[word], ()
    if word.startswith("Callable"):
        return FUNCTION, ()
    if word.startswith("Sequence"):
        return NAMES, ()
    if parameter.kind is not parameter.KEYWORD_ONLY:
        return REFERENCE, ()
    return TEXT if isinstance(parameter.default, str) else ANY, ()


@cache
def of_class(cls):
    """The arguments of a class of constraints or forces."""
    return arguments_of(cls, [marker for marker in cls.markers if marker.placed])


def of_body(cls):
    """The arguments of a body."""
    return arguments_of(cls)


@cache
def bodies_of(cls):
    """Which of a and b a class has: whether each is required."""
    parameters = inspect.signature(cls).parameters
    return {name: parameters[name].default is parameters[name].empty for name in BODIES if name in parameters}


def constraints():
    """The classes of constraints and joints, by the names that files use."""
    known = _named({**primitive.registered(), **joint.registered()})
    return {name: cls for name, cls in known.items() if cls is not EulerNormalization}


def forces():
    """The classes of forces, by the names that files use."""
    return _named(force.registered())


def _named(registered):
    return {type_name(cls): cls for cls in registered.values()}


def type_name(cls):
    """The name of a class in files: its own, or with its module, for a plug-in."""
    cls = next(base for base in cls.__mro__ if issubclass(base, Attachment) and not base.__name__.startswith("_"))
    built_in = f"{cls.__module__}.".startswith(BUILT_IN)
    return cls.__name__ if built_in else f"{cls.__module__}.{cls.__qualname__}"


def body_type(body):
    """The name of the type of a body."""
    return "Body" if isinstance(body, Body) else "PointMass" if isinstance(body, PointMass) else ""


def find(name, known, others, what, allow_code):
    """The class of a type name; raises `Misread`. The module of a plug-in is imported only if `allow_code`."""
    found = known().get(name)
    if found is None and allow_code and "." in name:
        _import_module_of(name)
        found = known().get(name)
    if found is not None:
        return found
    if name in others():
        raise Misread(f"{name} is no {what}: it belongs under [[{'force' if what == 'constraint' else 'constraint'}]].")
    if name == EulerNormalization.__name__:
        raise Misread("every rigid body has one by itself; leave it out.")
    near = close(name, known())
    if near:
        raise Misread(f"unknown type; did you mean {' or '.join(near)}?")
    if "." in name:
        raise Misread(
            "unknown type; if it is a plug-in, import its module before, or allow the file to import it: "
            "--allow-code, or ts.load(path, allow_code=True)."
        )
    raise Misread(f"unknown type; there are {', '.join(known())}.")


def _import_module_of(name):
    module = name.partition(".<locals>")[0].rpartition(".")[0]
    while module and module not in sys.modules:
        try:
            import_module(module)
        except ModuleNotFoundError:
            module = module.rpartition(".")[0]
        except Exception as error:
            raise Misread(f"its module {module} can't be imported: {type(error).__name__}: {error}") from error


def _whole(value, names, argument):
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    raise Misread("it must be a whole number.")


def _flag(value, names, argument):
    if isinstance(value, bool):
        return value
    raise Misread("it must be true or false.")


def _text(value, names, argument):
    if not isinstance(value, str):
        raise Misread("it must be text in quotes.")
    if argument.options and value not in argument.options:
        near = close(value, argument.options) or argument.options
        raise Misread(f"it must be {' or '.join(map(repr, argument.options))}; write {near[0]!r}?")
    return value


def _names(value, names, argument):
    if isinstance(value, list) and all(isinstance(part, str) for part in value):
        return value
    raise Misread('it must be a list of names such as ["crank"].')


def _function(value, names, argument):
    raise Misread("it is a function, and a file holds no code; build such a scene in Python.")


def _any(value, names, argument):
    if isinstance(value, bool):
        return value
    decode = values.decode_array if isinstance(value, list) else values.decode_motion
    return decode(value, names)


def _of(decode):
    return lambda value, names, argument: decode(value, names)


_DECODERS = {
    NUMBER: _of(values.decode_number),
    ARRAY: _of(values.decode_array),
    MOTION: _of(values.decode_motion),
    VECTOR: _of(values.decode_vector),
    WHOLE: _whole,
    FLAG: _flag,
    TEXT: _text,
    REFERENCE: _text,
    NAMES: _names,
    FUNCTION: _function,
    ANY: _any,
}
