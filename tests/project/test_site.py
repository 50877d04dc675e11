"""The site of the documentation builds without a warning: pages of classes, gallery, notebooks."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import tsdyn as ts

ROOT = Path(__file__).parents[2]
NEEDED = ("sphinx", "myst_nb", "furo", "ipykernel")
COPIED = ("docs", "tsdyn", "constraints", "integrators", "examples", "benchmarks")
BESIDE = ("CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", "pyproject.toml")


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path):
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed: pip install 'tsdyn[docs]'")
    for name in COPIED:
        ignored = shutil.ignore_patterns("__pycache__", "results", "reference")
        shutil.copytree(ROOT / name, tmp_path / name, ignore=ignored if name != "tsdyn" else None)
    for name in BESIDE:
        shutil.copy(ROOT / name, tmp_path)
    options = ["-W", "--keep-going", "-q", "-D", "nb_execution_mode=off"]  # test_notebooks.py runs the notebooks
    command = [sys.executable, "-m", "sphinx", *options, "-b", "html", "docs", "site"]
    result = subprocess.run(command, cwd=tmp_path, text=True, capture_output=True, timeout=1800)
    assert result.returncode == 0, result.stdout + result.stderr
    site = tmp_path / "site"
    for kind, known in (("joints", ts.constraints.registered_joints()), ("integrators", ts.integrators.registered())):
        for cls in known:
            if cls.__module__.startswith("tsdyn."):
                page = (site / "reference" / kind / f"{cls.__name__}.html").read_text(encoding="utf-8")
                assert f"{cls.__name__}.png" in page
                assert "Source" in page
    assert len([*(site / "gallery").glob("*.html")]) > 25
    assert "constraint_error" in (site / "api" / "results.html").read_text(encoding="utf-8")
