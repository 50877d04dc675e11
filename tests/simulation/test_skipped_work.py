"""What a scene doesn't need is not done: counts in the stats, and kernels that are never loaded."""

import numpy as np
import pytest

import tsdyn as ts
from examples import pendulum_chain, top, two_body_pendulum
from tests.helpers.processes import REPORT, run
from tests.helpers.reference import load
from tests.helpers.tolerances import ALGEBRA, COARSE, HELD

C, F, I = ts.constraints, ts.forces, ts.integrators
METHODS = {"nystrom4": I.Nystrom4(step=1e-2), "dop853": I.DOP853(1e-8, 1e-8), "taylor": I.Taylor(1e-10)}


def counts(scene, method, **options):
    solution = ts.simulate(scene, (0.0, 0.5), integrator=method, **options).raise_if_failed()
    return {name: value for name, value in vars(solution.stats).items() if name != "seconds"}


def bodies(*inertias):
    """Bodies in free fall, all turning."""
    scene = ts.Scene()
    for i, inertia in enumerate(inertias):
        scene.add_body(1.0, inertia, position=(3.0 * i, 0.0, 0.0), angular_velocity=(1.0, 2.0, 3.0))
    return scene


@pytest.mark.parametrize("name", METHODS)
def test_gyroscopic_torques_of_spheres(name):
    method = METHODS[name]
    round_one, long_one = (0.1, 0.1, 0.1), (0.1, 0.2, 0.25)
    some = counts(bodies(round_one, long_one, round_one), method)
    assert some["gyroscopic_skipped"] == 2 * some["evaluations"]
    assert counts(bodies(long_one), method)["gyroscopic_skipped"] == 0
    full = counts(bodies(0.1 * np.eye(3)), method)
    assert full == counts(bodies(round_one), method)
    assert full["gyroscopic_skipped"] == full["evaluations"]
    masses = ts.Scene()
    masses.add_point_mass(1.0)
    assert counts(masses, method)["gyroscopic_skipped"] == 0  # a point mass never had one


def test_a_sphere_turns_as_it_does_with_the_torque():
    """An inertia that is off a sphere's by rounding is not skipped, and makes no difference."""
    nearly = bodies((0.1, 0.1, np.nextafter(0.1, 1.0)))
    one, other = (ts.simulate(scene, (0.0, 2.0), rtol=1e-10, atol=1e-10) for scene in (bodies((0.1, 0.1, 0.1)), nearly))
    assert (one.stats.gyroscopic_skipped > 0, other.stats.gyroscopic_skipped) == (True, 0)
    np.testing.assert_allclose(one.q[-1], other.q[-1], rtol=0, atol=ALGEBRA)


@pytest.mark.parametrize("name", METHODS)
def test_forces_that_are_absent(name):
    method = METHODS[name]
    without = counts(two_body_pendulum.build(), method)
    assert without["forces_skipped"] == without["evaluations"]
    scene = two_body_pendulum.build()
    scene.add(F.PointForce(scene.bodies[1], force=(1e-300, 0.0, 0.0)))  # next to nothing
    some = counts(scene, method)
    assert some["forces_skipped"] == 0
    same = {key: value for key, value in without.items() if key != "forces_skipped"}
    assert {key: value for key, value in some.items() if key != "forces_skipped"} == same


def test_constant_columns_of_series():
    joints = counts(pendulum_chain.build(3), METHODS["taylor"])
    assert joints["columns_skipped"] == 2 * 3 * joints["evaluations"]  # both markers of each Spherical
    tip = counts(top.build(), METHODS["taylor"])
    assert tip["columns_skipped"] == 3 * tip["evaluations"]  # that of the normal varies, and belongs to the ground
    scene = ts.Scene()
    one, two = scene.add_body(1.0, (0.1, 0.1, 0.1)), scene.add_body(1.0, (0.1, 0.1, 0.1), position=(0.0, 0.0, 1.0))
    scene.add(C.Distance(one, two))
    assert counts(scene, METHODS["taylor"])["columns_skipped"] == 0
    assert counts(pendulum_chain.build(3), METHODS["dop853"])["columns_skipped"] == 0


@pytest.mark.parametrize("name", ["sliding_top", "two_body_pendulum_spatial", "chain_4"])
def test_factors_that_still_serve(name):
    """The last placement's factors tell the contraction."""
    scene = load(name)[0]
    solution = ts.simulate(scene, (0.0, 1.0), integrator=I.Nystrom4(step=1e-3), chart_interval=10)
    stats = solution.stats
    looks, charts = stats.steps + 1, stats.charts - 1
    assert looks - 5 <= stats.factorizations_skipped <= looks + 5
    assert 2 * stats.placements <= stats.factorizations <= 2 * stats.placements + charts + 8
    other = ts.simulate(
        scene, (0.0, 1.0), integrator=I.Nystrom4(step=1e-3), chart_interval=10, formulation="null-space"
    )  # which always looks anew
    np.testing.assert_allclose(solution.charts.contraction, other.charts.contraction, rtol=COARSE, atol=HELD)


def test_factors_far_from_the_place_are_not_taken():
    """Steps so long that the correction changes Phi_q U: it is factorised again to look at the chart."""
    scene = pendulum_chain.build()
    stats = ts.simulate(scene, (0.0, 1.0), integrator=I.Nystrom4(step=0.04), chart_interval=1).stats
    assert stats.factorizations_skipped < 0.2 * stats.steps


@pytest.mark.slow
def test_implicit_methods_keep_their_matrices():
    stats = counts(two_body_pendulum.build(), I.SDIRK54(1e-6, 1e-6))
    kept = stats["stage_iterations"] - stats["iteration_matrices"]
    assert 0 < kept <= stats["factorizations_skipped"] <= kept + stats["placements"] + stats["charts"]


def test_landings_that_need_no_solve():
    for scene in (pendulum_chain.build(), two_body_pendulum.build()):
        stats = ts.simulate(scene, (0.0, 1.0), integrator=I.Taylor(1e-14)).stats
        assert stats.solves_skipped + stats.newton_iterations >= stats.steps + 1
        assert stats.factorizations <= 2 * (stats.steps + 1)


# never heard of it: what else the process has run changes nothing, and what is not used is not loaded

LOADED = (
    REPORT
    + """
import gc
import numpy as np
import tsdyn as ts
from examples import pendulum_chain, drive_train, driven_pivot, top
from tsdyn.jit.compiled import is_loaded
from tsdyn.jit.kernels import Callback
from tsdyn.runs.stepper import advance
from tsdyn.taylor.stepper import advance_series
def everything_else():
    ts.simulate(drive_train.build(), (0.0, 0.1), t_eval=[0.0, 0.05], events=lambda t, state: t - 0.02)
    ts.simulate(drive_train.build(), (0.0, 0.1), integrator="sdirk54", dense_output=True).at(0.05)
    ts.simulate(driven_pivot.build(), (0.0, 0.1))
    ts.simulate(top.build(), (0.0, 0.1), formulation="null-space", integrator="rk45")
    ts.simulate(top.build(), (0.0, 0.1), formulation="maggi-kane", integrator="nystrom4")
def loaded():
    return sorted({o.py_func.__qualname__ for o in gc.get_objects() if type(o) is Callback and o._address})
def counted(**options):
    solution = ts.simulate(pendulum_chain.build(), (0.0, 0.2), **options)
    stats = {name: value for name, value in vars(solution.stats).items() if name != "seconds"}
    return [stats, solution.q[-1].tolist()]
BEFORE
found = [counted(t_eval=[0.0, 0.2]), loaded(), is_loaded(advance), is_loaded(advance_series)]
within = [counted(t_eval=[0.0, 0.1, 0.2])[0], loaded()]
steps = [counted(integrator="dop853", rtol=1e-8, atol=1e-8), loaded()]
report(found=found, within=within, steps=steps)
"""
)


@pytest.fixture(scope="module")
def alone():
    return run(LOADED.replace("BEFORE", ""), {})[0]


@pytest.mark.slow
def test_counts_are_those_of_a_process_that_never_heard_of_the_rest(alone):
    after = run(LOADED.replace("BEFORE", "everything_else()"), {})[0]
    for name in ("found", "within", "steps"):
        assert after[name][0] == alone[name][0]


@pytest.mark.slow
def test_kernels_of_other_kinds_and_methods_are_never_loaded(alone):
    _, names, of_steps, of_series = alone["found"]
    kinds = {name.split(".")[0] for name in names if name.endswith("_loop")}
    assert kinds == {"Spherical", "EulerNormalization"}
    expected = ["advance_series", "expand_series", "factor_values", "reach", "solve_values"]  # of symmetric S alone
    assert [name for name in names if not name.endswith("_loop")] == expected
    assert (of_steps, of_series) == (0, 1)  # the driver of the other methods is not loaded either


@pytest.mark.slow
def test_accelerations_between_the_steps_are_loaded_where_an_output_asks(alone):
    assert "accelerate_here" not in alone["found"][1]
    assert set(alone["within"][1]) - set(alone["found"][1]) == {"accelerate_here", "pass_singular"}


@pytest.mark.slow
def test_a_method_loads_its_own_step_and_nothing_between_the_steps(alone):
    new = set(alone["steps"][1]) - set(alone["within"][1])
    assert {"second_order_step", "place", "accelerate", "complete", "check", "start_chart", "stage_error_norm"} <= new
    assert not {name for name in new if name.startswith(("fill", "dop853", "hermite", "implicit", "linear", "time_"))}
    assert {name.split(".")[0] for name in new if name.endswith("_loop")} <= {"Spherical", "EulerNormalization"}
