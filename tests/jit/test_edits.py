"""No edit is ever answered by a stale kernel, and an edit compiles what it affects alone."""

import math
import os

import pytest

from tests.helpers.processes import REPORT, ROOT, SMALL, edit, run
from tests.helpers.tolerances import ROUNDING


@pytest.mark.slow
def test_edited_callee_in_another_file_is_seen(package):
    environment = {"NUMBA_CACHE_DIR": str(package / "cache")}
    before, _ = run(SMALL, environment, package)
    assert before["Phi"] == 0.0
    edit(
        package / "tsdyn" / "elements" / "markers.py",
        "            x[i] = q[at + i]\n    else",
        "            x[i] = 2.0 * q[at + i]\n    else",
    )
    after, _ = run(SMALL, environment, package)
    assert after["Phi"] == (36.0 - 9.0) / 6.0
    assert after["misses"] == 3  # the loops; their caller reaches them by address
    again, _ = run(SMALL, environment, package)
    assert (again["Phi"], again["misses"]) == (after["Phi"], 0)
    edit(
        package / "tsdyn" / "simulation" / "solution.py", "import numpy as np\n", "import numpy as np\n\nNOTHING = 0\n"
    )
    edit(package / "tsdyn" / "elements" / "markers.py", "2.0 * q[at + i]", "2.0 * q[at + i]  # twice")
    assert run(SMALL, environment, package)[0]["misses"] == 0  # no code that a kernel reaches has changed


def test_kernels_in_a_sub_package_follow_an_edit_of_their_callees(package):
    folder = package / "tsdyn" / "below"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "inner.py").write_text(
        "from ..jit.kernels import kernel\nLEVEL = 3.0\n@kernel\ndef level(x):\n    return LEVEL * x\n"
    )
    (folder / "outer.py").write_text(
        "from ..jit.kernels import entry\nfrom . import inner\n@entry\ndef twice(x):\n    return 2.0 * inner.level(x)\n"
    )
    environment = {"NUMBA_CACHE_DIR": str(package / "cache")}
    code = REPORT + "\nfrom tsdyn.below.outer import twice\nreport(value=twice(1.0))\n"
    first, _ = run(code, environment, package)
    assert (first["value"], first["misses"]) == (6.0, 1)
    assert run(code, environment, package)[0]["misses"] == 0
    edit(folder / "inner.py", "3.0", "5.0")
    edited, _ = run(code, environment, package)
    assert (edited["value"], edited["misses"]) == (10.0, 1)


@pytest.mark.slow
def test_an_edit_of_a_docstring_compiles_nothing(package):
    file = package / "tsdyn" / "documented.py"
    file.write_text('from .jit.kernels import entry\n@entry\ndef twice(x):\n    """Double."""\n    return 2.0 * x\n')
    environment = {"NUMBA_CACHE_DIR": str(package / "cache")}
    code = REPORT + "\nfrom tsdyn.documented import twice\nreport(value=twice(1.0))\n"
    assert run(code, environment, package)[0]["misses"] == 1
    edit(file, "Double.", "Twice x.")
    assert run(code, environment, package)[0]["misses"] == 0
    edit(file, "2.0", "3.0")
    edited, _ = run(code, environment, package)
    assert (edited["value"], edited["misses"]) == (3.0, 1)


PLUG_IN = (
    REPORT
    + """
import numpy as np
import plug
import tsdyn as ts
scene = ts.Scene()
mass = scene.add_point_mass(1.0, position=(0.0, 0.0, 3.0))
scene.add(plug.Height(mass))
free = scene.add_point_mass(1.0, position=(2.0, 0.0, 0.0))
motion = (lambda t: 0.1 * np.sin(t) + 2.0, lambda t: 0.1 * np.cos(t), lambda t: -0.1 * np.sin(t))
rod = scene.add(ts.constraints.Distance(free, scene.ground, length=motion))
found = scene.evaluate(t=1.0)
report(Phi=float(found.Phi[0]), Phi_t=float(found.Phi_t[1]), gamma=float(found.gamma[1]))
"""
)


PLUG = """
import tsdyn as ts
from helper import LEVEL, square

class Height(ts.Primitive):
    rows = 1
    markers = (ts.Point("a"),)
    def __init__(self, a):
        super().__init__(a, None, ((0, 0, 0),))
    @staticmethod
    def phi(x, par, t, out):
        out[0] = square(x[2]) - LEVEL
    @staticmethod
    def jacobian(x, par, t, out):
        out[0, 2] = 2.0 * x[2]
    @staticmethod
    def gamma(x, xd, par, t, out):
        out[0] = 2.0 * square(xd[2])
"""


HELPER = """
import deeper
import tsdyn as ts
LEVEL = 9.0

@ts.kernel
def square(x, power=2.0):
    return deeper.raised(x, power)
"""


DEEPER = """
import tsdyn as ts

@ts.kernel
def raised(x, power):
    return x**power
"""


@pytest.fixture
def plug_in(tmp_path):
    """A primitive in one file of a user's, its helper and a constant in another."""
    (tmp_path / "plug.py").write_text(PLUG)
    (tmp_path / "helper.py").write_text(HELPER)
    (tmp_path / "deeper.py").write_text(DEEPER)
    return tmp_path


def plug_run(folder, environment):
    return run(PLUG_IN, {"PYTHONPATH": os.pathsep.join([str(ROOT), str(folder)]), **environment}, folder)[0]


@pytest.mark.slow
def test_plug_in_is_cached_and_its_edits_are_seen(plug_in, warm):
    _, environment = warm(SMALL.replace("length=3.0", "length=3 * (lambda t: 3.0,)"))  # all of Distance is in the cache
    first = plug_run(plug_in, environment)
    assert first["misses"] == 3 + 3  # its loops and the three motions: nothing of the core
    assert first["Phi"] == 0.0
    second = plug_run(plug_in, environment)
    assert second["misses"] == 0
    edit(plug_in / "helper.py", "LEVEL = 9.0", "LEVEL = 5.0")
    assert plug_run(plug_in, environment)["Phi"] == 4.0
    edit(plug_in / "deeper.py", "return x**power", "return x**power + 1.0")  # reached as module.function
    assert plug_run(plug_in, environment)["Phi"] == 5.0
    edit(plug_in / "helper.py", "power=2.0", "power=3.0")
    assert plug_run(plug_in, environment)["Phi"] == 23.0


@pytest.mark.slow
def test_functions_on_one_line_are_told_apart(plug_in, warm):
    # f and fdd differ in a constant only: same file, line, name and byte code
    _, environment = warm(SMALL.replace("length=3.0", "length=3 * (lambda t: 3.0,)"))
    for _ in range(2):
        found = plug_run(plug_in, environment)
        length = 0.1 * math.sin(1.0) + 2.0
        assert found["Phi_t"] == pytest.approx(-length * 0.1 * math.cos(1.0) / 2.0, rel=ROUNDING)
        expected = (-((0.1 * math.cos(1.0)) ** 2) + length * 0.1 * math.sin(1.0)) / 2.0
        assert found["gamma"] == pytest.approx(expected, rel=ROUNDING)
