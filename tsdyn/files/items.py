"""Constraints and forces of a document."""

import inspect

import numpy as np

from ..elements.joint import Joint
from ..elements.joint_coordinates import Angle
from ..elements.membership import idle_forces
from . import types
from .describe import BUILT
from .expressions import Misread
from .reading import arguments_in, decoded, keep_bits, known_keys, made, name_of, referred
from .values import decode_array

KEYS = ("type", "name", "at", *BUILT, "angle_near")


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
    known_keys(path, table, (*KEYS, *bodies, *arguments), reading.mistakes)
    positions = _positions(reading, path, table, what, bodies, arguments)
    values = {n: one for n, one in arguments.items() if one.kind != types.REFERENCE}
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
    return found if complete else None


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
