"""The shape of tests/: folders named after packages, helpers apart from tests, short files, every platform."""

import ast
from pathlib import Path

TESTS = Path(__file__).parents[1]
FILES = {file.relative_to(TESTS).as_posix(): file for file in sorted(TESTS.rglob("*.py"))}
HOUSE = {file.stem for file in (TESTS.parent / "tsdyn").iterdir()} | {"constraints", "integrators"}
BESIDE = {"helpers", "references", "project"}  # what tests share, and what is tested that is no package
LONGEST = 700  # lines
POSIX = {"fcntl", "grp", "pwd", "resource", "termios"}


def imported(file):
    """Modules that a file imports, lazily or at its top."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_folders_are_named_after_packages():
    folders = {name.split("/")[0] for name in FILES if "/" in name}
    assert folders <= HOUSE | BESIDE


def test_files_are_short_and_share_by_helpers():
    for name, file in FILES.items():
        assert len(file.read_text().splitlines()) <= LONGEST, name
        names = set(imported(file))
        tests = {name for name in names if name.split(".")[-1].startswith("test_") and name.startswith("tests")}
        assert not tests, name
        assert not names & POSIX, name
        body = ast.parse(file.read_text()).body
        has_tests = any(isinstance(node, ast.FunctionDef) and node.name.startswith("test_") for node in body)
        assert file.name.startswith("test_") == has_tests, name
