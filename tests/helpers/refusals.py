"""Tables of refusals: calls on a small scene, the error that each raises, and words of its message."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

import tsdyn as ts

C = ts.constraints
NAN, INF = math.nan, math.inf
STEP = ts.integrators.Nystrom4(step=1e-2)


def build():
    """A pendulum and a bead; another scene with a stranger in it."""
    scene, other = ts.Scene(), ts.Scene()
    rod = scene.add_body(1.0, (1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0), name="rod")
    bead = scene.add_point_mass(0.5, position=(0.0, 3.0, 0.0), name="bead")
    pivot = scene.add(C.Spherical(rod, scene.ground, point_a=(-1.0, 0.0, 0.0), name="pivot"))
    stranger = other.add_body(1.0, (1.0, 1.0, 1.0), name="stranger")
    return SimpleNamespace(
        scene=scene, ground=scene.ground, rod=rod, bead=bead, pivot=pivot, other=other, stranger=stranger
    )


def text(value):
    """What a test is called by: the beginning of repr, without addresses."""
    return re.sub(" at 0x[0-9a-f]+", "", repr(value))[:30]


def case(name, call, error, *words):
    """A row of the tables: call(world) raises error, and its message contains the words."""
    return pytest.param(call, error, words, id=name)


def in_parts(cases, count):
    """Rows in a few parts: a test of its own costs ten times what a refusal does."""
    return [pytest.param(cases[i::count], id=f"part {i}") for i in range(count)]


def refuse(call, error, words, name=""):
    with pytest.raises(ts.TsdynError) as caught:
        call()
    message = str(caught.value)
    assert isinstance(caught.value, error), f"{name}: {type(caught.value).__name__}: {message}"
    missing = [word for word in words if word not in message]
    assert not missing, f"{name}: {missing} not in: {message}"


NO_NUMBERS = {
    "two numbers": (0.0, 0.0),
    "one number": 0.0,
    "None": None,
    "text": "abc",
    "numbers as text": ("1", "2", "3"),
    "nan": (0.0, 0.0, NAN),
    "inf": (0.0, INF, 0.0),
    "two-dimensional": [[0.0, 0.0, 0.0]],
    "a None in it": (None, 0.0, 0.0),
    "complex": np.array([1j, 0.0, 0.0]),
    "too large for a float": (10**400, 0, 0),
}


def added(**arguments):
    return lambda w: w.scene.add_body(**{"mass": 1.0, "inertia": (1.0, 1.0, 1.0), "name": "block", **arguments})


KINDS = {
    "Spherical": {},
    "Distance": {"length": 1.0},
    "Dot1": {"axis_a": (1, 0, 0), "axis_b": (0, 1, 0)},
    "Dot2": {"axis_a": (1, 0, 0)},
    "PlaneContact": {"normal_b": (0, 0, 1)},
    **{
        kind: {"axis_a": (1, 0, 0), "axis_b": (1, 0, 0)}
        for kind in ("Revolute", "Cylindrical", "Translational", "Planar", "Parallel")
    },
    "Universal": {"axis_a": (1, 0, 0), "axis_b": (0, 1, 0)},
    "ConstantAngle": {"axis_a": (1, 0, 0), "axis_b": (0, 1, 0)},
    "PointOnLine": {"axis_b": (1, 0, 0)},
    "Fixed": {},
    "RotationMotor": {"axis_a": (1, 0, 0), "axis_b": (1, 0, 0), "angle": 0.5},
    "TranslationMotor": {"axis_a": (1, 0, 0)},
    "PointDriver": {"path": (0.0, 0.0, 0.0)},
    "AngleDriver": {"reference_a": (1, 0, 0), "across_a": (0, 1, 0), "reference_b": (1, 0, 0)},
    "Thread": {
        "reference_a": (1, 0, 0),
        "across_a": (0, 1, 0),
        "axis_a": (0, 0, 1),
        "reference_b": (1, 0, 0),
        "lead": 0.1,
    },
    "Screw": {"axis_a": (1, 0, 0), "axis_b": (1, 0, 0), "lead": 0.1},
    "RackAndPinion": {"axis_a": (1, 0, 0), "axis_b": (1, 0, 0), "direction_a": (0, 1, 0), "radius": 0.1},
    "Gear": {"axis_a": (0, 0, 1), "ratio": -1.0},
}


def made(kind, pair=lambda w: (w.rod, w.ground), **arguments):
    return lambda w: getattr(C, kind)(*pair(w), **{"name": "joint", **KINDS.get(kind, {}), **arguments})


def placed(kind, pair=lambda w: (w.rod, w.ground), **arguments):
    given = {"ConstantAngle": {"axis_a": (1, 0, 0), "axis_b": (0, 1, 0)}, "Parallel": {"axis": (1, 0, 0)}}
    given |= {"Spherical": {"point": (0, 0, 0)}, "Universal": {"point": (0, 0, 0), "axis": (0, 1, 0)}}
    given |= {
        "PointDriver": {"point": (0, 0, 0), "path": (0, 0, 0)},
        "AngleDriver": {"reference": (1, 0, 0), "across": (0, 1, 0)},
        "Thread": {"point": (0, 0, 0), "axis": (0, 0, 1), "reference": (1, 0, 0), "across": (0, 1, 0), "lead": 1.0},
        "Screw": {"point": (0, 0, 0), "axis": (1, 0, 0), "lead": 1.0},
        "RackAndPinion": {"point": (0, 0, 0), "axis": (1, 0, 0), "direction": (0, 1, 0), "radius": 1.0},
        "Gear": {"point_a": (1, 0, 0), "point_b": (0, 0, 0), "axis": (0, 0, 1), "ratio": 2.0},
    }
    given = given.get(kind, {"point": (0, 0, 0), "axis": (1, 0, 0)})
    return lambda w: getattr(C, kind).at(*pair(w), **{"name": "joint", **given, **arguments})


def zero(t):
    return 0.0


def one(t):
    return 1.0


def branch(t):
    return 1.0 if t < 2.0 else 2.0
