"""The page of an animation: its poses and loads are those of the run, and it needs nothing from outside."""

import base64
import re
import shutil
import subprocess
import sys
import webbrowser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from examples import door, four_bar
from tests.helpers.pages import Tags, array, decoded, place
from tsdyn.graphics.run_data import FLASH, FRAMES, HIT, HOLDS_BACK, OPEN, PUSHES, STICKS, run_data
from tsdyn.graphics.view import Painter

C, S = ts.constraints, ts.shapes
SEEN = 2e-4  # of a length or a unit vector: less than a pixel


@pytest.fixture(scope="module")
def run():
    return ts.simulate(four_bar.build(), (0.0, 2.0), dense_output=True)


@pytest.fixture(scope="module")
def page(run, tmp_path_factory):
    return run.view(tmp_path_factory.mktemp("pages") / "run.html").read_text(encoding="utf-8")


def chain(count):
    """Cylinders in a row, on hinges."""
    scene = ts.Scene()
    before = scene.ground
    for i in range(count):
        link = scene.add_body(**S.cylinder(0.02, 0.2, axis="x", density=1e3), position=(0.2 * i + 0.1, 0, 0))
        scene.add(C.Revolute.at(before, link, point=(0.2 * i, 0, 0), axis=(0, 1, 0)))
        before = link
    return scene


def test_a_page_is_whole_and_asks_for_nothing(page):
    tags = Tags(page)
    assert page.startswith("<!doctype html>")
    for tag in ("html", "head", "body", "script", "style", "select", "label", "button"):
        assert tags.opened.count(tag) == tags.closed.count(tag) > 0
    assert not tags.addresses
    assert "http://" not in page
    assert "https://" not in page
    assert "{{" not in page.split("<script>")[0]
    assert "MIT" in page  # the licence of three.js


def test_a_page_has_the_poses_of_the_run(run, page):
    data = decoded(page)
    assert data.frames == FRAMES
    assert [body["name"] for body in data.bodies] == [body.name for body in run.scene.bodies]
    states = run.at(data.t)
    for i, body in enumerate(run.scene.bodies):
        np.testing.assert_allclose(data.positions[:, i], states.position(body), atol=1e-6)
        np.testing.assert_allclose(np.roll(data.rotations[:, i], 1, axis=1), states.orientation(body), atol=SEEN)


def test_between_outputs_the_motion_is_a_quintic(run):
    """Without dense output, and close to it."""
    from tsdyn.graphics.run_data import resample

    plain = ts.simulate(run.scene, (0.0, 2.0))
    assert plain.t.size < 200
    found, exact = resample(plain, 500), resample(run, 500)
    np.testing.assert_allclose(found.position, exact.position, atol=SEEN)
    np.testing.assert_allclose(found.orientation, exact.orientation, atol=SEEN)


def test_arrows_are_the_reactions(run, page):
    data = decoded(page)
    assert {arrow["layer"] for arrow in data.arrows} == {"reactions"}
    for arrow, load in zip(data.arrows, data.loads, strict=True):
        values = run.reaction(arrow["name"])[("force", "torque").index(arrow["unit"])]
        scale = data.scales[arrow["unit"]]
        near = [np.abs(data.t - t).argmin() for t in run.t]
        np.testing.assert_allclose(scale * load[near], values, atol=0.03 * scale)
    assert data.scales["force"] == pytest.approx(max(np.abs(run.reaction(c)[0]).max() for c in joints(run)), rel=0.01)


def joints(run):
    return [constraint for constraint in run.scene.constraints if not getattr(constraint, "normalises", False)]


def test_reactions_that_are_not_unique_say_so():
    redundant = decoded(view(ts.simulate(door.build(), (0.0, 0.1))))
    assert not any(arrow["unique"] for arrow in redundant.arrows)
    assert all(arrow["unique"] for arrow in decoded(view(ts.simulate(chain(2), (0.0, 0.1)))).arrows)


def test_joints_are_drawn_where_their_points_meet():
    scene = ts.Scene()
    crank = scene.add_body(**S.box((0.4, 0.1, 0.1), mass=1.0), position=(0.2, 0, 0), name="crank")
    bob = scene.add_point_mass(mass=1.0, position=(0.4, 0, -1.0), name="bob")
    scene.add(C.Revolute.at(scene.ground, crank, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(C.Distance(crank, bob, point_a=(0.2, 0, 0)))
    scene.add(ts.forces.Spring(bob, scene.ground, point_b=(0, 0, -1.0), stiffness=30.0))
    data = decoded(view(ts.simulate(scene, (0.0, 1.0))))
    rod, coil = data.links
    assert (rod["kind"], coil["kind"]) == ("cylinder", "coil")
    for frame in (0, 400, data.frames - 1):
        a, b = (place(data, frame, rod[letter], rod[f"point_{letter}"]) for letter in "ab")
        assert np.linalg.norm(a - b) == pytest.approx(1.0, abs=SEEN)
    pin = next(part for part in data.parts if part["layer"] == "joints" and part["body"] == -1)
    axis = np.array(pin["matrix"][6:9])
    np.testing.assert_allclose(np.abs(axis) / np.linalg.norm(axis), (0, 1, 0), atol=SEEN)
    np.testing.assert_allclose(pin["matrix"][9:], (0, 0, 0), atol=SEEN)
    assert {arrow["layer"] for arrow in data.arrows} == {"reactions", "forces"}


def test_contacts_show_whether_the_plane_pushes():
    """A bead on a plane; a spring lifts it with k (1 - l0 / l) times its height, more than the weight at the ends."""
    scene = ts.Scene(gravity=(0, 0, -10))
    bead = scene.add_point_mass(mass=1.0, position=(2, 0, 0), name="bead")
    scene.add(C.PlaneContact(bead, scene.ground, normal_b=(0, 0, 1), name="plane"))
    scene.add(ts.forces.Spring(bead, scene.ground, point_b=(0, 0, 1), stiffness=20.0, free_length=0.6))
    data = decoded(view(ts.simulate(scene, (0.0, 3.0), dense_output=True)))
    lift = 20.0 * (1.0 - 0.6 / np.hypot(1.0, data.positions[:, 0, 0]))
    states, clear = np.frombuffer(base64.b64decode(data.contacts[0]), "u1"), np.abs(lift - 10.0) > 0.3
    np.testing.assert_array_equal(states[clear], np.where(lift < 10.0, PUSHES, HOLDS_BACK)[clear])
    assert {*states[clear]} == {PUSHES, HOLDS_BACK}
    assert [part["body"] for part in data.parts if "contact" in part] == [0]


def test_contacts_of_the_same_bodies_are_told_apart():
    scene = ts.Scene(gravity=(0, 0, -10))
    bead = scene.add_point_mass(mass=1.0, name="bead")
    for normal in ((0, 0, 1), (0, 1, 0)):
        scene.add(C.PlaneContact(bead, scene.ground, normal_b=normal))
    scene.add(ts.forces.PointForce(bead, force=(0, 5, 0)))
    data = decoded(view(ts.simulate(scene, (0.0, 0.1))))
    states = [{*base64.b64decode(each)} for each in data.contacts]
    assert states == [{PUSHES}, {HOLDS_BACK}]


def view(solution, **options):
    """The page of a solution, in a notebook."""
    from tsdyn.graphics.run_data import run_data
    from tsdyn.graphics.view import page_of

    return page_of(run_data(solution, **options))


@pytest.mark.parametrize(
    ("shape", "kind", "size"),
    [
        (S.box((1.0, 2.0, 3.0), mass=2.0), "box", (1.0, 2.0, 3.0)),
        (S.sphere(0.5, mass=3.0), "sphere", (0.5, 0.5, 0.5)),
        (S.cylinder(0.2, 1.5, axis="x", mass=3.0), "cylinder", (0.2, 0.2, 1.5)),
        (S.cylinder(0.9, 0.1, axis="y", mass=3.0), "cylinder", (0.9, 0.9, 0.1)),
    ],
    ids=["box", "ball", "shaft", "disc"],
)
def test_the_shape_of_a_free_body_follows_from_its_inertia(shape, kind, size):
    """It is the shape itself."""
    scene = ts.Scene()
    scene.add_body(**shape)
    (part,) = decoded(view(ts.simulate(scene, (0.0, 0.1)))).parts
    columns = np.reshape(part["matrix"], (4, 3))
    assert part["kind"] == kind
    np.testing.assert_allclose(np.sort(np.linalg.norm(columns[:3], axis=1)), np.sort(size), rtol=1e-4)
    if kind == "cylinder":
        assert abs(columns[2, 0 if size[0] < 0.5 else 1]) == pytest.approx(size[2], rel=1e-4)


@pytest.mark.parametrize(
    ("shape", "parts"),
    [
        (S.box((0.08, 0.06, 0.06), mass=1.0), [("box", (0.08, 0.06, 0.06))]),
        (S.box((0.06, 0.06, 0.06), mass=1.0), [("box", (0.06, 0.06, 0.06))]),
        (S.sphere(0.1, inner=0.09, mass=1.0), [("sphere", (0.1, 0.1, 0.1))]),
        (S.cylinder(0.1, 0.5, inner=0.09, mass=1.0), [("cylinder", (0.1, 0.1, 0.5))]),
        (S.capsule(0.1, 0.5, mass=1.0), [("cylinder", (0.1, 0.1, 0.5)), *[("sphere", (0.1, 0.1, 0.1))] * 2]),
    ],
    ids=["bar", "cube", "hollow ball", "tube", "capsule"],
)
def test_a_body_made_of_a_shape_has_that_shape(shape, parts):
    """Inertia doesn't tell a bar of square section from a cylinder, nor a cube from a ball."""
    scene = ts.Scene()
    body = scene.add_body(**shape, name="body")
    for each in (scene, scene.copy(), scene.with_parameters({"body.position": (1, 0, 0)})):
        found = decoded(view(ts.simulate(each, (0.0, 0.1)))).parts
        assert [part["kind"] for part in found] == [kind for kind, _ in parts]
        for part, (_, size) in zip(found, parts, strict=True):
            np.testing.assert_allclose(np.linalg.norm(np.reshape(part["matrix"], (4, 3))[:3], axis=1), size, rtol=1e-5)
    other = scene.with_parameters({"body.position": (1, 0, 0)})
    other["body"].shape = []
    assert decoded(view(ts.simulate(other, (0.0, 0.1)))).parts == []
    assert len(decoded(view(ts.simulate(scene, (0.0, 0.1)))).parts) == len(parts)
    body.name = "renamed"
    assert [*scene.shapes] == ["renamed"]
    body.shape = None
    assert scene.shapes == {}
    with pytest.raises(ts.InvalidArgument, match=r"renamed: shape must be one of ts\.shapes"):
        body.shape = "box"


def test_files_keep_shapes(tmp_path):
    """Scene files and saved solutions; meshes are left out, and a hidden body stays hidden."""
    pytest.importorskip("zarr")
    scene = ts.Scene(gravity=(0, 0, 0))
    hammer = S.cylinder(0.02, 0.3, axis="y", density=700) + S.box((0.1, 0.03, 0.03), density=7850).moved((0, 0.15, 0))
    scene.add_body(**hammer.rotated(Rotation.from_rotvec((0.1, 0.2, 0.3))), name="hammer")
    scene.add_body(mass=1.0, inertia=(1, 1, 1), shape=S.Capsule(0.1, 0.5, axis="x", colour="red"), name="leg")
    scene.add_body(mass=1.0, inertia=(1, 1, 1), shape=[], name="hidden")
    scene.add_point_mass(mass=1.0, name="bob").shape = S.Sphere(0.2)
    solution = ts.simulate(scene, (0.0, 0.1))
    pages = [decoded(view(solution))]
    for kept in (
        ts.simulate(ts.load(scene.save(tmp_path / "a.toml")), (0.0, 0.1)),
        ts.load(solution.save(tmp_path / "a.zarr")),
    ):
        pages.append(decoded(view(kept)))
    assert [part["kind"] for part in pages[0].parts] == ["cylinder", "box", "cylinder", "sphere", "sphere", "sphere"]
    assert pages[1].parts == pages[2].parts == pages[0].parts
    mesh = S.Mesh((((0, 0, 0), (1, 0, 0), (0, 1, 0)), ((0, 1, 2),)))
    scene["leg"].shape = mesh
    assert ts.load(scene.save(tmp_path / "a.toml"))["leg"].shape is None


def test_the_caps_of_a_capsule_are_at_its_ends():
    scene = ts.Scene()
    scene.add_body(mass=1.0, inertia=(1, 1, 1), shape=S.Capsule(0.1, 0.6, axis="y", position=(1, 0, 0)))
    _, *caps = decoded(view(ts.simulate(scene, (0.0, 0.1)))).parts
    np.testing.assert_allclose([cap["matrix"][9:] for cap in caps], [(1, -0.3, 0), (1, 0.3, 0)], atol=1e-6)


def test_an_arm_without_mass_is_drawn_as_a_rod():
    """From the centroid to a joint outside of the shape; a joint on its surface needs none."""
    scene = ts.Scene()
    bob = scene.add_body(**S.sphere(0.1, mass=1.0), position=(1, 0, 0))
    tail = scene.add_body(**S.box((0.1, 0.1, 0.1), mass=1.0), position=(1.05, 0, 0))
    scene.add(C.Revolute.at(scene.ground, bob, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(C.Fixed.at(bob, tail, point=(1.1, 0, 0)))
    parts = decoded(view(ts.simulate(scene, (0.0, 0.1)))).parts
    kinds = [[part["kind"] for part in parts if part["layer"] == "bodies" and part["body"] == i] for i in (0, 1)]
    assert kinds == [["sphere", "cylinder"], ["box"]]
    rod = next(part for part in parts if part["kind"] == "cylinder" and part["layer"] == "bodies")
    np.testing.assert_allclose(rod["matrix"][6:], (-1, 0, 0, -0.5, 0, 0), atol=1e-6)


def test_a_rod_in_any_direction_is_thin():
    turned = S.rod(2.0, axis="x", mass=3.0).rotated(Rotation.from_rotvec((0.3, 1.1, -0.7)))
    scene = ts.Scene(gravity=(0, 0, 0))
    rod = scene.add_body(**turned, angular_velocity=(0, 0, 0))
    scene.add(C.Fixed.at(scene.ground, rod, point=(0, 0, 0)))
    part = decoded(view(ts.simulate(scene, (0.0, 0.1)))).parts[0]
    lengths = np.linalg.norm(np.reshape(part["matrix"], (4, 3))[:3], axis=1)
    np.testing.assert_allclose(lengths, (0.04, 0.04, 2.0), rtol=1e-4)


def test_shapes_of_the_user_are_drawn():
    scene = ts.Scene()
    hammer = S.cylinder(0.02, 0.3, density=700) + S.box((0.1, 0.03, 0.03), density=7850).moved((0, 0, 0.15))
    tool = scene.add_body(**hammer, name="tool")
    vertices, faces = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)), ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    mesh = S.Mesh((vertices, faces), scale=2.0, position=(0, 0, -1), colour="#336699")
    data = decoded(view(ts.simulate(scene, (0.0, 0.1)), shapes={tool: hammer, "ground": [mesh, S.Sphere(0.1)]}))
    handle, head, stone, ball = data.parts
    assert [part["kind"] for part in data.parts] == ["cylinder", "box", "mesh0", "sphere"]
    assert (head["body"], stone["body"], ball["body"]) == (0, -1, -1)
    np.testing.assert_allclose(handle["matrix"][9:], -hammer.centroid, rtol=1e-4)
    np.testing.assert_allclose(head["matrix"][9:], (0, 0, 0.15) - hammer.centroid, rtol=1e-4)
    assert stone["colour"] == "#336699"
    np.testing.assert_allclose(array(data.meshes[0]["vertices"], "<f4").reshape(-1, 3), 2.0 * np.array(vertices))
    np.testing.assert_array_equal(array(data.meshes[0]["faces"], "<u4").reshape(-1, 3), faces)


def test_trails_are_of_bodies_and_of_points():
    solution = ts.simulate(chain(12), (0.0, 0.1))
    assert [trail["body"] for trail in decoded(view(solution)).trails] == [0, 1, 3, 4, 6, 7, 9, 11]
    found = decoded(view(solution, trails=["body2", (solution.scene.bodies[11], (0.1, 0, 0))])).trails
    assert found == [{"body": 1, "point": [0.0, 0.0, 0.0]}, {"body": 11, "point": [0.1, 0.0, 0.0]}]
    assert decoded(view(solution, trails=[])).trails == []


def test_fifty_bodies_fit_into_three_megabytes():
    solution = ts.simulate(chain(50), (0.0, 10.0), integrator=ts.integrators.Taylor(tol=1e-4), max_steps=30)
    text = view(solution)
    data = decoded(text)
    assert not solution.success
    assert solution.message in data.note
    assert data.frames >= 800
    assert len(text) < 3_000_000


@pytest.mark.parametrize("gravity", [(0, 0, -9.81), (0, -9.81, 0), (3, 0, 0), (0, 0, 0)])
def test_up_is_against_gravity(gravity):
    scene = ts.Scene(gravity=gravity)
    scene.add_point_mass(mass=1.0)
    data = decoded(view(ts.simulate(scene, (0.0, 0.1))))
    assert np.linalg.norm(data.up) == 1.0
    assert np.dot(data.up, gravity) == -np.linalg.norm(gravity)
    assert np.dot(data.view, data.up) > 0.0


def truck(speed):
    """A block that slides without friction."""
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(**S.box((3.0, 2.0, 6.0), mass=2.0), position=(0, 1, 0), velocity=(speed, 0, 0), name="truck")
    return ts.simulate(scene, (0.0, 10.0))


def test_a_page_is_fitted_to_the_mechanism_and_goes_with_it():
    """A block of half diagonal 3.5 m; where it moves by less than its size, the camera stays."""
    far, near = decoded(view(truck(10.0))), decoded(view(truck(0.2)))
    centres = array(far.centres, "<f4").reshape(-1, 3) + far.origin
    np.testing.assert_allclose(centres, np.stack([10.0 * far.t, 0 * far.t + 1, 0 * far.t], axis=1), atol=1e-4)
    assert (far.radius, far.follow) == (pytest.approx(1.1 * 3.5), -2)
    assert (near.radius, near.follow) == (pytest.approx(1.1 * (3.5 + 1.0)), -1)
    np.testing.assert_allclose(array(near.centres, "<f4") + near.origin, (1, 1, 0), atol=1e-6)


def test_a_swing_is_fitted_to_what_it_hangs_from():
    scene = ts.Scene()
    bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0))
    box = scene.add_body(**S.box((0.02, 0.02, 0.02), mass=1.0), position=(0, 1, 0))
    for body in (bob, box):
        scene.add(C.Distance(body, scene.ground))
    assert decoded(view(ts.simulate(scene, (0.0, 3.0)))).follow == -1


def test_camera_and_followed_body_are_chosen(run, tmp_path):
    data = decoded(view(run, camera=(1, -2, 0.5), follow="coupler"))
    assert (data.view, data.eye, data.follow) == ([1, -2, 0.5], None, 1)
    data = decoded(view(run, camera=[(1, 2, 3), (0, 0, 1)], follow=run.scene.bodies[2]))
    assert (data.view, data.eye, data.follow) == ([1, 2, 2], [[1, 2, 3], [0, 0, 1]], 2)
    for wrong in ((0, 0, 0), (1, 2), "top", [(1, 2, 3), (1, 2, 3)], (np.nan, 0, 1)):
        with pytest.raises(ts.InvalidArgument, match=r"camera must be a direction \(3,\)"):
            run.view(tmp_path / "a", camera=wrong)
    with pytest.raises(ts.InvalidBody, match="did you mean 'coupler'"):
        run.view(tmp_path / "a", follow="coupla")


def test_names_are_on_the_page(run, page):
    labels = decoded(page).labels
    assert [label["text"] for label in labels if label["layer"] == "bodies"] == [body.name for body in run.scene.bodies]
    named = {label["text"]: label for label in labels if label["layer"] == "joints"}
    assert named.keys() == {joint.name for joint in joints(run)}
    data = decoded(page)
    for joint in joints(run):
        label = named[joint.name]
        index = [*run.scene.bodies, run.scene.ground].index(joint.a) % 4
        at = place(data, 0, index if index < 3 else -1, joint.point_a)
        np.testing.assert_allclose(place(data, 0, label["body"], label["point"]), at, atol=SEEN)


def sketch():
    """Two rods, the second 0.3 m too high, and turned about x by an angle of sine 0.6."""
    scene = ts.Scene()
    rod, turn = S.rod(1.0, axis="x", mass=1.0), Rotation.from_rotvec((np.arcsin(0.6), 0, 0))
    upper = scene.add_body(**rod, position=(0.5, 0, 0), name="upper")
    lower = scene.add_body(**rod, position=(1.5, 0, 0.3), orientation=turn, name="lower")
    axes = {"axis_a": (0, 1, 0), "axis_b": (0, 1, 0)}
    scene.add(C.Revolute(scene.ground, upper, point_b=(-0.5, 0, 0), **axes, name="shoulder"))
    scene.add(C.Revolute(upper, lower, point_a=(0.5, 0, 0), point_b=(-0.5, 0, 0), **axes, name="elbow"))
    return scene


def test_a_scene_that_is_not_assembled_is_shown(tmp_path):
    scene = sketch()
    data = decoded(scene.view(tmp_path / "sketch").read_text(encoding="utf-8"))
    assert (data.frames, data.time, data.arrows, data.trails) == (1, [0.0, 0.0], [], [])
    assert "2 constraint rows are violated" in data.note
    (label,) = [label for label in data.labels if label["violated"]]
    assert label["text"].startswith("Revolute 'elbow' point[2]: Phi = -0.3\nRevolute 'elbow' axis[")
    assert label["text"].endswith("0.6")
    red = [part for part in (*data.parts, *data.links) if part["colour"] == "#d33a2c"]
    assert {part["body"] for part in red if "body" in part} == {0, 1}
    (gap,) = [part for part in red if "body" not in part]
    ends = [place(data, 0, gap[letter], gap[f"point_{letter}"]) for letter in "ab"]
    np.testing.assert_allclose(ends, [(1, 0, 0), (1, 0, 0.3)], atol=1e-6)
    scene.assemble()
    data = decoded(scene.view(tmp_path / "sketch").read_text(encoding="utf-8"))
    assert not data.note
    assert not any(label["violated"] for label in data.labels)
    assert not [part for part in (*data.parts, *data.links) if part["colour"] == "#d33a2c"]


def test_violated_velocities_and_motions_are_named(tmp_path):
    """A hinge that is torn apart at 2 m/s, and a rod whose length is 1 + t^2."""
    scene = ts.Scene()
    bar = scene.add_body(**S.box((1.0, 0.1, 0.1), mass=1.0), position=(0.5, 0, 0), velocity=(0, 0, 2))
    scene.add(C.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    bob = scene.add_point_mass(mass=1.0, position=(0, 1, 0))
    scene.add(C.Distance(bob, scene.ground, length=1 + ts.motions.time**2, name="rod"))
    labels = decoded(scene.view(tmp_path / "a").read_text(encoding="utf-8")).labels
    assert [label["text"] for label in labels if label["violated"]] == ["Revolute 'hinge' point[2]: dPhi/dt = -2"]
    labels = decoded(scene.view(tmp_path / "a", t=2.0).read_text(encoding="utf-8")).labels
    (rod,) = [label["text"] for label in labels if "rod" in label["text"]]
    assert rod == "rod: Phi = -12"  # (d.d - L^2) / (2 L_0), of d = L_0 = 1 m and L = 5 m


def test_a_start_on_another_branch_is_told(tmp_path):
    """All rows hold half a turn away from a motor's angle, and where the axes of a hinge are opposed."""
    scene = ts.Scene()
    wheel = scene.add_body(**S.cylinder(0.1, 0.1, mass=1.0), name="wheel")
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    motor = scene.add(C.RotationMotor.of(hinge, angle=np.pi, name="motor"))
    note = decoded(scene.view(tmp_path / "a").read_text(encoding="utf-8")).note
    assert "motor" in note
    assert "3.14159265" in note
    scene.remove(motor)
    wheel.orientation = (0, 1, 0, 0)
    page = decoded(scene.view(tmp_path / "a").read_text(encoding="utf-8"))
    assert "hinge" in page.note
    assert not any(label["violated"] for label in page.labels)
    with pytest.raises(ts.InconsistentState):
        ts.simulate(scene, (0.0, 1.0))


def test_scenes_that_cannot_be_shown_are_refused(tmp_path):
    with pytest.raises(ts.InvalidBody, match="no bodies"):
        ts.Scene().view(tmp_path / "a")
    with pytest.raises(ts.InvalidArgument, match="t \\(s\\)"):
        sketch().view(tmp_path / "a", t=np.nan)
    with pytest.raises(ts.InvalidCall, match="follow"):
        sketch().view(tmp_path / "a", folow="upper")
    assert not list(tmp_path.iterdir())


def test_a_gif_has_the_frames_of_the_run(tmp_path):
    """A red ball that moves by 20 of its radii to the right, over a time of 2 s, seen from the front."""
    image = pytest.importorskip("PIL.Image")
    scene = ts.Scene(gravity=(0, 0, 0))
    shape = S.Sphere(0.1, colour="red")
    scene.add_body(mass=1.0, inertia=(1, 1, 1), shape=shape, velocity=(1.0, 0, 0), name="ball")
    scene.add_body(mass=1.0, inertia=(1, 1, 1), shape=S.Box((2, 0.1, 0.1)), position=(1, 0, -1))
    path = ts.simulate(scene, (0.0, 2.0)).view(tmp_path / "ball.gif", camera=(0, -1, 0))
    with image.open(path) as gif:
        assert (gif.n_frames, gif.info["duration"]) == (41, 50)
        middles = []
        for k in (0, 20, 40):
            gif.seek(k)
            rgb = np.asarray(gif.convert("RGB")).astype(int)
            red = (rgb[..., 0] > 100) & (rgb[..., 1:].max(axis=-1) < 60)
            rows, columns = np.nonzero(red)
            middles.append((columns.mean(), rows.mean()))
            wide = np.ptp(columns) + 1
    middles = np.array(middles)
    np.testing.assert_allclose(np.diff(middles[:, 0]), 5.0 * wide, rtol=0.05)  # 1 m, of a diameter of 0.2 m
    np.testing.assert_allclose(middles[:, 1], middles[0, 1], atol=1.0)


def test_a_gif_of_a_scene_is_one_picture(tmp_path):
    image = pytest.importorskip("PIL.Image")
    for camera in (None, (0, 0, 1)):
        with image.open(sketch().view(tmp_path / "sketch.gif", camera=camera)) as gif:
            assert (gif.n_frames, gif.size) == (1, (640, 480))


def test_violated_rows_at_one_place_are_lines_of_their_own_in_a_gif(tmp_path):
    image = pytest.importorskip("PIL.Image")
    scene = ts.Scene()
    for name in ("one", "two"):
        bob = scene.add_point_mass(mass=1.0, position=(1.2, 0, 0), name=name)
        scene.add(C.Distance(bob, scene.ground, length=1.0, name=f"rod {name}"))
    with image.open(scene.view(tmp_path / "rods.gif")) as gif:
        rgb = np.asarray(gif.convert("RGB")).astype(int)[-60:]
    red = ((rgb[..., 0] > 180) & (rgb[..., 1:].max(axis=-1) < 120)).any(axis=1)
    assert np.count_nonzero(np.diff(red.astype(int)) == 1) == 2


def test_a_gif_needs_matplotlib(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ts.MissingDependency, match=r"the GIF needs matplotlib: pip install 'tsdyn\[plot\]'"):
        run.view(tmp_path / "a.gif")
    assert not list(tmp_path.iterdir())


def test_the_scripts_of_the_page_can_be_read(page, tmp_path):
    node = shutil.which("node")
    if node is None:
        pytest.skip("no engine of JavaScript here")
    *_, scripts = re.findall("<script>(.*?)</script>", page, re.DOTALL)
    (tmp_path / "page.js").write_text(scripts, encoding="utf-8")
    subprocess.run([node, "--check", tmp_path / "page.js"], check=True)


def test_a_run_of_one_output_is_a_picture():
    solution = ts.simulate(chain(2), (0.0, 1.0))
    assert decoded(view(solution[:1])).frames == 1
    with pytest.raises(ts.InvalidArgument, match="no outputs"):
        view(solution[:0])


def test_names_cannot_break_the_page():
    scene = ts.Scene()
    scene.add_point_mass(mass=1.0, name="</script><b>{{three}}")
    text = view(ts.simulate(scene, (0.0, 0.1)))
    assert decoded(text).bodies[0]["name"] == "</script><b>{{three}}"
    assert Tags(text).opened.count("script") == 3


def test_a_stored_run_is_shown(tmp_path):
    pytest.importorskip("h5py")
    solution = ts.simulate(chain(2), (0.0, 1.0), store=tmp_path / "run.h5")
    data = decoded(view(solution))
    np.testing.assert_allclose(data.positions[-1], solution.q[-1].reshape(2, 7)[:, :3], atol=1e-6)


def test_wrong_shapes_and_paths_are_refused(run, tmp_path):
    with pytest.raises(ts.InvalidBody, match=r"no body is named 'crnk'; did you mean 'crank'"):
        run.view(tmp_path / "a", shapes={"crnk": S.Sphere(1.0)})
    with pytest.raises(ts.InvalidBody, match="not a body of this scene"):
        run.view(tmp_path / "a", shapes={ts.Scene().add_point_mass(mass=1.0): S.Sphere(1.0)})
    with pytest.raises(ts.InvalidArgument, match=r"ts\.shapes"):
        run.view(tmp_path / "a", shapes={"crank": "box"})
    with pytest.raises(ts.InvalidArgument, match="dictionary"):
        run.view(tmp_path / "a", shapes=S.Sphere(1.0))
    with pytest.raises(ts.InvalidBody, match="did you mean 'crank'"):
        run.view(tmp_path / "a", trails=["crnk"])
    with pytest.raises(ts.InvalidArgument, match="trail of 'crank': point"):
        run.view(tmp_path / "a", trails=[("crank", (1, 2))])
    with pytest.raises(ts.InvalidArgument, match="trails"):
        run.view(tmp_path / "a", trails=7)
    with pytest.raises(ts.InvalidArgument, match="can't be written"):
        run.view(tmp_path / "nowhere" / "a.html")
    for name in ("a.png", "a.html.gz"):
        with pytest.raises(ts.InvalidArgument, match=r"must end in \.html or \.gif, got"):
            run.view(tmp_path / name)
    with pytest.raises(ts.InvalidCall, match="did you mean shapes"):
        run.view(shape={})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("display", [True, False])
def test_without_a_path_the_browser_opens(run, display, monkeypatch, capsys):
    from tsdyn.graphics import view as module

    opened = []
    monkeypatch.setattr(module, "has_display", lambda: display)
    monkeypatch.setattr(webbrowser, "open", lambda address: opened.append(address) or True)
    path = run.view()
    assert path.read_text(encoding="utf-8").startswith("<!doctype html>")
    assert opened == ([path.as_uri()] if display else [])
    assert (str(path) in capsys.readouterr().out) == (not display)
    Path(path).unlink()


def test_a_notebook_shows_the_page_inline(run, page, monkeypatch, tmp_path):
    shell = SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    shown = run.view()
    inline = shown._repr_html_()
    assert inline.startswith("<iframe srcdoc=")
    assert Tags(inline).opened == ["iframe"]
    assert shown.html == page
    assert shown.save(tmp_path / "run").read_text(encoding="utf-8") == page
    assert "MB" in repr(shown)


def rolling_scene():
    scene = ts.Scene()
    coin = scene.add_body(1.0, (0.08, 0.15, 0.08), position=(0, 0, 0.5), velocity=(1, 0, 0), name="coin")
    coin.angular_velocity = (0, 2, 0)
    places = {"axis_a": (0, 1, 0), "normal_b": (0, 0, 1)}
    scene.add(ts.constraints.RollingDisc(coin, scene.ground, radius=0.5, name="on", **places))
    return scene


def test_contact_points_and_their_paths():
    """A point after the bodies, where the surfaces touch, with a trail, a mark, and the arrow of the reaction."""
    scene = rolling_scene()
    data = run_data(ts.simulate(scene, (0, 1)))
    assert [body["name"] for body in data["bodies"]] == ["coin", "contact of on"]
    painter = Painter(data)
    np.testing.assert_allclose(painter.position[-1, 1], (1, 0, 0), atol=1e-6)
    assert {trail["body"] for trail in data["trails"]} == {0, 1}
    assert [part["kind"] for part in data["parts"] if part["body"] == 1] == ["sphere"]
    assert {arrow["body"] for arrow in data["arrows"] if arrow["name"] == "on"} == {1}


def test_contacts_that_open_and_close():
    """A ball of 0.1 m falls by G / 2 m in 1 s, rebounds with half its rate for 1 s, and rests from 3 s."""
    scene = ts.Scene(gravity=(0, 0, -10))
    ball = scene.add_point_mass(mass=1.0, position=(0, 0, 5.1), name="ball")
    floor = {"radius_a": 0.1, "normal_b": (0, 0, 1), "restitution": 0.5, "name": "floor"}
    scene.add(C.SphereContact(ball, scene.ground, **floor))
    data = decoded(view(ts.simulate(scene, (0.0, 5.0), dense_output=True)))
    t = np.linspace(0.0, 5.0, data.frames)
    states = np.frombuffer(base64.b64decode(data.contacts[0]), "u1")
    hit = (t >= 1.0) & (t < 1.0 + FLASH * 5.0)
    away = np.abs(t[:, None] - [1.0, 1.0 + FLASH * 5.0, 2.0, 3.0 + FLASH * 5.0]).min(axis=1) > 0.01
    first = away & (t < 2.0)
    np.testing.assert_array_equal(states[first], np.where(hit, HIT, OPEN)[first])
    assert {*states[t > 3.2]} == {PUSHES}
    words = np.array(data.said["words"])[np.frombuffer(base64.b64decode(data.said["of"]), "<u2")]
    assert ({*words[t < 2.9]}, {*words[t > 3.1]}) == ({""}, {"closed: floor"})
    surface, mark = [part for part in data.parts if part["kind"] == "sphere"][-2:]
    np.testing.assert_allclose(np.diag(np.reshape(surface["matrix"][:9], (3, 3))), 0.1)
    assert (surface["body"], mark["body"], mark["contact"]) == (0, 1, 0)
    np.testing.assert_allclose(data.positions[:, 1], data.positions[:, 0] - [0, 0, 0.1], atol=SEEN)


@pytest.mark.parametrize("every_step", [True, False])
def test_a_contact_that_sticks_has_a_colour_of_its_own(every_step):
    """A block slides to rest: its friction of 2 N/kg takes 1 m/s in 0.5 s."""
    scene = ts.Scene(gravity=(0, 0, -10))
    block = scene.add_point_mass(mass=1.0, velocity=(1, 0, 0))
    scene.add(C.PlaneContact(block, scene.ground, normal_b=(0, 0, 1), unilateral=True, kinetic=0.2, name="lane"))
    times = None if every_step else np.linspace(0, 1, 101)
    data = decoded(view(ts.simulate(scene, (0.0, 1.0), t_eval=times)))
    t = np.linspace(0.0, 1.0, data.frames)
    states = np.frombuffer(base64.b64decode(data.contacts[0]), "u1")
    assert ({*states[t < 0.49]}, {*states[t > 0.51]}) == ({PUSHES}, {STICKS})


def test_rolling_surfaces_are_drawn_with_marks():
    """To scale, in place of the solid of the body's inertia, and a mark that turns with the body."""
    kinds = ts.constraints.RollingDisc, ts.constraints.RollingBall
    for kind, shape, own in zip(kinds, ("cylinder", "sphere"), ({"axis_a": (0, 1, 0)}, {}), strict=True):
        scene = ts.Scene()
        body = scene.add_body(1.0, (1, 1, 1), position=(0, 0, 0.3))
        scene.add(kind(body, scene.ground, radius=0.3, normal_b=(0, 0, 1), **own))
        surface, *marks = [part for part in run_data(ts.simulate(scene, (0, 1)))["parts"] if part["body"] == 0]
        assert surface["kind"] == shape
        assert surface["layer"] == "bodies"
        np.testing.assert_allclose(np.linalg.norm(np.reshape(surface["matrix"][:9], (3, 3)), axis=1)[:2], 0.3)
        assert marks
        assert {mark["colour"] for mark in marks} != {surface["colour"]}


def test_cylinders_and_ellipsoids_are_drawn(tmp_path):
    scene = ts.Scene()
    for i, inside in enumerate((False, True)):
        body = scene.add_body(1.0, (1, 1, 1), position=(0, 0, 0.3))
        places = {"axis_b": (1, 0, 0), "point_b": (0, 0, 0.8 if inside else -0.7), "radius": 0.3}
        cylinder = ts.constraints.RollingBallOnCylinder(
            body, scene.ground, cylinder_radius=0.8 if inside else 0.7, inside=inside, name=f"{i}", **places
        )
        scene.add(cylinder)
    egg = scene.add_body(1.0, (1, 1, 1), position=(2, 0, 0.2))
    scene.add(ts.constraints.RollingEllipsoid(egg, scene.ground, semi_axes=(0.4, 0.3, 0.2), normal_b=(0, 0, 1)))
    page = scene.view(tmp_path / "scene.html")
    assert page.exists()
