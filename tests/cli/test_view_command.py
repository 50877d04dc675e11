"""tsdyn view: animations of scene files and of saved solutions."""

import numpy as np
import pytest

import tsdyn as ts
from examples import four_bar
from tests.helpers.pages import decoded
from tsdyn.cli import main


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    four_bar.build().save("bars.toml")
    return tmp_path


def test_a_scene_file_is_run_and_shown(folder, capsys):
    assert main(["view", "bars.toml", "--to", "0.2", "--output", "bars.html"]) == 0
    assert capsys.readouterr().out == "Animation: bars.html\n"
    assert decoded((folder / "bars.html").read_text(encoding="utf-8")).time == [0.0, 0.2]


def test_a_saved_solution_is_shown(folder):
    pytest.importorskip("h5py")
    solution = ts.simulate(four_bar.build(), (0.0, 0.2), dense_output=True)
    solution.save("bars.h5")
    assert main(["view", "bars.h5", "--output", "saved"]) == 0
    solution.view("run")
    saved, run = (decoded((folder / name).read_text(encoding="utf-8")) for name in ("saved.html", "run.html"))
    np.testing.assert_array_equal(saved.positions, run.positions)
    np.testing.assert_array_equal(saved.loads, run.loads)


def test_what_cannot_be_shown_is_said(folder, capsys):
    assert main(["view", "bars.toml", "--to", "0.1", "--output", "nowhere/bars.html"]) == 1
    assert "there is no folder" in capsys.readouterr().err
    (folder / "there.html").write_text("")
    assert main(["view", "bars.toml", "--output", "there"]) == 1
    assert "--force" in capsys.readouterr().err
    assert main(["view", "absent.toml"]) == 1
    assert "absent.toml" in capsys.readouterr().err
