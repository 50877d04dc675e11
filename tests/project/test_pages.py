"""Snippets and commands of README, CONTRIBUTING and docs run as they are printed."""

import re
import shlex
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def snippets():
    """Python of README and docs, by file: later blocks may use names of earlier ones."""
    for file in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        blocks = re.findall(r"```python\n(.*?)```", file.read_text(), re.DOTALL)
        if blocks:
            yield pytest.param(blocks, id=file.stem)


@pytest.mark.parametrize("blocks", list(snippets()))
def test_snippets_run(blocks, request, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    name = f"snippets_of_{request.node.callspec.id.replace('-', '_')}"
    (tmp_path / f"{name}.py").write_text("\n\n".join(blocks))
    import_module(name)


def commands():
    """Commands that README, CONTRIBUTING and docs show, inline or in blocks, without the folder of an environment."""
    for file in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))):
        blocks = re.findall(r"```sh\n(.*?)```", file.read_text(), re.DOTALL)
        lines = [part for block in blocks for line in block.splitlines() for part in line.split("&&")]
        for command in (*re.findall(r"`([^`\n]+)`", file.read_text()), *lines):
            yield command.strip().replace(".venv/bin/", "")


def test_commands_of_the_docs_exist():
    """Modules, files and verbs that pages name in commands."""
    from tsdyn.cli.command import main

    seen = set()
    for command in commands():
        words = shlex.split(command, comments=True) if command.startswith(("python", "tsdyn")) else []
        if words[:2] == ["python", "-m"] and words[2] not in ("pytest", "venv"):
            module = ROOT.joinpath(*words[2].split("."))
            assert module.with_suffix(".py").exists() or (module / "__main__.py").exists(), command
        elif words[:1] == ["python"] and words[1].endswith(".py"):
            assert (ROOT / words[1]).exists(), command
        elif words[:1] == ["tsdyn"] and len(words) > 1 and words[1] not in seen:
            with pytest.raises(SystemExit) as ended:
                main([words[1], "--help"])
            assert ended.value.code == 0, command
        seen.update(words[:2])
    assert {"-m", "examples/top.py", "tables", "profile"} <= seen
