"""tsdyn run, check, info, new and convert: what they print and write, and their exit codes."""

import json

import numpy as np
import pytest

import tsdyn as ts
from examples import four_bar
from tests.helpers.commands import called
from tests.helpers.processes import OF_CHECKOUT
from tsdyn.simulation.run_options import OF_RUN

FALL = 'version = 1\n[[body]]\nname = "stone"\ntype = "PointMass"\nmass = 1.0\nposition = [0, 0, 5]\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fall.toml").write_text(FALL)
    four_bar.build().save("bars.toml")
    return tmp_path


def test_run(folder, capsys):
    code, out, _ = called(capsys, "run", "bars.toml", "--to", "0.1")
    assert code == 0
    assert all(word in out for word in ("3 rigid bodies", "Taylor", "success at t = 0.1 s", "errors", "energy"))


def test_run_lasts_ten_seconds_by_default(folder, capsys):
    code, out, _ = called(capsys, "run", "fall.toml", "--json")
    found = json.loads(out)
    assert (code, found["reached"], found["success"]) == (0, 10.0, True)
    assert found["provenance"]["method"].startswith("Taylor")


def test_a_run_with_a_contact_counts_phases_and_impulses(folder, capsys):
    """A stone falls by 5 m, for 1.01 s, and stays."""
    (folder / "fall.toml").write_text(
        FALL + '[[constraint]]\ntype = "PlaneContact"\na = "stone"\nb = "ground"\nname = "floor"\n'
        "normal_b = [0, 0, 1]\nunilateral = true\n"
    )
    found = json.loads(called(capsys, "run", "fall.toml", "--to", "2", "--json")[1])
    assert (found["phases"], found["impulses"]) == (2, 1)
    found = json.loads(called(capsys, "run", "fall.toml", "--to", "1", "--json")[1])
    assert (found["phases"], found["impulses"]) == (1, 0)


def test_options_come_before_the_file(folder, capsys):
    (folder / "fall.toml").write_text(FALL + '[run]\nend = 0.2\nevery = 0.1\nmethod = "rk45"\nrtol = 1e-7\n')
    found = json.loads(called(capsys, "run", "fall.toml", "--json")[1])
    assert (found["reached"], found["outputs"]) == (0.2, 3)
    assert found["provenance"]["rtol"] == 1e-7
    words = "--to", "0.1", "--method", "dop853", "--rtol", "1e-5", "--every", "0.02"
    found = json.loads(called(capsys, "run", "fall.toml", "--json", *words)[1])
    assert (found["reached"], found["outputs"], found["provenance"]["rtol"]) == (0.1, 6, 1e-5)
    assert found["provenance"]["method"].startswith("DOP853")


def test_results(folder, capsys):
    outputs = [word for name in ("a.h5", "a.csv", "a.zarr") for word in ("--output", name)]
    code, out, _ = called(capsys, "run", "bars.toml", "--to", "0.1", *outputs)
    assert code == 0
    assert "written   a.csv" in out
    solution = ts.load("a.h5")
    np.testing.assert_array_equal(ts.load("a.zarr").q, solution.q)
    rows = np.genfromtxt("a.csv", delimiter=",", skip_header=1)
    np.testing.assert_array_equal(rows[:, 1:22], solution.q)
    header = (folder / "a.csv").read_text().splitlines()[0]
    assert header.startswith("time (s),q crank.x (m),")


def test_plot(folder, capsys):
    pytest.importorskip("matplotlib")
    assert called(capsys, "run", "fall.toml", "--to", "0.1", "--plot")[0] == 0
    assert (folder / "fall.png").read_bytes().startswith(b"\x89PNG")


def test_a_figure_that_the_file_asks_for_is_refused_before_the_run(folder, capsys):
    pytest.importorskip("matplotlib")
    (folder / "fall.toml").write_text(FALL + '[run]\nend = 0.1\n[output]\nplot = "nowhere/fall.png"\n')
    code, out, err = called(capsys, "run", "fall.toml")
    assert (code, out) == (1, "")
    assert "there is no folder" in err


def test_a_run_that_fails(folder, capsys):
    (folder / "fall.toml").write_text(
        FALL + "[run]\nmax_steps = 1\nend = 1.0\nmethod = { type = 'Nystrom4', step = 0.1 }\n"
    )
    code, out, err = called(capsys, "run", "fall.toml", "--output", "a.h5")
    assert code == 1
    assert "max_steps" in out
    assert err.startswith("tsdyn: ")
    assert not ts.load("a.h5").success


def test_check(folder, capsys):
    assert called(capsys, "check", "bars.toml")[0] == 0
    text = (folder / "bars.toml").read_text()
    (folder / "bars.toml").write_text(text.replace("Revolute", "Revolut", 1).replace("mass =", "mas =", 1))
    code, _, err = called(capsys, "check", "bars.toml")
    assert code == 1
    assert "2 mistakes" in err or "3 mistakes" in err
    code, out, _ = called(capsys, "check", "bars.toml", "--json")
    assert code == 1
    assert json.loads(out)["mistakes"][0]["line"] == 4


def test_check_compares_the_start_with_the_constraints(folder, capsys):
    text = (folder / "bars.toml").read_text()
    (folder / "bars.toml").write_text(text.replace("position = [0.12", "position = [0.13", 1))
    code, _, err = called(capsys, "check", "bars.toml")
    assert code == 1
    assert "initial position breaks" in err


def test_info(folder, capsys):
    code, out, _ = called(capsys, "info", "bars.toml")
    assert code == 0
    assert all(word in out for word in ("crank pin", "redundant rows", "Taylor", "degrees of freedom"))
    found = json.loads(called(capsys, "info", "bars.toml", "--json")[1])
    assert (found["degrees_of_freedom"], len(found["redundant_rows"])) == (1, 3)
    called(capsys, "run", "bars.toml", "--to", "0.1", "--output", "a.h5")
    assert "Provenance" in called(capsys, "info", "a.h5")[1]


def test_new(folder, capsys):
    assert called(capsys, "new")[0] == 0
    assert called(capsys, "run", "scene.toml", "--to", "0.1")[0] == 0
    code, _, err = called(capsys, "new")
    assert code == 1
    assert "exists" in err
    assert called(capsys, "new", "scene.txt")[0] == 1


@OF_CHECKOUT
def test_convert(folder, capsys):
    assert called(capsys, "convert", "four_bar", "again.toml")[0] == 0
    assert (folder / "again.toml").read_bytes() == (folder / "bars.toml").read_bytes()
    called(capsys, "run", "bars.toml", "--to", "0.1", "--output", "a.h5")
    for name in ("a.zarr", "a.csv", "b.h5"):
        assert called(capsys, "convert", "a.h5", name)[0] == 0
    np.testing.assert_array_equal(ts.load("b.h5").q, ts.load("a.h5").q)
    assert called(capsys, "convert", "bars.toml", "bars.h5")[0] == 1


def test_convert_keeps_a_scene_file_as_it_stands(folder, capsys):
    called(capsys, "new", "a.toml")
    before = (folder / "a.toml").read_text()
    assert "[parameters]" in before
    assert called(capsys, "convert", "a.toml", "b.toml")[0] == 0
    assert (folder / "b.toml").read_text() == before


def test_nothing_is_overwritten_unless_asked(folder, capsys):
    (folder / "cases.csv").write_text("stone.mass\n1.0\n2.0\n")
    (folder / "page.html").write_text("kept")
    kept = {path: path.read_bytes() for path in folder.iterdir()}
    for words in (
        ["convert", "bars.toml", "bars.toml"],
        ["convert", "four_bar", "bars.toml"],
        ["run", "fall.toml", "--to", "0.1", "--output", "cases.csv"],
        ["ensemble", "fall.toml", "--to", "0.1", "--parameters", "cases.csv", "--output", "cases.csv"],
        ["view", "fall.toml", "--to", "0.1", "--output", "page.html"],
    ):
        code, _, err = called(capsys, *words)
        assert (code, "exists" in err, "--force" in err) == (1, True, True)
    assert {path: path.read_bytes() for path in folder.iterdir()} == kept
    assert called(capsys, "run", "fall.toml", "--to", "0.1", "--output", "cases.csv", "--force")[0] == 0
    assert (folder / "cases.csv").read_text().startswith("time (s)")


@pytest.mark.parametrize("command", ["run", "ensemble", "profile", "benchmark"])
def test_commands_have_one_vocabulary(command, capsys):
    words = called(capsys, command, "--help")[1]
    assert all(option in words for option in ("--to S", "--plot [PATH]", "--formulation NAME", "--json"))
    assert ("--every S" in words) == (command != "benchmark")


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["profile", "fall.toml", "--t-end", "1"], 2, "the end of the run is --to"),
        (["profile", "fall.toml", "--outputs", "5"], 2, "--every"),
        (["run", "fall.toml", "--to", "run.h5"], 2, "it is a time in s. Results are written with --output"),
        (["run", "fall.toml", "--hep"], 2, "did you mean --help?"),
        (["tables", "--no-figure"], 2, "drawn with --plot only"),
        (["run", "fall.toml", "--integrator", "rk45"], 2, "the integrator is --method"),
        (["rnu", "fall.toml"], 2, "did you mean run?"),
        (["run", "fall.toml", "--methd=rk45"], 2, "did you mean --method"),
        (["run", "fall.toml", "--methd", "rk45"], 2, "did you mean --method"),
        (["run", "fall.toml", "--method", "dop835"], 1, "dop853"),
        (["run", "missing.toml"], 1, "can't be read"),
        (["run", "fall.toml", "--output", "a.txt"], 1, ".csv"),
        (["run", "fall.toml", "--output", "missing/a.h5"], 1, "no folder"),
        (["run", "fall.toml", "--every", "-1"], 1, "every must be"),
        (["run", "fall.toml", "--to", "-1"], 1, "end after it starts"),
        (["run"], 2, "SCENE"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_usage(words, code, said, folder, capsys):
    before = sorted(folder.iterdir())
    found, _, err = called(capsys, *words)
    assert found == code
    assert said in err
    found, out, _ = called(capsys, *words, "--json")
    assert found == code
    assert said in json.loads(out)["message"]
    assert sorted(folder.iterdir()) == before


def test_rows_of_contacts_with_friction_are_counted(folder, capsys):
    body = "[[body]]\nname = 'stone'\ntype = 'PointMass'\nmass = 1.0\n"
    contact = "[[constraint]]\ntype = 'PlaneContact'\nname = 'floor'\na = 'stone'\nb = 'ground'\n"
    law = "normal_b = [0, 0, 1]\nunilateral = true\nkinetic = 0.3\n"
    (folder / "stone.toml").write_text(f"version = 1\n{body}{contact}{law}")
    assert "floor  PlaneContact  3 rows" in called(capsys, "info", "stone.toml")[1]
    found = json.loads(called(capsys, "info", "stone.toml", "--json")[1])
    assert [item["rows"] for item in found["constraints"]] == [3]


def test_robots(folder, capsys):
    pytest.importorskip("lxml")
    link = "<inertial><mass value='2'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
    joint = "<joint name='hinge' type='revolute'><parent link='base'/><child link='arm'/>{}</joint>"
    joint = joint.format("<limit lower='0' upper='1'/>")
    (folder / "arm.urdf").write_text(
        f"<robot name='r'><link name='base'/><link name='arm'>{link}</link>{joint}</robot>"
    )
    code, out, err = called(capsys, "convert", "arm.urdf", "arm.toml")
    assert (code, ts.load("arm.toml").mobility().degrees_of_freedom) == (0, 1)
    assert "limits of a joint (1): hinge [0, 1]" in out
    assert "not carried over: 1 x limits of a joint" in err
    code, out, _ = called(capsys, "check", "arm.urdf", "--json")
    assert (code, json.loads(out)["not_carried_over"]) == (0, [["limits of a joint", "hinge", "[0, 1]"]])
    code, out, _ = called(capsys, "info", "arm.urdf", "--free-base", "--json")
    assert (code, json.loads(out)["degrees_of_freedom"]) == (0, 6)
    assert called(capsys, "run", "arm.urdf", "--to", "0.1")[0] == 0
    assert called(capsys, "convert", "arm.urdf", "stops.toml", "--limits")[0] == 0
    stop = ts.load("stops.toml")["limits of hinge"]
    assert (stop.lower, stop.upper) == (0.0, 1.0)
    assert "is for URDF files" in called(capsys, "run", "bars.toml", "--free-base")[2]


def test_options_of_a_run_have_flags(folder, capsys):
    """Every number and word of `RunOptions`."""
    words = ("run", "fall.toml", "--method", "rk45", "--max-step", "0.01", "--max-steps", "7", "--json")
    found = json.loads(called(capsys, *words)[1])
    assert (found["status"], found["stats"]["steps"]) == ("max_steps", 7)
    assert found["reached"] <= 0.07 * (1.0 + 1e-12)
    for form in ("null-space", "maggi-kane"):
        assert json.loads(
            called(capsys, "run", "bars.toml", "--to", "0.01", "--method", "dop853", "--formulation", form, "--json")[1]
        )["success"]
    code, _, said = called(capsys, "run", "bars.toml", "--redundancy", "keep")
    assert (code, "redundancy must be 'drop' or 'refuse'" in said) == (1, True)
    _, flags, _ = called(capsys, "run", "--help")
    for name in OF_RUN.keys() - {"integrator", "events", "history", "dense_output"}:
        assert f"--{name.replace('_', '-')} " in flags
