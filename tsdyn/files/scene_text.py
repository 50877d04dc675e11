"""A scene as TOML text, and the text as a scene; TOML of plain data; the file that `tsdyn new` writes."""

from __future__ import annotations

import json
import math
import re
import tomllib
from contextlib import suppress
from functools import cached_property
from types import SimpleNamespace
from typing import Any, NamedTuple, Self

import numpy as np

from ..elements.force import Force
from ..errors import InvalidArgument, InvalidFile
from ..validation import number, shown
from . import run_tables
from .build import build, describe, outline
from .types import Mistakes, Unwritable, encode

# Lines and columns in a TOML text: where each value stands.

_SPACE = re.compile(r"[ \t]*")
_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_STRINGS = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|' + r"'''.*?'{3,5}|" + r'"(?:\\.|[^"\\\n])*"|' + r"'[^'\n]*'", re.DOTALL
)
_OTHER = re.compile(r"[^\s,\]}#]+(?: [0-9][^\s,\]}#]*)?")


class Places:
    """Where each value of a valid TOML text stands, by path, a tuple of keys and indices.

    Parameters
    ----------
    text : str
        That tomllib has read.
    """

    def __init__(self, text):
        self.text, self._offsets, self._counts = text, {}, {}

    @cached_property
    def offsets(self):
        """Offsets by path, found when they are first asked for."""
        with suppress(IndexError, AttributeError, RecursionError):  # for messages: what is found so far serves
            self._scan()
        return self._offsets

    def line_and_column(self, path):
        """Line and column, from 1, of a value, or of the innermost table around it that is known."""
        if path not in self.offsets and (*path[:-1], "at", *path[-1:]) in self.offsets:
            path = (*path[:-1], "at", *path[-1:])
        while path and path not in self.offsets:
            path = path[:-1]
        offset = self.offsets.get(path, 0)
        line = self.text.count("\n", 0, offset) + 1
        return line, offset - (self.text.rfind("\n", 0, offset) + 1) + 1

    def _scan(self):
        at, table = 0, ()
        while True:
            at = _BLANK.match(self.text, at).end()
            if at >= len(self.text):
                return
            if self.text[at] == "[":
                at, table = self._header(at)
            else:
                at = self._pair(at, table)

    def _header(self, at):
        """A header; the offset after it, and the path of its table."""
        begin, several = at, self.text.startswith("[[", at)
        keys, at = self._keys(at + 1 + several)
        path = ()
        for key in keys[:-1]:
            path = self._latest((*path, key))
        path = (*path, keys[-1])
        if several:
            self._offsets.setdefault(path, begin)
            count = self._counts[path] = self._counts.get(path, -1) + 1
            path = (*path, count)
        self._offsets.setdefault(path, begin)
        return at + 1 + several, path

    def _latest(self, path):
        """The path of a table, or of the latest of an array of tables."""
        return (*path, self._counts[path]) if path in self._counts else path

    def _keys(self, at):
        """A dotted key, and the offset after it and the blanks behind."""
        keys = []
        while True:
            at = _SPACE.match(self.text, at).end()
            quoted = self.text[at] in "\"'"
            found = (_STRINGS if quoted else _BARE).match(self.text, at)
            keys.append(found.group()[1:-1] if quoted else found.group())
            at = _SPACE.match(self.text, found.end()).end()
            if self.text[at] != ".":
                return keys, at
            at += 1

    def _pair(self, at, table):
        """A key and its value; the offset after it."""
        keys, at = self._keys(at)
        at = _SPACE.match(self.text, at + 1).end()
        return self._value(at, (*table, *keys))

    def _value(self, at, path):
        """A value; the offset after it."""
        self._offsets.setdefault(path, at)
        first = self.text[at]
        if first == "[":
            return self._items(at + 1, "]", path)
        if first == "{":
            return self._items(at + 1, "}", path)
        return (_STRINGS if first in "\"'" else _OTHER).match(self.text, at).end()

    def _items(self, at, end, path):
        """What is in brackets; the offset after them."""
        count = 0
        while True:
            at = _BLANK.match(self.text, at).end()
            if self.text[at] == end:
                return at + 1
            at = self._value(at, (*path, count)) if end == "]" else self._pair(at, path)
            count += 1
            at = _BLANK.match(self.text, at).end()
            if self.text[at] == ",":
                at += 1


# TOML of plain data: tables, lists, text, numbers to the last bit.

WIDTH = 110


def as_toml(document):
    """The TOML text of a document: values first, then tables, then arrays of tables."""
    lines = _pairs(document)
    for key, value in document.items():
        if isinstance(value, dict):
            lines += ["", f"[{_key(key)}]", *_pairs(value, nested=False)]
    for key, value in document.items():
        if _is_tables(value):
            for table in value:
                lines += ["", f"[[{_key(key)}]]", *_pairs(table, nested=False)]
    return "\n".join(lines).lstrip("\n") + "\n"


def _is_tables(value):
    return isinstance(value, list) and bool(value) and all(isinstance(part, dict) for part in value)


def _pairs(table, nested=True):
    """The lines of the pairs of a table; nested: without its tables, which have headers."""
    return [
        f"{_key(key)} = {_value(value)}"
        for key, value in table.items()
        if not (nested and (isinstance(value, dict) or _is_tables(value)))
    ]


def _key(key):
    return key if _BARE.fullmatch(key) else _text(key)


def _text(value):
    """A basic string; TOML has the escapes of JSON, and no surrogates."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value):
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, float):
        return _float(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_value(part)}" for key, part in value.items()) + " }"
    return _list([_value(part) for part in value])


def _float(value):
    if not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0.0 else "-inf"
    return repr(value)


def _list(parts):
    """A list, over several lines if it is long."""
    line = "[" + ", ".join(parts) + "]"
    if len(line) <= WIDTH:
        return line
    lines, row = [], ""
    for part in parts:
        if row and len(row) + len(part) + 2 > WIDTH:
            lines.append(row)
            row = ""
        row += f"{part}, "
    return "[\n" + "\n".join(f"  {row.rstrip()}" for row in (*lines, row)) + "\n]"


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
    text = scene._named.text() if is_of_file(scene) else as_toml(describe(scene))
    try:
        twin, _ = read(text, "the scene", make, None)
    except InvalidFile as error:
        raise InvalidArgument(f"the scene can't be written: read again, {error} {KEEP}") from error
    _demand_same(scene, twin)
    return text


def is_of_file(scene):
    """Whether a scene is as a file with a table `parameters` says."""
    try:
        return scene._named is not None and not _changed(scene, scene._named.made(type(scene), {}))
    except Unwritable:  # a function, which has been added
        return False


def write_outline(scene, make):
    """The text of a scene without what only its owner can pass again, which is named; "" where that is no scene."""
    document, left = outline(scene)
    text = as_toml(document)
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
    output: dict  # files, where to draw, and channels


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
    if scene is not None and names:
        scene._named = NamedNumbers(document, mistakes, allow_code, names)
    given = run_tables.options(document["run"], simulate, mistakes, names) if "run" in document else {}
    cases = {}
    if "ensemble" in document and study is not False:
        table = document["ensemble"]
        if isinstance(table, dict):
            table = table | {key: value for key, value in (study or {}).items() if value is not None}
        cases = run_tables.ensemble(table, scene, mistakes, names)
    output = run_tables.output(document.get("output", {}), scene, mistakes)
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
            item.active,
        )
    return found


def _marks_of(part):
    """Type, places and parameters of a primitive or force."""
    places = [np.asarray(place).tobytes() for place in part.coordinates]
    return type(part), places, [repr(encode(value)) for value in part.parameters()]


def _demand_same(scene, twin):
    """Refuse a scene that comes back as another one."""
    changed = _changed(scene, twin)
    if changed:
        raise InvalidArgument(
            f"the scene can't be written: {', '.join(changed[:5])} would not come back to the bit. {KEEP}"
        )


def _changed(scene, twin):
    """Names of the parts in which two scenes differ."""
    one, other = marks(scene), marks(twin)
    found = [name for name in one if name not in other or one[name] != other[name]]
    return found if found or list(one) == list(other) else ["the names"]


# The scene file that `tsdyn new` writes.

TEXT = """\
# A scene of tsdyn. SI units and radians; Euler parameters scalar first.
# Run it:    tsdyn run scene.toml
# Check it:  tsdyn check scene.toml        What is in it:  tsdyn info scene.toml
version = 1
title = "pendulum with a spring"
gravity = [0.0, 0.0, -9.81]

# Numbers with names. A number anywhere below may be an expression of them, in quotes.
[parameters]
length = 1.0
mass = 2.0

# A rigid body; type = "PointMass" is a particle, without inertia and orientation.
[[body]]
name = "arm"
mass = "mass"
inertia = [0.01, "mass * length**2 / 12", "mass * length**2 / 12"] # about the centroid, body frame
position = ["length / 2", 0, 0]                                    # of the centroid, ground frame
# orientation = [1, 0, 0, 0]
# velocity = [0, 0, 0]
# angular_velocity = [0, 0, 0]                                     # body frame

# A joint. `at` gives its point and axis in the ground frame; without it point_a, axis_b, ... are in the body frames.
[[constraint]]
type = "Revolute"
name = "hinge"
a = "ground"
b = "arm"
at = { point = [0, 0, 0], axis = [0, 1, 0] }

# A motor would prescribe the angle, as an expression of the time t:
# [[constraint]]
# type = "RotationMotor"
# a = "ground"
# b = "arm"
# at = { axis = [0, 1, 0] }
# angle = "0.5 * sin(2 * t)"

[[force]]
type = "Spring"
name = "spring"
a = "arm"
b = "ground"
point_a = ["length / 2", 0, 0]
point_b = ["length", 0, 0.5]
stiffness = 20.0
damping = 0.1

# assemble = true moves bodies that don't quite fit to the nearest places where they do.
[start]
assemble = false

[run]
end = 10.0
every = 0.01 # outputs; without it one a step
# method = "dop853"
# rtol = 1e-9

# Results of `tsdyn run` and `tsdyn ensemble`, below the working folder.
# [output]
# files = ["arm.h5", "arm.csv"]
# plot = "arm.png"
# channels = ["hinge", "arm.position", "spring.tension"] # of the CSV file and of the figure

# Many runs, by `tsdyn ensemble`: what differs from case to case. `tsdyn info --parameters` lists them.
# [ensemble]
# cases = 100
# [ensemble.parameters]
# "arm.mass" = { normal = [2.0, 0.05] }
# "spring.stiffness" = { uniform = [15, 25] }
"""


# The table `parameters` of a scene file: numbers by name, and the scene of the file with other ones.

OF_RUNS = ("run", "ensemble", "output")  # tables that are no part of a scene


class TableNumbers(SimpleNamespace):
    """Numbers of the table as attributes."""


class NamedNumbers:
    """What a scene of a file is made of, to make it again with other numbers.

    Parameters
    ----------
    document : dict
        Plain data of the file.
    mistakes : Mistakes
        Those of the file: none.
    allow_code : bool
        As of `build`.
    values : dict
        Numbers of the table by name.
    """

    def __init__(self, document: dict[str, Any], mistakes: Any, allow_code: bool, values: dict[str, float]) -> None:
        self.document = {key: value for key, value in document.items() if key not in OF_RUNS}
        self.name, self.places, self.allow_code = mistakes.name, mistakes.places, allow_code
        self.values = TableNumbers(**values)

    def __deepcopy__(self, memo: Any) -> Self:
        return self  # never changed

    def made(self, make: Any, changes: dict[str, Any]) -> Any:
        """The scene with other numbers, by name; raises InvalidArgument where the file has mistakes with these."""
        numbers = {name: number(value) for name, value in changes.items()}
        for name, value in numbers.items():
            if not math.isfinite(value):
                raise InvalidArgument(f"{name}, of [parameters], must be a finite number, got {shown(changes[name])}.")
        table = self.document["parameters"] | numbers
        document, mistakes = self.document | {"parameters": table}, Mistakes(self.name, self.places)
        scene, values = build(document, make, mistakes, self.allow_code)
        try:
            mistakes.demand_none()
        except InvalidFile as error:
            said = ", ".join(f"{name} = {value:.6g}" for name, value in numbers.items())
            raise InvalidArgument(f"with {said}, {error}") from error
        scene._named = NamedNumbers(document, mistakes, self.allow_code, values)
        return scene

    def text(self) -> str:
        """The file as TOML text, without what is no part of a scene."""
        return as_toml(self.document)
