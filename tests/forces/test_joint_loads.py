"""Torques and forces of joints by time, coordinate and rate: sampled and held, continuous; work, states, failures."""

import math
import pickle

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.methods import one_of_each
from tests.helpers.tolerances import COARSE, FINE, HELD, LOOSE, NEAR, ROUGH, ROUNDING

C, F, I = ts.constraints, ts.forces, ts.integrators
PERIOD, INERTIA = 0.1, 2.0
METHODS = one_of_each(tol=1e-10, step=0.003)


class PID:
    """A controller with a memory."""

    def __init__(self, goal):
        self.goal = goal
        self.reset()

    def reset(self):
        self.integral, self.calls = 0.0, []

    def __call__(self, t, x, rate):
        self.calls.append((t, x, rate))
        self.integral += PERIOD * (self.goal - x)
        return 8.0 * (self.goal - x) - 3.0 * rate + 0.5 * self.integral


def exact(goal, count, mass):
    """Coordinate and rate at each instant, the motion between them being uniformly accelerated."""
    pid, x, v, found = PID(goal), 0.0, 0.0, []
    for k in range(count + 1):
        found.append((x, v))
        a = pid(k * PERIOD, x, v) / mass
        x, v = x + PERIOD * (v + 0.5 * PERIOD * a), v + PERIOD * a
    return np.array(found).T


def wheel(goal=1.0, **options):
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(1.0, (1, 1, INERTIA), name="wheel")
    hinge = scene.add(C.Revolute.at(scene.ground, body, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    options = {"function": PID(goal), "period": PERIOD} | options
    return scene, hinge, scene.add(F.JointTorque(hinge, **options, name="motor"))


def slider(goal=1.0, **options):
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(INERTIA, (1, 1, 1), name="block")
    guide = scene.add(C.Translational.at(scene.ground, body, point=(0, 0, 0), axis=(1, 2, 2), name="guide"))
    options = {"function": PID(goal), "period": PERIOD} | options
    return scene, guide, scene.add(F.JointForce(guide, **options, name="drive"))


@pytest.mark.slow_for("sdirk54")
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_a_controller_is_asked_at_its_instants_and_held(options):
    """A wheel that is turned by more than a turn: every method is as exact as the recursion of the sampled motion."""
    goal = 3.0 * np.pi
    scene, hinge, motor = wheel(goal)
    solution = ts.simulate(scene, (0.0, 3.0), dense_output=True, **options).raise_if_failed()
    x, v = exact(goal, 30, INERTIA)
    calls = np.array(motor.function.calls)
    assert len(calls) == 30
    np.testing.assert_allclose(calls[:, 0], PERIOD * np.arange(30), atol=ROUNDING)
    np.testing.assert_allclose(calls[:, 1:], np.stack([x, v], axis=1)[:30], atol=ROUGH)
    assert solution.angle(hinge)[-1] == pytest.approx(x[30], abs=ROUGH)
    assert solution.constraint_error.acceleration.max() < FINE
    at = np.isclose(solution.t[:, None], calls[:, 0], rtol=0.0, atol=HELD).any(axis=1)
    assert at.sum() == 30
    gains = solution.angular_acceleration("wheel")[at, 2]
    np.testing.assert_allclose(gains, np.diff(v) / PERIOD, atol=COARSE)
    np.testing.assert_allclose(solution.reaction(motor, on=scene.bodies[0])[1][at, 2], INERTIA * gains, atol=ROUGH)
    np.testing.assert_allclose(solution.power[at], INERTIA * gains * v[:30], atol=LOOSE)
    np.testing.assert_allclose(solution.energy, solution.work, atol=COARSE)
    state = solution.at(solution.t)
    np.testing.assert_allclose(state.qdd, solution.qdd, atol=ROUGH)


def test_a_force_along_a_guide():
    scene, guide, drive = slider()
    solution = ts.simulate(scene, (0.0, 2.0), t_eval=PERIOD * np.arange(21), dense_output=True).raise_if_failed()
    x, v = exact(1.0, 20, INERTIA)
    assert solution.method.startswith("Taylor")
    np.testing.assert_allclose(solution.displacement(guide), x, atol=HELD)
    np.testing.assert_allclose(solution.displacement_rate(guide), v, atol=HELD)
    np.testing.assert_allclose(solution.energy, solution.work, atol=HELD)
    assert scene.forces == (drive,)


def test_a_run_that_goes_on_holds_what_was_held():
    """It ends between instants; the controller, which is not reset, is asked at the next one."""
    scene, _, motor = wheel(30.0)
    whole = ts.simulate(scene, (0.0, 1.0), **METHODS["taylor"])
    first = ts.simulate(scene, (0.0, 0.43), **METHODS["taylor"])
    assert len(motor.function.calls) == 5
    for state in (first.state, first.state):
        integral = motor.function.integral
        rest = ts.simulate(scene, (0.43, 1.0), state=state, **METHODS["taylor"])
        assert [round(t, 9) for t, *_ in motor.function.calls[-5:]] == [0.5, 0.6, 0.7, 0.8, 0.9]
        if state is first.state:
            break
        motor.function.integral = integral
    np.testing.assert_allclose(rest.q[-1], whole.q[-1], atol=HELD)
    ts.simulate(scene, (0.0, 0.2), **METHODS["taylor"])
    assert len(motor.function.calls) == 2  # reset


def test_outputs_and_events_ask_nobody():
    scene, _, motor = wheel()
    plain = ts.simulate(scene, (0.0, 1.0), **METHODS["taylor"])
    count = len(motor.function.calls)
    other = ts.simulate(
        scene, (0.0, 1.0), t_eval=[0.05, 0.1, 0.77], events=lambda t, s: s.q[6] - 0.2, **METHODS["taylor"]
    )
    assert len(motor.function.calls) == count == 10
    np.testing.assert_array_equal(plain.steps.t, other.steps.t)
    np.testing.assert_array_equal(plain.qdd[plain.t == 0.1], other.qdd[other.t == 0.1])
    assert len(other.t_events[0]) == 1


def test_two_periods_and_a_table():
    """Their instants and knots are stops of one run."""
    scene, hinge, _ = wheel(function=lambda t, x, v: 1.0, period=0.25)
    scene.add(F.JointTorque(hinge, function=lambda t, x, v: -t, period=0.1, name="brake"))
    table = ts.Table([0.0, 0.33, 1.0], [0.0, 0.5, 0.0])
    scene.add(F.Torque(scene.bodies[0], torque=(0.0, 0.0, 2.0 * ts.motions.Piecewise(table))))
    solution = ts.simulate(scene, (0.0, 1.0), integrator=I.DOP853(1e-10, 1e-10)).raise_if_failed()
    assert {0.25, 0.33, 0.5, 0.75} < set(solution.t)
    held = sum(-0.1 * k * 0.1 for k in range(10))
    area = ts.motions.Piecewise(table).pieces[0]
    knots, c = area.knots, area.c
    pushed = 2.0 * sum((c[i, k] * h ** (k + 1) / (k + 1)) for i, h in enumerate(np.diff(knots)) for k in range(4))
    assert solution.angular_velocity("wheel")[-1, 2] == pytest.approx((1.0 + held + pushed) / INERTIA, abs=HELD)


def spring_and_damper(t, x, rate):
    return -4.0 * (x - 10.0) - 1.0 * rate + 0.5 * math.sin(t)


@pytest.mark.slow
@pytest.mark.parametrize("make", [wheel, slider])
def test_a_continuous_load(make):
    """By more than a turn: it is that of a spring, a damper and an actuator."""
    scene, joint, _ = make(function=spring_and_damper, period=None)
    solution = ts.simulate(scene, (0.0, 3.0), rtol=1e-10, atol=1e-10, dense_output=True).raise_if_failed()
    assert solution.method.startswith("Taylor")
    x = solution.angle(joint) if make is wheel else solution.displacement(joint)
    from scipy.integrate import solve_ivp

    expected = solve_ivp(
        lambda t, y: (y[1], spring_and_damper(t, *y) / INERTIA), (0.0, 3.0), (0.0, 0.0), "DOP853", solution.t,
        rtol=1e-12, atol=1e-12,
    ).y[0]  # fmt: skip
    np.testing.assert_allclose(x, expected, atol=NEAR)
    assert x.max() > 2.0 * np.pi
    np.testing.assert_allclose(solution.energy, solution.work, atol=ROUGH)


@pytest.mark.parametrize("name", ["taylor", "dop853"])
def test_a_controller_that_fails_ends_the_run(name):
    def failing(t, x, rate):
        return 1.0 if t < 0.45 else 1.0 / (t - t)

    scene, _, motor = wheel(function=failing)
    solution = ts.simulate(scene, (0.0, 1.0), **METHODS[name])
    assert not solution.success
    assert solution.reached == 0.5
    assert solution.status == ts.Status.SAMPLING_FAILED
    assert "motor: its function raised ZeroDivisionError at t = 0.5 s" in solution.message
    motor.function = lambda t, x, rate: "fast"
    with pytest.raises(ts.InvalidForce, match="must return a finite number; at t = 0 s it gave 'fast'"):
        ts.simulate(scene, (0.0, 1.0))


def test_copies_and_pickles_have_controllers_of_their_own():
    scene, _, motor = wheel()
    twin = scene.copy()
    ts.simulate(twin, (0.0, 0.5), **METHODS["taylor"])
    assert len(twin[motor].function.calls) == 5
    assert motor.function.calls == []
    solution = ts.simulate(scene, (0.0, 0.5), **METHODS["taylor"])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(solution)).power, solution.power)


def test_the_joint_says_where():
    """A geometry that is set later, the second axis of a universal joint, and what may not be set."""
    scene, hinge, motor = wheel(function=lambda t, x, rate: 1.0)
    with pytest.raises(ts.InvalidForce, match=r"axis is that of its joint 'hinge'"):
        motor.axis = (1, 0, 0)
    with pytest.raises(ts.InvalidArgument, match="what refers to it: motor"):
        scene.remove(hinge)
    scene = ts.Scene(gravity=(0, 0, 0))
    cross = scene.add_body(1.0, (2.0, 3.0, 4.0), name="cross")
    joint = scene.add(C.Universal.at(scene.ground, cross, point=(0, 0, 0), axis_a=(1, 0, 0), axis_b=(0, 1, 0)))
    scene.add(F.JointTorque(joint, function=lambda t, x, rate: 6.0, period=1.0, which=1))
    assert scene.evaluate().qdd[4:] == pytest.approx(0.0)  # nothing is held before a run
    solution = ts.simulate(scene, (0.0, 0.01))
    np.testing.assert_allclose(solution.angular_acceleration("cross")[0], (0.0, 2.0, 0.0), atol=HELD)


BAD = {
    "no angle": (lambda: F.JointTorque(slider()[1], function=PID(1), period=1.0), "one with angle"),
    "no joint": (lambda: F.JointForce("hinge", function=PID(1), period=1.0), "one with displacement"),
    "period": (lambda: wheel(period=0.0), "period"),
    "function": (lambda: wheel(function=3.0), "function of"),
    "object without period": (lambda: wheel(period=None), r"three arguments.*With period="),
    "which": (lambda: wheel(which=1), "which must be from 0 to 0"),
    "which as an array": (lambda: wheel(which=np.zeros(3)), "which must be from 0 to 0"),
    "too many": (lambda: ts.simulate(wheel(period=1e-9)[0], (0.0, 1.0)), "as many as a run may have"),
}


@pytest.mark.parametrize(("call", "words"), BAD.values(), ids=BAD)
def test_bad_loads(call, words):
    with pytest.raises(ts.TsdynError, match=words):
        call()
