"""Radau IIA: orders, agreement with other methods in every kind of scene, work at tight tolerances, what is refused."""

import re

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import tsdyn as ts
from benchmarks import friction
from benchmarks.stiff import hung, jointed
from benchmarks.stiff_chain import chain
from tests.helpers import closed_loops, locked_scenes, rough_joints
from tests.helpers.every_force import everything
from tests.helpers.reference import demand_on_the_manifold
from tests.helpers.tolerances import CLOSE, EPS
from tsdyn.stress import gallery, rods

I = ts.integrators
ORDERS = 5, 9, 13
compiles = pytest.mark.slow  # kernels of its own, which other methods don't need


@pytest.mark.parametrize("order", ORDERS)
def test_the_coefficients_are_those_of_radau_iia(order):
    """Collocation: A is exact for powers up to the number of stages; L-stable: R(z) -> 0; order 2 s - 1."""
    tableau, stages = I.Radau(order=order).tableau, (order + 1) // 2
    A, c = tableau.coefficients, np.array(tableau.nodes)
    for power in range(stages):
        np.testing.assert_allclose(A @ c**power, c ** (power + 1) / (power + 1), rtol=0, atol=20 * EPS)
    for power in range(order):
        assert abs(A[-1] @ c**power - 1 / (power + 1)) < 20 * EPS
    assert abs(1.0 - A[-1] @ np.linalg.solve(A, np.ones(stages))) < 1e4 * EPS  # R at infinity


@pytest.mark.parametrize("order", ORDERS)
def test_stages_fall_apart_by_the_eigenvalues(order):
    tableau = I.Radau(order=order).tableau
    there, back = tableau.transformations()
    values, found = tableau.eigenvalues, there @ tableau.coefficients @ back
    expected = np.zeros_like(found)
    expected[0, 0] = values[0].real
    for i in range(1, len(found), 2):
        z = values[i]
        expected[i : i + 2, i : i + 2] = [[z.real, -z.imag], [z.imag, z.real]]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e3 * EPS)


@pytest.mark.parametrize("order", ORDERS)
def test_the_error_estimate_has_the_order_of_the_stages(order):
    """With the start as a node besides, its quadrature is exact for powers below the number of stages, not beyond."""
    tableau, stages = I.Radau(order=order).tableau, (order + 1) // 2
    weights, c = tableau.error_weights(), np.array(tableau.c)
    assert weights[0] == tableau.eigenvalues[0].real
    assert max(abs(weights @ c**power) for power in range(stages)) < 100 * EPS
    assert abs(weights @ c**stages) > 1e-6


@pytest.mark.parametrize(("nodes", "order", "message"), [
    ((0.5, 1.0), 3, "an odd number of nodes"),
    ((0.2, 0.6, 0.9), 5, "the last one is 1"),
    ((0.6, 0.2, 1.0), 5, "in ascending order"),
    ((0.2, 0.6, 1.0), 5, "b c.3 = 1/4 fails"),
    ((0.2, 0.6, 1.0), 3, "exceed the number of nodes by 2"),
], ids=str)  # fmt: skip
def test_wrong_nodes_are_refused(nodes, order, message):
    with pytest.raises(ts.InvalidArgument, match=message):
        ts.CollocationTableau(nodes, order)


def test_orders_and_what_chooses_them():
    chosen = [I.Radau(tol, tol).order for tol in (1e-2, 1e-8, 1e-9)]
    assert (chosen, I.Radau(step=0.1).order, I.Radau(order=13).order) == ([9, 9, 13], 5, 13)
    assert repr(I.Radau(1e-3, 1e-4, order=5)) == "Radau(rtol=0.001, atol=0.0001, order=5)"
    with pytest.raises(ts.InvalidArgument, match="order must be 5, 9 or 13, got 7"):
        I.Radau(order=7)


@pytest.mark.slow_for("null-space")
@pytest.mark.parametrize("form", ["null-space", "maggi-kane"])
def test_other_forms_are_refused(form):
    scene = ts.Scene()
    scene.add_point_mass(1.0)
    with pytest.raises(
        ts.InvalidArgument, match=f"Radau solves its stages .* formulation='{form}' is served by .*dop853"
    ) as refused:
        ts.simulate(scene, (0.0, 1.0), integrator="radau", formulation=form)
    for name in re.findall("'(.*?)'", str(refused.value).partition("is served by")[2]):  # and so it is
        assert ts.simulate(scene, (0.0, 1.0), integrator=name, formulation=form).success
    with pytest.raises(ts.InvalidArgument, match="Taylor series are of the motion itself"):
        ts.prepare(scene, integrator="taylor", formulation=form)


@compiles
@pytest.mark.parametrize("tol", [1e-5, 1e-9])
def test_a_pendulum_on_a_rough_pin(tol):
    """Friction by the reactions of the pin, against minimal coordinates in SciPy; it turns back many times."""
    scene, bar, pin, friction = rough_joints.pendulum()
    found = ts.simulate(scene, (0.0, 3.0), integrator=I.Radau(tol, tol), dense_output=True).raise_if_failed()
    angle, rate = solve_ivp(rough_joints.pendulum_rates, (0, 3), (0, 0), method="DOP853", rtol=1e-12, atol=1e-12).y[
        :, -1
    ]
    place = 0.8 * np.array([np.cos(angle), 0.0, -np.sin(angle)])
    np.testing.assert_allclose(found.position(bar)[-1], place, rtol=0, atol=tol)
    np.testing.assert_allclose(found.angular_velocity(bar)[-1], (0, rate, 0), rtol=0, atol=10 * tol)
    demand_on_the_manifold(found, found)
    rough_joints.demand_balance(scene, found, (pin, friction), tol=tol)


@compiles
@pytest.mark.parametrize("make", [
    lambda: rough_joints.chain(6)[0],
    lambda: rough_joints.four_bar()[0],  # with redundant rows
    lambda: rough_joints.slide(0.5, 0.4)[0],
], ids=["chain", "four-bar", "slide"])  # fmt: skip
def test_friction_by_reactions_is_that_of_other_methods(make):
    exact = ts.simulate(make(), (0.0, 0.3), integrator=I.DOP853(1e-12, 1e-12), t_eval=[0.3])
    for method in (I.Radau, I.SDIRK54):
        found = ts.simulate(make(), (0.0, 0.3), integrator=method(1e-7, 1e-7), t_eval=[0.3]).raise_if_failed()
        np.testing.assert_allclose(found.q, exact.q, rtol=0, atol=1e-7)
        np.testing.assert_allclose(found.qd, exact.qd, rtol=0, atol=1e-6)


@compiles
@pytest.mark.parametrize("method", [I.Radau, I.SDIRK54])
def test_outputs_change_no_bit_where_there_is_friction_by_reactions(method):
    """Stages begin with the factors of the step's start, whatever has been asked for inside of the step before."""
    plain, asked = (
        ts.simulate(rough_joints.chain(4)[0], (0.0, 0.3), integrator=method(1e-6, 1e-6), t_eval=t_eval)
        for t_eval in ([0.3], np.linspace(0.0, 0.3, 50))
    )
    np.testing.assert_array_equal(plain.q[-1], asked.q[-1])


@compiles
@pytest.mark.parametrize("method", [I.Radau, I.SDIRK54])
def test_a_mechanism_that_jams_is_named(method):
    """The place where series find no reactions, and what is said there."""
    scene = rough_joints.chain(6)[0]
    exact, found = (ts.simulate(scene, (0.0, 1.0), integrator=each) for each in (I.Taylor(1e-8), method(1e-4, 1e-4)))
    assert found.status == exact.status == ts.Status.JAMMED
    assert abs(found.t[-1] - exact.t[-1]) < 1e-5


@compiles
@pytest.mark.parametrize("kind", ["force", "reaction"])
@pytest.mark.parametrize("tol", [1e-2, 1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("method", [I.Radau, I.SDIRK54])
def test_friction_within_a_tiny_slip_velocity(method, kind, tol):
    """A block of 1 kg, pushed by 3.2 sin(3 t) N, against friction of 2.5 N: the exact law, in closed form.

    With s = 3 t it slides from s = a = arcsin(2.5 / 3.2) on, until 3 v = 3.2 (cos a - cos s) - 2.5 (s - a) is zero, and
    sticks to s = a + pi, when it slides back. A mass of 1 kg swings beside it on a spring of 100 N/m, at up to 1 m/s:
    its corrections are far larger than those of the block at rest, and contract much sooner.
    """
    scene = ts.Scene(gravity=(0.0, 0.0, -10.0))
    block = scene.add_point_mass(1.0, name="block")
    plane = scene.add(ts.constraints.PlaneContact(block, scene.ground, normal_b=(0, 0, 1)))
    if kind == "force":
        scene.add(ts.forces.CoulombFriction(block, scene.ground, force=2.5, slip_velocity=1e-7))
    else:
        scene.add(ts.forces.ContactFriction(plane, kinetic=0.25, slip_velocity=1e-7))
    scene.add(ts.forces.PointForce(block, force=(ts.motions.Sine(3.2, 3.0), 0.0, 0.0)))
    mass = scene.add_point_mass(1.0, position=(0.0, 1.0, 0.0), velocity=(1.0, 0.0, 0.0), name="mass")
    scene.add(ts.constraints.PlaneContact(mass, scene.ground, normal_b=(0, 0, 1)))
    scene.add(ts.forces.Spring(mass, scene.ground, point_b=(-2.0, 1.0, 0.0), free_length=2.0, stiffness=100.0))
    a = np.arcsin(2.5 / 3.2)
    end = brentq(lambda s: 3.2 * (np.cos(a) - np.cos(s)) - 2.5 * (s - a), a + 0.1, a + np.pi)
    far = (3.2 * (np.cos(a) * (end - a) - np.sin(end) + np.sin(a)) - 1.25 * (end - a) ** 2) / 9.0
    times = (0.5 * (end - np.pi + a) + np.arange(12) * np.pi) / 3.0  # while it sticks
    found = ts.simulate(scene, (0.0, 12.0), integrator=method(tol, tol), t_eval=times).raise_if_failed()
    np.testing.assert_allclose(found.position(block)[:, 0], [0, far] * 6, rtol=0, atol=tol)


@compiles
@pytest.mark.parametrize("order", ORDERS)
def test_the_observed_order(order):
    """Of a pendulum with a spring and a damper, by fixed steps, down to rounding; between the steps, too."""

    def scene():
        found = ts.Scene(gravity=(0, 0, -9.81))
        rod = found.add_body(1.0, (0.01, 0.02, 0.015), position=(0.5, 0, 0), name="rod")
        found.add(ts.constraints.Spherical(found.ground, rod, point_b=(-0.5, 0, 0)))
        found.add(ts.forces.Spring(found.ground, rod, point_a=(1, 1, 0), stiffness=20.0, damping=0.3))
        return found

    times = np.linspace(0.05, 0.95, 19)
    exact = ts.simulate(scene(), (0, 1), t_eval=[*times, 1.0], integrator=I.Taylor(1e-15)).q
    errors, between, counts = [], [], {5: (16, 32, 64), 9: (8, 12, 18), 13: (7, 9, 12)}[order]
    for steps in counts:
        found = ts.simulate(scene(), (0, 1), integrator=I.Radau(step=1 / steps, order=order), dense_output=True)
        errors.append(np.abs(found.q[-1] - exact[-1]).max())
        between.append(np.abs(found.at(times).q - exact[:-1]).max())
    ratio = np.log(counts[-1] / counts[-2])
    assert np.log(errors[-2] / errors[-1]) / ratio > order - 1.0
    assert np.log(between[-2] / between[-1]) / ratio > (order + 1) / 2 + 1.0
    assert errors[-2] > 1e-13  # and no rounding


@compiles
@pytest.mark.parametrize(("make", "end"), [
    (jointed, 0.3), (hung, 0.05),
    (closed_loops.four_bar, 0.5),  # with redundant rows
    (lambda: locked_scenes.slider_crank(), 0.3),  # bodies that never turn
    (lambda: locked_scenes.hub(8), 0.1),
    (lambda: rods.build(rods.loop(6)), 0.2), (lambda: rods.build(rods.net(2, 2)), 0.1),
    (gallery.governor, 0.3),
    (lambda: everything(np.random.default_rng(3))[0], 0.2),
    (lambda: chain(5), 0.1),
], ids=["joint", "springs", "four-bar", "slider", "hub", "loop", "net", "governor", "forces", "chain"])  # fmt: skip
@pytest.mark.parametrize("tol", [1e-5, 1e-9])
def test_the_motion_is_that_of_other_methods(make, end, tol):
    """Errors below the tolerance, also between the steps, and all three levels of the constraints at rounding."""
    scene, times = make(), np.linspace(0.0, end, 23)
    other = ts.simulate(scene, (0.0, end), t_eval=times, integrator=I.SDIRK54(1e-11, 1e-11)).raise_if_failed()
    own = ts.simulate(scene, (0.0, end), integrator=I.Radau(tol, tol), dense_output=True).raise_if_failed()
    between = own.at(times)
    np.testing.assert_allclose(between.q, other.q, rtol=tol, atol=tol)
    np.testing.assert_allclose(between.qd, other.qd, rtol=10 * tol, atol=10 * tol)
    demand_on_the_manifold(own, own)
    np.testing.assert_allclose(own.at(own.t).q, own.q, rtol=0, atol=CLOSE)
    again = ts.simulate(scene, (0.0, end), integrator=I.Radau(tol, tol), t_eval=times)
    assert again.stats.steps == own.stats.steps  # outputs change no step


@compiles
@pytest.mark.parametrize("kind", [I.Radau, I.SDIRK54])
def test_an_output_between_steps_takes_two_factorisations(kind):
    """Of Phi_q U for positions and velocities, of S for accelerations, which are the interpolant's: no forces."""
    scene, method = chain(8), kind(1e-3, 1e-3)
    few, many = (ts.simulate(scene, (0.0, 0.2), integrator=method, t_eval=np.linspace(0, 0.2, n)) for n in (2, 102))
    exact = ts.simulate(scene, (0.0, 0.2), integrator=I.SDIRK54(1e-9, 1e-9), t_eval=many.t)
    np.testing.assert_allclose(many.q, exact.q, rtol=0, atol=1e-3)
    demand_on_the_manifold(many, many)
    assert many.stats.factorizations - few.stats.factorizations <= 2 * 100
    assert many.stats.evaluations == few.stats.evaluations


@compiles
def test_less_than_half_the_evaluations_of_sdirk54_at_tight_tolerances():
    """For an error no larger; less than 0.6 matrices a step, and memory in proportion to the number of bodies."""

    def run(method):
        return ts.simulate(chain(16), (0.0, 0.5), integrator=method).raise_if_failed()

    exact, own, other = (run(method) for method in (I.Radau(1e-11, 1e-11), I.Radau(1e-9, 1e-9), I.SDIRK54(1e-8, 1e-8)))
    assert np.abs(own.q[-1] - exact.q[-1]).max() < np.abs(other.q[-1] - exact.q[-1]).max()
    assert 2 * own.stats.evaluations < other.stats.evaluations
    assert own.stats.iteration_matrices < 0.6 * (own.stats.steps + own.stats.rejected)
    assert own.stats.stage_iterations < 3 * 7 * (own.stats.steps + own.stats.rejected)
    assert own.stats.jacobians == 1


@compiles
def test_overdamped_bushings_take_hundreds_of_steps():
    """Order reduction would take 39,000 of them at 1e8 N/m: the order of the stages is the order that is left."""
    scene = ts.Scene()
    arm = scene.add_body(
        mass=1.0, inertia=(0.1, 0.1, 0.02), position=(0.0, 0.0, -0.5), angular_velocity=(0.5, 0.0, 0.0)
    )
    scene.add(ts.forces.Bushing(arm, scene.ground, point_a=(0.0, 0.0, 0.5), stiffness=1e8, damping=1e5))
    found = ts.simulate(scene, (0.0, 2.0), integrator=I.Radau(1e-8, 1e-8)).raise_if_failed()
    assert found.stats.steps < 400


@compiles
@pytest.mark.parametrize("order", ORDERS)
def test_the_interpolant_is_exact_for_polynomials(order):
    """A force that is a polynomial of time of the degree of the stages: position and velocity between the steps."""
    stages = (order + 1) // 2
    series = legendre.leg2poly(np.eye(stages + 1)[-1])
    scene, span = ts.Scene(gravity=(0, 0, 0)), (0.0, 1.0)
    ball = scene.add_point_mass(1.0)
    scene.add(ts.forces.PointForce(ball, force=(ts.motions.Polynomial(series.tolist()), 0.0, 0.0)))
    found = ts.simulate(scene, span, integrator=I.Radau(step=0.25, order=order), dense_output=True)
    t = np.linspace(0.0, 1.0, 41)
    force = np.polynomial.Polynomial(series)
    state = found.at(t)
    np.testing.assert_allclose(state.q[:, 0], force.integ(2)(t), rtol=0, atol=1e2 * EPS)
    np.testing.assert_allclose(state.qd[:, 0], force.integ()(t), rtol=0, atol=1e2 * EPS)
    np.testing.assert_allclose(state.qdd[:, 0], force(t), rtol=0, atol=1e3 * EPS)


@compiles
@pytest.mark.parametrize("method", [I.Radau, I.SDIRK54])
def test_pins_that_stick_and_slide_by_the_exact_law(method):
    """Each pin stops and turns back as by series; no steps towards the events, which end a phase where they are."""
    scene = friction.build(4, rough=True, slip=0.0)
    exact = ts.simulate(scene, (0.0, 1.0), rtol=1e-11, atol=1e-11)
    found = ts.simulate(scene, (0.0, 1.0), integrator=method(1e-8, 1e-8)).raise_if_failed()
    assert [names for *_, names in found.phases] == [names for *_, names in exact.phases] == [
        (), ("RevoluteFriction(pin 1)",), ()
    ]  # fmt: skip
    starts = [[begin for begin, *_ in solution.phases] for solution in (found, exact)]
    np.testing.assert_allclose(*starts, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.q[-1], exact.q[-1], rtol=0, atol=1e-8)
    assert np.diff(np.unique(found.t)).min() > 1e-6
