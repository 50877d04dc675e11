"""The shape of the house: imports run one way, kernels are compiled in one place, files stay short."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = {
    "tsdyn": ROOT / "tsdyn",
    "constraints": ROOT / "constraints",
    "forces": ROOT / "tsdyn" / "forces",
    "integrators": ROOT / "integrators",
}
FILES = {
    (f"{name}.{file.stem}" if name != "tsdyn" else file.stem): file
    for name, folder in FOLDERS.items()
    for file in sorted(folder.glob("*.py"))
}
# lowest first; a module imports from lines above its own, or from its own line
LAYERS = """
_code_hash _interrupts _cache _compiler _compiled _waiting errors _discovery jet truncated checks aligned chebyshev history mesh shapes
calls membership compiled_once names
_kernel
_four rotation linalg pieces table knots motion motions motion_program signal angle recurrences
blocks block_steps block_kernels hubs
vectors
markers bodies tableau friction joint_coordinates joint_turns
joint_motion
poses axis_rows massless
attachment marker_forces frames curvature body_loops
series_loops
force_series
force_loops
friction_loops force_pack
friction_pack
network local
free normal
selection
rows nearness
free_memory
primitive
joint
framed_joint
force
joint_friction
state_function
joint_load
given_load
rigid_shift system stepping progress
handles
still
sparse_rows
assembly interpolation constraints.* forces.*
expansion
workspace run_state
outputs independent
stops
series_state
implicit
integrator
integrators.* constraints.__init__ forces.__init__ integrators.__init__
arguments
loads
landing displacement free_accelerations uniqueness
friction_solve
friction_basis friction_reactions friction_unique
local_chart
newton evaluate diagnostics
kinematics
state
reactions power dense friction_balance conservation
control turning holonomic
chart rank
branch initial start kinetic
approach folds dependence
conflict mobility
assemble
setting null_space tangent editing
scene
maggi_kane linearise driven
series_steps
series_stops
series_length
taylor expansion_pack
series_memory
series_dense
formulation run
_worker
_workers
first_run
memory prepare task sampling
sign_search events drive work account
inside
watch
relay
series_run steps solution
passage origin digits
series_check timers
timekeeper replay phases
simulate choice force_check
integrator_scenes integrator_checks agreement profile_report scene_file
testing benchmark_report benchmark advice
profiling
compile_command
tables plots
benchmark_plot
profile_plot
cli __init__
__main__
"""


def layer_of(module):
    for level, line in enumerate(LAYERS.split("\n")):
        names = line.split()
        if module in names or (module.count(".") and f"{module.split('.')[0]}.*" in names and "__init__" not in module):
            return level
    return pytest.fail(f"{module} has no layer: give it one in test_architecture.py")


def imports(module, file, everywhere=False):
    """The package's modules that a module imports: at its top, or anywhere in it."""
    tree = ast.parse(file.read_text())
    nodes = ast.walk(tree) if everywhere else tree.body
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and node.level:
            inside = "." in module and node.level == 1
            base = module.split(".")[0] + "." if inside else ""
            target = node.module or ""
            names = [f"{base}{target}"] if target else [f"{base}{alias.name}" for alias in node.names]
            for name in names:
                yield f"{name}.__init__" if name in ("constraints", "forces", "integrators") else name


@pytest.mark.parametrize("module", FILES, ids=str)
def test_imports_run_one_way(module):
    for target in imports(module, FILES[module]):
        assert layer_of(target) <= layer_of(module), f"{module} imports {target}, which is above it"
        assert target != module


@pytest.mark.parametrize("module", [m for m in FILES if "." in m], ids=str)
def test_plug_in_folders_import_relatively(module):
    for node in ast.walk(ast.parse(FILES[module].read_text())):
        if isinstance(node, ast.ImportFrom) and not node.level:
            assert not node.module.startswith("tsdyn")
        if isinstance(node, ast.Import):
            assert not any(alias.name.startswith("tsdyn") for alias in node.names)


@pytest.mark.parametrize("module", FILES, ids=str)
def test_numba_is_used_in_one_place(module):
    if module in ("_cache", "_code_hash", "_compiler", "_compiled", "_kernel", "_four", "_workers"):
        return
    names = {
        alias.name
        for node in ast.walk(ast.parse(FILES[module].read_text()))
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for alias in node.names
        if (getattr(node, "module", None) or alias.name).startswith(("numba", "llvmlite"))
    }
    assert names <= {"NumbaError"}


@pytest.mark.parametrize("module", FILES, ids=str)
def test_files_stay_short(module):
    assert len(FILES[module].read_text().splitlines()) <= 400


@pytest.mark.parametrize("folder", ["constraints", "integrators"])
def test_folders_are_no_packages_of_their_own(folder):
    code = f"import {folder}"
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert result.returncode != 0
    assert "relative import" in result.stderr


def test_no_optional_dependency_is_imported():
    names = ("matplotlib", "tqdm", "scipy.linalg", "scipy.integrate", "scipy.optimize")
    code = f"import sys, tsdyn; print([m for m in {names} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
