"""One file more in a folder of built-in classes, and the suite tests it: nothing in tests/ is edited."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = {
    "constraints/half_square.py": '''
"""Phi = (d.d - 1) / 2 of the points' difference d."""
from ..plugins import Point, Primitive

class HalfSquare(Primitive):
    """Keep two points 1 m apart."""

    rows = 1
    markers = (Point("a"), Point("b"))

    def __init__(self, a, b, *, point_a=(0, 0, 0), point_b=(0, 0, 0), name=""):
        super().__init__(a, b, (point_a, point_b), name)

    @staticmethod
    def phi(x, par, t, out):
        out[0] = ((x[0] - x[3]) ** 2 + (x[1] - x[4]) ** 2 + (x[2] - x[5]) ** 2 - 1.0) / 2.0

    @staticmethod
    def jacobian(x, par, t, out):
        for i in range(3):
            out[0, i] = x[i] - x[3 + i]
            out[0, 3 + i] = -out[0, i]

    @staticmethod
    def gamma(x, xd, par, t, out):
        out[0] = (xd[0] - xd[3]) ** 2 + (xd[1] - xd[4]) ** 2 + (xd[2] - xd[5]) ** 2

    @staticmethod
    def series(x, par, k, s, out):
        for i in range(3):
            out[0, i] = x[i] - x[3 + i]
            out[0, 3 + i] = -out[0, i]
''',
    "constraints/hanger.py": '''
"""A ball joint by another name."""
from ..plugins import Joint, Point
from .spherical import Spherical

class Hanger(Joint):
    """Keep two points together."""

    markers = (Point("a"), Point("b"))

    def __init__(self, a, b, *, point_a=(0, 0, 0), point_b=(0, 0, 0), name=""):
        super().__init__(a, b, (point_a, point_b), name)

    def compose(self):
        yield "point", Spherical(self.a, self.b, point_a=self.point_a, point_b=self.point_b)
''',
    "tsdyn/forces/attraction.py": '''
"""F = -k d on the points' difference d."""
from ..plugins import Force, Point

class Attraction(Force):
    """A spring without a free length."""

    markers = (Point("a"), Point("b"))

    def __init__(self, a, b, *, point_a=(0, 0, 0), point_b=(0, 0, 0), name=""):
        super().__init__(a, b, (point_a, point_b), name)

    @staticmethod
    def law(x, xd, par, t, out):
        for i in range(3):
            out[i] = 3.0 * (x[3 + i] - x[i])
            out[3 + i] = -out[i]

    @staticmethod
    def series(x, xd, par, k, s, out):
        for i in range(3):
            out[i] = 3.0 * (x[3 + i] - x[i])
            out[3 + i] = -out[i]

    @staticmethod
    def potential(x, par, t):
        return 1.5 * ((x[0] - x[3]) ** 2 + (x[1] - x[4]) ** 2 + (x[2] - x[5]) ** 2)
''',
    "integrators/kutta3.py": '''
"""Kutta's third-order method."""
from ..plugins import ExplicitRungeKutta, RungeKuttaTableau

class Kutta3(ExplicitRungeKutta):
    """Three stages, no error estimate."""

    order = 3
    tableau = RungeKuttaTableau(a=((), (1 / 2,), (-1, 2)), b=(1 / 6, 2 / 3, 1 / 6), c=(0, 1 / 2, 1), order=3)
''',
}
TESTED_BY = [
    ("HalfSquare", "constraints/test_primitives.py"),
    ("HalfSquare", "constraints/test_constraints_hold.py"),
    ("HalfSquare", "formulations/test_constraint_hessians.py"),
    ("Hanger", "constraints/test_joints.py"),
    ("Hanger", "constraints/test_constraints_hold.py"),
    ("Attraction", "forces/test_forces.py"),
    ("Attraction", "formulations/test_linearisation.py"),
    ("Kutta3", "integrators/test_integrators.py"),
]


@pytest.fixture
def extended(tmp_path):
    """A copy of the project with the files above in it."""
    for part in ("tsdyn", "constraints", "integrators", "tests", "examples", "benchmarks"):
        shutil.copytree(ROOT / part, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__", "results", "images"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text.lstrip())
    return tmp_path


@pytest.mark.slow
def test_new_classes_are_tested_without_an_edit(extended):
    kinds, files = (list(dict.fromkeys(column)) for column in zip(*TESTED_BY, strict=True))
    result = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-v",
            "-m",
            "",
            "-k",
            " or ".join(kinds),
            *(f"tests/{file}" for file in files),
        ],
        cwd=extended,
        env={name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")},
        text=True,
        capture_output=True,
        timeout=1200,
    )
    assert result.returncode == 0, result.stdout
    passed = [line for line in result.stdout.splitlines() if "PASSED" in line]
    for kind, file in TESTED_BY:
        assert any(line.startswith(f"tests/{file}") and kind in line for line in passed), (kind, file)
