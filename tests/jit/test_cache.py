"""The kernel cache: a second process compiles nothing, and no edit is ever answered by a stale kernel."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import tsdyn

ROOT = Path(__file__).parents[2]
posix = pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX file permissions, limits or locks")

REPORT = """
import json, tsdyn
from tsdyn.jit import cache as _cache
def report(**numbers):
    print(json.dumps({**numbers, **_cache.statistics, "folder": str(_cache.folder())}))
"""
SMALL = (
    REPORT
    + """
import tsdyn as ts
scene = ts.Scene()
mass = scene.add_point_mass(1.0, position=(1.0, 2.0, 2.0))
scene.add(ts.constraints.Distance(mass, scene.ground, length=3.0))
report(Phi=float(scene.evaluate().Phi[0]))
"""
)
TINY = (
    REPORT
    + """
from tsdyn.jit.kernels import entry
@entry
def twice(x):
    return 2.0 * x
report(value=twice(1.0))
"""
)
KERNELS = 4  # of SMALL: three loops of Distance and the one that Python calls


def command(code, environment, cwd, before=()):
    full = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "TSDYN_QUIET")}
    full.update(environment)
    return subprocess.Popen(
        [*before, sys.executable, "-c", code],
        env=full,
        cwd=cwd,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def finish(process):
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    return {"misses": 0, "hits": 0, **json.loads(out.splitlines()[-1])}, err


def run(code, environment, cwd=ROOT):
    return finish(command(code, environment, cwd))


@pytest.fixture
def package(tmp_path):
    """A copy of the sources, to edit."""
    for folder in ("tsdyn", "constraints", "integrators"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def edit(file, old, new):
    text = file.read_text()
    assert text.count(old) == 1
    file.write_text(text.replace(old, new))


@pytest.fixture
def warm(tmp_path):
    """A copy of the user's cache that no other test writes to, as an environment."""
    folder = Path(run(SMALL, {})[0]["folder"])
    shutil.copytree(folder, tmp_path / "warm" / "tsdyn" / folder.name, copy_function=linked)
    return {"NUMBA_CACHE_DIR": str(tmp_path / "warm")}


def linked(source, target):
    """Link a file of the cache, which is never written in place; copy it where files can't be linked."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def test_second_process_compiles_nothing(warm):
    code = (
        REPORT
        + """
from examples import top
from examples.bead_on_surface import build
for form in ("tangent", "maggi-kane"):
    tsdyn.simulate(top.build(), (0.0, 0.01), formulation=form, t_eval=[0.0, 0.0055])
    tsdyn.simulate(
        top.build(), (0.0, 0.01), formulation=form, integrator="dop853", dense_output=True, events=lambda t, _: t - 0.1
    ).at(0.001)
tsdyn.simulate(build(), (0.0, 0.01)).multipliers
report()
"""
    )
    first, _ = run(code, warm)
    files = sorted(Path(first["folder"]).iterdir())
    second, errors = run(code, warm)
    assert second["misses"] == 0
    assert second["hits"] > 15
    assert sorted(Path(second["folder"]).iterdir()) == files
    assert "compiling" not in errors


FORCES = (
    REPORT
    + """
import tsdyn as ts
scene = ts.Scene()
mass = scene.add_point_mass(1.0, position=(1.0, 2.0, 2.0))
body = scene.add_body(1.0, (1.0, 1.0, 1.0))
scene.add(ts.forces.Spring(mass, body, stiffness=3.0))
scene.add(ts.forces.PointForce(body, force=lambda t: (t, 0.0, 0.0)))
scene.add(ts.forces.Torque(body, torque=lambda t, state: (state[0], 0.0, 0.0)))
def drag(t, a, b, par, out):
    out[0] = -par[0] * a[7]
scene.add(ts.forces.UserForce(mass, body, function=drag, parameters=(2.0,)))
solution = ts.simulate(scene, (0.0, 0.01))
solution.multipliers, solution.power, solution.reaction(scene.forces[0])
kernels = [force.kernels for force in scene.forces] + [kind.own_kernels for kind in ts.forces.registered()]
loaded = lambda name: sum(k[name]._address is not None for k in kernels)
report(q=solution.q[-1].tolist(), forces=loaded("force"), jacobians=loaded("jacobian"))
"""
)


def test_forces_are_cached_and_only_those_used_are_loaded(warm):
    first, _ = run(FORCES, warm)
    second, _ = run(FORCES, warm)
    assert (second["misses"], second["q"]) == (0, first["q"])
    edited, _ = run(FORCES.replace("-par[0] * a[7]", "-par[0] * a[8]"), warm)
    assert edited["misses"] == 1  # the loop of the one function
    assert edited["q"] != first["q"]
    assert second["forces"] == 4 + 2  # those of the four; Spring's and PointForce's are their classes', too
    assert second["jacobians"] == 0  # only implicit methods ask for them
    empty = FORCES.replace("scene.add(ts.forces", "(ts.forces").replace(", solution.reaction(scene.forces[0])", "")
    without, _ = run(empty, warm)
    assert (without["misses"], without["forces"]) == (0, 0)


IMPLICIT = (
    REPORT
    + """
from tsdyn.formulations import linearisation as linearise
from benchmarks.stiff import hung, jointed
def loaded(scene):
    kinds = {type(c): c.kernels["curvature"] for c in scene.constraints}.values()
    forces = [force.kernels["jacobian"] for force in scene.forces]
    own = [getattr(linearise, name) for name in ("linearise", "reduce", "factorise", "solve", "soften")]
    return [sum(kernel._address is not None for kernel in kernels) for kernels in (kinds, forces, own)]
scene = jointed()
for method in ("nystrom4", "rk45", "dop853"):
    tsdyn.simulate(scene, (0.0, 1e-3), integrator=method, t_eval=[0.0, 3.3e-4]).multipliers
explicit = loaded(scene)
for method in ("implicittrapezoid", "sdirk54"):
    for build in (jointed, hung):
        ends = tsdyn.simulate(build(), (0.0, 0.01), integrator=method, dense_output=True).at([0.001, 0.002]).q
report(explicit=explicit, implicit=loaded(scene), q=ends.tolist())
"""
)


def test_implicit_methods_are_cached_and_load_what_explicit_ones_do_not(warm):
    first, _ = run(IMPLICIT, warm)
    second, errors = run(IMPLICIT, warm)
    assert (second["misses"], second["q"]) == (0, first["q"])
    assert "compiling" not in errors
    for result in (first, second):
        assert result["explicit"] == [0, 0, 0]
        assert result["implicit"] == [3, 1, 5]  # Spherical, Dot1 and normalisations; TorsionalSpring; all


def test_first_compilation_is_announced_once(tmp_path):
    result, errors = run(SMALL, {"NUMBA_CACHE_DIR": str(tmp_path)})
    assert result["misses"] == KERNELS
    assert errors.count("compiling kernels") == 1


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


@pytest.mark.parametrize("damage", [lambda b: b[: len(b) // 2], lambda b: b"", lambda b: b[:-9] + b"\0" * 9])
def test_damaged_kernels_are_compiled_anew(tmp_path, damage):
    environment = {"NUMBA_CACHE_DIR": str(tmp_path)}
    run(TINY, environment)
    (file,) = tmp_path.rglob("*.kernel")
    file.write_bytes(damage(file.read_bytes()))
    mended, _ = run(TINY, environment)
    assert (mended["value"], mended["damaged"], mended["misses"]) == (2.0, 1, 1)
    again, _ = run(TINY, environment)
    assert (again.get("damaged", 0), again["misses"]) == (0, 0)


@posix
def test_full_disk_costs_a_warning_and_not_the_run(tmp_path):
    full = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
    result, errors = run(full + TINY, {"NUMBA_CACHE_DIR": str(tmp_path)})
    assert (result["value"], result["misses"]) == (2.0, 1)
    assert errors.count("so every process compiles them again") == 1
    assert not [file for file in Path(result["folder"]).iterdir() if file.suffix != ".lock"]


WITHOUT_PRIVILEGE = ["setpriv", "--bounding-set=-dac_override,-dac_read_search"]  # root heeds permissions, too


@posix
def test_complete_cache_that_can_not_be_written_is_used(tmp_path):
    as_root = hasattr(os, "getuid") and os.getuid() == 0
    if as_root and not shutil.which("setpriv"):
        pytest.skip("root writes everywhere")
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / "kept"), "TMPDIR": str(scratch)}
    folder = Path(run(TINY, environment)[0]["folder"])
    for path in (folder, folder.parent, folder.parent.parent):
        path.chmod(0o555)
    process = command(TINY, environment, ROOT, before=WITHOUT_PRIVILEGE if as_root else ())
    found, errors = finish(process)
    assert (found["value"], found["misses"]) == (2.0, 0)
    assert Path(found["folder"]).is_relative_to(scratch)
    assert errors == ""


INTERRUPTED = """
import signal
from numba.core.registry import cpu_target
from tsdyn.jit.kernels import entry
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
engine = cpu_target.target_context.codegen()._engine._ee
found = engine._object_cache_notify
def notify(*arguments):
    signal.raise_signal(signal.SIGINT)
    found(*arguments)
engine._object_cache_notify = notify
@entry
def twice(x):
    return 2.0 * x
try:
    twice(1.0)
except KeyboardInterrupt:
    print("interrupted")
engine._object_cache_notify = found
print(twice(1.0), signal.getsignal(signal.SIGINT) is signal.default_int_handler)
"""


def test_interrupt_while_llvm_works_is_a_keyboard_interrupt(tmp_path):
    process = command(INTERRUPTED, {"NUMBA_CACHE_DIR": str(tmp_path), "TSDYN_QUIET": "1"}, ROOT)
    assert process.communicate(timeout=300) == ("interrupted\n2.0 True\n", "")


@posix
def test_no_writable_home_falls_back_to_the_temporary_folder(package):
    blocked = package / "file"
    blocked.touch()
    scratch = package / "scratch"
    scratch.mkdir()
    environment = {"HOME": str(blocked), "XDG_CACHE_HOME": "", "TMPDIR": str(scratch)}
    for folder in ("tsdyn", "constraints", "integrators"):
        (package / folder).chmod(0o555)
    first, _ = run(SMALL, environment, package)
    second, _ = run(SMALL, environment, package)
    assert first["folder"].startswith(str(scratch))
    assert (first["misses"], second["misses"]) == (KERNELS, 0)


@posix
def test_processes_starting_together_compile_once(tmp_path):
    environment = {"NUMBA_CACHE_DIR": str(tmp_path)}
    results = [finish(process)[0] for process in [command(SMALL, environment, ROOT) for _ in range(3)]]
    assert {result["Phi"] for result in results} == {0.0}
    assert sum(result["misses"] for result in results) == KERNELS


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


def test_plug_in_is_cached_and_its_edits_are_seen(plug_in, warm):
    run(SMALL.replace("length=3.0", "length=3 * (lambda t: 3.0,)"), warm)  # so that all of Distance is in the cache
    first = plug_run(plug_in, warm)
    assert first["misses"] == 3 + 3  # its loops and the three motions: nothing of the core
    assert first["Phi"] == 0.0
    second = plug_run(plug_in, warm)
    assert second["misses"] == 0
    edit(plug_in / "helper.py", "LEVEL = 9.0", "LEVEL = 5.0")
    assert plug_run(plug_in, warm)["Phi"] == 4.0
    edit(plug_in / "deeper.py", "return x**power", "return x**power + 1.0")  # reached as module.function
    assert plug_run(plug_in, warm)["Phi"] == 5.0
    edit(plug_in / "helper.py", "power=2.0", "power=3.0")
    assert plug_run(plug_in, warm)["Phi"] == 23.0


def test_functions_on_one_line_are_told_apart(plug_in, warm):
    # f and fdd differ in a constant only: same file, line, name and byte code
    import math

    for _ in range(2):
        found = plug_run(plug_in, warm)
        length = 0.1 * math.sin(1.0) + 2.0
        assert found["Phi_t"] == pytest.approx(-length * 0.1 * math.cos(1.0) / 2.0, rel=1e-14)
        expected = (-((0.1 * math.cos(1.0)) ** 2) + length * 0.1 * math.sin(1.0)) / 2.0
        assert found["gamma"] == pytest.approx(expected, rel=1e-14)


def test_plug_in_integrator_is_cached(warm):
    code = (
        REPORT
        + """
from examples import top
from examples.plug_in_integrator import METHODS
for method in METHODS:
    for form in ("tangent", "maggi-kane"):
        tsdyn.simulate(top.build(), (0.0, 0.01), formulation=form, integrator=method(1e-6, 1e-6), t_eval=[0.0, 0.0055])
report()
"""
    )
    run(code.replace("METHODS:", "(tsdyn.integrators.RK45,):"), warm)  # so that all of the core is in the cache
    for file in Path(warm["NUMBA_CACHE_DIR"]).rglob("plug_in_integrator*"):
        file.unlink()  # left by whoever has run the example before
    assert run(code, warm)[0]["misses"] == 3  # two step kernels and an error estimate: nothing of the core
    assert run(code, warm)[0]["misses"] == 0


def test_threads_that_start_together(warm):
    """In a process that has loaded nothing yet."""
    code = (
        REPORT
        + """
from concurrent.futures import ThreadPoolExecutor
from examples import top
with ThreadPoolExecutor(4) as pool:
    ends = list(pool.map(lambda _: tsdyn.simulate(top.build(), (0.0, 0.1)).q[-1].tolist(), range(8)))
report(same=all(end == ends[0] for end in ends))
"""
    )
    run(code, warm)
    result, _ = run(code, warm)
    assert (result["same"], result["misses"]) == (True, 0)


def test_numba_settings_are_left_alone():
    from numba.core.caching import CacheImpl, _CacheLocator

    assert tsdyn.__version__
    assert all(locator.__module__ == _CacheLocator.__module__ for locator in CacheImpl._locator_classes)
    assert os.environ.get("NUMBA_CACHE_LOCATOR_CLASSES", "") == numba.config.CACHE_LOCATOR_CLASSES


def test_debug_mode_runs_plain_python():
    code = (
        REPORT
        + """
from examples import top
from tsdyn.jit import kernels as _kernel
end = tsdyn.simulate(top.build(), (0.0, 0.01), t_eval=[0.0055, 0.01])
report(q=end.q.tolist(), debug=_kernel.DEBUG)
"""
    )
    compiled, _ = run(code, {})
    plain, _ = run(code, {"TSDYN_DEBUG": "1"})
    assert (compiled["debug"], plain["debug"]) == (False, True)
    assert plain["misses"] == plain["hits"] == 0
    assert [pytest.approx(row, abs=1e-15) for row in compiled["q"]] == plain["q"]


DRIVEN = (
    REPORT
    + """
import numpy as np
import tsdyn as ts
C, M = ts.constraints, ts.motions
def scene(angle, travel):
    scene = ts.Scene()
    wheel = scene.add_body(1.0, (1.0, 1.0, 1.0))
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(C.RotationMotor.of(hinge, angle=angle))
    other = scene.add_body(1.0, (1.0, 1.0, 1.0), position=(2.0, 0.0, 0.0))
    scene.add(C.Revolute.at(scene.ground, other, point=(2, 0, 0), axis=(0, 0, 1)))
    scene.add(C.Gear.at(wheel, other, point_a=(0, 0, 0), point_b=(2, 0, 0), axis=(0, 0, 1), ratio=-0.7))
    nut = scene.add_body(1.0, (1.0, 1.0, 1.0))
    scene.add(C.Screw.at(scene.ground, nut, point=(0, 0, 0), axis=(1, 0, 0), lead=0.1))
    bead = scene.add_point_mass(1.0)
    scene.add(C.PointDriver(scene.ground, bead, path=(travel, 0.0, travel)))
    return scene
ends = []
for angle, travel in ((M.Sine(1.0, 2.0), M.Polynomial((0, 0, 1))), MORE):
    for method in ("taylor", "dop853"):
        ends.append(ts.simulate(scene(angle, travel), (0.0, 0.1), integrator=method, initial_tol=10.0).q[-1].tolist())
alone = scene(lambda t: t + 0.1 * np.sin(t), lambda t: t * t)
ends.append(ts.simulate(alone, (0.0, 0.1), integrator="dop853", initial_tol=10.0).q[-1].tolist())
report(q=ends)
"""
)


def test_new_motions_compile_nothing(warm):
    """Whatever is prescribed is numbers for kernels that are there."""
    few, more = "(M.Ramp(), M.Ramp())", "(np.tanh(M.Ramp(0.0, 3.0)), M.Exponential(1.0, 2.0) * M.Sine(1.0, 3.0))"
    first, _ = run(DRIVEN.replace("MORE", few), warm)
    second, errors = run(DRIVEN.replace("MORE", more), warm)
    assert second["misses"] == 0
    assert "compiling" not in errors
    assert second["q"][0] == first["q"][0]


def test_a_scene_without_motions_loads_none_of_it():
    code = (
        REPORT
        + """
from examples import slider_crank
from tsdyn.motions.program import run_program
for method in ("taylor", "dop853"):
    tsdyn.simulate(slider_crank.build(), (0.0, 0.01), integrator=method)
kinds = [kind.kernels for kind in tsdyn.constraints.registered()]
loaded = [name for kernels in kinds for name, kernel in kernels.items() if kernel._address is not None]
report(program=run_program._address is not None, loaded=loaded)
"""
    )
    found, _ = run(code, {})
    assert not found["program"]
    assert not {"driven_series", "far_driven_series", "remember", "drift", "phi_t"} & set(found["loaded"])
