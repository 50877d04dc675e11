"""tsdyn ensemble, benchmark and completion: what they run, print and write, and their exit codes."""

import json
import subprocess
import sys

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.commands import called
from tsdyn.cli.parser import plain

STUDY = """\
version = 1
[parameters]
heavy = 4
[[body]]
name = "stone"
type = "PointMass"
mass = 1.0
[run]
end = 0.5
[ensemble]
cases = 5
[ensemble.parameters]
"stone.velocity" = { linspace = [[0, 0, 1], [0, 0, 5]] }
"stone.mass" = { uniform = [1, "heavy"] }
gravity = [0, 0, -10]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def test_a_study_of_a_file(folder, capsys):
    code, out, _ = called(capsys, "ensemble", "study.toml", "--output", "a.h5", "--output", "a.csv")
    assert code == 0
    assert all(word in out for word in ("5 cases: 5 success", "a second", "stone.z", "median", "written   a.csv"))
    found = ts.load("a.h5")
    np.testing.assert_allclose(found.q[:, 2], 0.5 * np.linspace(1, 5, 5) - 10 * 0.125, rtol=1e-13)
    masses = found.parameters["stone.mass"]
    assert masses.tobytes() == np.random.default_rng(0).uniform(1, 4, 5).tobytes()
    assert len((folder / "a.csv").read_text().splitlines()) == 6
    again = json.loads(called(capsys, "ensemble", "study.toml", "--json", "--cases", "3", "--seed", "7")[1])
    assert (again["cases"], again["ended"], again["failed"]) == (3, {"success": 3}, [])
    assert again["final"]["stone.z"]["50 %"] == pytest.approx(0.5 * 3 - 1.25)


def test_times_of_outputs(folder, capsys):
    """Those of the file are for single runs; those that are asked for are kept."""
    (folder / "study.toml").write_text(STUDY.replace("end = 0.5", "end = 0.5\nevery = 0.25"))
    for words, shape in (((), (5, 3)), (("--every", "0.25"), (5, 3, 3))):
        assert called(capsys, "ensemble", "study.toml", *words, "--output", f"{len(words)}.h5")[0] == 0
        assert ts.load(f"{len(words)}.h5").q.shape == shape


def test_a_grid_and_a_table(folder, capsys):
    text = STUDY.replace("cases = 5\n", "grid = true\n").replace("[0, 0, 5]]", "[0, 0, 5], 3]")
    text = text.replace('{ uniform = [1, "heavy"] }', "[1, 2]")
    (folder / "grid.toml").write_text(text)
    assert json.loads(called(capsys, "ensemble", "grid.toml", "--json")[1])["cases"] == 6
    (folder / "cases.csv").write_text(
        "stone.mass,stone.velocity[0],stone.velocity[1],stone.velocity[2]\n1,1,0,0\n2,3,0,0\n"
    )
    code, out, _ = called(capsys, "ensemble", "study.toml", "--parameters", "cases.csv", "--json", "--to", "1")
    found = json.loads(out)
    assert (code, found["cases"], found["parameters"]) == (0, 2, {"stone.mass": [2], "stone.velocity": [2, 3]})
    assert found["final"]["stone.x"]["50 %"] == pytest.approx(2.0)


def test_outputs_of_the_file_and_failures(folder, capsys):
    pytest.importorskip("matplotlib")
    text = STUDY.replace('{ uniform = [1, "heavy"] }', "[1, 2, -3, 4, 5]")
    (folder / "failing.toml").write_text(text + '[output]\nfiles = ["b.csv"]\nplot = "b.png"\n')
    code, out, _ = called(capsys, "ensemble", "failing.toml", "--json")
    found = json.loads(out)
    assert (code, found["success"], found["ended"]) == (1, False, {"success": 4, "case_failed": 1})
    assert found["failed"][0][0] == 2
    assert "positive" in found["failed"][0][1]
    assert found["written"] == ["b.csv", "b.png"]
    assert (folder / "b.png").read_bytes().startswith(b"\x89PNG")
    assert called(capsys, "run", "failing.toml")[0] == 0
    assert (folder / "b.csv").read_text().startswith("time (s)")


def test_a_store_goes_on(folder, capsys):
    assert called(capsys, "ensemble", "study.toml", "--store", "s.zarr")[0] == 0
    code, _, err = called(capsys, "ensemble", "study.toml", "--store", "s.zarr")
    assert (code, "resume=True" in err) == (1, True)
    assert called(capsys, "ensemble", "study.toml", "--store", "s.zarr", "--resume")[0] == 0


def test_saved_ensembles_are_told_and_converted(folder, capsys):
    called(capsys, "ensemble", "study.toml", "--output", "a.h5")
    assert "5 cases: 5 success" in called(capsys, "info", "a.h5")[1]
    assert json.loads(called(capsys, "info", "a.h5", "--json")[1])["cases"] == 5
    assert called(capsys, "convert", "a.h5", "a.csv")[0] == 0
    assert len((folder / "a.csv").read_text().splitlines()) == 6
    code, _, err = called(capsys, "view", "a.h5")
    assert (code, "case(0).view()" in err) == (1, True)


WRONG = {
    "no table [ensemble]": ("ensemble", "plain.toml"),
    "did you mean ensemble": ("ensembel", "study.toml"),
    "did you mean --cases": ("ensemble", "study.toml", "--casse", "3"),
    "no folder": ("ensemble", "study.toml", "--output", "missing/a.h5"),
    "results are written to": ("ensemble", "study.toml", "--output", "a.txt"),
    "line 3, column 1 (stone.mass)": ("ensemble", "study.toml", "--parameters", "bad.csv"),
    "can't be read": ("ensemble", "study.toml", "--parameters", "missing.csv"),
    "--tolerances must be numbers": ("benchmark", "study.toml", "--tolerances", "fine"),
    "invalid choice: 'fish'": ("completion", "fish"),
}


@pytest.mark.parametrize("message", WRONG)
def test_wrong_usage(message, folder, capsys):
    (folder / "plain.toml").write_text(STUDY.partition("[ensemble]")[0])
    (folder / "bad.csv").write_text("stone.mass\n1\nheavy\n")
    code, _, err = called(capsys, *WRONG[message])
    assert code in (1, 2)
    assert message in err


def test_errors_are_json_where_json_is_asked_for(folder, capsys):
    code, out, err = called(capsys, "ensemble", "missing.toml", "--json")
    assert (code, json.loads(out)["error"]) == (1, "StorageError")
    assert "can't be read" in err


def test_benchmark(folder, capsys):
    words = "--methods", "taylor,dop853", "--tolerances", "1e-6", "--to", "0.1", "--repeats", "1"
    code, out, _ = called(capsys, "benchmark", "study.toml", "--json", *words)
    rows = json.loads(out)["rows"]
    assert (code, [row["method"] for row in rows]) == (0, ["Taylor", "DOP853"])
    assert max(row["error_r"] for row in rows) < 1e-5


def test_numbers_that_json_has_not():
    found = plain({"a": np.array([1.0, np.nan]), "b": np.int64(3), "c": (np.inf, True, None)})
    assert found == {"a": [1.0, None], "b": 3, "c": [None, True, None]}


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_completion(shell, capsys):
    pytest.importorskip("shtab")
    code, out, _ = called(capsys, "completion", shell)
    assert code == 0
    assert all(word in out for word in ("ensemble", "--tolerances", "--resume"))


def test_help_loads_no_run(folder):
    code = (
        "import sys; from tsdyn.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass\n"
        "names = 'matplotlib', 'pandas', 'xarray', 'h5py', 'zarr', 'shtab', 'tsdyn.ensembles', 'tsdyn.measuring'\n"
        "print([name for name in sys.modules if name.startswith(names)], file=sys.stderr)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stderr.strip() == "[]"
