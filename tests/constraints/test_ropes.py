"""Ropes: Atwood's machine, tackles, hoists, swinging loads; ropes that go slack; ropes that can't be."""

from itertools import pairwise, product

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts
from tests.helpers.methods import one_of_each
from tests.helpers.tolerances import FINE, NEAR

C = ts.constraints
ORIGIN, G = (0.0, 0.0, 0.0), 10.0
METHODS = one_of_each(tol=1e-10, step=1e-3)


def atwood(**options):
    scene = ts.Scene(gravity=(0, 0, -G))
    heavy = scene.add_point_mass(mass=3.0, position=(0, 0, -2), name="heavy")
    light = scene.add_point_mass(mass=1.0, position=(1, 0, -2), name="light")
    points = [(heavy, ORIGIN), (scene.ground, ORIGIN), (scene.ground, (1, 0, 0)), (light, ORIGIN)]
    return scene, scene.add(C.Rope(points, always_taut=True, name="rope", **options))


@pytest.mark.parametrize("method", METHODS)
def test_atwoods_machine(method):
    scene, rope = atwood()
    assert rope.length == 5.0
    solution = ts.simulate(scene, (0.0, 0.4), **METHODS[method])
    assert abs(solution.state.velocity("light")[2] - 0.4 * G / 2.0) < NEAR
    assert np.abs(solution.multipliers - 15.0).max() < NEAR  # 2 m M g / (m + M)
    force, torque = solution.reaction(rope, on=scene["light"])
    assert np.abs(force - (0.0, 0.0, 15.0)).max() < NEAR
    assert np.abs(torque).max() < FINE
    assert solution.constraint_error.acceleration.max() < FINE
    assert np.ptp(solution.energy) < 1e-7


@pytest.mark.parametrize("length", [1e-10, 1e10])
def test_any_length(length):
    scene, weights = ts.Scene(gravity=(0, 0, -G * length)), []
    for i, mass in enumerate((3.0, 1.0)):
        weights.append(scene.add_point_mass(mass, position=(i * length, 0, -2 * length)))
    over = [(scene.ground, ORIGIN), (scene.ground, (length, 0, 0))]
    scene.add(C.Rope([(weights[0], ORIGIN), *over, (weights[1], ORIGIN)], always_taut=True))
    solution = ts.simulate(scene, (0.0, 0.4))
    np.testing.assert_allclose(solution.velocity(weights[1])[-1], (0.0, 0.0, 0.2 * G * length), rtol=1e-9, atol=0)


@pytest.mark.parametrize("parts", [2, 3, 4, 6, 9])
def test_a_tackle_divides_the_load_by_its_parts(parts):
    """Parts of rope carry the block of mass M, the free end the mass m: M a = n T - M g, m n a = m g - T."""
    scene = ts.Scene(gravity=(0, 0, -G))
    block = scene.add_body(mass=4.0, inertia=(1, 1, 1), position=(0, 0, -3), name="block")
    weight = scene.add_point_mass(mass=1.0, position=(2, 0, -3), name="weight")
    scene.add(C.Translational.at(scene.ground, block, point=block.position, axis=(0, 0, 1)))
    ends = [(scene.ground, ORIGIN), (block, ORIGIN)]
    path = [ends[i % 2] for i in range(parts % 2, parts + parts % 2 + 1)]  # ends above
    points = [*path, (scene.ground, (2, 0, 0)), (weight, ORIGIN)]
    if path[-1][0] is block:
        points = [*path, (scene.ground, ORIGIN), (scene.ground, (2, 0, 0)), (weight, ORIGIN)]
    carried = sum(one[0] is not other[0] and block in (one[0], other[0]) for one, other in pairwise(points))
    scene.add(C.Rope(points, always_taut=True))
    solution = ts.simulate(scene, (0.0, 0.2))
    a = (carried - 4.0) * G / (4.0 + carried**2)
    assert abs(solution.state.velocity(block)[2] - 0.2 * a) < NEAR
    assert np.abs(solution.multipliers[:, 5] - (G - carried * a)).max() < NEAR


@pytest.mark.parametrize("formulation", ["tangent", "null-space"])
def test_a_loop_of_rope_locks_a_hinge(formulation):
    """Two spans between the bodies of a hinge: they swing as one rigid body."""

    def swing(lash):
        scene = ts.Scene()
        arm = scene.add_body(1.0, (0.2, 0.3, 0.4), angular_velocity=(0, 0, 1), name="arm")
        scene.add(C.Spherical.at(scene.ground, arm, point=(0, 0, 0)))
        flap = scene.add_body(1.0, (0.2, 0.3, 0.4), (1, 0, 0), velocity=(0, 1, 0), angular_velocity=(0, 0, 1))
        lash(scene, arm, flap)
        return ts.simulate(scene, (0, 1), formulation=formulation, rtol=1e-11, atol=1e-11).raise_if_failed()

    def by_rope(scene, arm, flap):
        scene.add(C.Revolute.at(arm, flap, point=(0.5, 0, 0), axis=(0, 1, 0)))
        scene.add(C.Rope([(arm, (0.1, 0.2, 0.6)), (flap, (0.2, 0.1, 0.1)), (arm, (0, 0, 0.3))], always_taut=True))

    one, other = swing(by_rope), swing(lambda scene, arm, flap: scene.add(C.Fixed.at(arm, flap, point=(0.5, 0, 0))))
    assert np.abs(one.q[-1] - other.q[-1]).max() < NEAR
    assert max(level.max() for level in one.constraint_error) < FINE


@pytest.mark.parametrize("method", METHODS)
def test_a_swinging_atwood_machine(method):
    """(m + M) rdd = m r w^2 + g (m cos - M), r wd = -2 rd w - g sin: Tufillaro's machine."""
    scene, _ = atwood()
    light = scene["light"]
    light.position = (1 + 2 * np.sin(0.8), 0, -2 * np.cos(0.8))
    scene.bodies[0].mass = 1.5
    solution = ts.simulate(scene, (0.0, 0.8), **METHODS[method])

    def swing(t, y):
        r, angle, rd, w = y
        return [rd, w, (r * w * w + G * (np.cos(angle) - 1.5)) / 2.5, -(2 * rd * w + G * np.sin(angle)) / r]

    r, angle, *_ = solve_ivp(swing, (0, 0.8), [2, 0.8, 0, 0], rtol=1e-12, atol=1e-12, method="DOP853").y[:, -1]
    expected = 1 + r * np.sin(angle), 0.0, -r * np.cos(angle)
    assert np.abs(solution.state.position(light) - expected).max() < 1e-7
    assert np.ptp(solution.energy) < 1e-6


def test_points_of_one_body_lie_on_the_rope_with_their_distance():
    """A beam that hangs on a rope run through both of its ends."""
    scene = ts.Scene(gravity=(0, 0, -G))
    beam = scene.add_body(mass=2.0, inertia=(1, 1, 1), position=(0, 0, -1), name="beam")
    points = [(scene.ground, (-1, 0, 0)), (beam, (-1, 0, 0)), (beam, (1, 0, 0)), (scene.ground, (1, 0, 0))]
    rope = scene.add(C.Rope(points, always_taut=True))
    assert rope.length == 4.0
    solution = ts.simulate(scene, (0.0, 0.01))
    assert np.abs(solution.multipliers[:, 0] - 10.0).max() < 1e-2  # two parts carry it
    force, torque = solution.reaction(rope, on=beam)
    assert np.abs(force[0] - (0, 0, 20.0)).max() < FINE
    assert np.abs(torque[0]).max() < FINE


def test_length_assembly_files_copies_and_analyses(tmp_path):
    scene, rope = atwood(length=5.5)
    with pytest.raises(ts.InconsistentState, match="rope"):
        ts.simulate(scene, (0.0, 0.1))
    scene.assemble()
    assert abs(ts.simulate(scene, (0.0, 0.1)).state.velocity("heavy")[2] + 0.5) < NEAR
    scene.save(tmp_path / "scene.toml")
    again = ts.load(tmp_path / "scene.toml")
    assert [body.name for body, _ in again["rope"].points] == ["heavy", "ground", "ground", "light"]
    state = ts.simulate(again, (0.0, 0.1)).state
    assert (state.q == ts.simulate(scene.copy(), (0.0, 0.1)).state.q).all()
    longer = scene.with_parameters({"rope.length": 6.0})
    longer.assemble()
    assert abs(sum(-longer[name].position[2] for name in ("heavy", "light")) - 5.0) < 1e-6
    assert rope.length == 5.5
    assert scene.mobility().degrees_of_freedom == 5
    even, _ = atwood()
    even["heavy"].mass = 1.0
    swings = np.abs(even.linearise().eigenvalues().imag).max()
    assert abs(swings - np.sqrt(G / 2.0)) < NEAR  # each load is a pendulum of 2 m


def test_a_run_ends_where_a_span_vanishes():
    scene = ts.Scene(gravity=(0, 0, 0))
    bead = scene.add_point_mass(mass=1.0, position=(0, 0, -1), velocity=(0, 0, 1), name="bead")
    other = scene.add_point_mass(mass=1.0, position=(1, 0, -1), velocity=(0, 0, -1), name="other")
    points = [(bead, ORIGIN), (scene.ground, ORIGIN), (scene.ground, (1, 0, 0)), (other, ORIGIN)]
    scene.add(C.Rope(points, always_taut=True, name="line"))
    for integrator in ("taylor", "dop853"):
        solution = ts.simulate(scene, (0.0, 2.0), integrator=integrator, max_steps=100_000)
        assert not solution.success
        assert abs(solution.state.t - 1.0) < 1e-6
        assert "The span of 'line' between 'bead' and 'ground' shrinks to length zero" in solution.message


@pytest.mark.slow_but("9")
@pytest.mark.parametrize("order", [5, 9, 13])
def test_no_implicit_step_leads_past_a_span_that_vanishes(order):
    """The bead of 1 kg meets its pulley head-on, from which no motion goes on: N of its row reversed is rounding."""
    for v, tol in product((1.0, 2.5, 7.3), (1e-4, 1e-6, 1e-8)):
        for g in (0.0, 10.0):
            scene = ts.Scene(gravity=(0, 0, -g))
            bead = scene.add_point_mass(mass=1.0, position=(0, 0, -1), velocity=(0, 0, v))
            other = scene.add_point_mass(mass=1.0, position=(2, 0, -1), velocity=(0, 0, -v))
            points = [(bead, ORIGIN), (scene.ground, ORIGIN), (scene.ground, (2, 0, 0)), (other, ORIGIN)]
            scene.add(C.Rope(points, always_taut=True))
            solution = ts.simulate(scene, (0.0, 2.0), integrator=ts.integrators.Radau(tol, tol, order=order))
            assert not solution.success
            assert abs(solution.state.t - 1.0 / v) < 1e-6


BY_TOLERANCE = {
    "taylor": lambda tol: ts.integrators.Taylor(tol),
    "dop853": lambda tol: ts.integrators.DOP853(tol, tol),
    "rk45": lambda tol: ts.integrators.RK45(tol, tol),
    "sdirk54": lambda tol: ts.integrators.SDIRK54(tol, tol),
    "trapezoid": lambda tol: ts.integrators.ImplicitTrapezoid(tol, tol),
    "radau": lambda tol: ts.integrators.Radau(tol, tol, order=13),
}


@pytest.mark.slow_for("sdirk54-null-space", "trapezoid-null-space")
@pytest.mark.parametrize("form", ["tangent", "null-space"])
@pytest.mark.parametrize("method", BY_TOLERANCE)
def test_no_method_leads_past_a_span_that_vanishes(method, form):
    """A bead of up to 20 times the other's mass meets its pulley: no step finds the far side, in any direction."""
    if form == "null-space" and method in ("taylor", "radau"):
        return
    rng = np.random.default_rng(7)
    for tol in np.geomspace(1e-2, 1e-4, 9):
        (m, other), v, along = rng.uniform(1.0, 5.0, 2) * (1.0, 0.25), rng.uniform(1.0, 9.0), rng.normal(size=3)
        along /= np.linalg.norm(along)
        beside = 2.0 * np.array([along[1], -along[0], 0.0])
        scene = ts.Scene(gravity=(0, 0, 0))
        bead = scene.add_point_mass(mass=m, position=-along, velocity=v * along)
        far = scene.add_point_mass(mass=other, position=beside - 1.7 * along, velocity=-v * along)
        ends = (scene.ground, ORIGIN), (scene.ground, beside)
        scene.add(C.Rope([(bead, ORIGIN), *ends, (far, ORIGIN)], always_taut=True))
        solution = ts.simulate(scene, (0.0, 2.0), integrator=BY_TOLERANCE[method](tol), formulation=form)
        assert not solution.success
        assert abs(solution.state.t - 1.0 / v) < 1e-4
        assert solution.position(bead)[-1] @ along < 0.0


def test_a_state_of_times_and_positions_alone_starts_a_rope():
    """Directions of spans are remembered from step to step only."""
    scene, _ = atwood()
    whole = ts.simulate(scene, (0.0, 0.4))
    first = ts.simulate(scene, (0.0, 0.2))
    state = ts.State(*(level[-1] for level in (first.t, first.q, first.qd, first.qdd, first.multipliers)))
    rest = ts.simulate(scene, (0.2, 0.4), state=state)
    np.testing.assert_allclose(rest.q[-1], whole.q[-1], atol=1e-10)


def test_ropes_that_cant_be():
    scene, rope = atwood()
    heavy, light, ground = *scene.bodies, scene.ground
    with pytest.raises(ts.InvalidConstraint, match="always_taut can't be set later"):
        rope.always_taut = False
    beyond = ts.Scene().add_point_mass(mass=1.0)
    wrong = {
        "1 point given": [(heavy, ORIGIN)],
        "coincide": [(heavy, ORIGIN), (ground, (0, 0, -2))],
        "different scenes": [(heavy, ORIGIN), (beyond, ORIGIN)],
        "a point mass has one point": [(heavy, (1, 0, 0)), (light, ORIGIN)],
        "all points are on": [(ground, ORIGIN), (ground, (1, 0, 0))],
        "not a body": [(heavy, ORIGIN), (3, ORIGIN)],
        "Rope: no body is named 'hevy'": [("hevy", ORIGIN), (light, ORIGIN)],
        "must be three finite numbers": [(ground, (1, 2)), (light, ORIGIN)],
        "give points=": [heavy, light],
    }
    for said, points in wrong.items():
        with pytest.raises(ts.InvalidConstraint, match=said):
            C.Rope(points, always_taut=True)
    span = [(ground, ORIGIN), (heavy, ORIGIN), (ground, (5, 0, 0))]
    with pytest.raises(ts.InvalidConstraint, match="too short: 5 m"):
        C.Rope(span, 4.0, always_taut=True)
    with pytest.raises(ts.InvalidConstraint, match="positive"):
        C.Rope(span, -1.0, always_taut=True)
    for options, said in (
        ({"restitution": 1.5}, "restitution must be a number from 0"),
        ({"restitution": 0.5, "always_taut": True}, "set always_taut=False"),
        ({"always_taut": 1}, "True or False"),
    ):
        with pytest.raises(ts.InvalidConstraint, match=said):
            C.Rope(span, **options)


# Ropes that go slack


def tether(length, position, velocity=(0, 0, 0), **options):
    scene = ts.Scene(gravity=(0, 0, -G))
    bob = scene.add_point_mass(mass=2.0, position=position, velocity=velocity, name="bob")
    scene.add(C.Rope([(scene.ground, ORIGIN), (bob, ORIGIN)], length, name="rope", **options))
    return scene, bob


@pytest.mark.slow_but("taylor", "dop853")
@pytest.mark.parametrize("method", METHODS)
def test_a_pendulum_on_a_rope_goes_slack_flies_and_is_caught(method):
    """Launched at the bottom with v^2 = 4 g L: slack at cos(angle from the top) = 2/3, then a parabola."""
    scene, _ = tether(1.0, (0, 0, -1), (np.sqrt(4 * G), 0, 0))
    solution = ts.simulate(scene, (0.0, 1.5), dense_output=True, **METHODS[method])
    (taut, slack, again), (t, name, impulse), *_ = solution.phases[:3], *solution.impulses
    assert [phase[2] for phase in (taut, slack, again)] == [("rope",), (), ("rope",)]
    start = solution.at(taut[1])
    assert abs(start.position("bob")[2] - 2.0 / 3.0) < NEAR
    # |x + v s + g s^2 / 2| = 1 from there: its first positive root
    (x, z), (u, w) = ((e[0], e[2]) for e in (start.position("bob"), start.velocity("bob")))
    flight = np.roots([G * G / 4, -G * w, u * u + w * w - G * z, 2 * (x * u + z * w)])  # divided by the time
    flight = min(root.real for root in flight if abs(root.imag) < 1e-9 and root.real > 1e-6)
    assert abs(slack[1] - slack[0] - flight) < NEAR
    end = np.array([x + u * flight, z + w * flight - G * flight**2 / 2]), np.array([u, w - G * flight])
    assert name == "rope"
    assert abs(t - again[0]) < FINE
    assert abs(impulse - 2.0 * (end[0] @ end[1])) < NEAR  # takes the radial velocity
    after = solution.at(t).velocity("bob")[[0, 2]]
    assert np.abs(after - (end[1] - (end[0] @ end[1]) * end[0])).max() < NEAR
    assert np.linalg.norm(solution.position("bob"), axis=1).max() < 1.0 + FINE
    tension = solution.multipliers[:, 0]
    assert tension.min() > -NEAR
    assert not tension[(solution.t > taut[1]) & (solution.t < again[0])].any()


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_bob_dropped_beside_its_anchor_rebounds(e):
    """A fall of the length from the anchor itself, where the span of the slack rope has no direction."""
    scene, bob = tether(1.25, (0, 0, 0), restitution=e)
    solution = ts.simulate(scene, (0.0, 0.9), t_eval=[0.0, 0.5, 0.9])
    (t, _, impulse), *_ = solution.impulses
    assert abs(t - 0.5) < FINE
    assert abs(impulse - 2.0 * (1 + e) * 5.0) < FINE
    assert np.abs(solution.velocity(bob)[1] - (0, 0, 5.0 * e)).max() < FINE


def test_a_rope_over_a_pulley_lifts_a_weight_when_it_becomes_taut():
    """3 kg fall by 0.8 m, then lift 1 kg: 3 v = 4 w; a rope of several spans, one on the ground alone."""
    scene = ts.Scene(gravity=(0, 0, -G))
    heavy = scene.add_point_mass(mass=3.0, position=(0, 0, -1), name="heavy")
    light = scene.add_point_mass(mass=1.0, position=(1, 0, -2), name="light")
    floor = C.PlaneContact(light, scene.ground, point_b=(0, 0, -2), normal_b=(0, 0, 1), unilateral=True, name="floor")
    scene.add(floor)
    points = [(heavy, ORIGIN), (scene.ground, ORIGIN), (scene.ground, (1, 0, 0)), (light, ORIGIN)]
    scene.add(C.Rope(points, 4.8, name="rope"))
    solution = ts.simulate(scene, (0.0, 0.5))
    assert [phase[2] for phase in solution.phases] == [("floor",), ("rope",)]
    (t, name, impulse), *more = solution.impulses
    assert (name, more) == ("rope", [])
    assert abs(t - 0.4) < FINE
    assert abs(impulse - 3.0) < FINE
    assert abs(solution.state.velocity(light)[2] - (3.0 + 5.0 * 0.1)) < FINE
    assert np.abs(solution.multipliers[solution.t > 0.4, 1] - 15.0).max() < NEAR


def test_slack_ropes_in_files_parameters_and_at_starts(tmp_path):
    scene, bob = tether(1.0, (0, 0, -1.2), restitution=0.5)
    with pytest.raises(ts.InconsistentState, match=r"rope is overstretched by 0\.2\."):
        ts.simulate(scene, (0.0, 0.1))
    scene.assemble()
    assert np.abs(bob.position - (0, 0, -1)).max() < FINE
    bob.position = (0, 0, -0.2)
    scene.save(tmp_path / "scene.toml")
    again = ts.load(tmp_path / "scene.toml")
    assert (again["rope"].length, again["rope"].restitution, again["rope"].always_taut) == (1.0, 0.5, False)
    expected = ts.simulate(scene, (0.0, 1.0))
    assert (ts.simulate(again, (0.0, 1.0)).state.q == expected.state.q).all()
    longer = scene.with_parameters({"rope.length": 2.0})
    assert abs(ts.simulate(longer, (0.0, 1.0)).impulses[0][0] - np.sqrt(2 * 1.8 / G)) < FINE
    assert scene.mobility().degrees_of_freedom == 3


def test_a_run_ends_where_a_span_of_a_taut_rope_vanishes():
    scene = ts.Scene(gravity=(0, 0, 0))
    bead = scene.add_point_mass(mass=1.0, position=(0, 0, -1), velocity=(0, 0, 1), name="bead")
    other = scene.add_point_mass(mass=3.0, position=(1, 0, -1), velocity=(0.4, 0, -1), name="other")
    points = [(bead, ORIGIN), (scene.ground, ORIGIN), (scene.ground, (1, 0, 0)), (other, ORIGIN)]
    scene.add(C.Rope(points, name="line"))
    solution = ts.simulate(scene, (0.0, 2.0))
    assert not solution.success
    assert "The span of 'line' between 'bead' and 'ground' shrinks to length zero" in solution.message
