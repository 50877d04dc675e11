"""The shape of the house: imports run one way, rows have one interface, kernels are compiled in one place."""

import ast
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

from tests.helpers.syntax import nodes, tree, walked

ROOT = Path(__file__).parents[2]
PLACES = {"tsdyn": ROOT / "tsdyn", "tsdyn.constraints": ROOT / "constraints", "tsdyn.integrators": ROOT / "integrators"}
# lowest first: a module imports from its own package and those (or modules that lie flat in tsdyn/) before it
ORDER = [
    "errors",
    "_version",
    "validation",
    "calls",
    "drawing",
    "jit",
    "maths",
    "shapes",
    "motions",
    "elements",
    "model",
    "rows",
    "workspaces",
    "methods",
    "plugins",
    "constraints",
    "forces",
    "integrators",
    "formulations",
    "observables",
    "graphics",
    "runs",
    "taylor",
    "configuration",
    "analyses",
    "ahead",
    "files",
    "importing",
    "simulation",
    "ensembles",
    "measuring",
    "plots",
    "testing",
    "stress",
    "cli",
    "hints",
    "__init__",
    "__main__",
]
GRAPHS = {"interface", "constraint_graph", "inertia_rows", "saddle_matrix", "symbolic", "tolerances"}


def _modules():
    """Every module by its dotted name, and its file."""
    found = {}
    for package, folder in PLACES.items():
        for file in sorted(folder.rglob("*.py")):
            parts = [*package.split("."), *file.relative_to(folder).with_suffix("").parts]
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


FILES = _modules()
PACKAGES = {name for name, file in FILES.items() if file.name == "__init__.py"}


def _district(module):
    """The package, or the module that lies flat in tsdyn/, that a module belongs to."""
    return module.split(".")[1] if "." in module else "__init__"


def kernels(*packages):
    """Every decorated function of some packages, with the name of its module."""
    for module in FILES:
        if _district(module) in packages:
            for node in nodes(FILES[module]):
                if isinstance(node, ast.FunctionDef) and node.decorator_list:
                    yield module, node


def imports(module):
    """The modules of tsdyn that a module imports, lazily or at its top; what type checkers alone import is none."""
    here = module.split(".") if module in PACKAGES else module.split(".")[:-1]
    blocks = [node for node in tree(FILES[module]).body if isinstance(node, ast.If)]
    blocks = [block for block in blocks if ast.unparse(block.test) == "TYPE_CHECKING"]
    typed = {node for block in blocks for part in block.body for node in walked(part)}
    for node in nodes(FILES[module]):
        if node in typed or not isinstance(node, ast.ImportFrom) or not node.level:
            continue
        base = [*here[: len(here) - node.level + 1], *(node.module or "").split(".")]
        base = ".".join(part for part in base if part)
        for alias in node.names:
            name = f"{base}.{alias.name}"
            yield name if name in FILES else base


@cache
def edges():
    """What each module imports."""
    return {module: sorted(set(imports(module)) - {module}) for module in FILES}


def test_packages_import_one_way():
    for module, targets in edges().items():
        for target in targets:
            assert target in FILES, f"{module} imports {target}, which is no module"
            above = ORDER.index(_district(target)) > ORDER.index(_district(module))
            assert not above, f"{module} imports {target}, above it"


def test_no_modules_import_each_other_in_a_circle():
    left = {module: set(targets) - PACKAGES for module, targets in edges().items() if module not in PACKAGES}
    while left:
        free = [module for module, targets in left.items() if not targets & left.keys()]
        assert free, f"a circle among {sorted(left)}"
        for module in free:
            del left[module]


def test_constraint_rows_have_one_interface():
    """Other packages read rows by `interface` alone; graphs and their orders are data that anybody may read."""
    open_to_all = {f"tsdyn.rows.{name}" for name in GRAPHS}
    for module, targets in edges().items():
        if _district(module) != "rows":
            below = {target for target in targets if _district(target) == "rows"}
            assert below <= open_to_all, module


def test_redundant_rows_are_dropped_behind_the_interface():
    for module in FILES:
        if _district(module) not in ("rows",):
            names = {getattr(node, "attr", "") for node in nodes(FILES[module])}
            assert not names & {"dropped", "reselection"}, module


# arguments of kernels that have one order everywhere, and the packages whose kernels keep to it
ARGUMENTS = ("context", "graph", "system", "w", "f", "l", "linear", "q", "qd", "qdd", "t", "out")
NAMED_THRESHOLDS = ("rows", "formulations", "workspaces")  # no bare numbers in kernels
ORDERED = ("rows", "formulations", "workspaces", "constraints", "forces", "taylor", "configuration", "maths")


def test_arguments_of_kernels_have_one_order():
    for module, node in kernels(*ORDERED):
        places = [ARGUMENTS.index(given.arg) for given in node.args.args if given.arg in ARGUMENTS]
        shown = ", ".join(ARGUMENTS[place] for place in places)
        assert places == sorted(places), f"{module}.{node.name}: {shown}"


def test_kernels_have_no_bare_thresholds():
    """Their numbers are multiples of a half, up to eight; all others have names in tolerances.py."""
    for module, node in kernels(*NAMED_THRESHOLDS):
        numbers = [one.value for one in walked(node) if isinstance(getattr(one, "value", None), float)]
        bare = [number for number in numbers if number > 8.0 or not (2.0 * number).is_integer()]
        assert not bare, f"{module}.{node.name}: {bare}"


def test_every_package_has_its_place():
    assert {_district(module) for module in FILES} == set(ORDER) - {"__main__"} | {_district("tsdyn.__main__")}


def test_the_wheel_has_every_package():
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    assert sorted(listed) == sorted(PACKAGES)


def test_built_in_classes_are_written_with_what_plug_ins_have():
    for name, file in FILES.items():
        if _district(name) in ("constraints", "forces", "integrators") and file.name != "__init__.py":
            districts = {_district(target) for target in edges()[name]}
            assert districts <= {"plugins", "constraints", "forces", "integrators"}, name


def test_modules_import_each_other_relatively():
    for module in FILES:
        for node in nodes(FILES[module]):
            if isinstance(node, ast.ImportFrom) and not node.level:
                assert not node.module.startswith("tsdyn"), module
            if isinstance(node, ast.Import):
                assert not any(alias.name.startswith("tsdyn") for alias in node.names), module


PUBLIC = {  # what may be imported of Numba and llvmlite outside jit/backend.py: their documented interfaces
    "numba",
    "numba.types",
    "numba.extending",
    "llvmlite.ir",
    "llvmlite.binding",
}


def _compiler_names(module):
    """The names of Numba's and llvmlite's that a module imports, with the modules that they are in."""
    for node in nodes(FILES[module]):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if alias.name.startswith(("numba", "llvmlite")))
        if isinstance(node, ast.ImportFrom) and not node.level and node.module.startswith(("numba", "llvmlite")):
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                yield (full, "") if full in PUBLIC else (node.module, alias.name)


def test_numba_is_used_in_one_place():
    for module in FILES:
        if _district(module) != "jit":
            assert not list(_compiler_names(module)), module


def test_one_file_uses_what_is_private_of_numba():
    """Imports, and attributes that begin with an underscore and aren't the object's own."""
    for module, file in FILES.items():
        if _district(module) != "jit" or module == "tsdyn.jit.backend":
            continue
        for home, name in _compiler_names(module):
            assert home in PUBLIC, (module, home, name)
            assert not name.startswith("_"), (module, home, name)
        assert not re.search(r"numba\.core|llvmlite\.\w*\._|\b(_defn|_cache|_nrt|_numba_type_)\b", file.read_text()), (
            module
        )


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
