"""Copies of the sources, to edit, and of the user's kernel cache, to count in."""

import os
import shutil
from pathlib import Path

import pytest

from tests.helpers.processes import ROOT, run


@pytest.fixture
def package(tmp_path):
    """A copy of the sources, to edit."""
    if not (ROOT / "tsdyn").is_dir():
        pytest.skip("tsdyn is installed, without its sources beside the tests")
    for folder in ("tsdyn", "constraints", "integrators"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


@pytest.fixture
def warm(tmp_path):
    """A function that runs code with the user's cache, where what it compiles serves other tests, too.

    It returns the report, and an environment with a copy of the cache that no other test writes to.
    """

    def prepare(code):
        first, _ = run(code, {})
        folder = Path(first["folder"])
        partial = shutil.ignore_patterns("*.kernel.*", "*.callee.*")  # another process is about to rename them
        shutil.copytree(folder, tmp_path / "warm" / "tsdyn" / folder.name, ignore=partial, copy_function=_linked)
        return first, {"NUMBA_CACHE_DIR": str(tmp_path / "warm")}

    return prepare


def _linked(source, target):
    """Link a file of the cache, which is never written in place; copy it where files can't be linked."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)
