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


def test_a_scene_is_shown_without_a_run(folder, capsys):
    assert main(["view", "bars.toml", "--no-run", "--follow", "crank", "--camera", "0", "1", "0", "--output", "a"]) == 0
    assert capsys.readouterr().out == "Start: a.html\n"
    data = decoded((folder / "a.html").read_text(encoding="utf-8"))
    assert (data.frames, data.follow, data.view) == (1, 0, [0.0, 1.0, 0.0])


def test_a_start_that_is_not_assembled_is_drawn(folder, capsys):
    scene = four_bar.build()
    scene["coupler"].position = scene["coupler"].position * 1.01
    scene.save("apart.toml")
    assert main(["view", "apart.toml", "--output", "apart.html"]) == 1
    said = capsys.readouterr().err
    assert "breaks" in said
    assert "The start is drawn in apart.html" in said
    assert any(label["violated"] for label in decoded((folder / "apart.html").read_text(encoding="utf-8")).labels)


def test_what_cannot_be_shown_is_said(folder, capsys):
    assert main(["view", "bars.toml", "--to", "0.1", "--output", "nowhere/bars.html"]) == 1
    assert "there is no folder" in capsys.readouterr().err
    (folder / "there.html").write_text("")
    assert main(["view", "bars.toml", "--output", "there"]) == 1
    assert "--force" in capsys.readouterr().err
    assert main(["view", "absent.toml"]) == 1
    assert "absent.toml" in capsys.readouterr().err
