"""A scene as TOML text, and the text as a scene."""

import re
import tomllib
from typing import Any, NamedTuple

import numpy as np

from ..elements.force import Force
from ..errors import InvalidArgument, InvalidFile
from . import run_table, study_tables, toml_text
from .build import build
from .describe import describe, outline
from .mistakes import Mistakes
from .places import Places
from .values import encode

KEEP = "A class of your own must keep each argument of its __init__ as an attribute of the same name."
LARGEST = 1 << 26  # bytes of a file that is read: what Python makes of it takes some thirty times as many
DEEP = 64  # parts of a key between dots: reading one takes time and memory by their square
DOTTED = re.compile(rf"""\.(?:[ \t]*(?:[\w-]{{1,999}}|"[^"\n]{{0,999}}"|'[^'\n]{{0,999}}')[ \t]*\.){{{DEEP}}}""")


def write(scene, make):
    """The text of a scene; `make` makes an empty one.

    Raises
    ------
    InvalidArgument
        If the scene has what a file can't hold, or the text would not give the same scene to the bit.
    """
    text = toml_text.write(describe(scene))
    try:
        twin, _ = read(text, "the scene", make, None)
    except InvalidFile as error:
        raise InvalidArgument(f"the scene can't be written: read again, {error} {KEEP}") from error
    _demand_same(scene, twin)
    return text


def write_outline(scene, make):
    """The text of a scene without what only its owner can pass again, which is named; "" where that is no scene."""
    document, left = outline(scene)
    text = toml_text.write(document)
    try:
        read(text, "the outline", make, None)
    except InvalidFile:
        return "", left
    return text, left


class Document(NamedTuple):
    """What a scene file holds."""

    scene: Any
    run: dict  # arguments of `simulate`
    ensemble: dict  # arguments of `ts.ensemble`
    output: dict  # files, and where to draw


def read(text, name, make, simulate, allow_code=False):
    """The scene of a text, and the arguments of `simulate` that its table `run` asks for; as of `read_all`."""
    return read_all(text, name, make, simulate, allow_code)[:2]


def read_all(text, name, make, simulate, allow_code=False, study=None):
    """The `Document` of a text; `name` is that of the file, `study` has other values of keys of the table ensemble.

    A study of False leaves that table unread.

    Raises
    ------
    InvalidFile
        If there are mistakes: all of them.
    """
    document, mistakes = parsed(text, name)
    scene, names = build(document, make, mistakes, allow_code)
    given = run_table.options(document["run"], simulate, mistakes, names) if "run" in document else {}
    cases = {}
    if "ensemble" in document and study is not False:
        table = document["ensemble"]
        if isinstance(table, dict):
            table = table | {key: value for key, value in (study or {}).items() if value is not None}
        cases = study_tables.ensemble(table, scene, mistakes, names)
    output = study_tables.output(document.get("output", {}), mistakes)
    mistakes.demand_none()
    return Document(scene, given, cases, output)


def parsed(text, name):
    """The document of a TOML text, and the `Mistakes` to be found in it; raises InvalidFile if it is no TOML."""
    try:
        deep = DOTTED.search(text)
        if deep:
            raise ValueError(f"a key has more than {DEEP} parts between dots")
        document = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        mistakes = Mistakes(name, Places(""))
        mistakes.found[()] = (*_place(error, text), f"this is no TOML: {error or 'too deep'}.")
        mistakes.demand_none()
    return document, Mistakes(name, Places(text))


def _place(error, text):
    """Line and column of a syntax error, which its message names."""
    words = str(error).replace(",", " ").replace(")", " ").split()
    numbers = [int(words[i + 1]) for i, word in enumerate(words[:-1]) if word in ("line", "column")
               and words[i + 1].isdigit()]  # fmt: skip
    if len(numbers) == 2:
        return tuple(numbers)
    return text.count("\n") + 1, 1


def marks(scene):
    """What a scene is made of, by the name of each part, to the bit."""
    found = {"gravity": scene.gravity.tobytes()}
    for body in scene.bodies:
        found[body.name] = type(body), [(name, np.asarray(value).tobytes()) for name, value in body.values.items()]
    for item in (*scene._added, *scene.forces):
        parts = [item] if isinstance(item, Force) else item.parts
        geometry = [angle.of(item) for angle in item.joint_coordinates]
        geometry = [repr([part for part in found if isinstance(part, tuple)]) for found in geometry]
        found[item.name] = (
            type(item),
            [_marks_of(part) for part in parts],
            geometry,
            np.asarray(item.angle_near).tobytes(),
        )
    return found


def _marks_of(part):
    """Type, places and parameters of a primitive or force."""
    places = [np.asarray(place).tobytes() for place in part.coordinates]
    return type(part), places, [repr(encode(value)) for value in part.parameters()]


def _demand_same(scene, twin):
    """Refuse a scene that comes back as another one."""
    one, other = marks(scene), marks(twin)
    changed = [name for name in one if name not in other or one[name] != other[name]]
    if changed or list(one) != list(other):
        which = ", ".join(changed[:5]) or "the names"
        raise InvalidArgument(f"the scene can't be written: {which} would not come back to the bit. {KEEP}")
