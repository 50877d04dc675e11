"""A scene of plain data; mistakes are gathered, and what depends on a part that is wrong is left out."""

import inspect
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..elements.bodies import Body
from ..elements.joint import Joint
from ..elements.joint_coordinates import Angle
from ..errors import TsdynError
from ..validation import close
from . import types
from .describe import BUILT, VERSION
from .expressions import CONSTANTS, NAMES, TIME, Misread
from .values import decode_array, decode_number

KEYS = ("version", "title", "gravity", "parameters", "body", "constraint", "force", "start", "run")
ITEM_KEYS = ("type", "name", "at", *BUILT, "angle_near")
ROUNDING = 8.0 * np.finfo(float).eps  # of a direction of unit length, scaled again


class Reading(NamedTuple):
    """What is known while a document is read."""

    mistakes: Any
    names: dict  # parameters, by name
    allow_code: bool
    bodies: dict  # by name, None for one that is wrong
    items: dict  # constraints and forces, likewise


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
        given["gravity"] = _decoded(reading, ("gravity",), document["gravity"], decode_array)
    scene = _made(reading, ("gravity",), "", make, given=given) or make()
    reading.bodies["ground"] = scene.ground
    for path, table in _tables(reading, document, "body"):
        _add_body(reading, scene, path, table)
    for key, known, others in (
        ("constraint", types.constraints, types.forces),
        ("force", types.forces, types.constraints),
    ):
        for path, table in _tables(reading, document, key):
            _add_item(reading, scene, path, table, (known, others, key))
    if not mistakes.found:
        _start(reading, scene, document.get("start", {}))
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


def known_keys(path, table, known, mistakes):
    """Add a mistake for each key that isn't known."""
    for key in table:
        if key not in known:
            near = close(key, known) or close(key.rstrip("s"), known)
            hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(known)}."
            mistakes.add((*path, key), f"unknown key {key!r}; {hint}")


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
            found[name] = decode_number(value, found)
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


def _decoded(reading, path, value, decode):
    """A value by a decoder of values.py; None, and a mistake, where that fails."""
    try:
        return decode(value, reading.names)
    except Misread as error:
        reading.mistakes.add_value(path, str(path[-1]), value, str(error))
        return None


def _made(reading, path, what, make, positions=(), given=MappingProxyType({})):
    """What a call makes; None, and a mistake at the argument that the message names, where that fails."""
    try:
        return make(*positions, **given)
    except TsdynError as error:
        message = str(error)
    except (TypeError, ValueError, ArithmeticError, OverflowError, AttributeError) as error:
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


def _name(reading, path, table, what, taken):
    """The name of a table, "" where there is none."""
    name = table.get("name", "")
    if not isinstance(name, str):
        reading.mistakes.add_value((*path, "name"), f"{what}: name", name, "it must be text in quotes.")
        return ""
    if name and name in taken:
        reading.mistakes.add((*path, "name"), f"{what}: the name {name!r} is in use; choose another one.")
    return name


def _arguments(reading, path, table, known, what):
    """The decoded values of a table by argument; None where one is wrong."""
    found = {}
    for key, value in table.items():
        if key in known:
            try:
                found[key] = known[key].decode(value, reading.names)
            except Misread as error:
                reading.mistakes.add_value((*path, key), f"{what}: {key}", value, str(error))
    return found


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
    name = _name(reading, path, table, what, reading.bodies)
    known = types.of_body(method.__func__)
    known_keys(path, table, ("type", "name", *known), reading.mistakes)
    given = _arguments(reading, path, table, known, what)
    for missing in [argument.name for argument in known.values() if argument.required and argument.name not in table]:
        reading.mistakes.add(path, f"{what} lacks {missing}.")
    body = None
    if len(reading.mistakes.found) == before:
        body = _made(reading, path, what, method, given={**given, "name": name})
    if isinstance(body, Body) and "orientation" in given:
        _keep_bits(body.values, "orientation", given["orientation"])
    reading.bodies[body.name if body is not None else name] = body


def _keep_bits(values, name, given):
    """Where a value of unit length was scaled again, put that of the file in its place: the last bit stays."""
    given, kept = np.array(given, float), values[name]
    if given.shape == kept.shape and np.abs(given - kept).max() <= ROUNDING:
        given.setflags(write=False)
        values[name] = given


def _add_item(reading, scene, path, table, kinds):
    """Add a constraint or force to the scene; kinds: its classes, the others, and what it is."""
    key = kinds[2]
    title, before = table.get("name", path[1] + 1), len(reading.mistakes.found)
    what = f"{key} {title!r}"
    name = _name(reading, path, table, what, reading.items)
    if name:
        reading.items[name] = None
    cls = _class(reading, path, table, what, kinds)
    if cls is None:
        return
    arguments, bodies = types.of_class(cls), types.bodies_of(cls)
    known_keys(path, table, (*ITEM_KEYS, *bodies, *arguments), reading.mistakes)
    positions = _positions(reading, path, table, what, bodies, arguments)
    values = {n: one for n, one in arguments.items() if one.kind != types.REFERENCE}
    given = _arguments(reading, path, table, values, what)
    placed = _at(reading, path, table, cls, what, values)
    for argument in values.values():
        if argument.required and argument.name not in table:
            reading.mistakes.add(path, f"{what} lacks {argument.name}.")
    if len(reading.mistakes.found) > before or positions is None:
        return
    make = cls if placed is None else cls.at
    item = _made(reading, path, what, make, positions, {**given, **(placed or {}), "name": name})
    if item is None:
        return
    _restore(reading, path, item, given, table)
    if _made(reading, path, what, scene.add, [item]) is not None:
        reading.items[item.name] = item


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
            found.append(_referred(reading, path, table, (what, name, "body", reading.bodies)))
            complete = complete and found[-1] is not None
    for name, argument in arguments.items():
        if argument.kind == types.REFERENCE:
            found.append(_referred(reading, path, table, (what, name, "constraint", reading.items)))
            complete = complete and found[-1] is not None
    return found if complete else None


def _referred(reading, path, table, referred):
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
    found = {key: _decoded(reading, (*path, key), value, decode_array) for key, value in placing.items()}
    return {key: value for key, value in found.items() if value is not None}


def _restore(reading, path, item, given, table):
    """Bring back what scaling and edits have left: last bits of directions, orientations at the angle zero, turns."""
    kept = vars(item)
    if "coordinates" in kept:
        places = dict(zip([marker.argument for marker in item.markers], item.coordinates, strict=True))
        for marker in item.markers:
            if marker.placed and marker.argument in given:
                _keep_bits(places, marker.argument, given[marker.argument])
        kept["coordinates"] = tuple(places.values())
    built = list(kept.get("built", ()))
    for key, i in BUILT.items():
        if key in table:
            value = _decoded(reading, (*path, key), table[key], decode_array)
            known = i < len(built) and built[i] is not None
            if known and np.shape(value) == (4,) and np.isclose(np.linalg.norm(value), 1.0):
                built[i] = np.array(value, float)
                continue
            reading.mistakes.add_value((*path, key), key, table[key], "it must be the Euler parameters of a body.")
    kept["built"] = tuple(built)
    if "angle_near" in table:
        near = _decoded(reading, (*path, "angle_near"), table["angle_near"], decode_array)
        angles = sum(isinstance(each, Angle) for each in item.joint_coordinates)
        if np.shape(near) not in ((), (angles,)):
            reading.mistakes.add_value((*path, "angle_near"), "angle_near", near, f"it must be {angles} numbers, rad.")
        kept["angle_near"] = near if np.ndim(near) == 0 else tuple(near)
    if isinstance(item, Joint):
        kept.pop("_composition", None)


def _start(reading, scene, start):
    """Carry out what the table start asks for: set joints, then assemble."""
    mistakes, path = reading.mistakes, ("start",)
    if not isinstance(start, dict):
        mistakes.add_value(path, "start", start, "it must be a table: [start].")
        return
    known = types.of_body(type(scene).assemble)
    known_keys(path, start, ("assemble", "set", *known), mistakes)
    assemble = start.get("assemble", False)
    if not isinstance(assemble, bool):
        mistakes.add_value((*path, "assemble"), "assemble", assemble, "it must be true or false.")
    given = _arguments(reading, path, start, known, "start")
    joints = start.get("set", [])
    for i, table in enumerate(joints if isinstance(joints, list) else [joints]):
        _set(reading, scene, (*path, "set", i), table)
    if assemble and not mistakes.found:
        _made(reading, path, "", scene.assemble, given=given)


def _set(reading, scene, path, table):
    """Set the coordinates of a joint."""
    known = types.of_body(type(scene).set)
    if not isinstance(table, dict) or not isinstance(table.get("joint"), str):
        reading.mistakes.add_value(path, "set", table, 'write { joint = "hinge", angle = 0.5 }.')
        return
    known_keys(path, table, known, reading.mistakes)
    given = _arguments(reading, path, table, known, "set")
    joint = _referred(reading, path, table, ("set", "joint", "constraint", reading.items))
    given.pop("joint", None)
    if joint is not None and not reading.mistakes.found:
        _made(reading, path, "", scene.set, [joint], given)
