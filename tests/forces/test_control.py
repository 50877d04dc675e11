"""Laws that see the whole scene: Control, point loads and user forces by its state; traced, called, sampled."""

import math
import os
import pickle
import signal
import threading

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.linalg import solve_continuous_are

import tsdyn as ts
from examples import active_suspension, swing_up
from tests.helpers.methods import one_of_each
from tests.helpers.tolerances import ALGEBRA, CLOSE, EPS, FINE, HELD, LOOSE, NEAR, ROUGH, ROUNDING, TIGHT

C, F = ts.constraints, ts.forces
K = np.array([2.0, 60.0, 4.0, 8.0])
METHODS = one_of_each(tol=1e-10, step=0.002) | {"radau": {"integrator": ts.integrators.Radau(1e-9, 1e-9)}}


def cart(force=None, angle=0.1):
    """A rod on a cart; force: a function of the scene that makes one."""
    scene = ts.Scene()
    body = scene.add_body(**ts.shapes.box((0.4, 0.2, 0.1), mass=2.0), name="cart")
    rod = scene.add_body(**ts.shapes.rod(0.5, axis="z", mass=0.3), position=(0, 0, 0.25), name="rod")
    scene.add(C.Translational.at(scene.ground, body, point=(0, 0, 0), axis=(1, 0, 0), name="rail"))
    scene.add(C.Revolute.at(body, rod, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    if force is not None:
        scene.add(force(scene))
    scene.set("hinge", angle=angle)
    return scene


def seen(state):
    x, angle = state.displacement("rail"), state.angle("hinge")
    return np.array([x, angle, state.displacement_rate("rail"), state.angle_rate("hinge")])


def balance(t, state, *, gain=1.0):
    return gain * (K @ seen(state))


def clipped(t, state, *, gain=1.0):
    return np.clip(gain * (K @ seen(state)), -1e3, 1e3)


def on_rail(function, **options):
    return lambda scene: F.Control(function, ["rail"], name="control", **options)


# Against what is known


@pytest.mark.slow_for("called")
@pytest.mark.parametrize("function", [balance, clipped], ids=["traced", "called"])
def test_poles_of_the_closed_loop_are_those_of_A_and_B_K(function):
    A, B = cart(angle=0.0).linearise(inputs=["rail"]).state_space()[:2]
    poles = cart(on_rail(function), angle=0.0).linearise().eigenvalues()
    expected = np.linalg.eigvals(A + np.outer(B, K))
    assert np.abs(np.sort_complex(poles) - np.sort_complex(expected)).max() < FINE


@pytest.mark.slow
def test_cost_of_the_regulator_is_that_of_the_riccati_equation():
    A, B = swing_up.build().linearise(inputs=["rail"]).state_space()[:2]
    Q, R = swing_up.COST, swing_up.EFFORT
    P = solve_continuous_are(A, B, Q, R)
    gains = np.linalg.solve(R, B.T @ P)
    scene = swing_up.build()
    scene.add(F.Control(lambda t, state: -gains @ swing_up.seen(state), ["rail"], name="regulator"))
    scene.set("hip", angle=2e-5)
    scene.set("knee", angle=-1e-5)
    t = np.linspace(0.0, 20.0, 4001)
    run = ts.simulate(scene, (0, 20), t_eval=t, rtol=1e-10, atol=1e-14)
    states = [run.displacement("rail"), *map(run.angle, swing_up.JOINTS)]
    x = np.column_stack([*states, run.displacement_rate("rail"), *map(run.angle_rate, swing_up.JOINTS)])
    u = run.actuation("regulator")
    rates = np.einsum("ki,ij,kj->k", x, Q, x) + np.einsum("ki,ij,kj->k", u, R, u)
    cost = trapezoid(rates, t)
    assert abs(cost / (x[0] @ P @ x[0]) - 1.0) < LOOSE


def test_a_suspension_with_another_law_fails_the_check():
    with pytest.raises(AssertionError):
        active_suspension.check(active_suspension.run(1.01 * active_suspension.SKYHOOK))


def test_a_joint_and_a_point_are_pushed_alike():
    def push(t, state):
        return balance(t, state), 0.0, 0.0

    runs = [
        ts.simulate(cart(make), (0, 1)) for make in (on_rail(balance), lambda s: F.PointForce(s["cart"], force=push))
    ]
    assert np.abs(runs[0].q[-1] - runs[1].q[-1]).max() < ALGEBRA
    (joint, point) = (run.power for run in runs)
    assert np.abs(joint - point).max() < NEAR * np.abs(joint).max()


def test_every_actuator_is_the_force_that_it_is_named_after():
    """By a Control, against JointForce, JointTorque, Spring, PointForce and Torque with the same numbers."""

    def scene_of(controlled):
        scene = cart(angle=0.3)
        dot = scene.add_point_mass(mass=1.0, position=(0.5, 0.4, 0.8), name="dot")
        spring = scene.add(F.Spring(scene["rod"], dot, point_a=(0, 0, 0.1), stiffness=20.0, name="spring"))
        push = F.PointForce(scene["rod"], force=(1, 2, 3), point_a=(0.1, 0.2, 0.3), frame="body", name="push")
        turn = F.Torque(scene["cart"], torque=(0.3, 0.1, 0.2), name="turn")
        if controlled:
            actuators = ["rail", scene["hinge"], ("hinge", "angle"), spring, push, turn]
            scene.add(F.Control(lambda t, state: [1.0, 2.0, 0.5, 3.0, 4.0, 5.0], actuators))
            return scene
        spring.actuator = 3.0
        scene.add(F.JointForce(scene["rail"], function=lambda t, x, v: 1.0))
        scene.add(F.JointTorque(scene["hinge"], function=lambda t, x, v: 2.5))
        push.force, turn.torque = 4.0 * push.force, 5.0 * turn.torque
        scene.add(push)
        scene.add(turn)
        return scene

    controlled, alone = (scene_of(controlled).evaluate().qdd for controlled in (True, False))
    assert np.abs(controlled - alone).max() < HELD * np.abs(alone).max()


@pytest.mark.slow
def test_user_force_of_the_scene_acts_and_reacts():
    def pull(t, state, par, out):
        d = state.position("b") - state.position("a", (0.1, 0, 0))
        out[:3] = par[0] * d
        out[3:] = -0.1 * state.velocity("b")

    def pull_by_arrays(t, a, b, par, out):
        for i in range(3):
            out[i] = par[0] * (b[i] - a[i])
            out[3 + i] = -0.1 * b[7 + i]

    found = []
    for function in (pull, pull_by_arrays):
        scene = ts.Scene()
        a = scene.add_body(1.0, (1, 2, 2.5), angular_velocity=(1, 2, 3), name="a")
        b = scene.add_body(2.0, (1, 1, 1), position=(1, 2, 3), velocity=(1, 0, 2), name="b")
        scene.add(F.UserForce(a, b, function=function, point_a=(0.1, 0, 0), parameters=(2.0,)))
        found.append(scene.evaluate().qdd)
    assert np.abs(found[0] - found[1]).max() < ALGEBRA * np.abs(found[0]).max()


@pytest.mark.slow
def test_loads_of_the_scene_are_those_of_arrays(rng):
    """Random laws of point loads in both frames, on a rigid body and on a point mass."""
    w = rng.normal(size=13)

    def by_array(t, x):
        return w[0] * x[0] + w[4] * x[4] + w[8] * x[8], w[1] * x[1] * x[12], w[3] * x[3] + t * w[9] * x[9]

    def of(name, point):
        def by_state(t, state):
            rigid = name == "a"
            p = state.orientation(name) if rigid else np.array([1.0, 0.0, 0.0, 0.0])
            omega = state.rotation(name) @ state.angular_velocity(name) if rigid else np.zeros(3)
            x = np.concatenate([state.position(name, point), p, state.velocity(name, point), omega])
            return by_array(t, x)

        return by_state

    point, frames, found = rng.normal(size=3), ("ground", "body"), []
    q = rng.normal(size=4)
    for whole in (False, True):
        scene = ts.Scene()
        a = scene.add_body(1.0, (1, 1.1, 1.2), (1, 2, 3), q / np.linalg.norm(q), (3, 2, 1), (1, 2, 3), name="a")
        dot = scene.add_point_mass(1.0, (3, 1, 2), (1, 0, 1), name="dot")
        for frame in frames:
            scene.add(F.PointForce(a, force=of("a", point) if whole else by_array, point_a=point, frame=frame))
            scene.add(F.Torque(a, torque=of("a", (0, 0, 0)) if whole else by_array, frame=frame))
        scene.add(F.PointForce(dot, force=of("dot", (0, 0, 0)) if whole else by_array))
        found.append(scene.evaluate(t=0.3).qdd)
    assert np.abs(found[0] - found[1]).max() < ALGEBRA * np.abs(found[0]).max()


# All methods and forms


@pytest.mark.slow_but("traced-dop853", "called-dop853", "traced-taylor")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("function", [balance, clipped], ids=["traced", "called"])
def test_methods_agree(function, options):
    reference = ts.simulate(cart(on_rail(balance)), (0, 1), rtol=1e-12, atol=1e-12)
    if function is clipped and options is METHODS["taylor"]:
        with pytest.raises(ts.TsdynError, match="can't be traced, it compares"):
            ts.simulate(cart(on_rail(function)), (0, 1), **options)
        return
    run = ts.simulate(cart(on_rail(function)), (0, 1), **options).raise_if_failed()
    assert np.abs(run.q[-1] - reference.q[-1]).max() < ROUGH
    assert max(error.max() for error in run.constraint_error) < HELD


@pytest.mark.slow
@pytest.mark.parametrize("form", ["null-space", "maggi-kane"])
def test_formulations_agree(form):
    reference = ts.simulate(cart(on_rail(balance)), (0, 1), rtol=1e-12, atol=1e-12)
    for method in ("dop853", "sdirk54"):
        if (form, method) != ("maggi-kane", "sdirk54"):
            run = ts.simulate(cart(on_rail(balance)), (0, 1), integrator=method, formulation=form)
            assert np.abs(run.q[-1] - reference.q[-1]).max() < ROUGH


def test_a_tension_through_zero_length_has_no_series():
    """A ball flies through the anchor of its actuator, where the direction turns at once."""
    scene = ts.Scene(gravity=(0, 0, 0))
    ball = scene.add_point_mass(mass=2.0, position=(1, 0, 0), velocity=(-1, 0, 0), name="ball")
    scene.add(F.Spring(ball, scene.ground, stiffness=1.0, free_length=0.0, name="cord"))
    scene.add(F.Control(lambda t, state: 0.6, ["cord"]))
    with pytest.raises(ts.TsdynError, match="may change within any part of a step"):
        ts.simulate(scene, (0, 1), integrator="taylor")
    # 2 x'' = -x - 0.6 before zero, from where on the tension pulls back: + 0.6
    run, w = ts.simulate(scene, (0, 1.6), rtol=1e-9, atol=1e-9), np.sqrt(0.5)
    t = (np.arccos(0.6 / np.hypot(1.6, 1.0 / w)) - np.arctan2(1.0 / w, 1.6)) / w
    speed = -1.6 * w * np.sin(w * t) - np.cos(w * t)
    expected = 0.6 - 0.6 * np.cos(w * (1.6 - t)) + speed / w * np.sin(w * (1.6 - t))
    assert abs(run.position("ball")[-1, 0] - expected) < ROUGH


@pytest.mark.parametrize("function", [balance, clipped], ids=["traced", "called"])
def test_power_is_the_gain_in_energy(function):
    run = ts.simulate(cart(on_rail(function)), (0, 1), t_eval=np.linspace(0, 1, 401), rtol=1e-10, atol=1e-10)
    rate = np.gradient(run.energy, run.t, edge_order=2)
    assert np.abs(rate - run.power)[2:-2].max() < 1e-3 * np.abs(run.power).max()
    assert np.abs(run.power - run.actuation("control")[:, 0] * run.displacement_rate("rail")).max() < HELD


def test_angles_count_turns():
    def wind(t, state):
        return 1.0 - 0.1 * state.angle("hinge")  # N m

    scene = ts.Scene(gravity=(0, 0, 0))
    wheel = scene.add_body(1.0, (1, 1, 1), name="wheel")
    scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    scene.add(F.Control(wind, ["hinge"]))
    scene.set("hinge", angle=-30.0)
    run = ts.simulate(scene, (0, 20), t_eval=np.linspace(0, 20, 101))
    assert np.abs(run.angle("hinge") - (10.0 - 40.0 * np.cos(np.sqrt(0.1) * run.t))).max() < ROUGH
    half = ts.simulate(scene, (0, 7))
    rest = ts.simulate(scene, (7, 20), state=half.state)
    assert abs(rest.angle("hinge")[-1] - run.angle("hinge")[-1]) < ROUGH


# Sample and hold


def test_values_are_held_between_samples():
    times = []

    def sampled(t, state):
        times.append(t)
        return balance(t, state)

    scene = cart(on_rail(sampled, period=0.01))
    run = ts.simulate(scene, (0, 0.2))
    assert np.abs(np.array(times) - 0.01 * np.arange(len(times))).max() < 4 * EPS
    assert len(times) == 20
    u = run.actuation("control")[:, 0]
    inside = np.unique(u[np.floor(run.t / 0.01 + 1e-9) == 7])
    assert inside.size == 1
    half = ts.simulate(scene, (0, 0.1))
    assert np.abs(ts.simulate(scene, (0.1, 0.2), state=half.state).q[-1] - run.q[-1]).max() < HELD


def test_controls_add_up():
    def half(t, state):
        return 0.5 * balance(t, state)

    scene = cart(lambda s: F.Control(half, ["rail"], name="one"))
    scene.add(F.Control(half, ["rail"], name="other"))
    scene.add(F.Control(clipped, ["hinge"], period=0.1, name="held"))
    scene.add(F.Control(lambda t, state: -clipped(0.1 * np.floor(10.0 * t + 1e-9), state), ["hinge"], period=0.1))
    whole = cart(on_rail(balance))
    runs = [ts.simulate(each, (0, 0.5)) for each in (scene, whole)]
    assert np.abs(runs[0].q[-1] - runs[1].q[-1]).max() < NEAR
    assert np.abs(runs[0].actuation("one") - runs[0].actuation("other")).max() == 0.0


def test_an_interrupt_within_a_law_keeps_what_was_computed():
    pressed = []

    def stops(t, state):
        if state.displacement("rail") > 0.02 and not pressed:
            pressed.append(True)
            raise KeyboardInterrupt
        return K @ seen(state)

    run = ts.simulate(cart(on_rail(stops)), (0, 1), integrator="dop853")
    assert run.status.name == "INTERRUPTED"
    assert 0.0 < run.displacement("rail")[-1] < 0.02


@pytest.mark.parametrize("task", ["run", "read"])
def test_ctrl_c_in_a_kernel_that_calls_a_law_is_answered(task):
    """Each Ctrl-C ends what it came in, and leaves nothing behind; most come while the kernel computes."""
    begun, given_up = threading.Event(), threading.Event()

    def begin():
        if not begun.is_set():  # set() takes a lock, which Ctrl-C must not meet
            begun.set()

    def law(t, state):
        if task == "read":
            begin()
        return np.clip(K @ seen(state), -1e3, 1e3)

    def press():
        begun.wait()
        if not given_up.wait(0.005):
            os.kill(os.getpid(), signal.SIGINT)

    scene = cart(on_rail(law))
    options = {"integrator": ts.integrators.RK45(rtol=1e-6), "dense_output": task == "read"}
    whole = ts.simulate(scene, (0, 2), **options)
    for _ in range(3):
        begun.clear()
        thread = threading.Thread(target=press)
        thread.start()
        try:
            if task == "run":
                run = ts.simulate(scene, (0, 2000), progress=lambda *_: begin(), **options)
                assert run.status is ts.Status.INTERRUPTED
                assert np.isfinite(run.q).all()
            else:
                with pytest.raises(KeyboardInterrupt):
                    whole.at(np.linspace(0, 2, 100_000))
        finally:
            given_up.set()
            begun.set()
            thread.join()
            given_up.clear()
    again = ts.simulate(scene, (0, 2), **options)
    np.testing.assert_array_equal(again.q, whole.q)


# Bits


@pytest.mark.slow_for("called")
@pytest.mark.parametrize("function", [balance, clipped], ids=["traced", "called"])
def test_ensembles_have_the_bits_of_runs_alone(function):
    scene, gains = cart(on_rail(function)), np.linspace(0.8, 1.4, 4)
    ensemble = ts.ensemble(scene, {"control.function.gain": gains}, (0, 0.5), integrator="dop853", threads=2)
    for gain, q in zip(gains, ensemble.q, strict=True):
        alone = scene.with_parameters({"control.function.gain": gain})
        assert (ts.simulate(alone, (0, 0.5), integrator="dop853").q[-1] == q).all()
    assert np.ptp(ensemble.q, axis=0).max() > LOOSE


def test_an_input_is_found_in_a_scene_with_other_numbers():
    B = [cart().with_parameters({"cart.mass": mass}).linearise(inputs=["rail"]).state_space()[1] for mass in (2.0, 4.0)]
    assert np.abs(B[0] - cart().linearise(inputs=["rail"]).state_space()[1]).max() < ROUNDING
    assert np.abs(B[0] - B[1]).max() > 0.1


def test_a_joint_that_is_moved_by_a_parameter_moves_in_the_law():
    def watch(t, state):
        return state.displacement("rail")

    scene = cart(lambda s: F.Control(watch, ["hinge"], name="control"))
    moved = scene.with_parameters({"rail.point_b": (-0.5, 0, 0)})
    for each in (scene, moved):
        run = ts.simulate(each, (0, 0.1), initial_tol=1.0)
        assert np.abs(run.actuation("control")[:, 0] - run.displacement("rail")).max() < TIGHT
        forces = each.evaluate(run.q[-1], run.qd[-1]).Q_A
        assert abs(forces @ run.qd[-1] - run.power[-1] - 0.0) < CLOSE + abs(9.81 * 2.3 * np.abs(run.qd[-1]).max())


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"period": 0.01}], ids=["continuous", "sampled"])
@pytest.mark.parametrize("function", [balance, clipped], ids=["traced", "called"])
def test_checkpoints_pickles_and_files(function, options, tmp_path):
    scene = cart(on_rail(function, **options))
    run = ts.simulate(scene, (0, 0.5), integrator="dop853")
    ts.simulate(scene, (0, 0.5), integrator="dop853", store=tmp_path / "run.zarr", checkpoint=1e-4)
    assert (ts.resume(tmp_path / "run.zarr", scene=scene).q[-1] == run.q[-1]).all()
    assert (ts.simulate(pickle.loads(pickle.dumps(scene)), (0, 0.5), integrator="dop853").q[-1] == run.q[-1]).all()
    assert (ts.simulate(scene.copy(), (0, 0.5), integrator="dop853").q[-1] == run.q[-1]).all()
    run.save(tmp_path / "solution.zarr")
    saved = ts.load(tmp_path / "solution.zarr")
    assert (saved.energy == run.energy).all()
    with pytest.raises(ts.TsdynError, match=r"solution\.actuation needs the scene"):
        saved.actuation("control")
    with pytest.raises(ts.TsdynError, match="holds data and no code"):
        scene.save(tmp_path / "scene.toml")


def test_a_function_may_hold_handles_in_a_copy():
    scene = cart()
    rail, body = scene["rail"], scene["cart"]
    scene.add(F.Control(lambda t, state: -3.0 * state.displacement(rail) + state.position(body)[0], [rail]))
    runs = [
        ts.simulate(each, (0, 0.2)).q[-1] for each in (scene, scene.copy(), scene.with_parameters({"rod.mass": 0.3}))
    ]
    assert (runs[0] == runs[1]).all()
    assert (runs[0] == runs[2]).all()


def test_a_run_says_how_the_law_is_called():
    said = [
        str(ts.prepare(cart(on_rail(f, **o)))) for f, o in ((balance, {}), (clipped, {}), (clipped, {"period": 0.1}))
    ]
    assert "control is traced and runs compiled" in said[0]
    assert "control is called in Python at each evaluation: it compares values" in said[1]
    assert "control is called in Python every 0.1 s" in said[2]


GAIN = 1.0


def test_a_law_follows_what_it_reads(monkeypatch):
    """A global that is changed, an array that is written to, an object that may change."""
    rows = np.array([1.0])
    box = {"gain": 1.0}
    scenes = [
        cart(on_rail(function), angle=0.0)
        for function in (lambda t, state: GAIN, lambda t, state: rows[0], lambda t, state: box["gain"])
    ]
    first = [ts.simulate(scene, (0, 0.1)).displacement("rail")[-1] for scene in scenes]
    monkeypatch.setitem(globals(), "GAIN", 3.0)
    rows[0] = box["gain"] = 3.0
    for before, scene in zip(first, scenes, strict=True):
        assert abs(ts.simulate(scene, (0, 0.1)).displacement("rail")[-1] - 3.0 * before) < ROUGH


# Wrong laws


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda t, state: (1.0, 2.0), "must give 1 number, one for each actuator; it gave 2"),
        (lambda t, state: state.angle("hing"), "^control: its function can't .* did you mean 'hinge'"),
        (lambda t, state: state.angle("rail"), "^control: its function can't .* has no angle"),
        (lambda t, state: state.position("card")[0], "no body is named 'card'; did you mean 'cart'"),
        (lambda t, state: state.acceleration("cart")[0], "accelerations and reactions follow from forces"),
        (lambda t, state: state.reaction("hinge")[0][0], "accelerations and reactions follow from forces"),
        (lambda t, state: state[0], "that of the scene and has no numbers by index"),
        (lambda t, state: state.angel("hinge"), "^control: .*'State' object has no .*'angel'; did you mean angle"),
        (lambda t, state: state.length("spring"), r"no attribute 'length'; see dir\(state\)"),
        (lambda t, state: undefined_name, "NameError"),  # noqa: F821
        (lambda t, state: None, "must give 1 number, one for each actuator; it gave None"),
        (lambda t, state: "1", "it gave '1'"),
        (lambda t: 0.0, r"function of two arguments \(t, state\)"),
        (3.0, r"function of \(t, state\), such as lambda t, state: 5\.0, got 3\.0"),
    ],
)
def test_wrong_functions_are_refused_where_they_are_added(function, said):
    with pytest.raises(ts.TsdynError, match=said):
        cart(on_rail(function))


def test_a_constant_torque_of_a_joint_is_a_function():
    with pytest.raises(ts.InvalidForce, match=r"such as lambda t, x, v: 5\.0, got 5\.0"):
        F.JointTorque(cart()["hinge"], function=5.0)


def _others(scene):
    return cart()["rail"]


@pytest.mark.parametrize(
    ("actuators", "said"),
    [
        (lambda s: [], "actuators must be a list of one or more"),
        (lambda s: "rail", "actuators must be a list of one or more"),
        (
            lambda s: ["rial"],
            "no spring, or joint with an angle or a displacement, is named 'rial'; did you mean 'rail'",
        ),
        (lambda s: ["cart"], "is named 'cart'; there are 'rail', 'hinge'\\.$"),
        (lambda s: [s["rail"], _others(s)], "belongs to another scene"),
        (lambda s: [_others(s)], "belong to another scene|belongs to another scene"),
        (lambda s: [("rail", "angle")], "has the coordinates"),
        (
            lambda s: [s.add(F.TorsionalSpring(s["cart"], s["rod"], axis_a=(0, 1, 0), stiffness=1.0))],
            "is a force, whose coordinates",
        ),
        (lambda s: [(s.add(F.Spring(s["cart"], s["rod"], stiffness=1.0)), "angle")], "is a force, whose coordinates"),
        (lambda s: [7], "is none"),
        (lambda s: [()], "is none"),
        (lambda s: [s["cart"]], "is none"),
        (lambda s: [(s["cart"], "position")], "is none"),
        (lambda s: ["cart"], "a displacement, is named 'cart'; there are 'rail', 'hinge'.$"),
        (lambda s: [C.Revolute(s["cart"], s["rod"], axis_a=(0, 1, 0), axis_b=(0, 1, 0))], "add its actuator"),
        (lambda s: [s.add(F.PointForce(s["cart"], force=(1, 0, 0)))], "must not be added itself"),
        (lambda s: [F.Torque(s["cart"], torque=lambda t: (t, 0, 0))], "must have a constant vector"),
    ],
)
def test_wrong_actuators_are_refused(actuators, said):
    with pytest.raises(ts.TsdynError, match=said):
        cart(lambda s: F.Control(lambda t, state: [0.0] * max(len(actuators(s)), 1), actuators(s)))


@pytest.mark.parametrize("value", [math.nan, -math.inf])
def test_a_law_without_finite_values_is_named_when_it_is_run(value):
    for law in (
        on_rail(lambda t, state: value),
        on_rail(lambda t, state: value * state.angle("hinge")),
        lambda s: F.PointForce(
            s["cart"], force=lambda t, state: (value, 0.0 * state.angle("hinge"), 0.0), name="control"
        ),
    ):
        with pytest.raises(ts.InconsistentState, match="'control' is inf or nan at t = 0 s"):
            ts.simulate(cart(law), (0, 1))


def test_what_a_force_of_the_state_must_give_is_said_without_actuators():
    with pytest.raises(ts.InvalidForce, match=r"must give 3 numbers; it gave 2\.$"):
        cart(lambda s: F.PointForce(s["cart"], force=lambda t, state: state.position("rod")[:2]))


@pytest.mark.parametrize("period", [None, 0.05])
def test_what_a_law_raises_ends_the_run(period):
    def breaks(t, state):
        return 1.0 / (0.0 if t > 0.3 else 1.0)

    run = ts.simulate(cart(on_rail(breaks, period=period)), (0, 1))
    assert not run.success
    assert 0.0 < run.t[-1] < 0.4
    assert "control" in run.message
    assert "ZeroDivisionError" in run.message


def test_a_value_that_is_not_finite_is_named():
    run = ts.simulate(cart(on_rail(lambda t, state: np.sqrt(0.3 - t))), (0, 1), integrator="dop853")
    assert not run.success
    assert "'control' is inf or nan" in run.message
    with pytest.raises(ts.InconsistentState, match="'control' is inf or nan"):
        ts.simulate(cart(on_rail(lambda t, state: np.nan)), (0, 1))


@pytest.mark.slow
def test_arrays_stay_for_functions_that_ask_no_method():
    def array(t, state):
        return -state[7], 0.0, 0.0

    def whole(t, state):
        return -state.velocity("cart")[0], 0.0, 0.0

    def helped(t, state):
        return whole(t, state)

    def listed(t, state):
        (v,) = (-state.velocity(name) for name in ("cart",))
        return v[0], 0.0, 0.0

    functions = array, whole, helped, listed
    scenes = [cart(lambda s, f=f: F.PointForce(s["cart"], force=f, name="drag")) for f in functions]
    first, *others = (ts.simulate(scene, (0, 1)) for scene in scenes)
    assert all(np.abs(first.q[-1] - other.q[-1]).max() < NEAR for other in others)
    scene = cart(lambda s: F.PointForce(s["cart"], force=whole, name="drag"))
    with pytest.raises(ts.TsdynError, match="of the state of the scene"):
        scene["drag"].force = array

    class Law:
        def __call__(self, t, state):
            return state.velocity("cart")

    law = Law()
    with pytest.raises(ts.TsdynError, match=r"Its state is the array \(13,\) of its body"):
        cart(lambda s: F.PointForce(s["cart"], force=lambda t, state: law(t, state)))
