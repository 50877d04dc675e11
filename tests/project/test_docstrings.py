"""The Examples of the docstrings of all that is public: there are some, and they print what they say."""

import doctest
import inspect
from io import StringIO

import pytest

import tsdyn as ts
from tsdyn.elements import force, joint, primitive
from tsdyn.methods import integrator

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
