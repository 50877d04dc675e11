"""Hybrid systems: actions of events that let parts come and go, set parameters and hit bodies."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.methods import one_of_each
from tests.helpers.tolerances import FINE, NEAR, ROUNDING

C, F = ts.constraints, ts.forces
METHODS = one_of_each(tol=1e-10, step=1e-3)
G = 10.0


def at(time, action, **attributes):
    """An event at a time, with an action."""

    def event(t, state):
        return t - time

    event.action = action
    vars(event).update(attributes)
    return event


def rotors():
    """Two rotors on an axis, and a clutch that is open."""
    scene, hinges = ts.Scene(gravity=(0, 0, 0)), []
    for name, inertia, rate in (("driver", 2.0, 10.0), ("load", 3.0, -1.0)):
        body = scene.add_body(mass=1.0, inertia=(2, 2, inertia), angular_velocity=(0, 0, rate), name=name)
        hinges.append(C.Revolute.at(scene.ground, body, point=(0, 0, 0), axis=(0, 0, 1), name=f"{name} hinge"))
        scene.add(hinges[-1])
    scene.add(C.Coupler(hinges[1], hinges[0], ratio=1.0, name="clutch"))
    scene.deactivate("clutch")
    return scene, hinges


def engage(change):
    """Close the clutch at the angles that its shafts have."""
    change.set("clutch.offset", change.state.angle("load hinge") - change.state.angle("driver hinge"))
    change.activate("clutch")


# Parts that come and go


@pytest.mark.slow_but("taylor", "dop853")
@pytest.mark.parametrize("method", METHODS)
def test_a_clutch_engages_and_opens(method):
    """J1 w1 + J2 w2 is kept, and J1 J2 (w1 - w2)^2 / 2 (J1 + J2) of energy lost; turns are counted all the time."""
    scene, (driver, load) = rotors()
    events = [at(1.0, engage), at(2.0, lambda change: change.deactivate("clutch"))]
    solution = ts.simulate(scene, (0, 3), events=events, dense_output=True, **METHODS[method]).raise_if_failed()
    assert [names for _, _, names in solution.phases] == [(), ("clutch",), ()]
    (t, name, impulse), *more = solution.impulses
    assert (name, more) == ("clutch", [])
    assert abs(t - 1.0) < FINE
    assert abs(abs(impulse) - 2.0 * (10.0 - 3.4)) < NEAR
    for hinge, first in ((driver, 10.0), (load, -1.0)):
        assert abs(solution.at(0.5).angle_rate(hinge) - first) < NEAR
        assert abs(solution.at(1.5).angle_rate(hinge) - 3.4) < NEAR
        assert abs(solution.at(3.0).angle_rate(hinge) - 3.4) < NEAR
        assert abs(solution.at(3.0).angle(hinge) - (first + 6.8)) < NEAR
        assert abs(solution.angle(hinge)[-1] - (first + 6.8)) < NEAR
    lost = 6.0 * 11.0**2 / 2.0 / 5.0
    assert abs(solution.energy[0] - solution.energy[-1] - lost) < 1e-7
    assert solution.constraint_error.position.max() < FINE
    assert len(solution.t_events[0]) == len(solution.t_events[1]) == 1


@pytest.mark.parametrize("formulation", ["tangent", "null-space"])
def test_a_pendulum_is_released_and_flies(formulation):
    scene = ts.Scene(gravity=(0, 0, -G))
    bob = scene.add_point_mass(mass=2.0, position=(1, 0, 0), name="bob")
    rod = scene.add(C.Distance(bob, scene.ground, name="rod"))

    def low(t, state):
        return state.position(bob)[0]

    low.action = lambda change: change.deactivate(rod)
    solution = ts.simulate(scene, (0, 2), events=low, formulation=formulation, rtol=1e-11, atol=1e-11)
    (t,) = solution.t_events[0]
    late, v = 2.0 - t, -np.sqrt(2 * G)
    assert np.abs(solution.state.position(bob) - (v * late, 0, -1 - G * late**2 / 2)).max() < NEAR
    assert [names for _, _, names in solution.phases] == [("rod",), ()]
    assert abs(solution.multipliers[solution.t <= t][-2:, 0] - 60.0).min() < 1e-6  # 3 m g at the lowest point
    assert not solution.multipliers[solution.t > t].any()
    force, torque = solution.reaction(rod)
    assert not force[-1].any()
    assert not torque.any()
    assert solution.impulses == []


def test_bodies_dock():
    """Momenta are kept; the pair turns about its centroid with what the impact off the centre leaves."""
    scene = ts.Scene(gravity=(0, 0, 0))
    port = scene.add_body(mass=3.0, inertia=(2, 2, 2), position=(0, 0, 0), name="station")
    probe = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(-4, 0.5, 0), velocity=(1, 0, 0), name="probe")
    scene.add(
        C.Fixed(port, probe, point_a=(-1, 0.5, 0), point_b=(1, 0, 0), axis_a=(1, 0, 0), axis_b=(1, 0, 0), name="dock")
    )
    scene.deactivate("dock")

    def contact(t, state):
        return state.position(port, point=(-1, 0.5, 0))[0] - state.position(probe, point=(1, 0, 0))[0]

    contact.action = lambda change: change.activate("dock")
    solution = ts.simulate(scene, (0, 4), events=contact).raise_if_failed()
    assert abs(solution.t_events[0][0] - 2.0) < FINE
    for momentum in (solution.linear_momentum, solution.angular_momentum):
        assert np.ptp(momentum, axis=0).max() < FINE
    # about the common centroid: spin of both, and of the reduced mass at r = (-2, 0.5)
    inertia, spin = 2.0 + 1.0 + 0.75 * (2.0**2 + 0.5**2), -0.75 * 0.5
    assert np.abs(solution.angular_velocity(probe)[-1] - (0, 0, spin / inertia)).max() < FINE
    energy = 0.5 * 4.0 * 0.25**2 + 0.5 * spin**2 / inertia
    assert abs(solution.energy[-1] - energy) < FINE
    (_, name, impulse), *more = solution.impulses
    assert (name, more, impulse.shape) == ("dock", [], (6,))


def test_a_force_comes_and_goes():
    """A thruster of 2 N on 4 kg, from 1 s to 3 s; work, power and reaction are those of this time."""
    scene = ts.Scene(gravity=(0, 0, 0))
    ship = scene.add_body(mass=4.0, inertia=(1, 1, 1), name="ship")
    thrust = scene.add(F.PointForce(ship, force=(2.0, 0, 0), name="thruster"))
    scene.deactivate(thrust)
    events = [at(1.0, lambda change: change.activate(thrust)), at(3.0, lambda change: change.deactivate("thruster"))]
    solution = ts.simulate(scene, (0, 4), events=events, t_eval=[0.5, 2.0, 4.0], dense_output=True)
    assert np.abs(solution.velocity(ship)[:, 0] - (0.0, 0.5, 1.0)).max() < FINE
    assert np.abs(solution.reaction(thrust)[0][:, 0] - (0, 2, 0)).max() < FINE
    assert np.abs(solution.power - (0, 1, 0)).max() < FINE
    assert np.abs(solution.power_of(thrust) - (0, 1, 0)).max() < FINE
    assert np.abs(solution.work - (0, 0.5, 2.0)).max() < FINE
    assert np.abs(solution.work_of(thrust) - (0, 0.5, 2.0)).max() < FINE
    assert [names for _, _, names in solution.phases] == [(), ("thruster",), ()]
    for t, expected in ((0.5, 0.0), (2.0, 2.0), (3.5, 0.0)):
        assert solution.at(t).reaction(thrust)[0][0] == pytest.approx(expected)
    with pytest.raises(ts.InvalidArgument, match="several phases"):
        solution.at([0.5, 2.0]).reaction(thrust)


def test_a_brake_is_applied():
    """A block at 2 m/s is braked from 1 s on by 2 m/s^2, rests 1 m further, and is let go on a slope."""
    scene = ts.Scene(gravity=(1.0, 0, 0))
    block = scene.add_point_mass(mass=3.0, velocity=(2, 0, 0), name="block")
    scene.add(F.CoulombFriction(block, scene.ground, force=9.0, name="brake"))
    scene.deactivate("brake")
    events = [at(1.0, lambda change: change.activate("brake")), at(4.0, lambda change: change.deactivate("brake"))]
    solution = ts.simulate(scene, (0, 5), events=events, t_eval=[0.5, 2.0, 3.5, 5.0])
    x = 2.5 + 3.0**2 / 2 / 2.0  # 3 m/s at 2.5 m, decelerated by 3 - 1 m/s^2
    assert np.abs(solution.position(block)[:, 0] - (1.125, 4.5, x, x + 0.5)).max() < 1e-12
    assert np.abs(solution.reaction("brake", on=block)[0][:, 0] - (0, -9, -3, 0)).max() < FINE
    assert solution.sticking("brake").tolist() == [False, False, True, False]
    assert np.abs(solution.dissipation - (0, 9.0, 0, 0)).max() < FINE


def test_what_joints_and_forces_remember_lives_through_phases():
    """A spring of a hinge counts turns, before, while and after it is inactive."""
    scene = ts.Scene(gravity=(0, 0, 0))
    rotor = scene.add_body(mass=1.0, inertia=(1, 1, 1), angular_velocity=(0, 0, 8.0), name="rotor")
    hinge = scene.add(C.Revolute.at(scene.ground, rotor, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    given = {"axis_a": (0, 0, 1), "reference_a": (1, 0, 0), "reference_b": (1, 0, 0)}
    scene.add(F.TorsionalSpring(scene.ground, rotor, **given, stiffness=0.0, damping=1e-9, name="other"))
    spring = scene.add(F.TorsionalSpring(scene.ground, rotor, **given, stiffness=4.0, name="spring"))
    scene.deactivate(spring)
    solution = ts.simulate(
        scene, (0, 4), events=at(2.0, lambda change: change.activate(spring)), rtol=1e-11, atol=1e-11
    )
    angle = 16.0 * np.cos(2.0 * 2.0) + 4.0 * np.sin(2.0 * 2.0)  # J a = -k angle from 16 rad on, at 8 rad/s
    assert abs(solution.angle(hinge)[-1] - angle) < 1e-7
    assert abs(solution.angle(spring)[-1] - angle) < 1e-7


# Parameters


def test_a_spring_becomes_stiffer():
    """Energies, loads and the motion are those of the stiffness of each phase."""
    scene = ts.Scene(gravity=(0, 0, 0))
    cart = scene.add_point_mass(mass=1.0, position=(1.5, 0, 0), name="cart")
    spring = scene.add(F.Spring(scene.ground, cart, stiffness=4.0, free_length=1.0, name="spring"))

    def through(t, state):
        return state.position(cart)[0] - 1.0

    through.terminal, through.action = False, lambda change: change.set("spring.stiffness", 16.0)
    quarter = np.pi / 4.0
    times = [0.0, quarter / 2, quarter + 0.1]
    solution = ts.simulate(scene, (0, 1.0), events=through, t_eval=times, rtol=1e-12, atol=1e-12)
    x = 1.0 - 0.25 * np.sin(4.0 * 0.1)  # at 1 m/s through the centre: amplitude 1 / 4
    assert abs(solution.position(cart)[-1, 0] - x) < NEAR
    assert np.ptp(solution.energy) < NEAR
    assert (
        np.abs(
            solution.reaction(spring, on=cart)[0][:, 0] - (-2.0, -4.0 * 0.5 * np.cos(np.pi / 4), 16.0 * (1 - x))
        ).max()
        < NEAR
    )
    assert scene.parameters()["spring.stiffness"] == 4.0


def test_masses_gravity_and_loads_change():
    scene = ts.Scene(gravity=(0, 0, -G))
    stone = scene.add_point_mass(mass=3.0, position=(0, 0, 0), velocity=(1, 0, 0), name="stone")
    scene.add(F.PointForce(stone, force=(0, 3.0, 0), name="wind"))

    def drop(change):
        change.set("stone.mass", 1.5)
        change.set("gravity", (0, 0, 0))
        change.set("wind.force", (0, 1.5, 0))

    solution = ts.simulate(scene, (0, 2), events=at(1.0, drop), t_eval=[0.5, 2.0])
    assert np.abs(solution.velocity(stone) - [(1, 0.5, -5), (1, 2, -10)]).max() < FINE
    assert np.abs(solution.linear_momentum[1] - (1.5, 3.0, -15)).max() < FINE
    assert abs(solution.potential_energy[1]) == 0.0
    assert np.abs(solution.power_of("wind") - (1.5, 3.0)).max() < FINE
    dense = ts.simulate(scene, (0, 2), events=at(1.0, drop), dense_output=True)
    assert abs(dense.work_of("wind")[-1] - (1.5 + 2.25)) < FINE


# Impulses


def test_an_impulse_off_the_centroid_spins_a_body():
    scene = ts.Scene(gravity=(0, 0, 0))
    turned = (np.sqrt(0.5), 0, 0, np.sqrt(0.5))  # the body's x axis along y
    rod = scene.add_body(mass=2.0, inertia=(0.5, 0.5, 0.25), orientation=turned, name="rod")
    action = lambda change: change.impulse(rod, (3.0, 0, 0), point=(0.5, 0, 0))  # noqa: E731
    solution = ts.simulate(scene, (0, 2), events=at(1.0, action), t_eval=[0.5, 1.0])
    assert np.abs(solution.velocity(rod) - [(0, 0, 0), (1.5, 0, 0)]).max() < FINE
    assert np.abs(solution.angular_velocity(rod) - [(0, 0, 0), (0, 0, -6.0)]).max() < FINE
    assert [(round(t, 12), name) for t, name, _ in solution.impulses] == [(1.0, "rod")]


def test_an_impulse_on_a_hinged_body_moves_it_as_the_hinge_lets_it():
    """A blow of 3 N s at a distance of 2/3 L from the hinge of a uniform rod: no reaction of the hinge."""
    scene = ts.Scene(gravity=(0, 0, 0))
    rod = scene.add_body(mass=2.0, inertia=(0.01, 1.5, 1.5), position=(1.5, 0, 0), name="rod")  # 3 m
    scene.add(C.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    action = lambda change: change.impulse("rod", (0, 3.0, 0), point=(0.5, 0, 0))  # noqa: E731
    solution = ts.simulate(scene, (0, 1), events=at(0.5, action))
    assert abs(solution.angle_rate("hinge")[-1] - 3.0 * 2.0 / 6.0) < FINE
    after = solution.linear_momentum[np.flatnonzero(solution.t >= 0.5)[1]]
    assert abs(np.linalg.norm(after) - 3.0) < FINE


@pytest.mark.parametrize("length", [1e-8, 1.0, 1e3, 1e8])
def test_impulses_in_all_units(length):
    """A rod is closed between two balls that fly apart and is struck, beside a door: momenta are those of impulses."""
    L = length
    scene = ts.Scene(gravity=(0, 0, 0))
    balls = [
        scene.add_body(
            float(k), k * L**2 * np.ones(3), (L * k, 0.3 * L * k, 0), velocity=L * np.array((k, k * k, 0.1))
        )
        for k in (1, 2)
    ]  # fmt: skip
    door = scene.add_body(3.0, L**2 * np.array((40.0, 5.0, 35.0)), position=(-3 * L, L, 0), name="door")
    scene.add(C.Revolute.at(scene.ground, door, point=(-4 * L, L, 0), axis=(0.6, 0, 0.8)))
    points = L * np.array((0.1, 0, 0)), L * np.array((0, 0.2, 0))
    scene.add(C.Distance(*balls, point_a=points[0], point_b=points[1], length=L, name="rod"))
    scene.deactivate("rod")
    blow, ends = L * np.array((-1.3, 2.1, -0.8)), []

    def close(change):
        ends.extend(map(change.state.position, balls, points))
        change.set("rod.length", np.linalg.norm(ends[1] - ends[0]))
        change.activate("rod")
        change.impulse(balls[0], blow)

    solution = ts.simulate(scene, (0, 1), events=at(0.5, close)).raise_if_failed()
    before, after = np.flatnonzero(solution.t == 0.5)
    gained = [k * (solution.velocity(ball)[after] - solution.velocity(ball)[before]) for k, ball in enumerate(balls, 1)]
    (P,) = (impulse for _, name, impulse in solution.impulses if name == "rod")
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    assert np.abs(sum(gained) - blow).max() < ROUNDING * L
    assert np.abs(gained[1] + P * along).max() < ROUNDING * L
    assert P > 0.1 * L


# Events


def test_actions_of_one_instant_are_carried_out_together():
    scene = ts.Scene(gravity=(0, 0, -G))
    stone = scene.add_point_mass(mass=1.0, velocity=(0, 0, 5), name="stone")
    seen = []

    def top(t, state):
        return state.velocity(stone)[2]

    def height(t, state):
        return 1.25 - state.position(stone)[2] - 0.5 * G * (t - 0.5) ** 2 + (t - 0.5) * 3.0

    top.action = lambda change: (seen.append("top"), change.impulse(stone, (1, 0, 0)))
    height.action = lambda change: (seen.append("height"), change.impulse(stone, (0, 2, 0)))
    for events in ([top, height], [height, top]):
        seen.clear()
        solution = ts.simulate(scene, (0, 1), events=events)
        assert seen == [event.__name__ for event in events]
        assert np.abs(solution.state.velocity(stone) - (1, 2, -5)).max() < FINE
        assert len(solution.phases) == 2


def test_an_action_recurs_and_the_run_ends_where_it_says():
    """A ball is hit back whenever it comes to the ground, until the fourth time."""
    scene = ts.Scene(gravity=(0, 0, -G))
    ball = scene.add_point_mass(mass=1.0, position=(0, 0, 1.25), name="ball")
    hits = []

    def ground(t, state):
        return state.position(ball)[2]

    def hit(change):
        hits.append(change.t)
        if len(hits) == 4:
            change.end()
        change.impulse(ball, (0, 0, 10.0))

    ground.direction, ground.action = -1, hit
    solution = ts.simulate(scene, (0, 10), events=ground)
    assert solution.status is ts.Status.EVENT
    assert np.abs(np.array(hits) - (0.5, 1.5, 2.5, 3.5)).max() < 1e-11
    assert solution.reached == hits[-1]
    assert len(solution.impulses) == 3
    ground.terminal = 2
    hits.clear()
    assert abs(ts.simulate(scene, (0, 10), events=ground).reached - 1.5) < 1e-11
    assert len(hits) == 1


def test_outputs_and_dense_output_have_both_sides_of_a_jump():
    scene = ts.Scene(gravity=(0, 0, 0))
    ship = scene.add_point_mass(mass=1.0, name="ship")
    event = at(1.0, lambda change: change.impulse(ship, (2, 0, 0)))
    solution = ts.simulate(scene, (0, 2), events=event, dense_output=True)
    (t,) = solution.t_events[0]
    assert (solution.t == t).sum() == 2
    assert solution.at(t).velocity(ship)[0] == 2.0
    assert solution.at(np.nextafter(t, 0)).velocity(ship)[0] == 0.0
    times = ts.simulate(scene, (0, 2), events=event, t_eval=[0.5, 1.5, 2.0])
    assert times.velocity(ship)[:, 0].tolist() == [0.0, 2.0, 2.0]


def test_contacts_and_actions():
    """A ball that bounces, on a floor that opens under it; and a kick that a resting contact returns."""
    scene = ts.Scene(gravity=(0, 0, -G))
    ball = scene.add_point_mass(mass=1.0, position=(0, 0, 1.25), name="ball")
    given = {"normal_b": (0, 0, 1), "unilateral": True, "restitution": 0.5}
    floor = scene.add(C.PlaneContact(ball, scene.ground, **given, name="floor"))
    solution = ts.simulate(scene, (0, 2), events=at(0.75, lambda change: change.deactivate(floor)))
    assert [(round(t, 9), name) for t, name, _ in solution.impulses] == [(0.5, "floor")]
    assert abs(solution.state.position(ball)[2] - (2.5 * 1.5 - G * 1.5**2 / 2)) < FINE
    ball.position = (0, 0, 0)
    down = at(0.5, lambda change: change.impulse(ball, (0, 0, -4)))
    solution = ts.simulate(scene, (0, 1), events=down)
    assert [(round(t, 9), name) for t, name, _ in solution.impulses][:2] == [(0.5, "floor"), (0.5, "ball")]
    assert abs(solution.impulses[0][2] - 6.0) < FINE
    assert abs(solution.t[-1] - 1.0) < FINE


@pytest.mark.parametrize(
    ("action", "mu", "slip"),
    [
        (lambda change: change.set("floor.kinetic", 0.1), 0.1, 2.6),
        (lambda change: change.set("floor.restitution", 0.5), 0.2, 2.6),
        (lambda change: change.deactivate("wind"), 0.2, 2.6),
        (lambda change: change.impulse("block", (-1.2, 0, 0)), 0.2, 2.0),
    ],
)
def test_a_block_slides_on_through_an_action(action, mu, slip, tmp_path):
    """Of friction mu m g, 0.2 at first: velocities, reactions, losses and the balance of energy."""
    scene = ts.Scene(gravity=(0, 0, -G))
    block = scene.add_point_mass(mass=2.0, velocity=(3, 0, 0), name="block")
    floor = {"normal_b": (0, 0, 1), "unilateral": True, "kinetic": 0.2, "name": "floor"}
    scene.add(C.PlaneContact(block, scene.ground, **floor))
    kite = scene.add_point_mass(mass=1.0, position=(0, 0, 9), name="kite")
    scene.add(F.PointForce(kite, force=(0, 1, 0), name="wind"))
    found = ts.simulate(scene, (0, 1), t_eval=[0.1, 0.7], events=at(0.2, action), dense_output=True)
    found.save(tmp_path / "run.h5")
    for solution in (found, ts.load(tmp_path / "run.h5")):
        v = np.array([3 - 0.2 * G * 0.1, slip - mu * G * 0.5])
        np.testing.assert_allclose(solution.velocity("block")[:, 0], v, rtol=FINE)
        friction = np.array([-0.2, -mu]) * 2.0 * G
        force, _ = solution.reaction("floor")
        np.testing.assert_allclose(force, np.transpose([friction, [0, 0], [2.0 * G] * 2]), rtol=FINE, atol=FINE)
        np.testing.assert_allclose(solution.at(0.7).reaction("floor")[0], force[1], rtol=FINE, atol=FINE)
        np.testing.assert_allclose(solution.friction_demand("floor"), [0.2, mu], rtol=FINE)
        np.testing.assert_allclose(solution.dissipation, -friction * v, rtol=FINE)
        np.testing.assert_allclose(solution.power_of("floor"), friction * v, rtol=FINE)
        np.testing.assert_allclose(np.ptp(solution.energy - solution.work), 0.0, atol=FINE)


def test_states_know_the_friction_that_holds():
    """A block at rest is held against 5 N, then against 4 N."""
    scene = ts.Scene(gravity=(0, 0, -G))
    block = scene.add_body(2.0, (1, 1, 1), name="block")
    way = C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0), name="way")
    scene.add(F.TranslationalFriction(scene.add(way), kinetic=0.2, static=0.3, name="rub"))
    scene.add(F.PointForce(block, force=(5, 0, 0), name="push"))
    ease = at(0.2, lambda change: change.set("push.force", (4, 0, 0)))
    for events, pushes in ((None, (5, 5)), (ease, (5, 4))):
        solution = ts.simulate(scene, (0, 1), events=events, dense_output=True)
        for t, push in zip((0.1, 0.7), pushes, strict=True):
            np.testing.assert_allclose(solution.at(t).reaction("rub")[0], [-push, 0, 0], rtol=FINE, atol=FINE)
            np.testing.assert_allclose(solution.at(t).reaction("push")[0], [push, 0, 0], rtol=FINE, atol=FINE)


def test_a_friction_of_a_joint_goes_within_a_run():
    """The block is braked by mu m g up to 0.2 s, and then by nothing."""
    scene = ts.Scene(gravity=(0, 0, -G))
    block = scene.add_body(2.0, (1, 1, 1), velocity=(3, 0, 0), name="block")
    way = C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0), name="way")
    scene.add(F.TranslationalFriction(scene.add(way), kinetic=0.2, static=0.3, name="rub"))
    release = at(0.2, lambda change: change.deactivate("rub"))
    solution = ts.simulate(scene, (0, 1), t_eval=[0.1, 0.7], events=release, dense_output=True)
    v = solution.velocity("block")[:, 0]
    np.testing.assert_allclose(v, [3 - 0.2 * G * 0.1, 3 - 0.2 * G * 0.2], rtol=FINE)
    np.testing.assert_allclose(solution.dissipation, [0.2 * 2.0 * G * v[0], 0.0], rtol=FINE)
    np.testing.assert_allclose(solution.reaction("way")[0][:, 2], 2.0 * G, rtol=FINE)
    np.testing.assert_allclose(np.ptp(solution.energy - solution.work), 0.0, atol=FINE)


def test_a_ball_rolls_when_it_would_after_an_action():
    """The ball slides up to 2 v / 7 mu g, and then at 5 v / 7, whatever happens to another body."""
    scene = ts.Scene(gravity=(0, 0, -G))
    ball = scene.add_body(**ts.shapes.sphere(0.1, mass=2.0), position=(0, 0, 0.1), velocity=(3, 0, 0), name="ball")
    scene.add(C.RollingBall(ball, scene.ground, radius=0.1, normal_b=(0, 0, 1), kinetic=0.2, name="lane"))
    bob = scene.add_point_mass(mass=1.0, position=(0, 5, -1), velocity=(1, 0, 0), name="bob")
    scene.add(C.Rope([(scene.ground, (0, 5, 0)), (bob, (0, 0, 0))], name="rope"))
    solution = ts.simulate(scene, (0, 1), events=at(0.2, lambda change: change.impulse("bob", (0.5, 0, 0))))
    begins = solution.phases[-1][0]
    assert (solution.sticking("lane") == (solution.t >= begins))[solution.t != begins].all()
    np.testing.assert_allclose(begins, 2 * 3 / (7 * 0.2 * G), rtol=FINE)
    np.testing.assert_allclose(solution.velocity("ball")[-1], [15 / 7, 0, 0], rtol=FINE, atol=FINE)
    assert all("rope" in names for _, _, names in solution.phases)
    np.testing.assert_allclose(solution.multipliers[-1, solution.rows("lane")][0], -2.0 * G, rtol=FINE)


def test_a_contact_of_the_start_that_is_inactive_is_passed():
    scene = ts.Scene(gravity=(0, 0, -G))
    ball = scene.add_point_mass(mass=1.0, position=(0, 0, 0.5), name="ball")
    floor = scene.add(C.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1), unilateral=True, name="floor"))
    net = scene.add(
        C.PlaneContact(ball, scene.ground, point_b=(0, 0, -2), normal_b=(0, 0, 1), unilateral=True, name="net")
    )
    scene.deactivate(floor)
    solution = ts.simulate(scene, (0, 2))
    assert [name for _, name, _ in solution.impulses] == ["net"]
    assert abs(solution.state.position(ball)[2] + 2) < FINE
    assert net.active


def test_a_run_goes_on_from_a_state_of_a_phase():
    scene, _ = rotors()
    events = [at(1.0, engage), at(2.0, lambda change: change.deactivate("clutch"))]
    whole = ts.simulate(scene, (0, 3), events=events)
    half = ts.simulate(scene, (0, 1.5), events=events)
    rest = ts.simulate(scene, (1.5, 3), state=half.state, events=events)
    assert [names for _, _, names in rest.phases] == [("clutch",), ()]
    assert np.abs(rest.state.q - whole.state.q).max() < NEAR
    assert [names for _, _, names in ts.simulate(scene, (1.5, 1.8), state=half.state).phases] == [("clutch",)]


@pytest.mark.parametrize("seed", range(4))
def test_energy_less_work_is_kept_through_random_actions(seed):
    """A chain over a floor: hinges open, a mass and the stiffness of a spring change, bodies are hit."""
    rng = np.random.default_rng(seed)
    scene, last, events = ts.Scene(gravity=(0, 0, -G)), None, []
    for i in range(3):
        body = scene.add_body(1.0 + rng.random(), (0.1, 0.12, 0.15), position=(i + 0.5, 0, 0), name=f"body {i}")
        joint = C.Revolute.at(last or scene.ground, body, point=(i, 0, 0), axis=(0, 1, 0), name=f"hinge {i}")
        last = scene.add(joint) and body
    scene.add(F.Spring(scene.ground, last, point_a=(3, 0, 1), stiffness=20.0, name="spring"))
    scene.add(F.ViscousFriction(scene.bodies[0], scene.ground, damping=0.1, name="drag"))
    given = {"point_b": (0, 0, -1), "normal_b": (0, 0, 1), "unilateral": True, "restitution": 0.6}
    scene.add(C.PlaneContact(last, scene.ground, **given, name="floor"))
    actions = [
        lambda change: change.set("body 1.mass", 1.7),
        lambda change: change.set("spring.stiffness", 35.0),
        lambda change: change.impulse("body 0", rng.normal(size=3), point=(0.1, 0.2, 0.3)),
        lambda change: change.deactivate(f"hinge {rng.integers(3)}"),
        lambda change: change.deactivate("spring"),
        lambda change: change.activate("spring"),
    ]
    events = [at(time, action) for time, action in zip(np.sort(rng.uniform(0.1, 1.4, 6)), actions, strict=True)]
    solution = ts.simulate(scene, (0, 1.5), events=events, dense_output=True, rtol=1e-11, atol=1e-11)
    assert solution.success
    assert np.ptp(solution.energy - solution.work) < 1e-7
    assert max(level.max() for level in solution.constraint_error) < FINE
    assert [len(times) for times in solution.t_events] == [1] * 6


def test_the_same_bits_again():
    scene, _ = rotors()
    runs = [ts.simulate(scene, (0, 3), events=at(1.0, engage)) for _ in range(2)]
    assert runs[0].q.tobytes() == runs[1].q.tobytes()
    assert runs[0].q.tobytes() == ts.simulate(scene.copy(), (0, 3), events=at(1.0, engage)).q.tobytes()


# Files, prepared runs, ensembles


@pytest.mark.slow_for("zarr")
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of the interrupts
@pytest.mark.parametrize("suffix", ["h5", "zarr"])
def test_stores_checkpoints_and_saved_solutions(tmp_path, suffix):
    scene, _ = rotors()
    options = {"events": [at(1.0, engage), at(2.0, lambda change: change.deactivate("clutch"))], "max_step": 0.05}
    whole = ts.simulate(scene, (0, 3), dense_output=True, **options)
    known = ts.load(whole.save(tmp_path / f"run.{suffix}"))
    assert (known.phases, known.impulses) == (whole.phases, whole.impulses)
    assert known.multipliers.tobytes() == whole.multipliers.tobytes()
    assert known.at(1.5).phase[:2] == whole.at(1.5).phase[:2] != whole.at(0.5).phase[:2]
    for number, end in enumerate((0.5, 1.0, 1.5, 2.0, 2.5)):

        def stop(fraction, end=end):
            if fraction is not None and fraction >= end / 3.0:
                raise KeyboardInterrupt

        path = tmp_path / f"part {number}.{suffix}"
        ts.simulate(scene, (0, 3), store=path, checkpoint=0.0, progress=stop, **options)
        rest = ts.resume(path, events=options["events"])
        assert rest.q.tobytes() == whole.q.tobytes()
        assert (rest.phases, rest.impulses) == (whole.phases, whole.impulses)


def test_impulses_of_several_rows_are_saved(tmp_path):
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(mass=2.0, inertia=(1, 1, 1), velocity=(1, 2, 0), name="body")
    scene.add(C.Spherical(body, scene.ground, point_b=(1, 2, 0), name="peg"))
    scene.deactivate("peg")
    events = [at(0.5, lambda change: change.impulse(body, (0, 0, 1))), at(1.0, lambda change: change.deactivate("peg"))]

    def there(t, state):
        return t - 1.0

    there.action = lambda change: change.activate("peg")
    solution = ts.simulate(scene, (0, 2), events=[there, *events[1:]])
    assert solution.status is ts.Status.SUCCESS  # both at one instant: activated, and deactivated
    solution = ts.simulate(scene, (0, 2), events=there)
    ((_, name, impulse),) = solution.impulses
    assert name == "peg"
    assert np.abs(np.abs(impulse) - (2, 4, 0)).max() < FINE
    ((_, again, found),) = ts.load(solution.save(tmp_path / "run.h5")).impulses
    assert (again, found.tolist()) == (name, impulse.tolist())


def test_prepared_runs_and_ensembles():
    scene, _ = rotors()
    events = [at(1.0, engage)]
    expected = ts.simulate(scene, (0, 2), events=events)
    run = ts.prepare(scene, events=events)
    assert [run((0, 2)).q.tobytes() == expected.q.tobytes() for _ in range(2)] == [True, True]
    kicked = ts.Scene(gravity=(0, 0, 0))
    stone = kicked.add_point_mass(mass=2.0, name="stone")  # a scene without phases of its own
    kick = at(1.0, lambda change: change.impulse("stone", (2.0, 0, 0)))
    assert abs(ts.prepare(kicked, events=kick)((0, 2)).velocity(stone)[-1, 0] - 1.0) < FINE
    ensemble = ts.ensemble(kicked, {"stone.mass": [1.0, 2.0, 4.0]}, (0.0, 2.0), events=kick)
    assert np.abs(ensemble.qd[:, 0] - (2.0, 1.0, 0.5)).max() < FINE
    pulled = kicked.with_parameters({"stone.mass": 4.0})
    kick.action = lambda change: change.impulse("stone", (2.0, 0, 0), point=None)
    assert abs(ts.simulate(pulled, (0, 2), events=kick).velocity(stone)[-1, 0] - 0.5) < FINE


# Inactive parts of scenes


def test_inactive_parts_in_files_copies_and_analyses(tmp_path):
    scene, _ = rotors()
    assert "1 inactive" in repr(scene)
    assert "inactive" in scene._repr_html_()
    assert scene.mobility().degrees_of_freedom == 2
    assert scene.evaluate().Phi.size == 12
    scene.save(tmp_path / "rotors.toml")
    again = ts.load(tmp_path / "rotors.toml")
    assert not again["clutch"].active
    assert not scene.copy()["clutch"].active
    assert not scene.with_parameters({"load.mass": 2.0})["clutch"].active
    one, other = (ts.simulate(each, (0, 2), events=at(1.0, engage)) for each in (scene, again))
    assert one.q.tobytes() == other.q.tobytes()
    scene.activate("clutch")
    assert scene.mobility().degrees_of_freedom == 1
    assert "inactive" not in repr(scene)
    with pytest.raises(ts.InvalidFile, match="active"):
        ts.load(_edited(tmp_path / "rotors.toml", "active = false", "active = 0"))


def test_what_doesnt_hold_at_the_start_is_not_shown_as_violated(tmp_path):
    scene = ts.Scene()
    body = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(0, 0, 1), name="body")
    scene.add(C.PlaneContact(body, scene.ground, normal_b=(0, 0, 1), unilateral=True, name="floor"))
    scene.add(C.Rope([(scene.ground, (0, 0, 2)), (body, (0, 0, 0))], 3.0, name="rope"))
    scene.add(C.Fixed(scene.ground, body, point_a=(1, 0, 0), name="dock"))
    scene.deactivate("dock")
    assert "Phi = " not in scene.view(tmp_path / "scene").read_text()
    scene.activate("dock")
    assert "dock" in scene.view(tmp_path / "scene").read_text().partition("Phi = ")[0]


def _edited(path, before, after):
    path.write_text(path.read_text().replace(before, after))
    return path


# What can't be


@pytest.mark.parametrize(
    ("action", "said"),
    [
        (lambda change: change.activate("clutsh"), r"did you mean 'clutch'\? It stopped"),
        (lambda change: change.activate("load"), "load is a body"),
        (lambda change: change.activate("clutch"), r"clutch by 1[01]\."),
        (lambda change: change.set("load.mas", 1.0), "no parameter 'load.mas'"),
        (lambda change: change.set("load.mass", -1.0), "positive"),
        (lambda change: change.set("load.velocity", (1, 0, 0)), "belongs to the start"),
        (lambda change: change.impulse("lode", (1, 0, 0)), "no body is named 'lode'"),
        (lambda change: change.impulse("load", (1, 0)), "three"),
        (lambda change: change.push("load"), "no attribute 'push'"),
        (lambda change: 1 / 0, "ZeroDivisionError"),
    ],
)
def test_actions_that_cant_be_carried_out_end_the_run_with_an_account(action, said):
    scene, _ = rotors()
    solution = ts.simulate(scene, (0, 2), events=at(1.0, action))
    assert solution.status is ts.Status.ACTION_FAILED
    assert abs(solution.reached - 1.0) < FINE
    with pytest.raises(ts.StepFailure, match=said):
        solution.raise_if_failed()


@pytest.mark.parametrize(
    "change",
    [
        lambda scene: scene.activate("clutch"),
        lambda scene: scene.remove("clutch"),
        lambda scene: setattr(scene["load"], "mass", 2.0),
        lambda scene: setattr(scene, "gravity", (0, 0, 1)),
    ],
)
def test_an_action_that_changes_the_scene_is_refused(change):
    """Such a change would count in some phases alone, or not at all; a new start is of other runs."""
    scene, _ = rotors()
    scene.add_point_mass(1.0, position=(5, 0, 0), name="stone")
    start = lambda _: setattr(scene["stone"], "position", (6, 0, 0))  # noqa: E731
    assert ts.simulate(scene, (0, 2), events=at(1.0, start)).state.position("stone")[0] == 5.0
    solution = ts.simulate(scene, (0, 2), events=at(1.0, lambda _: change(scene)))
    assert solution.status is ts.Status.ACTION_FAILED
    assert "it has changed the scene" in solution.message


def test_a_change_is_over_after_its_action():
    """What would do nothing raises; the state of the event stays readable."""
    scene, _ = rotors()
    kept = []
    ts.simulate(scene, (0, 2), events=at(1.0, kept.append))
    (change,) = kept
    requests = [("activate", "clutch"), ("deactivate", "clutch"), ("set", "load.mass", 2.0), ("end",)]
    for name, *arguments in (*requests, ("impulse", "load", (1, 0, 0))):
        with pytest.raises(ts.InvalidArgument, match="event at t = 1 s is over"):
            getattr(change, name)(*arguments)
    assert abs(change.state.angle_rate("load hinge") + 1.0) < FINE


def test_what_isnt_an_action_and_what_cant_come_and_go():
    scene, (driver, _) = rotors()
    with pytest.raises(ts.InvalidArgument, match="action must be a function"):
        ts.simulate(scene, (0, 1), events=at(1.0, "clutch"))
    for action in (lambda: None, lambda t, change: None):
        with pytest.raises(ts.InvalidArgument, match=r"action is called with \(change\)"):
            ts.simulate(scene, (0, 1), events=at(2.0, action))  # beyond the end
    rotor = scene.add(F.Armature(driver, inertia=1.0))
    for item, said in ((rotor, "inertia"), ("driver", "is a body"), ("nothing", "nothing"), (scene.ground, "ground")):
        with pytest.raises(ts.InvalidArgument, match=said):
            scene.deactivate(item)
