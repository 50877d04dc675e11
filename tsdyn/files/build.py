"""A scene of plain data; mistakes are gathered, and what depends on a part that is wrong is left out."""

import math

from ..elements.bodies import Body
from ..validation import close
from . import types
from .describe import VERSION
from .expressions import CONSTANTS, NAMES, TIME, Misread
from .items import add_item
from .reading import Reading, arguments_in, decoded, keep_bits, known_keys, made, name_of
from .start_table import carry_out_start
from .values import decode_array, decode_number

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
    known = types.of_body(method.__func__)
    solid = "inertia" in known
    known_keys(path, table, ("type", "name", *(["shape"] if solid else []), *known), reading.mistakes)
    given = arguments_in(reading, path, table, known, what)
    if solid and "shape" in table:
        known = {key: argument for key, argument in known.items() if key not in SHAPED}
        given |= _shaped(reading, path, table, what)
    for missing in [argument.name for argument in known.values() if argument.required and argument.name not in table]:
        reading.mistakes.add(path, f"{what} lacks {missing}.")
    body = None
    if len(reading.mistakes.found) == before:
        body = made(reading, path, what, method, given={**given, "name": name})
    if isinstance(body, Body) and "orientation" in given:
        keep_bits(body.values, "orientation", given["orientation"])
    reading.bodies[body.name if body is not None else name] = body


def _shaped(reading, path, table, what):
    """Mass and inertia of the table `shape` of a body."""
    shape, where, mistakes = table["shape"], (*path, "shape"), reading.mistakes
    for key in SHAPED:
        if key in table:
            mistakes.add((*path, key), f"{what}: {key} beside shape, which gives it; leave one of them out.")
    kind = shape.get("type") if isinstance(shape, dict) else shape
    if not isinstance(shape, dict) or not isinstance(kind, str) or kind not in types.SHAPES:
        hint = " or ".join(close(str(kind), types.SHAPES) or types.SHAPES)
        mistakes.add_value(where, f"{what}: shape", kind, f"write a table with the type {hint} and its arguments.")
        return {}
    known, before = types.of_body(types.SHAPES[kind]), len(mistakes.found)
    known_keys(where, shape, ("type", *known), mistakes)
    given = arguments_in(reading, where, shape, known, what)
    for missing in [argument.name for argument in known.values() if argument.required and argument.name not in shape]:
        mistakes.add(where, f"{what}: the {kind} lacks {missing}.")
    found = made(reading, where, what, types.SHAPES[kind], given=given) if len(mistakes.found) == before else None
    return {} if found is None else dict(found)
