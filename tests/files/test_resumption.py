"""A run that was stopped, or killed, and goes on from its checkpoint gives the bits of one never stopped."""

import os
from inspect import signature

import numpy as np
import pytest

import tsdyn as ts
from benchmarks.stiff import jointed
from examples import driven_pivot, four_bar, geared_pair, top
from tests.helpers.built_in import FORCES, by_name
from tests.helpers.calls import same_run
from tests.helpers.refusals import refuse
from tests.helpers.resuming import Stop
from tests.helpers.skates import sleigh
from tsdyn.files import checkpoint
from tsdyn.runs import driver
from tsdyn.simulation import segments

I = ts.integrators


@pytest.fixture
def short_slices(monkeypatch):
    """Slices of a few steps, so that a short run has many."""
    monkeypatch.setattr(driver, "FIRST_SLICE", 4)


def stop_and_go_on(build, end, path, again=None, **options):
    """A whole run; one that is stopped twice and gone on with."""
    whole = ts.simulate(build(), (0.0, end), history=True, **options)
    stopped = ts.simulate(build(), (0.0, end), history=True, store=path, checkpoint=0.0, progress=Stop(2), **options)
    given = {"scene": again, "events": options.get("events")}
    ts.resume(path, **given, progress=Stop(2))
    resumed = ts.resume(path, **given)
    same_run(whole, resumed)
    same_run(whole, ts.resume(path, **given))  # a finished run
    return stopped


EXPLICIT = {
    "dop853": {"integrator": "dop853"},
    "rk45": {"integrator": "rk45"},
    "nystrom4": {"integrator": I.Nystrom4(1e-2)},
    "taylor": {"integrator": I.Taylor(step=0.02)},
}
FORMS = ("tangent", "null-space", "maggi-kane")
WAYS = {
    **{f"{name}, {form}": {**way, "formulation": form} for name, way in EXPLICIT.items() for form in FORMS
       if form == "tangent" or name != "taylor"},
    "times": {"integrator": "dop853", "t_eval": np.linspace(0.0, 1.0, 33)},
    "charts": {"integrator": "dop853", "chart_interval": 3},
    "max_step": {"max_step": 0.01},
    "sdirk54": {"integrator": "sdirk54"},
    "sdirk54, null-space": {"integrator": "sdirk54", "formulation": "null-space"},
    "trapezoid": {"integrator": I.ImplicitTrapezoid(1e-4, 1e-4)},
}  # fmt: skip


@pytest.mark.slow_but("dop853, tangent", "nystrom4, null-space", "rk45, maggi-kane", "taylor, tangent", "times")
@pytest.mark.usefixtures("short_slices")
@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_every_method(way, tmp_path):
    stopped = stop_and_go_on(top.build, 1.0, tmp_path / "run.h5", **way)
    assert stopped.status == ts.Status.INTERRUPTED
    assert 0.0 < stopped.reached < 1.0


@pytest.mark.slow_but("dop853, null-space")
@pytest.mark.usefixtures("short_slices")
@pytest.mark.parametrize(
    "way",
    [
        {"integrator": I.Taylor(step=0.02)},
        {"integrator": "dop853", "formulation": "null-space"},
        {"integrator": I.Nystrom4(1e-2), "formulation": "null-space"},
        {"integrator": "dop853", "formulation": "null-space", "t_eval": np.linspace(0.0, 1.0, 33)},
        {"integrator": I.Radau(1e-6, 1e-6)},
        {"integrator": "sdirk54"},
    ],
    ids=["taylor", "dop853, null-space", "nystrom4, null-space", "times, null-space", "radau", "sdirk54"],
)
def test_rows_on_velocities(way, tmp_path):
    stop_and_go_on(sleigh, 1.0, tmp_path / "run.h5", **way)


def drawn():
    """A motor with a rotor turns a wheel, coupled by a product of angles to another, that lifts a load by a cable."""
    scene, c = ts.Scene(gravity=(0, 0, -9.81)), ts.constraints
    hinges = []
    for i in range(3):
        wheel = scene.add_body(1.0, (0.3, 0.3, 0.3), position=(i, 0, 0), angular_velocity=(0, 0, 4.0 if i < 2 else 0.0))
        hinges.append(scene.add(c.Revolute.at(scene.ground, wheel, point=(i, 0, 0), axis=(0, 0, 1), name=f"h{i}")))
    scene.add(c.Coupler(hinges[2], *hinges[:2], function=lambda p, q: 0.1 * p * q + 0.2 * np.sin(p)))
    scene.assemble(fixed=["body1", "body2"])
    scene.add(ts.forces.Armature(hinges[0], inertia=0.02, ratio=5.0))
    load = scene.add_body(0.5, (0.1, 0.1, 0.1), position=(2.3, 0, -1.0), name="load")
    points = [(scene.bodies[2], (0.3, 0, 0)), (scene.ground, (2.3, 0, 0.5)), (load, (0, 0, 0.1))]
    scene.add(ts.forces.Cable(points, stiffness=300.0, damping=2.0, free_length=1.5))
    counter = scene.add_point_mass(mass=0.4, position=(5, 0, -1))
    weight = scene.add_point_mass(mass=0.5, position=(6, 0, -1.5))
    over = [(counter, (0, 0, 0)), (scene.ground, (5, 0, 0)), (scene.ground, (6, 0, 0)), (weight, (0, 0, 0))]
    scene.add(c.Rope(over, always_taut=True))
    return scene


@pytest.mark.slow_but("dop853")
@pytest.mark.usefixtures("short_slices")
@pytest.mark.parametrize(
    "method", [None, "dop853", I.Nystrom4(1e-2), "radau"], ids=["default", "dop853", "nystrom4", "radau"]
)
def test_rotors_couplers_cables_and_ropes(method, tmp_path):
    stop_and_go_on(drawn, 0.7, tmp_path / "run.h5", again=drawn(), integrator=method)


@pytest.mark.slow_but("Cable", "Spring")
@pytest.mark.parametrize("kind", [kind for kind in FORCES if "function" not in signature(kind).parameters], **by_name)
def test_forces_without_functions_of_the_user_need_no_scene(kind, tmp_path, rng):
    """A store holds all of a scene whose laws are tsdyn's own."""
    scene = ts.Scene()
    bodies = [scene.add_body(1.0, (0.1, 0.2, 0.3), rng.normal(size=3)) for _ in range(2)]
    scene.add(kind.example(rng, *bodies))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 0.01), store=tmp_path / "run.h5", checkpoint=60.0, history=True)
    same_run(solution, ts.resume(tmp_path / "run.h5"))


@pytest.mark.slow_but("redundant-dop853", "turns-default")
@pytest.mark.usefixtures("short_slices")
@pytest.mark.parametrize("method", [None, "dop853", I.Nystrom4(1e-2)], ids=["default", "dop853", "nystrom4"])
@pytest.mark.parametrize("build", [four_bar.build, geared_pair.build], ids=["redundant", "turns"])
def test_redundant_rows_and_counted_turns(build, method, tmp_path):
    stop_and_go_on(build, 1.0, tmp_path / "run.zarr", integrator=method)


@pytest.mark.usefixtures("short_slices")
def test_events(tmp_path):
    def low(t, state):
        return state.q[2] - 0.9

    stopped = stop_and_go_on(top.build, 1.0, tmp_path / "run.h5", integrator="dop853", events=low)
    assert stopped.status == ts.Status.INTERRUPTED
    refuse(lambda: ts.resume(tmp_path / "run.h5"), ts.StorageError, ("events", "low"))

    def low(t, state):
        return state.q[2] - 0.8

    refuse(lambda: ts.resume(tmp_path / "run.h5", events=low), ts.StorageError, ("source", "low", "changed"))


@pytest.mark.usefixtures("short_slices")
def test_the_message_says_how_to_go_on(tmp_path):
    def low(t, state):
        return state.q[2] - 0.9

    for i, (build, options, more) in enumerate(
        (
            (top.build, {"checkpoint": 0.0}, ""),
            (top.build, {"checkpoint": 0.0, "events": low}, ", events=events"),
            (driven_pivot.build, {"checkpoint": 0.0}, ", scene=scene"),
        )
    ):
        path = tmp_path / f"run {i}.h5"
        stopped = ts.simulate(build(), (0.0, 1.0), integrator="dop853", store=path, progress=Stop(2), **options)
        assert f"Continue with ts.resume({str(path)!r}{more})." in stopped.message
        assert "simulate(" not in stopped.message
    again = ts.resume(tmp_path / "run 0.h5", progress=Stop(2))
    assert "Continue with ts.resume(" in again.message
    plain = ts.simulate(top.build(), (0.0, 1.0), integrator="dop853", store=tmp_path / "plain.h5", progress=Stop(2))
    assert "state=solution.state" in plain.message


def bouncing():
    scene = ts.Scene()
    ball = scene.add_body(1.0, (0.1, 0.1, 0.1), position=(0.0, 0.0, 1.0), velocity=(1.0, 0.0, 0.0))
    scene.add(ts.constraints.SphereContact(ball, scene.ground, radius_a=0.2, normal_b=(0, 0, 1), restitution=0.7))
    return scene


@pytest.mark.parametrize("build", [top.build, bouncing], ids=["top", "ball"])
@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_a_run_that_max_steps_stops_may_make_as_many_steps_again(build, method, tmp_path):
    options, path = {"integrator": method, "history": True}, tmp_path / "run.h5"
    whole = ts.simulate(build(), (0.0, 1.0), **options)
    most = whole.stats.steps // 3 or 1
    found = [ts.simulate(build(), (0.0, 1.0), store=path, checkpoint=1e9, max_steps=most, **options)]
    assert f"Continue with ts.resume({str(path)!r})" in found[0].message
    while not found[-1].success:
        assert found[-1].status == ts.Status.MAX_STEPS
        assert found[-1].stats.steps == len(found) * most
        found.append(ts.resume(path))
    assert len(found) == -(-whole.stats.steps // most)
    same_run(whole, found[-1])


def test_scenes_with_code_are_passed_again(tmp_path):
    path, scene = tmp_path / "run.h5", driven_pivot.build()
    stop_and_go_on(driven_pivot.build, 0.5, path, again=scene, integrator="dop853")
    refuse(lambda: ts.resume(path), ts.StorageError, ("yours", "ts.resume(path, scene=scene)"))
    scene.bodies[0].mass *= 1.0 + 2.0**-52
    refuse(lambda: ts.resume(path, scene=scene), ts.StorageError, ("another one",))


def folding():
    """Links of one length, folded into a line, whose fold the motion passes."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    ends = [scene.add_point_mass(1.0, position=(x, 0.0, 1.0), velocity=(0.7, 0.0, 0.0)) for x in (0.0, 1.0)]
    for x, end in enumerate(ends):
        scene.add(ts.constraints.Distance(end, scene.ground, point_b=(float(x), 0.0, 0.0)))
        scene.add(ts.constraints.PlaneContact(end, scene.ground, normal_b=(0.0, 1.0, 0.0)))
    scene.add(ts.constraints.Distance(*ends))
    return scene


@pytest.mark.slow
@pytest.mark.usefixtures("short_slices")
@pytest.mark.parametrize("method", [None, "dop853", I.Nystrom4(1e-2)], ids=["default", "dop853", "nystrom4"])
@pytest.mark.parametrize("count", range(2, 14, 3))
def test_singular_configurations(method, count, tmp_path):
    path, options = tmp_path / "run.h5", {"integrator": method, "history": True}
    whole = ts.simulate(folding(), (0.0, 6.0), **options)
    ts.simulate(folding(), (0.0, 6.0), store=path, checkpoint=0.0, progress=Stop(count), **options)
    same_run(whole, ts.resume(path))
    assert method is None or "singular" in whole.message


@pytest.mark.slow
@pytest.mark.usefixtures("short_slices")
@pytest.mark.parametrize("count", [2, 5, 8, 11, 13, 15])
def test_runs_that_turn_to_an_implicit_method(count, tmp_path, monkeypatch):
    """Stopped in segments of either method, of which there are five or more."""
    monkeypatch.setattr(segments.limits, "PATIENCE", 1)
    monkeypatch.setattr(segments.Turns, "patience", 1)
    path, options = tmp_path / "run.h5", {"rtol": 1e-7, "atol": 1e-7, "history": True}
    whole = ts.simulate(jointed(), (0.0, 2.0), **options)
    assert "Radau took over 3 times" in whole.message
    stopped = ts.simulate(jointed(), (0.0, 2.0), store=path, checkpoint=0.0, progress=Stop(count), **options)
    assert stopped.status == ts.Status.INTERRUPTED
    same_run(whole, ts.resume(path))
    again = ts.resume(path)
    same_run(whole, again)
    assert again.method == whole.method


def hinged():
    """A scene with a rod on a hinge, released from the horizontal."""
    scene = ts.Scene(gravity=(0.0, 0.0, -10.0))
    rod = scene.add_body(1.0, (0.1, 0.1, 0.1), position=(1.0, 0.0, 0.0))
    at = {"point": (0, 0, 0), "axis": (0, 1, 0)}
    return scene, rod, scene.add(ts.constraints.Revolute.at(rod, scene.ground, **at, name="hinge"))


@pytest.mark.slow
@pytest.mark.usefixtures("short_slices")
@pytest.mark.parametrize("method", ["taylor", "dop853", "sdirk54"])
def test_friction_of_joints(method, tmp_path):
    def build():
        scene, _, hinge = hinged()
        scene.add(ts.forces.RevoluteFriction(hinge, kinetic=0.2, radius=0.05))
        return scene

    stop_and_go_on(build, 1.0, tmp_path / "run.h5", integrator=method)


def stopping():
    """A block that comes to rest, where explicit steps collapse, and is pushed with less than its friction."""
    scene = ts.Scene()
    block = scene.add_body(2.0, (0.01, 0.01, 0.01), velocity=(1, 0, 0))
    guide = scene.add(ts.constraints.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(ts.forces.TranslationalFriction(guide, kinetic=0.4, slip_velocity=1e-11))
    scene.add(ts.forces.PointForce(block, force=(ts.motions.Sine(0.9 * 0.4 * 2.0 * 9.81, 3.0), 0, 0)))
    return scene


@pytest.mark.slow
def test_friction_that_comes_to_rest(tmp_path, short_slices):
    stop_and_go_on(stopping, 3.0, tmp_path / "run.zarr")
    for count in (3, 8):
        path = tmp_path / f"{count}.zarr"
        ts.simulate(stopping(), (0.0, 3.0), history=True, store=path, checkpoint=0.0, progress=Stop(count))
        same_run(ts.simulate(stopping(), (0.0, 3.0), history=True), ts.resume(path))


def controlled():
    scene, _, hinge = hinged()
    scene.add(ts.forces.JointTorque(hinge, function=lambda t, angle, rate: -2.0 * rate, period=0.05))
    return scene


@pytest.mark.usefixtures("short_slices")
def test_sampled_loads(tmp_path):
    stop_and_go_on(controlled, 2.0, tmp_path / "run.h5", again=controlled(), integrator="dop853")


class Late:
    """A digital controller, one sample late: it keeps a number, an array and a list, which change their shapes."""

    def reset(self):
        self.next, self.mean, self.seen = 0.0, np.zeros(1, np.float32), []
        self.notes = [[1], [2, 3], "no numbers"]

    def __call__(self, t, state):
        given, self.next = self.next, -2.0 * state.angle_rate("hinge") * np.ones(1)
        self.mean = (0.9 * self.mean + self.next).astype(np.float32)
        self.seen = [*self.seen[-3:], float(self.next[0])]
        return given + 0.1 * self.mean + 0.1 * sum(self.seen)


def delayed():
    scene, _, hinge = hinged()
    scene.add(ts.forces.Control(Late(), [hinge], period=0.05))
    return scene


@pytest.mark.usefixtures("short_slices")
def test_what_a_digital_controller_keeps(tmp_path):
    stop_and_go_on(delayed, 2.0, tmp_path / "run.h5", again=delayed(), integrator="dop853")


def loaded():
    """Every sort of load that has a series: of state, of time, data, friction."""
    scene, rod, _ = hinged()
    scene.add(ts.forces.PointForce(rod, force=lambda t, state: (-state[7], 0.0, np.sin(t))))
    scene.add(ts.forces.Torque(rod, torque=lambda t: (0.0, np.cos(3.0 * t), 0.0)))
    table = ts.Table((0.0, 0.4, 1.1, 2.0), (0.0, 1.0, -1.0, 0.5))
    scene.add(ts.forces.Spring(rod, scene.ground, point_b=(0, 0, 2), stiffness=3.0, actuator=table))
    scene.add(ts.forces.CoulombFriction(rod, scene.ground, torque=0.3, slip_rate=0.1))
    return scene


@pytest.mark.slow
@pytest.mark.usefixtures("short_slices")
def test_series_of_loads(tmp_path):
    stopped = stop_and_go_on(loaded, 2.0, tmp_path / "run.h5", again=loaded())
    assert stopped.method.startswith("Taylor")


@pytest.fixture
def stopped(tmp_path, short_slices):
    """The path of a run that was stopped."""
    path = tmp_path / "run.h5"
    ts.simulate(top.build(), (0.0, 3.0), integrator="dop853", store=path, checkpoint=0.0, progress=Stop(3))
    return path


def test_a_damaged_checkpoint_is_refused_and_the_one_before_it_offered(stopped):
    newest, _ = checkpoint.place(stopped)
    content = newest.read_bytes()
    newest.write_bytes(content[:-100])
    refuse(lambda: ts.resume(stopped), ts.StorageError, ("damaged", "one before it", "whole", "delete"))
    newest.unlink()
    whole = ts.simulate(top.build(), (0.0, 3.0), integrator="dop853")
    np.testing.assert_array_equal(ts.resume(stopped).q, whole.q)


def test_both_damaged(stopped):
    for path in checkpoint.place(stopped):
        path.write_bytes(b"\0" + path.read_bytes())
    refuse(lambda: ts.resume(stopped), ts.StorageError, ("no checkpoint of this format",))


@pytest.mark.parametrize(("fact", "word"), [("version", "0.0.0"), ("machine", ["abacus"])])
def test_another_version_or_machine(fact, word, stopped):
    numbers, arrays = checkpoint.read(stopped)
    checkpoint.write(stopped, {**numbers, fact: word}, arrays)
    refuse(lambda: ts.resume(stopped), ts.StorageError, ("the bits would differ",))


@pytest.mark.parametrize("missing", [1, 5000, None])
def test_a_damaged_store(stopped, missing):
    """HDF5 would wait for what is missing."""
    content = stopped.read_bytes()
    left = content[:300] if missing is None else content[:-missing]
    stopped.write_bytes(left)
    refuse(lambda: ts.resume(stopped), ts.StorageError, ("damaged", f"{len(left)} bytes"))


@pytest.mark.parametrize("part", ["c/0/0", "zarr.json"])
def test_truncated_files_of_zarr(part, tmp_path, short_slices):
    path = tmp_path / "run.zarr"
    solution = ts.simulate(
        top.build(), (0.0, 3.0), integrator="dop853", store=path, checkpoint=0.0, progress=Stop(3)
    )  # fmt: skip
    file = path / "qd" / part
    file.write_bytes(file.read_bytes()[:-100])
    for read in (lambda: ts.resume(path), lambda: solution.qd):
        refuse(read, ts.StorageError, ("run.zarr", "damaged"))


def test_a_chunk_of_zarr_that_is_gone(tmp_path, short_slices):
    path = tmp_path / "run.zarr"
    ts.simulate(top.build(), (0.0, 3.0), integrator="dop853", store=path, checkpoint=0.0, progress=Stop(3))
    (path / "qd" / "c" / "0" / "0").unlink()
    refuse(lambda: ts.resume(path), ts.StorageError, ("damaged", "qd lacks chunks"))


@pytest.mark.parametrize("suffix", ["h5", "zarr"])
def test_stopped_again_before_the_first_checkpoint(suffix, tmp_path, short_slices):
    path, method = tmp_path / f"run.{suffix}", I.Nystrom4(1e-3)
    ts.simulate(top.build(), (0.0, 1.0), integrator=method, store=path, checkpoint=0.0, progress=Stop(6))
    for _ in range(3):
        ts.resume(path, progress=Stop(1))
    np.testing.assert_array_equal(ts.resume(path).q, ts.simulate(top.build(), (0.0, 1.0), integrator=method).q)


def test_no_checkpoint(tmp_path):
    refuse(lambda: ts.resume(tmp_path / "run.h5"), ts.StorageError, ("run.h5 doesn't exist.",))
    refuse(lambda: ts.resume(tmp_path / "nowhere/run.h5"), ts.StorageError, ("run.h5 doesn't exist.",))
    ts.simulate(top.build(), (0.0, 0.1), store=tmp_path / "runs.h5")
    refuse(lambda: ts.resume(tmp_path / "run.h5"), ts.StorageError, ("doesn't exist; did you mean runs.h5?",))
    refuse(lambda: ts.resume(tmp_path / "runs.h5"), ts.StorageError, ("was written without checkpoint=seconds",))
    refuse(lambda: ts.resume(3), ts.InvalidArgument, ("path must be a path", "3"))


@pytest.mark.parametrize("stride", [5, pytest.param(1, marks=pytest.mark.slow)])
def test_a_file_runs_no_code(stride, stopped, tmp_path):
    """A pickle that would run a command, in each array of a checkpoint, and in place of it."""
    import pickle

    class Evil:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "executed"),)

    payload, (numbers, arrays) = pickle.dumps(Evil()), checkpoint.read(stopped)
    for name in list(arrays)[::stride]:
        checkpoint.write(stopped, numbers, arrays | {name: np.frombuffer(payload, np.uint8)})
        refuse(lambda: ts.resume(stopped), ts.StorageError, (), name)
    for content in (payload, checkpoint.FORMAT + b"0" * 64 + b"\n" + payload):
        checkpoint.place(stopped)[0].write_bytes(content)
        refuse(lambda: ts.resume(stopped), ts.StorageError, ("checkpoint",))
    assert not (tmp_path / "executed").exists()
