"""ImplicitTrapezoid and SDIRK54: orders, errors, dense output, what is counted, and how they end or refuse."""

import numpy as np
import pytest

import tsdyn as ts
from benchmarks.stiff import hung, jointed
from tests.helpers.driven_rod import driven
from tests.helpers.reference import demand_on_the_manifold, load, run
from tests.helpers.tolerances import CLOSE, EPS, HELD, LOOSE
from tsdyn.stress.gallery import governor

pytestmark = pytest.mark.slow  # kernels of their own, which explicit methods don't need
I = ts.integrators
SDIRK54, ImplicitTrapezoid, RK45 = I.SDIRK54, I.ImplicitTrapezoid, I.RK45
SCENES = ("sliding_top", "two_body_pendulum", "two_body_pendulum_spatial")
METHODS = (ImplicitTrapezoid, SDIRK54)
by_name = {"ids": lambda x: getattr(x, "__name__", str(x))}


# order, errors


@pytest.mark.slow
@pytest.mark.parametrize("first", [3.0, 1.0, 1e-5])
@pytest.mark.parametrize("method", METHODS, **by_name)
def test_a_first_step_of_any_length(method, first):
    """One far too long is tried and rejected, by a failed stage or by its error, even where no step is before it."""
    tol = {ImplicitTrapezoid: 1e-5, SDIRK54: 1e-7}[method]
    solution, off = run("two_body_pendulum", method(tol, tol, first_step=first))
    assert off < 100.0 * tol
    history = solution.steps
    assert history.h[0] == first
    assert history.accepted.sum() == solution.stats.steps
    assert (~history.accepted).sum() == solution.stats.rejected
    assert history.accepted[0] == (first < 0.1)
    accepted = history.t[history.accepted]
    np.testing.assert_allclose(np.diff(accepted), history.h[history.accepted][:-1], rtol=CLOSE)


# dense output


@pytest.mark.slow_but("driven-*", "hung-*")
@pytest.mark.parametrize("method", [ImplicitTrapezoid(1e-3, 1e-3), SDIRK54(1e-7, 1e-7), SDIRK54(1e-2, 1e-2)], ids=repr)
@pytest.mark.parametrize("make", [lambda: load(SCENES[0])[0], lambda: load(SCENES[2])[0], driven, jointed, hung])
def test_dense_output_is_on_the_manifold_and_changes_nothing(make, method, rng):
    dense, plain = (ts.simulate(make(), (0.0, 2.0), integrator=method, dense_output=d) for d in (True, False))
    state = dense.raise_if_failed().at(rng.uniform(0.0, 2.0, 300))
    demand_on_the_manifold(dense, state)
    demand_on_the_manifold(dense, dense.at(dense.t))
    demand_on_the_manifold(dense, dense)
    for name in ("t", "q", "qd", "qdd"):
        np.testing.assert_array_equal(getattr(dense, name), getattr(plain, name))
    np.testing.assert_array_equal(dense.steps.h, plain.steps.h)


# what is counted


@pytest.mark.slow
@pytest.mark.parametrize("tol", [1e-3, 1e-5])
@pytest.mark.parametrize("method", METHODS, **by_name)
def test_work_is_counted(method, tol):
    """Every stage iteration is an evaluation; besides, one at each step's end, and two to begin."""
    scene, _ = load("two_body_pendulum")
    stats = ts.simulate(scene, (0.0, 10.0), integrator=method(tol, tol)).stats
    tried, implicit_stages = stats.steps + stats.rejected, len(method.tableau.c) - 1
    assert stats.evaluations == stats.stage_iterations + tried + 2
    assert implicit_stages * tried <= stats.stage_iterations <= 8 * implicit_stages * tried
    assert stats.jacobians <= 2
    assert 0 < stats.iteration_matrices < 0.5 * stats.stage_iterations
    explicit = ts.simulate(scene, (0.0, 1.0), integrator="rk45").stats
    assert explicit.jacobians == explicit.iteration_matrices == explicit.stage_iterations == 0


# ends and refusals


def pushed_late():
    """A mass that rests for a second, then is pushed ever harder: at a step of 0.1 s nothing foretells that."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    mass = scene.add_point_mass(1.0, (1.0, 0.0, 0.0))
    scene.add(ts.constraints.PlaneContact(mass, scene.ground, normal_b=(0.0, 0.0, 1.0)))
    scene.add(ts.forces.PointForce(mass, force=lambda t: (1e6 * max(t - 1.0, 0.0), 0.0, 0.0)))
    return scene


def demand_a_failed_stage(solution):
    assert solution.status == ts.Status.STAGE_FAILED
    assert not solution.success
    assert all(np.isfinite(part).all() for part in (solution.q, solution.qd, solution.qdd))
    assert solution.t.size == solution.stats.steps + 1
    assert "stage" in solution.message
    assert "smaller step" in solution.message
    with pytest.raises(ts.StepFailure, match="stage") as caught:
        solution.raise_if_failed()
    assert caught.value.solution is solution


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS, **by_name)
def test_a_stage_that_fails_midway(method):
    """The run hands back what it had, which an adaptive one goes on from, past the same place."""
    solution = ts.simulate(pushed_late(), (0.0, 2.0), integrator=method(step=0.1))
    demand_a_failed_stage(solution)
    assert solution.t[-1] == pytest.approx(1.0)
    assert solution.stats.steps == 10
    np.testing.assert_allclose(solution.q, [(1.0, 0.0, 0.0)] * 11, atol=HELD)
    state = solution.state
    after = ts.simulate(pushed_late(), (state.t, 2.0), state=state, integrator=method(1e-5, 1e-5)).raise_if_failed()
    assert after.q[-1, 0] == pytest.approx(1.0 + 1e6 / 6.0, rel=LOOSE)


@pytest.mark.parametrize(("method", "step"), [(ImplicitTrapezoid, 0.2), (SDIRK54, 0.5)], **by_name)
def test_a_stage_of_a_step_far_too_long(method, step):
    demand_a_failed_stage(ts.simulate(hung(), (0.0, 5.0), integrator=method(step=step)))


@pytest.mark.parametrize("method", METHODS, **by_name)
def test_maggi_kane_is_refused(method):
    for integrator in (method(), method.__name__.lower()):
        with pytest.raises(ts.InvalidArgument, match=r"null-space.*'dop853', 'nystrom4', 'rk45'") as caught:
            ts.simulate(load("sliding_top")[0], (0.0, 1.0), integrator=integrator, formulation="maggi-kane")
        assert "'sdirk54'" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_velocity_constraints_hold_as_by_explicit_methods(method):
    solution = ts.simulate(governor(), (0.0, 2.0), integrator=method(rtol=1e-5, atol=1e-5))
    assert solution.success
    assert solution.constraint_error.velocity.max() < 8.0 * EPS * np.abs(solution.qd).max()
