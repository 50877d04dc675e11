"""Wrong scene files: every mistake at once, each with its line and what to write; fuzzed files never crash."""

import os
import re
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

import tsdyn as ts
from tsdyn.files.scene_text import TEXT

ROOT = Path(__file__).parents[2]

RIGHT = """\
version = 1
gravity = [0, 0, -9.81]
[parameters]
length = 0.5
[[body]]
name = "arm"
mass = 2
inertia = [0.1, 0.2, 0.1]
position = ["length", 0, 0]
[[body]]
name = "bob"
type = "PointMass"
mass = 0.1
position = [1, 0, 1]
[[constraint]]
type = "Revolute"
name = "hinge"
a = "ground"
b = "arm"
at = { point = [0, 0, 0], axis = [0, 1, 0] }
[[constraint]]
type = "Distance"
a = "arm"
b = "bob"
length = "1.2 + 0.0 * sin(t)"
[[force]]
type = "RevoluteFriction"
joint = "hinge"
radius = 0.01
kinetic = 0.1
[[force]]
type = "PointForce"
a = "arm"
force = [0, 0, { times = [0, 1], values = [0, 1] }]
frame = "body"
[start]
assemble = true
[run]
end = 1.0
method = { type = "RK45", rtol = 1e-9 }
[ensemble]
cases = 3
assemble = ["bob"]
[ensemble.parameters]
"arm.mass" = { uniform = [1, "4 * length"] }
"hinge.point_a" = [0, 0, 0]
[output]
files = ["a.h5"]
"""
SPREAD, POINT = 'uniform = [1, "4 * length"]', '"hinge.point_a" = [0, 0, 0]'
INERTIA = "mass = 2\ninertia = [0.1, 0.2, 0.1]"
WRONG = {  # name: (what is replaced, by what, line, words of the message)
    "no TOML": ("[[body]]\nname = \"arm\"", "[[body]\nname = \"arm\"", 5, ("no TOML",)),
    "twice": ("mass = 2\n", "mass = 2\nmass = 3\n", 8, ("no TOML", "overwrite")),
    "no version": ("version = 1\n", "", 1, ("write version = 1",)),
    "version misspelt": ("version", "verson", 1, ("verson", "write version = 1")),
    "later version": ("version = 1", "version = 7", 1, ("newer tsdyn",)),
    "version is text": ("version = 1", 'version = "1"', 1, ("write version = 1",)),
    "unknown table": ("[start]", "[starts]", 36, ("'starts'", "start?")),
    "plural": ("[[force]]\ntype = \"Rev", "[[forces]]\ntype = \"Rev", 26, ("'forces'", "force?")),
    "table in single brackets": ("[[body]]\nname = \"bob\"", "[bodyy]\nname = \"bob\"", 10, ("bodyy", "body?")),
    "title is a number": ("version = 1", "version = 1\ntitle = 3", 2, ("title = 3", "text in quotes")),
    "infinite parameter": ("length = 0.5", "length = 1e400", 4, ("finite",)),
    "gravity of two": ("[0, 0, -9.81]", "[0, 0]", 2, ("gravity", "three finite numbers")),
    "gravity is text": ("[0, 0, -9.81]", '"down"', 2, ("'down'", "unknown name")),
    "parameter of t": ("length = 0.5", 'length = "t"', 4, ("depends on the time",)),
    "parameter of nothing": ("length = 0.5", 'length = "lenght2"', 4, ("lenght2",)),
    "parameter with a name of a function": ("length = 0.5", "length = 0.5\nsin = 1", 5, ("'sin'", "another")),
    "wrong parameter": ('["length", 0, 0]', '["lenght", 0, 0]', 9, ("'lenght'", "did you mean length")),
    "key of a body": ("mass = 2\n", "mas = 2\n", 7, ("'mas'", "mass?")),
    "body lacks mass": ("mass = 2\n", "", 5, ("'arm'", "lacks mass")),
    "negative mass": ("mass = 2\n", "mass = -2\n", 7, ("positive", "-2")),
    "mass is true": ("mass = 2\n", "mass = true\n", 7, ("True", "must be a number")),
    "mass is infinite": ("mass = 2\n", "mass = inf\n", 7, ("positive finite",)),
    "mass is huge": ("mass = 2\n", f"mass = {10**400}\n", 7, ("too large",)),
    "impossible inertia": ("[0.1, 0.2, 0.1]", "[0.1, 0.2, 0.9]", 8, ("triangle inequality",)),
    "ragged inertia": ("[0.1, 0.2, 0.1]", "[0.1, [0.2], 0.1]", 8, ("3 principal values",)),
    "type of a body": ('"PointMass"', '"Pointmass"', 12, ("'PointMass'",)),
    "shape beside mass": ("mass = 2\n", "mass = 2\nshape = { type = 'rod', length = 1 }\n", 7, ("beside shape",)),
    "unknown shape": (INERTIA, "shape = { type = 'bx' }", 7, ("'bx'", "type box")),
    "shape is a list": (INERTIA, "shape = { type = [1] }", 7, ("[1]", "type box")),
    "shape lacks a length": (INERTIA, "shape = { type = 'rod', mass = 1 }", 7, ("lacks length",)),
    "shape without mass": (INERTIA, "shape = { type = 'sphere', radius = 1 }", 7, ("density",)),
    "drawn is a table": (INERTIA, f"{INERTIA}\ndrawn = {{ type = 'Box' }}", 9, ("list of tables",)),
    "drawn is unknown": (INERTIA, f"{INERTIA}\ndrawn = [{{ type = 'Bx' }}]", 9, ("'Bx'", "type Box")),
    "drawn is a point": (INERTIA, f"{INERTIA}\ndrawn = [{{ type = 'Sphere', radius = 0 }}]", 9, ("positive",)),
    "drawn lacks a size": (INERTIA, f"{INERTIA}\ndrawn = [{{ type = 'Box' }}]", 9, ("Box lacks size",)),
    "axis of a shape": (INERTIA, "shape = { type = 'rod', mass = 1, length = 1, axis = 'w' }", 7, ("'x'",)),
    "inertia of a particle": ("mass = 0.1\n", "mass = 0.1\ninertia = [1, 1, 1]\n", 14, ("'inertia'",)),
    "name in use": ('name = "bob"', 'name = "arm"', 11, ("'arm' is in use",)),
    "name is a number": ('name = "bob"', "name = 3", 11, ("text in quotes",)),
    "type of a constraint": ('"Revolute"', '"Revolut"', 16, ("'Revolut'", "Revolute?")),
    "no type": ('type = "Revolute"\n', "", 15, ("has no type",)),
    "force among constraints": ('"Distance"', '"Spring"', 22, ("no constraint", "[[force]]")),
    "plug-in": ('"Distance"', '"os.system"', 22, ("--allow-code",)),
    "normalisation": ('"Distance"', '"EulerNormalization"', 22, ("by itself",)),
    "force of code": ('"PointForce"', '"UserForce"', 31, ("lacks function", "no")),
    "unknown body": ('b = "arm"', 'b = "amr"', 19, ("'amr'", "did you mean 'arm'")),
    "body is a list": ('b = "arm"', 'b = ["arm"]', 19, ("no body",)),
    "no second body": ('b = "arm"\n', "", 15, ("lacks b",)),
    "same bodies": ('a = "ground"\nb = "arm"', 'a = "arm"\nb = "arm"', 15, ("to itself",)),
    "key of at": ("axis = [", "axes = [", 20, ("'axes'", "axis")),
    "zero axis": ("axis = [0, 1, 0]", "axis = [0, 0, 0]", 20, ("length zero",)),
    "marker beside at": ('b = "arm"\nat', 'b = "arm"\npoint_a = [0, 0, 0]\nat', 20, ("within at",)),
    "at is a list": ("{ point = [0, 0, 0], axis = [0, 1, 0] }", "[0, 0, 0]", 20, ("write at = {",)),
    "unknown function": ("sin(t)", "sine(t)", 25, ("'sine'", "sin")),
    "unknown variable": ("sin(t)", "sin(x)", 25, ("'x'",)),
    "unfinished expression": ("sin(t)", "sin(t", 25, ("no expression",)),
    "code": ("sin(t)", "__import__('os').system('true')", 25, ("no arithmetic",)),
    "attribute": ("sin(t)", "t.__class__", 25, ("no arithmetic",)),
    "negative length": ("1.2 +", "-1.2 +", 25, ("must be positive",)),
    "no such joint": ('joint = "hinge"', 'joint = "hing"', 28, ("did you mean 'hinge'",)),
    "joint of another class": ('joint = "hinge"', 'joint = "Distance(arm, bob)"', 26, ("must be a Revolute",)),
    "friction lacks a number": ("kinetic = 0.1\n", "", 26, ("lacks kinetic",)),
    "negative friction": ("kinetic = 0.1", "kinetic = -0.1", 30, ("not negative",)),
    "load of two": ("[0, 0, { times", "[0, { times", 34, ("force",)),
    "table without values": ("values = [0, 1]", "value = [0, 1]", 34, ("times, values and kind",)),
    "times go back": ("times = [0, 1]", "times = [1, 0]", 34, ("each after the one before",)),
    "unknown frame": ('frame = "body"', 'frame = "boddy"', 35, ("write 'body'",)),
    "values of joints": ("assemble = true", "assemble = true\njoints = 5", 38, ("table of numbers by name",)),
    "assemble is a number": ("assemble = true", "assemble = 1", 37, ("true or false",)),
    "run ends first": ("end = 1.0", "end = -1.0", 38, ("after the start",)),
    "unknown method": ('"RK45"', '"RK54"', 40, ("RK45",)),
    "argument of a method": ("rtol = 1e-9", "rtoll = 1e-9", 40, ("rtoll", "did you mean rtol")),
    "tolerance of a method": ("rtol = 1e-9", "rtol = -1e-9", 40, ("positive",)),
    "unknown parameter": ('"arm.mass" =', '"arm.mas" =', 45, ("did you mean arm.mass")),
    "unknown spread": ("uniform", "unifrm", 45, ("{ uniform = [low, high] }",)),
    "spread of three": (SPREAD, "uniform = [1, 2, 3]", 45, ("two values",)),
    "spread of text": (SPREAD, 'uniform = [1, "two"]', 45, ("unknown name", "'two'")),
    "negative deviation": (SPREAD, "normal = [1, -1]", 45, ("must not be negative",)),
    "spread of a motion": (SPREAD, 'uniform = [1, "2 + t"]', 45, ("depends on the time",)),
    "shape of a parameter": (POINT, '"hinge.point_a" = [0, 0]', 46, ("(3,)",)),
    "ragged cases": (POINT, '"hinge.point_a" = [[0, 0, 0], [0, 0]]', 46, ("different lengths",)),
    "infinite case": (POINT, '"bob.mass" = [1, inf, 2]', 46, ("finite",)),
    "numbers of cases": (POINT, '"bob.mass" = [1, 2]', 41, ("bob.mass 2", "cases 3")),
    "no cases": ("cases = 3\n", "", 41, ("cases = 100",)),
    "cases is text": ("cases = 3", 'cases = "3"', 42, ("whole number from 1 to",)),
    "too many cases": ("cases = 3", "cases = 100000000", 42, ("from 1 to 1000000",)),
    "body to assemble": ('["bob"]', '["bobb"]', 43, ("names of bodies",)),
    "grid is a number": ("cases = 3", "grid = 3", 42, ("true or false",)),
    "keep": ("cases = 3", 'keep = "last"', 42, ("'t_eval'",)),
    "nothing varies": ("[ensemble.parameters]", "[ensemble.parmeters]", 44, ("'parmeters'", "parameters?")),
    "output above": ('["a.h5"]', '["../a.h5"]', 48, ("below the working folder",)),
    "output elsewhere": ('["a.h5"]', '["/etc/a.h5"]', 48, ("below the working folder",)),
    "output is text": ('["a.h5"]', '"a.h5"', 48, ("list of paths",)),
    "key of the output": ("files =", "file =", 48, ("'file'", "files")),
    "unknown option": ("end = 1.0\n", "end = 1.0\nto = 3\n", 40, ("'to'",)),
}  # fmt: skip

MODULE = """
import tsdyn as ts

class Pair(ts.Joint):
    markers = (ts.Point("a"), ts.Point("b"))

    def compose(self):
        yield "pair", ts.constraints.Spherical(self.a, self.b)
"""
PLUGGED = """
version = 1
[[body]]
name = "bob"
mass = 1
inertia = [1, 1, 1]
[[constraint]]
type = "pair_of_a_file.Pair"
a = "bob"
b = "ground"
"""


def load(text, folder):
    path = folder / "scene.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return ts.load(path)


def test_the_right_file(tmp_path):
    scene = load(RIGHT, tmp_path)
    assert ts.simulate(scene, (0.0, 0.01), integrator="dop853").constraint_error.position.max() < 1e-14
    assert len(load(TEXT, tmp_path).bodies) == 1


def test_shapes_give_mass_and_inertia(tmp_path):
    shape = "shape = { type = 'box', size = ['2 * length', 0.2, 0.3], density = 100 }"
    arm = load(RIGHT.replace(INERTIA, shape), tmp_path).bodies[0]
    box = ts.shapes.box((1.0, 0.2, 0.3), density=100)
    assert arm.mass == box.mass
    np.testing.assert_array_equal(arm.inertia, box.inertia)


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_is_named_with_its_line(name, tmp_path):
    old, new, line, words = WRONG[name]
    assert RIGHT.count(old) >= 1
    with pytest.raises(ts.InvalidFile) as caught:
        load(RIGHT.replace(old, new, 1), tmp_path)
    message = str(caught.value)
    lines = [found for found, _, _ in caught.value.mistakes]
    assert line in lines, message
    assert f"scene.toml:{line}:" in message
    said = " ".join(text for found, _, text in caught.value.mistakes if found == line)
    assert all(word in said for word in words), message


def test_all_mistakes_at_once(tmp_path):
    several = [WRONG[name] for name in ("negative mass", "unknown body", "code", "unknown frame", "unknown method")]
    text = RIGHT
    for old, new, _, _ in several:
        text = text.replace(old, new, 1)
    with pytest.raises(ts.InvalidFile) as caught:
        load(text, tmp_path)
    assert [line for _, _, line, _ in several] == [line for line, _, _ in caught.value.mistakes]


def test_bodies_of_an_item_of_unknown_type(tmp_path):
    text = "version = 1\n[[constraint]]\ntype = 'Revolut'\na = 'ground'\nb = 'am'\n"
    with pytest.raises(ts.InvalidFile) as caught:
        load(text, tmp_path)
    assert [line for line, _, _ in caught.value.mistakes] == [3, 5]


def test_a_start_that_cannot_be_assembled(tmp_path):
    with pytest.raises(ts.InvalidFile, match="arm, bob held fixed"):
        load(RIGHT.replace("1.2 + 0.0", "9.0 + 0.0").replace("[start]", '[start]\nfixed = ["arm", "bob"]'), tmp_path)


def test_files_that_are_none(tmp_path):
    for text in (b"\xff\xfe\x00", b"version = 1\n\x00", b"\xef\xbb\xbf" + b"version = 1\nx=\xc3"):
        with pytest.raises((ts.StorageError, ts.InvalidFile), match=re.escape("scene.toml")):
            load(text, tmp_path)
    with pytest.raises(ts.StorageError, match="can't be read"):
        ts.load(tmp_path / "missing.toml")
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(ts.StorageError, match="can't be read"):
        ts.load(tmp_path / "folder.toml")
    with pytest.raises(ts.InvalidFile, match="TOML"):
        load("version = " + "[" * 5000, tmp_path)


def test_code_of_plug_ins_is_imported_only_if_allowed(tmp_path, monkeypatch):
    (tmp_path / "pair_of_a_file.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ts.InvalidFile, match="allow-code"):
        load(PLUGGED, tmp_path)
    assert ts.load(tmp_path / "scene.toml", allow_code=True).constraints[0].rows == 3


def fuzzed(rng, text):
    """A text with a few bytes, lines or words changed."""
    data = bytearray(text.encode())
    for _ in range(rng.integers(1, 6)):
        at, way = int(rng.integers(len(data))), rng.integers(5)
        if way == 0:
            data[at] = int(rng.integers(256))
        elif way == 1:
            del data[at : at + int(rng.integers(1, 12))]
        elif way == 2:
            data[at:at] = rng.choice(
                [b"[", b"]", b'"', b"=", b"{", b"\n", b"nan", b"1e999", b"-1", b"[[body]]\n", b"t"]
            )
        else:
            lines = bytes(data).split(b"\n")
            i, j = rng.integers(len(lines), size=2)
            lines[i] = lines[j] if way == 3 else lines[i][::-1]
            data = bytearray(b"\n".join(lines))
        if not data:
            return b""
    return bytes(data)


FORBIDDEN = ("os.system", "subprocess.Popen", "os.exec", "os.posix_spawn", "os.remove", "os.rename", "socket.connect")
watched = []  # the folder that files are read from, while they are


def watch(event, arguments):
    """An audit hook: while a file is read, nothing is started, removed or written."""
    if watched and (event in FORBIDDEN or (event == "open" and isinstance(arguments[1], str) and "w" in arguments[1])):
        raise AssertionError(f"{event} {arguments}")


def hanging(number, frame):
    raise AssertionError("a file takes a minute")


@pytest.fixture
def watching():
    if not hasattr(watch, "added"):
        watch.added = sys.addaudithook(watch)
    yield
    watched.clear()


def fuzz(seeds, folder):
    """How many of the files are refused; every error but a TsdynError, and every side effect, fails."""
    wrong, texts = 0, (RIGHT, TEXT, (ROOT / "examples" / "four_bar.toml").read_text())
    path, before = folder / "scene.toml", signal.signal(signal.SIGALRM, hanging)
    for seed in seeds:
        text = fuzzed(np.random.default_rng(seed), texts[seed % len(texts)])
        path.write_bytes(text)
        watched.append(folder)
        signal.alarm(60)
        try:
            ts.load(path)
        except ts.TsdynError:
            wrong += 1
        except BaseException as error:
            raise AssertionError(f"seed {seed}: {type(error).__name__}: {error}\n{text!r}") from error
        finally:
            signal.alarm(0)
            watched.clear()
    signal.signal(signal.SIGALRM, before)
    return wrong


def test_the_watch_sees_what_a_file_must_not_do(watching, tmp_path):
    watched.append(tmp_path)
    with pytest.raises(AssertionError, match=r"os\.system"):
        os.system("true")
    with pytest.raises(AssertionError, match="open"):
        (tmp_path / "made").write_text("")


def test_fuzzed_files(watching, tmp_path):
    assert fuzz(range(150), tmp_path) > 75


@pytest.mark.slow
def test_many_fuzzed_files(watching, tmp_path):
    assert fuzz(range(1000, 11000), tmp_path) > 5000
