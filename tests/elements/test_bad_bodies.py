"""Impossible bodies and gravity are refused, and a refusal changes nothing."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.refusals import INF, NAN, NO_NUMBERS, added, build, case, refuse, text
from tests.helpers.tolerances import EXACT

C = ts.constraints
MASSES = (0.0, -1.0, NAN, INF, "x", "5", None, [1.0], [1.0, 2.0], (), 1j, np.complex128(1.0), 10**400)
INERTIAS = [
    ((1.0, 1.0, 3.0), "triangle"),
    (np.diag((1.0, 1.0, 3.0)), "triangle"),
    ((1.0, 1.0, -1.0), "negative"),
    ((0.0, 0.0, 0.0), "add_point_mass"),
    ((1.0, 0.0, 0.0), "triangle"),
    ((1.0, 1.0, NAN), "finite"),
    (np.diag((1.0, 1.0, INF)), "finite"),
    ([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "symmetric"),
    ((1.0, 1.0), "3 principal values"),
    (np.eye(4), "3 x 3"),
    ([[1.0, 2.0], [3.0]], "3 x 3"),
    (5.0, "3 x 3"),
    (None, "3 x 3"),
    ("abc", "3 x 3"),
    (("1", "1", "1"), "inertia"),
    (np.array([1.0, 1.0, 1.0 + 1j]), "inertia"),
]
ORIENTATIONS = [
    ((0.0, 0.0, 0.0, 0.0), "zero"),
    ((1.0, 0.0, 0.0, NAN), "finite"),
    ((1.0, 0.0, 0.0), "four"),
    (np.eye(2), "four"),
    (np.diag((1.0, 1.0, -1.0)), "reflection"),
    (-np.eye(3), "reflection"),
    (1.001 * np.eye(3), "orthogonal"),
    (np.ones((3, 3)), "orthogonal"),
    (np.zeros((3, 3)), "orthogonal"),
    (1e300 * np.eye(3), "orthogonal"),
    (NAN * np.eye(3), "four"),
    (np.eye(3)[None], "four"),
    (1.0, "four"),
    (None, "four"),
    ("abc", "four"),
    (("1", "0", "0", "0"), "four"),
    ((2.0, 0.0, 0.0, 0.0), "length 2"),
    ((1.000002, 0.0, 0.0, 0.0), "1.000002"),
    (Rotation.identity(2), "one scipy Rotation"),
    (Rotation, "four"),
]
BODIES = [
    *(case(f"mass {text(m)}", added(mass=m), ts.InvalidBody, "block", "mass", "positive") for m in MASSES),
    *(case(f"inertia {i}", added(inertia=j), ts.InvalidBody, "block", w) for i, (j, w) in enumerate(INERTIAS)),
    *(
        case(f"orientation {i}", added(orientation=p), ts.InvalidBody, "block", w)
        for i, (p, w) in enumerate(ORIENTATIONS)
    ),
    *(
        case(f"{name}: {what}", added(**{name: value}), ts.InvalidBody, "block", name.replace("_", " "), "three finite")
        for name in ("position", "velocity", "angular_velocity")
        for what, value in NO_NUMBERS.items()
    ),
    *(
        case(f"gravity: {what}", lambda w, v=value: ts.Scene(gravity=v), ts.InvalidArgument, "gravity", "three finite")
        for what, value in NO_NUMBERS.items()
    ),
    case("mass underflows", added(mass=1e-310), ts.InvalidBody, "block", "mass", "1e-300"),
    case("point mass without mass", lambda w: w.scene.add_point_mass(0.0, name="dot"), ts.InvalidBody, "dot", "mass"),
    case("name twice", added(name="rod"), ts.InvalidBody, "'rod'", "another name"),
    case("point mass named twice", lambda w: w.scene.add_point_mass(1.0, name="rod"), ts.InvalidBody, "'rod'"),
    case("named ground", added(name="ground"), ts.InvalidBody, "'ground'", "another name"),
    case("point mass, orientation", lambda w: w.bead.orientation, ts.InvalidBody, "bead", "add_body"),
    case("unknown name", lambda w: w.scene.body("door"), ts.InvalidBody, "'door'", "rod", "bead"),
    *(
        case(f"set {name}", lambda w, n=name, v=value: setattr(w.rod, n, v), ts.InvalidBody, "rod", name)
        for name, value in {"mass": -1.0, "inertia": (1, 1, NAN), "orientation": (2, 0), "position": "x"}.items()
    ),
]


@pytest.mark.parametrize(("call", "error", "words"), BODIES)
def test_bodies(call, error, words):
    refuse(lambda: call(build()), error, words)


def test_refused_body_leaves_no_trace():
    w = build()
    with pytest.raises(ts.InvalidBody):
        added(velocity=None)(w)
    assert w.scene.bodies == (w.rod, w.bead)
    assert len(w.scene.constraints) == 2
    assert added()(w).name == "block"


@pytest.mark.parametrize("name", ["mass", "inertia", "position", "orientation", "velocity", "angular_velocity"])
def test_refused_value_is_not_taken_over(name):
    w = build()
    before = getattr(w.rod, name)
    with pytest.raises(ts.InvalidBody):
        setattr(w.rod, name, None)
    np.testing.assert_array_equal(getattr(w.rod, name), before)
    with pytest.raises(ts.InvalidArgument):
        w.scene.gravity = None
    np.testing.assert_array_equal(w.scene.gravity, (0.0, 0.0, -9.81))


@pytest.mark.parametrize("name", ["position", "velocity", "angular_velocity", "orientation", "inertia", "gravity"])
def test_change_of_one_component_is_made_or_refused_not_lost(name):
    w = build()
    owner = w.scene if name == "gravity" else w.rod
    try:
        getattr(owner, name)[0] = 0.5
    except ValueError:  # read-only
        return
    assert np.all(getattr(owner, name)[0] == 0.5)


def test_change_of_a_constraint_is_made_or_refused_not_lost():
    w = build()
    string = w.scene.add(C.Distance(w.bead, w.ground, length=3.0))
    w.scene.evaluate()
    try:
        string.length = 1.0
    except (AttributeError, ts.TsdynError):
        return
    assert w.scene.evaluate().Phi[3] != 0.0


def test_default_names_avoid_those_taken():
    scene = ts.Scene()
    scene.add_point_mass(1.0, name="body2")
    assert scene.add_point_mass(1.0).name not in ("body2", "")


def test_what_is_unusual_and_right():
    w = build()
    tilted = w.scene.add_body(1, np.eye(3) * 2, orientation=np.array([1.0 + 5e-7, 0, 0, 0]))
    assert np.array_equal(tilted.orientation, (1, 0, 0, 0))
    turned = w.scene.add_body(np.float32(1), [1, 1, 2], orientation=Rotation.from_euler("z", 90, degrees=True))
    np.testing.assert_allclose(turned.orientation, (math.sqrt(0.5), 0, 0, math.sqrt(0.5)), atol=EXACT)
    normalisation = w.scene.add(C.EulerNormalization(w.rod))
    assert normalisation is w.scene.add(C.EulerNormalization(w.rod))
    assert normalisation in w.scene.constraints
    solution = ts.simulate(w.scene, np.array([0, 1]), integrator="NYSTROM-4", max_steps=np.int64(3), progress=False)
    assert solution.status == ts.Status.MAX_STEPS


@pytest.mark.parametrize("make", [lambda: ts.Body(1.0), lambda: ts.Body(mass=1.0), lambda: ts.PointMass(mass=1.0)])
def test_bodies_are_made_by_their_scene(make):
    with pytest.raises(ts.InvalidBody, match="are made by scene"):
        make()
