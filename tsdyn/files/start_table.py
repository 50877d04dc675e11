"""The table `start` of a document: joints that are set, assembly."""

from . import types
from .reading import arguments_in, known_keys, made, referred


def carry_out_start(reading, scene, start):
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
    given = arguments_in(reading, path, start, known, "start")
    joints = start.get("set", [])
    for i, table in enumerate(joints if isinstance(joints, list) else [joints]):
        _set(reading, scene, (*path, "set", i), table)
    if assemble and not mistakes.found:
        made(reading, path, "", scene.assemble, given=given)


def _set(reading, scene, path, table):
    """Set the coordinates of a joint."""
    known = types.of_body(type(scene).set)
    if not isinstance(table, dict) or not isinstance(table.get("joint"), str):
        reading.mistakes.add_value(path, "set", table, 'write { joint = "hinge", angle = 0.5 }.')
        return
    known_keys(path, table, known, reading.mistakes)
    given = arguments_in(reading, path, table, known, "set")
    joint = referred(reading, path, table, ("set", "joint", "constraint", reading.items))
    given.pop("joint", None)
    if joint is not None and not reading.mistakes.found:
        made(reading, path, "", scene.set, [joint], given)
