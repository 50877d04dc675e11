"""Channels: values against closed forms, in tables, figures, files, ensembles and on the command line."""

import csv
import json
from functools import cache

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.commands import called
from tests.helpers.tolerances import FAIR, HELD, ROUNDING

pytest.importorskip("matplotlib")
pandas = pytest.importorskip("pandas")
from matplotlib import pyplot  # noqa: E402

G, LENGTH, MASS, RATE = 10.0, 1.5, 3.0, 4.0  # m/s^2, m, kg, rad/s


@pytest.fixture(autouse=True)
def no_windows():
    pyplot.switch_backend("agg")
    yield
    pyplot.close("all")


def bar_and_bob():
    """A bar that falls from the horizontal about a hinge, a bob on a rod beside it, and what pulls at the bar."""
    scene = ts.Scene(gravity=(0, 0, -G))
    bar = scene.add_body(**ts.shapes.rod(LENGTH, axis="x", mass=MASS), position=(LENGTH / 2, 0, 0), name="bar")
    scene.add(ts.constraints.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    bob = scene.add_point_mass(MASS, position=(0, 5, 0), name="bob.1")
    scene.add(ts.constraints.Distance(bob, scene.ground, point_b=(LENGTH, 5, 0), name="rod"))
    return scene


@cache
def fall():
    return ts.simulate(bar_and_bob(), (0.0, 1.0), rtol=1e-11, atol=1e-11, dense_output=True)


def test_channels_of_a_falling_bar_and_of_a_bob():
    """Energy gives rate^2 = 3 g sin(angle) / L, and the reaction of the hinge along the bar 5/2 m g sin(angle)."""
    frame = fall().to_dataframe(["hinge", "bar.position", "rod.tension", "bob.1.position.z"])
    assert frame.index.name == "time (s)"
    assert list(frame)[:3] == ["hinge.angle (rad)", "hinge.rate (rad/s)", "hinge.force.x (N)"]
    assert list(frame)[-3:] == ["bar.position.z (m)", "rod.tension (N)", "bob.1.position.z (m)"]
    assert frame.attrs["units"]["hinge.torque.x (N m)"] == "N m"
    angle, rate = frame["hinge.angle (rad)"], frame["hinge.rate (rad/s)"]
    assert angle.max() > np.pi / 2
    np.testing.assert_allclose(rate**2, 3 * G * np.sin(angle) / LENGTH, atol=FAIR)
    np.testing.assert_allclose(frame["bar.position.z (m)"], -LENGTH / 2 * np.sin(angle), atol=HELD)
    along = np.cos(angle) * frame["hinge.force.x (N)"] - np.sin(angle) * frame["hinge.force.z (N)"]
    np.testing.assert_allclose(along, -2.5 * MASS * G * np.sin(angle), atol=1e-5)
    np.testing.assert_allclose(
        frame["rod.tension (N)"], -3 * MASS * G * frame["bob.1.position.z (m)"] / LENGTH, atol=1e-5
    )


def driven():
    """A wheel driven at a constant rate about a tilted axis against a brake; a block on a spring, pushed by a table."""
    scene = ts.Scene(gravity=(0, 0, 0))
    wheel = scene.add_body(mass=2.0, inertia=(0.1, 0.1, 0.2), name="wheel", angular_velocity=(0, 0, RATE))
    joint = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1), name="axle"))
    scene.add(ts.constraints.RotationMotor.of(joint, angle=ts.motions.Ramp(0.0, RATE), name="motor"))
    scene.add(ts.forces.JointTorque(joint, function=brake, name="brake"))
    block = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(0, 0, -1), name="block")
    scene.add(ts.constraints.Translational.at(scene.ground, block, point=(0, 0, -1), axis=(0, 0, 1), name="guide"))
    scene.add(ts.forces.Spring(scene.ground, block, stiffness=100.0, damping=5.0, free_length=0.9, name="spring"))
    push = ts.Table([0.0, 0.5, 0.5, 9.0], [0.0, 0.0, 7.0, 7.0], kind="linear")
    scene.add(ts.forces.PointForce(block, force=(push, 0.0, 0.0), name="push"))
    return scene


def brake(t, angle, rate):
    return -0.5 * rate


def test_loads_along_joints_and_springs():
    """The motor balances the brake; the tension is k (l - l0) + c ld; turns are counted."""
    found = ts.simulate(driven(), (0.0, 4.0)).to_dataframe(["motor", "brake", "spring", "axle.angle", "guide"])
    assert list(found)[:4] == [
        "motor.angle (rad)",
        "motor.rate (rad/s)",
        "motor.torque.axis (N m)",
        "brake.torque.axis (N m)",
    ]
    np.testing.assert_allclose(found["brake.torque.axis (N m)"], -0.5 * RATE, rtol=HELD)
    np.testing.assert_allclose(found["motor.torque.axis (N m)"], 0.5 * RATE, rtol=1e-9)
    np.testing.assert_allclose(found["axle.angle (rad)"], RATE * found.index, atol=1e-9)
    assert {"guide.displacement (m)", "guide.rate (m/s)", "guide.force.x (N)"} < set(found)
    length, rate = found["spring.length (m)"], -found["guide.rate (m/s)"]  # the block hangs below
    np.testing.assert_allclose(length, 1.0 - found["guide.displacement (m)"], atol=HELD)
    np.testing.assert_allclose(found["spring.tension (N)"], 100.0 * (length - 0.9) + 5.0 * rate, atol=1e-9)


def test_joints_of_two_angles_and_of_an_angle_and_a_displacement():
    scene = ts.Scene(gravity=(0, 0, 0))
    a, b = (scene.add_body(mass=1.0, inertia=(1, 1, 1), name=name) for name in "ab")
    scene.add(
        ts.constraints.Universal.at(scene.ground, a, point=(0, 0, 0), axis_a=(1, 0, 0), axis_b=(0, 1, 0), name="cross")
    )
    scene.add(ts.constraints.Cylindrical.at(scene.ground, b, point=(0, 0, 0), axis=(0, 0, 1), name="sleeve"))
    scene.set("cross", angle=(0.3, -0.2))
    scene.set("sleeve", angle_rate=2.0, displacement_rate=-1.0)
    frame = ts.simulate(scene, (0.0, 1.0)).to_dataframe(["cross.angle", "sleeve"])
    assert list(frame)[:6] == [
        "cross.angle 1 (rad)", "cross.angle 2 (rad)", "sleeve.angle (rad)", "sleeve.angle_rate (rad/s)",
        "sleeve.displacement (m)", "sleeve.displacement_rate (m/s)",
    ]  # fmt: skip
    np.testing.assert_allclose(frame.iloc[-1, :6], [0.3, -0.2, 2.0, 2.0, -1.0, -1.0], atol=HELD)


def curve(axes, label):
    """Times and values of the curve with this name."""
    return next(line.get_data() for ax in axes for line in ax.lines if line.get_label() == label)


def test_a_contact_with_friction_that_closes():
    """A puck lands, slides to rest, and then carries a side load of 2 N; a demand in flight is zero."""
    scene = ts.Scene(gravity=(0, 0, -G))
    puck = scene.add_point_mass(MASS, position=(0, 0, 0.2), velocity=(3, 0, 0), name="puck")
    scene.add(ts.forces.PointForce(puck, force=(0, 2, 0)))
    law = {"normal_b": (0, 0, 1), "unilateral": True, "kinetic": 0.5}
    scene.add(ts.constraints.PlaneContact(puck, scene.ground, **law, name="ice"))
    solution = ts.simulate(scene, (0, 1), dense_output=True)
    times = [0.1, 0.21, 0.9]
    found = solution.at(times).friction_demand("ice")
    np.testing.assert_allclose(found, [0, 0.5, 2 / (MASS * G)], rtol=FAIR)
    table = solution.to_dataframe(channels=["ice.friction_demand", "ice.contact_point"])
    np.testing.assert_allclose(table.iloc[-1, 0], 2 / (MASS * G), rtol=FAIR)
    np.testing.assert_array_equal(table.iloc[:, 1:], solution.position("puck"))
    assert solution.to_dataframe(channels=["ice"]).columns.size == 6  # force and torque


@pytest.mark.parametrize("dense", [True, False])
def test_figures_are_smooth_where_steps_are_few(dense):
    scene = bar_and_bob()
    solution = ts.simulate(scene, (0.0, 1.0), rtol=1e-11, atol=1e-11, dense_output=dense)
    assert solution.t.size < 30
    axes = solution.plot(["hinge", "bob.1", "rod"])
    assert [ax.get_ylabel() for ax in axes] == [
        "angle (rad)", "rate (rad/s)", "force, tension (N)", "torque (N m)", "position, length (m)", "velocity (m/s)"
    ]  # fmt: skip
    assert axes[-1].get_xlabel() == "time (s)"
    t, angle = curve(axes, "hinge.angle")
    assert t.size >= 1000
    _, rate = curve(axes, "hinge.rate")
    near = FAIR if dense else 1e-3
    np.testing.assert_allclose(angle, fall().at(t).angle("hinge"), atol=near)
    np.testing.assert_allclose(rate, fall().at(t).angle_rate("hinge"), atol=near)
    along = np.cos(angle) * curve(axes, "hinge.force.x")[1] - np.sin(angle) * curve(axes, "hinge.force.z")[1]
    np.testing.assert_allclose(along, -2.5 * MASS * G * np.sin(angle), atol=1e-5 if dense else 0.2)


@pytest.mark.parametrize("dense", [True, False])
def test_jumps_stay_upright(dense):
    """The guide takes what the table pushes: nothing until 0.5 s, then 7 N."""
    solution = ts.simulate(driven(), (0.0, 1.0), dense_output=dense)
    t, force = curve(solution.plot("guide.force.x"), "guide.force.x")
    before, after = t < 0.5, t > 0.5
    assert 0.5 - t[before].max() < 1e-6 > t[after].min() - 0.5
    np.testing.assert_allclose(force[before], 0.0, atol=1e-9)
    np.testing.assert_allclose(force[after], -7.0, atol=1e-9)


def test_an_acceleration_that_jumps_leaves_no_wave_in_the_step_before():
    """A block falls freely, and from 0.5 s on a table carries it: velocity -g t, then constant."""
    scene = ts.Scene(gravity=(0, 0, -G))
    block = scene.add_point_mass(1.0, name="block")
    scene.add(ts.forces.PointForce(block, force=(0, 0, ts.Table([0, 0.5, 0.5, 1], [0, 0, G, G], kind="linear"))))
    solution = ts.simulate(scene, (0.0, 1.0))
    assert solution.t.size < 30
    t, rate = curve(solution.plot("block.velocity.z"), "block.velocity.z")
    np.testing.assert_allclose(rate, -G * np.minimum(t, 0.5), atol=1e-6)


def test_outputs_too_few_for_a_curve_are_dots():
    """Three turns between two outputs: no curve may be drawn through these."""
    scene = driven()
    solution = ts.simulate(scene, (0.0, 9.0), t_eval=[0.0, 4.5, 9.0])
    axes = solution.plot("axle.angle")
    _, angle = curve(axes, "axle.angle")
    assert np.isnan(angle).all()
    (dots,) = [line for line in axes[0].lines if line.get_marker() == "."]
    np.testing.assert_allclose(dots.get_ydata(), RATE * np.array([0.0, 4.5, 9.0]), atol=1e-9)


def test_a_scene_at_rest_is_drawn_as_curves():
    """What moves it is noise of the run, which says nothing of how far outputs may be apart."""
    scene = ts.Scene(gravity=(0, 0, -G))
    block = scene.add_body(mass=2.0, inertia=(1, 1, 1), position=(0, 0, 1.0), name="block")
    for i in range(3):
        at = np.array([np.cos(2.1 * i), np.sin(2.1 * i), 0.0])
        scene.add(ts.forces.Spring(block, scene.ground, point_a=at, point_b=at, stiffness=2e3, damping=20.0))
    scene.set_start(scene.equilibrium())
    _, height = curve(ts.simulate(scene, (0.0, 2.0)).plot("block.position.z"), "block.position.z")
    np.testing.assert_allclose(height, scene["block"].position[2], atol=1e-5)


@pytest.mark.parametrize("dense", [True, False])
def test_a_run_that_ended_early_is_drawn_to_its_end(dense):
    solution = ts.simulate(bar_and_bob(), (0.0, 1.0), max_steps=4, dense_output=dense)
    assert not solution.success
    t, angle = curve(solution.plot("hinge"), "hinge.angle")
    np.testing.assert_allclose(angle, fall().at(t).angle("hinge"), atol=1e-3)
    assert solution.reached - t[-1] < 1e-6


def test_paths_names_and_the_overview(tmp_path):
    solution = fall()
    assert solution.plot().shape == (2, 2)
    for path in (tmp_path / "a.png", str(tmp_path / "b.pdf")):
        assert solution.plot(path).shape == (2, 2)
        assert (tmp_path / path).stat().st_size > 0
    assert solution.plot("hinge.angle", tmp_path / "c.svg").shape == (1,)
    assert solution.plot("hinge.angle", path=str(tmp_path / "d.png")).shape == (1,)
    assert {path.name for path in tmp_path.iterdir()} == {"a.png", "b.pdf", "c.svg", "d.png"}
    part = solution[2:6]
    t, _ = curve(part.plot("hinge.angle"), "hinge.angle")
    assert part.t[0] <= t.min() < t.max() <= part.t[-1]
    (ax,) = solution[3:4].plot("hinge.angle")
    assert [line.get_ydata().tolist() for line in ax.lines if line.get_marker() == "."] == [
        [solution.angle("hinge")[3]]
    ]
    with pytest.raises(ts.InvalidArgument, match="no outputs"):
        solution[0:0].plot("hinge")


WRONG = {
    "hing": "no channel is named 'hing'; did you mean 'hinge'",
    "hinge.angel": "did you mean 'hinge.angle'",
    "hinge.position": "There are hinge.angle, hinge.angle_rate, hinge.rate, .* hinge.force, hinge.torque",
    "bar.position.w": "did you mean 'bar.position",
    "bob.1.orientation": "There are bob.1.position, bob.1.velocity, bob.1.acceleration",
    "zzz": "there are bar, bob.1, hinge, rod",
    "ground": "no channel is named 'ground'",
    "": "no channel is named ''",
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_names_are_answered_by_right_ones(name, tmp_path):
    for ask in (fall().plot, fall().to_dataframe, lambda names: fall().to_csv(tmp_path / "a.csv", names)):
        with pytest.raises(ts.InvalidArgument, match=WRONG[name]):
            ask([name])
    assert not any(tmp_path.iterdir())
    with pytest.raises(ts.InvalidArgument, match=f"keep must be .*{WRONG[name]}"):
        ts.ensemble(bar_and_bob(), {"bar.mass": [1.0]}, (0, 0.1), keep=[name])


@pytest.mark.parametrize("names", [3, [], [3], ["hinge", None], {"hinge": 1, 2: 3}])
def test_what_are_no_names(names):
    with pytest.raises(ts.InvalidArgument, match="channels must be a name such as"):
        fall().to_dataframe(names)


@pytest.mark.parametrize("dense", [False, True])
@pytest.mark.parametrize("period", [None, 0.05])
def test_actuations_of_a_control(period, dense):
    """Functions of time, so in closed form: also within steps, and held between samples. Two act on one joint."""
    scene = ts.Scene()
    bar = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=3.0), position=(0.5, 0, 0), name="bar")
    c = ts.constraints
    hinge = scene.add(c.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    push = ts.forces.PointForce(bar, force=(0, 0, 1.0), name="push")
    values = np.array([2.0, -3.0, 5.0])
    scene.add(ts.forces.Control(lambda t, state: t * values, [hinge, push, "hinge"], period=period, name="law"))
    run = ts.simulate(scene, (0, 0.98), dense_output=dense)
    frame, last = run.to_dataframe("law"), run.t if period is None else period * np.floor(run.t / period + 1e-9)
    assert list(frame.columns) == [
        "law.actuation.hinge 1 (N m)",
        "law.actuation.push (N)",
        "law.actuation.hinge 2 (N m)",
    ]
    np.testing.assert_allclose(frame.to_numpy(), last[:, None] * values, atol=ROUNDING)
    torques, forces = run.plot("law.actuation")
    for ax, own in (torques, values[[0, 2]]), (forces, values[1:2]):
        for line, value in zip(ax.lines, own, strict=True):
            t = line.get_xdata()
            inside = t if period is None else period * np.floor(t / period)
            np.testing.assert_allclose(line.get_ydata(), inside * value, atol=ROUNDING)


def test_a_handle_is_answered_by_its_name():
    bob = (scene := ts.Scene()).add_point_mass(1.0, name="bob")
    run = ts.simulate(scene, (0, 0.1))
    for given in (bob, [bob]):
        with pytest.raises(ts.InvalidArgument, match=r"channels must be a name .*; its name is 'bob'\."):
            run.to_dataframe(given)


def test_a_name_of_a_body_and_of_a_joint():
    """The quantity tells which is meant; the name alone doesn't."""
    scene = ts.Scene()
    arm = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=1.0), position=(0.5, 0, 0), name="arm")
    scene.add(ts.constraints.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 1, 0), name="arm"))
    solution = ts.simulate(scene, (0.0, 0.2))
    assert list(solution.to_dataframe(["arm.angle", "arm.position.z"])) == ["arm.angle (rad)", "arm.position.z (m)"]
    with pytest.raises(ts.InvalidArgument, match="'arm' is a channel of 2 objects; give each"):
        solution.plot("arm")


def test_csv_files(tmp_path):
    """One row of heads; numbers to the bit; a file of all outputs without channels; formulas are none."""
    path = fall().to_csv(tmp_path / "a.csv", ["hinge.angle", "bar.position.z", "hinge.force.x"])
    with open(path, newline="") as file:
        head, *rows = csv.reader(file)
    assert head == ["time (s)", "hinge.angle (rad)", "bar.position.z (m)", "hinge.force.x (N)"]
    np.testing.assert_array_equal(np.array(rows, float)[:, 1], fall().angle("hinge"))
    np.testing.assert_array_equal(np.array(rows, float)[:, 0], fall().t)
    every = pandas.read_csv(fall().to_csv(str(tmp_path / "b.csv")))
    np.testing.assert_array_equal(every["q bar.z (m)"], fall().position("bar")[:, 2])
    assert len(every) == fall().t.size
    stone = (scene := ts.Scene()).add_point_mass(1.0, name="=1+1")
    assert stone.name in (text := ts.simulate(scene, (0, 0.1)).to_csv(tmp_path / "c.csv", "=1+1").read_text())
    assert ",'=1+1.position.x (m)," in text
    with pytest.raises(ts.StorageError, match="can't be written"):
        fall().to_csv(tmp_path / "nowhere" / "a.csv", "hinge")
    with pytest.raises(ts.InvalidArgument, match=r"path must be a path, as text or a Path, got 3\."):
        fall().to_csv(3)


def wobble(t):
    return 0.0, 0.0, 0.1 * np.sin(3.0 * t)


def test_saved_and_stored_solutions(tmp_path):
    pytest.importorskip("h5py")
    names = ["hinge", "bar", "rod"]
    for again in (
        ts.load(fall().save(tmp_path / "a.h5")),
        ts.simulate(bar_and_bob(), (0.0, 1.0), rtol=1e-11, atol=1e-11, store=tmp_path / "b.h5"),
    ):
        pandas.testing.assert_frame_equal(again.to_dataframe(names), fall().to_dataframe(names))
        t, angle = curve(again.plot(names), "hinge.angle")
        np.testing.assert_allclose(angle, fall().at(t).angle("hinge"), atol=1e-3)


def test_a_solution_without_its_scene_says_what_it_lacks(tmp_path):
    """A function is not in the file: kinematics are told, loads are refused with what to pass."""
    pytest.importorskip("h5py")
    scene = bar_and_bob()
    scene.add(ts.forces.PointForce(scene["bar"], force=wobble, name="wobble"))
    whole = ts.simulate(scene, (0.0, 0.5))
    path = whole.save(tmp_path / "a.h5")
    found = ts.load(path)
    np.testing.assert_array_equal(found.to_dataframe("hinge")["hinge.angle (rad)"], whole.angle("hinge"))
    assert list(found.to_dataframe(["hinge", "rod"])) == ["hinge.angle (rad)", "hinge.rate (rad/s)", "rod.length (m)"]
    t, angle = curve(found.plot("hinge"), "hinge.angle")
    assert t.size >= 1000
    np.testing.assert_allclose(angle[[0, -1]], whole.angle("hinge")[[0, -1]], atol=1e-6)
    for ask in (found.plot, found.to_dataframe):
        with pytest.raises(ts.StorageError, match=r"what hinge exerts needs the scene .*wobble"):
            ask("hinge.force.x")
        with pytest.raises(ts.StorageError, match="what rod exerts"):
            ask(["rod.tension"])
        with pytest.raises(ts.InvalidArgument, match=r"no channel is named 'wobble.force'.*wobble"):
            ask("wobble.force")
    again = ts.load(path, scene=scene)
    pandas.testing.assert_frame_equal(again.to_dataframe(["hinge", "wobble"]), whole.to_dataframe(["hinge", "wobble"]))


def test_ensembles_keep_channels(tmp_path):
    """At the end, or over t_eval; in memory, stores and files; with units."""
    pytest.importorskip("xarray")
    scene, table = bar_and_bob(), {"bar.mass": [1.0, 2.0, 4.0]}
    names, times = ["hinge.angle", "hinge.force.z", "rod"], np.linspace(0.0, 0.8, 5)
    last = ts.ensemble(scene, table, (0, 0.8), keep=names)
    series = ts.ensemble(scene, table, (0, 0.8), keep=names, t_eval=times)
    alone = ts.simulate(scene.with_parameters({"bar.mass": 2.0}), (0, 0.8), t_eval=times)
    for name in ("hinge.angle", "hinge.force.z", "rod.length", "rod.tension"):
        expected = alone.to_dataframe(name).to_numpy()[:, 0]
        assert series.kept[name].shape == (3, 5)
        np.testing.assert_array_equal(series.kept[name][1], expected)
        np.testing.assert_allclose(last.kept[name], series.kept[name][:, -1], rtol=0, atol=1e-6)
    assert (series.unit("hinge.force.z"), series.unit("bar.mass")) == ("N", "kg")
    frame = series.to_dataframe()
    assert len(frame) == 15
    np.testing.assert_array_equal(frame["hinge.angle (rad)"], series.kept["hinge.angle"].ravel())
    assert series.to_xarray()["rod.tension"].dims == ("case", "time")
    assert series.to_xarray()["rod.tension"].attrs["units"] == "N"
    for found in (series, ts.load(series.save(tmp_path / "a.h5"))):
        assert found.plot("hinge.angle").get_ylabel() == "hinge.angle (rad)"
        assert found.unit("rod.length") == "m"
        np.testing.assert_array_equal(found.kept["rod.length"], series.kept["rod.length"])
    assert last.plot("rod.tension").get_ylabel() == "rod.tension (N)"
    stored = ts.ensemble(scene, table, (0, 0.8), keep=names, t_eval=times, store=tmp_path / "b.zarr")
    np.testing.assert_array_equal(stored.kept["hinge.angle"], series.kept["hinge.angle"])
    with pytest.raises(ts.StorageError, match="another ensemble"):
        ts.ensemble(scene, table, (0, 0.8), keep=names[:1], t_eval=times, store=tmp_path / "b.zarr", resume=True)


def test_channels_of_cases_that_end_early_or_fail():
    """NaN behind the end; NaN where a case could not be run."""

    def low(t, state):
        return state.angle("hinge") - 0.5

    low.terminal = True
    scene = bar_and_bob()
    ended = ts.ensemble(scene, {"bar.mass": [1.0, 2.0]}, (0, 1), keep="hinge.angle", t_eval=[0.0, 0.1, 1.0], events=low)
    assert np.isfinite(ended.kept["hinge.angle"][:, :2]).all()
    assert np.isnan(ended.kept["hinge.angle"][:, 2]).all()
    failed = ts.ensemble(scene, {"rod.length": [7.0, 8.0]}, (0, 1), keep=["hinge.angle"])
    assert not failed.success.any()
    assert np.isnan(failed.kept["hinge.angle"]).all()
    assert failed.kept["hinge.angle"].shape == (2,)


SCENE = """\
version = 1
gravity = [0, 0, -10]
[[body]]
name = "bar"
shape = { type = "rod", length = 1.5, axis = "x", mass = 3.0 }
position = [0.75, 0, 0]
[[constraint]]
type = "Revolute"
name = "hinge"
a = "ground"
b = "bar"
at = { point = [0, 0, 0], axis = [0, 1, 0] }
[run]
end = 1.0
"""
TABLES = """\
[output]
files = ["c.csv"]
plot = "c.png"
channels = ["hinge.angle", "bar.position"]
[ensemble]
keep = ["hinge.angle"]
[ensemble.parameters]
"bar.mass" = [1, 2]
"""


def test_channels_on_the_command_line_and_in_files(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.toml").write_text(SCENE)
    asked = "run", "a.toml", "--csv", "a.csv", "--plot", "a.png", "--output", "a.h5", "--channels"
    code, out, _ = called(capsys, *asked, "hinge.angle,bar.position.z", "hinge.force.x")
    assert code == 0, out
    text = (tmp_path / "a.csv").read_text()
    assert text.startswith("time (s),hinge.angle (rad),bar.position.z (m),hinge.force.x (N)\n0.0,")
    assert (tmp_path / "a.png").stat().st_size > 0
    assert called(capsys, "convert", "a.h5", "b.csv", "--channels", "hinge.rate")[0] == 0
    assert (tmp_path / "b.csv").read_text().startswith("time (s),hinge.rate (rad/s)\n")
    (tmp_path / "c.toml").write_text(SCENE + TABLES)
    assert called(capsys, "run", "c.toml")[0] == 0
    head = "time (s),hinge.angle (rad),bar.position.x (m),bar.position.y (m),bar.position.z (m)\n"
    assert (tmp_path / "c.csv").read_text().startswith(head)
    assert (tmp_path / "c.png").stat().st_size > 0
    found = json.loads(called(capsys, "ensemble", "c.toml", "--json")[1])
    assert list(found["final"]) == ["hinge.angle (rad)"]
    found = json.loads(called(capsys, "ensemble", "c.toml", "--json", "--channels", "bar.position.z")[1])
    assert list(found["final"]) == ["bar.position.z (m)"]


def test_wrong_channels_on_the_command_line_and_in_files(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.toml").write_text(SCENE)
    for words, said in (
        (("--channels", "hinge"), "give --csv PATH or --plot"),
        (("--csv", "a.txt"), "ends in .csv"),
        (("--csv", "a.csv", "--channels", "hinge.angel"), "did you mean 'hinge.angle'"),
    ):
        code, _, error = called(capsys, "run", "a.toml", *words)
        assert code == 1
        assert said in error
    wrong = (
        ('["hinge.angle", "bar.position"]', '["hinge.angel"]', "did you mean 'hinge.angle'"),
        ('["hinge.angle", "bar.position"]', '"hinge"', "must be a list of names"),
        ('keep = ["hinge.angle"]', 'keep = ["hnge"]', "did you mean 'hinge'"),
        ('keep = ["hinge.angle"]', "keep = []", "names of channels"),
    )
    for right, other, said in wrong:
        (tmp_path / "b.toml").write_text(SCENE + TABLES.replace(right, other))
        code, _, error = called(capsys, "run", "b.toml")
        assert code == 1
        assert said in error
        assert "b.toml:" in error
    assert {path.name for path in tmp_path.iterdir()} == {"a.toml", "b.toml"}
