"""The JSON Schema of scene files, from the signatures that files are read by. `tsdyn info --schema` prints it."""

import inspect

from ..motions.tables import MAKERS
from . import run_tables, types
from .build import BUILT, KEYS, VERSION

ID = "tsdyn scene"
NUMBER = {"$ref": "#/$defs/number"}
NAMES = {"type": "array", "items": {"type": "string"}}
VECTOR = {"$ref": "#/$defs/vector"}
DEFINITIONS = {
    "number": {"description": "a number, or an expression of parameters", "type": ["number", "string"]},
    "vector": {"type": "array", "items": NUMBER, "minItems": 3, "maxItems": 3},
    "array": {"anyOf": [NUMBER, {"type": "array", "items": {"$ref": "#/$defs/array"}}]},
    "motion": {
        "description": "a number, an expression of the time t, or data",
        "anyOf": [NUMBER, {"$ref": "#/$defs/data"}],
    },
    "vector motion": {
        "anyOf": [
            {"type": "array", "items": {"$ref": "#/$defs/motion"}, "minItems": 3, "maxItems": 3},
            {"$ref": "#/$defs/data"},
        ]
    },
    "data": {
        "anyOf": [
            {"type": "object", "required": ["times", "values"], "additionalProperties": False,
             "properties": {"times": {"$ref": "#/$defs/array"}, "values": {"$ref": "#/$defs/array"},
                            "kind": {"enum": list(MAKERS)}}},
            {"type": "object", "required": ["knots", "coefficients"], "additionalProperties": False,
             "properties": {"knots": {"$ref": "#/$defs/array"}, "coefficients": {"$ref": "#/$defs/array"},
                            "beyond": {"enum": [True, False, "periodic"]}}},
            {"type": "object", "required": ["expression"], "properties": {"expression": {"type": "string"}},
             "additionalProperties": {"$ref": "#/$defs/motion"}},
        ]
    },
}  # fmt: skip
BY_KIND = {
    types.NUMBER: NUMBER,
    types.WHOLE: {"type": "integer"},
    types.FLAG: {"type": "boolean"},
    types.TEXT: {"type": "string"},
    types.ARRAY: {"$ref": "#/$defs/array"},
    types.MOTION_TYPE: {"$ref": "#/$defs/motion"},
    types.VECTOR: {"$ref": "#/$defs/vector motion"},
    types.REFERENCE: {"description": "the name of a constraint", "type": "string"},
    types.COORDINATE: {"description": "the name of a joint, [name, coordinate, index], or a list of these"},
    types.POINTS: {"description": "a list of [body, [x, y, z]]", "type": "array", "minItems": 2},
    types.NAMES: NAMES,
    types.VALUES: {"type": "object", "additionalProperties": {"$ref": "#/$defs/array"}},
    types.ANY: {},
}


def schema(scene, simulate):
    """The JSON Schema, with all built-in classes; by the class of scenes and `simulate`."""
    bodies = [_body(name, getattr(scene, method)) for name, method in types.BODY_TYPES.items()]
    run = {name: _property(argument) for name, argument in run_tables.arguments(simulate).items()}
    own = {"start": NUMBER, "end": NUMBER, "every": NUMBER, "method": {"type": ["string", "object"]}}
    properties = {
        "version": {"const": VERSION},
        "title": {"type": "string"},
        "gravity": VECTOR,
        "parameters": {"type": "object", "additionalProperties": NUMBER},
        "body": {"type": "array", "items": {"anyOf": bodies}},
        "constraint": _items(types.constraints()),
        "force": _items(types.forces()),
        "start": _start(scene),
        "run": _closed({**own, **run}),
        "ensemble": _ensemble(),
        "output": _closed({"files": NAMES, "plot": {"type": "string"}, "channels": NAMES}),
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": ID,
        "type": "object",
        "required": ["version"],
        "additionalProperties": False,
        "properties": {key: properties[key] for key in KEYS},
        "$defs": DEFINITIONS | {"drawn": {"oneOf": [_shape(*pair) for pair in types.DRAWN.items()]}},
    }


def _closed(properties, required=(), **others):
    """A table of these keys alone."""
    wanted = {"required": list(required)} if required else {}
    return {"type": "object", **wanted, **others, "additionalProperties": False, "properties": properties}


def _ensemble():
    pair = {"type": "array", "items": {"$ref": "#/$defs/array"}, "minItems": 2}
    spread = {kind: {**pair, "maxItems": most} for kind, most in run_tables.SPREADS.items()}
    value = {"anyOf": [{"$ref": "#/$defs/array"}, _closed(spread, minProperties=1, maxProperties=1)]}
    whole = {key: {"type": "integer", "minimum": least} for key, least in run_tables.LEAST.items()}
    keep = {"anyOf": [{"enum": list(run_tables.KEEPS)}, {**NAMES, "minItems": 1}]}
    others = {"grid": {"type": "boolean"}, "keep": keep, "assemble": {"anyOf": [{"type": "boolean"}, NAMES]}}
    parameters = {"type": "object", "additionalProperties": value, "minProperties": 1}
    return _closed({"parameters": parameters, **whole, **others}, ["parameters"])


def _property(argument):
    found = dict(BY_KIND[argument.kind])
    return found | ({"enum": list(argument.options)} if argument.options else {})


def _body(name, method):
    known = types.arguments_of(method)
    properties = {key: _property(argument) for key, argument in known.items()}
    drawn = {"type": "array", "items": {"$ref": "#/$defs/drawn"}}
    kind, required = {"type": {"const": name}, "drawn": drawn}, _required(known)
    given = {"required": ["type", *required]}
    if "inertia" in known:
        kind["shape"] = {"oneOf": [_shape(*pair) for pair in types.SHAPES.items()]}
        given = {"anyOf": [{"required": required}, {"required": ["shape"]}]}
    return _closed({**kind, "name": {"type": "string"}, **properties}, **given)


def _required(known):
    return [argument.name for argument in known.values() if argument.required]


def _shape(name, function):
    """The schema of a shape that gives mass and inertia, or is drawn."""
    known = types.of_shape(function)
    properties = {"type": {"const": name}, **{key: _property(argument) for key, argument in known.items()}}
    return _closed(properties, ["type", *_required(known)])


def _items(classes):
    """The schema of constraints or forces: one of the built-in classes, or a plug-in by its full name."""
    known = [_item(*pair) for pair in classes.items() if _is_published(*pair)]
    plug_in = {"type": "object", "required": ["type"], "properties": {"type": {"type": "string", "pattern": "[.]"}}}
    return {"type": "array", "items": {"oneOf": [*known, plug_in]}}


def _is_published(name, cls):
    """Whether a class is built in, and needs no function."""
    return "." not in name and not any(argument.kind == types.FUNCTION for argument in types.of_class(cls).values())


def _item(name, cls):
    """The schema of a class of constraints or forces."""
    bodies, arguments = types.bodies_of(cls), types.of_class(cls)
    places = inspect.signature(cls.at).parameters
    at = [key for key in places if key not in ("a", "b", "joint", "name", "cls")]
    at = [key for key in at if key not in arguments or arguments[key].place]
    properties = {
        "type": {"const": name},
        "name": {"type": "string"},
        **{key: {"description": "the name of a body, or ground", "type": "string"} for key in bodies},
        **{key: _property(argument) for key, argument in arguments.items()},
        "at": _closed(dict.fromkeys(at, VECTOR)),
        "active": {"type": "boolean"},
    }
    if cls.joint_coordinates:
        properties |= {key: {"$ref": "#/$defs/array"} for key in (*BUILT, "angle_near")}
    required = ["type", *(key for key, needed in bodies.items() if needed), *_required(arguments)]
    return _closed(properties, required)


def _start(scene):
    known = {name: _property(argument) for name, argument in types.arguments_of(scene.assemble).items()}
    coordinates = {name: _property(argument) for name, argument in types.arguments_of(scene.set).items()}
    each = _closed(coordinates, ["joint"])
    return _closed({"assemble": {"type": "boolean"}, "set": {"type": "array", "items": each}, **known})
