"""Snippets and commands of README, CONTRIBUTING and docs run as they are printed, and print what is printed there."""

import os
import re
import shlex
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from tests.helpers.documents import README, pages, python_blocks

ROOT = Path(__file__).parents[2]


def snippets():
    """Python of README and docs, by file: later blocks may use names of earlier ones."""
    for file in (README, *pages()):
        blocks = python_blocks(file)
        if blocks:
            yield pytest.param(blocks, id=file.stem)


@pytest.mark.slow_but("README", "index", "parallel", "closed-loop", "events")
@pytest.mark.parametrize("blocks", list(snippets()))
def test_snippets_run(blocks, request, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    name = f"snippets_of_{request.node.callspec.id.replace('-', '_')}"
    (tmp_path / f"{name}.py").write_text("\n\n".join(code for code, _ in blocks))
    import_module(name)
    printed = capsys.readouterr().out
    for _, output in blocks:
        assert output in printed


def commands():
    """Commands that README, CONTRIBUTING and docs show, inline or in blocks, without the folder of an environment."""
    for file in (README, ROOT / "CONTRIBUTING.md", *pages()):
        blocks = re.findall(r"```sh\n(.*?)```", file.read_text(), re.DOTALL)
        lines = [part for block in blocks for line in block.splitlines() for part in line.split("&&")]
        for command in (*re.findall(r"`([^`\n]+)`", file.read_text()), *lines):
            yield command.strip().replace(".venv/bin/", "")


# verbs and modules that the pages name, and that run in seconds and offline; installs, the suite itself and benchmarks,
# which take minutes to hours, have tests of their own
WRITTEN = ("linkage.py",)  # by the reader of the tutorial
RUN = ("python examples/", "tsdyn tables", "tsdyn compile", "tsdyn profile")


def runnable():
    """Each such command once; `file.py` stands for a file of the reader's."""
    found = (command.partition("#")[0].strip() for command in commands())
    named = (command.replace("file.py", "examples/top.py") for command in found if command.startswith(RUN))
    kept = (command for command in named if command not in ("tsdyn profile", "tsdyn compile --all"))
    return sorted({command for command in kept if not re.search(r"\[|[A-Z]{2}", command)})  # nor forms, as SCENE


@pytest.mark.slow
@pytest.mark.parametrize("command", runnable())
def test_commands_run(command, tmp_path):
    words = [str(ROOT / word) if word.endswith(".py") else word for word in shlex.split(command)]
    words = [sys.executable, *(("-m", *words) if words[0] == "tsdyn" else words[1:])]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "agg"}
    result = subprocess.run(words, cwd=tmp_path, env=environment, text=True, capture_output=True, timeout=900)
    assert result.returncode == 0, result.stderr


def test_there_are_commands_to_run():
    assert {"python examples/top.py", "tsdyn tables", "tsdyn compile", "tsdyn profile examples/top.py"} <= {*runnable()}


def test_commands_of_the_docs_exist():
    """Modules, files and verbs that pages name in commands."""
    from tsdyn.cli import main

    seen = set()
    for command in commands():
        words = shlex.split(command, comments=True) if command.startswith(("python", "tsdyn")) else []
        if words[:2] == ["python", "-m"] and words[2] not in ("pytest", "venv", "sphinx"):
            module = ROOT.joinpath(*words[2].split("."))
            assert module.with_suffix(".py").exists() or (module / "__main__.py").exists(), command
        elif words[:1] == ["python"] and words[1].endswith(".py") and words[1] not in WRITTEN:
            assert (ROOT / words[1]).exists(), command
        elif words[:1] == ["tsdyn"] and len(words) > 1 and words[1] not in seen:
            with pytest.raises(SystemExit) as ended:
                main([words[1], "--help"])
            assert ended.value.code == 0, command
        seen.update(words[:2])
    assert {"-m", "examples/top.py", "tables", "profile"} <= seen
