"""One symbol, one meaning (docs/notation.md), within every function of the core."""

import ast
from collections import defaultdict
from pathlib import Path

from tests.helpers.syntax import nodes, tree, walked

ROOT = Path(__file__).parents[2] / "tsdyn"
CORE = (
    "elements/loops", "formulations", "maths", "methods", "model", "motions", "rows", "runs", "taylor",
)  # fmt: skip
FILES = [ROOT / "workspaces.py", *(path for package in CORE for path in sorted((ROOT / package).glob("*.py")))]
SCOPES = ast.FunctionDef, ast.Lambda, ast.ClassDef, ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp


def of_function(function):
    """All nodes of a function but those of scopes within it."""
    nodes = list(function.body)
    while nodes:
        node = nodes.pop()
        yield node
        nodes += [child for child in ast.iter_child_nodes(node) if not isinstance(child, SCOPES)]


def names_in(target):
    """The names that an assignment to a target binds."""
    return {node.id for node in walked(target) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}


def double_names(function):
    """Names that are the index of a loop and something else besides, or the function's own name."""
    indices, others = set(), {argument.arg for argument in function.args.args}
    for node in of_function(function):
        if isinstance(node, ast.For):
            ranged = isinstance(node.iter, ast.Call) and getattr(node.iter.func, "id", "") == "range"
            (indices if ranged else others).update(names_in(node.target))
        elif isinstance(node, ast.Assign) and not (isinstance(node.value, ast.Constant) and node.value.value == 0):
            others.update(*map(names_in, node.targets))  # a counter that begins at zero is an index, too
    return indices & others | {function.name} & (indices | others)


def test_the_walk_finds_a_name_of_two_things():
    (function,) = ast.parse("def f(c):\n    c = load(c)\n    for c in range(3):\n        f = c\n").body
    assert double_names(function) == {"c", "f"}


def test_a_name_is_bound_to_one_thing_in_a_function():
    found = {}
    for path in FILES:
        for node in tree(path).body:
            if isinstance(node, ast.FunctionDef) and (names := double_names(node)):
                found[f"{path.relative_to(ROOT)}: {node.name}"] = names
    assert found == {}


def test_a_threshold_of_the_core_has_a_name_of_its_own():
    places = defaultdict(set)
    for path in (ROOT / package / "tolerances.py" for package in (*CORE, "elements")):
        for node in tree(path).body if path.exists() else ():
            if isinstance(node, ast.Assign):
                for name in names_in(node.targets[0]):
                    places[name].add(path.parent.name)
    assert {name: found for name, found in places.items() if len(found) > 1} == {}
    assert {"ROUNDING", "SLIP", "SAFETY"} <= places.keys()


def test_a_class_name_has_one_meaning():
    """`Store` is one thing in two formats."""
    places = defaultdict(set)
    for folder in (ROOT, ROOT.parent / "constraints", ROOT.parent / "integrators"):
        for path in folder.rglob("*.py"):
            for node in nodes(path):
                if isinstance(node, ast.ClassDef):
                    places[node.name].add(path.relative_to(ROOT.parent).as_posix())
    double = {name: found for name, found in places.items() if len(found) > 1}
    assert double == {"Store": {"tsdyn/files/hdf5.py", "tsdyn/files/zarr_folder.py"}}


def test_functions_take_ten_positional_arguments_at_most():
    found = set()
    for path in ROOT.rglob("*.py"):
        for node in nodes(path):
            if isinstance(node, ast.FunctionDef):
                names = [argument.arg for argument in (*node.args.posonlyargs, *node.args.args)]
                if len(names) - (names[:1] in (["self"], ["cls"])) > 10:
                    found.add(f"{path.relative_to(ROOT).as_posix()}: {node.name}")
    assert found == set()
