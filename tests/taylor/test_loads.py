"""Loads that are functions of time, data, or functions of time and state: their series against laws and stages."""

import math

import numpy as np
import pytest

import tsdyn as ts

C, F, I, M = ts.constraints, ts.forces, ts.integrators, ts.motions
SAME = 1e-12


def arm(links=1):
    """Links on pins, released from the horizontal."""
    scene, last = ts.Scene(gravity=(0, 0, -10)), None
    for i in range(links):
        link = scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(i + 0.5, 0, 0))
        scene.add(C.Revolute.at(last or scene.ground, link, point=(i, 0, 0), axis=(0, 1, 0), name=f"pin {i}"))
        last = link
    return scene, link


def wave(t):
    return 2.0 * math.sin(3.0 * t)


def three(t):
    return np.sin(t), 0.3 * np.cos(2.0 * t) ** 2, math.exp(-t)


@ts.kernel
def squared(x):
    return x * x


def drag(t, a, b, par, out):
    v = math.sqrt(squared(a[7]) + squared(a[8]) + squared(a[9]) + 0.01)
    for i in range(3):
        out[i] = -par[0] * v * a[7 + i] + np.sin(2.0 * t) * a[4 + i]
        out[3 + i] = -par[1] * a[10 + i]


def tether(t, a, b, par, out):
    d = np.zeros(3)
    for i in range(3):
        d[i] = a[i] - b[i]
    length = np.linalg.norm(d)
    out[:3] = -par[0] * (length - 1.0) * d / length


def cubic(t, state):
    return -0.3 * state[7] - state[0] ** 3, 0.0, 0.5 * np.tanh(state[9])


def control(t, x, rate):
    return 5.0 * (math.sin(t) - x) - 0.5 * rate


TIMES = np.linspace(0.0, 5.0, 11)
TABLE = ts.Table(TIMES, np.sin(3.0 * TIMES))
TABLES = ts.Table(TIMES, np.stack([np.sin(TIMES), np.cos(TIMES), TIMES], axis=1))
LOADS = {
    "actuator": lambda a, b: F.Spring(a, b, stiffness=30.0, damping=1.0, point_b=(0, 0, 3), actuator=wave),
    "motion": lambda a, b: F.Spring(a, b, stiffness=30.0, point_b=(0, 0, 3), actuator=5.0 * np.sin(4.0 * M.time)),
    "table": lambda a, b: F.Spring(a, b, stiffness=30.0, point_b=(0, 0, 3), actuator=TABLE),
    "torsional": lambda a, b: F.TorsionalSpring(b, a, axis_a=(0, 1, 0), stiffness=3.0, damping=0.1, actuator=wave),
    "torque": lambda a, b: F.Torque(a, torque=three),
    "tables": lambda a, b: F.Torque(a, torque=TABLES),
    "body": lambda a, b: F.PointForce(a, force=three, frame="body", point_a=(0.5, 0, 0)),
    "user": lambda a, b: F.UserForce(a, b, function=drag, parameters=(0.2, 0.1), point_a=(0.5, 0, 0)),
    "arrays": lambda a, b: F.UserForce(a, b, function=tether, parameters=(20.0,), point_b=(0, 0, 3)),
    "friction": lambda a, b: F.CoulombFriction(a, b, torque=0.5, slip_rate=0.1),
    "state": lambda a, b: F.PointForce(a, force=cubic),
    "state, body": lambda a, b: F.PointForce(a, force=cubic, frame="body"),
    "state, torque": lambda a, b: F.Torque(a, torque=cubic),
}
SLOW = ("motion", "tables", "body", "state", "state, body", "state, torque", "torsional")


CHECKED = {name: make for name, make in LOADS.items() if name != "arrays"}  # truncated series are no vectors' elements


@pytest.mark.slow_for(*SLOW, "user")
@pytest.mark.parametrize("make", CHECKED.values(), ids=CHECKED)
def test_series_of_loads_are_those_of_their_laws(make):
    ts.testing.check_force(make)


@pytest.mark.slow_for(*SLOW, "arrays", "user")
@pytest.mark.parametrize("make", LOADS.values(), ids=LOADS)
def test_motions_by_series_are_those_by_stages(make):
    scene, link = arm()
    scene.add(make(link, scene.ground))
    one, other = (ts.simulate(scene, (0, 1), integrator=kind(rtol=1e-13, atol=1e-13)) for kind in (I.Taylor, I.DOP853))
    assert np.abs(one.state.q - other.state.q).max() < SAME
    assert ts.simulate(scene, (0, 0.1)).method.startswith("Taylor")


@pytest.mark.slow
@pytest.mark.parametrize("make", [F.JointTorque, F.JointForce])
def test_control_laws_of_joints(make):
    scene = ts.Scene(gravity=(0, 0, -10))
    body = scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0.5, 0, 0))
    kind = C.Revolute if make is F.JointTorque else C.Translational
    joint = scene.add(kind.at(scene.ground, body, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(make(joint, function=control))
    one, other = (ts.simulate(scene, (0, 5), integrator=kind(rtol=1e-13, atol=1e-13)) for kind in (I.Taylor, I.DOP853))
    assert np.abs(one.state.q - other.state.q).max() < SAME


def test_instances_with_and_without_a_load_of_time():
    """Of one kind, mixed: constants keep the series of constants."""
    scene, link = arm(2)
    for actuator in (1.0, wave, TABLE, 2.0):
        scene.add(F.Spring(link, scene.ground, stiffness=5.0, point_b=(0, 0, 3), actuator=actuator))
    one, other = (ts.simulate(scene, (0, 1), integrator=kind(rtol=1e-13, atol=1e-13)) for kind in (I.Taylor, I.DOP853))
    assert np.abs(one.state.q - other.state.q).max() < SAME


# laws that series don't follow everywhere


def resist(t, a, b, par, out):
    v = np.sqrt(a[7] ** 2 + a[8] ** 2 + a[9] ** 2)
    for i in range(3):
        out[i] = -0.3 * v * a[7 + i]


def throw(speed):
    scene = ts.Scene(gravity=(0, 0, -10))
    ball = scene.add_point_mass(mass=1.0, velocity=(0, 0, speed))
    scene.add(F.UserForce(ball, function=resist))
    return scene


def height(speed, t):
    """Of a ball thrown upwards, past its highest point."""
    v, c = math.sqrt(10.0 / 0.3), math.sqrt(10.0 * 0.3)
    top = math.atan(speed / v) / c
    return math.log(1.0 + (speed / v) ** 2) / 0.6 - math.log(math.cosh(c * (t - top))) / 0.3


def test_a_law_with_a_kink_at_rest_is_followed_past_it():
    """Where v > 0, the series of |v| is v: it resists an upward motion only."""
    solution = ts.simulate(throw(5.0), (0, 3), integrator=I.Taylor(1e-12))
    assert solution.stats.rejected > 0
    assert solution.state.q[2] == pytest.approx(height(5.0, 3.0), abs=1e-10)


def test_series_begin_where_a_law_has_none():
    """From rest: |v| is divided by."""
    scene, link = arm()
    scene.add(F.UserForce(link, function=resist))
    expected = ts.simulate(scene, (0, 1), integrator=I.DOP853(rtol=1e-12, atol=1e-12)).state.q
    for method in ("taylor", None):
        solution = ts.simulate(scene, (0, 1), integrator=method)
        assert solution.method.startswith("Taylor")
        np.testing.assert_allclose(solution.state.q, expected, atol=1e-8)


def across(t, a, b, par, out):
    out[0] = -a[0] * (1.0 + np.sqrt(a[8] ** 2))


def test_the_default_method_serves_where_series_end():
    """The velocity across the slide is zero for ever, and |v| has no series there."""
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(1.0, (1, 1, 1), (0.3, 0, 0))
    scene.add(ts.constraints.Translational.at(scene.ground, body, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(F.UserForce(body, function=across))
    assert ts.simulate(scene, (0, 1), integrator="taylor").status == ts.Status.STEP_COLLAPSED
    solution = ts.simulate(scene, (0, 1))
    assert solution.method.startswith("DOP853")
    assert solution.state.q[0] == pytest.approx(0.3 * math.cos(1.0), abs=1e-8)


def test_a_pulse_is_not_stepped_over():
    pulse = 100.0 * np.exp(-(((M.time - 0.7) / 0.01) ** 2))
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(mass=1.0)
    scene.add(F.PointForce(mass, force=(pulse, 0.0, 0.0)))
    solution = ts.simulate(scene, (0, 1))
    assert solution.method.startswith("Taylor")
    assert solution.state.velocity(mass)[0] == pytest.approx(math.sqrt(math.pi), abs=1e-7)
