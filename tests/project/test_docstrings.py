"""Docstrings: the examples of all that is public print what they say, and references are to what there is."""

import ast
import doctest
import inspect
import re
from io import StringIO
from pathlib import Path
from tokenize import COMMENT, generate_tokens

import pytest

import tsdyn as ts
from tsdyn.elements import force, joint, primitive
from tsdyn.methods import integrator

PACKAGES = ("tsdyn", "constraints", "integrators")
SUFFIXES = ("html", "json", "toml")  # of files
MODULES = (ts, ts.constraints, ts.forces, ts.integrators, ts.motions, ts.plots, ts.shapes, ts.testing)
PUBLIC = {f"{module.__name__}.{name}": getattr(module, name) for module in MODULES for name in module.__all__}
METHODS = {
    f"tsdyn.{kind.__name__}.{name}": value
    for kind in (ts.Scene, ts.Solution)
    for name, value in inspect.getmembers(kind, inspect.isfunction)
    if not name.startswith("_") and "Examples\n" in (value.__doc__ or "")
}
OBJECTS = {name: value for name, value in PUBLIC.items() if isinstance(value, type) or inspect.isroutine(value)}


@pytest.fixture
def registries():
    """What an example defines is forgotten."""
    kept = [(module._registry, dict(module._registry)) for module in (force, integrator, joint, primitive)]
    yield
    for registry, before in kept:
        registry.clear()
        registry.update(before)


@pytest.mark.slow_for(
    "tsdyn.forces.CoulombFriction",
    "tsdyn.profile",
    "tsdyn.testing.*",
    "tsdyn.forces.*Friction",
    "tsdyn.forces.Torque",
    "tsdyn.integrators.SDIRK54",
    "tsdyn.integrators.ImplicitTrapezoid",
    "tsdyn.DiagonallyImplicit",
)
@pytest.mark.parametrize("name", OBJECTS | METHODS)
def test_examples_print_what_they_say(name, registries):
    if "plot" in name:
        pytest.importorskip("matplotlib")
    text = inspect.getdoc((OBJECTS | METHODS)[name])
    assert "\nExamples\n--------\n" in text
    test = doctest.DocTestParser().get_doctest(text, {}, name, None, 0)
    assert test.examples
    said = StringIO()
    result = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test, out=said.write)
    assert result.failed == 0, said.getvalue()


def references(tree, text):
    """Words `module.name` in the comments of a source and in its docstrings, but for examples."""
    found = [token.string for token in generate_tokens(StringIO(text).readline) if token.type == COMMENT]
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    found += [ast.get_docstring(node) or "" for node in ast.walk(tree) if isinstance(node, documented)]
    lines = [line for part in found for line in part.splitlines() if not line.lstrip().startswith((">>>", "..."))]
    return re.findall(r"(?<![\w./])([a-z]+_[a-z_]{2,})\.(\w{3,})\b(?![/.])", "\n".join(lines))


def test_comments_and_docstrings_refer_to_what_there_is():
    """Of words with an underscore, a module or a name of the file: what is said to be computed elsewhere is found."""
    root = Path(ts.__file__).parents[1]
    sources = {path: path.read_text() for name in PACKAGES for path in (root / name).rglob("*.py")}
    trees, names = {path: ast.parse(text) for path, text in sources.items()}, {}
    for path, tree in trees.items():
        known = names.setdefault(path.stem, set())
        for node in ast.walk(tree):
            known |= {getattr(node, key) for key in ("name", "id", "arg", "attr", "asname") if hasattr(node, key)}
    stale = [
        f"{path.relative_to(root)}: {module}.{name}"
        for path, text in sources.items()
        for module, name in references(trees[path], text)
        if name not in names.get(module, ()) and not (name in SUFFIXES or module in names[path.stem])
    ]
    assert len(sources) > 300
    assert not stale
