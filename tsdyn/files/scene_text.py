"""A scene as TOML text, and the text as a scene; the file that `tsdyn new` writes."""

from __future__ import annotations

import math
import re
import tomllib
from types import SimpleNamespace
from typing import Any, NamedTuple, Self

import numpy as np

from ..elements.force import Force
from ..errors import InvalidArgument, InvalidFile
from ..validation import number, shown
from . import run_tables, toml_text
from .build import build, describe, outline
from .reading import Mistakes
from .toml_text import Places
from .types import Unwritable, encode

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
    text = scene._named.text() if is_of_file(scene) else toml_text.write(describe(scene))
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
        return toml_text.write(self.document)
