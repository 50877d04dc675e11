"""What a solution says of forces: reactions, energy, power, dissipation; turns counted; ends and refusals."""

import pickle

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.every_force import everything, pull
from tests.helpers.scenes import rotation, unit
from tests.helpers.tolerances import CLOSE, COARSE, FAIR, FINE, HELD, LOOSE, NEAR, ROUGH, ROUNDING
from tsdyn.observables.diagnostics import kinetic_energy, load_powers, potential_energy

C, F = ts.constraints, ts.forces
RK45 = ts.integrators.RK45
BY_RK45 = RK45(rtol=1e-9, atol=1e-9)
SPACING = 2e-4  # s, of differences of the energy


def energy_rates(solution):
    """d/dt (T + U) at every output along its q, qd, qdd: differences of sixth order of the energy."""
    q, qd, qdd = solution.q, solution.qd, solution.qdd
    arguments = solution.t, solution._memory

    def energy(s):
        x, xd = q + s * qd + s * s / 2 * qdd, qd + s * qdd
        total = kinetic_energy(solution.system, x, xd) + potential_energy(solution.system, x)
        for load in solution.packed.loads:
            total = total + load_powers(solution.packed, load, arguments[0], x, xd, arguments[1])[0]
        return total

    h = SPACING
    return sum(w * (energy(k * h) - energy(-k * h)) for k, w in {1: 45 / 60, 2: -9 / 60, 3: 1 / 60}.items()) / h


@pytest.mark.slow
def test_energy_power_and_dissipation_balance(rng):
    scene, _ = everything(rng)
    solution = ts.simulate(scene, (0, 1), integrator=BY_RK45).raise_if_failed()
    rounding = 20 * np.finfo(float).eps * solution.kinetic_energy.max() / SPACING
    assert np.abs(energy_rates(solution) - solution.power + solution.dissipation).max() < rounding
    assert np.abs(solution.power).max() > 1.0
    assert (solution.dissipation >= 0).all()
    assert solution.dissipation.max() > 0.1
    for i in range(0, solution.t.size, 50):
        found = scene.evaluate(solution.q[i], solution.qd[i], solution.t[i])
        np.testing.assert_allclose(solution.qdd[i], found.qdd, atol=CLOSE)
        np.testing.assert_allclose(solution.multipliers[i], found.multipliers, atol=CLOSE)


def test_a_spring_and_gravity_lose_nothing():
    scene = ts.Scene()
    bob = scene.add_body(1.0, (0.1, 0.2, 0.3), (1, 0, 0), angular_velocity=(1, 2, 3))
    scene.add(F.Spring(scene.ground, bob, point_b=(0.2, 0.1, 0), stiffness=40.0))
    solution = ts.simulate(scene, (0, 3), integrator=RK45(1e-11, 1e-11))
    assert np.ptp(solution.energy) < NEAR
    assert np.ptp(solution.potential_energy) > 1.0
    assert np.abs(solution.power).max() < HELD
    assert not solution.dissipation.any()


def test_harmonic_oscillator():
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(2.0, (1.5, 0, 0))
    scene.add(F.Spring(scene.ground, mass, stiffness=8.0, damping=0.4, free_length=1.0))
    solution = ts.simulate(scene, (0, 5), integrator=RK45(1e-11, 1e-12), t_eval=np.linspace(0, 5, 11))
    decay, w = 0.1, np.sqrt(4 - 0.1**2)
    t = solution.t
    expected = 1 + 0.5 * np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t))
    np.testing.assert_allclose(solution.q[:, 0], expected, atol=CLOSE)


@pytest.mark.slow
def test_reactions_of_forces_and_constraints_are_what_moves_the_bodies(rng):
    """Newton and Euler for each body from all reactions."""
    scene, _ = everything(rng)
    solution = ts.simulate(scene, (0, 1), integrator=BY_RK45, t_eval=[0.0, 0.45, 1.0]).raise_if_failed()
    total = {body: [np.zeros((3, 3)), np.zeros((3, 3))] for body in scene.bodies}
    for item in (*scene.constraints, *scene.forces):
        if item.b is not None and item.a.dimension and item.b.dimension:
            continue
        body = item.a if item.a.dimension else item.b
        force, torque = solution.reaction(item)
        assert force.shape == torque.shape == (3, 3)
        total[body][0] += force
    push = scene.forces[7]
    force, torque = solution.reaction(push)
    A = solution.rotation(push.a)
    np.testing.assert_allclose(force, [A[i] @ (np.sin(t), 0.2, t) for i, t in enumerate(solution.t)], atol=ROUNDING)
    np.testing.assert_allclose(torque, 0.0, atol=ROUNDING)  # about its own point
    np.testing.assert_allclose(solution.reaction(scene.forces[8])[1], [(0.1, 0.2, 0.3)] * 3, atol=ROUNDING)


def test_newton_euler_of_a_body(rng):
    scene = ts.Scene()
    body = scene.add_body(1.3, (0.2, 0.3, 0.4), rng.normal(size=3), unit(rng, 4), angular_velocity=(1, 2, 3))
    items = [
        scene.add(C.PlaneContact(body, scene.ground, point_a=(0, 0, 0.5), normal_b=(0, 1, 1))),
        scene.add(F.Spring(scene.ground, body, point_a=(0, 0, 5), point_b=(0.3, 0, 0), stiffness=9, damping=0.2)),
        scene.add(F.PointForce(body, point_a=(0, 0.2, 0), force=(1, 2, 3))),
        scene.add(F.Torque(body, torque=(0.3, 0.2, 0.1), frame="body")),
        scene.add(F.ViscousFriction(body, scene.ground, point_a=(0.1, 0, 0), damping=0.3, torsional_damping=0.1)),
    ]
    points = [(0, 0, 0.5), (0.3, 0, 0), (0, 0.2, 0), (0, 0, 0), (0.1, 0, 0)]
    scene.assemble()
    solution = ts.simulate(scene, (0, 0.5), integrator=BY_RK45, t_eval=[0, 0.2, 0.5]).raise_if_failed()
    for i in range(3):
        A = rotation(solution.orientation(body)[i])
        force, torque = np.array([0, 0, -1.3 * 9.81]), np.zeros(3)
        for item, s in zip(items, points, strict=True):
            f, n = (part[i] for part in solution.reaction(item))
            force, torque = force + f, torque + n + np.cross(A @ s, f)
        np.testing.assert_allclose(1.3 * solution.acceleration(body)[i], force, atol=FINE)
        w, J = solution.angular_velocity(body)[i], np.diag((0.2, 0.3, 0.4))
        euler = J @ solution.angular_acceleration(body)[i] + np.cross(w, J @ w)
        np.testing.assert_allclose(euler, A.T @ torque, atol=FINE)


# turns


def rotor(speed, **spring):
    """A rotor about z at its centroid, three rows that hold it there."""
    scene = ts.Scene()
    body = scene.add_body(1.0, (1.0, 1.0, 0.5), angular_velocity=(0, 0, speed))
    scene.add(C.Spherical(body, scene.ground))
    for axis in ((1, 0, 0), (0, 1, 0)):
        scene.add(C.Dot1(body, scene.ground, axis_a=(0, 0, 1), axis_b=axis))
    axes = {"axis_a": (0, 0, 1), "reference_a": (1, 0, 0), "reference_b": (1, 0, 0)}
    return scene, scene.add(F.TorsionalSpring(scene.ground, body, **axes, **spring))


@pytest.mark.parametrize("formulation", ["tangent", "maggi-kane"])
@pytest.mark.parametrize("t_eval", [None, (0.0, 1.7, 3.9, 4.0), (4.0,)])
@pytest.mark.parametrize("speed", [20.0, -20.0])
def test_turns_are_counted(t_eval, speed, formulation):
    """angle = speed / w sin(w t), 3.6 turns there and back; energy and torque follow it."""
    scene, spring = rotor(speed, stiffness=0.5 * 0.8**2)
    options = {"integrator": RK45(1e-10, 1e-10), "t_eval": t_eval, "formulation": formulation}
    solution = ts.simulate(scene, (0, 4), **options).raise_if_failed()
    angle = speed / 0.8 * np.sin(0.8 * solution.t)
    np.testing.assert_allclose(solution.reaction(spring)[1][:, 2], -0.32 * angle, atol=COARSE)
    np.testing.assert_allclose(solution.potential_energy, 0.16 * angle**2, atol=LOOSE)
    np.testing.assert_allclose(solution.energy, 0.25 * speed**2, rtol=ROUGH)
    assert np.abs(solution.power).max() < FINE * 0.32 * 25 * 20  # of torque times speed
    assert solution.q.shape == (solution.t.size, 7)


def test_turns_are_counted_on_from_a_state():
    scene, spring = rotor(20.0, stiffness=0.32)
    whole = ts.simulate(scene, (0, 4), integrator=RK45(1e-10, 1e-10))
    first = ts.simulate(scene, (0, 1.9), integrator=RK45(1e-10, 1e-10), t_eval=[0.0])
    state = pickle.loads(pickle.dumps(first.state))
    assert len(state) == 5
    assert state.memory[0] == pytest.approx(25 * np.sin(0.8 * 1.9), rel=FAIR)
    second = ts.simulate(scene, (state.t, 4), state=state, integrator=RK45(1e-10, 1e-10))
    np.testing.assert_allclose(second.q[-1], whole.q[-1], atol=ROUGH)
    np.testing.assert_allclose(second.reaction(spring)[1][-1, 2], whole.reaction(spring)[1][-1, 2], atol=ROUGH)
    other = ts.Scene()
    other.add_body(1, (1, 1, 1))
    with pytest.raises(ts.InvalidArgument, match="remembers"):
        ts.simulate(other, (0, 1), state=state)


def test_torsional_damper_and_actuator():
    """A motor against a damper: w = N / c (1 - exp(-c t / J))."""
    scene, _ = rotor(0.0, damping=0.7, actuator=lambda t: 3.0)
    solution = ts.simulate(scene, (0, 3), integrator=RK45(1e-10, 1e-10))
    w = 3.0 / 0.7 * (1 - np.exp(-0.7 / 0.5 * solution.t))
    body = scene.bodies[0]
    np.testing.assert_allclose(solution.angular_velocity(body)[:, 2], w, atol=NEAR)
    np.testing.assert_allclose(solution.power, 3.0 * w, atol=FAIR)
    np.testing.assert_allclose(solution.dissipation, 0.7 * w**2, atol=FAIR)


# ends


def test_a_spring_shrunk_to_nothing_turns_its_direction():
    """A free mass that arrives at the other end exactly at t = 1, in steps of powers of two."""
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(1.0, (1, 0, 0), (-1, 0, 0))
    spring = scene.add(F.Spring(scene.ground, mass, actuator=lambda t: 1e-300))
    solution = ts.simulate(scene, (0, 2), integrator=ts.integrators.Nystrom4(0.25))
    assert solution.state.q[0] == -1.0
    np.testing.assert_array_equal(np.sign(solution.reaction(spring)[0][:, 0]), np.sign(solution.t - 1.0 + 0.1))


@pytest.mark.parametrize("free_length", [None, 0.5])
def test_a_spring_has_no_direction_at_rest_at_its_anchor(free_length):
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(1.0, (1, 0, 0))
    scene.add(F.Spring(scene.ground, mass, stiffness=9.0, free_length=free_length, name="strut"))
    mass.position = (0, 0, 0)
    with pytest.raises(ts.InconsistentState, match=r"finite.*strut"):
        ts.simulate(scene, (0, 1))


def test_a_table_must_cover_the_run():
    scene = ts.Scene()
    mass = scene.add_point_mass(1.0)
    scene.add(F.PointForce(mass, force=ts.Table([0, 1, 2], np.ones((3, 3)))))
    ts.simulate(scene, (0, 2)).raise_if_failed()
    with pytest.raises(ts.InvalidForce, match="covers 0 to 2 s"):
        ts.simulate(scene, (0, 2.5))


def test_a_solution_keeps_its_forces_and_survives_pickling(rng):
    scene, _ = rotor(3.0, stiffness=1.0)
    scene.add(F.UserForce(scene.bodies[0], function=pull, parameters=(1.0,)))
    solution = ts.simulate(scene, (0, 0.3))
    twin = pickle.loads(pickle.dumps(solution))
    before = solution.reaction(scene.forces[0]), solution.power
    scene.forces[0].stiffness = 7.0
    solution.__dict__.pop("_force_powers")
    np.testing.assert_array_equal(solution.reaction(scene.forces[0]), before[0])
    np.testing.assert_array_equal(twin.reaction(twin.scene.forces[0]), before[0])
    np.testing.assert_array_equal(twin.power, before[1])


def test_forces_leave_scenes_alone_that_have_none():
    scene = ts.Scene()
    scene.add_body(1, (1, 1, 1))
    solution = ts.simulate(scene, (0, 0.1))
    assert not solution.power.any()
    assert not solution.dissipation.any()
    assert solution.state.memory.size == 0


def test_power_of_a_spring_at_zero_length_is_that_of_its_rate_just_after():
    scene = ts.Scene(gravity=(0, 0, 0))
    mass = scene.add_point_mass(1.0, position=(1, 0, 0))
    given = {"stiffness": 30.0, "damping": 0.2, "actuator": 3.0}
    spring = scene.add(F.Spring(scene.ground, mass, free_length=0.5, **given))
    mass.position, mass.velocity = (0, 0, 0), (2, 0, 0)
    solution = ts.simulate(scene, (0, 0.01), dense_output=True)
    lost = 0.2 * 2.0**2
    assert solution.power[0] == pytest.approx(-3.0 * 2.0, rel=ROUNDING)
    assert solution.power_of(spring)[0] == pytest.approx(-3.0 * 2.0 - lost, rel=ROUNDING)
