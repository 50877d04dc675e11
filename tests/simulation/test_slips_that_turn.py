"""Slips whose direction turns where they are slow: as they begin and end, in scenes of any length, by long steps."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts
from tests.helpers.rough_boxes import FLOOR, G
from tsdyn.elements.friction import HEADING_ROWS, heading, heading_series
from tsdyn.jit.kernels import twin
from tsdyn.stress import laws
from tsdyn.stress.judgement import run_case
from tsdyn.stress.random_scenes import CONTACTS, drawn

C = ts.constraints
D = np.array((2e-7, 0.0, 0.0))


def headed(v):
    """The direction of friction of a slip v, in units of |D|, which has the direction D where it is slow."""
    return np.array(twin(heading)(*(2e-7 * np.asarray(v)), D, 1.0))


def test_friction_is_against_what_a_slip_has_across_its_direction():
    """A slow slip keeps its direction; a fast one that is at right angles to it, or just beyond, has its own."""
    np.testing.assert_allclose(headed((3.0, 0.0, 0.0)), (1, 0, 0), atol=1e-15)
    np.testing.assert_allclose(headed((-3.0, 0.0, 0.0)), (1, 0, 0), atol=1e-15)
    np.testing.assert_allclose(headed((0.0, 1e-4, 0.0)), (1, 0, 0), atol=2e-12)
    np.testing.assert_allclose(headed((1e5, 1e5, 0.0)), np.array((1, 1, 0)) / np.sqrt(2.0), atol=1e-9)
    before, at, beyond = (headed((x, 1e4, 0.0)) for x in (0.1, 0.0, -0.1))
    np.testing.assert_allclose(at, (1e-4, 1, 0), atol=1e-7)
    np.testing.assert_allclose([before, beyond], [at, at], atol=1e-6)


@pytest.mark.parametrize("v", [(1.0, 0.3, 0.1), (0.01, 2.0, -0.4), (-0.5, 0.2, 0.0), (30.0, 40.0, 5.0)])
def test_the_series_of_that_direction(v):
    rate, t, orders = np.array((0.1, -0.2, 0.3)), 0.05, 14
    s = np.zeros((3 + HEADING_ROWS, orders))
    s[:3, 0], s[:3, 1] = 2e-7 * np.array(v), 2e-7 * rate
    terms = np.array([twin(heading_series)(s, 0, 3, D, 1.0, k) for k in range(orders)])
    np.testing.assert_allclose(t ** np.arange(orders) @ terms, headed(v + rate * t), atol=1e-13)


def test_a_slip_that_does_not_slide_has_no_direction():
    s, none = np.zeros((3 + HEADING_ROWS, 3)), np.zeros(3)
    s[:3, :2] = 1.0
    assert not any(any(twin(heading_series)(s, 0, 3, none, 1.0, k)) for k in range(3))
    assert not any(twin(heading)(1.0, 2.0, 3.0, none, 1.0))
    assert not any(twin(heading)(0.0, 0.0, 0.0, none, 1.0))


@pytest.mark.parametrize(
    ("seed", "most"),
    [(5002025, 2), pytest.param(5002051, 2, marks=pytest.mark.slow), pytest.param(6000308, 3, marks=pytest.mark.slow)],
    ids=["taylor", "stiff", "long steps from rest"],
)
def test_coins_that_begin_to_slip_across_their_load(seed, most):
    """The load of a coin that rolls turns faster than it grows: the slip was along a line at the wrong side."""
    solution = run_case(drawn(np.random.default_rng(seed), 1, most, {"coins": CONTACTS["coins"]}))
    assert solution.success
    assert not [found for law in (laws.rubbing, laws.unilateral) for found in law(solution) if found.broken]


@pytest.mark.parametrize("unilateral", [False, True], ids=["bilateral", "unilateral"])
@pytest.mark.parametrize(("growth", "turn"), [(0.2, 0.4), (0.2, 4.0), (0.01, 1.0)])
def test_a_block_breaks_away_under_a_load_that_turns(growth, turn, unilateral):
    """The load grows to mu m g at 1 s, and turns faster than it grows: m v' = L - mu m g v / |v|, v = 0 there."""
    scene, mu, t = ts.Scene(gravity=(0, 0, -G)), 0.3, ts.motions.time
    block = scene.add_point_mass(1.0, name="block")
    given = {"unilateral": True, "kinetic": mu} if unilateral else {}
    floor = scene.add(C.PlaneContact(block, scene.ground, normal_b=(0, 0, 1), **given, name="rub"))
    if not unilateral:
        floor.name = "floor"
        scene.add(ts.forces.ContactFriction(floor, kinetic=mu, name="rub"))
    size = mu * G * (1.0 + growth * (t - 1.0))
    scene.add(ts.forces.PointForce(block, force=(size * np.cos(turn * t), size * np.sin(turn * t), 0.0)))
    solution = ts.simulate(scene, (0, 1.5), rtol=1e-10, atol=1e-12)

    def rates(t, y):
        load = (1.0 + growth * (t - 1.0)) * np.array([np.cos(turn * t), np.sin(turn * t)])
        return np.append(y[2:], mu * G * (load - y[2:] / np.hypot(*y[2:])))

    begin = 1e-5  # s, up to which the slip is along the load
    way = np.array([np.cos(turn * (1.0 + begin)), np.sin(turn * (1.0 + begin))])
    start = np.append([0.0, 0.0], 0.5 * mu * G * growth * begin**2 * way)
    exact = solve_ivp(rates, (1.0 + begin, 1.5), start, method="Radau", rtol=1e-9, atol=1e-13).y[:2, -1]
    assert [phase.sticking for phase in solution.phases] == [("rub",), ()]
    assert abs(solution.phases[0].end - 1.0) * growth < 1e-15
    np.testing.assert_allclose(solution.position("block")[-1, :2], exact, atol=1e-8)


@pytest.mark.parametrize("method", [ts.integrators.Nystrom4(step=1e-5), "rk45"], ids=["nystrom4", "rk45"])
def test_a_small_coin_keeps_its_gap(method):
    """Its radius is the only length of the scene: gaps are held to rounding of it, not of axes of length one."""
    scene, radius = ts.Scene(gravity=(0, 0, -G)), 2e-6
    axis, height = np.array((0.6, 0.0, 0.8)), 0.6 * radius
    start = {"velocity": (1e-3, 0, 0), "angular_velocity": (100.0, 0, 700.0)}
    coin = scene.add_body(1.0, (1e-12, 1e-12, 2e-12), (0, 0, height), **start, name="coin")
    given = {"axis_a": axis, "radius": radius, "normal_b": (0, 0, 1), "kinetic": 0.3}
    scene.add(C.RollingDisc(coin, scene.ground, **given, name="floor"))
    assert scene.packed.size == radius
    solution = ts.simulate(scene, (0, 2e-3), integrator=method)
    sine = np.sqrt(1.0 - (solution.rotation("coin")[:, 2] @ axis) ** 2)
    gap = solution.position("coin")[:, 2] - radius * sine
    closed = np.abs(solution.multipliers[:, 0]) > 0.0
    assert closed.sum() > 10
    assert np.abs(gap[closed]).max() < 1e-13 * radius


LEGS = 0.3 + 2.0 * np.pi / 3.0 * np.arange(3)


@pytest.mark.parametrize(("speed", "spin"), [(1.0, 2.0), (1.0, 8.0), (0.3, 3.0)])
def test_a_tripod_slides_and_spins_to_rest(speed, spin):
    """Legs carry a third each, as the centre of mass is at the floor's height: an ODE of the plane up to 1e-7 m/s."""
    m, r, mu, inertia = 2.0, 0.5, 0.3, 0.08

    def rate(t, y):
        p = r * np.array([np.cos(y[2] + LEGS), np.sin(y[2] + LEGS)])
        u = y[3:5, None] + y[5] * np.array([-p[1], p[0]])
        f = -mu * m * G / 3.0 * u / np.linalg.norm(u, axis=0)
        return [*y[3:], *(f.sum(axis=1) / m), (p[0] * f[1] - p[1] * f[0]).sum() / inertia]

    def left(t, y):
        return np.hypot(np.hypot(y[3], y[4]), r * y[5]) - 1e-7

    left.terminal = True
    begin = [0.0, 0.0, 0.0, speed, 0.0, spin]
    known = solve_ivp(rate, (0, 2), begin, method="DOP853", rtol=1e-12, atol=1e-15, events=left)
    scene = ts.Scene(gravity=(0, 0, -G))
    plate = scene.add_body(m, np.full(3, inertia), velocity=(speed, 0, 0), angular_velocity=(0, 0, spin), name="plate")
    for angle in LEGS:
        foot = (r * np.cos(angle), r * np.sin(angle), 0.0)
        scene.add(C.PlaneContact(plate, scene.ground, point_a=foot, **FLOOR, kinetic=mu))
    solution = ts.simulate(scene, (0, 1), rtol=1e-10, atol=1e-12)
    end = solution.phases[-1][0]
    assert 0.0 < end - known.t[-1] < 2e-7
    np.testing.assert_allclose(solution.position("plate")[-1], [*known.y[:2, -1], 0.0], atol=1e-11)
    assert not solution.qd[-1].any()


def test_a_ball_rolls_in_a_bowl_that_turns():
    """Rolling, v = W x R n - r w x n at the contact along n, and momenta; F eliminated."""
    R, r, m, rate = 1.0, 0.1, 1.5, 2.0
    inertia, g, W, start = 0.4 * m * r * r, np.array((0, 0, -G)), np.array((0, 0, rate)), np.array((0.6, 0.0, -0.8))
    v = np.array((0.0, 1.0, 0.0))
    spin = np.cross(start, np.cross(W, R * start) - v) / r

    def rates(t, y):
        n, w = y[:3] / (R - r), y[3:]
        v = np.cross(W, R * n) - r * np.cross(w, n)
        nd = v / (R - r)
        known = r * m * np.cross(n, np.cross(W, R * nd) - r * np.cross(w, nd) - g)
        mass = (inertia + m * r * r) * np.eye(3) - m * r * r * np.outer(n, n)
        return [*v, *np.linalg.solve(mass, known)]

    known = solve_ivp(rates, (0, 2), [*(R - r) * start, *spin], method="DOP853", rtol=1e-12, atol=1e-13)
    scene = ts.Scene(gravity=g)
    bowl = scene.add_body(5.0, (1, 1, 1), angular_velocity=W, name="bowl")
    hinge = scene.add(C.Revolute.at(scene.ground, bowl, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(C.RotationMotor.of(hinge, angle=ts.motions.Ramp(0.0, rate)))
    ball = scene.add_body(m, np.full(3, inertia), (R - r) * start, velocity=v, angular_velocity=spin, name="ball")
    scene.add(C.SphereContact(ball, bowl, radius_a=r, radius_b=R, inside=True, kinetic=2.0, name="wall"))
    solution = ts.simulate(scene, (0, 2), rtol=1e-11, atol=1e-12)
    assert solution.success
    assert solution.sticking("wall").all()
    np.testing.assert_allclose(solution.position("ball")[-1], known.y[:3, -1], atol=1e-9)
