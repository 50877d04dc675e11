"""The command `tsdyn profile`."""

import pytest

from tests.helpers.processes import OF_CHECKOUT
from tsdyn.cli import main


@pytest.mark.slow
def test_command_on_an_example(capsys, tmp_path):
    pytest.importorskip("matplotlib")
    figure = tmp_path / "profile.png"
    arguments = ["--to", "1", "--method", "dop853", "--rtol", "1e-6", "--atol", "1e-6", "--every", "0.05"]
    assert main(["profile", "top", *arguments, "--no-advice", "--plot", str(figure)]) == 0
    out = capsys.readouterr().out
    assert out.startswith("<Scene of 1 rigid body")
    assert "DOP853(rtol=1e-06, atol=1e-06)" in out
    assert "times of t_eval" in out
    assert figure.exists()


@pytest.mark.slow
def test_command_on_a_file(capsys, tmp_path):
    file = tmp_path / "two.py"
    file.write_text(
        "import tsdyn as ts\ndef build():\n    scene = ts.Scene()\n    scene.add_point_mass(1.0)\n    return scene\n"
        "scene = build()\nnumber = 3\ndef needs(x):\n    return x\n"
    )
    for where in (str(file), f"{file}:scene"):
        assert main(["profile", where, "--to", "0.1", "--no-advice"]) == 0
        assert "<Scene of 1 point mass: 3 coordinates" in capsys.readouterr().out
    for where, words in (
        (f"{file}:number", "must give a ts.Scene, got 3"),
        (f"{file}:needs", "must need no argument"),
        (f"{file}:nothing", "has no 'nothing'"),
    ):
        assert main(["profile", where]) == 1
        assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("nowhere.py", None, "no file"),
        ("empty.py", "", "neither build() nor scene"),
        ("broken.py", "1 / 0", "can't be run: ZeroDivisionError"),
        ("scene.txt", "", "nor a Python file"),
    ],
)
def test_command_says_what_is_wrong_with_a_file(name, content, words, capsys, tmp_path):
    if content is not None:
        (tmp_path / name).write_text(content)
    assert main(["profile", str(tmp_path / name)]) == 1
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("tsdyn: ")
    assert words in err


@OF_CHECKOUT
def test_command_names_the_examples(capsys):
    assert main(["profile", "tpo"]) == 1
    assert "pendulum_chain" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["profile"], ["profile", "top", "--to", "soon"]], ids=" ".join)
def test_wrong_arguments(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    assert "usage: tsdyn profile" in capsys.readouterr().err
