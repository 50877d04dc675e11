"""`ts.compare`: errors of other engines, and scenes that they can't have."""

import sys
from itertools import pairwise

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import HELD, TIGHT

C = ts.constraints


def pendulum():
    """A bar on a hinge with a spring and a damper."""
    scene = ts.Scene()
    bar = scene.add_body(mass=2.0, inertia=(0.1, 0.2, 0.2), position=(0.5, 0, 0), name="bar")
    scene.add(C.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    spring = {"stiffness": 3.0, "damping": 0.1, "free_angle": 0.3}
    scene.add(ts.forces.TorsionalSpring.at(scene.ground, bar, axis=(0, 1, 0), **spring, name="spring"))
    return scene


def four_bar():
    """A loop, closed by a ball."""
    scene, points, last = ts.Scene(), np.array([(0, 0, 0), (0, 0, 1), (2, 0, 1.5), (2, 0, 0)], float), None
    for i, (one, other) in enumerate(pairwise(points)):
        bar = scene.add_body(mass=1.0 + i, inertia=(0.1, 0.1, 0.1), position=(one + other) / 2, name=f"bar{i}")
        scene.add(C.Revolute.at(last or scene.ground, bar, point=one, axis=(0, 1, 0), name=f"pin{i}"))
        last = bar
    scene.add(C.Spherical.at(last, scene.ground, point=points[-1], name="ball"))
    return scene


def beads():
    """Two particles, a rod and a spring, pulled aside."""
    scene = ts.Scene()
    one = scene.add_point_mass(mass=1.0, position=(1, 0, 0), velocity=(0, 1, 0), name="one")
    other = scene.add_point_mass(mass=2.0, position=(2, 0, 0), name="other")
    scene.add(C.Distance(one, scene.ground, name="rod"))
    scene.add(ts.forces.Spring(one, other, stiffness=50.0, damping=0.2, name="spring"))
    scene.add(ts.forces.PointForce(other, force=(0, 0, 3), name="pull"))
    return scene


def joints():
    """A tree of the other joints, each body on its own."""
    scene = ts.Scene(gravity=(0, 0, -1))
    kinds = {"Cylindrical": {}, "Planar": {}, "Translational": {}, "Universal": {"axis_b": (0, 1, 0)}, "Fixed": {}}
    for i, (kind, more) in enumerate(kinds.items()):
        body = scene.add_body(mass=1.0, inertia=(0.1, 0.2, 0.15), position=(i, 0.3, -0.2), name=kind)
        axis = {} if kind == "Fixed" else {"axis": (1, 0, 0.0)}
        scene.add(getattr(C, kind).at(scene.ground, body, point=(i, 0, 0), **axis, **more, name=f"joint {kind}"))
    return scene


def needle():
    """A slender rod, without inertia about its axis."""
    scene = ts.Scene()
    bar = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=3.0), position=(0.5, 0, 0), name="bar")
    scene.add(C.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    return scene


def rotors():
    """A bar on a slide, both driven by rotors."""
    scene = ts.Scene()
    cart = scene.add_body(mass=2.0, inertia=(0.1, 0.2, 0.3), name="cart")
    bar = scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.02), position=(0.5, 0, 0), name="bar")
    rail = scene.add(C.Translational.at(scene.ground, cart, point=(0, 0, 0), axis=(1, 0, 0), name="rail"))
    hinge = scene.add(C.Revolute.at(cart, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    scene.add(ts.forces.Armature(rail, inertia=3.0))
    scene.add(ts.forces.Armature(hinge, inertia=1e-3, ratio=20.0))
    return scene


def planes():
    """A top on a table, a slab on a fixed point, and a bead on the tilted side of a slab."""
    scene = ts.Scene()
    table = scene.add_body(mass=5.0, inertia=(1.0, 1.0, 1.5), position=(0, 0, -0.1), name="table")
    scene.add(C.Revolute.at(scene.ground, table, point=(0.2, 0, 0), axis=(0.1, 0, 1), name="post"))
    spun = {"velocity": (0.1, 0, 0), "angular_velocity": (0.5, 0, 12)}
    top = scene.add_body(mass=3.0, inertia=(0.9, 0.9, 0.3), position=(0.5, 0, 1), **spun, name="top")
    scene.add(C.PlaneContact(top, table, point_a=(0, 0, -1), point_b=(0, 0, 0.1), normal_b=(0, 0, 1), name="tip"))
    moving = {"velocity": (0.2, 0.1, 0), "angular_velocity": (0, 0, 3)}
    slab = scene.add_body(mass=2.0, inertia=(0.3, 0.2, 0.4), position=(3, 0, 0.1), **moving, name="slab")
    scene.add(C.PlaneContact(scene.ground, slab, point_a=(3.1, 0.2, 0), point_b=(0, 0, -0.1), normal_b=(0, 0, 1)))
    bead = scene.add_point_mass(mass=1.0, position=(3, 0, 0.2), velocity=(0, 0.1, 0), name="bead")
    scene.add(C.PlaneContact(bead, slab, point_b=(0, 0, 0.1), normal_b=(0, 0, 1)))
    scene.assemble()
    return scene


@pytest.mark.parametrize("build", [pendulum, four_bar, beads, joints, needle, planes, rotors])
def test_mujoco_with_small_steps_agrees(build):
    pytest.importorskip("mujoco")
    found = ts.compare(build(), (0.0, 0.2), with_="mujoco", step=2e-4, method="rk4", outputs=20)
    loop = build in (four_bar, beads)
    assert found.error.max() < (5e-3 if loop else 1e-10)
    assert found.rotation_error.max() < (5e-3 if loop else 1e-10)
    assert found.error.shape == found.t.shape == found.theirs.energy.shape
    assert found.ours.position.max() < HELD
    assert (found.theirs.position.max() > TIGHT) == loop
    assert found.reached


def test_euler_is_of_first_order():
    pytest.importorskip("mujoco")
    errors = [ts.compare(pendulum(), (0.0, 0.5), with_="mujoco", step=h).error[-1] for h in (2e-3, 1e-3)]
    assert 1.8 < errors[0] / errors[1] < 2.2


def test_result():
    pytest.importorskip("mujoco")
    found = ts.compare(pendulum(), (1.0, 1.5), with_="mujoco", step=1e-2)
    assert found.t[0] == 1.0
    assert found.t[-1] == 1.5
    assert all(word in str(found) for word in ("MuJoCo", "step 0.01 s", "(bar)", "energy"))
    assert "<table>" in found._repr_html_()
    pytest.importorskip("matplotlib")
    figure = found.plot()
    assert len(figure.axes) == 4


@pytest.mark.slow
@pytest.mark.parametrize("build", [pendulum, four_bar, beads])
def test_exudyn_with_small_steps_agrees(build):
    pytest.importorskip("exudyn")
    found = ts.compare(build(), (0.0, 0.2), with_="exudyn", step=1e-4, outputs=20)
    assert found.error.max() < 1e-6
    assert found.ours.position.max() < HELD


@pytest.mark.slow
def test_exudyn_has_no_plane_for_a_point_mass():
    pytest.importorskip("exudyn")
    with pytest.raises(ts.InvalidArgument, match="PlaneContact of a point mass has no counterpart"):
        ts.compare(planes(), with_="exudyn")


def test_scenes_that_an_engine_cannot_have():
    pytest.importorskip("mujoco")
    scene = pendulum()
    wheel = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(3, 0, 0), name="wheel")
    scene.add(C.Screw.at(scene.ground, wheel, point=(3, 0, 0), axis=(0, 0, 1), lead=0.1, name="spindle"))
    with pytest.raises(ts.InvalidArgument, match="MuJoCo can't have this scene:\n  spindle: Screw has no counterpart"):
        ts.compare(scene, with_="mujoco")
    scene = pendulum()
    wheel = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(3, 0, 0), name="wheel")
    axle = scene.add(C.Revolute.at(scene.ground, wheel, point=(3, 0, 0), axis=(0, 0, 1), name="axle"))
    scene.add(C.Coupler(axle, scene["hinge"], polynomial=(0, 1, 0.1), name="cam"))
    with pytest.raises(ts.InvalidArgument, match=r"scene:\n  cam: Coupler has no counterpart$"):
        ts.compare(scene, with_="mujoco")
    scene = pendulum()
    scene.add(C.RotationMotor.of(scene["hinge"], angle=lambda t: 0.1 * t, name="drive"))
    with pytest.raises(ts.InvalidArgument, match="drive"):
        ts.compare(scene, with_="mujoco")
    scene = pendulum()
    stone = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(0, 0, 2), name="stone")
    scene.add(C.PlaneContact(stone, scene.ground, normal_b=(0, 0, 1), unilateral=True, name="floor"))
    with pytest.raises(ts.InvalidArgument, match="floor: it opens and closes"):
        ts.compare(scene, with_="mujoco")
    scene = pendulum()
    scene.deactivate("hinge")
    with pytest.raises(ts.InvalidArgument, match="hinge: it is switched off"):
        ts.compare(scene, with_="mujoco")


def test_wrong_arguments(monkeypatch):
    with pytest.raises(ts.InvalidArgument, match="did you mean mujoco"):
        ts.compare(pendulum(), with_="mojoco")
    with pytest.raises(ts.InvalidArgument, match="step"):
        ts.compare(pendulum(), with_="mujoco", step=-1)
    with pytest.raises(ts.InvalidArgument, match="t_span"):
        ts.compare(pendulum(), (1, 0), with_="mujoco")
    with pytest.raises(ts.InvalidBody, match="no bodies"):
        ts.compare(ts.Scene(), (0, 1), with_="mujoco")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ts.MissingDependency, match="pip install mujoco"):
        ts.compare(pendulum(), with_="mujoco")


def test_unknown_methods_and_options():
    pytest.importorskip("mujoco")
    with pytest.raises(ts.InvalidArgument, match="did you mean euler"):
        ts.compare(pendulum(), with_="mujoco", method="eulr")
    with pytest.raises(ts.InvalidArgument, match="no option 'solreff'"):
        ts.compare(pendulum(), with_="mujoco", options={"solreff": (0.01, 1)})
    for wrong in ("x", (), (0.01, float("nan")), (1, 2, 3)):
        with pytest.raises(ts.InvalidArgument, match="solref of MuJoCo must be a list of up to 2 numbers"):
            ts.compare(four_bar(), with_="mujoco", options={"solref": wrong})


def test_softness_of_loops():
    """Stiffer equality constraints, smaller violation."""
    pytest.importorskip("mujoco")
    found = [
        ts.compare(four_bar(), (0.0, 0.2), with_="mujoco", options={"solref": (tau, 1.0)}, outputs=20)
        for tau in (0.05, 0.005)
    ]
    assert found[1].theirs.position.max() < 0.1 * found[0].theirs.position.max()


@pytest.mark.slow
def test_exudyn_says_why_it_gives_up():
    pytest.importorskip("exudyn")
    with pytest.raises(ts.StepFailure, match=r"gave up with RK44 and the step 0.1 s: .*another method"):
        ts.compare(pendulum(), (0, 1), with_="exudyn", step=0.1, method="RK44")
