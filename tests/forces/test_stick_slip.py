"""Exact friction: what it holds doesn't move, what it stops rests where the closed form says, events at their times."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.rough_joints import four_bar
from tests.helpers.tolerances import CLOSE, FINE, HELD, TIGHT
from tsdyn.simulation.unit_events import Slowing

C, F, M = ts.constraints, ts.forces, ts.motions
G = 9.81


SLOPE = np.radians(10.0)


def on_a_slope(ratio, slope=SLOPE, **given):
    """A block on a slope, which pulls with a part of what friction can hold."""
    turn = Rotation.from_rotvec((0.0, slope, 0.0))
    scene = ts.Scene()
    block = scene.add_body(3.0, (0.03, 0.03, 0.03), (0.3, 0.2, 0.1), turn, name="block")
    axis = turn.apply((1, 0, 0))
    guide = scene.add(C.Translational.at(scene.ground, block, point=block.position, axis=axis, name="guide"))
    scene.add(F.TranslationalFriction(guide, kinetic=np.tan(slope) / ratio, name="friction", **given))
    return scene


def on_a_plane(speed, mu, slope=0.0, **given):
    """A particle on a plane that rises along x; its friction is named."""
    scene = ts.Scene(gravity=(0.0, 0.0, -G))
    block = scene.add_point_mass(2.0, velocity=speed, name="block")
    plane = scene.add(C.PlaneContact(block, scene.ground, normal_b=(-np.sin(slope), 0, np.cos(slope)), name="plane"))
    scene.add(F.ContactFriction(plane, kinetic=mu, name="friction", **given))
    return scene


@pytest.mark.parametrize(
    "scene", [on_a_slope(0.99), on_a_plane((0, 0, 0), 0.2, np.arctan(0.19))], ids=["guide", "plane"]
)
def test_a_block_below_its_angle_does_not_move_by_a_bit(scene):
    solution = ts.simulate(scene, (0.0, 1000.0), dense_output=True)
    assert (solution.q == solution.q[0]).all()
    assert not solution.qd.any()
    assert (solution.at(np.linspace(0.0, 1000.0, 7)).q == solution.q[0]).all()
    assert solution.sticking("friction").all()
    assert solution.phases == [(0.0, 1000.0, ("friction",))]


def test_a_block_beyond_its_angle_slides():
    slope, ratio = SLOPE, 1.1
    solution = ts.simulate(on_a_slope(ratio, slope), (0.0, 1.0))
    way = 0.5 * G * np.sin(slope) * (1.0 - 1.0 / ratio)
    assert solution.displacement("guide")[-1] == pytest.approx(way, rel=FINE)
    assert not solution.sticking("friction").any()


METHODS = [
    {},
    {"integrator": "dop853", "rtol": 1e-12, "atol": 1e-13},
    {"integrator": "rk45", "rtol": 1e-12, "atol": 1e-13},
    {"integrator": "sdirk54", "rtol": 1e-10, "atol": 1e-12},
    {"integrator": ts.integrators.Nystrom4(step=2e-3)},
    {"formulation": "null-space", "rtol": 1e-12, "atol": 1e-13},
]


@pytest.mark.slow_for("null-space")
@pytest.mark.parametrize("given", METHODS, ids=lambda given: str(given.get("integrator", given.get("formulation"))))
def test_a_block_that_stops_and_is_pushed_below_the_limit_rests(given):
    """1 m/s, pushed to and fro with nine tenths of its friction: the place from the root of its velocity."""
    scene = ts.Scene()
    block = scene.add_body(2.0, (0.01, 0.01, 0.01), velocity=(1, 0, 0))
    guide = scene.add(C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0), name="guide"))
    scene.add(F.TranslationalFriction(guide, kinetic=0.4, name="friction"))
    scene.add(F.PointForce(block, force=(M.Sine(0.9 * 0.4 * 2.0 * G, 3.0), 0, 0)))
    solution = ts.simulate(scene, (0.0, 3.0), **given)
    w, a = 3.0, 0.4 * G
    t = brentq(lambda t: 1.0 - a * t + 0.9 * a * (1.0 - np.cos(w * t)) / w, 0.0, 1.0, xtol=1e-16)
    end = t - 0.5 * a * t * t + 0.9 * a * (t - np.sin(w * t) / w) / w
    assert solution.displacement("guide")[-1] == pytest.approx(end, abs=1e-12)
    rests = solution.t > t + 1e-6
    assert (solution.q[rests] == solution.q[-1]).all()
    force = solution.reaction("friction", on=block)[0][rests, 0]
    np.testing.assert_allclose(force, -0.9 * 0.4 * 2.0 * G * np.sin(w * solution.t[rests]), atol=HELD)


def test_a_straight_slide_in_a_plane_ends_after_a_few_evaluations(monkeypatch):
    """Up a slope the block stops at v / (g (sin + mu cos)): what its event watches is as smooth as its velocity."""
    mu, v, asked, over = 0.3, 1.5, [], Slowing.over
    monkeypatch.setattr(Slowing, "over", lambda event, states: asked.append(states) or over(event, states))
    solution = ts.simulate(on_a_plane((v * np.cos(SLOPE), 0, v * np.sin(SLOPE)), mu, SLOPE), (0, 1))
    stop = v / (G * (np.sin(SLOPE) + mu * np.cos(SLOPE)))
    assert abs(solution.phases[1][0] - stop) < HELD
    assert abs(np.linalg.norm(solution.state.position("block")) - 0.5 * v * stop) < HELD
    assert len(asked) < 12


def test_a_slide_that_curves_to_its_end_in_the_plane():
    """Down a slope, across it at first: speed and direction as of the quadrature by the direction's angle."""
    slope, mu, speed = SLOPE, 0.3, 1.0
    solution = ts.simulate(on_a_plane((0.0, speed, 0.0), mu, -slope), (0.0, 3.0), rtol=1e-12, dense_output=True)
    # v' = g (sin cos(f) - mu cos), v f' = -g sin sin(f); f from the line of fall: v(f) = v0 tan(f/2)^p / sin(f)
    g, p = G * np.sin(slope), mu / np.tan(slope)
    at = lambda f: speed * np.tan(0.5 * f) ** p / np.sin(f)  # noqa: E731
    time = quad(lambda f: at(f) / (g * np.sin(f)), 0.0, 0.5 * np.pi, epsabs=1e-13)[0]
    across = quad(lambda f: at(f) ** 2 / g, 0.0, 0.5 * np.pi, epsabs=1e-13)[0]
    assert solution.phases[-1][0] == pytest.approx(time, abs=1e-8)
    assert solution.position("block")[-1, 1] == pytest.approx(across, abs=1e-9)
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=1e-9)


def belt(static, speed=0.5, stiffness=100.0, mu=0.4):
    """A block on a belt, held by a spring: at rest on the belt where the spring is relaxed."""
    scene = ts.Scene()
    band = scene.add_body(10.0, (1, 1, 1), velocity=(speed, 0, 0), name="band")
    way = scene.add(C.Translational.at(scene.ground, band, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(C.TranslationMotor.of(way, displacement=M.Ramp(0.0, speed)))
    block = scene.add_point_mass(1.0, velocity=(speed, 0, 0), name="block")
    contact = scene.add(C.PlaneContact(block, band, normal_b=(0, 0, 1)))
    scene.add(C.Dot2(scene.ground, block, axis_a=(0, 1, 0)))
    scene.add(F.Spring(block, scene.ground, point_b=(-5, 0, 0), stiffness=stiffness, free_length=5.0))
    scene.add(F.ContactFriction(contact, kinetic=mu, static=static, name="friction"))
    return scene


@pytest.mark.parametrize("static", [0.6, 0.45])
def test_the_period_of_a_belt_oscillator(static):
    """Sticks for 2 (mu_s - mu) m g / (k V), slips half an ellipse about mu m g / k: in closed form."""
    speed, stiffness, mu = 0.5, 100.0, 0.4
    solution = ts.simulate(belt(static), (0.0, 5.0), rtol=1e-13, atol=1e-13, dense_output=True)
    w, b = np.sqrt(stiffness), (static - mu) * G / stiffness
    stick = 2.0 * b / speed
    slip = 2.0 * (np.pi - np.arctan(w * b / speed)) / w
    begins = np.array([begin for begin, _, names in solution.phases if names])[1:]
    assert len(begins) > 4
    np.testing.assert_allclose(np.diff(begins), stick + slip, atol=1e-10)
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=FINE)
    breaks = np.array([end for _, end, names in solution.phases if names])[:-1]
    np.testing.assert_allclose(solution.at(breaks[1:]).position("block")[:, 0], static * G / stiffness, atol=FINE)


def test_without_a_jump_it_is_caught_by_the_belt_once():
    """Static friction no larger than kinetic: after it breaks loose it swings at the belt's speed, touching it."""
    solution = ts.simulate(belt(None), (0.0, 1.0), rtol=1e-12)
    w, middle = 10.0, 0.4 * G / 100.0
    loose = middle / 0.5
    place = middle + 0.5 / w * np.sin(w * (1.0 - loose))
    assert solution.position("block")[-1, 0] == pytest.approx(place, abs=FINE)


def test_a_reversal_without_rest():
    """A block thrown up a slope beyond its angle turns at once, and slides down with the other sign."""
    slope, mu = np.radians(30.0), 0.2
    along = np.array([np.cos(slope), 0.0, np.sin(slope)])
    solution = ts.simulate(on_a_plane(2.0 * along, mu, slope), (0.0, 1.0), rtol=1e-12, atol=1e-12)
    up, down = (G * (np.sin(slope) + s * mu * np.cos(slope)) for s in (1.0, -1.0))
    turn = 2.0 / up
    assert solution.t[np.argmin(np.abs(solution.t - turn))] == pytest.approx(turn, rel=FINE)
    assert not solution.sticking("friction").any()
    way = 0.5 * 2.0 * turn - 0.5 * down * (1.0 - turn) ** 2
    np.testing.assert_allclose(solution.position("block")[-1], way * along, atol=FINE)


@pytest.mark.slow_for("0.0-0.0")
@pytest.mark.parametrize(("start", "end"), [(0.0, 0.0), (0.9, 0.0), (1.1, None)])
def test_a_start_at_rest_sticks_by_the_static_bound(start, end):
    """A torque that static friction holds, or not: a wheel with CoulombFriction of a given torque."""
    scene = ts.Scene(gravity=(0, 0, 0))
    wheel = scene.add_body(1.0, (1.0, 1.0, 2.0), name="wheel")
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    scene.add(F.CoulombFriction(wheel, scene.ground, torque=3.0, static_torque=4.0, name="brake"))
    scene.add(F.JointTorque(hinge, function=lambda t, x, v: 4.0 * start))
    solution = ts.simulate(scene, (0.0, 2.0))
    wanted = 0.5 * (4.0 * start - 3.0) / 2.0 * 4.0 if end is None else end
    assert solution.angle("hinge")[-1] == pytest.approx(wanted, abs=FINE)
    assert solution.sticking("brake").all() == (end is not None)
    torque = np.linalg.norm(solution.reaction("brake")[1], axis=1)
    np.testing.assert_allclose(torque, 3.0 if end is None else 4.0 * start, atol=TIGHT)


def test_a_wheel_runs_down():
    """t = J w / N, angle J w^2 / (2 N)."""
    scene = ts.Scene(gravity=(0, 0, 0))
    wheel = scene.add_body(1.0, (1.0, 1.0, 2.0), angular_velocity=(0, 0, 3.0))
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(F.CoulombFriction(wheel, scene.ground, torque=4.0, name="brake"))
    solution = ts.simulate(scene, (0.0, 100.0))
    assert solution.angle(hinge)[-1] == pytest.approx(2.25, abs=FINE)
    assert solution.phases[-1] == (pytest.approx(1.5, abs=FINE), 100.0, ("brake",))


def test_two_frictions_of_one_slide_add_up():
    """Bounds of 3 and 5 N hold 7 N together, which neither does alone; 9 N leave 1 N to accelerate."""
    for load, way in ((7.0, 0.0), (-7.0, 0.0), (9.0, 0.25)):
        scene = ts.Scene(gravity=(0, 0, 0))
        block = scene.add_body(2.0, (1, 1, 1), name="block")
        scene.add(C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0)))
        for force in (3.0, 5.0):
            scene.add(F.CoulombFriction(block, scene.ground, force=force))
        scene.add(F.PointForce(block, force=(load, 0, 0)))
        assert ts.simulate(scene, (0.0, 1.0)).position("block")[-1, 0] == pytest.approx(way, abs=FINE)


def test_pins_of_a_four_bar_turn_at_dead_centres_and_stop_together():
    """Three rows too many: the reactions that friction needs are unique, others are not."""
    scene, pins = four_bar(rough_at=())
    for i, pin in enumerate(pins):
        scene.add(F.RevoluteFriction(pin, radius=0.05, kinetic=0.3, name=f"friction {i}"))
    solution = ts.simulate(scene, (0.0, 30.0), rtol=1e-11, dense_output=True)
    assert solution.phases[-1][2] == tuple(f"friction {i}" for i in range(4))
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=CLOSE)
    assert not solution.qd[-1].any()


def chain(count, **given):
    scene, last = ts.Scene(), None
    for i in range(count):
        link = scene.add_body(1.0, (0.01, 0.1, 0.1), (i + 0.5, 0.0, 0.0), name=f"link {i}")
        pin = C.Revolute.at(last or scene.ground, link, point=(i, 0, 0), axis=(0, 1, 0), name=f"pin {i}")
        scene.add(F.RevoluteFriction(scene.add(pin), radius=0.02, kinetic=0.3, name=f"friction {i}", **given))
        last = link
    return scene


@pytest.mark.slow
def test_a_swinging_chain_lands_where_its_pins_come_to_rest():
    """Sixty times a pin sticks within a second. The end is that of the regularised law at 1e-12 m/s and rtol 1e-10."""
    solution = ts.simulate(chain(16), (0.0, 1.0), rtol=1e-10)
    np.testing.assert_allclose(solution.position("link 15")[-1], [13.55239608, 0.0, -4.90372608], atol=1e-8)
    assert sum(len(names) > 0 for _, _, names in solution.phases) > 40


@pytest.mark.slow
def test_twenty_joints_stick_and_slip_with_static_above_kinetic():
    solution = ts.simulate(chain(20, static=0.4), (0.0, 0.3), rtol=1e-10, dense_output=True)
    assert solution.success
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=CLOSE * 20.0 * G)
    errors = solution.constraint_error
    assert max(errors.position.max(), errors.velocity.max()) < TIGHT
    for i in range(20):  # what sticks has no rate, and is within its bound
        rests = solution.sticking(f"friction {i}")
        assert np.abs(solution.angle_rate(f"pin {i}")[rests]).max(initial=0.0) < TIGHT
        force, _ = solution.reaction(f"pin {i}", on=solution.scene[f"link {i}"])
        torque = np.abs(solution.reaction(f"friction {i}")[1][:, 1])
        assert (torque <= 0.4 * 0.02 * np.linalg.norm(force[:, [0, 2]], axis=1) + HELD).all()


def test_joints_without_a_load_make_no_events():
    """A level chain, released: of each joint's load the next one has 0.2 or so, and the tip falls freely."""
    scene, last, end = ts.Scene(gravity=(0, 0, -G)), None, 5e-6
    for k in range(30):
        link = scene.add_body(0.1, (1e-4, 1e-4, 1e-4), (0.1 * k + 0.05, 0, 0), name=f"link {k}")
        pin = scene.add(C.Revolute.at(last or scene.ground, link, point=(0.1 * k, 0, 0), axis=(0, 1, 0)))
        scene.add(F.RevoluteFriction(pin, kinetic=0.1, radius=0.01))
        last = link
    solution = ts.simulate(scene, (0.0, end))
    assert solution.phases == [(0.0, end, ())]
    np.testing.assert_allclose(solution.position(last)[-1], (2.95, 0.0, -0.5 * G * end**2), rtol=0, atol=TIGHT)
    np.testing.assert_allclose(solution.velocity(last)[-1, 2], -G * end, rtol=1e-9)


def test_a_start_as_slow_as_rest_sticks():
    """In a plane 1e-8 m/s is rest: the slip is ended."""
    solution = ts.simulate(on_a_plane((6e-9, 0, 0), 0.3), (0.0, 1.0))
    assert solution.success
    assert not solution.qd.any()


@pytest.mark.parametrize("inactive", [0, 1])
def test_an_inactive_friction_is_none(inactive):
    without, scene = chain(2), chain(2)
    without.remove(f"friction {inactive}")
    scene.deactivate(f"friction {inactive}")
    one, other = (ts.simulate(each, (0.0, 0.5), rtol=1e-12, atol=1e-12) for each in (without, scene))
    np.testing.assert_allclose(other.q[-1], one.q[-1], rtol=0, atol=TIGHT)
    assert other.phases == one.phases


def test_an_impact_releases_what_sticks():
    """An elastic ball stops at the block and leaves it 2 m/s, which friction stops after v^2 / (2 mu g)."""
    scene = ts.Scene()
    block = scene.add_point_mass(1.0, name="block")
    table = scene.add(C.PlaneContact(block, scene.ground, normal_b=(0, 0, 1)))
    scene.add(F.ContactFriction(table, kinetic=0.3, name="friction"))
    ball = scene.add_point_mass(1.0, position=(-1, 0, 0), velocity=(2, 0, 0))
    scene.add(C.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1)))
    scene.add(C.SphereContact(ball, block, radius_a=0.05, radius_b=0.05, restitution=1.0, name="hit"))
    solution = ts.simulate(scene, (0.0, 3.0))
    assert [names for _, _, names in solution.phases] == [("friction",), (), ("friction",)]
    assert solution.position(block)[-1, 0] == pytest.approx(4.0 / (2.0 * 0.3 * G), abs=FINE)


def test_evaluate_says_what_a_run_does():
    held, sliding = on_a_slope(0.9), on_a_slope(1.1)
    assert np.abs(held.evaluate().qdd).max() < TIGHT
    slope = SLOPE
    assert np.linalg.norm(sliding.evaluate().qdd) == pytest.approx(G * np.sin(slope) * (1.0 - 1.0 / 1.1), rel=FINE)
    assert held.mobility().degrees_of_freedom == 1
    for scene in (held, sliding):
        np.testing.assert_allclose(ts.simulate(scene, (0.0, 0.1)).qdd[0], scene.evaluate().qdd, atol=TIGHT)


def test_what_sticks_has_no_modes():
    assert on_a_slope(0.9).linearise().eigenvalues().size == 0
    np.testing.assert_allclose(on_a_slope(1.1).linearise().eigenvalues(), [0.0, 0.0], atol=TIGHT)


def test_what_sticks_is_in_equilibrium():
    found = on_a_slope(0.5).equilibrium()
    assert found.moved < 1e-15
    force = 3.0 * G * np.sin(SLOPE) * np.array([-np.cos(SLOPE), 0.0, np.sin(SLOPE)])
    np.testing.assert_allclose(found.reaction("friction")[0], force, atol=TIGHT)
    with pytest.raises(ts.NoEquilibrium):
        on_a_slope(1.1).equilibrium()


@pytest.mark.slow
def test_the_same_bits_in_another_process():
    script = textwrap.dedent("""
        import sys
        sys.path.insert(0, sys.argv[1])
        import tsdyn as ts
        from tests.forces.test_stick_slip import belt
        print(ts.simulate(belt(0.6), (0.0, 2.0)).q.tobytes().hex())
    """)
    root = __file__.rsplit("/tests/", 1)[0]
    found = [
        subprocess.run([sys.executable, "-c", script, root], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert found[0] == found[1] == ts.simulate(belt(0.6), (0.0, 2.0)).q.tobytes().hex() + "\n"


def test_files_and_parameters_keep_the_law(tmp_path):
    scene = on_a_slope(0.5)
    scene.save(tmp_path / "slope.toml")
    again = ts.simulate(ts.load(tmp_path / "slope.toml"), (0.0, 1.0))
    assert again.q.tobytes() == ts.simulate(scene, (0.0, 1.0)).q.tobytes()
    assert again.sticking("friction").all()
    given = ts.simulate(on_a_slope(0.5, slip_velocity=1e-4), (0.0, 1.0))
    found = ts.simulate(scene.with_parameters({"friction.slip_velocity": 1e-4}), (0.0, 1.0))
    assert found.q.tobytes() == given.q.tobytes()
    loose = scene.with_parameters({"friction.kinetic": 0.1})
    assert ts.simulate(loose, (0.0, 1.0)).displacement("guide")[-1] > 0.1


def test_wrong_statics_are_refused():
    scene = ts.Scene()
    block = scene.add_point_mass(1.0)
    with pytest.raises(ts.InvalidForce, match="static_force must be at least"):
        F.CoulombFriction(block, scene.ground, force=2.0, static_force=1.0)
    scene.add(F.CoulombFriction(block, scene.ground, force=2.0, slip_velocity=1e-3, name="drag"))
    with pytest.raises(ts.InvalidForce, match="sticking"):
        ts.simulate(scene, (0.0, 0.1)).sticking("drag")


@pytest.mark.slow_for("plane")
@pytest.mark.parametrize("kind", ["plane", "given"])
def test_a_slide_that_begins_across_its_load_keeps_the_quick_method(kind):
    """A load that turns, hardly above the bound: slip turns the faster the slower it is, which is stiff at first."""
    scene, N = on_a_plane((0, 0, 0), 0.3) if kind == "plane" else ts.Scene(), 2.0 * G
    if kind == "given":
        block = scene.add_point_mass(2.0, name="block")
        scene.add(C.PlaneContact(block, scene.ground, normal_b=(0, 0, 1)))
        scene.add(F.CoulombFriction(block, scene.ground, force=0.3 * N))
    scene.add(F.PointForce(scene["block"], force=lambda t: (0.31 * N * np.cos(t), 0.31 * N * np.sin(t), 0.0 * t)))
    solution = ts.simulate(scene, (0.0, 5.0), rtol=1e-12, atol=1e-12, max_steps=1000)
    # dx/dt = v by scipy's DOP853 at 1e-13, from the series at 1e-5 s
    np.testing.assert_allclose(solution.position("block")[-1], [-0.5518621, -0.13589615, 0.0], rtol=0, atol=1e-8)


@pytest.mark.parametrize("kind", ["plane", "given"])
def test_a_slip_that_turns_down_the_slope_rests_in_time(kind):
    """Thrown across a slope: d(f |v| + g.v)/dt = |g|^2 - f^2, so it rests after v f / (f^2 - |g|^2)."""
    slope, mu = 0.3, 0.35
    along, f = G * np.sin(slope), mu * G * np.cos(slope)
    scene = ts.Scene(gravity=(along, 0, -G * np.cos(slope)))
    block = scene.add_point_mass(1.0, position=(2, 0, 0), velocity=(0, 1, 0))
    plane = scene.add(C.PlaneContact(block, scene.ground, normal_b=(0, 0, 1)))
    if kind == "plane":
        scene.add(F.ContactFriction(plane, kinetic=mu, name="friction"))
    else:
        scene.add(F.CoulombFriction(block, scene.ground, force=f, name="friction"))
    solution = ts.simulate(scene, (0.0, 2.0), rtol=1e-13, atol=1e-13)
    assert solution.phases[-1] == (pytest.approx(f / (f**2 - along**2), abs=CLOSE), 2.0, ("friction",))
