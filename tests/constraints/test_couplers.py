"""Couplers of joint coordinates against closed forms, by every method; what they are made of, and what is refused."""

import pickle
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import tsdyn as ts
from tests.helpers.driven import METHODS, held, loose
from tests.helpers.tolerances import CLOSE, EPS, FAIR, NEAR, TIGHT
from tsdyn.observables.evaluate import constraint_arrays
from tsdyn.runs import driver

X, Y, Z = np.eye(3)
C = ts.constraints
RADAU = {"radau": {"integrator": "radau", "rtol": 1e-9, "atol": 1e-9}}
MAGGI = {"integrator": "dop853", "rtol": 1e-11, "atol": 1e-11, "formulation": "maggi-kane"}
every_method = pytest.mark.parametrize("options", (METHODS | RADAU).values(), ids=METHODS | RADAU)


def wheel(scene, parent, x, axis, inertia=0.5, **given):
    """A wheel on a hinge of a parent, with isotropic inertia."""
    body = scene.add_body(1.0, (inertia,) * 3, position=x, **given)
    name = f"hinge {body.name}"
    return body, scene.add(C.Revolute.at(parent, body, point=x, axis=axis, name=name))


def crossed(ratio, torque, offset=0.0):
    """Two wheels on axes at right angles, on the ground; a torque on the first."""
    scene = ts.Scene(gravity=(0, 0, 0))
    one, fast = wheel(scene, scene.ground, (0, 0, 0), Z, 0.2, name="one")
    _, slow = wheel(scene, scene.ground, (1, 0, 0), X, 0.7, name="two")
    if torque:
        scene.add(ts.forces.Torque(one, torque=(0, 0, torque)))
    gear = scene.add(C.Coupler(slow, fast, ratio=ratio, offset=offset, name="gear"))
    return scene, fast, slow, gear


@pytest.mark.slow_for("*sdirk54*", "*radau*", "*null-space*")
@every_method
@pytest.mark.parametrize("ratio", [-np.sqrt(2.0), 0.3])
def test_crossed_axes_over_many_turns(ratio, options):
    """(J1 + ratio^2 J2) theta'' = torque; the torque that turns the second wheel is the coupler's."""
    gain = 25.0
    scene, fast, slow, gear = crossed(ratio, gain * (0.2 + ratio**2 * 0.7))
    solution = ts.simulate(scene, (0.0, 3.0), t_eval=np.linspace(0.0, 3.0, 61), **options)
    held(solution)
    theta = gain * solution.t**2 / 2
    assert theta[-1] > 2 * np.pi * 15
    np.testing.assert_allclose(solution.angle(fast), theta, atol=NEAR * loose(options) * theta[-1])
    assert np.abs(solution.angle(slow) - ratio * solution.angle(fast)).max() < TIGHT * theta[-1]
    _, torque = solution.reaction(gear, on="two")
    np.testing.assert_allclose(torque[:, 0], 0.7 * ratio * gain, rtol=FAIR * loose(options))
    _, torque = solution.reaction(gear, on="one")
    np.testing.assert_allclose(torque[:, 2], -0.7 * ratio**2 * gain, rtol=FAIR * loose(options))


def test_a_hundred_turns_in_long_steps():
    """No torque: both turn evenly, and a run that goes on from a state knows the turns."""
    scene, fast, slow, _ = crossed(0.25, 0.0)
    scene.body("one").angular_velocity, scene.body("two").angular_velocity = (0, 0, 80.0), (20.0, 0, 0)
    half = ts.simulate(scene, (0.0, 5.0))
    whole = ts.simulate(scene, (half.state.t, 10.0), state=half.state)
    assert abs(whole.angle(fast)[-1] - 800.0) < 1e-9
    assert abs(whole.angle(slow)[-1] - 200.0) < 1e-9
    assert max(map(max, whole.constraint_error)) < 1e-11


@pytest.mark.parametrize("options", [METHODS["taylor"], METHODS["dop853"], MAGGI], ids=["taylor", "dop853", "maggi"])
def test_a_differential(options):
    """2 q_cage = q_left + q_right: with torques T on the sides, J q_i'' + Jc (q_1'' + q_2'') / 4 = T_i."""
    scene = ts.Scene(gravity=(0, 0, 0))
    left, l = wheel(scene, scene.ground, (0, 0, 0), X, 0.4, name="left")
    right, r = wheel(scene, scene.ground, (1, 0, 0), X, 0.4, name="right")
    _, c = wheel(scene, scene.ground, (0.5, 0.5, 0), Y, 0.9, name="cage")
    scene.add(C.Coupler(c, l, r, ratio=0.5))
    T = 3.0, -1.0
    for body, torque in zip((left, right), T, strict=True):
        scene.add(ts.forces.Torque(body, torque=(torque, 0, 0)))
    solution = ts.simulate(scene, (0.0, 2.0), **options)
    A = 0.4 * np.eye(2) + 0.9 / 4
    gain = np.linalg.solve(A, T)
    for joint, each in zip((l, r), gain, strict=True):
        assert abs(solution.angle(joint)[-1] - each * 2.0) < 1e-8
    assert abs(solution.angle(c)[-1] - 0.5 * gain.sum() * 2.0) < 1e-8
    assert scene.mobility().degrees_of_freedom == 2


@pytest.mark.slow
@pytest.mark.parametrize("count", [3, 12, 40])
def test_a_train_of_wheels_on_a_carrier(count):
    """Each wheel turns by -0.9 of the one before, on axes that alternate: the carrier is a hub of many rows."""
    scene = ts.Scene(gravity=(0, 0, 0))
    arm = scene.add_body(3.0, (1, 1, 1), name="arm")
    scene.add(C.Fixed.at(scene.ground, arm, point=(0, 0, 0)))
    hinges = [wheel(scene, arm, (0.2 * i, 0, 0), (X, Y, Z)[i % 3], 0.3, name=f"w{i}")[1] for i in range(count)]
    for one, two in pairwise(hinges):
        scene.add(C.Coupler(two, one, ratio=-0.9))
    scene.add(ts.forces.JointTorque(hinges[0], function=lambda t, q, rate: 2.0))
    solution = ts.simulate(scene, (0.0, 2.0), rtol=1e-11, atol=1e-11)
    held(solution)
    J = 0.3 * sum(0.81**i for i in range(count))
    theta = 2.0 / J * 2.0
    angles = np.array([solution.angle(hinge)[-1] for hinge in hinges])
    np.testing.assert_allclose(angles, theta * (-0.9) ** np.arange(count), atol=1e-9)


CAM = {
    "polynomial": {"polynomial": (0.0, 0.0, 0.02, 0.001)},
    "function": {"function": lambda q: 0.1 * (1.0 - np.cos(q)) + 0.002 * q},
    "motion": {"function": 0.1 * np.sin(2.0 * ts.motions.time) + 0.01 * ts.motions.time**2},
}
SLOPES = {  # f' and f''
    "polynomial": (lambda q: 0.04 * q + 0.003 * q**2, lambda q: 0.04 + 0.006 * q),
    "function": (lambda q: 0.1 * np.sin(q) + 0.002, lambda q: 0.1 * np.cos(q)),
    "motion": (lambda q: 0.2 * np.cos(2 * q) + 0.02 * q, lambda q: -0.4 * np.sin(2 * q) + 0.02),
}


def cam(given, speed=20.0):
    """A cam on the ground lifts a rod of 1 kg along z; the coupler is made of `given`."""
    scene = ts.Scene(gravity=(0, 0, -9.81))
    _, hinge = wheel(scene, scene.ground, (0, 0, 0), Z, 0.5, angular_velocity=(0, 0, speed), name="cam")
    rod = scene.add_body(1.0, (1, 1, 1), position=(1, 0, 0), name="rod")
    slide = scene.add(C.Translational.at(scene.ground, rod, point=rod.position, axis=Z, name="slide"))
    coupler = scene.add(C.Coupler(slide, hinge, **given, name="follower"))
    scene.assemble(fixed=["cam"])
    return scene, hinge, slide, coupler


@pytest.mark.slow_for("*sdirk54*", "*radau*", "*null-space*")
@every_method
@pytest.mark.parametrize("kind", CAM)
def test_cams_against_one_equation(kind, options):
    """(J + m f'^2) q'' + m f' f'' q'^2 + m g f' = 0."""
    scene, hinge, slide, coupler = cam(CAM[kind])
    f1, f2 = SLOPES[kind]

    def rates(t, y):
        q, u = y
        return u, -(f1(q) * f2(q) * u * u + 9.81 * f1(q)) / (0.5 + f1(q) ** 2)

    solution = ts.simulate(scene, (0.0, 2.0), **options)
    held(solution)
    u0 = solution.angle_rate(hinge)[0]
    known = solve_ivp(rates, (0.0, 2.0), (0.0, u0), method="DOP853", rtol=1e-12, atol=1e-12)
    assert abs(solution.angle(hinge)[-1] - known.y[0, -1]) < 1e-7 * loose(options) ** 0.5
    assert np.ptp(solution.energy) < 1e-6 * loose(options) ** 0.5
    force, _ = solution.reaction(coupler, on="rod")
    assert np.abs(force[:, 2] - 9.81 - solution.displacement_acceleration(slide)).max() < 1e-6  # qdd of implicit stages


def test_a_spline_is_differentiated_exactly():
    """The default method is one without series; Taylor is refused by the coupler's name."""
    knots = np.linspace(0.0, 2 * np.pi, 13)
    spline = CubicSpline(knots, 0.1 * (1 - np.cos(knots)), bc_type="periodic")
    scene, hinge, slide, _ = cam({"function": spline})
    solution = ts.simulate(scene, (0.0, 1.0), rtol=1e-9, atol=1e-9)
    assert np.abs(solution.displacement(slide) - spline(solution.angle(hinge))).max() < 1e-12
    assert solution.angle(hinge)[-1] > 2 * np.pi
    rate = spline(solution.angle(hinge), 1) * solution.angle_rate(hinge)
    assert np.abs(solution.displacement_rate(slide) - rate).max() < 1e-12
    with pytest.raises(ts.InvalidArgument, match=r"follower.*data.*piece"):
        ts.simulate(scene, (0.0, 1.0), integrator="taylor")


def fold(a, b):
    return np.sin(a) + 0.5 * b**2 - 3.0 * a + 0.25


def test_a_function_of_several_joints_in_a_chain():
    """The three levels hold for a sum of functions of two joints of a chain of five; energy is kept."""
    scene, last, joints = ts.Scene(), None, []
    last = scene.ground
    for i in range(5):
        body = scene.add_body(1.0 + i, (0.1, 0.2, 0.15), position=(i + 0.5, 0, 0), name=f"link {i}")
        joints.append(scene.add(C.Revolute.at(last, body, point=(i, 0, 0), axis=(X + Y, Y, Z)[i % 3], name=f"j{i}")))
        last = body
    scene.add(C.Coupler(joints[4], joints[0], joints[2], function=fold, name="fold"))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 1.0), rtol=1e-10, atol=1e-10)
    held(solution)
    a, b, c = (solution.angle(joints[i]) for i in (0, 2, 4))
    assert np.abs(c - fold(a, b)).max() < 1e-13
    assert np.ptp(solution.energy) < 1e-6
    values = scene.evaluate()
    assert np.abs(values.Phi_q @ solution.qdd[0] + values.gamma).max() < 1e-10
    again = ts.simulate(pickle.loads(pickle.dumps(scene)), (0.0, 1.0), rtol=1e-10, atol=1e-10)
    assert (again.q == solution.q).all()


def lift(p, q):
    return 0.3 * p * q + 0.1 * np.sin(p * q) + 0.02 * p**2


def crane(function, axes=(Z, X)):
    """Two wheels on axes of the ground, of 0.5 and 0.3 kg m^2, lift a body of 2 kg by a function of both angles."""
    scene = ts.Scene(gravity=(0, 0, -9.81))
    joints = [wheel(scene, scene.ground, (i, 0, 0), axes[i], (0.5, 0.3)[i], name=f"w{i}")[1] for i in range(2)]
    body = scene.add_body(2.0, (1, 1, 1), position=(3, 0, 0), name="load")
    joints.append(scene.add(C.Translational.at(scene.ground, body, point=(3, 0, 0), axis=Z, name="slide")))
    scene.add(C.Coupler(joints[2], *joints[:2], function=function, name="crane"))
    return scene, joints


@pytest.mark.slow_for("*sdirk54*", "*radau*", "*null-space*", "taylor")
@every_method
def test_a_product_of_two_angles_against_lagrange(options):
    """(J + m g g^T) q'' = -m g (q'^T G q' + 9.81), g and G the first and second derivatives of the lift."""
    scene, joints = crane(lift)
    scene.body("w0").angular_velocity, scene.body("w1").angular_velocity = (0, 0, 9.0), (-3.0, 0, 0)
    scene.assemble(fixed=["w0", "w1"])

    def rates(t, y):
        (p, q), u, sine, cosine = y[:2], y[2:], np.sin(y[0] * y[1]), np.cos(y[0] * y[1])
        g = np.array([q * (0.3 + 0.1 * cosine) + 0.04 * p, p * (0.3 + 0.1 * cosine)])
        both = 0.3 + 0.1 * cosine - 0.1 * p * q * sine
        G = np.array([[0.04 - 0.1 * q * q * sine, both], [both, -0.1 * p * p * sine]])
        forces = -2.0 * g * (u @ G @ u + 9.81)
        return *u, *np.linalg.solve(np.diag((0.5, 0.3)) + 2.0 * np.outer(g, g), forces)

    solution = ts.simulate(scene, (0.0, 2.0), **options)
    held(solution)
    p, q = (solution.angle(joint) for joint in joints[:2])
    assert np.ptp(p) > 2.0 * np.pi
    assert np.abs(solution.displacement(joints[2]) - lift(p, q)).max() < 1e-12
    start = 0.0, 0.0, solution.angle_rate(joints[0])[0], solution.angle_rate(joints[1])[0]
    known = solve_ivp(rates, (0.0, 2.0), start, method="DOP853", rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose((p[-1], q[-1]), known.y[:2, -1], atol=2e-7 * loose(options) ** 0.5)
    assert np.ptp(solution.energy) < 1e-6 * loose(options) ** 0.5


@pytest.mark.slow
def test_linearisation_of_a_product():
    """At p = q = 0 of p^2 + p q + q^2: K = m g [[2, 1], [1, 2]]; the product is off the diagonal."""
    scene, _ = crane(lambda p, q: p**2 + p * q + q**2)
    found = scene.linearise()
    np.testing.assert_allclose(found.M, np.diag((0.5, 0.3)), atol=1e-14)
    np.testing.assert_allclose(found.K, 2.0 * 9.81 * np.array([[2.0, 1.0], [1.0, 2.0]]), atol=1e-12)


@pytest.mark.slow
def test_a_function_of_angles_and_travels_in_a_chain():
    """Each joint of a chain of five, of both kinds, is in a product with the others; a run goes on to the bit."""
    scene, last, joints = ts.Scene(), None, []
    last = scene.ground
    for i in range(5):
        body = scene.add_body(1.0 + i, (0.1, 0.2, 0.15), position=(i + 0.5, 0, 0), name=f"link {i}")
        kind = (C.Revolute, C.Translational)[i % 2]
        joints.append(scene.add(kind.at(last, body, point=(i, 0, 0), axis=(X + Y, Y, Z, X, Y)[i], name=f"j{i}")))
        last = body

    def product(a, x, b, y):
        return np.exp(0.1 * a * x) * np.cos(b * y) + a * y - 1.0

    coupler = scene.add(C.Coupler(joints[4], *joints[:4], function=product, name="product"))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 1.0), rtol=1e-10, atol=1e-10)
    held(solution)
    a, x, b, y, c = (solution.angle(j) if i % 2 == 0 else solution.displacement(j) for i, j in enumerate(joints))
    assert np.abs(c - product(a, x, b, y)).max() < 1e-12
    assert np.ptp(solution.energy) < 1e-6
    assert {body.name for body in coupler.bodies} == {f"link {i}" for i in range(5)}
    half = ts.simulate(scene, (0.0, 0.5), rtol=1e-10, atol=1e-10)
    known = ts.simulate(scene, (0.0, 1.0), rtol=1e-10, atol=1e-10, t_eval=[0.5, 1.0])
    rest = ts.simulate(scene, (half.state.t, 1.0), state=half.state, rtol=1e-10, atol=1e-10)
    assert np.abs(rest.q[-1] - known.q[-1]).max() < 1e-8
    again = ts.simulate(pickle.loads(pickle.dumps(crane(lift)[0])), (0.0, 1.0))
    assert (again.q == ts.simulate(crane(lift)[0], (0.0, 1.0)).q).all()


@pytest.mark.slow
@pytest.mark.parametrize("kinds", ["aa", "da", "dd", "ada"])
def test_kernels_and_series_of_functions_of_several(kinds):
    def make(a, b):
        joints = [
            a.scene.add(C.Cylindrical(a, b, axis_a=rng.normal(size=3), axis_b=rng.normal(size=3))) for _ in "abcd"
        ]
        pairs = [(joint, {"a": "angle", "d": "displacement"}[kind]) for joint, kind in zip(joints, kinds, strict=False)]
        return C.Coupler((joints[3], "angle"), *pairs, offset=0.3, function=SAMPLES[len(kinds)])

    rng = np.random.default_rng(3)
    ts.testing.check_primitive(make, states=3)


SAMPLES = {
    2: lambda p, q: (
        np.sin(p * q) + q**3 * p / (1.0 + p**2) + np.exp(-p * q) - np.arctan(p * q) + np.log(9.0 + (p * q) ** 2)
    ),
    3: lambda p, q, r: np.sin(p * q * r) - np.sqrt(9.0 + (q * r) ** 2) + np.tanh(0.2 * r * p),
}


@pytest.mark.slow_for("motion", "polynomial")
@pytest.mark.parametrize("given", [{"ratio": 0.7}, *CAM.values()], ids=["ratio", *CAM])
def test_kernels_and_series(given):
    """phi, jacobian, gamma and the coefficients of Taylor series, of every kind of term."""

    def make(a, b):
        joint = a.scene.add(C.Cylindrical(a, b, axis_a=(1, 2, 3), axis_b=(3, 1, -1)))
        pair = (joint, "angle"), (joint, "displacement")
        return C.Coupler(*(pair if rng.random() < 0.5 else pair[::-1]), offset=0.3, **given)

    rng = np.random.default_rng(3)
    ts.testing.check_primitive(make, states=3)


def test_sparse_and_dense_rows_agree():
    """A scene beyond the limit of dense matrices: Phi_q from its short rows is that of the dense kernels."""
    scene = ts.Scene()
    hinges = [wheel(scene, scene.ground, (i, 0, 0), (X, Y)[i % 2], name=f"w{i}")[1] for i in range(150)]
    scene.add(C.Coupler(hinges[1], hinges[0], ratio=0.5))
    for i in range(2, 119):
        scene.add(C.Coupler(hinges[i], hinges[i - 1], hinges[0], ratio=(0.5, -0.25)))
    values = scene.evaluate()
    q, qd = scene.start
    dense = constraint_arrays(scene.system, q, qd, 0.0)[1]
    assert np.abs(dense - values.Phi_q.toarray()).max() == 0.0


def test_redundant_couplers_are_dropped_and_hold():
    scene, fast, slow, _ = crossed(0.5, 1.0)
    _, other = wheel(scene, scene.ground, (2, 0, 0), Y, name="three")
    scene.add(C.Coupler(other, fast, ratio=2.0, name="to the first"))
    scene.add(C.Coupler(other, slow, ratio=4.0, name="to the second"))
    report = scene.mobility()
    assert report.degrees_of_freedom == 1
    assert len(report.redundant) == 1
    solution = ts.simulate(scene, (0.0, 3.0))
    held(solution)
    assert np.abs(solution.angle(other) - 4.0 * solution.angle(slow)).max() < 1e-12
    assert not solution.reaction_unique("to the first").any()
    J = 0.2 + 0.25 * 0.7 + 4.0 * 0.5
    assert abs(solution.angle(fast)[-1] - 1.0 / J * 4.5) < 1e-9


@pytest.mark.slow
def test_linearisation_and_equilibrium():
    """Two pendulums of which one turns half as far: (J1 + J2 / 4) q'' = -m g l (1 + 1 / 4) q."""
    scene = ts.Scene(gravity=(0, 0, -9.81))
    joints = []
    for i in range(2):
        body = scene.add_body(1.0, (0.1, 0.1, 0.1), position=(3 * i, 0, -0.5), name=f"p{i}")
        joints.append(scene.add(C.Revolute.at(scene.ground, body, point=(3 * i, 0, 0), axis=Y, name=f"h{i}")))
    scene.add(C.Coupler(joints[1], joints[0], ratio=0.5))
    J = 0.1 + 0.25
    omega = np.sqrt(9.81 * 0.5 / J)
    eigenvalues = scene.linearise().eigenvalues()
    np.testing.assert_allclose(np.abs(eigenvalues.imag), omega, rtol=1e-10)
    scene.set("h0", angle=0.4)
    scene.assemble()
    report = scene.equilibrium()
    assert report.stable
    assert abs(report.state.angle("h0")) < 1e-8


def test_kinematics_and_inverse_dynamics():
    """The motor's torque carries both wheels."""
    scene, fast, slow, _ = crossed(-1.5, 0.0)
    motor = scene.add(C.RotationMotor.of(fast, angle=2.0 * ts.motions.time**2))
    solution = ts.simulate(scene, (0.0, 4.0))
    _, torque = solution.reaction(motor, on="one")
    np.testing.assert_allclose(torque[:, 2], 4.0 * (0.2 + 2.25 * 0.7), rtol=1e-9)
    moved = scene.kinematics(np.linspace(0.0, 4.0, 9))
    np.testing.assert_allclose(moved.angle(slow), -3.0 * moved.t**2, atol=1e-9)


def test_parameters_files_and_ensembles(tmp_path):
    scene, fast, slow, gear = crossed(0.5, 2.0, offset=0.0)
    again = ts.load(scene.save(tmp_path / "gear.toml"))
    assert (ts.simulate(again, (0, 1)).q == ts.simulate(scene, (0, 1)).q).all()
    _, third = wheel(again, again.ground, (2, 0, 0), Y, name="three")
    again.add(C.Coupler(third, again["hinge one"], again["hinge two"], ratio=(1.0, 2.0)))
    twin = ts.load(again.save(tmp_path / "three.toml"))
    assert (ts.simulate(twin, (0, 1)).q == ts.simulate(again, (0, 1)).q).all()
    ratios = np.array([0.5, -2.0, 0.1])
    found = ts.ensemble(scene, {"gear.ratio": ratios}, (0.0, 1.0))
    for i, ratio in enumerate(ratios):
        assert abs(found.case(i).angle(fast)[-1] - 1.0 / (0.2 + ratio**2 * 0.7)) < CLOSE
        own = ts.simulate(scene.with_parameters({"gear.ratio": ratio}), (0.0, 1.0))
        assert (own.q[-1] == found.q[i]).all()
    gear.ratio = 3.0
    assert abs(ts.simulate(scene, (0.0, 1.0)).angle(slow)[-1] - 3.0 / (0.2 + 9.0 * 0.7)) < CLOSE
    with pytest.raises(ts.InvalidArgument, match="gear' counts turns"):
        ts.ensemble(scene, {"one.mass": np.ones(4)}, (0.0, 1.0), lanes=4)


@pytest.mark.parametrize("given", [CAM["polynomial"], CAM["motion"]], ids=["polynomial", "motion"])
def test_functions_in_files(given, tmp_path):
    scene, *_ = cam(given)
    again = ts.load(scene.save(tmp_path / "cam.toml"))
    assert (ts.simulate(again, (0, 1)).q == ts.simulate(scene, (0, 1)).q).all()


def test_a_run_resumes_to_the_bit(tmp_path, monkeypatch):
    """Turns are state: a stored run that is interrupted after some turns goes on with them."""
    monkeypatch.setattr(driver, "FIRST_SLICE", 4)
    scene, hinge, *_ = cam(CAM["polynomial"], 40.0)
    left = iter(range(2))

    def stop(fraction):
        if next(left, None) is None:
            raise KeyboardInterrupt

    whole = ts.simulate(scene, (0.0, 6.0), integrator="dop853")
    part = ts.simulate(
        scene, (0.0, 6.0), integrator="dop853", store=tmp_path / "part.zarr", checkpoint=0.0, progress=stop
    )
    assert not part.success
    assert abs(part.angle(hinge)[-1]) > 2 * np.pi
    found = ts.resume(tmp_path / "part.zarr", scene=scene)
    assert (found.q[-1] == whole.q[-1]).all()


@pytest.mark.parametrize(
    ("give", "said"),
    [
        (lambda j, k, o: ((j,), {}), "one joint or more"),
        (lambda j, k, o: ((j, j), {}), "depend on itself"),
        (lambda j, k, o: ((j, k, k), {}), "given twice"),
        (lambda j, k, o: ((j, k), {"ratio": (1.0, 2.0)}), "2 ratios are given for 1"),
        (lambda j, k, o: ((j, k), {"ratio": np.nan}), "ratio must be a finite number"),
        (lambda j, k, o: ((j, k), {"offset": np.inf}), "offset must be a finite number"),
        (lambda j, k, o: ((j, o), {}), "another scene"),
        (lambda j, k, o: ((j, 3.0), {}), "with an angle or a displacement, .* got 3.0"),
        (lambda j, k, o: (((j, "displacement"), k), {}), "say which coordinate"),
        (lambda j, k, o: ((j, k), {"polynomial": ()}), "polynomial must be finite coefficients"),
        (lambda j, k, o: ((j, k), {"polynomial": (1.0, np.nan)}), "polynomial must be finite coefficients"),
        (lambda j, k, o: ((j, k), {"polynomial": (1.0,), "ratio": 2.0}), "one of ratio, polynomial and function"),
        (lambda j, k, o: ((j, k), {"function": 3.0}), "plain function of 1 coordinate"),
        (lambda j, k, o: ((j, k), {"function": lambda a, b: a}), "called with 1 coordinate"),
        (lambda j, k, o: ((j, k), {"function": lambda a: abs(a)}), "can't be differentiated"),
    ],
)
def test_what_is_refused(give, said):
    _, fast, slow, _ = crossed(1.0, 0.0)
    _, stranger, *_ = crossed(1.0, 0.0)
    joints, others = give(slow, fast, stranger)
    with pytest.raises(ts.InvalidConstraint, match=said):
        C.Coupler(*joints, **others)


@pytest.mark.parametrize(
    "make",
    [
        lambda joint: C.Coupler("hinge one", joint),
        lambda joint: C.Coupler(joint, ("hinge one", "angle")),
        lambda joint: C.Stop("hinge one", lower=0.0),
        lambda joint: ts.forces.Armature("hinge one", inertia=1.0),
        lambda joint: ts.forces.JointTorque("hinge one", function=lambda t, q, rate: 1.0),
        lambda joint: ts.forces.RevoluteFriction("hinge one", radius=0.1, kinetic=0.1),
    ],
)
def test_a_name_in_place_of_a_joint(make):
    _, fast, *_ = crossed(1.0, 0.0)
    with pytest.raises(ts.TsdynError, match=r"the name 'hinge one'; pass the object itself, scene\['hinge one'\]"):
        make(fast)


def test_couplers_in_a_circle_and_products():
    scene, fast, slow, _ = crossed(1.0, 0.0)
    _, third = wheel(scene, scene.ground, (2, 0, 0), Y, name="three")
    scene.add(C.Coupler(third, slow, name="second"))
    with pytest.raises(ts.InvalidConstraint, match=r"'third', .*'second'.*'gear'|'third', 'gear', 'second'"):
        scene.add(C.Coupler(fast, third, name="third"))
    hinges = [wheel(scene, scene.ground, (3 + i, 0, 0), Y, name=f"w{i}")[1] for i in range(6)]
    with pytest.raises(ts.InvalidConstraint, match="6 coordinates together; at most 5"):
        C.Coupler(third, *hinges, function=lambda a, b, c, d, e, f: a * b * c * d * e * f)
    with pytest.raises(ts.InvalidConstraint, match="too many operations"):
        C.Coupler(third, slow, fast, function=lambda a, b: sum(np.sin(i * a * b) for i in range(50)))


def test_a_start_off_the_row_is_refused_and_assembled():
    scene, fast, slow, _ = crossed(0.5, 0.0, offset=0.3)
    with pytest.raises(ts.InconsistentState, match=r"Coupler 'gear': Phi = -0\.3"):
        ts.simulate(scene, (0.0, 1.0))
    scene.assemble()
    state = ts.simulate(scene, (0.0, 0.1)).state
    assert abs(state.angle(slow) - 0.3 - 0.5 * state.angle(fast)) < 4 * EPS


def test_a_start_beyond_a_turn():
    """`scene.set` says on which turn a joint is: 0.5 of 9 rad, not of 9 rad less a turn."""
    scene, fast, slow, _ = crossed(0.5, 0.0)
    scene.set(fast, angle=9.0)
    scene.set(slow, angle=4.5)
    state = ts.simulate(scene, (0.0, 0.1)).state
    assert abs(state.angle(slow) - 0.5 * state.angle(fast)) < 1e-13
    assert abs(state.angle(fast) - 9.0) < 1e-13


@pytest.mark.parametrize("angle", [4.0, -9.0, 25.0])
def test_coupled_joints_follow_one_that_is_set(angle):
    """A differential in a car: bodies at the end of a tree are moved over turns, and the coupled ones with them."""
    scene, hinges = ts.Scene(gravity=(0, 0, 0)), []
    car = scene.add_body(100.0, (1, 1, 1), name="car")
    scene.add(C.Translational.at(scene.ground, car, point=(0, 0, 0), axis=(1, 0, 0)))
    for y in (0.0, 1.0, -1.0):
        wheel = scene.add_body(1.0, (1, 1, 1), position=(0, y, 0))
        hinges.append(scene.add(C.Revolute.at(car, wheel, point=(0, y, 0), axis=(0, 1, 0))))
    scene.add(C.Coupler(*hinges, ratio=(0.5, 1.5)))
    scene.set(hinges[1], angle=angle)
    cage, left, right = (ts.simulate(scene, (0.0, 0.1)).state.angle(hinge) for hinge in hinges)
    assert abs(left - angle) < 1e-12
    assert abs(cage - 0.5 * left - 1.5 * right) < 1e-12
    assert abs(cage) + abs(right) > 0.1 * abs(angle)


def test_coordinates_of_joints_with_several():
    """A nut of a cylindrical joint moves by its own turn; one arm of a universal joint follows the other."""
    scene = ts.Scene(gravity=(0, 0, -10.0))
    nut = scene.add_body(1.0, (1, 1, 0.99), name="nut")
    joint = scene.add(C.Cylindrical.at(scene.ground, nut, point=(0, 0, 0), axis=Z, name="bolt"))
    with pytest.raises(ts.InvalidConstraint, match=r"\(joint, 'angle'\), \(joint, 'displacement'\)"):
        C.Coupler(joint, joint)
    scene.add(C.Coupler((joint, "displacement"), (joint, "angle"), ratio=0.1))
    state = ts.simulate(scene, (0.0, 1.0)).state
    assert abs(state.displacement(joint) - 0.1 * state.angle(joint)) < 1e-14
    assert abs(state.displacement(joint) + 10.0 / (1.0 + 0.99 / 0.01) / 2) < 1e-10
    cross = scene.add_body(1.0, (1, 1, 1), position=(3, 0, 0), angular_velocity=(1, 1, 0), name="cross")
    arms = scene.add(C.Universal.at(scene.ground, cross, point=(3, 0, 0), axis=X, axis_b=Y, name="arms"))
    scene.add(C.Coupler((arms, "angle", 1), (arms, "angle", 0), ratio=1.0))
    one, other = ts.simulate(scene, (0.0, 0.5)).state.angle(arms)
    assert abs(one - other) < 1e-12
    assert abs(one) > 0.1


@pytest.mark.parametrize(
    "method", [ts.integrators.Taylor(step=0.05), ts.integrators.Nystrom4(step=0.05)], ids=["taylor", "nystrom4"]
)
def test_a_fixed_step_of_half_a_turn_ends_the_run(method):
    """Its turns can't be counted: no run goes on with the wrong ones."""
    scene, *_ = crossed(0.3, 0.0)
    scene.body("one").angular_velocity, scene.body("two").angular_velocity = (0, 0, 70.0), (21.0, 0, 0)
    solution = ts.simulate(scene, (0.0, 1.0), integrator=method)
    assert not solution.success
    assert "smaller step" in solution.message


@pytest.mark.slow_but("*taylor*")
@every_method
def test_beside_a_row_on_velocities(options):
    """On a cart with a blade two wheels on crossed axes are coupled: the levels hold, and all methods agree."""
    scene = ts.Scene(gravity=(0, 0, 0))
    cart = scene.add_body(2.0, (0.3, 0.3, 0.4), velocity=(1, 0, 0), angular_velocity=(0, 0, 0.5), name="cart")
    scene.add(C.Planar.at(scene.ground, cart, point=(0, 0, 0), axis=Z))
    scene.add(C.KnifeEdge(cart, scene.ground, point_a=(-0.3, 0, 0), axis_a=Y, normal_b=Z))
    one, fast = wheel(scene, cart, (0, 0, 0.3), Z, 0.3, name="one")
    _, slow = wheel(scene, cart, (0.4, 0, 0.3), X, 0.2, name="two")
    scene.add(C.Coupler(slow, fast, ratio=2.0))
    scene.add(ts.forces.Torque(one, torque=(0, 0, 0.2)))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 1.5), **options)
    held(solution)
    assert np.abs(solution.angle(slow) - 2.0 * solution.angle(fast)).max() < TIGHT
    known = ts.simulate(scene, (0.0, 1.5), rtol=1e-12, atol=1e-12)
    assert np.abs(solution.q[-1] - known.q[-1]).max() < 1e-8 * loose(options)


def test_ratios_of_a_differential_are_a_parameter():
    """A torque of 1 N m on the cage: with r = (r_1, r_2), all inertias 1 kg m^2, q_0'' = r.r / (1 + r.r)."""
    scene, hinges = ts.Scene(gravity=(0, 0, 0)), []
    for name, x, axis in (("cage", 0, (0, 1, 0)), ("left", -1, (1, 0, 0)), ("right", 1, (1, 0, 0))):
        body = scene.add_body(1.0, (1, 1, 1), position=(x, 0, 0), name=name)
        hinges.append(scene.add(ts.constraints.Revolute.at(scene.ground, body, point=(x, 0, 0), axis=axis)))
    scene.add(ts.constraints.Coupler(*hinges, ratio=(0.5, 0.5), name="differential"))
    scene.add(ts.forces.Torque(scene["cage"], torque=(0, 1, 0)))
    assert scene.parameters()["differential.ratio"].tolist() == [0.5, 0.5]
    ratios = np.array([(0.5, 0.5), (0.5, 0.7), (1.0, 2.0)])
    table = ts.ensemble(scene, {"differential.ratio": ratios}, (0, 1))
    for i, r in enumerate(ratios):
        goal = 0.5 * (r @ r) / (1.0 + r @ r)
        one = ts.simulate(scene.with_parameters({"differential.ratio": r}), (0, 1))
        assert abs(one.angle(hinges[0].name)[-1] - goal) < 1e-9
        assert abs(table.case(i).angle(hinges[0].name)[-1] - goal) < 1e-9
    with pytest.raises(ts.InvalidConstraint, match="3 ratios are given for 2"):
        scene.with_parameters({"differential.ratio": (1, 2, 3)})
