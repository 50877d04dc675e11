"""Scenes go to a file and back to the same bits."""

import importlib
import pkgutil
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PchipInterpolator

import examples
import tsdyn as ts
from examples import driven_pivot, parallel_runs, top
from tests.helpers import closed_loops, driven, hanging_chains, locked_scenes
from tests.helpers.built_in import FORCES, JOINTS, PRIMITIVES, by_name
from tests.helpers.plug_ins import Rod
from tests.helpers.scene_marks import outcome, there_and_back
from tests.helpers.sketched_mechanisms import MECHANISMS
from tests.helpers.tolerances import ROUNDING
from tsdyn.files import types
from tsdyn.files.scene_text import marks
from tsdyn.simulation.load import scene_file
from tsdyn.stress.gallery import CASES
from tsdyn.stress.random_scenes import generate

ROOT = Path(__file__).parents[2]
MODULES = [importlib.import_module(f"examples.{module.name}") for module in pkgutil.iter_modules(examples.__path__)]
FUNCTIONS = {"drive_train": "torque", "active_suspension": "force"}  # of users: what is a function in build()
SCENES = {module.__name__.partition(".")[2]: module.build for module in MODULES if hasattr(module, "build")}
SCENES = {name: build for name, build in SCENES.items() if name not in FUNCTIONS}
GALLERY = {case.name: case.build for case in CASES if "500" not in case.name}
SCENES |= {"driven_pivot": driven_pivot.build_driven, "sleeping top": top.build_sleeping} | GALLERY
SCENES["parallel_runs"] = lambda: parallel_runs.build(3.0)
OF_TESTS = {name: (lambda make=make: make(np.random.default_rng(5)).scene) for name, make in MECHANISMS.items()}
OF_TESTS |= {name: locked_scenes.SCENES[name][0] for name in locked_scenes.SCENES}
OF_TESTS |= {
    "loop": lambda: closed_loops.four_bar(planar=True), "ring": lambda: closed_loops.ring(12),
    "pendulums": lambda: hanging_chains.pendulums([0.4, 0.3, 0.2]), "everything driven": driven.everything,
}  # fmt: skip
PULSE = 0.1 * np.exp(-ts.motions.time) * np.sin(3.0 * ts.motions.time) ** 2
MOTIONS = {
    "constant": ts.motions.Constant(0.4),
    "polynomial": ts.motions.Polynomial((0.4, -0.1, 0.02)),
    "sine": ts.motions.Sine(amplitude=0.1, frequency=7.0, phase=0.3, offset=-0.2),
    "exponential": ts.motions.Exponential(amplitude=-0.1, rate=-0.5, offset=0.3),
    "product": PULSE,
    "shared": PULSE * PULSE / (1.0 + PULSE) - np.sinh(PULSE),
    "root": np.sqrt(1.0 + ts.motions.time**2) - np.cosh(ts.motions.time) ** -1.5,
    "deep": sum((np.cos(PULSE + 0.01 * i) for i in range(60)), 0.1),
    "table": ts.Table((0.0, 1.0, 2.0, 3.5), (0.1, 0.3, 0.4, 0.2)),
    "arrays": (np.arange(4.0), np.array([0.1, 0.2, 0.2, 0.5])),
    "spline": CubicSpline((0.0, 1.0, 2.0, 3.0), (0.1, 0.4, 0.2, 0.1), bc_type="periodic"),
    "spline, extrapolated": PchipInterpolator((0.0, 1.0, 2.0), (0.1, 0.4, 0.2)),
    "spline and sine": 2.0 * ts.motions.Piecewise(ts.Table((0, 1, 2), (0.1, 0.2, 0.4))) + np.sin(ts.motions.time),
}


@pytest.mark.slow_for(*GALLERY)
@pytest.mark.parametrize("name", SCENES)
def test_scenes_of_examples_and_gallery(name, tmp_path):
    there_and_back(SCENES[name](), tmp_path / "scene.toml")


@pytest.mark.slow_for(*GALLERY)
@pytest.mark.parametrize("name", SCENES)
def test_a_number_that_nothing_uses_changes_nothing(name, tmp_path):
    """Of the table parameters: all else is as the file says, joints of forces and what has been set included."""
    path = SCENES[name]().save(tmp_path / "scene.toml")
    with open(path, "a") as file:
        file.write("\n[parameters]\nspare = 1.0\n")
    scene = ts.load(path)
    other = scene.with_parameters({"spare": 2.0})
    assert (scene.parameters()["spare"], other.parameters()["spare"]) == (1.0, 2.0)
    assert marks(other) == marks(scene)
    assert "spare = 2.0" in other.save(tmp_path / "other.toml").read_text()
    scene.gravity = (0.0, 0.1, 0.2)
    scene.bodies[0].mass = 1.25
    other = scene.with_parameters({"spare": 3.0})
    assert marks(other) == marks(scene)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_examples_with_functions_are_refused(name, tmp_path):
    build = importlib.import_module(f"examples.{name}").build
    with pytest.raises(ts.InvalidArgument, match=rf"{FUNCTIONS[name]} is the function"):
        build().save(tmp_path / "scene.toml")


@pytest.mark.parametrize("name", OF_TESTS)
def test_scenes_of_tests(name, tmp_path):
    there_and_back(OF_TESTS[name](), tmp_path / "scene.toml")


@pytest.mark.parametrize("name", ["four_bar", "screw_press", "top"])
def test_runs_have_the_same_bits(name, tmp_path):
    scene = SCENES[name]()
    assert outcome(there_and_back(scene, tmp_path / "scene.toml")) == outcome(scene)


@pytest.mark.parametrize("kind", [*PRIMITIVES, *JOINTS, *FORCES], **by_name)
def test_every_built_in_class(kind, tmp_path):
    if kind.__name__ == "EulerNormalization":
        pytest.skip("every body has one by itself")
    scene, rng = ts.Scene(), np.random.default_rng(3)
    places = [rng.normal(size=(2, 3)), rng.normal(size=(2, 3)), [rng.normal(size=4) for _ in range(2)]]
    a, b = (
        scene.add_body(1.0 + i, (1, 1.1, 1.2), places[0][i], places[2][i] / np.linalg.norm(places[2][i]), places[1][i])
        for i in range(2)
    )
    scene.add(kind.example(rng, a, b))
    if any(argument.kind == types.FUNCTION for argument in types.of_class(kind).values()):
        with pytest.raises(ts.InvalidArgument, match="function"):
            scene.save(tmp_path / "scene.toml")
    else:
        there_and_back(scene, tmp_path / "scene.toml")


@pytest.mark.parametrize("seed", range(12))
def test_random_scenes(seed, tmp_path):
    there_and_back(generate(seed, least=2, most=6).scene, tmp_path / "scene.toml")


@pytest.mark.parametrize("name", MOTIONS)
def test_motions(name, tmp_path):
    scene = ts.Scene()
    crank = scene.add_body(1.0, (1, 1, 1), orientation=(0.8, 0, 0, 0.6), name="crank")
    scene.add(ts.constraints.Revolute.at(scene.ground, crank, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    motor = scene.add(ts.constraints.RotationMotor.of(scene["hinge"], angle=MOTIONS[name], name="motor"))
    scene.add(ts.forces.Spring(crank, scene.ground, point_b=(1, 0, 0), actuator=MOTIONS[name], name="spring"))
    twin = there_and_back(scene, tmp_path / "scene.toml")
    t = np.linspace(0.0, 2.0, 23)
    np.testing.assert_array_equal(twin["motor"].angle.over(t), motor.angle.over(t))
    np.testing.assert_array_equal(twin["spring"].actuator.over(t), scene["spring"].actuator.over(t))


def test_loads_of_three_components(tmp_path):
    scene, t = ts.Scene(), ts.motions.time
    ball = scene.add_point_mass(1.0, position=(0, 0, 1), name="ball")
    scene.add(ts.forces.PointForce(ball, force=(0.0, np.sin(t), 1.0), name="swing"))
    scene.add(ts.forces.PointForce(ball, force=ts.Table((0, 1, 2), np.arange(9.0).reshape(3, 3)), name="table"))
    for kind in ("linear", "previous", "pchip"):
        table = ts.Table((0, 1, 1, 2), (0.1, 0.2, 0.4, 0.7), kind=kind)
        scene.add(ts.forces.PointForce(ball, force=(0, table, 0), name=f"{kind} component"))
        vectors = ts.Table((0, 1, 1, 2), np.outer(table.values, (1, 2, 3)), kind=kind)
        scene.add(ts.forces.PointForce(ball, force=vectors, name=kind))
    scene.add(ts.forces.PointForce(ball, force=CubicSpline((0, 1, 2), np.eye(3)), name="spline"))
    scene.add(ts.constraints.PointDriver("ground", ball, path=(0.0, 0.1 * np.sin(t), 1.0), name="lead"))
    assert outcome(there_and_back(scene, tmp_path / "scene.toml")) == outcome(scene)


def test_edits_remain(tmp_path):
    scene = ts.Scene()
    arm = scene.add_body(2.0, (0.1, 0.2, 0.1), position=(0.5, 0, 0), name="arm")
    scene.add(ts.constraints.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    scene.add(ts.constraints.Revolute.at(scene.ground, arm, point=(0, 1, 0), axis=(0, 1, 0)))
    scene.add(ts.constraints.Revolute.at(scene.ground, arm, point=(0, 2, 0), axis=(0, 1, 0)))
    scene.set("hinge", angle=7.5, rate=0.3)
    scene.gravity = (0.0, -0.0, -3.0)
    twin = there_and_back(scene, tmp_path / "scene.toml")
    runs = [ts.simulate(each, (0.0, 0.02)) for each in (scene, twin)]
    np.testing.assert_array_equal(*(run.angle("hinge") for run in runs))
    assert runs[1].angle("hinge")[0] == pytest.approx(7.5)
    scene.remove(scene.constraints[1])
    there_and_back(scene, tmp_path / "scene.toml")
    there_and_back(scene.copy(), tmp_path / "scene.toml")


def test_the_example(tmp_path):
    scene, given = scene_file(ROOT / "examples" / "four_bar.toml")
    assert (given["t_span"], given["t_eval"].size) == ((0.0, 2.0), 201)
    assert scene.mobility().degrees_of_freedom == 0  # it is driven
    bodies = there_and_back(scene, tmp_path / "scene.toml").bodies
    assert bodies[0].angular_velocity[2] == pytest.approx(6.0 + 0.6 * np.pi)


def test_odd_names(tmp_path):
    scene = ts.Scene()
    for name in ('a "b"\\', "ü\t\n", "", "ground floor", "body1", "\x7f#'[]"):
        scene.add_body(1.0, (1, 1, 1), name=name)
    scene.add(ts.constraints.Spherical(scene.bodies[0], scene.bodies[1], name="=#\"'"))
    there_and_back(scene, tmp_path / "scene.toml")


def test_extreme_numbers(tmp_path):
    scene = ts.Scene(gravity=(5e-324, 1.7e308, -0.0))
    scene.add_body(
        1e-300, np.array([[2, 0.1, -0.0], [0.1, 3, 0.2], [-0.0, 0.2, 2.5]]), position=(1e16, 0.1 + 0.2, -0.0)
    )
    scene.add_body(1.0, (1, 1, 1), orientation=(1.0, -0.0, 0.0, -0.0), velocity=(0.0, -0.0, 0.0))
    there_and_back(scene, tmp_path / "scene.toml")


def test_plug_ins(tmp_path):
    scene = ts.Scene()
    bob = scene.add_point_mass(1.0, position=(1.5, 0, 0), name="bob")
    scene.add(Rod(bob, scene.ground, length=1.5, name="rod"))
    there_and_back(scene, tmp_path / "scene.toml")


def test_a_class_that_keeps_other_arguments_is_refused(tmp_path):
    class Odd(ts.Joint):
        markers = (ts.Point("a"), ts.Point("b"))

        def __init__(self, a, b, *, gap=0.0, **places):
            super().__init__(a, b, **places)
            self.width = 2.0 * gap

        def compose(self):
            yield "gap", ts.constraints.Distance(self.a, self.b, length=self.width)

    scene = ts.Scene()
    bob = scene.add_point_mass(1.0, position=(1.5, 0, 0), name="bob")
    scene.add(Odd(bob, scene.ground, gap=0.75, name="odd"))
    with pytest.raises(ts.InvalidArgument, match=r"odd.* as an attribute of the same name"):
        scene.save(tmp_path / "scene.toml")
    assert not list(tmp_path.iterdir())


def test_functions_are_refused_by_name(tmp_path):
    def pull(t, state):
        return (0.0, 0.0, t)

    scene = ts.Scene()
    bob = scene.add_point_mass(1.0, position=(1.5, 0, 0), name="bob")
    scene.add(ts.forces.PointForce(bob, force=pull, name="wind"))
    scene.add(ts.constraints.Distance(bob, scene.ground, length=lambda t: 1.5 + 0.0 * t, name="rod"))
    with pytest.raises(ts.InvalidArgument, match=r"rod: length is the function .*lambda.*wind: force is the .*pull"):
        scene.save(tmp_path / "scene.toml")


@pytest.mark.parametrize("path", ["scene.txt", "scene", 3, "missing/scene.toml"])
def test_impossible_places(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = ts.Scene()
    scene.add_point_mass(1.0)
    with pytest.raises((ts.InvalidArgument, ts.StorageError), match=r"\.toml"):
        scene.save(path)


def test_loads_in_body_axes(tmp_path):
    scene = ts.Scene()
    body = scene.add_body(mass=1.0, inertia=(1, 1, 1), name="body")
    scene.add(ts.forces.Torque(body, frame="body", torque=(1, 2, 3)))
    scene.add(ts.forces.PointForce(body, frame="body", force=(1, 2, 3), point_a=(0, 0, 1)))
    again = ts.load(scene.save(tmp_path / "scene.toml"))
    np.testing.assert_array_equal(ts.simulate(again, (0, 1)).q, ts.simulate(scene, (0, 1)).q)


def test_a_start_with_values_of_joints(tmp_path):
    """A pendulum at a third of a turn; a file names its joints as `scene.assemble` does."""
    path = tmp_path / "pendulum.toml"
    path.write_text(
        """
version = 1
[parameters]
start = 1.0471975511965976
[[body]]
name = "rod"
mass = 1
inertia = [0.1, 0.1, 0.1]
position = [0.5, 0, 0]
[[constraint]]
type = "Revolute"
name = "hinge"
a = "ground"
b = "rod"
at = { point = [0, 0, 0], axis = [0, 0, 1] }
[start]
assemble = true
joints = { hinge = "2 * start" }
"""
    )
    position = ts.load(path).bodies[0].position
    np.testing.assert_allclose(position, (-0.25, np.sqrt(3.0) / 4.0, 0.0), atol=ROUNDING)
