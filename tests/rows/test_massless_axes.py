"""Bodies without inertia about an axis that the joints hold: as exact and as cheap as all others, in every form."""

from itertools import pairwise

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import ALGEBRA, FINE, HELD, NEAR, ROUGH, TIGHT

C, I, F = ts.constraints, ts.integrators, ts.forces
GRAVITY = (4.0, -3.0, -8.0)
METHODS = [I.Taylor(rtol=1e-11, atol=1e-11), I.DOP853(1e-9, 1e-9)]


def chain(count, lean, inertia=0.0):
    """Links along z, joined by revolutes across; those in `lean` have that inertia about their length."""
    scene, rng = ts.Scene(gravity=GRAVITY), np.random.default_rng(1)
    last = scene.ground
    for i in range(count):
        body = scene.add_body(1.0, (0.1, 0.1, inertia if i in lean else 0.05), position=(0.0, 0.0, -i - 0.5))
        axis = rng.normal(size=3) * (1.0, 1.0, 0.2)
        scene.add(C.Revolute.at(last, body, point=(0.0, 0.0, -i), axis=axis))
        last = body
    return scene


def small():
    """A body with no inertia to speak of on its levers."""
    scene = chain(3, ())
    scene.bodies[1].inertia = (1e-12, 1e-12, 1e-13)
    return scene


def four_bar():
    """Planar, of rods without inertia about their length: three of its rows follow from the others."""
    scene = ts.Scene(gravity=GRAVITY)
    corners = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.5, 0.0, 1.5), (2.0, 0.0, 0.0)])
    bodies = []
    for a, b in pairwise(corners):
        angle = np.arctan2(*(b - a)[[0, 2]])
        p = (np.cos(angle / 2.0), 0.0, np.sin(angle / 2.0), 0.0)
        bodies.append(scene.add_body(1.0, (0.1, 0.1, 0.0), 0.5 * (a + b), p))
    around = [scene.ground, *bodies, scene.ground]
    for (a, b), point in zip(pairwise(around), corners, strict=True):
        scene.add(C.Revolute.at(a, b, point=point, axis=(0.0, 1.0, 0.0)))
    return scene


def hub():
    """A plate without inertia about an axis that balls and rods hold, so many that it is cut."""
    scene, rng = ts.Scene(gravity=GRAVITY), np.random.default_rng(2)
    plate = scene.add_body(3.0, (0.0, 0.4, 0.4))
    scene.add(
        C.Universal.at(plate, scene.ground, point=(0.0, 0.0, 0.5), axis_a=(1.0, 0.0, 0.0), axis_b=(0.0, 1.0, 0.0))
    )
    for i in range(16):
        point = np.array([np.cos(0.4 * i), np.sin(0.4 * i), 0.0])
        ball = scene.add_body(0.3, (0.02, 0.02, 0.03), point - (0.0, 0.0, 0.5), angular_velocity=rng.normal(size=3))
        scene.add(C.Spherical.at(plate, ball, point=point))
    scene.assemble()
    return scene


SCENES = {
    "one of a chain": lambda: chain(4, {2}),
    "all of a chain": lambda: chain(4, range(4)),
    "small": small,
    "four bar": four_bar,
    "hub": hub,
}


def demand_exact(scene, solution, tol=1e-11):
    """Accelerations are those of the equations of motion in plain NumPy; energy is kept, and nothing needs a basis."""
    assert solution.success
    assert solution.stats.b_iterations == 0
    for i in (0, len(solution.t) // 2, -1):
        state = scene.evaluate(solution.q[i], solution.qd[i], solution.t[i])
        size = np.abs(state.qdd).max()
        np.testing.assert_allclose(solution.qdd[i], state.qdd, rtol=0.0, atol=tol * size)
        kept = ~np.isnan(state.multipliers) & ~np.isnan(solution.multipliers[i])
        assert kept.any()
    np.testing.assert_allclose(solution.energy, solution.energy[0], rtol=0.0, atol=NEAR * (1 + abs(solution.energy[0])))
    errors = solution.constraint_error
    assert max(errors.position.max(), errors.velocity.max()) < ALGEBRA
    assert errors.acceleration.max() < TIGHT


@pytest.mark.slow_for("*-hub")
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("method", METHODS, ids=str)
def test_accelerations_are_exact(name, method):
    scene = SCENES[name]()
    demand_exact(scene, ts.simulate(scene, (0.0, 0.3), integrator=method))


@pytest.mark.slow
def test_many_bodies():
    scene = chain(120, range(0, 120, 2))
    demand_exact(scene, ts.simulate(scene, (0.0, 0.05), integrator=METHODS[0]), 1e-9)


@pytest.mark.parametrize("name", ["all of a chain", "four bar"])
def test_both_forms_agree(name):
    scene = SCENES[name]()
    free, basis = (
        ts.simulate(scene, (0.0, 0.3), integrator=I.Nystrom4(step=5e-3), formulation=form, chart_interval=10**9)
        for form in ("tangent", "null-space")
    )
    np.testing.assert_allclose(free.q, basis.q, rtol=0.0, atol=HELD)
    np.testing.assert_array_equal(free.charts.t, basis.charts.t)


@pytest.mark.parametrize("inertia", [1e-14, 1e-12, 1e-9, 1e-7])
def test_next_to_no_inertia_is_next_to_none(inertia):
    none, little = (
        ts.simulate(chain(4, range(4), j), (0.0, 0.3), integrator=METHODS[0]).raise_if_failed() for j in (0.0, inertia)
    )
    assert little.stats.steps == none.stats.steps
    np.testing.assert_allclose(little.q[-1], none.q[-1], rtol=0.0, atol=ALGEBRA + 10.0 * inertia)


@pytest.mark.slow
def test_friction_of_a_joint():
    scene = chain(2, {1})
    scene.add(F.RevoluteFriction(scene.constraints[1], kinetic=0.2, radius=0.05))
    solution = ts.simulate(scene, (0.0, 0.2), integrator=METHODS[1]).raise_if_failed()
    state = scene.evaluate(solution.q[-1], solution.qd[-1], solution.t[-1])
    np.testing.assert_allclose(solution.qdd[-1], state.qdd, rtol=0.0, atol=FINE * np.abs(state.qdd).max())
    assert solution.stats.b_iterations == 0


def test_a_free_rod_with_little_inertia_spins_on():
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    rod = scene.add_body(1.0, (1.0, 1.0, 1e-11), angular_velocity=(0.3, 0.0, 5.0))
    solution = ts.simulate(scene, (0.0, 1.0)).raise_if_failed()
    np.testing.assert_allclose(solution.angular_velocity(rod)[:, 2], 5.0, rtol=ROUGH)


def test_two_bodies_whose_common_axis_is_free():
    scene = ts.Scene()
    rods = [scene.add_body(1.0, (1.0, 1.0, 0.0), (0.0, 0.0, z), name=f"rod {z}") for z in (0.0, 1.0)]
    scene.add(C.Fixed.at(*rods, point=(0.0, 0.0, 0.5)))
    scene.add(C.Spherical.at(rods[0], scene.ground, point=(0.0, 0.0, -1.0)))
    with pytest.raises(ts.SingularConfiguration, match=r"rod .* axis \[0. 0. 1.\].*carries no inertia"):
        ts.simulate(scene, (0.0, 0.1))
    scene.add(C.Dot1(rods[1], scene.ground, axis_a=(1.0, 0.0, 0.0), axis_b=(0.0, 1.0, 0.0)))
    solution = ts.simulate(scene, (0.0, 0.1))
    assert solution.success
    assert solution.method.startswith("Taylor")


def test_an_axis_that_only_redundant_rows_hold():
    scene = four_bar()
    scene.add(C.Dot1(scene.bodies[0], scene.ground, axis_a=(1.0, 0.0, 0.0), axis_b=(0.0, 1.0, 0.0)))
    assert ts.simulate(scene, (0.0, 0.1)).success


def test_a_slide_without_inertia_is_still():
    scene = ts.Scene()
    slide = scene.add_body(1.0, (1.0, 1.0, 0.0))
    bob = scene.add_body(1.0, (0.1, 0.1, 0.0), (0.0, 0.0, -1.0))
    scene.add(C.Translational.at(slide, scene.ground, point=(0.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0)))
    scene.add(C.Revolute.at(slide, bob, point=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0)))
    bob.velocity, bob.angular_velocity = (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    solution = ts.simulate(scene, (0.0, 0.5), integrator=METHODS[0])
    assert solution.stats.rotations_skipped > 0
    demand_exact(scene, solution)
