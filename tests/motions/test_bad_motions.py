"""Motions that are no functions of time, no derivatives of each other, or can't be compiled."""

import gc
import math
import re
from functools import partial

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.refusals import INF, NAN, STEP, branch, build, case, one, refuse, zero
from tsdyn.jit import backend

C = ts.constraints


def raising(t):
    raise ValueError("not yet")


def root(t):
    return 0.0 * math.sqrt(0.5 - t)


def pole(t):
    return 0.0 / (0.53 - t) if t != 0.53 else 1 // 0


def slope(t):
    return 0.3 * t


def lifted(motion):
    """A bead held at a height: its constraint is called lift."""

    def call(w):
        w.scene.add(C.Dot2(w.ground, w.bead, axis_a=(0, 0, 1), value=motion, name="lift"))
        return ts.simulate(w.scene, (0.0, 1.0), integrator=STEP)

    return call


MOTIONS = [
    *(
        case(f"not callable, {i}", lifted(m), ts.InvalidConstraint, "lift", "value", "(f, fd, fdd)")
        for i, m in enumerate([(zero, 3.0, zero), (zero, zero), branch, (zero, None, zero), (zero,) * 4, "sin"])
    ),
    case("Motion of numbers", lambda w: ts.Motion(1.0, 2.0, 3.0), ts.InvalidConstraint, "(f, fd, fdd)"),
    case("one coefficient", lambda w: ts.motions.Polynomial(0.4), ts.InvalidArgument, "c_0 first: Polynomial([0.4])"),
    case("nan at first", lifted((lambda t: NAN, zero, zero)), ts.InvalidConstraint, "lift", "not finite", "t = 0"),
    case("inf at first", lifted((zero, zero, lambda t: INF)), ts.InvalidConstraint, "lift", "not finite", "t = 0"),
    case("raises", lifted((raising, zero, zero)), ts.InvalidConstraint, "lift", "not yet", "t = 0"),
    case("returns None", lifted((lambda t: None, zero, zero)), ts.InvalidConstraint, "lift", "t = 0"),
    case("returns text", lifted((lambda t: "x", zero, zero)), ts.InvalidConstraint, "lift", "t = 0"),
    case("returns a complex number", lifted((lambda t: 1j, zero, zero)), ts.InvalidConstraint, "lift", "t = 0"),
    case("returns an array", lifted((lambda t: np.zeros(1), zero, zero)), ts.InvalidConstraint, "lift", "t = 0"),
    case("two arguments", lifted((lambda t, x: 0.0, zero, zero)), ts.InvalidConstraint, "lift", "argument"),
    case("wrong rate", lifted((slope, zero, zero)), ts.InvalidConstraint, "lift", "fd is not the derivative of f"),
    case(
        "wrong acceleration", lifted((zero, zero, one)), ts.InvalidConstraint, "lift", "fdd is not the derivative of fd"
    ),
    case("no real value later", lifted((root, zero, zero)), ts.InvalidConstraint, "lift", "t = "),
    case("divides by zero later", lifted((pole, zero, zero)), ts.InvalidConstraint, "lift", "t = "),
]


@pytest.mark.parametrize(("call", "error", "words"), MOTIONS)
def test_motions(call, error, words):
    refuse(lambda: call(build()), error, words)


class Called:
    def __call__(self, t):
        return 0.0

    def method(self, t):
        return 0.0 * len(vars(self))


def optional(t, scale=0.0):
    return scale * t


CALLABLES = {
    "built-in": (math.sin, math.cos, lambda t: -math.sin(t)),
    "ufunc": (np.sin, np.cos, lambda t: -np.sin(t)),
    "partial": (partial(optional, scale=0.0), zero, zero),
    "object": (Called(), zero, zero),
    "bound method": (Called().method, zero, zero),
    "class": (float, one, zero),
    "default argument": (optional, zero, zero),
}


@pytest.mark.usefixtures("few_objects")
@pytest.mark.slow_but("built-in", "partial")
@pytest.mark.parametrize("motion", CALLABLES.values(), ids=CALLABLES.keys())
def test_other_callables_run_or_are_refused(motion):
    try:
        lifted(motion)(build()).raise_if_failed()
    except ts.InvalidConstraint as error:
        assert "lift" in str(error)  # noqa: PT017  (either is right)
    gc.collect()  # a file left open by a failed compilation is this test's


TABLE = {"height": 0.0}


def looked_up(t):
    return 0.0 * TABLE["height"]


def looked_up_too(t):
    return 1.0 * TABLE["height"]


def locked():
    """The kernels whose compilation still holds its lock."""
    caches = [item for item in gc.get_objects() if issubclass(type(item), backend.KernelCache)]
    return [cache._name for cache in caches if "looked_up" in cache._name and cache._lock is not None]


@pytest.mark.usefixtures("few_objects")
def test_motion_that_numba_cannot_compile():
    with pytest.raises(ts.InvalidConstraint, match=r"lift.*Numba can't compile") as caught:
        lifted((looked_up, zero, zero))(build())
    held = locked()  # else the same motion, tried again, waits for the lock of the first try
    del caught
    gc.collect()
    assert held == []


@pytest.mark.usefixtures("few_objects")
def test_motion_object_is_named_after_its_constraint():
    refuse(lambda: lifted(ts.Motion(looked_up_too, zero, zero))(build()), ts.InvalidConstraint, ("lift", "Numba"))
    gc.collect()


def test_defaults_without_a_star():
    scene = ts.Scene()
    arm = scene.add_body(1.0, (1.0, 1.0, 1.0), position=(1, 0, 0), name="arm")
    hinge = scene.add(ts.constraints.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    for made, words in (
        (lambda: ts.forces.PointForce(arm, force=lambda t, f=2.0: (f * t, 0.0, 0.0)), "lambda t, *, f=f: ..."),
        (lambda: ts.forces.PointForce(arm, force=lambda t, s, f=2.0: (f, 0.0, 0.0)), "lambda t, s, *, f=f: ..."),
        (lambda: ts.constraints.Distance(arm, scene.ground, length=lambda t, f=1: f + t), "lambda t, *, f=f: ..."),
        (lambda: ts.forces.JointTorque(hinge, function=lambda t, a, w, k=2.0: -k * a), "lambda t, a, w, *, k=k: ..."),
    ):
        with pytest.raises(ts.TsdynError, match=re.escape(f"; defaults stand behind a star: {words}")):
            made()
    scene.add(ts.forces.PointForce(arm, force=lambda t, *, f=2.0: (f * t, 0.0, 0.0), name="push"))
    np.testing.assert_array_equal(scene.evaluate(t=3.0).Q_A[:3], (6.0, 0.0, -9.81))
    scene.add(ts.forces.PointForce(arm, force=lambda t, state=None: (t, 0.0, 0.0), name="pull"))
