"""Lanes: several cases at once in a thread, each as if it were alone."""

import numpy as np
import pytest

import tsdyn as ts
from benchmarks.scenes import SCENES
from examples import coin
from tests.helpers.rods_on_a_spring import two_rods_on_a_spring as spring
from tests.helpers.skates import sleigh
from tsdyn.ensembles import runner
from tsdyn.taylor import lane_stepper

RNG = np.random.default_rng(5)
CASES, RTOL = 11, 1e-10
AGREE = 1e-8  # errors of runs at RTOL, of which rounding makes others in lanes
SHORT = {"rtol": RTOL, "atol": RTOL, "threads": 1}


def uniform(*shape):
    return RNG.uniform(0.9, 1.1, (CASES, *shape))


def loop():
    """Two rods on a pin, the ends of both held to the ground."""
    scene = ts.Scene(gravity=(0, 0, -10))
    a = scene.add_body(1.0, (0.02, 0.1, 0.1), position=(0.5, 0, 0), name="a")
    b = scene.add_body(2.0, (0.1, 0.1, 0.02), position=(1, 0, -0.5), name="b")
    scene.add(ts.constraints.Spherical.at(scene.ground, a, point=(0, 0, 0)))
    scene.add(ts.constraints.Revolute.at(a, b, point=(1, 0, 0), axis=(0, 1, 0)))
    scene.add(ts.constraints.Distance(b, scene.ground, point_a=(0, 0, -0.5), point_b=(2, 0.3, -1.5)))
    return scene


def damped():
    """A body on a bushing, with friction, of coefficients that are zero in some cases."""
    scene = ts.Scene(gravity=(0, 0, -10))
    body = scene.add_body(1.0, (0.3, 0.4, 0.5), velocity=(0.1, 0.2, 0), angular_velocity=(1, 2, 3), name="body")
    scene.add(ts.forces.Bushing(body, scene.ground, stiffness=(4, 5, 6), torsional_stiffness=3, name="bush"))
    scene.add(ts.forces.ViscousFriction(body, scene.ground, damping=1, torsional_damping=1, name="oil"))
    return scene


def damping(scene):
    whether = np.arange(CASES) % 2
    table = {f"bush.{name}": whether[:, None] * uniform(3) for name in ("damping", "torsional_damping")}
    return table | {f"oil.{name}": whether[::-1] * uniform() for name in ("damping", "torsional_damping")}


STUDIES = {
    "sliding top": (SCENES["sliding top"].build, 3.0, lambda scene: {f"{scene.bodies[0].name}.mass": 30 * uniform()}),
    "two-body pendulum": (
        SCENES["two-body pendulum"].build,
        0.5,
        lambda scene: {f"{scene.bodies[1].name}.mass": 75 * uniform()},
    ),
    "chain of 4": (SCENES["chain of 4"].build, 0.2, lambda scene: {"gravity": (0, 0, -9.6) * uniform(1)}),
    "springs": (
        spring,
        0.5,
        lambda scene: {"spring.stiffness": 20 * uniform(), "rod 1.inertia": (0.1, 0.1, 0.05) * uniform(1)},
    ),
    "damped": (damped, 0.5, damping),
    "sleigh": (sleigh, 1.0, lambda scene: {"sleigh.mass": 2 * uniform(), "rod.mass": uniform()}),
    "coin": (lambda: coin.rolling(0.3, (0.4, 8.0, 1.5)), 1.0, lambda scene: {"coin.mass": uniform()}),
    "loop": (loop, 0.3, lambda scene: {"a.mass": uniform(), "b.mass": 2 * uniform()}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", STUDIES)
def test_lanes_agree_with_runs_alone(name, monkeypatch):
    build, end, table = STUDIES[name]
    scene = build()
    values, alone = table(scene), []
    one = ts.ensemble(scene, values, (0.0, end), **SHORT)
    run = runner.Runner.run
    monkeypatch.setattr(runner.Runner, "run", lambda self, room, k: alone.append(room.first + k) or run(self, room, k))
    found = ts.ensemble(scene, values, (0.0, end), lanes=4, **SHORT)
    assert (one.lanes, found.lanes) == (1, 4)
    assert alone == [0]
    assert found.success.all()
    assert (found.t == end).all()
    np.testing.assert_allclose(found.q, one.q, rtol=0, atol=AGREE)
    np.testing.assert_allclose(found.qd, one.qd, rtol=0, atol=100 * AGREE)
    assert (found.q != one.q).any()  # of lanes, not of runs alone
    errors = found.case(3).constraint_error
    assert errors.position.max() < AGREE


@pytest.mark.slow
def test_lanes_of_rolling_bodies_run_the_loops_of_contacts():
    """Which are twice as quick as those for any marker."""
    contact = STUDIES["coin"][0]().packed.constraints[0]
    ts.ensemble(contact.scene, {"coin.mass": uniform()}, (0.0, 0.1), lanes=4, **SHORT)
    known = [one for one, _ in lane_stepper._known]
    assert contact.kernels["contact_series"] in known
    assert contact.kernels["series"] not in known


def spun():
    """A body that turns about its tip, and cases from slow to fast."""
    scene = ts.Scene(gravity=(0, 0, -10))
    body = scene.add_body(1.0, (0.3, 0.2, 0.1), position=(0, 0, -0.5), name="body")
    scene.add(ts.constraints.Spherical.at(scene.ground, body, point=(0, 0, 0)))
    speed = np.geomspace(0.01, 80.0, CASES)
    spin = speed[:, None] * np.array([0.6, 0.48, 0.64])
    lever = np.broadcast_to((0.0, 0.0, -0.5), spin.shape)
    turn = np.stack([np.cross(w, s) for w, s in zip(spin, lever, strict=True)])
    return scene, {"body.angular_velocity": spin, "body.velocity": turn}


@pytest.mark.slow
def test_a_case_depends_neither_on_its_neighbours_nor_on_threads():
    scene, table = spun()
    found = ts.ensemble(scene, table, (0, 1), lanes=4, **SHORT)
    again = ts.ensemble(scene, table, (0, 1), lanes=4, rtol=RTOL, atol=RTOL, threads=3)
    backwards = ts.ensemble(scene, {name: a[::-1] for name, a in table.items()}, (0, 1), lanes=4, **SHORT)
    for name in ("q", "qd", "t", "status"):
        assert getattr(again, name).tobytes() == getattr(found, name).tobytes()
        assert getattr(backwards, name)[::-1].tobytes() == getattr(found, name).tobytes()
    for i in (0, CASES - 1):
        alone = ts.ensemble(scene, {name: a[i : i + 1] for name, a in table.items()}, (0, 1), lanes=4, **SHORT)
        assert alone.q[0].tobytes() == found.q[i].tobytes()
    one = ts.ensemble(scene, table, (0, 1), **SHORT)
    np.testing.assert_allclose(found.q, one.q, rtol=0, atol=100 * AGREE)


@pytest.mark.slow
def test_outputs_at_times():
    scene, table = spun()
    times = [0.0, 0.1, 0.11, 0.5, 1.0]
    options = {"keep": "t_eval", "t_eval": times, **SHORT}
    one, found = (ts.ensemble(scene, table, (0, 1), lanes=n, **options) for n in (1, 4))
    assert found.success.all()
    np.testing.assert_allclose(found.q, one.q, rtol=0, atol=100 * AGREE)
    np.testing.assert_allclose(found.qd, one.qd, rtol=0, atol=1e4 * AGREE)
    last = ts.ensemble(scene, table, (0, 1), lanes=4, **SHORT)
    assert found.q[:, -1].tobytes() == last.q.tobytes()


@pytest.mark.slow
def test_cases_that_fail_spoil_no_other():
    scene = spring()
    table = {"spring.stiffness": 20 * uniform(), "spring.damping": 0.1 * uniform(), "rod 0.mass": uniform()}
    plain = ts.ensemble(scene, table, (0, 0.3), lanes=4, **SHORT)
    table["rod 0.mass"][2] = np.nan
    table["spring.stiffness"][5] = 1e308
    found, one = (ts.ensemble(scene, table, (0, 0.3), lanes=n, **SHORT) for n in (4, 1))
    assert found.status.tolist() == one.status.tolist()
    assert found.message == one.message
    assert np.flatnonzero(~found.success).tolist() == [2, 5]
    for i in range(CASES):
        np.testing.assert_array_equal(found.q[i], (one if i in (2, 5) else plain).q[i], err_msg=str(i))


@pytest.mark.slow
def test_motions_that_turn_stiff_are_run_alone():
    scene = ts.Scene(gravity=(0, 0, -10))
    bob = scene.add_point_mass(1.0, position=(1, 0, 0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    scene.add(ts.forces.Spring(bob, scene.ground, point_b=(1, 0, 1), stiffness=1.0, damping=0.0, name="spring"))
    table = {"spring.damping": np.concatenate((np.geomspace(1e-3, 1e7, CASES), [0.0]))}
    found, one = (ts.ensemble(scene, table, (0, 0.05), lanes=n, threads=1) for n in (4, 1))
    assert found.status.tolist() == one.status.tolist()
    np.testing.assert_allclose(found.q, one.q, rtol=0, atol=1e-6)
    alone = (found.q == one.q).all(axis=1)
    assert alone.any()
    assert not alone.all()


def pushed():
    """A body under a load of time."""
    scene = spring()
    scene.add(ts.forces.PointForce(scene.bodies[0], force=lambda t: (t, 0.0, 0.0), name="wind"))
    return scene


def redundant():
    """A door on two hinges."""
    scene = ts.Scene()
    door = scene.add_body(1.0, (0.1, 0.1, 0.1), position=(0.5, 0, 0), name="rod 0")
    for z in (0.0, 1.0):
        scene.add(ts.constraints.Revolute.at(scene.ground, door, point=(0, 0, z), axis=(0, 0, 1)))
    return scene


REFUSED = {
    "lanes must be one of 1, 4, got 3": (spring, {"lanes": 3}),
    "lanes must be one of 1, 4, got True": (spring, {"lanes": True}),
    "the method is DOP853": (spring, {"integrator": "dop853"}),
    "a fixed step": (spring, {"integrator": ts.integrators.Taylor(step=0.01)}),
    "events can't be served": (spring, {"events": lambda t, state: 1.0}),
    "dense_output can't": (spring, {"dense_output": True}),
    "a function keep=": (spring, {"keep": lambda solution: 1.0}),
    "function of the case": (spring, {"parameters": lambda i: {"rod 0.mass": 1.0}, "cases": 4}),
    "assemble= can't": (spring, {"assemble": True}),
    "max_steps can't": (spring, {"max_steps": 100}),
    "chart_interval=3 can't be served in lanes": (spring, {"chart_interval": 3}),
    "formulation='null-space' and redundancy='refuse' can't": (
        spring, {"formulation": "null-space", "redundancy": "refuse"},
    ),
    "wind is a function of time": (pushed, {}),
    "some rows are redundant": (redundant, {}),
}  # fmt: skip


@pytest.mark.parametrize("message", REFUSED)
def test_what_lanes_cannot_serve_is_refused_by_name(message):
    build, options = REFUSED[message]
    given = {"parameters": {"rod 0.mass": uniform()}, "t_span": (0, 0.1), "lanes": 4, **options}
    with pytest.raises(ts.TsdynError, match=message):
        ts.ensemble(build(), **given)


@pytest.mark.slow
def test_a_store_and_a_file_say_how_many_lanes(tmp_path):
    scene, path = spring(), tmp_path / "study.h5"
    table = {"spring.stiffness": 20 * uniform()}
    found = ts.ensemble(scene, table, (0, 0.1), lanes=4, store=path, **SHORT)
    assert found.lanes == ts.load(found.save(tmp_path / "saved.h5")).lanes == 4
    resumed = ts.ensemble(scene, table, (0, 0.1), lanes=4, store=path, resume=True, **SHORT)
    assert resumed.q[:].tobytes() == found.q[:].tobytes()
    with pytest.raises(ts.TsdynError, match="another ensemble"):
        ts.ensemble(scene, table, (0, 0.1), store=path, resume=True, **SHORT)
