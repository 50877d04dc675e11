"""Types: stubs that are up to date, annotations of all that is public, and what mypy says of a user's script."""

import inspect
import shutil
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

import numpy as np
import pytest

import tsdyn as ts
from tools.stubs import FILES, stub

ROOT = Path(__file__).parents[2]
MODULES = (ts, ts.constraints, ts.forces, ts.integrators, ts.motions, ts.plots, ts.shapes, ts.testing)
PUBLIC = {f"{module.__name__}.{name}": getattr(module, name) for module in MODULES for name in module.__all__}
CLASSES = {name: kind for name, kind in PUBLIC.items() if isinstance(kind, type)}
FUNCTIONS = {name: f for name, f in PUBLIC.items() if inspect.isfunction(f) and f is not ts.kernel}

WRONG = {  # each on a line of its own, and what mypy says of it
    "ts.Scene(gravty=(0, 0, 1))": 'Unexpected keyword argument "gravty"',
    "scene.add_body(1.0, (1, 1, 1), positon=(0, 0, 0))": 'Unexpected keyword argument "positon"',
    "ts.constraints.Revolute(body, scene.ground, axis=(0, 0, 1))": 'Unexpected keyword argument "axis"',
    "ts.constraints.Revolute.at(body, scene.ground, axes=(0, 0, 1))": 'Unexpected keyword argument "axes"',
    "ts.constraints.Revolt": 'Module has no attribute "Revolt"',
    "ts.simulat(scene, (0, 1))": 'Module has no attribute "simulat"',
    'ts.simulate(scene, (0, 1), formulation="tangnt")': 'Argument "formulation" to "simulate" has incompatible type',
    'ts.integrators.RK45("1e-6")': 'Argument 1 to "RK45" has incompatible type',
    "body.masss = 2.0": "Incompatible types in assignment",
    'body.mass = "heavy"': "Incompatible types in assignment",
}


@pytest.mark.parametrize("package", FILES)
def test_stubs_are_up_to_date(package):
    assert FILES[package].read_text(encoding="utf-8") == stub(package), "write it anew: python -m tools.stubs"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_public_functions_are_annotated(name):
    assert not unannotated(FUNCTIONS[name])


@pytest.mark.parametrize("name", CLASSES)
def test_public_classes_are_annotated(name):
    found = {}
    for base in [base for base in CLASSES[name].__mro__ if base.__module__.startswith("tsdyn")]:
        for member, value in vars(base).items():
            function = getattr(value, "fget", getattr(value, "func", getattr(value, "__func__", value)))
            public = member == "__init__" or not member.startswith("_")
            if public and inspect.isfunction(function) and not isinstance(value, staticmethod):  # which are kernels
                found.setdefault(member, []).append(function)
    for member, functions in found.items():
        assert any(not unannotated(f) for f in functions[: 1 if member == "__init__" else None]), member


def unannotated(function):
    """The parameters of a function that have no annotation, and "return"."""
    signature = inspect.signature(function)
    missing = [
        name for name, p in signature.parameters.items() if p.annotation is p.empty and name not in ("self", "cls")
    ]
    return missing + ["return"] * (signature.return_annotation is signature.empty)


def test_annotations_name_what_there_is():
    """Names of annotations that are imported for type checkers only."""
    from tsdyn import hints

    for function in (ts.simulate, ts.Scene.add_body, ts.constraints.Distance.__init__, ts.Solution.at):
        known = {**vars(hints), **inspect.unwrap(function).__globals__, "np": np}
        for annotation in function.__annotations__.values():
            eval(annotation, known)


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """A folder, and the Python of a virtual environment with the files that a wheel has, as pyproject.toml says."""
    folder = tmp_path_factory.mktemp("types")
    venv.create(folder / "venv", with_pip=False, symlinks=sys.platform != "win32")
    python = folder / "venv" / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    code = "import sysconfig; print(sysconfig.get_path('purelib'))"
    purelib = Path(subprocess.run([python, "-c", code], capture_output=True, text=True, check=True).stdout.strip())
    setting = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    for package in setting["packages"]:
        source = setting["package-dir"].get(package, package.replace(".", "/"))
        target = purelib / Path(*package.split("."))
        target.mkdir(exist_ok=True)
        for pattern in ("*.py", *setting["package-data"]["*"]):
            for file in (ROOT / source).glob(pattern):
                shutil.copy(file, target)
    (purelib / "others.pth").write_text(str(Path(np.__path__[0]).parent))
    return folder, python


@pytest.mark.slow
def test_mypy_accepts_a_users_script_and_finds_slips_of_the_pen(environment):
    pytest.importorskip("mypy")
    head = "import tsdyn as ts\nscene = ts.Scene()\nbody = scene.add_body(1.0, (1, 1, 1))\n"
    folder, python = environment
    shutil.copy(Path(__file__).with_name("user_script.py"), folder)
    (folder / "wrong.py").write_text(head + "\n".join(WRONG))
    result = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--python-executable", python, "user_script.py", "wrong.py"],
        cwd=folder, capture_output=True, text=True,
    )  # fmt: skip
    errors = [line for line in result.stdout.splitlines() if ": error: " in line]
    assert not [line for line in errors if line.startswith("user_script.py")], result.stdout + result.stderr
    for number, (code, expected) in enumerate(WRONG.items(), 4):
        assert any(line.startswith(f"wrong.py:{number}: error: {expected}") for line in errors), (code, result.stdout)
