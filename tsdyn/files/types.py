"""The types that a scene file may name, arguments by signature; values as plain data and back; places of mistakes."""

import inspect
import reprlib
import sys
from functools import cache
from importlib import import_module
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from .. import shapes
from ..constraints.euler_normalization import EulerNormalization
from ..elements import force, joint, primitive
from ..elements.bodies import Body, PointMass
from ..elements.element import Attachment
from ..errors import InvalidArgument, InvalidFile, TsdynError
from ..motions.elementary import Piecewise, Smooth
from ..motions.of_coordinates import CoordinateFunction
from ..motions.prescribed import Motion
from ..motions.signals import Signal
from ..motions.tables import Pieces, Table, is_data
from ..validation import close
from . import expressions
from .expressions import Misread

# Values of arguments: numbers, arrays, motions and tables as plain data, and back.

EXPRESSION = "expression"  # the key of a motion whose parts have names of their own
TABLE = ("times", "values")  # keys of a table, and
KIND = "kind"
PIECES = ("knots", "coefficients")  # keys of a piecewise polynomial, and
BEYOND = "beyond"
MOTION = "a number, an expression of the time such as '0.1 * sin(2 * t)', or { times = [...], values = [...] }"


class Unwritable(Exception):
    """What a file can't hold: its description."""


def encode(value):
    """Plain data of a value; raises `Unwritable`."""
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value)
    if isinstance(value, np.ndarray) and value.dtype.kind in "fi":
        return value.tolist()
    if isinstance(value, Motion):
        return _encode_motion(value)
    if isinstance(value, Signal):
        return _encode_signal(value)
    if isinstance(value, CoordinateFunction):
        value = value.smooth
    if isinstance(value, Smooth):
        return _encode_smooth(value)
    if isinstance(value, Table):
        found = {"times": value.times.tolist(), "values": value.values.tolist()}
        return found | ({} if value.kind == "cubic" else {KIND: value.kind})
    if is_data(value):
        motions = Piecewise.each(value)
        return _encode_smooth(motions[0]) if len(motions) == 1 else [_encode_smooth(motion) for motion in motions]
    if isinstance(value, (tuple, list)):
        return [encode(part) for part in value]
    if callable(value):
        raise Unwritable(f"the function {_name_of(value)}")
    raise Unwritable(f"{value!r}")


def _name_of(function):
    return getattr(function, "__qualname__", repr(function))


def _encode_motion(motion):
    if motion.given:
        raise Unwritable(f"the function {', '.join(map(_name_of, motion.given))}")
    return _encode_smooth(motion.smooth)


def _encode_signal(signal):
    if isinstance(signal.source, Table):
        return encode(signal.source)
    if signal.is_function:
        raise Unwritable(f"the function {_name_of(signal.source)}")
    found = [_encode_smooth(motion) for motion in signal.motions]
    return found[0] if signal.width == 1 else found


def _encode_smooth(motion):
    text, parts = expressions.write(motion)
    parts = {name: _encode_pieces(part) if isinstance(part, Pieces) else part for name, part in parts.items()}
    if text in parts and len(parts) == 1:  # data alone
        return parts[text]
    return {EXPRESSION: text, **parts} if parts else text


def _encode_pieces(pieces):
    found = {"knots": pieces.knots.tolist(), "coefficients": pieces.c.tolist()}
    return found | ({} if pieces.beyond is False else {BEYOND: pieces.beyond})


def is_number(value):
    """Whether plain data is a number."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def decode_number(value, names):
    """A number of plain data: one, or an expression of names that doesn't depend on time."""
    if isinstance(value, str):
        found = expressions.read(value, names)
        if isinstance(found, Smooth):
            raise Misread("it depends on the time t, and must be a number.")
        return found
    if not is_number(value):
        raise Misread("it must be a number, or an expression of parameters such as '2 * length'.")
    if isinstance(value, int) and abs(value) > 2**63:
        raise Misread("the number is too large.")
    return value


def decode_array(value, names):
    """A number, or nested lists of numbers, of plain data."""
    if isinstance(value, list):
        return [decode_array(part, names) for part in value]
    try:
        return decode_number(value, names)
    except Misread as error:
        raise Misread(f"{error} Arrays are lists of numbers such as [0.0, 0.0, 1.0].") from None


def decode_motion(value, names):
    """What a prescribed quantity, or a load, is given by: a number, a motion, a `Table`."""
    if isinstance(value, str):
        return expressions.read(value, names)
    if isinstance(value, dict):
        return _decode_table(value, names)
    if is_number(value):
        return value
    raise Misread(f"it must be {MOTION}.")


def decode_vector(value, names):
    """What a load of three numbers is given by: a list of three, or a table of vectors."""
    if isinstance(value, list):
        return [decode_motion(part, names) for part in value]
    if isinstance(value, dict) and EXPRESSION not in value:
        return _decode_table(value, names)
    raise Misread(f"it must be three values, each {MOTION}; or such a table of vectors.")


def _decode_table(value, names):
    """A motion of a table of plain data."""
    if EXPRESSION in value:
        return _decode_parts(value, names)
    for known, more, make in ((TABLE, KIND, _table), (PIECES, BEYOND, _pieces)):
        if set(value) - {more} == set(known):
            try:
                return make(value, names)
            except (InvalidArgument, ValueError, IndexError) as error:
                raise Misread(str(error)) from error
    raise Misread(
        "such a table has the keys times, values and kind; or knots, coefficients and beyond; or expression and its "
        f"parts; got {', '.join(value) or 'none'}."
    )


def _table(value, names):
    return Table(*(decode_array(value[key], names) for key in TABLE), value.get(KIND, "cubic"))


def _pieces(value, names):
    knots, c = (np.array(decode_array(value[key], names), float) for key in PIECES)
    beyond = value.get(BEYOND, False)
    if knots.ndim != 1 or knots.size < 2 or c.ndim != 2 or len(c) != knots.size - 1 or not c.shape[1]:
        raise Misread("coefficients must be a list for each piece between knots, the constant one first.")
    if not (isinstance(beyond, bool) or beyond == "periodic"):
        raise Misread(f"beyond must be true, false or 'periodic', got {beyond!r}.")
    return Piecewise._of(Pieces(knots, c, beyond))


def _decode_parts(value, names):
    """The motion of an expression whose parts are named beside it, each after those that it uses."""
    known = dict(names)
    for name, part in value.items():
        if name != EXPRESSION:
            if not isinstance(part, (str, dict, int, float)) or isinstance(part, bool):
                raise Misread(f"{name} must be {MOTION}.")
            found = decode_motion(part, known)
            known[name] = Piecewise(found) if isinstance(found, Table) else found
    if not isinstance(value[EXPRESSION], str):
        raise Misread("expression must be text.")
    return expressions.read(value[EXPRESSION], known)


# The types that a scene file may name, by the registries that plug-ins use; their arguments, by signature.

BODIES, OWN = ("a", "b"), ("name", "self", "scene", "shape")
BUILT_IN = ("tsdyn.constraints.", "tsdyn.forces.")
SHAPES = {name: getattr(shapes, name) for name in ("box", "sphere", "cylinder", "capsule", "rod", "from_mesh")}
DRAWN = {cls.__name__: cls for cls in (shapes.Box, shapes.Sphere, shapes.Cylinder, shapes.Capsule)}
BODY_TYPES = {"Body": "add_body", "PointMass": "add_point_mass"}  # by the methods of a scene
ENUMERATIONS = {  # by the aliases of hints.py
    "Frame": ("ground", "body"),
    "Folds": ("keep", "free"),
    "Axis": ("x", "y", "z"),
    "Formulation": ("tangent", "null-space", "maggi-kane"),
    "Redundancy": ("drop", "refuse"),
    "ImpactLaw": ("newton", "poisson"),
}

NUMBER, WHOLE, FLAG, TEXT, ARRAY, MOTION_TYPE, VECTOR, FUNCTION, REFERENCE, NAMES, VALUES, ANY, COORDINATE, POINTS = (
    "number", "integer", "boolean", "text", "array", "motion", "vector", "function", "reference", "names", "values",
    "any", "coordinate", "points",
)  # fmt: skip
KINDS = {
    "float": NUMBER,
    "int": WHOLE,
    "bool": FLAG,
    "str": TEXT,
    "ArrayLike": ARRAY,
    "Floats": ARRAY,
    "Orientation": ARRAY,
    "Prescribed": MOTION_TYPE,
    "Load": MOTION_TYPE,
    "VectorLoad": VECTOR,
    "Path": VECTOR,
    "JointLaw": FUNCTION,
    "ControlLaw": FUNCTION,
    "Actuators": NAMES,
    "JointCoordinate": COORDINATE,
    "RopePoints": POINTS,
}
NAMED = REFERENCE, COORDINATE, POINTS  # kinds that name other parts of the scene


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
    """The `Argument`s of a class or a method of a scene, by name; bodies and the name are left out.

    Of arguments by position without a number only joint coordinates are known, as one list.
    """
    placing, found = {marker.argument for marker in markers}, {}
    for name, parameter in inspect.signature(function).parameters.items():
        if name in (*BODIES, *OWN) or parameter.kind is parameter.VAR_KEYWORD:
            continue
        kind, options = _kind_of(parameter)
        if parameter.kind is parameter.VAR_POSITIONAL and kind != COORDINATE:
            continue
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
    if word.startswith("Mapping"):
        return VALUES, ()
    if parameter.kind is not parameter.KEYWORD_ONLY:
        return REFERENCE, ()
    return TEXT if isinstance(parameter.default, str) else ANY, ()


@cache
def of_class(cls):
    """The arguments of a class of constraints or forces."""
    return arguments_of(cls, [marker for marker in cls.markers if marker.placed])


@cache
def of_shape(cls):
    """The arguments of a shape to draw."""
    return {
        name: one._replace(kind=ARRAY) if one.kind in (ANY, REFERENCE) else one
        for name, one in arguments_of(cls).items()
    }


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


def _values(value, names, argument):
    if isinstance(value, dict):
        return {key: decode_array(part, names) for key, part in value.items()}
    raise Misread("it must be a table of numbers by name, such as { hip = 0.3 }.")


def _function(value, names, argument):
    raise Misread("it is a function, and a file holds no code; build such a scene in Python.")


def _any(value, names, argument):
    if isinstance(value, bool):
        return value
    decode = decode_array if isinstance(value, list) else decode_motion
    return decode(value, names)


def _of(decode):
    return lambda value, names, argument: decode(value, names)


_DECODERS = {
    NUMBER: _of(decode_number),
    ARRAY: _of(decode_array),
    MOTION_TYPE: _of(decode_motion),
    VECTOR: _of(decode_vector),
    WHOLE: _whole,
    FLAG: _flag,
    TEXT: _text,
    REFERENCE: _text,
    COORDINATE: _any,
    POINTS: _any,
    NAMES: _names,
    VALUES: _values,
    FUNCTION: _function,
    ANY: _any,
}


# Mistakes in a file, gathered and reported at once, each with its line, the value and what to write instead.

SHOWN = 50
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60


class Mistakes:
    """What is wrong in a file.

    Parameters
    ----------
    name : str
        Of the file, in messages.
    places : Places
    """

    def __init__(self, name, places):
        self.name, self.places, self.found = name, places, {}

    def add(self, path, message):
        """Add a mistake at a path, once."""
        self.found.setdefault((path, message), (*self.places.line_and_column(path), message))

    def add_value(self, path, what, value, reason):
        """Add a value that is wrong, with the reason."""
        self.add(path, f"{what} = {_SHORT.repr(value)}: {reason}")

    def demand_none(self):
        """Raise InvalidFile if there are any, in the order of the file."""
        if not self.found:
            return
        found = sorted(self.found.values())
        more = f"\n  and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
        lines = "\n".join(f"  {self.name}:{line}:{column}: {message}" for line, column, message in found[:SHOWN])
        count = f"{len(found)} mistake{'s' if len(found) > 1 else ''}"
        raise InvalidFile(f"{self.name} has {count}:\n{lines}{more}", tuple(found))


ROUNDING = 8.0 * np.finfo(float).eps  # of a direction of unit length, scaled again


class Reading(NamedTuple):
    """What is known while a document is read."""

    mistakes: Any
    names: dict  # parameters, by name
    allow_code: bool
    bodies: dict  # by name, None for one that is wrong
    items: dict  # constraints and forces, likewise


def known_keys(path, table, known, mistakes):
    """Add a mistake for each key that isn't known."""
    for key in table:
        if key not in known:
            near = close(key, known) or close(key.rstrip("s"), known)
            hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(known)}."
            mistakes.add((*path, key), f"unknown key {key!r}; {hint}")


def decoded(reading, path, value, decode):
    """A decoded value; None, and a mistake, where that fails."""
    try:
        return decode(value, reading.names)
    except Misread as error:
        reading.mistakes.add_value(path, str(path[-1]), value, str(error))
        return None


def made(reading, path, what, make, positions=(), given=MappingProxyType({})):
    """What a call makes; None, and a mistake at the argument that the message names, where that fails."""
    try:
        return make(*positions, **given)
    except TsdynError as error:
        message = str(error)
    except Exception as error:  # of a plug-in, too
        message = f"{type(error).__name__}: {error}"
    own = not what or what.partition(" ")[2].strip("'") in message
    reading.mistakes.add(_blamed(path, given, message), message if own else f"{what}: {message}")
    return None


def _blamed(path, given, message):
    """The path of the argument that a message names, or else of the table."""
    words = {word.strip(".,:;()'\"").partition("[")[0] for word in message.split()}
    for key in given:
        if words & {key, f"{key}_a", f"{key}_b"}:
            return (*path, key)
    return path


def name_of(reading, path, table, what, taken):
    """The name of a table, "" where there is none."""
    name = table.get("name", "")
    if not isinstance(name, str):
        reading.mistakes.add_value((*path, "name"), f"{what}: name", name, "it must be text in quotes.")
        return ""
    if name and name in taken:
        reading.mistakes.add((*path, "name"), f"{what}: the name {name!r} is in use; choose another one.")
    return name


def arguments_in(reading, path, table, known, what):
    """The decoded values of a table by argument; None where one is wrong."""
    found = {}
    for key, value in table.items():
        if key in known:
            try:
                found[key] = known[key].decode(value, reading.names)
            except Misread as error:
                reading.mistakes.add_value((*path, key), f"{what}: {key}", value, str(error))
    return found


def referred(reading, path, table, referred):
    """The body or constraint that a key names; None where there is none, or it is wrong itself."""
    what, key, kind, known = referred
    if key not in table:
        reading.mistakes.add(path, f"{what} lacks {key}, the name of a {kind}.")
        return None
    name = table[key]
    if not isinstance(name, str) or name not in known:
        near = close(str(name), known)
        there = ", ".join(list(known)[:10]) or "none"
        hint = f"did you mean {' or '.join(map(repr, near))}?" if near else f"there are {there}."
        reading.mistakes.add_value((*path, key), f"{what}: {key}", name, f"no {kind} before it has this name; {hint}")
        return None
    return known[name]


def keep_bits(values, name, given):
    """Where a value of unit length was scaled again, put that of the file in its place: the last bit stays."""
    given, kept = np.array(given, float), values[name]
    if given.shape == kept.shape and np.abs(given - kept).max() <= ROUNDING:
        given.setflags(write=False)
        values[name] = given
