"""Armature: inertia of joint coordinates in every form and method, in energies, analyses, files and reactions."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts
from tests.helpers.methods import one_of_each
from tests.helpers.tolerances import FINE, NEAR, ROUNDING

C, F = ts.constraints, ts.forces
METHODS = one_of_each(tol=1e-10, step=1e-3)
INERTIA, END = 0.7, 0.5


def double_pendulum():
    """Two bars on hinges about y; the second rotor turns with the angle between them."""
    scene = ts.Scene()
    one = scene.add_body(mass=2.0, inertia=(0.3, 0.4, 0.5), position=(0.5, 0, 0), name="one")
    two = scene.add_body(mass=1.0, inertia=(0.1, 0.2, 0.15), position=(1.5, 0, 0), name="two")
    first = scene.add(C.Revolute.at(scene.ground, one, point=(0, 0, 0), axis=(0, 1, 0), name="first"))
    second = scene.add(C.Revolute.at(one, two, point=(1, 0, 0), axis=(0, 1, 0), name="second"))
    scene.add(F.Armature(first, inertia=INERTIA, name="rotor"))
    scene.add(F.Armature(second, inertia=INERTIA / 4.0, ratio=-2.0))
    return scene


def minimal(t, y):
    """Its equations in the two absolute angles."""
    a, b, u, v = y
    c, s = np.cos(a - b), np.sin(a - b)
    M = np.array([[0.4 + 2.0 * 0.25 + 1.0, 0.5 * c], [0.5 * c, 0.2 + 0.25]])
    M += INERTIA * np.array([[2.0, -1.0], [-1.0, 1.0]])
    load = [9.81 * 2.0 * np.cos(a) - 0.5 * s * v * v, 9.81 * 0.5 * np.cos(b) + 0.5 * s * u * u]
    return [u, v, *np.linalg.solve(M, load)]


@pytest.fixture(scope="module")
def exact():
    return solve_ivp(minimal, (0.0, END), np.zeros(4), rtol=1e-12, atol=1e-12, method="DOP853").y[:, -1]


@pytest.mark.parametrize("method", METHODS)
def test_every_method_solves_the_equations_in_minimal_coordinates(method, exact):
    solution = ts.simulate(double_pendulum(), (0.0, END), **METHODS[method])
    a, b = solution.state.angle("first"), solution.state.angle("second")
    tol = 1e-8
    assert np.abs([a, a + b] - exact[:2]).max() < tol
    assert np.ptp(solution.energy) < 100.0 * tol
    assert solution.constraint_error.acceleration.max() < FINE


@pytest.mark.parametrize(
    ("integrator", "formulation"),
    [
        ("dop853", "maggi-kane"),
        *(pytest.param(*pair, marks=pytest.mark.slow) for pair in (("sdirk54", "null-space"), ("radau", "tangent"))),
    ],
)
def test_forms_agree(integrator, formulation, exact):
    options = {"integrator": integrator, "formulation": formulation, "rtol": 1e-11, "atol": 1e-11}
    state = ts.simulate(double_pendulum(), (0.0, END), **options).state
    assert abs(state.angle("first") - exact[0]) < 1e-9


def test_evaluate_has_the_whole_mass_matrix():
    scene = double_pendulum()
    found = scene.evaluate()
    acceleration = minimal(0.0, np.zeros(4))[2:]
    assert np.abs(found.qdd[[5, 12]] * 2.0 - acceleration).max() < FINE  # omega_y' = 2 e_2'' at the identity
    left = found.M @ found.qdd + found.Phi_q.T @ found.multipliers - found.Q_A - found.S
    assert np.abs(left).max() < 100.0 * FINE


def slider():
    scene = ts.Scene()
    block = scene.add_body(mass=2.0, inertia=(1, 1, 1), name="block")
    guide = scene.add(C.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(0, 0, 1), name="guide"))
    return scene, block, scene.add(F.Armature(guide, inertia=0.5, ratio=2.0, name="drive"))


def test_displacements_have_mass_and_reactions_are_those_of_the_rotor():
    scene, block, drive = slider()
    solution = ts.simulate(scene, (0.0, 1.0))
    assert abs(solution.state.displacement("guide") + 9.81 / 4.0) < FINE  # 2 kg of weight, 4 kg in motion
    force, torque = solution.reaction(drive, on=block)
    assert np.abs(force - (0.0, 0.0, 9.81)).max() < FINE
    assert np.abs(torque).max() < FINE
    assert np.abs(solution.kinetic_energy - 2.0 * solution.velocity(block)[:, 2] ** 2).max() < FINE


def flywheel(stiffness=12.0):
    scene = ts.Scene()
    wheel = scene.add_body(mass=1.0, inertia=(1, 1, 2), name="wheel")
    hinge = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    rotor = scene.add(F.Armature(hinge, inertia=0.01, ratio=10.0, name="rotor"))
    places = {"axis_a": (0, 0, 1), "reference_a": (1, 0, 0), "reference_b": (1, 0, 0)}
    scene.add(F.TorsionalSpring(scene.ground, wheel, **places, stiffness=stiffness))
    return scene, hinge, rotor


def test_analyses():
    scene, hinge, _ = flywheel()
    linear = scene.linearise()
    assert np.abs(linear.M - 3.0).max() < FINE
    assert np.abs(np.abs(linear.eigenvalues().imag) - 2.0).max() < FINE
    assert scene.equilibrium().stable
    loads = scene.inverse_dynamics({hinge: 0.5 * ts.motions.time**2}, [hinge], [0.0, 1.0])
    assert np.abs(np.ravel(loads.load(hinge)) - (3.0, 3.0 + 12.0 * 0.5)).max() < NEAR


def test_parameters_files_and_ensembles(tmp_path):
    scene, *_ = flywheel()
    scene.set("hinge", angle=0.1)

    def expected(inertia):
        return 0.1 * np.cos(np.sqrt(12.0 / (2.0 + 100.0 * inertia)))

    ensemble = ts.ensemble(scene, {"rotor.inertia": [0.01, 0.04]}, (0, 1), rtol=1e-10, atol=1e-10)
    for i, inertia in enumerate((0.01, 0.04)):
        assert abs(ensemble.case(i).state.angle("hinge") - expected(inertia)) < NEAR
    scene.save(tmp_path / "scene.toml")
    again = ts.load(tmp_path / "scene.toml")
    again["rotor"].inertia = 0.04
    assert abs(ts.simulate(again, (0, 1), rtol=1e-10, atol=1e-10).state.angle("hinge") - expected(0.04)) < NEAR


@pytest.mark.slow
def test_friction_that_follows_from_reactions_acts_beside_it():
    for integrator, formulation in (("taylor", "tangent"), ("dop853", "tangent"), ("dop853", "null-space")):
        scene = ts.Scene(gravity=(0, 0, -10))
        wheel = scene.add_body(mass=10.0, inertia=(0.3, 0.5, 0.3), angular_velocity=(0, 8, 0))
        bearing = scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 1, 0)))
        scene.add(F.RevoluteFriction(bearing, radius=0.02, kinetic=0.1))
        scene.add(F.Armature(bearing, inertia=0.5))
        state = ts.simulate(scene, (0, 1), integrator=integrator, formulation=formulation).state
        assert abs(state.angle_rate(bearing) - 7.8) < 1e-6  # half the deceleration without the rotor


def test_an_armature_of_zero_changes_no_motion_and_a_large_one_holds():
    plain, *_ = flywheel()
    without = plain.with_parameters({"rotor.inertia": 0.0})
    plain.remove(plain["rotor"])
    ends = [ts.simulate(scene, (0, 1), integrator="dop853").state.q for scene in (plain, without)]
    assert np.abs(ends[0] - ends[1]).max() < ROUNDING
    scene, *_ = flywheel()
    scene.set("hinge", angle=0.1)
    scene["rotor"].inertia = 1e8
    assert abs(ts.simulate(scene, (0, 1)).state.angle("hinge") - 0.1) < NEAR


def test_wrong_arguments():
    scene, hinge, rotor = flywheel()
    with pytest.raises(ts.InvalidForce, match="not negative"):
        F.Armature(hinge, inertia=-1.0)
    with pytest.raises(ts.InvalidForce, match="ratio must not be zero"):
        rotor.ratio = 0.0
    with pytest.raises(ts.InvalidForce, match="which must be from 0 to 0"):
        F.Armature(hinge, inertia=1.0, which=1)
    with pytest.raises(ts.InvalidForce, match="joint must be one with"):
        F.Armature(scene["wheel"], inertia=1.0)


def test_linearisation_about_a_motion_is_that_of_minimal_coordinates():
    """A spinning disc carries a pendulum whose rotor is heavy."""
    scene = double_pendulum()
    state = ts.simulate(scene, (0.0, 0.3), integrator="dop853").state
    linear = scene.linearise(state)
    a, b = state.angle("first"), state.angle("second")
    y = np.array([a, a + b, state.angle_rate("first"), state.angle_rate("first") + state.angle_rate("second")])
    step = 1e-5 * np.eye(4)
    slopes = np.array([np.subtract(minimal(0, y + e), minimal(0, y - e))[2:] / 2e-5 for e in step]).T
    T = np.array([[1.0, 0.0], [1.0, 1.0]])  # absolute angles by the joints'
    A = np.linalg.solve(T, slopes @ np.kron(np.eye(2), T))
    assert np.abs(linear.state_space().A[2:] - A).max() < 1e-7


def test_forms_agree_beside_rolling():
    """A driven wheel on a free axle: rows on velocities beside the rotor."""
    ends = []
    for formulation in ("tangent", "null-space"):
        scene, motion = ts.Scene(), {"position": (0, 0, 0.5), "velocity": (0.5, 0, 0)}
        axle = scene.add_body(mass=2.0, inertia=(0.2, 0.2, 0.3), **motion)
        wheel = scene.add_body(mass=1.0, inertia=(0.05, 0.1, 0.05), **motion, angular_velocity=(0, 1, 0))
        hub = scene.add(C.Revolute.at(axle, wheel, point=(0, 0, 0.5), axis=(0, 1, 0)))
        scene.add(C.RollingDisc(wheel, scene.ground, axis_a=(0, 1, 0), radius=0.5, normal_b=(0, 0, 1)))
        scene.add(F.Armature(hub, inertia=0.3))
        scene.add(F.Torque(wheel, torque=(0.1, 0.7, 0.2)))
        options = {"integrator": "dop853", "formulation": formulation, "rtol": 1e-10, "atol": 1e-10}
        ends.append(ts.simulate(scene, (0.0, 0.3), **options).state.q)
    assert np.abs(ends[0] - ends[1]).max() < NEAR


@pytest.mark.parametrize("name", ["rotor.inertia", "rotor.ratio"])
@pytest.mark.parametrize("beside", [False, True], ids=["alone", "beside a mass"])
def test_ensembles_vary_it(name, beside):
    """A torque of 6 N m on a wheel of 2 kg m^2: 6 / (2 + I r^2) rad/s after a second."""
    scene = ts.Scene()
    wheel = scene.add_body(1.0, (1, 1, 2), name="wheel")
    hinge = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    scene.add(F.Armature(hinge, inertia=0.01, ratio=10.0, name="rotor"))
    scene.add(F.Torque(wheel, torque=(0, 0, 6.0)))
    values = np.array([1.0, 2.0, 3.0]) * scene.parameters()[name]
    table = {name: values} | ({"wheel.mass": np.array([1.0, 2.0, 3.0])} if beside else {})
    for options in ({}, {"t_eval": np.linspace(0, 1, 5)}, {"integrator": "dop853"}):
        found = ts.ensemble(scene, table, (0, 1), **options)
        for i, value in enumerate(values):
            added = 100.0 * value if name == "rotor.inertia" else 0.01 * value**2
            assert abs(found.case(i).angle_rate("hinge")[-1] - 6.0 / (2.0 + added)) < 1e-8
