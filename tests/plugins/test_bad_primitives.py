"""Primitives that are defined wrongly are refused when they are used, by the name of the class."""

import gc

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.refusals import NAN, build, case, refuse, text

TABLE = {"height": 0.0}


def phi(x, par, t, out):
    out[0] = x[2]


def jacobian(x, par, t, out):
    out[0, 2] = 1.0


def gamma(x, xd, par, t, out):
    out[0] = 0.0


def start(self, a, b=None, coordinates=((0.0, 0.0, 0.0),)):
    ts.Primitive.__init__(self, a, b, coordinates, "mine")


def phi_of_table(x, par, t, out):
    out[0] = x[2] * TABLE["height"]


GOOD = {
    "rows": 1,
    "markers": (ts.Point("a"),),
    "phi": staticmethod(phi),
    "jacobian": staticmethod(jacobian),
    "gamma": staticmethod(gamma),
    "__init__": start,
}


def primitive(b=None, **changes):
    """Define a primitive, put one on the bead and evaluate it; a change to `...` leaves the attribute out."""

    def call(w):
        body = {name: value for name, value in {**GOOD, **changes}.items() if value is not ...}
        w.scene.add(type("Mine", (ts.Primitive,), body)(w.bead, b and b(w)))
        return w.scene.evaluate()

    return call


def with_parameters(value):
    return primitive(parameters=lambda self: value)


def count_differs(w):
    def named(self, a):
        ts.Primitive.__init__(self, a, None, ((0.0, 0.0, 0.0),), f"mine on {a.name}")

    own = {"__init__": named, "parameters": lambda self: (1.0,) * (1 + self.a.dimension // 4)}
    mine = type("Mine", (ts.Primitive,), {**GOOD, **own})
    w.scene.add(mine(w.bead))
    w.scene.add(mine(w.rod))
    return w.scene.evaluate()


PRIMITIVES = [
    *(
        case(f"no {name}", primitive(**{name: ...}), ts.InvalidConstraint, "Mine", name, "static method")
        for name in ("phi", "jacobian", "gamma")
    ),
    *(
        case(f"{name}, number of arguments", primitive(**{name: staticmethod(f)}), ts.InvalidConstraint, "Mine", name)
        for name, f in {"phi": gamma, "jacobian": gamma, "gamma": phi, "phi_t": gamma}.items()
    ),
    case("phi no function", primitive(phi=3.0), ts.InvalidConstraint, "Mine", "phi"),
    *(
        case(f"markers {text(m)}", primitive(markers=m), ts.InvalidConstraint, "Mine", "markers", "Point")
        for m in (..., (), "a", (ts.Point,), None, ts.Point("a"))
    ),
    case("marker on c", lambda w: ts.Point("c"), ts.InvalidConstraint, "'a' or 'b'"),
    *(
        case(f"rows {text(r)}", primitive(rows=r), ts.InvalidConstraint, "Mine", "rows")
        for r in (..., 0, -1, 2.5, "1", None)
    ),
    case("b missing", primitive(markers=(ts.Point("a"), ts.Point("b"))), ts.InvalidConstraint, "None", "not a body"),
    case("b only", primitive(markers=(ts.Point("b"),)), ts.InvalidConstraint, "None", "not a body"),
    case("too many coordinates", primitive(markers=(ts.Point("a"),) * 2), ts.InvalidConstraint, "mine", "2 markers"),
    case("never initialised", primitive(__init__=lambda *_: None), ts.InvalidConstraint, "Mine", "__init__"),
    *(
        case(f"parameters {text(v)}", with_parameters(v), ts.InvalidConstraint, "mine", "parameters")
        for v in (3.0, None, ("x",), (None,), (NAN,), ([1.0],))
    ),
    case("number of parameters differs", count_differs, ts.InvalidConstraint, "mine", "parameters"),
    case(
        "the base class",
        lambda w: w.scene.add(ts.Primitive(w.rod)) and w.scene.evaluate(),
        ts.InvalidConstraint,
        "rows",
    ),
]


@pytest.mark.parametrize(("call", "error", "words"), PRIMITIVES)
def test_primitives(call, error, words):
    refuse(lambda: call(build()), error, words)


@pytest.mark.usefixtures("few_objects")
def test_primitive_that_numba_cannot_compile():
    call = primitive(phi=staticmethod(phi_of_table))
    refuse(lambda: call(build()), ts.InvalidConstraint, ("Mine", "phi", "Numba"))
    gc.collect()


def jacobian_nan(x, par, t, out):
    out[0, 2] = np.nan


@pytest.mark.slow
@pytest.mark.parametrize(
    "use", [lambda s: ts.simulate(s, (0, 1)), lambda s: s.assemble()], ids=["simulate", "assemble"]
)
def test_jacobian_of_nan(use):
    w = build()
    w.bead.position = (0.0, 0.0, 0.0)
    w.scene.add(type("Mine", (ts.Primitive,), {**GOOD, "jacobian": staticmethod(jacobian_nan)})(w.bead))
    refuse(lambda: use(w.scene), ts.TsdynError, ("mine", "finite"))
