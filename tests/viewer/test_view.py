"""The page of an animation: its poses and loads are those of the run, and it needs nothing from outside."""

import base64
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
from tsdyn.viewer.run_data import FRAMES, HOLDS_BACK, PUSHES

C, S = ts.constraints, ts.shapes
ROOT = Path(__file__).parents[2]
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
    from tsdyn.viewer.run_data import resample

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
    from tsdyn.viewer.run_data import run_data
    from tsdyn.viewer.view import page_of

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
    with pytest.raises(ts.InvalidBody, match="not a body of this solution"):
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
        with pytest.raises(ts.InvalidArgument, match=r"must end in \.html, got"):
            run.view(tmp_path / name)
    with pytest.raises(ts.InvalidCall, match="did you mean shapes"):
        run.view(shape={})
    assert not list(tmp_path.iterdir())


def test_a_run_loads_nothing_that_draws():
    code = "import sys; from examples import top; top.ts.simulate(top.build(), (0.0, 0.1)); print(*sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    modules = result.stdout.split()
    assert "tsdyn.simulation.simulate" in modules
    assert not [
        name for name in modules if name.startswith(("tsdyn.viewer", "tsdyn.figures", "matplotlib", "webbrowser"))
    ]


@pytest.mark.parametrize("display", [True, False])
def test_without_a_path_the_browser_opens(run, display, monkeypatch, capsys):
    from tsdyn.viewer import view as module

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
