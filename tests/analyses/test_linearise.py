"""`scene.linearise`: M, C, K and eigenvalues against closed forms and independent minimal coordinates."""

import numpy as np
import pytest
from scipy.linalg import eig, eigh

import tsdyn as ts
from tests.helpers import minimal_coordinates as minimal
from tests.helpers.closed_loops import four_bar, parallelogram
from tests.helpers.every_force import everything
from tests.helpers.hanging_chains import DOWN, G, pendulum_matrices, pendulums
from tests.helpers.tolerances import CLOSE, FINE, HELD
from tsdyn.analyses.coordinates import Variations, stacked
from tsdyn.analyses.nominal_motion import NominalMotion
from tsdyn.elements.bodies import transform_g

C, F = ts.constraints, ts.forces


def differences(f, x, h=2e-3):
    """The Jacobian of f at x by central differences of sixth order."""
    weights = {1: 45.0, 2: -9.0, 3: 1.0}
    columns = []
    for e in np.eye(len(x)):
        columns.append(sum(c * (f(x + i * h * e) - f(x - i * h * e)) for i, c in weights.items()) / (60.0 * h))
    return np.array(columns).T


@pytest.mark.parametrize("count", [1, 2, 8])
def test_chain_that_hangs(count):
    linear = pendulums(np.zeros(count)).linearise()
    M, K = pendulum_matrices(count)
    to_absolute = np.tril(np.ones((count, count)))
    assert linear.coordinates == tuple(f"pin {i}.angle" for i in range(count))
    np.testing.assert_allclose(linear.M, to_absolute.T @ M @ to_absolute, atol=HELD * np.abs(M).max())
    np.testing.assert_allclose(linear.K, to_absolute.T @ K @ to_absolute, atol=HELD * np.abs(K).max())
    expected = np.sqrt(eigh(K, M, eigvals_only=True))
    modes = linear.modes()
    np.testing.assert_allclose(modes.frequency, expected / (2.0 * np.pi), rtol=CLOSE)
    assert np.abs(linear.eigenvalues().real).max() == 0.0
    assert len(linear.eigenvalues()) == 2 * count
    assert linear.steady


@pytest.mark.parametrize("angles", [(np.pi,), (np.pi, np.pi), (0.0, np.pi)])
def test_inverted_pendulums(angles):
    linear = pendulums(angles).linearise()
    M, K = pendulum_matrices(len(angles))
    signs = np.cos(angles)
    M = M * np.outer(signs, signs) + (0.02 - 0.02 * np.outer(signs, signs)) * np.eye(len(angles))
    expected = np.sqrt(-eigh(K * np.diag(signs), M, eigvals_only=True).astype(complex))
    expected = np.concatenate((expected, -expected))
    found = linear.eigenvalues()
    for value in expected:
        assert np.abs(found - value).min() < CLOSE * np.abs(value)
    assert found.real.max() > 1.0


@pytest.mark.slow_for("0", "1")
@pytest.mark.parametrize("seed", range(6))
def test_derivatives_in_any_motion(seed):
    rng = np.random.default_rng(seed)
    kinds = rng.choice(["Revolute", "Cylindrical", "Screw", "Translational", "Universal"], 3)
    links = [minimal.random_link(rng, kind) for kind in kinds]
    k = len(minimal.moves(links))
    x, xd = 0.6 * rng.normal(size=(2, k))
    scene, _ = minimal.build(links, DOWN)
    minimal.place(scene, links, x, xd)
    linear = scene.linearise()
    order = []  # of the coordinates of a joint, angles come first
    for i in range(len(links)):
        own = [(j, what) for j, (link, what, _) in enumerate(minimal.moves(links)) if link == i]
        order += [j for j, what in own if what != "slide"] + [j for j, what in own if what == "slide"]

    def xdd(x, xd):
        return minimal.accelerations(links, x, xd, DOWN)[0]

    by_x, by_xd = differences(lambda y: xdd(y, xd), x), differences(lambda y: xdd(x, y), xd)
    for found, expected in ((linear.K, by_x), (linear.C, by_xd)):
        expected = expected[np.ix_(order, order)]
        np.testing.assert_allclose(-np.linalg.solve(linear.M, found), expected, atol=CLOSE * np.abs(expected).max())
    assert not linear.steady


def test_damped_pair_of_masses():
    """Two masses on springs and dampers along x, with a force on the second: textbook matrices and transfer."""
    scene = ts.Scene(gravity=(0, 0, 0))
    one = scene.add_point_mass(mass=2.0, position=(1, 0, 0), name="one")
    two = scene.add_point_mass(mass=3.0, position=(2, 0, 0), name="two")
    for ball in (one, two):
        for axis in np.eye(3)[1:]:
            scene.add(C.PlaneContact(ball, scene.ground, normal_b=axis))
    scene.add(F.Spring(scene.ground, one, stiffness=50.0, damping=0.3))
    scene.add(F.Spring(one, two, stiffness=70.0, damping=0.2, name="link"))
    scene.add(F.PointForce(two, force=(1e-300, 0, 0), name="push"))
    linear = scene.linearise(inputs=["push.x", "link"], outputs=["one.x", "two.x rate"])
    assert linear.coordinates == ("one.x", "two.x")
    assert linear.inputs == ("push.x", "link")
    M, damping, K = np.diag([2.0, 3.0]), np.array([[0.5, -0.2], [-0.2, 0.2]]), np.array([[120.0, -70.0], [-70.0, 70.0]])
    for found, expected in ((linear.M, M), (linear.C, damping), (linear.K, K), (linear.F, [[0.0, 1.0], [1.0, -1.0]])):
        np.testing.assert_allclose(found, expected, atol=1e-11)
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, damping)]])
    expected = eig(A)[0]
    assert all(np.abs(linear.eigenvalues() - value).min() < CLOSE * abs(value) for value in expected)
    modes = linear.modes()
    np.testing.assert_allclose(modes.damping_ratio, -modes.eigenvalues.real / np.abs(modes.eigenvalues))
    np.testing.assert_allclose(modes.twist("one")[:, 0], modes.shapes[:, 0])
    system = linear.to_scipy()
    s = 2.0j
    transfer = system.C @ np.linalg.solve(s * np.eye(4) - system.A, system.B)
    places = np.linalg.solve(s * s * M + s * damping + K, [[0.0, 1.0], [1.0, -1.0]])
    np.testing.assert_allclose(transfer, [places[0], s * places[1]], rtol=CLOSE)


@pytest.mark.parametrize("rate", [0.0, 2.0])
def test_four_bar_with_redundant_rows_and_a_spring(rate):
    """One coordinate: derivatives of the crank's acceleration by its angle and rate, each at a consistent state."""

    def build(x):
        scene = four_bar(angle=x[0], rate=x[1])
        scene.add(
            F.Spring(scene.bodies[0], scene.bodies[2], stiffness=80.0, damping=1.5, free_length=0.8, name="spring")
        )
        return scene

    def acceleration(x):
        scene = build(x)
        q, qdd = scene.start[0], scene.evaluate().qdd
        return np.atleast_1d(2.0 * (transform_g(q[3:7]) @ qdd[3:7])[2])

    scene = build((1.0, rate))
    assert len(scene.mobility().redundant) == 3
    linear = scene.linearise(inputs=["spring"])
    assert len(linear.coordinates) == 1
    assert linear.coordinates[0].endswith(".angle")
    expected = -differences(acceleration, np.array([1.0, rate]))
    found = [linear.K[0] / linear.M[0], linear.C[0] / linear.M[0]]
    np.testing.assert_allclose(found, expected.T, atol=CLOSE * np.abs(expected).max())


@pytest.mark.parametrize("kind", ["Planar", "PointOnLine", "Parallel", "ConstantAngle", "Spherical"])
def test_joints_whose_coordinates_are_those_of_bodies(kind):
    """At rest, out of balance: displacements and rotations of bodies, (dpi)dd = domegad + omegad x dpi."""
    rng = np.random.default_rng(3)
    links = [minimal.random_link(rng, each) for each in ("Revolute", kind, "Revolute")]
    every = minimal.moves(links)
    k = len(every)
    x0 = 0.5 * rng.normal(size=k)
    scene, _ = minimal.build(links, DOWN)
    minimal.place(scene, links, x0, np.zeros(k))
    linear = scene.linearise()

    def twists(x):
        """Of each coordinate chosen its row of the Jacobian (k,), its acceleration, and omegad of its body."""
        xdd, poses = minimal.accelerations(links, x, np.zeros(k), DOWN)
        found = []
        for name in linear.coordinates:
            owner, what = name.split(".")
            i = int(owner.split()[-1]) - 1
            if owner.startswith("joint"):
                wanted = "turn" if what == "angle" else "slide"
                j = max(j for j, (link, kind, _) in enumerate(every) if link == i and kind == wanted)
                sign = (
                    -1.0 if links[i].kind == "PointOnLine" else 1.0
                )  # along the axis of the second body, of the first
                found.append((sign * np.eye(k)[j], sign * xdd[j], np.zeros(3), np.zeros((3, k)), 0))
                continue
            axis, turns = "xyz".index(what[-1]), what.startswith("rotation")
            J = poses[i].Jw if turns else poses[i].Jv
            gain = J @ xdd
            found.append((J[axis], gain[axis], gain * turns, poses[i].Jw * turns, axis))
        return found

    P = np.array([one[0] for one in twists(x0)])
    turned = np.array([np.cross(one[2], one[3].T)[:, one[4]] for one in twists(x0)])
    slopes = differences(lambda x: np.array([one[1] for one in twists(x)]), x0) + turned
    expected = slopes @ np.linalg.inv(P)
    np.testing.assert_allclose(-np.linalg.solve(linear.M, linear.K), expected, atol=CLOSE * np.abs(expected).max())


def test_components_of_a_force_that_joints_take_up():
    """The force as a whole has a column for each; one alone is refused if it does no work."""
    scene = pendulums([0.0])
    push = scene.add(F.PointForce(scene.bodies[0], force=(1.0, 2.0, 3.0), name="push"))
    whole = scene.linearise(inputs=[push]).state_space().B
    np.testing.assert_allclose(whole[:, :1], scene.linearise(inputs=["push.x"]).state_space().B, rtol=HELD)
    assert np.abs(whole[:, 0]).max() > 0.0
    assert np.abs(whole[:, 1:]).max() <= HELD * np.abs(whole).max()
    with pytest.raises(ts.InvalidArgument, match=r"push\.y does no work"):
        scene.linearise(inputs=["push.y"])


def test_what_has_no_linearisation_is_refused_by_name():
    scene = pendulums([0.0, 0.0])
    with pytest.raises(ts.InvalidArgument, match="sequence"):
        scene.linearise(inputs="pin 0")
    with pytest.raises(ts.InvalidArgument, match="pin 1"):
        scene.linearise(inputs=["pin 7"])
    with pytest.raises(ts.InvalidArgument, match="state"):
        scene.linearise(state=3.0)
    with pytest.raises(ts.InvalidCall, match="outputs"):
        scene.linearise(output=[])
    scene.bodies[0].position = (0.1, 0.0, 0.0)
    with pytest.raises(ts.InconsistentState, match="pin 0"):
        scene.linearise()
    driven = pendulums([0.0])
    motor = driven.add(C.RotationMotor.of(driven["pin 0"], angle=0.0, name="motor"))
    with pytest.raises(ts.InvalidArgument, match="motor"):
        driven.linearise(inputs=[motor])
    sampled = pendulums([0.0])
    sampled.add(F.JointTorque(sampled["pin 0"], function=lambda t, x, rate: -x, period=0.1, name="servo"))
    with pytest.raises(ts.InvalidForce, match="servo"):
        sampled.linearise()


@pytest.mark.slow
def test_a_kink_is_refused_where_it_matters():
    scene = pendulums([0.0])
    scene.add(F.JointTorque(scene["pin 0"], function=stop, name="stop"))
    scene.set("pin 0", angle=0.3)
    assert scene.linearise().K[0, 0] == pytest.approx(1.3 * G * 0.35 * np.cos(0.3) + 500.0, rel=FINE)
    straight = pendulums([0.0])
    straight.add(F.JointTorque(straight["pin 0"], function=stop, name="stop"))
    with pytest.raises(ts.InvalidForce, match="stop"):
        straight.linearise()


def stop(t, angle, rate):
    """A one-sided spring."""
    return -500.0 * angle if angle > 0.0 else 0.0


def test_singular_configuration_is_refused():
    flat = parallelogram(angle=0.0, rate=0.0)
    with pytest.raises(ts.SingularConfiguration):
        flat.linearise()


def test_friction_in_a_joint_at_rest_is_damping():
    """A pin with friction: mu_s R_f / v_0 times the load, by the slope of the regularised law."""
    scene = pendulums([0.0], inertia=0.1)
    scene.add(F.RevoluteFriction(scene["pin 0"], radius=0.01, kinetic=0.2, slip_velocity=1e-3, name="rough"))
    linear = scene.linearise()
    assert linear.C[0, 0] == pytest.approx(0.2 * 0.01 * 1.3 * G * 0.01 / 1e-3, rel=CLOSE)


def test_long_chain():
    linear = pendulums(np.zeros(150)).linearise()  # above the size where matrices are sparse
    expected = np.sqrt(eigh(*pendulum_matrices(150)[::-1], eigvals_only=True))
    np.testing.assert_allclose(2.0 * np.pi * linear.modes().frequency, expected, rtol=CLOSE)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_every_force_and_a_driven_rod_in_motion(seed):
    """M dxdd + C dxd + K dx = 0 along curves of states, by differences of `scene.evaluate`."""
    rng = np.random.default_rng(seed)
    scene, _ = everything(rng)
    q, qd = scene.start
    qd = qd + 0.5 * rng.normal(size=qd.size)
    t = 0.0

    def state(x):
        """The nearest consistent state, with its accelerations."""
        p, v = x[: q.size].copy(), x[q.size :]
        for _ in range(6):
            now = scene.evaluate(p, v, t)
            p = p - np.linalg.pinv(now.Phi_q) @ now.Phi
        now = scene.evaluate(p, v, t)
        v = v - np.linalg.pinv(now.Phi_q) @ (now.Phi_q @ v + now.Phi_t)
        return p, v, scene.evaluate(p, v, t).qdd

    q, qd, _ = state(np.concatenate((q, qd)))
    scene.place(q, qd)
    linear = scene.linearise()
    motion = NominalMotion(scene.packed, np.zeros(scene.system.memory.size), t, q, qd)
    variations = Variations(motion, np.zeros(3))
    every = {one.name: one for one in (*variations.joints, *variations.bodies)}
    Z, Zd, Zdd = stacked([every[name] for name in linear.coordinates], q.size)
    for _ in range(3):
        way = rng.normal(size=2 * q.size)
        curve = differences(lambda s: np.concatenate(state(np.concatenate((q, qd)) + s[0] * way)), np.zeros(1), h=4e-4)  # noqa: B023
        dq, dqd, dqdd = curve[:, 0].reshape(3, -1)
        dx, dxd, dxdd = Z @ dq, Z @ dqd + Zd @ dq, Z @ dqdd + 2.0 * Zd @ dqd + Zdd @ dq
        parts = linear.M @ dxdd, linear.C @ dxd, linear.K @ dx
        np.testing.assert_allclose(sum(parts), 0.0, atol=CLOSE * max(np.abs(part).max() for part in parts))


def test_joint_that_constraints_hold_is_no_coordinate():
    scene = ts.Scene()
    one, two = (scene.add_body(1.0, (1, 1, 1), (x, 0, 0), name=name) for x, name in ((0.5, "one"), (1.5, "two")))
    scene.add(ts.constraints.Spherical.at(scene.ground, one, point=(0, 0, 0)))
    scene.add(ts.constraints.Fixed.at(one, two, point=(1, 0, 0)))
    scene.add(ts.constraints.Revolute.at(one, two, point=(1, 0, 0), axis=(0, 1, 0), name="hinge"))
    assert not any("hinge" in name for name in scene.linearise().coordinates)


def wire(j):
    """A slender body with inertia j about its axis, hinged about this with a torsional spring of 1e-6 N m."""
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(1.0, (1e-2, 1e-2, j), position=(0, 0, -0.5), name="wire")
    scene.add(ts.constraints.Spherical.at(scene.ground, body, point=(0, 0, 0), name="end"))
    directions = {"axis_a": (0, 0, 1), "reference_a": (1, 0, 0), "reference_b": (1, 0, 0)}
    scene.add(ts.forces.TorsionalSpring(scene.ground, body, **directions, stiffness=1e-6, name="torsion"))
    return scene


@pytest.mark.parametrize("j", [1e-5, 1e-8, 1e-10, 1e-12])
def test_torsion_of_a_slender_body(j):
    found, expected = wire(j).linearise(), np.sqrt(1e-6 / j)
    A = found.state_space().A
    np.testing.assert_allclose(np.abs(found.eigenvalues()).max(), expected, rtol=HELD)
    np.testing.assert_allclose(2 * np.pi * found.modes().frequency.max(), expected, rtol=HELD)
    np.testing.assert_allclose(np.abs(np.linalg.eigvals(A)).max(), expected, rtol=HELD)
    shape = found.modes().shapes[-1].real
    assert shape @ found.M @ shape == pytest.approx(1.0, rel=HELD)
    assert wire(j).equilibrium().smallest_stiffness == pytest.approx(1e-6 / j, rel=HELD)


def test_damping_ratio_of_a_slender_body():
    scene = wire(1e-10)
    directions = {"axis_a": (0, 0, 1), "reference_a": (1, 0, 0), "reference_b": (1, 0, 0)}
    scene.add(ts.forces.TorsionalSpring(scene.ground, scene["wire"], **directions, stiffness=0.0, damping=2e-9))
    assert scene.linearise().modes().damping_ratio[-1] == pytest.approx(0.1, rel=HELD)


def test_a_rod_is_as_slender_as_it_is():
    scene = ts.Scene()
    rod = scene.add_body(**ts.shapes.rod(1.0, axis="z", mass=1.0), position=(0, 0, -0.5), name="rod")
    scene.add(ts.constraints.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 1, 0)))
    assert scene.equilibrium().smallest_stiffness == pytest.approx(1.5 * 9.81, rel=HELD)
    np.testing.assert_allclose(np.abs(scene.linearise().eigenvalues()), np.sqrt(1.5 * 9.81), rtol=HELD)
