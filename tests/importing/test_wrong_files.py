"""Wrong URDF, MJCF and SDF files: refused with line and reason, never a raw error, nothing executed."""

import os
import random
import re
import warnings
from contextlib import suppress
from pathlib import Path

import pytest

import tsdyn as ts

pytest.importorskip("lxml")
MODELS = Path(__file__).parent / "models"
LEG = (MODELS / "leg.xml").read_text().replace('<include file="ball.xml"/>', "")
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
    "huge mass": (ARM.replace('value="2.5"', 'value="1e60"'), "is beyond 1e+50"),
    "huge inertia": (ARM.replace('ixx="0.1"', 'ixx="1e307"'), "is beyond 1e+50"),
    "huge place": (ARM.replace('xyz="0.3 0 0"', 'xyz="1e200 1e200 0"'), "is beyond 1e+50"),
    "huge offset": (
        ARM.replace('<child link="ram"/>', '<child link="ram"/><mimic joint="turn" multiplier="2" offset="-1e300"/>'),
        "its offset is beyond 1e+50",
    ),
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
            LEG.replace('pos="0 0.01 0"', 'pos="1e308 1e308 1e308"'),
            "joint 'hip_y': its place or its offset is beyond 1e+50",
        ),
        (LEG.replace('kp="30"', 'kp="30" gear="1e200"'), "stiffness"),
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
    with pytest.raises(ts.StorageError, match=r"too large: .* may have 100 at most"):
        ts.load(MODELS / "arm.urdf")
    with pytest.raises(ts.InvalidArgument, match="expand the macros"):
        ts.load(tmp_path / "robot.urdf.xacro")


MADE = {
    "height field": ("<asset><hfield name='h' nrow='100000' ncol='100000' size='1 1 1 1'/></asset>", "cells"),
    "copies": ("<worldbody><replicate count='3000000'><body/></replicate></worldbody>", "objects"),
    "copies of copies": (
        "<worldbody>" + "<replicate count='99'>" * 9 + "<body/>" + "</replicate>" * 9 + "</worldbody>",
        "objects",
    ),
    "a cable": ("<worldbody><composite type='cable' count='1000000 1 1'/></worldbody>", "objects"),
    "a soft body": ("<worldbody><flexcomp name='f' type='grid' count='999 999 999'/></worldbody>", "objects"),
    "infinitely many": ("<worldbody><replicate count='inf'><body/></replicate></worldbody>", "objects"),
    "long names": (
        f"<worldbody><replicate count='9999'><body name='{'n' * 10_000}'/></replicate></worldbody>",
        "objects",
    ),
    "a torus": ("<asset><mesh name='m' builtin='supertorus' params='9999 .5 1 1'/></asset>", "vertices"),
}


@pytest.mark.parametrize("case", MADE)
def test_mjcf_that_makes_too_much(case, tmp_path):
    pytest.importorskip("mujoco")
    content, word = MADE[case]
    assert word in str(refusal(tmp_path, f"<mujoco>{content}</mujoco>", "m.xml"))


def test_rooms_of_mjcf_are_not_made(tmp_path):
    """What a scene lacks takes no memory: data of the user's, keyframes, sensors, the stack of MuJoCo."""
    pytest.importorskip("mujoco")
    rooms = "<size memory='900T' nuserdata='2000000000' nuser_geom='2000000000' nkey='2000000000'/>"
    rooms += "<custom><numeric name='n' size='100'/></custom>"
    body = "<body><joint axis='0 1 0'/><geom size='1' pos='1 0 0' user='1 2'/></body>"
    path = tmp_path / "m.xml"
    path.write_text(f"<mujoco>{rooms}<worldbody>{body}</worldbody></mujoco>")
    with warnings.catch_warnings(action="ignore", category=ts.ImportLosses):
        scene = ts.load(path)
    assert "number of the user's (1): n" in str(scene.imported)


def test_models_that_contain_each_other(tmp_path):
    """Sixteen attached models, each twice in the next one; one that attaches itself; one that includes itself."""
    pytest.importorskip("mujoco")
    head = "<mujoco model='{0}'><asset><model name='m' file='{1}.xml'/></asset><worldbody>"
    attach = "<frame><attach model='m' body='b' prefix='{0}'/></frame>"
    (tmp_path / "0.xml").write_text("<mujoco><worldbody><body name='b'><geom size='1'/></body></worldbody></mujoco>")
    for i in range(1, 17):
        twice = f"<body name='b'>{attach.format('x')}{attach.format('y')}</body></worldbody></mujoco>"
        (tmp_path / f"{i}.xml").write_text(head.format(i, i - 1) + twice)
    (tmp_path / "self.xml").write_text(head.format("s", "self") + "</worldbody></mujoco>")
    (tmp_path / "again.xml").write_text("<mujoco><include file='again.xml'/></mujoco>")
    for name, word in (("16", "objects"), ("self", "contains itself"), ("again", "included twice")):
        with pytest.raises(ts.InvalidFile, match=word):
            ts.load(tmp_path / f"{name}.xml")


def test_files_that_include_each_other_in_a_long_chain(tmp_path):
    pytest.importorskip("mujoco")
    for i in range(600):
        nested = "<body>" * 9 + f"<include file='{i + 1}.xml'/>" + "</body>" * 9
        (tmp_path / f"{i}.xml").write_text(f"<mujoco><worldbody>{nested}</worldbody></mujoco>")
    (tmp_path / "600.xml").write_text("<mujoco><worldbody/></mujoco>")
    with pytest.raises(ts.InvalidFile, match="too deeply"):
        ts.load(tmp_path / "0.xml")


def test_names_that_no_file_has(tmp_path):
    pytest.importorskip("mujoco")
    for name in ("x" * 5000, "a/" * 3000):
        for case in OUTSIDE.values():
            assert "no file" in str(refusal(tmp_path, f"<mujoco>{case.format(name)}</mujoco>", "m.xml"))
    folders = "".join(f"<compiler meshdir='{i}'/>" for i in range(99))
    assert "folders of meshes" in str(refusal(tmp_path, f"<mujoco>{folders}</mujoco>", "m.xml"))


OUTSIDE = {
    "include": "<include file='{0}'/>",
    "model": "<asset><model name='m' file='{0}'/></asset>",
    "mesh": "<asset><mesh name='m' file='{0}'/></asset><worldbody><body name='b'><joint/><geom type='mesh' mesh='m'/>"
    "</body></worldbody>",
    "height field": "<asset><hfield name='h' file='{0}' size='1 1 1 1'/></asset>",
    "soft body": "<worldbody><flexcomp name='f' type='mesh' file='{0}'/></worldbody>",
}


@pytest.mark.parametrize("way", ["up", "absolute", "link"])
@pytest.mark.parametrize("case", OUTSIDE)
def test_files_outside_are_read_only_if_asked_for(case, way, tmp_path):
    pytest.importorskip("mujoco")
    (tmp_path / "inside").mkdir()
    (tmp_path / "secret.stl").write_text("secret")
    (tmp_path / "inside" / "link.stl").symlink_to(tmp_path / "secret.stl")
    name = {"up": "../secret.stl", "absolute": str(tmp_path / "secret.stl"), "link": "link.stl"}[way]
    content = f"<mujoco>{OUTSIDE[case].format(name)}</mujoco>"
    assert "ts.load(path, outside=True)" in str(refusal(tmp_path / "inside", content, "m.xml"))
    with pytest.raises(ts.InvalidFile) as caught:  # it is read, and is of no use
        ts.load(tmp_path / "inside" / "m.xml", outside=True)
    assert "ts.load(path" not in str(caught.value)


@pytest.mark.parametrize("case", OUTSIDE)
def test_what_files_name_is_regular(case, tmp_path):
    pytest.importorskip("mujoco")
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "zero.stl").symlink_to("/dev/zero")
    for name in ("pipe.stl", "zero.stl"):
        (tmp_path / "m.xml").write_text(f"<mujoco>{OUTSIDE[case].format(name)}</mujoco>")
        with pytest.raises((ts.InvalidFile, ts.StorageError), match="regular file"):
            ts.load(tmp_path / "m.xml", outside=True)


@pytest.mark.parametrize("name", ["m.urdf", "m.xml", "m.sdf"])
def test_files_are_regular(name, tmp_path):
    os.mkfifo(tmp_path / name)
    with pytest.raises(ts.StorageError, match="regular file"):
        ts.load(tmp_path / name)


def test_too_many_elements(tmp_path, monkeypatch):
    monkeypatch.setattr("tsdyn.importing.xml_file.MOST", 100)
    assert "more than 100" in str(refusal(tmp_path, "<robot>" + "<link/>" * 101 + "</robot>"))
    attributes = " ".join(f"a{i}=''" for i in range(101))
    assert "more than 100" in str(refusal(tmp_path, f"<robot {attributes}/>"))


def test_long_chains_of_frames(tmp_path):
    """Each link placed in the next one, two thousand of them; and a circle of them."""
    link = "<link name='l{0}'><pose relative_to='{1}'>0.001 0 0 0 0 0</pose></link>"
    links = "".join(link.format(i, f"l{i + 1}" if i < 1999 else "__model__") for i in range(2000))
    hinge = (
        "<joint name='j' type='revolute'><parent>world</parent><child>l0</child><axis><xyz>0 1 0</xyz></axis></joint>"
    )
    path = tmp_path / "m.sdf"
    path.write_text(f"<sdf version='1.9'><model name='m'>{links}{hinge}</model></sdf>")
    assert ts.load(path).body("l0").position[0] == pytest.approx(2.0)
    circle = path.read_text().replace("__model__", "l0")
    assert "circle" in str(refusal(tmp_path, circle, "m.sdf"))


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


def test_files_outside_by_the_command_line(tmp_path, capsys):
    from tsdyn.cli import main

    (tmp_path / "inside").mkdir()
    (tmp_path / "part.xml").write_text("<mujocoinclude><visual/></mujocoinclude>")
    path = tmp_path / "inside" / "m.xml"
    path.write_text(LEG.replace("<worldbody>", "<include file='../part.xml'/><worldbody>"))
    assert main(["info", str(path)]) != 0
    assert "outside=True" in capsys.readouterr().err
    assert main(["info", str(path), "--outside"]) == 0
