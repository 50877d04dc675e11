"""Exact friction of joints beside friction of contacts: one problem says what sticks, slides and opens."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.calls import same_run
from tests.helpers.resuming import Stop
from tests.helpers.tolerances import ALGEBRA, CLOSE, HELD, TIGHT

C, F = ts.constraints, ts.forces
G = 9.81


def hold_orientation(scene, body):
    for k in range(3):
        axes = {"axis_a": np.eye(3)[k], "axis_b": np.eye(3)[(k + 1) % 3]}
        scene.add(C.Dot1(body, scene.ground, **axes))


def cart(speed=2.0, bearing=0.3, **given):
    """A wheel of 2 kg and 0.4 m on a rough floor; 5 kg rest on its rough axle, of 0.05 m."""
    scene = ts.Scene(gravity=(0, 0, -G))
    start = {"position": (0, 0, 0.4), "velocity": (speed, 0, 0)}
    load = scene.add_body(5.0, (1, 1, 1), **start, name="load")
    wheel = scene.add_body(2.0, (0.1, 0.16, 0.1), **start, angular_velocity=(0, speed / 0.4, 0), name="wheel")
    axle = scene.add(C.Revolute.at(load, wheel, point=(0, 0, 0.4), axis=(0, 1, 0), name="axle"))
    hold_orientation(scene, load)
    scene.add(C.SphereContact(wheel, scene.ground, radius_a=0.4, normal_b=(0, 0, 1), kinetic=0.8, name="floor"))
    scene.add(F.RevoluteFriction(axle, radius=0.05, kinetic=bearing, name="bearing", **given))
    return scene


def slowing(bearing=0.3):
    """Of the cart: (I / R^2 + m + M) a = mu r / R M sqrt(g^2 + a^2)."""
    mass, drag = 8.0, bearing * 0.05 / 0.4 * 5.0
    return drag * G / np.sqrt(mass**2 - drag**2)


@pytest.mark.slow_for("*null-space*")
@pytest.mark.parametrize("given", [{}, {"formulation": "null-space"}], ids=str)
def test_a_wheel_with_a_rough_axle_rolls_to_rest(given):
    solution = ts.simulate(cart(), (0, 12), rtol=1e-13, atol=1e-13, **given)
    end = 2.0 / slowing()
    assert [names for _, _, names in solution.phases] == [
        ("floor",),
        ("floor", "bearing"),
    ]
    assert solution.sticking("floor").all()
    assert abs(solution.phases[1][0] - end) < HELD * end
    assert abs(solution.position("load")[-1, 0] - end) < HELD * 10
    force = solution.reaction("floor")[0]
    np.testing.assert_allclose(force[0], [-7.0 * slowing(), 0.0, 7.0 * G], atol=HELD * 100)
    np.testing.assert_allclose(force[-1], [0.0, 0.0, 7.0 * G], atol=HELD * 100)


def test_a_locked_axle_makes_the_wheel_slide():
    """The load doesn't turn, so neither does the wheel: it slides by mu g."""
    scene = cart(speed=3.0, bearing=1e3)
    scene["wheel"].angular_velocity = (0, 0, 0)
    solution = ts.simulate(scene, (0, 1))
    assert solution.phases[0][2] == ("floor", "bearing")
    assert abs(solution.phases[0][1] - 3.0 / (0.8 * G)) < HELD
    assert abs(solution.position("wheel")[-1, 0] - 4.5 / (0.8 * G)) < HELD


def block(slope, mu, hinge, angle, rate=0.0):
    """A block of 4 kg on a slope, along x down it, with an arm of 1 kg and 0.1 kg m^2 whose centre is 0.5 m off."""
    scene = ts.Scene(gravity=(G * np.sin(slope), 0, -G * np.cos(slope)))
    body = scene.add_body(4.0, (1, 1, 1), name="block")
    e, turn = np.array([np.cos(angle), 0, -np.sin(angle)]), (np.cos(angle / 2), 0, np.sin(angle / 2), 0)
    velocity = 0.5 * rate * np.array([-np.sin(angle), 0, -np.cos(angle)])
    motion = {"orientation": turn, "velocity": velocity, "angular_velocity": (0, rate, 0)}
    arm = scene.add_body(1.0, (0.1, 0.1, 0.1), position=0.5 * e, **motion, name="arm")
    axes = {"point_b": (-0.5, 0, 0), "axis_a": (0, 1, 0), "axis_b": (0, 1, 0)}
    scene.add(C.Revolute(body, arm, **axes, name="hinge"))
    hold_orientation(scene, body)
    scene.add(C.PlaneContact(body, scene.ground, normal_b=(0, 0, 1), unilateral=True, kinetic=mu, name="floor"))
    scene.add(F.RevoluteFriction(scene["hinge"], radius=0.05, kinetic=hinge, name="rough"))
    return scene


def test_what_sticks_does_not_move_by_a_bit():
    scene = block(0.3, 0.5, 40.0, np.pi / 2)
    solution = ts.simulate(scene, (0, 100))
    assert solution.phases == [(0.0, 100.0, ("floor", "rough"))]
    assert np.ptp(solution.q, axis=0).max() == 0.0
    np.testing.assert_allclose(
        solution.reaction("floor")[0][-1], [-5 * G * np.sin(0.3), 0, 5 * G * np.cos(0.3)], rtol=HELD
    )
    assert solution.sticking("floor").all()
    assert solution.sticking("rough").all()
    assert scene.equilibrium().moved == 0.0
    assert scene.linearise().eigenvalues().size == 0
    assert np.abs(scene.evaluate().qdd).max() < HELD


def test_a_stiff_hinge_slides_as_one_body():
    scene = block(0.3, 0.2, 40.0, np.pi / 2)
    solution = ts.simulate(scene, (0, 2))
    assert solution.phases == [(0.0, 2.0, ("floor", "rough"))]
    rate = G * (np.sin(0.3) - 0.2 * np.cos(0.3))
    np.testing.assert_allclose(solution.position("arm")[-1], [2 * rate, 0, -0.5], atol=HELD)
    np.testing.assert_allclose(scene.evaluate().qdd[[0, 7]], rate, rtol=HELD)


def arm_on_a_slope(slope, mu, hinge, angle, rate, span):
    """x, theta, and rates, at the end of a span in which the block slides down and the arm turns by its rate's sign."""
    gx, gz = G * np.sin(slope), -G * np.cos(slope)

    def right(t, y):
        c, s, w = np.cos(y[1]), np.sin(y[1]), y[3]
        load = fz = 0.0
        for _ in range(60):  # of the hinge: F, and the normal force -4 gz + Fz of the floor
            normal = -4.0 * gz + fz
            # m a = m g + F, F = F(xdd, thetadd); 4 xdd = 4 gx - Fx - mu N;  J thetadd = l (s Fx + c Fz) - sign mu r |F|
            M = np.array([[5.0, -0.5 * s], [-0.5 * s, 0.1 + 0.25]])
            given = [
                5.0 * gx - mu * normal + 0.5 * c * w * w,
                -0.5 * (s * gx + c * gz) - np.sign(w) * hinge * 0.05 * load,
            ]
            xdd, wd = np.linalg.solve(M, given)
            fx = xdd - 0.5 * (s * wd + c * w * w) - gx
            fz = -0.5 * (c * wd - s * w * w) - gz
            load = np.hypot(fx, fz)
        return [y[2], w, xdd, wd]

    return solve_ivp(right, (0, span), [0.0, angle, 0.0, rate], "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]


@pytest.mark.slow_for("*null-space*")
@pytest.mark.parametrize("given", [{}, {"integrator": "dop853"}, {"formulation": "null-space"}], ids=str)
def test_a_block_slides_while_its_arm_turns(given):
    """Against minimal coordinates."""
    scene = block(0.5, 0.2, 0.3, 0.0, 3.0)
    solution = ts.simulate(scene, (0, 0.4), rtol=1e-12, atol=1e-12, **given)
    assert solution.phases == [(0.0, 0.4, ("floor",))]
    x, theta, v, w = arm_on_a_slope(0.5, 0.2, 0.3, 0.0, 3.0, 0.4)
    assert w > 0.0
    np.testing.assert_allclose(solution.position("block")[-1], [x, 0, 0], atol=TIGHT)
    np.testing.assert_allclose(
        [solution.velocity("block")[-1, 0], solution.angle_rate("hinge")[-1]], [v, w], atol=TIGHT
    )
    np.testing.assert_allclose(solution.angle("hinge")[-1], theta, atol=TIGHT)


def stick_and_slip():
    """The arm's swing makes the block slide and stick in turn."""
    return block(0.5, 0.6, 0.3, 2.0, 6.0)


def test_energy_and_bounds_along_sticking_and_sliding():
    solution = ts.simulate(stick_and_slip(), (0, 3), rtol=1e-11, atol=1e-11, dense_output=True)
    assert len(solution.phases) == 5
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=CLOSE)
    errors = solution.constraint_error
    assert max(errors.position.max(), errors.velocity.max()) < ALGEBRA
    force, sticks = solution.reaction("floor")[0], solution.sticking("floor")
    assert (np.abs(force[:, 0]) <= 0.6 * force[:, 2] * (1.0 + HELD)).all()
    np.testing.assert_allclose(np.abs(force[~sticks, 0]), 0.6 * force[~sticks, 2], rtol=HELD)
    assert not solution.velocity("block")[sticks].any()


def test_a_run_that_stops_goes_on_to_the_same_bits(tmp_path):
    scene, file = stick_and_slip(), tmp_path / "run.h5"
    whole = ts.simulate(scene, (0, 3))
    ts.simulate(scene, (0, 3), store=file, checkpoint=0.0, history=True, progress=Stop(4))
    resumed = ts.resume(file)
    same_run(resumed, whole)
    assert resumed.phases == whole.phases


def test_cases_of_an_ensemble_have_their_own_phases():
    mu = [0.2, 0.6, 2.0]
    found = ts.ensemble(stick_and_slip(), {"floor.kinetic": mu}, (0, 1))
    for i, value in enumerate(mu):
        alone = ts.simulate(stick_and_slip().with_parameters({"floor.kinetic": value}), (0, 1))
        np.testing.assert_array_equal(found.q[i], alone.q[-1])
        assert found.case(i).phases == alone.phases


def gripper(squeeze, mu=0.4):
    """Two jaws of 1 kg in rough guides along x, and 1 kg between them."""
    scene = ts.Scene(gravity=(0, 0, -G))
    load = scene.add_point_mass(1.0, name="load")
    for side in (-1, 1):
        jaw = scene.add_body(1.0, (0.1, 0.1, 0.1), position=(0.1 * side, 0, 0), name=f"jaw {side}")
        guide = scene.add(
            C.Translational.at(scene.ground, jaw, point=(0.1 * side, 0, 0), axis=(1, 0, 0), name=f"guide {side}")
        )
        scene.add(F.TranslationalFriction(guide, kinetic=0.1, name=f"rub {side}"))
        scene.add(F.PointForce(jaw, force=(-side * squeeze, 0, 0), name=f"squeeze {side}"))
        place = {"point_b": (-0.1 * side, 0, 0), "normal_b": (-side, 0, 0)}
        scene.add(C.PlaneContact(load, jaw, **place, unilateral=True, kinetic=mu, name=f"pad {side}"))
    return scene


@pytest.mark.parametrize("seed", [98, 114, 158, 0])
def test_what_a_rope_has_stopped_sticks_between_both_coefficients(seed):
    """A pan swings up until its rope is taut; its weight of 0.23 N m is between 0.2 and 0.26 N m of its hinge.

    The rope, which the stuck hinge leaves no motion, has no share of the load, whatever its rounding.
    """
    rng, tilt, d = np.random.default_rng(seed), -0.3, 0.023
    bearing = Rotation.from_rotvec((0, 0, rng.uniform(0.0, 2.0 * np.pi)))
    pose = bearing * Rotation.from_rotvec((0, -tilt, 0))
    scene = ts.Scene(gravity=(0, 0, -10.0))
    pan = scene.add_body(
        1.0, (0.1, 0.2, 0.3), position=pose.apply((d, 0, 0)), orientation=pose.as_quat(scalar_first=True),
        velocity=pose.apply((0, 0, 5.0 * d)), angular_velocity=(0, -5.0, 0), name="pan",
    )  # fmt: skip
    hinge = scene.add(C.Revolute.at(scene.ground, pan, point=(0, 0, 0), axis=bearing.apply((0, 1, 0)), name="hinge"))
    anchor, hook = rng.uniform((0.2, -0.3, -1.5), (0.8, 0.3, -0.5)), np.array((0.5, 0.1, 0.0))
    points = [(scene.ground, bearing.apply(anchor)), (pan, hook - (d, 0, 0))]
    scene.add(C.Rope(points, length=np.linalg.norm(hook - anchor), name="rope"))
    friction = scene.add(F.RevoluteFriction(hinge, radius=0.1, kinetic=0.2, static=0.26))
    solution = ts.simulate(scene, (0, 0.5))
    assert [names for *_, names in solution.phases] == [(), ("rope", friction.name)]
    assert solution.sticking(friction)[-1]
    assert np.abs(solution.position(pan)[-1] - bearing.apply((d, 0, 0))).max() < HELD


def test_a_gripper_holds_and_drops_its_load():
    """It holds 2 mu F, and beyond it the load falls with g - 2 mu F / m."""
    held = ts.simulate(gripper(13.0), (0, 1))
    assert np.ptp(held.q, axis=0).max() == 0.0
    np.testing.assert_allclose(held.reaction("pad 1")[0][-1], [-13.0, 0, G / 2], atol=TIGHT)
    slips = ts.simulate(gripper(10.0), (0, 0.1))
    np.testing.assert_allclose(slips.position("load")[-1, 2], -0.005 * (G - 8.0), atol=HELD)
    assert not slips.sticking("pad 1").any()


def carts(speeds, friction, block, mu):
    """A block slides along x on a pile of carts, each of which has a brake on the one below."""
    scene = ts.Scene(gravity=(0, 0, -10.0))
    below = scene.ground
    for i, (speed, own) in enumerate(zip(speeds, friction, strict=True)):
        cart = scene.add_body(1.0 + i, (1, 1, 1), velocity=(speed, 0, 0), name=f"cart {i}")
        rail = scene.add(C.Translational.at(below, cart, point=(0, 0, 0), axis=(1, 0, 0), name=f"rail {i}"))
        scene.add(F.TranslationalFriction(rail, kinetic=own, name=f"brake {i}"))
        below = cart
    scene.add_point_mass(1.0, velocity=(block, 0, 0), name="block")
    scene.add(C.PlaneContact(scene["block"], below, normal_b=(0, 0, 1), unilateral=True, kinetic=mu, name="floor"))
    return scene


@pytest.mark.parametrize("method", ["taylor", "dop853", "radau"])
@pytest.mark.parametrize("friction", [(0.14,), (0.19, 0.08)], ids=str)
def test_a_block_comes_to_rest_on_carts_that_their_brakes_hold(method, friction):
    """The end of the slip leaves the carts rates of rounding, which are no sliding: the brakes go on to hold them."""
    solution = ts.simulate(carts([0.0] * len(friction), friction, 1.3, 0.2), (0, 2), integrator=method)
    names = ("floor", *(f"brake {i}" for i in range(len(friction))))
    assert [held for _, _, held in solution.phases] == [names] * 2
    assert abs(solution.phases[1][0] - 1.3 / 2.0) < HELD
    np.testing.assert_allclose(solution.position("block")[-1, 0], 1.3**2 / 4.0, atol=HELD)
    assert np.abs(solution.position("cart 0")).max() < ALGEBRA


@pytest.mark.parametrize("method", ["dop853", "radau"])
@pytest.mark.parametrize("seed", range(4))
def test_carts_come_to_rest_one_after_the_other(method, seed):
    """They, and the block, stand still after at most the sum of v / (mu g); nothing drives them again."""
    rng = np.random.default_rng(seed)
    scene = carts(rng.uniform(-2, 2, 2), rng.uniform(0.3, 0.4, 2), rng.uniform(-2, 2), rng.uniform(0.1, 0.2))
    solution, other = (ts.simulate(scene, (0, 6), integrator=each, rtol=1e-10, atol=1e-10) for each in (method, None))
    assert np.diff(solution.energy).max() <= TIGHT
    assert np.abs(solution.qd[-1]).max() < ALGEBRA
    np.testing.assert_allclose(solution.q[-1], other.q[-1], atol=CLOSE)
