"""Numbers of the table `parameters` of a scene file are parameters of the scene: as if the file had been edited."""

import copy
import json
import pickle
from pathlib import Path

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.commands import called
from tests.helpers.tolerances import HELD

TEXT = """\
version = 1
gravity = [0, 0, -10]
[parameters]
length = 1.5
half = "length / 2"
stiffness = 3.0
pulse = 2.0
tilt = 0.3
[[body]]
name = "bar"
shape = { type = "rod", length = "length", axis = "x", mass = "2 * length" }
position = ["half * cos(tilt)", 0, "-half * sin(tilt)"]
orientation = ["cos(tilt / 2)", 0, "sin(tilt / 2)", 0]
[[constraint]]
type = "Revolute"
name = "hinge"
a = "ground"
b = "bar"
at = { point = [0, 0, 0], axis = [0, 1, 0] }
[[force]]
type = "Spring"
name = "spring"
a = "bar"
b = "ground"
point_a = ["half", 0, 0]
point_b = ["2 * length", 0, 0.5]
stiffness = "stiffness"
[[force]]
type = "PointForce"
name = "push"
a = "bar"
force = [0, 0, "sin(pulse * t)"]
[start]
set = { joint = "hinge", rate = "pulse" }
"""


def read(tmp_path, text=TEXT):
    (tmp_path / "scene.toml").write_text(text)
    return ts.load(tmp_path / "scene.toml")


def edited(tmp_path, **values):
    """The scene of the file with other numbers in its text."""
    text = TEXT
    for name, value in values.items():
        line = next(line for line in TEXT.splitlines() if line.startswith(f"{name} = "))
        text = text.replace(line, f"{name} = {value!r}")
    (tmp_path / "edited").mkdir(exist_ok=True)
    return read(tmp_path / "edited", text)


def demand_same(one, other):
    """The same bits of all parameters, and of a run."""
    assert list(one.parameters()) == list(other.parameters())
    for name, value in one.parameters().items():
        np.testing.assert_array_equal(value, other.parameters()[name], err_msg=name)
    runs = [ts.simulate(scene, (0.0, 1.0)) for scene in (one, other)]
    for name in ("t", "q", "qd", "multipliers"):
        np.testing.assert_array_equal(getattr(runs[0], name), getattr(runs[1], name))
    np.testing.assert_array_equal(runs[0].angle("hinge"), runs[1].angle("hinge"))


@pytest.mark.parametrize(
    "values",
    [{"length": 2.0}, {"half": 1.0}, {"stiffness": 7.0, "tilt": -0.5}, {"pulse": 5.0}, {"length": 1, "pulse": 9.0}],
)
def test_one_number_is_as_if_the_file_had_been_edited(values, tmp_path):
    scene = read(tmp_path)
    assert scene.parameters()["length"] == 1.5
    other = scene.with_parameters(values)
    demand_same(other, edited(tmp_path, **values))
    demand_same(scene, read(tmp_path))  # which has not changed


def test_what_follows_from_one_length(tmp_path):
    """Mass 2 L, inertia m L^2 / 12, the joint at the end, the free length of the spring, expressions of the table."""
    other = read(tmp_path).with_parameters({"length": 3.0, "tilt": 0.0})
    np.testing.assert_allclose(other["bar"].inertia, np.diag([0.0, 4.5, 4.5]), atol=HELD)
    np.testing.assert_allclose(other["hinge"].point_b, [-1.5, 0, 0], atol=HELD)
    assert other["bar"].mass == 6.0
    assert other["spring"].free_length == pytest.approx(np.hypot(3.0, 0.5), abs=HELD)
    assert other.parameters()["half"] == 1.5
    assert {name: other.parameters().units[name] for name in ("half", "bar.mass")} == {"half": "", "bar.mass": "kg"}


def test_changes_one_after_the_other(tmp_path):
    """A number of the file keeps what was set before, of the file and of bodies, on the scene and on copies."""
    scene = read(tmp_path).with_parameters({"length": 2.0}).with_parameters({"bar.mass": 5.0})
    scene = pickle.loads(pickle.dumps(copy.deepcopy(scene.copy()))).with_parameters({"stiffness": 4.0})
    assert (scene.parameters()["length"], scene["bar"].mass, scene["spring"].stiffness) == (2.0, 5.0, 4.0)
    assert scene["bar"].inertia[2, 2] == pytest.approx(4.0 * 2.0**2 / 12)
    own = read(tmp_path)
    own["spring"].damping, own.gravity = 0.5, (0, 0, -1)
    other = own.with_parameters({"length": 2.0})
    assert other["spring"].damping == 0.5
    np.testing.assert_array_equal(other.gravity, (0, 0, -1))
    handle = own["bar"]
    assert other[handle].mass == 4.0
    assert ts.simulate(other, (0, 0.1)).position(handle).shape[1] == 3


def test_a_body_and_a_joint_of_one_name(tmp_path):
    scene = read(tmp_path, TEXT.replace('"hinge"', '"bar"', 1).replace('joint = "hinge"', 'joint = "bar"'))
    scene.body("bar").mass = 9.0
    other = scene.with_parameters({"length": 2.0})
    assert (other.body("bar").mass, other.body("bar").inertia[1, 1]) == (9.0, pytest.approx(4.0 * 4.0 / 12))


def test_ensembles_sweep_numbers_of_the_file(tmp_path):
    scene, lengths = read(tmp_path), [1.0, 1.5, 2.5]
    found = ts.ensemble(scene, {"length": lengths, "bar.mass": [1.0, 2.0, 3.0]}, (0, 1), keep=["hinge.angle"])
    assert found.success.all()
    for i, length in enumerate(lengths):
        alone = edited(tmp_path, length=length)
        alone["bar"].mass = i + 1.0
        angle = ts.simulate(alone, (0, 1)).angle("hinge")[-1]
        assert found.kept["hinge.angle"][i] == found.case(i).angle("hinge")[-1] == angle
    again = ts.load(found.save(tmp_path / "a.h5"))
    assert again.case(2).angle("hinge")[-1] == angle
    by_case = ts.ensemble(scene, lambda i: {"length": lengths[i]} if i else {"bar.mass": 2.0}, (0, 1), cases=3)
    assert by_case.success.all()
    np.testing.assert_array_equal(by_case.q[2], ts.simulate(edited(tmp_path, length=2.5), (0, 1)).q[-1])
    stored = ts.ensemble(scene, {"length": lengths}, (0, 1), store=tmp_path / "a.zarr", threads=2)
    np.testing.assert_array_equal(stored.q[2], by_case.q[2])


def test_one_length_of_a_closed_loop():
    """A driven four-bar that its file assembles, with friction of a joint: its links have the lengths of the case."""
    path = Path(__file__).parents[2] / "examples" / "four_bar.toml"
    scene = ts.load(path)
    found = ts.ensemble(scene, {"crank": [0.25, 0.3]}, (0, 0.2), keep=["rocker.position", "bearing.angle"])
    assert found.success.all(), found.message
    alone = ts.simulate(scene, (0, 0.2))
    assert found.kept["rocker.position.x"][1] == alone.position("rocker")[-1, 0]
    np.testing.assert_allclose(
        found.kept["bearing.angle"], alone.angle("bearing")[-1], atol=HELD
    )  # as the motor drives
    short = scene.with_parameters({"crank": 0.25})
    pins = [ts.simulate(short, (0, 0.2)).position("coupler", point=(sign * 0.45, 0, 0)) for sign in (-1, 1)]
    np.testing.assert_allclose(np.linalg.norm(pins[0], axis=1), 0.25, atol=HELD)  # of the crank
    np.testing.assert_allclose(np.linalg.norm(pins[1] - [0.8, 0, 0], axis=1), 0.7, atol=HELD)  # of the rocker


def test_runs_that_are_prepared(tmp_path):
    run = ts.prepare(read(tmp_path)).with_parameters({"length": 2.0})
    np.testing.assert_array_equal(run((0, 1)).q, ts.simulate(edited(tmp_path, length=2.0), (0, 1)).q)


def test_a_study_of_a_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    study = (
        '[ensemble]\nkeep = ["bar.position.x"]\n[ensemble.parameters]\nlength = { linspace = [1, 2, 3] }\ntilt = 0\n'
    )
    (tmp_path / "study.toml").write_text(TEXT + "[run]\nend = 1e-9\n" + study)
    found = json.loads(called(capsys, "ensemble", "study.toml", "--json")[1])
    assert found["final"]["bar.position.x (m)"]["50 %"] == pytest.approx(0.75, abs=1e-6)
    (tmp_path / "cases.csv").write_text("length,bar.mass\n1.0,2.0\n4.0,3.0\n")
    words = "ensemble", "study.toml", "--parameters", "cases.csv", "--channels", "spring.length", "--json"
    assert json.loads(called(capsys, *words)[1])["ended"] == {"success": 2}
    assert "length" in called(capsys, "info", "study.toml", "--parameters")[1]


def test_a_saved_scene_keeps_its_numbers_while_it_is_as_its_file_says(tmp_path):
    scene = read(tmp_path).with_parameters({"length": 2.0})
    again = ts.load(scene.save(tmp_path / "a.toml"))
    demand_same(again, scene)
    demand_same(again.with_parameters({"tilt": 0.1}), edited(tmp_path, length=2.0, tilt=0.1))
    scene.add(ts.forces.PointForce(scene["bar"], force=lambda t: (0.0, 0.0, t), name="gust"))
    with pytest.raises(ts.InvalidArgument, match=r"gust.*function"):
        scene.save(tmp_path / "b.toml")
    scene.remove("gust")
    scene["bar"].mass = 3.0
    bare = ts.load(scene.save(tmp_path / "b.toml"))
    assert "length" not in bare.parameters()
    assert bare["bar"].mass == 3.0


WRONG = {
    "length": (-1.0, r"with length = -1, .*scene.toml:11:\d+: body 'bar': rod: length \(m\) must be a positive"),
    "half": (np.nan, r"half, of \[parameters\], must be a finite number, got nan"),
    "pulse": ("fast", r"pulse, of \[parameters\], must be a finite number, got 'fast'"),
    "lenght": (1.0, "the scene has no parameter 'lenght'; did you mean length"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_numbers(name, tmp_path):
    value, said = WRONG[name]
    with pytest.raises(ts.InvalidArgument, match=f"(?s){said}"):
        read(tmp_path).with_parameters({name: value})


def test_a_wrong_number_fails_its_case_alone(tmp_path):
    found = ts.ensemble(read(tmp_path), {"length": [1.0, -1.0]}, (0, 0.1))
    assert found.success.tolist() == [True, False]
    assert "with length = -1" in found.message[1]


def test_a_scene_with_other_parts_than_its_file_says_so(tmp_path):
    scene = read(tmp_path)
    scene.remove("spring")
    assert scene.with_parameters({"bar.mass": 2.0})["bar"].mass == 2.0
    with pytest.raises(ts.InvalidArgument, match="length: the scene has other parts than its file"):
        scene.with_parameters({"length": 2.0})


def test_a_number_with_the_name_of_gravity_is_left_to_the_scene(tmp_path):
    scene = read(
        tmp_path, TEXT.replace("gravity = [0, 0, -10]\n", "").replace("length = 1.5", "length = 1.5\ngravity = 3")
    )
    np.testing.assert_array_equal(scene.parameters()["gravity"], (0, 0, -9.81))
