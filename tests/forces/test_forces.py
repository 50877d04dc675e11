"""Every force against closed formulas of the tests' own, and its Jacobians against differences."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.built_in import FORCES, by_name
from tests.helpers.scenes import product, rotate, rotation, unit
from tests.helpers.tolerances import COARSE, FAIR, ROUNDING, TIGHT
from tsdyn.observables.generalised_forces import force_loads

F = ts.forces
FORMULA = {"rtol": 1e-12, "atol": 1e-12}


def pair(rng):
    """Two turning bodies."""
    scene = ts.Scene()
    for _ in range(2):
        scene.add_body(
            1.5,
            (1.0, 1.1, 1.2),
            position=rng.normal(size=3),
            orientation=unit(rng, 4),
            velocity=rng.normal(size=3),
            angular_velocity=rng.normal(size=3),
        )
    return scene, *scene.bodies


def load_of(scene, body, t=0.0):
    """Force and torque about the centroid, ground frame, that all forces exert on a body: Q_r and E Q_p / 2."""
    (q, qd), at = scene.start, int(scene.system.bodies[body.index, 0])
    memory = np.append(np.zeros(scene.system.memory.size), np.ones(scene.system.normals.size))  # normal loads of one
    Q = force_loads(scene.system, np.array([t]), q[None], qd[None], memory[None])[0]
    e0, e = body.orientation[0], body.orientation[1:]
    E = np.column_stack((-e, [[e0, -e[2], e[1]], [e[2], e0, -e[0]], [-e[1], e[0], e0]]))
    return Q[at : at + 3], E @ Q[at + 3 : at + 7] / 2


def place(body, s):
    """Position and velocity of a point, ground frame."""
    A, s = rotation(body.orientation), np.asarray(s, float)
    return body.position + A @ s, body.velocity + A @ np.cross(body.angular_velocity, s)


def turning(body):
    return rotation(body.orientation) @ body.angular_velocity


def expect(scene, body, force, torque_about_centroid, t=0.0):
    got = load_of(scene, body, t)
    np.testing.assert_allclose(got[0], force, **FORMULA)
    np.testing.assert_allclose(got[1], torque_about_centroid, **FORMULA)


def test_every_force_is_public():
    assert set(F.__all__) == {kind.__name__ for kind in FORCES} | {"registered"}


@pytest.mark.slow
@pytest.mark.parametrize("kind", FORCES, **by_name)
@pytest.mark.parametrize("seed", range(2))
def test_kernels_jacobians_and_power(kind, seed):
    ts.testing.check_force(kind, seed=seed)


def wave(t):
    return (np.sin(3 * t), t * t, 1.0)


def follow(t, state):
    return (state[4] * t - state[7], state[0] * state[12], np.sin(state[8]))


TABLE = ts.Table(np.linspace(0, 1, 9), np.sin(np.arange(27.0)).reshape(9, 3))


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["ground", "body"])
@pytest.mark.parametrize("load", [(1, 2, 3), wave, follow, TABLE], ids=["constant", "time", "state", "table"])
@pytest.mark.parametrize(("kind", "word"), [(F.PointForce, "force"), (F.Torque, "torque")])
def test_jacobians_of_loads(kind, word, load, frame):
    ts.testing.check_force(lambda a, b: kind(a, **{word: load}, frame=frame), states=1)


def test_spring(rng):
    scene, a, b = pair(rng)
    one, two = rng.normal(size=(2, 3))
    scene.add(
        F.Spring(a, b, point_a=one, point_b=two, stiffness=3.0, damping=0.7, free_length=0.4, actuator=lambda t: 2 * t)
    )
    (x, xd), (y, yd) = place(a, one), place(b, two)
    length = np.linalg.norm(y - x)
    along = (y - x) / length
    pull = (3.0 * (length - 0.4) + 0.7 * along @ (yd - xd) + 2 * 0.3) * along
    expect(scene, a, pull, np.cross(x - a.position, pull), 0.3)
    expect(scene, b, -pull, np.cross(y - b.position, -pull), 0.3)


def test_spring_is_free_at_the_start(rng):
    scene, a, b = pair(rng)
    spring = scene.add(F.Spring(a, b, point_a=(1, 2, 3), stiffness=3.0))
    assert spring.free_length == pytest.approx(np.linalg.norm(place(a, (1, 2, 3))[0] - b.position), rel=ROUNDING)
    expect(scene, a, (0, 0, 0), (0, 0, 0))


@pytest.mark.parametrize("turn", [0.3, 2.0, -3.0])
def test_torsional_spring(rng, turn):
    scene, a, b = pair(rng)
    axis, reference = unit(rng), rng.normal(size=3)
    u = rotate(a.orientation, axis)
    b.orientation = product(np.append(np.cos(turn / 2), np.sin(turn / 2) * u), a.orientation)
    b.angular_velocity = rng.normal(size=3)
    b_axes = reference - axis * (axis @ reference)
    scene.add(
        F.TorsionalSpring(
            a, b, axis_a=axis, reference_a=reference, reference_b=b_axes, stiffness=3, damping=0.7, free_angle=0.2,
            actuator=0.4,
        )
    )  # fmt: skip
    torque = (0.4 - 3 * (turn - 0.2) - 0.7 * u @ (turning(b) - turning(a))) * u
    expect(scene, b, (0, 0, 0), torque)
    expect(scene, a, (0, 0, 0), -torque)


def test_bushing(rng):
    scene, a, b = pair(rng)
    one, two = rng.normal(size=(2, 3))
    K, C, Kt, Ct = rng.uniform(0.5, 2, size=(4, 3))
    scene.add(
        F.Bushing(a, b, point_a=one, point_b=two, stiffness=K, damping=C, torsional_stiffness=Kt, torsional_damping=Ct)
    )
    (x, xd), (y, yd), A = place(a, one), place(b, two), rotation(a.orientation)
    rate = A.T @ (yd - xd - np.cross(turning(a), y - x))
    force = A @ (K * (A.T @ (y - x)) + C * rate)
    e0, *e = product(a.orientation * [1, -1, -1, -1], b.orientation)
    phi = 2 * np.array(e)
    torque = A @ (e0 * Kt * phi + np.cross(e, Kt * phi) + Ct * (A.T @ (turning(b) - turning(a))))
    expect(scene, a, force, np.cross(y - a.position, force) + torque)
    expect(scene, b, -force, np.cross(y - b.position, -force) - torque)
    before = load_of(scene, b)
    b.orientation = -b.orientation  # the same attitude
    np.testing.assert_allclose(load_of(scene, b), before, **FORMULA)


def test_bushing_is_linear_for_small_turns(rng):
    scene, a, b = pair(rng)
    small = 1e-6 * rng.normal(size=3)
    b.orientation = product(a.orientation, np.append(1.0, small / 2) / np.sqrt(1 + small @ small / 4))
    scene.add(F.Bushing(a, b, torsional_stiffness=(1, 2, 3)))
    torque = rotate(a.orientation, np.array([1, 2, 3]) * small)
    np.testing.assert_allclose(load_of(scene, a)[1], torque, rtol=0, atol=TIGHT)


@pytest.mark.slow
def test_point_force_and_torque(rng):
    scene, a, _ = pair(rng)
    s, load, A = rng.normal(size=3), rng.normal(size=3), rotation(a.orientation)
    x, xd = place(a, s)
    state = np.concatenate((x, a.orientation, xd, turning(a)))
    cases = [
        (load, load),
        (wave, np.array(wave(0.4))),
        (TABLE, CubicSpline(TABLE.times, TABLE.values)(0.4)),
        (follow, np.array(follow(0.4, state))),
    ]
    for frame, turned in (("ground", np.eye(3)), ("body", A)):
        for given, value in cases:
            scene, a2, _ = pair(np.random.default_rng(0))
            for name in ("position", "orientation", "velocity", "angular_velocity"):
                setattr(a2, name, getattr(a, name))
            scene.add(F.PointForce(a2, point_a=s, force=given, frame=frame))
            expect(scene, a2, turned @ value, np.cross(x - a.position, turned @ value), 0.4)
            scene, a2, _ = pair(np.random.default_rng(0))
            for name in ("position", "orientation", "velocity", "angular_velocity"):
                setattr(a2, name, getattr(a, name))
            scene.add(F.Torque(a2, torque=given, frame=frame))
            if given is follow:
                centre = np.concatenate((a.position, a.orientation, a.velocity, turning(a)))
                value = np.array(follow(0.4, centre))
            expect(scene, a2, (0, 0, 0), turned @ value, 0.4)


def test_frictions(rng):
    scene, a, b = pair(rng)
    s = rng.normal(size=3)
    x, xd = place(a, s)
    slip = xd - b.velocity - np.cross(turning(b), x - b.position)
    spin = turning(a) - turning(b)
    viscous = F.ViscousFriction(a, b, point_a=s, damping=0.7, torsional_damping=0.3)
    coulomb = F.CoulombFriction(a, b, point_a=s, force=2.0, torque=1.5, slip_velocity=0.1, slip_rate=0.2)
    expected = np.zeros((2, 3))
    for friction, force, torque in (
        (viscous, -0.7 * slip, -0.3 * spin),
        (coulomb, -2 * slip / np.hypot(np.linalg.norm(slip), 0.1), -1.5 * spin / np.hypot(np.linalg.norm(spin), 0.2)),
    ):
        scene.add(friction)
        expected += force, torque
        force, torque = expected
        expect(scene, a, force, torque + np.cross(x - a.position, force))
        expect(scene, b, -force, -torque - np.cross(x - b.position, force))


def test_coulomb_friction_stops_a_mass_where_it_should():
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(2.0, velocity=(3, 0, 0))
    scene.add(F.CoulombFriction(mass, scene.ground, force=4.0, slip_velocity=1e-3))
    solution = ts.simulate(scene, (0, 2), integrator=ts.integrators.RK45(1e-8, 1e-8)).raise_if_failed()
    assert solution.q[-1, 0] == pytest.approx(3.0**2 / (2 * 4.0 / 2.0), abs=COARSE)


def gravitation(t, a, b, par, out):
    d = a[:3] - b[:3]
    if t < -1.0:
        raise ValueError
    r = np.sqrt(np.sum(d * d))
    for i in range(3):
        out[i] = -par[0] * d[i] / r**3


@pytest.mark.slow
def test_user_force_between_point_masses():
    """A circular orbit of two masses."""
    scene = ts.Scene(gravity=(0, 0, 0))
    one = scene.add_point_mass(1.0, (1, 0, 0), (0, 0.5, 0))
    two = scene.add_point_mass(1.0, (-1, 0, 0), (0, -0.5, 0))
    scene.add(F.UserForce(one, two, function=gravitation, parameters=[1.0]))
    period = 4 * np.pi
    solution = ts.simulate(scene, (0, period), integrator=ts.integrators.RK45(1e-10, 1e-10)).raise_if_failed()
    np.testing.assert_allclose(solution.q[-1], solution.q[0], atol=FAIR)


@pytest.mark.slow
def test_user_force_has_all_of_both_states(rng):
    scene, a, b = pair(rng)
    one, two = rng.normal(size=(2, 3))
    (x, xd), (y, yd) = place(a, one), place(b, two)
    states = [np.concatenate((z, body.orientation, zd, turning(body))) for z, zd, body in ((x, xd, a), (y, yd, b))]
    weights = rng.normal(size=26)

    def everything(t, a, b, par, out):
        total = t
        for i in range(13):
            total += par[i] * a[i] + par[13 + i] * b[i]
        for i in range(6):
            out[i] = total * (i + 1)

    force = scene.add(F.UserForce(a, b, function=everything, point_a=one, point_b=two, parameters=weights))
    for _ in range(2):
        total = 0.3 + force.values @ np.concatenate(states)
        push, torque = total * np.array([1, 2, 3]), total * np.array([4, 5, 6])
        expect(scene, a, push, torque + np.cross(x - a.position, push), 0.3)
        expect(scene, b, -push, -torque - np.cross(x - b.position, push), 0.3)
        force.values = 2 * weights


@pytest.mark.slow
def test_one_function_is_compiled_once(rng):
    scene, a, b = pair(rng)
    forces = [scene.add(F.UserForce(body, function=gravitation, parameters=[k])) for k, body in ((1.0, a), (2.0, b))]
    assert forces[0].kernels is forces[1].kernels
    assert len(scene.system.forces) == 1


INTERNAL = [kind for kind in FORCES if kind not in (F.PointForce, F.Torque, F.Control)]


@pytest.mark.slow_for("UserForce", "*Friction")
@pytest.mark.parametrize("kind", INTERNAL, ids=lambda kind: kind.__name__)
def test_internal_forces_keep_the_momentum(kind, rng):
    scene, a, b = pair(rng)
    scene.add(kind.example(rng, a, b))
    (f, n), (g, m) = load_of(scene, a, 0.5), load_of(scene, b, 0.5)
    size = 1 + np.abs((f, n, g, m)).max() * 10
    assert np.abs(f + g).max() < ROUNDING * size
    assert np.abs(n + np.cross(a.position, f) + m + np.cross(b.position, g)).max() < ROUNDING * size


@pytest.mark.parametrize("kind", [k for k in INTERNAL if k is not F.UserForce], ids=lambda kind: kind.__name__)
def test_moving_the_whole_scene_turns_the_forces(kind, rng):
    scene, a, b = pair(rng)
    scene.add(kind.example(rng, a, b))
    before = [load_of(scene, body) for body in (a, b)]
    p, shift, drift, spin = unit(rng, 4), *rng.normal(size=(3, 3))
    R = Rotation.from_quat(np.roll(p, -1)).as_matrix()
    for body in (a, b):
        body.position, body.orientation = R @ body.position + shift, product(p, body.orientation)
        body.velocity = R @ body.velocity + drift + np.cross(spin, body.position)
        body.angular_velocity = body.angular_velocity + rotation(body.orientation).T @ spin
    for body, (force, torque) in zip((a, b), before, strict=True):
        expect(scene, body, R @ force, R @ torque)


def test_the_sum_in_evaluate(rng):
    scene, a, _ = pair(rng)
    scene.add(F.PointForce(a, force=(1, 2, 3)))
    scene.add(F.PointForce(a, force=(1, 0, 0)))
    np.testing.assert_allclose(scene.evaluate().Q_A[:3], (2, 2, 3 - 1.5 * 9.81))
    assert scene.forces[0].name == "PointForce(body1)"
    assert "2 forces" in repr(scene)


def test_attributes_can_be_set(rng):
    scene, a, _ = pair(rng)
    push = scene.add(F.PointForce(a, force=(1, 2, 3)))
    push.force = (3, 2, 1)
    push.point_a = (0, 0, 1)
    x = place(a, (0, 0, 1))[0]
    expect(scene, a, (3, 2, 1), np.cross(x - a.position, (3, 2, 1)))
    push.force = wave
    expect(scene, a, wave(0.3), np.cross(x - a.position, wave(0.3)), 0.3)
    with pytest.raises(ts.UnknownAttribute, match="did you mean force"):
        push.forse = (1, 1, 1)
    with pytest.raises(ts.InvalidForce, match="three finite"):
        push.force = (1, 1)
    push.force = (0, 0, 0)
    expect(scene, a, np.zeros(3), np.zeros(3))
