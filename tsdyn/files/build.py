"""A scene as plain data, and plain data as a scene."""

import inspect
import math

import numpy as np

from ..elements.bodies import IDENTITY, Body
from ..elements.element import Angle, chosen_coordinate, idle_forces
from ..elements.joint import Joint
from ..errors import InvalidArgument
from ..jit.code_hash import is_ours
from ..validation import close
from . import types
from .expressions import CONSTANTS, NAMES, TIME, Misread
from .types import (
    Reading,
    Unwritable,
    arguments_in,
    decode_array,
    decode_number,
    decoded,
    encode,
    keep_bits,
    known_keys,
    made,
    name_of,
    referred,
)

# A scene as plain data: bodies, constraints and forces with the arguments that make them again.

VERSION = 1
BUILT = {"built_a": 0, "built_b": 1}  # orientations of a and b at which an angle is zero


def describe(scene):
    """The document of a scene.

    Raises
    ------
    InvalidArgument
        If the scene has what a file can't hold, such as a function; names each.
    """
    refused = []
    document = {
        "version": VERSION,
        "gravity": scene.gravity.tolist(),
        "body": [_body(body) for body in scene.bodies],
        "constraint": [_item(item, refused) for item in scene._added],
        "force": [_item(item, refused) for item in scene.forces],
    }
    refused += _shared([body.name for body in scene.bodies] + ["ground"], "body")
    refused += _shared([item.name for item in (*scene._added, *scene.forces)], "constraint or force")
    if refused:
        raise InvalidArgument(
            "the scene can't be written, as a file holds data and no code: " + "; ".join(refused) + ". Write functions "
            "of time with ts.motions, such as 0.1 * np.sin(2.0 * ts.motions.time), or as a ts.Table."
        )
    return {key: value for key, value in document.items() if value != []}


def outline(scene):
    """The document of a scene without the parts that a file can't hold, or that are of classes not tsdyn's own.

    Returns
    -------
    dict, list of str
        The document; the names of the parts that are left out.
    """
    left, document = [], {"version": VERSION, "gravity": scene.gravity.tolist()}
    document["body"] = [_body(body) for body in scene.bodies]
    for key, items in (("constraint", scene._added), ("force", scene.forces)):
        document[key] = []
        for item in items:
            refused = [] if is_ours(type(item).__module__) else [item.name]
            found = {} if refused else _item(item, refused)
            named = [name for value in found.values() for name in (value if isinstance(value, list) else [value])]
            if refused or any(isinstance(name, str) and name in left for name in named):
                left.append(item.name)
            else:
                document[key].append(found)
    return {key: value for key, value in document.items() if value != []}, left


def _shared(names, what):
    seen = set()
    return [f"{name!r} is the name of more than one {what}" for name in names if name in seen or seen.add(name)]


def _body(body):
    """The pairs of a body."""
    rigid = isinstance(body, Body)
    found = {"name": body.name} | ({} if rigid else {"type": types.body_type(body)})
    for name, value in body.values.items():
        value = np.diagonal(value) if name == "inertia" and _is_diagonal(value) else value
        value = encode(value)
        if not _is_plain_zero(value) and not (name == "orientation" and repr(value) == repr(IDENTITY.tolist())):
            found[name] = value
    pieces = None if callable(body._shape) else body._shape  # those of an imported file may be meshes
    drawn = [_piece(piece) for piece in pieces or () if type(piece) in types.DRAWN.values()]
    return found | ({"drawn": drawn} if drawn or pieces == () else {})


def _piece(piece):
    """The pairs of a shape to draw."""
    found = {name: encode(getattr(piece, name)) for name in types.of_shape(type(piece))}
    plain = {"position": [0.0] * 3, "rotation": np.eye(3).tolist(), "colour": "", "axis": "z"}
    return {"type": type(piece).__name__} | {name: value for name, value in found.items() if value != plain.get(name)}


def _is_diagonal(matrix):
    return not _bits(matrix - np.diag(np.diagonal(matrix))).any() and not np.signbit(matrix).any()


def _bits(array):
    return np.ascontiguousarray(array).view(np.int64)


def _is_plain_zero(value):
    """Whether a value is zero, or a list of zeros, of positive sign: what an argument that is left out is."""
    return not isinstance(value, (bool, str, dict)) and not _bits(np.array(value, float)).any()


def _item(item, refused):
    """The pairs of a constraint or force; what can't be written is added to `refused`."""
    cls = type(item)
    found = {"type": types.type_name(cls)}
    if item.named or item.name != item._untitled([body for body in (item.a, item.b) if body is not None]):
        found["name"] = item.name
    arguments = types.of_class(cls)
    references = [name for name, argument in arguments.items() if argument.kind == types.REFERENCE]
    found |= {name: getattr(item, name).name for name in types.bodies_of(cls) if getattr(item, name) is not None}
    for name in references:
        found[name] = getattr(vars(item).get(name), "name", "")
        if not found[name]:
            refused.append(f"{item.name} keeps no {name}")
    for name, argument in arguments.items():
        if argument.kind == types.COORDINATE:
            found[name] = _coordinate_names(item, vars(item)[name])
        if argument.kind == types.POINTS:
            found[name] = [[body.name, list(s)] for body, s in vars(item)[name]]
        if argument.kind in types.NAMED:
            continue
        try:
            value = encode(_value_of(item, argument))
        except Unwritable as what:
            refused.append(f"{item.name}: {name} is {what}")
            continue
        if value is not None and not _is_left_out(value, argument):
            found[name] = value
    if getattr(item, "is_idle", False):  # says so, for nothing is left out by mistake
        found |= {name: encode(vars(item)[name]) for name in item.sources if vars(item)[name] is not None}
    return found | _history(item) | ({} if item.active else {"active": False})


def _coordinate_names(item, given):
    """[joint, kind, index] of a coordinate of a joint, or of several; a joint alone where that says as much."""
    if not isinstance(given, tuple):
        is_default = chosen_coordinate(item.name, given, default=True)[1:] == item.coordinate
        return given.name if is_default else [given.name, *item.coordinate]
    joint, *which = given
    is_one = which and isinstance(which[0], str)
    return [joint.name, *which] if is_one else [_coordinate_names(item, each) for each in given]


def _value_of(item, argument):
    """The present value of an argument; None where an item keeps none, as what follows from others."""
    if argument.place:
        borrowed = isinstance(getattr(type(item), "coordinates", None), property)
        return None if borrowed else getattr(item, argument.name, None)
    if argument.name in vars(item):
        return vars(item)[argument.name]
    if argument.required:
        raise Unwritable("kept under another name than that of the argument")
    return None


def _is_left_out(value, argument):
    """Whether an argument that is left out has this value."""
    if argument.required or argument.default is None:
        return False
    same = repr(value) == repr(encode(argument.default))
    return same and (value is False or value == "" or _is_plain_zero(value))


def _history(item):
    """What is left of edits of a scene: the orientations at which angles are zero, and turns."""
    if not item.joint_coordinates or "built" not in vars(item):
        return {}
    found = {}
    for key, i in BUILT.items():
        body, built = (item.a, item.b)[i], item.built[i]
        if built is not None and built.tobytes() != body.values["orientation"].tobytes():
            found[key] = built.tolist()
    if np.any(item.angle_near):
        found["angle_near"] = encode(item.angle_near)
    return found


# A scene of plain data; mistakes are gathered, and what depends on a part that is wrong is left out.

# The table `start` of a document: joints that are set, assembly.


def carry_out_start(reading, scene, start):
    """Carry out what the table start asks for: set joints, then assemble."""
    mistakes, path = reading.mistakes, ("start",)
    if not isinstance(start, dict):
        mistakes.add_value(path, "start", start, "it must be a table: [start].")
        return
    known = types.arguments_of(type(scene).assemble)
    known_keys(path, start, ("assemble", "set", *known), mistakes)
    assemble = start.get("assemble", False)
    if not isinstance(assemble, bool):
        mistakes.add_value((*path, "assemble"), "assemble", assemble, "it must be true or false.")
    given = arguments_in(reading, path, start, known, "start")
    joints = start.get("set", [])
    for i, table in enumerate(joints if isinstance(joints, list) else [joints]):
        _set(reading, scene, (*path, "set", i), table)
    if assemble and not mistakes.found:
        made(reading, path, "", scene.assemble, given=given)


def _set(reading, scene, path, table):
    """Set the coordinates of a joint."""
    known = types.arguments_of(type(scene).set)
    if not isinstance(table, dict) or not isinstance(table.get("joint"), str):
        reading.mistakes.add_value(path, "set", table, 'write { joint = "hinge", angle = 0.5 }.')
        return
    known_keys(path, table, known, reading.mistakes)
    given = arguments_in(reading, path, table, known, "set")
    joint = referred(reading, path, table, ("set", "joint", "constraint", reading.items))
    given.pop("joint", None)
    if joint is not None and not reading.mistakes.found:
        made(reading, path, "", scene.set, [joint], given)


# Constraints and forces of a document.

KINDS = ("angle", "displacement")  # of joint coordinates
ITEM_KEYS = ("type", "name", "at", *BUILT, "angle_near", "active")


def add_item(reading, scene, path, table, kinds):
    """Add a constraint or force to the scene; kinds: its classes, the others, and what it is."""
    key = kinds[2]
    title, before = table.get("name", path[1] + 1), len(reading.mistakes.found)
    what = f"{key} {title!r}"
    name = name_of(reading, path, table, what, reading.items)
    if name:
        reading.items[name] = None
    cls = _class(reading, path, table, what, kinds)
    if cls is None:
        for side in types.BODIES:
            if side in table:
                referred(reading, path, table, (what, side, "body", reading.bodies))
        return
    arguments, bodies = types.of_class(cls), types.bodies_of(cls)
    known_keys(path, table, (*ITEM_KEYS, *bodies, *arguments), reading.mistakes)
    positions = _positions(reading, path, table, what, bodies, arguments)
    values = {n: one for n, one in arguments.items() if one.kind not in types.NAMED}
    given = arguments_in(reading, path, table, values, what)
    placed = _at(reading, path, table, cls, what, values)
    for argument in values.values():
        if argument.required and argument.name not in table:
            code = "; that is code, and a file holds none: build such a scene in Python."
            end = code if argument.kind == types.FUNCTION else "."
            reading.mistakes.add(path, f"{what} lacks {argument.name}{end}")
    if len(reading.mistakes.found) > before or positions is None:
        return
    make = cls if placed is None else cls.at
    with idle_forces(any(source in given for source in getattr(cls, "sources", ()))):
        item = made(reading, path, what, make, positions, {**given, **(placed or {}), "name": name})
    if item is None:
        return
    _restore(reading, path, item, given, table)
    if made(reading, path, what, scene.add, [item]) is not None:
        reading.items[item.name] = item
        if not isinstance(table.get("active", True), bool):
            reading.mistakes.add_value(
                (*path, "active"), f"{what}: active", table["active"], "it must be true or false."
            )
        elif not table.get("active", True):
            made(reading, path, what, scene.deactivate, [item])


def _class(reading, path, table, what, kinds):
    """The class that the type of a table names; None, and a mistake, where there is none."""
    known, others, key = kinds
    if not isinstance(table.get("type"), str):
        example = "Revolute" if key == "constraint" else "Spring"
        reading.mistakes.add((*path, "type"), f'{what} has no type; write type = "{example}", or another class.')
        return None
    try:
        return types.find(table["type"], known, others, key, reading.allow_code)
    except Misread as error:
        reading.mistakes.add_value((*path, "type"), f"{what}: type", table["type"], str(error))
        return None


def _positions(reading, path, table, what, bodies, arguments):
    """The bodies and joints of a table, in the order of the signature; None where one is missing or wrong."""
    found, complete = [], True
    for name, required in bodies.items():
        if name in table or required:
            found.append(referred(reading, path, table, (what, name, "body", reading.bodies)))
            complete = complete and found[-1] is not None
    for name, argument in arguments.items():
        if argument.kind == types.REFERENCE:
            found.append(referred(reading, path, table, (what, name, "constraint", reading.items)))
            complete = complete and found[-1] is not None
        if argument.kind == types.COORDINATE:
            found += _coordinates(reading, path, table, what, name)
            complete = complete and None not in found
        if argument.kind == types.POINTS:
            found.append(_points(reading, path, table, what, name))
            complete = complete and found[-1] is not None
    return found if complete else None


def _points(reading, path, table, what, key):
    """The points of a rope, [["body", [x, y, z]], ...]; None, and a mistake, where one is wrong."""
    given, found = table.get(key), []
    if not isinstance(given, list) or not all(isinstance(one, list) and len(one) == 2 for one in given):
        reading.mistakes.add((*path, key), f'{what}: write {key} = [["body", [0.0, 0.0, 0.0]], ...], two or more.')
        return None
    for name, s in given:
        body = referred(reading, path, {key: name}, (what, key, "body", reading.bodies))
        place = decoded(reading, (*path, key), s, decode_array)
        found.append(None if body is None or place is None else (body, place))
    return None if None in found else found


def _coordinates(reading, path, table, what, key):
    """The joint coordinates that a key names: "hinge", ["hinge", "angle", 0], or a list of these."""
    given = table.get(key)
    alone = isinstance(given, list) and given[1:2] in [[kind] for kind in KINDS]
    found, several = [], isinstance(given, list) and bool(given) and key == "independents"
    for one in given if several and not alone else [given]:
        joint, *which = one if isinstance(one, list) and one else [one]
        own = table if key not in table else {**table, key: joint}
        joint = referred(reading, path, own, (what, key, "constraint", reading.items))
        found.append(None if joint is None else (joint, *which))
    return found


def _at(reading, path, table, cls, what, arguments):
    """The arguments of `.at`, in the ground frame; None where the table has none."""
    if "at" not in table:
        return None
    path = (*path, "at")
    if not isinstance(table["at"], dict):
        reading.mistakes.add_value(path, f"{what}: at", table["at"], "write at = { point = [...], axis = [...] }.")
        return None
    known = [n for n in inspect.signature(cls.at).parameters if n not in ("a", "b", "joint", "name")]
    known = [n for n in known if n not in arguments or arguments[n].place]
    known_keys(path, table["at"], known, reading.mistakes)
    for key in [key for key in table if key in arguments and arguments[key].place]:
        reading.mistakes.add((*path[:-1], key), f"{what}: {key} beside at; write it within at, in the ground frame.")
    placing = {key: value for key, value in table["at"].items() if key in known}
    found = {key: decoded(reading, (*path, key), value, decode_array) for key, value in placing.items()}
    return {key: value for key, value in found.items() if value is not None}


def _restore(reading, path, item, given, table):
    """Bring back what scaling and edits have left: last bits of directions, orientations at the angle zero, turns."""
    kept = vars(item)
    if "coordinates" in kept:
        places = dict(zip([marker.argument for marker in item.markers], item.coordinates, strict=True))
        for marker in item.markers:
            if marker.placed and marker.argument in given:
                keep_bits(places, marker.argument, given[marker.argument])
        kept["coordinates"] = tuple(places.values())
    built = list(kept.get("built", ()))
    for key, i in BUILT.items():
        if key in table:
            value = decoded(reading, (*path, key), table[key], decode_array)
            known = i < len(built) and built[i] is not None
            if known and np.shape(value) == (4,) and np.isclose(np.linalg.norm(value), 1.0):
                built[i] = np.array(value, float)
                continue
            reading.mistakes.add_value((*path, key), key, table[key], "it must be the Euler parameters of a body.")
    kept["built"] = tuple(built)
    if "angle_near" in table:
        near = decoded(reading, (*path, "angle_near"), table["angle_near"], decode_array)
        angles = sum(isinstance(each, Angle) for each in item.joint_coordinates)
        if np.shape(near) not in ((), (angles,)):
            reading.mistakes.add_value((*path, "angle_near"), "angle_near", near, f"it must be {angles} numbers, rad.")
        kept["angle_near"] = near if np.ndim(near) == 0 else tuple(near)
    if isinstance(item, Joint):
        kept.pop("_composition", None)


SHAPED = ("mass", "inertia")  # what a shape gives
KEYS = (
    "version",
    "title",
    "gravity",
    "parameters",
    "body",
    "constraint",
    "force",
    "start",
    "run",
    "ensemble",
    "output",
)


def build(document, make, mistakes, allow_code=False):
    """The scene of a document, or None where there are mistakes; and the parameters.

    Parameters
    ----------
    document : dict
    make : callable
        Of a scene: `Scene`.
    mistakes : Mistakes
    allow_code : bool
        Whether modules of plug-ins may be imported.
    """
    if not _has_version(document, mistakes):
        mistakes.demand_none()
    known_keys((), document, KEYS, mistakes)
    reading = Reading(mistakes, _parameters(document, mistakes), allow_code, {}, {})
    given = {}
    if "gravity" in document:
        gravity = decoded(reading, ("gravity",), document["gravity"], decode_array)
        given |= {} if gravity is None else {"gravity": gravity}
    if not isinstance(document.get("title", ""), str):
        mistakes.add_value(("title",), "title", document["title"], "it must be text in quotes.")
    scene = made(reading, ("gravity",), "", make, given=given) or make()
    reading.bodies["ground"] = scene.ground
    for path, table in _tables(reading, document, "body"):
        _add_body(reading, scene, path, table)
    for key, known, others in (
        ("constraint", types.constraints, types.forces),
        ("force", types.forces, types.constraints),
    ):
        for path, table in _tables(reading, document, key):
            add_item(reading, scene, path, table, (known, others, key))
    if not mistakes.found:
        carry_out_start(reading, scene, document.get("start", {}))
    return None if mistakes.found else scene, reading.names


def _has_version(document, mistakes):
    version = document.get("version")
    if version == VERSION and not isinstance(version, bool):
        return True
    if "version" not in document:
        near = close("version", document)
        hint = f" (or is {near[0]!r} meant to be it?)" if near else ""
        mistakes.add((), f"the file has no version; write version = {VERSION} at its top{hint}.")
    elif isinstance(version, int) and version > VERSION:
        mistakes.add(("version",), f"version = {version}: this tsdyn reads {VERSION}; a newer tsdyn wrote the file.")
    else:
        mistakes.add_value(("version",), "version", version, f"write version = {VERSION}.")
    return False


def _parameters(document, mistakes):
    """Numbers by name, each after those that it uses."""
    given, found = document.get("parameters", {}), {}
    if not isinstance(given, dict):
        mistakes.add_value(("parameters",), "parameters", given, "it must be a table: [parameters].")
        return found
    for name, value in given.items():
        path = ("parameters", name)
        if name in (TIME, *CONSTANTS, *NAMES) or not name.isidentifier():
            mistakes.add(path, f"{name!r} can't be the name of a parameter; choose another one.")
        try:
            found[name] = float(decode_number(value, found))
            if not math.isfinite(found[name]):
                raise Misread("it must be finite.")
        except Misread as error:
            mistakes.add_value(path, name, value, str(error))
            found[name] = 1.0  # so that what uses it can be read
    return found


def _tables(reading, document, key):
    """The tables of an array of tables, with their paths."""
    tables = document.get(key, [])
    if not isinstance(tables, list):
        reading.mistakes.add((key,), f"{key}: each begins with [[{key}]], in two brackets.")
        return
    for i, table in enumerate(tables):
        if isinstance(table, dict):
            yield (key, i), table
        else:
            reading.mistakes.add_value((key, i), key, table, f"each begins with [[{key}]].")


def _add_body(reading, scene, path, table):
    """Add a body to the scene."""
    kind = table.get("type", "Body")
    what = f"body {table.get('name', path[1] + 1)!r}"
    if not isinstance(kind, str) or kind not in types.BODY_TYPES:
        near = close(str(kind), types.BODY_TYPES) or list(types.BODY_TYPES)
        reading.mistakes.add_value((*path, "type"), f"{what}: type", kind, f"write {' or '.join(map(repr, near))}.")
        reading.bodies[str(table.get("name", ""))] = None
        return
    method, before = getattr(scene, types.BODY_TYPES[kind]), len(reading.mistakes.found)
    name = name_of(reading, path, table, what, reading.bodies)
    known = types.arguments_of(method.__func__)
    solid = "inertia" in known
    known_keys(path, table, ("type", "name", "drawn", *(["shape"] if solid else []), *known), reading.mistakes)
    given = arguments_in(reading, path, table, known, what)
    if solid and "shape" in table:
        known = {key: argument for key, argument in known.items() if key not in SHAPED}
        given |= _shaped(reading, path, table, what)
    for missing in [argument.name for argument in known.values() if argument.required and argument.name not in table]:
        reading.mistakes.add(path, f"{what} lacks {missing}.")
    drawn = _drawn(reading, path, table, what)
    body = None
    if len(reading.mistakes.found) == before:
        body = made(reading, path, what, method, given={**given, "name": name})
    if body is not None and drawn is not None:
        body.shape = drawn
    if isinstance(body, Body) and "orientation" in given:
        keep_bits(body.values, "orientation", given["orientation"])
    reading.bodies[body.name if body is not None else name] = body


def _shaped(reading, path, table, what):
    """Mass, inertia and shape of the table `shape` of a body."""
    for key in SHAPED:
        if key in table:
            reading.mistakes.add((*path, key), f"{what}: {key} beside shape, which gives it; leave one of them out.")
    found = _shape(reading, (*path, "shape"), table["shape"], types.SHAPES, what)
    return {} if found is None else dict(found)


def _drawn(reading, path, table, what):
    """The shapes to draw of a body; None where there are none."""
    given, where = table.get("drawn"), (*path, "drawn")
    if given is None or isinstance(given, list):
        return given and [_shape(reading, (*where, i), one, types.DRAWN, what) for i, one in enumerate(given)]
    reading.mistakes.add_value(where, f"{what}: drawn", given, "write a list of tables, each a shape.")
    return None


def _shape(reading, where, shape, kinds, what):
    """What a table makes that names one of some kinds of shapes, with its arguments; None, with mistakes, if wrong."""
    mistakes, said = reading.mistakes, "drawn" if kinds is types.DRAWN else "shape"
    kind = shape.get("type") if isinstance(shape, dict) else shape
    if not isinstance(shape, dict) or not isinstance(kind, str) or kind not in kinds:
        hint = " or ".join(close(str(kind), kinds) or kinds)
        mistakes.add_value(where, f"{what}: {said}", kind, f"write a table with the type {hint} and its arguments.")
        return None
    known, before = types.of_shape(kinds[kind]), len(mistakes.found)
    known_keys(where, shape, ("type", *known), mistakes)
    given = arguments_in(reading, where, shape, known, what)
    for missing in [argument.name for argument in known.values() if argument.required and argument.name not in shape]:
        mistakes.add(where, f"{what}: the {kind} lacks {missing}.")
    return made(reading, where, what, kinds[kind], given=given) if len(mistakes.found) == before else None
