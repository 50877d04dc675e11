"""The shape of tests/: folders named after packages, helpers apart from tests, short files, every platform."""

import ast
import keyword
import re
from pathlib import Path

from tests.helpers.syntax import nodes, walked

TESTS = Path(__file__).parents[1]
ROOT = TESTS.parent
HOUSE_FOLDERS = "tsdyn", "constraints", "integrators"
FILES = {file.relative_to(TESTS).as_posix(): file for file in sorted(TESTS.rglob("*.py"))}
HOUSE = {file.stem for file in (TESTS.parent / "tsdyn").iterdir()} | {"constraints", "integrators"}
BESIDE = {"helpers", "references", "project"}  # what tests share, and what is tested that is no package
LONGEST = 700  # lines
POSIX = {"fcntl", "grp", "pwd", "resource", "termios"}


def imported(tree):
    """Modules that a file imports, lazily or at its top."""
    for node in walked(tree):
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
        tree = ast.parse(file.read_text())
        names = set(imported(tree))
        tests = {name for name in names if name.split(".")[-1].startswith("test_") and name.startswith("tests")}
        assert not tests, name
        assert not names & POSIX, name
        has_tests = any(isinstance(node, ast.FunctionDef) and node.name.startswith("test_") for node in tree.body)
        assert file.name.startswith("test_") == has_tests, name


def test_texts_of_the_code_name_what_exists():
    """A file that a comment or docstring refers to is another one that is there; so are names in backticks."""
    code = {file: file.read_text() for folder in HOUSE_FOLDERS for file in sorted((ROOT / folder).rglob("*.py"))}
    known = {"tsdyn", *keyword.kwlist, *(part.split(".")[0] for file in code for part in file.relative_to(ROOT).parts)}
    for file in code:
        for node in nodes(file):
            known |= {getattr(node, field, None) for field in ("name", "id", "attr", "arg")}
    for file, text in code.items():
        for named in re.findall(r"(?<![\w.])(?:\w+/)*\w+\.py\b", text):
            others = [each for each in code if each != file and each.as_posix().endswith(f"/{named}")]
            assert others or (ROOT / named).exists() or named == "file.py", f"{file}: {named}"
        for named in re.findall(r"`([A-Za-z_]\w*)`", text):
            assert named in known, f"{file}: {named}"
