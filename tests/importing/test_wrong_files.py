"""Wrong URDF, MJCF and SDF files: refused with line and reason, never a raw error, nothing executed."""

import random
import re
import warnings
from contextlib import suppress
from pathlib import Path

import pytest

import tsdyn as ts

pytest.importorskip("lxml")
MODELS = Path(__file__).parent / "models"
ARM, FOUR_BAR = (MODELS / "arm.urdf").read_text(), (MODELS / "four_bar.sdf").read_text()


def refusal(folder, content, name="robot.urdf"):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ts.InvalidFile) as caught:
        ts.load(path)
    return caught.value


WRONG = {
    "no XML": ("<robot", "no XML"),
    "empty": ("", "no XML"),
    "another root": ("<html/>", "the root element <html> is of no known format"),
    "no links": ("<robot name='r'/>", "has no links"),
    "unknown type": (ARM.replace('"continuous"', '"continous"'), "unknown type 'continous'"),
    "unknown link": (ARM.replace('child link="arm"', 'child link="amr"'), "there is no link 'amr'"),
    "text for a number": (ARM.replace('value="2.5"', 'value="heavy"'), "must be 1 finite number"),
    "not finite": (ARM.replace('value="2.5"', 'value="nan"'), "must be 1 finite number"),
    "two numbers": (ARM.replace('xyz="0.3 0 0"', 'xyz="0.3 0"'), "must be 3 finite numbers"),
    "negative mass": (ARM.replace('value="2.5"', 'value="-2.5"'), "the mass -2.5 kg is negative"),
    "two parents": (ARM.replace('child link="camera"', 'child link="arm"'), "two parents"),
    "circle": (ARM.replace('child link="camera"', 'child link="base"'), "circle"),
    "same name": (ARM.replace('link name="camera"', 'link name="tool"'), "two links named 'tool'"),
    "no axis": (ARM.replace('xyz="1 0 0.2"', 'xyz="0 0 0"'), "the axis has length zero"),
    "no mass": ("<robot name='r'><link name='a'/></robot>", "no link moves"),
    "entities": ("<!DOCTYPE r [<!ENTITY a 'x'><!ENTITY b '&a;&a;'>]><robot name='&b;'/>", "DOCTYPE"),
    "a file as entity": ("<!DOCTYPE r [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><robot>&a;</robot>", "DOCTYPE"),
    "a file as attribute": (
        "<!DOCTYPE r [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><robot name='&a;'/>",
        "external entity",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_urdf(case, tmp_path):
    content, message = WRONG[case]
    error = refusal(tmp_path, content)
    assert message in str(error)
    assert all(line >= 1 and column >= 1 for line, column, _ in error.mistakes)


def test_all_mistakes_at_once(tmp_path):
    error = refusal(tmp_path, ARM.replace('value="2.5"', 'value="x"').replace('child link="arm"', 'child link="amr"'))
    assert len(error.mistakes) >= 2
    line = next(i for i, text in enumerate(ARM.splitlines(), 1) if 'value="2.5"' in text)
    assert any(found == line for found, _, _ in error.mistakes)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (FOUR_BAR.replace("<parent>crank", "<parent>cramk"), "no link 'cramk'"),
        (FOUR_BAR.replace('relative_to="crank"', 'relative_to="coupler"'), "circle"),
        (FOUR_BAR.replace('type="ball"', 'type="bal"'), "unknown type 'bal'"),
        (FOUR_BAR.replace("<mass>1.2", "<mass>-1"), "negative"),
        (FOUR_BAR.replace("<xyz>0 1 0", "<xyz>0 0 0", 1), "length zero"),
        ("<sdf version='1.9'/>", "no <model>"),
        (FOUR_BAR.replace('<link name="coupler">', "<link>"), "<link> lacks name"),
        (FOUR_BAR.replace('<joint name="pin" ', "<joint "), "<joint> lacks name"),
    ],
)
def test_sdf(wrong, message, tmp_path):
    assert message in str(refusal(tmp_path, wrong, "robot.sdf"))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("<mujoco><worldbody><body><joint axis='0 0 0'/><geom size='1'/></body></worldbody></mujoco>", "MuJoCo"),
        ("<mujoco><worldbdy/></mujoco>", "worldbdy"),
        ("<mujoco><include file='nothing.xml'/></mujoco>", "nothing.xml"),
        ("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>", "mass and inertia"),
        ("<mujoco/>", "no link moves"),
        (
            "<mujoco><asset><mesh name='m' file='gone.stl'/></asset><worldbody><body name='b'><joint/>"
            "<geom type='mesh' mesh='m'/></body></worldbody></mujoco>",
            "gone.stl",
        ),
    ],
)
def test_mjcf(wrong, message, tmp_path):
    pytest.importorskip("mujoco")
    assert message in str(refusal(tmp_path, wrong, "robot.xml"))


def test_files_that_are_not_there_or_too_large(tmp_path, monkeypatch):
    with pytest.raises(ts.StorageError, match="can't be read"):
        ts.load(tmp_path / "none.urdf")
    monkeypatch.setattr("tsdyn.importing.xml_file.LARGEST", 100)
    with pytest.raises(ts.StorageError, match="100 are as many"):
        ts.load(MODELS / "arm.urdf")
    with pytest.raises(ts.InvalidArgument, match="expand the macros"):
        ts.load(tmp_path / "robot.urdf.xacro")


def test_deep_files(tmp_path):
    assert "no XML" in str(refusal(tmp_path, "<a>" * 100_000))


@pytest.mark.parametrize("name", ["lxml", "mujoco"])
def test_missing_parsers(name, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, name, None)
    with pytest.raises(ts.MissingDependency, match=re.escape("pip install 'tsdyn[import]'")):
        ts.load(MODELS / "leg.xml")


@pytest.mark.parametrize("name", ["arm.urdf", "four_bar.sdf", "leg.xml"])
def test_fuzzed_files(name, tmp_path):
    pytest.importorskip("mujoco")
    data, rng = (MODELS / name).read_bytes(), random.Random(7)
    for _ in range(60):
        wrong = bytearray(data)
        for _ in range(rng.choice((1, 2, 5))):
            at = rng.randrange(len(wrong))
            wrong[at : at + rng.choice((0, 1, 5, 50))] = rng.choice(
                (b"", b"0", b"nan", b"-1", b"<", b'"', b"\xff", b"1e400")
            )
        path = tmp_path / name
        path.write_bytes(wrong)
        with warnings.catch_warnings(action="ignore", category=ts.ImportLosses), suppress(ts.TsdynError):
            ts.load(path)
