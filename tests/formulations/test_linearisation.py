"""What implicit methods know of the equations' derivatives, against differences of sixth order."""

import numpy as np
import pytest

import tsdyn as ts
from benchmarks.stiff import hung, jointed
from tests.helpers import built_in
from tests.helpers.every_force import everything
from tests.helpers.reduced_ode import Tangent, difference
from tests.helpers.reference import load
from tests.helpers.scenes import BETWEEN, PRIMITIVES, build, random_chain, random_pair, unit
from tests.helpers.tolerances import EPS, HELD, LOOSE
from tsdyn.elements.loads import JointLoad

C, F = ts.constraints, ts.forces
SPACING = 1e-3  # of differences of f
QUOTIENT = 3e-11  # of the size of f and its derivatives: ten times what rounding and SPACING^6 f^(7) leave
TRANSCENDENTAL, SMOOTH = ("Thread", "Gear"), 2e-3  # constraints with sines and angles in them; their differences
POLYNOMIAL = 0.05  # of differences of polynomials of degree six and less, which they are exact for


def demand_derivatives(scene, rng, spread=0.05, t=0.2, h=SPACING):
    """Both Jacobians of f at a random state of the chart of the start; returns the reduced ODE and the state."""
    ode = Tangent(scene)
    v, vd = spread * rng.normal(size=ode.k), ode.vd + rng.normal(size=ode.k)
    vdd = ode.f(v, vd, t)
    f_v, f_vd = ode.jacobians(t)
    expected_v = difference(lambda x: ode.f(x, vd, t), v, h)
    expected_vd = difference(lambda x: ode.f(v, x, t), vd, h)
    size = 1.0 + max(np.abs(part).max() for part in (vdd, expected_v, expected_vd))
    np.testing.assert_allclose(f_v, expected_v, rtol=0, atol=QUOTIENT * size)
    np.testing.assert_allclose(f_vd, expected_vd, rtol=0, atol=QUOTIENT * size)
    return ode, v, vd


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sliding_top", "two_body_pendulum", "two_body_pendulum_spatial", "chain_4"])
def test_jacobian_of_reference_scenes(name, rng):
    for _ in range(3):
        demand_derivatives(load(name)[0], rng)


@pytest.mark.slow
@pytest.mark.parametrize("links", [1, 2, 3, 5])
def test_jacobian_of_random_chains(links, rng):
    demand_derivatives(build(random_chain(rng, links)), rng)


@pytest.mark.slow
@pytest.mark.parametrize("between", BETWEEN)
@pytest.mark.parametrize("name", PRIMITIVES)
def test_jacobian_with_every_constraint(name, between, rng):
    """The driven ones away from the time of the chart."""
    scene = build(random_pair(rng, name, between))
    scene.assemble()
    demand_derivatives(scene, rng)


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind",
    [k for k in built_in.FORCES if not issubclass(k, (ts.JointFriction, JointLoad))],
    ids=lambda kind: kind.__name__,
)
def test_jacobian_with_every_force(kind, rng):
    """On a chain of two bodies, fast enough that stiffness and damping and what they do to joints all count.

    But for friction of joints, of which the Jacobian holds the normal loads fixed, and for loads on joints, below.
    """
    scene = build(random_chain(rng, 2))
    scene.add(kind.example(rng, *scene.bodies))
    demand_derivatives(scene, rng)


@pytest.mark.slow
def test_jacobian_with_loads_on_joints(rng):
    """Of the angle and the displacement, not linear."""
    scene = ts.Scene()
    arm = scene.add_body(1.0, (1.0, 1.1, 1.2), (1.0, 0.0, 0.0), angular_velocity=(0.0, 0.7, 0.0), velocity=(0, 0, -0.7))
    sled = scene.add_body(
        0.5, (0.2, 0.3, 0.4), (2.0, 0.0, 0.0), angular_velocity=(0.0, 0.7, 0.0), velocity=(0, 0, -1.4)
    )
    hinge = scene.add(C.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 1, 0)))
    slide = scene.add(C.Translational.at(arm, sled, point=(1.5, 0, 0), axis=(1, 0, 0)))
    scene.add(F.JointTorque(hinge, function=lambda t, angle, rate: -3.0 * angle - 0.5 * rate * rate))
    scene.add(F.JointForce(slide, function=lambda t, s, rate: -20.0 * s * s - 2.0 * rate * s))
    demand_derivatives(scene, rng)


@pytest.mark.slow
def test_jacobian_with_all_forces_and_a_driven_rod(rng):
    demand_derivatives(everything(rng)[0], rng)


def points(rng):
    """Point masses and a body: rods, one of them driven, a plane, springs and friction."""
    scene = ts.Scene(gravity=(1.0, -2.0, -9.0))
    first, second, third = (scene.add_point_mass(m, rng.normal(size=3), rng.normal(size=3)) for m in (0.7, 1.1, 1.6))
    body = scene.add_body(1.2, (0.3, 0.4, 0.5), (1.0, 1.0, 1.0), unit(rng, 4), angular_velocity=(1.0, -2.0, 3.0))
    scene.add(C.Distance(first, scene.ground))
    scene.add(C.Distance(second, body, point_b=(0.1, 0.2, 0.3)))
    scene.add(C.PlaneContact(third, scene.ground, normal_b=(1.0, 2.0, 3.0)))
    scene.add(F.Spring(first, third, stiffness=20.0, damping=3.0))
    scene.add(F.Spring(scene.ground, second, stiffness=20.0, damping=3.0, point_a=(3.0, 0.0, 0.0)))
    scene.add(F.CoulombFriction(third, scene.ground, force=2.0, slip_velocity=0.5))
    scene.assemble()
    return scene


@pytest.mark.slow
def test_jacobian_of_point_masses(rng):
    demand_derivatives(points(rng), rng)


@pytest.mark.slow
@pytest.mark.parametrize(("make", "scale"), [(jointed, 1e-5), (hung, 1e-4)], ids=lambda x: getattr(x, "__name__", x))
def test_jacobian_of_stiff_scenes(make, scale, rng):
    """Softened, so that differences of f don't drown in the rounding of its size."""
    demand_derivatives(make(scale), rng)


@pytest.mark.slow
def test_kept_derivatives_serve_where_a_body_has_turned_to(rng):
    """What is kept of a bushing, its axes all different, serves where its body has turned to."""
    scene = ts.Scene()
    body = scene.add_body(1.0, (0.3, 0.4, 0.5), (0.0, 0.0, -1.0))
    scene.add(C.Spherical(body, scene.ground, point_a=(0.0, 0.0, 1.0)))
    scene.add(F.Bushing(body, scene.ground, torsional_damping=(3e5, 1e6, 1e4)))
    ode = Tangent(scene)
    v = 0.3 * rng.normal(size=ode.k)
    ode.f(np.zeros(ode.k), np.zeros(ode.k), 0.0)
    ode.jacobians(0.0)
    ode.f(v, np.zeros(ode.k), 0.0)
    kept = ode.jacobians(0.0, renew=False)
    exact = ode.jacobians(0.0)
    size = np.abs(exact[1]).max()
    assert size > 1e5
    np.testing.assert_allclose(kept[1], exact[1], rtol=0, atol=HELD * size)
    assert np.abs(kept[0] - exact[0]).max() < LOOSE * size  # gravity's and the joint's are those of before


@pytest.mark.slow
def test_solve_and_soften_are_dense_solves(rng):
    ode, *_ = demand_derivatives(build(random_chain(rng, 3)), rng)
    f_v, f_vd = ode.jacobians(0.2)
    one, none = np.eye(ode.k), np.zeros((ode.k, ode.k))
    for g in (1e-4, 0.02, 0.5):
        rho, ex, ey = rng.normal(size=(3, ode.k))
        P = one - g * f_vd - g * g * f_v
        J = np.block([[none, one], [f_v, f_vd]])
        whole = np.eye(2 * ode.k) - g * J
        small = 100 * EPS * max(np.linalg.cond(P), np.linalg.cond(whole))
        np.testing.assert_allclose(ode.solved(g, rho), np.linalg.solve(P, rho), rtol=small, atol=small)
        expected = np.linalg.solve(whole, np.concatenate((ex, ey)))
        np.testing.assert_allclose(ode.softened(ex, g, ey), expected, rtol=small, atol=small * np.abs(expected).max())
