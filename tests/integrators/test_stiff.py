"""Implicit methods on stiff scenes: steps by accuracy alone, few Jacobians, no damping of their own."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.linalg import expm

import tsdyn as ts
from benchmarks.stiff import hung, jointed
from tests.helpers.closed_forms import compound_pendulum, point_pendulum
from tests.helpers.reference import demand_on_the_manifold
from tests.helpers.tolerances import CLOSE, HELD, NEAR

pytestmark = pytest.mark.slow  # kernels of their own, which explicit methods don't need
I = ts.integrators
by_name = {"ids": lambda x: getattr(x, "__name__", str(x))}
SDIRK54, ImplicitTrapezoid, RK45 = I.SDIRK54, I.ImplicitTrapezoid, I.RK45
METHODS = (ImplicitTrapezoid, SDIRK54)
STIFF = (jointed, hung)
END, TARGET = 5.0, 1e-4  # s, m
TIMES = np.linspace(0.0, END, 51)
LADDER = (1e-1, 1e-2, 1e-3, 1e-4, 5e-5, 3e-5, 1e-5, 1e-6)


def places(solution):
    return np.stack([solution.position(body) for body in solution.scene.bodies], axis=1)


@cache
def stiff(make, method, tol, scale=1.0):
    return ts.simulate(make(scale), (0.0, END), integrator=method(tol, tol), t_eval=TIMES).raise_if_failed()


def off_by(make, method, tol, scale=1.0):
    return np.abs(places(stiff(make, method, tol, scale)) - places(stiff(make, SDIRK54, 1e-9, scale))).max()


def cheapest(make, method, target):
    """The first run of a ladder of tolerances whose error in positions is below the target."""
    return next(stiff(make, method, tol) for tol in LADDER if off_by(make, method, tol) <= target)


@pytest.mark.slow
@pytest.mark.parametrize(("make", "end"), [(jointed, 0.3), (hung, 0.05)], **by_name)
def test_the_reference_of_stiff_scenes(make, end):
    """From beginning to end of the fast motion, and on, against RK45 at tight tolerances."""
    one, two = (
        ts.simulate(make(), (0.0, end), integrator=m, t_eval=[0.0, 0.2 * end, end])
        for m in (SDIRK54(1e-9, 1e-9), RK45(1e-11, 1e-11))
    )
    np.testing.assert_allclose(one.q, two.q, rtol=0, atol=HELD)
    np.testing.assert_allclose(one.qd, two.qd, rtol=0, atol=CLOSE)
    finer = off_by(make, SDIRK54, 1e-8)
    assert 0.0 < finer < NEAR  # what is compared with errors of 1e-6 and more


@pytest.mark.slow
@pytest.mark.parametrize(("method", "times"), [(ImplicitTrapezoid, 8), (SDIRK54, 50)], **by_name)
@pytest.mark.parametrize("make", STIFF, **by_name)
def test_fewer_steps_than_rk45(make, method, times):
    assert times * cheapest(make, method, TARGET).stats.steps < cheapest(make, RK45, TARGET).stats.steps


@pytest.mark.slow
@pytest.mark.parametrize("make", STIFF, **by_name)
def test_sdirk54_beats_the_trapezoid_where_accuracy_counts(make):
    """From tolerances of 1e-6 on, fewer evaluations for no larger an error."""
    other = stiff(make, ImplicitTrapezoid, 1e-6)
    own = cheapest(make, SDIRK54, off_by(make, ImplicitTrapezoid, 1e-6))
    assert 2 * own.stats.evaluations < other.stats.evaluations


@pytest.mark.slow_but("hung-*")
@pytest.mark.parametrize(
    ("make", "method", "tol"),
    [(jointed, SDIRK54, tol) for tol in (1e-1, 1e-2, 1e-3, 1e-4)]
    + [(jointed, ImplicitTrapezoid, tol) for tol in (1e-3, 5e-5)]
    + [(hung, SDIRK54, 1e-5), (hung, ImplicitTrapezoid, 1e-5)],
    **by_name,
)
def test_a_hundred_times_stiffer_takes_no_more_steps(make, method, tol):
    steps = [stiff(make, method, tol, scale).stats.steps for scale in (1.0, 100.0)]
    assert abs(steps[1] / steps[0] - 1.0) < 0.2
    assert off_by(make, method, tol, 100.0) < 100.0 * tol


@pytest.mark.slow_but("hung-*")
@pytest.mark.parametrize("method", METHODS, **by_name)
@pytest.mark.parametrize("make", STIFF, **by_name)
def test_stiff_scenes_reuse_their_jacobian(make, method):
    for scale in (1.0, 100.0):
        solution = stiff(make, method, 1e-5, scale)
        assert solution.stats.jacobians <= solution.stats.steps / 10
        demand_on_the_manifold(solution, solution)


@pytest.mark.slow_but("hung")
@pytest.mark.parametrize("make", STIFF, **by_name)
def test_work_balance(make):
    """What the energy loses is what dampers take, by Simpson's rule over the steps, which resolve the fast motion."""
    solution = ts.simulate(make(), (0.0, END), integrator=SDIRK54(1e-7, 1e-7))
    lost = simpson(solution.dissipation, x=solution.t)
    loss = solution.energy[0] - solution.energy[-1]
    swing = np.ptp(solution.kinetic_energy)
    assert np.abs(solution.power).max() < HELD * swing
    assert abs(loss - lost) < NEAR * swing
    if make is hung:  # there it is much more than what the error of the run could be
        assert loss > 1e-4 * swing


SOFT, HARD, DAMPING = 80.0, 1e6, 1e4  # N/m, N/m, N s/m


def soft_and_hard():
    """Two masses of 1 kg joined by a stiff, overdamped spring, on a soft one; its swing lasts a second."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    a, b = (scene.add_point_mass(1.0, (x, 0.0, 0.0)) for x in (1.3, 2.3))
    scene.add(ts.forces.Spring(scene.ground, a, stiffness=SOFT, free_length=1.0))
    scene.add(ts.forces.Spring(a, b, stiffness=HARD, damping=DAMPING, free_length=1.0))
    return scene


LINEAR = np.zeros((4, 4))
LINEAR[:2, 2:] = np.eye(2)
LINEAR[2:, :2] = [[-SOFT - HARD, HARD], [HARD, -HARD]]
LINEAR[2:, 2:] = [[-DAMPING, DAMPING], [DAMPING, -DAMPING]]
BEGIN = np.array([0.3, 0.3, 0.0, 0.0])


def displacements(solution):
    return np.column_stack((solution.q[:, [0, 3]] - [1.0, 2.0], solution.qd[:, [0, 3]]))


def amplitude(z):
    return np.hypot(z[:, 1], z[:, 3] / np.sqrt(SOFT / 2.0))


@pytest.mark.parametrize("method", [ImplicitTrapezoid(1e-3, 1e-3), SDIRK54(1e-4, 1e-4), SDIRK54(1e-6, 1e-6)], ids=repr)
def test_a_slow_mode_is_not_damped(method):
    """After fifty swings its amplitude is what it should be, by the exact solution of the linear equations."""
    solution = ts.simulate(soft_and_hard(), (0.0, 50.0), integrator=method)
    last = solution.t > 49.0
    exact = np.array([expm(LINEAR * t) @ BEGIN for t in solution.t[last]])
    np.testing.assert_allclose(amplitude(displacements(solution)[last]), amplitude(exact), rtol=method.rtol)


@pytest.mark.parametrize("step", [0.05, 0.02])
def test_the_trapezoid_is_the_trapezoidal_rule(step):
    """On linear equations, where it is (I - h A / 2)^-1 (I + h A / 2), thousands of fast time constants a step."""
    solution = ts.simulate(soft_and_hard(), (0.0, 20.0), integrator=ImplicitTrapezoid(step=step)).raise_if_failed()
    assert step * np.abs(np.linalg.eigvals(LINEAR)).max() > 300
    z = [BEGIN]
    for _ in solution.t[1:]:
        z.append(np.linalg.solve(np.eye(4) - step / 2 * LINEAR, (np.eye(4) + step / 2 * LINEAR) @ z[-1]))
    left = 1e-12 * solution.stats.steps  # by the iterations, at their tolerance for fixed steps
    np.testing.assert_allclose(displacements(solution), z, rtol=0, atol=left)
    assert solution.stats.jacobians == 1


@pytest.mark.slow_but("point_pendulum-*")
@pytest.mark.parametrize("method", [ImplicitTrapezoid(1e-4, 1e-4), SDIRK54(1e-6, 1e-6)], ids=repr)
@pytest.mark.parametrize("make", [point_pendulum, compound_pendulum], **by_name)
def test_a_pendulum_keeps_its_energy(make, method):
    """Over twenty swings from 115 degrees."""
    scene, quarter = make()
    solution = ts.simulate(scene, (0.0, 80.0 * quarter), integrator=method)
    assert np.abs(solution.energy - solution.energy[0]).max() < 10.0 * method.rtol * np.ptp(solution.kinetic_energy)


@pytest.mark.parametrize(
    ("tol", "end", "method"), [(1e-3, 1.0, I.Radau), (1e-3, 0.02, I.Taylor), (1e-13, 0.1, I.Taylor)]
)
def test_the_default_method_is_implicit_where_that_costs_less(tol, end, method):
    """Not for the little that is left of a run, nor at tolerances at which implicit steps are short, too."""
    solution = ts.simulate(jointed(), (0.0, end), rtol=tol, atol=tol).raise_if_failed()
    assert solution.method.startswith(method.__name__)
    assert solution.stats.stiff


def bushed(stiffness, damping):
    """A rod swings on a bushing, 1 s."""
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1e-3, 1 / 12, 1 / 12), position=(0.5, 0.0, 0.0))
    twist = (stiffness, 0.0, stiffness)
    place = {"point": (0, 0, 0), "stiffness": stiffness, "torsional_stiffness": twist, "damping": damping}
    scene.add(ts.forces.Bushing.at(scene.ground, rod, **place))
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stiffness", "damping"),
    [(1e6, 0.0), (1e6, 1e3), (1e8, 1e2), (1e8, 1e4), (1e10, 1e2), (1e10, 1e4), (1e12, 1e3), (1e12, 1e5)],
)
def test_the_default_method_takes_no_more_than_the_better_of_its_methods(stiffness, damping):
    """Oscillations that steps at the limit of stability keep alive have to be followed before long steps are taken.

    Where damping is slight, that is dearer at first than going on: an explicit method took 3.4 million steps at 1e12.
    """
    runs = [
        ts.simulate(bushed(stiffness, damping), (0.0, 1.0), max_steps=12000, **options)
        for options in ({}, {"integrator": "radau"}, {"integrator": "taylor"})
    ]
    default, *single = runs
    default.raise_if_failed()
    assert default.stats.steps < 1.5 * min(one.stats.steps for one in single if one.success) + 100
    best = next(one for one in single if one.success)
    np.testing.assert_allclose(default.q[-1], best.q[-1], rtol=0.0, atol=1e-8)
