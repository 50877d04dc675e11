"""A wheel that carries compiled kernels: built, installed elsewhere, and run with a Numba that may not compile."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numba
import numpy as np
import pytest

from tests.helpers.processes import KERNELS, ROOT, SMALL
from tsdyn.jit import compilers, stock, target

SCRIPT = Path(__file__).with_name("shipped_kernels.py")
LARGEST = 20e6  # bytes
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(compilers.current() is stock or not target.portable(), reason="kernels of portable targets"),
]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, for the default target alone; kernels that the user's cache has aren't compiled again."""
    pytest.importorskip("setuptools", minversion="77")
    folder = tmp_path_factory.mktemp("wheel")
    for name in ("tsdyn", "constraints", "integrators"):
        shutil.copytree(ROOT / name, folder / "source" / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder / "source")
    environment = {**os.environ, "TSDYN_SHIP_KERNELS": "1", "TSDYN_TARGET": target.portable()}
    pip = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-index", "--no-build-isolation", "-w", folder]
    subprocess.run([*pip, folder / "source"], env=environment, check=True)
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """The Python of an environment with this wheel, and NumPy, SciPy and Numba of this one."""
    folder = tmp_path_factory.mktemp("installed")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-deps", "--no-index", wheel]
    subprocess.run(pip, check=True)
    where = subprocess.run(
        [python, "-c", "import site; print(site.getsitepackages()[-1])"], capture_output=True, text=True
    )
    libraries = {Path(module.__file__).parents[1] for module in (np, numba)}
    Path(where.stdout.strip(), "libraries.pth").write_text("\n".join(map(str, libraries)))
    return python


def answers(python, folder, *arguments, **changes):
    """What the script, or other code, reports, run with an empty cache; and stderr."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("TSDYN_", "NUMBA_", "PYTHON"))}
    result = subprocess.run(
        [python, *arguments],
        cwd=folder,
        env={**kept, "TSDYN_CACHE_DIR": str(folder / "cache"), "TMPDIR": str(folder), **changes},
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout.splitlines()[-1]), result.stderr


def test_the_wheel_is_small_and_of_this_python(wheel):
    assert wheel.stat().st_size < LARGEST
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    assert wheel.name.split("-")[2] == python
    assert "none-any" not in wheel.name
    names = zipfile.ZipFile(wheel).namelist()
    assert f"tsdyn/kernels/{target.portable()}/versions.json" in names


def test_nothing_is_compiled_by_any_method_and_form(installed, tmp_path):
    """And the bits are those of kernels that are compiled here."""
    found, errors = answers(installed, tmp_path, SCRIPT)
    assert Path(found["home"]).is_relative_to(installed.parents[1])
    assert Path(found["shipped"]).name == target.portable()
    assert found.get("misses", 0) == 0
    assert len(found["ends"]) >= 15  # of seven methods; implicit ones and Taylor serve fewer forms
    assert errors == ""
    own, _ = answers(sys.executable, tmp_path, SCRIPT, "dop853", "tangent", TSDYN_CACHE_DIR="", PYTHONPATH=str(ROOT))
    assert own["end"] == found["ends"]["DOP853 tangent"]


def by_another_numba(folder):
    file = folder / "versions.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "numba": "0.1"}))


def by_one_that_fails(folder):
    by_another_numba(folder)
    for file in folder.glob("*.backend._probe_arguments*"):
        file.write_bytes(file.read_bytes()[:-9])


def damaged(folder):
    for file in folder.glob("*.distance.Distance.phi_loop*"):
        file.write_bytes(file.read_bytes()[:-9])


def open_to_all(folder):
    folder.chmod(0o777)


@pytest.mark.parametrize(
    ("change", "compiled", "said"),
    [
        (by_another_numba, 0, ""),
        (by_one_that_fails, KERNELS, "kernels that came with tsdyn were compiled by Numba 0.1 and are compiled anew"),
        (damaged, 1, "a stored kernel can't be loaded"),
        pytest.param(
            open_to_all, KERNELS, "", marks=pytest.mark.skipif(sys.platform == "win32", reason="POSIX permissions")
        ),
    ],
)
def test_kernels_that_cannot_be_used_are_compiled_into_the_users_cache(installed, tmp_path, change, compiled, said):
    (folder,) = installed.parents[1].rglob(f"tsdyn/kernels/{target.portable()}")
    shutil.copytree(folder, tmp_path / "kept")
    names = {file.name for file in folder.iterdir()}
    try:
        change(folder)
        found, errors = answers(installed, tmp_path, "-c", SMALL, TSDYN_QUIET="1")
        assert (found["Phi"], found.get("misses", 0)) == (0.0, compiled)
        assert errors.count(said) == 1 if said else errors == ""
        again, _ = answers(installed, tmp_path, "-c", SMALL, TSDYN_QUIET="1")
        assert (again["Phi"], again.get("misses", 0), again.get("damaged", 0)) == (0.0, 0, 0)
        assert {file.name for file in folder.iterdir()} == names
    finally:
        shutil.rmtree(folder)
        shutil.copytree(tmp_path / "kept", folder)
