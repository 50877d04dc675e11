"""Linkages that run through singular configurations: on the smooth branch, or with an account of why not."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts
from tests.helpers import closed_loops
from tests.helpers.closed_loops import angles
from tests.helpers.tolerances import ALGEBRA, CLOSE, COARSE, EXACT, FAIR, HELD, LOOSE, NEAR, ROUGH, ROUNDING
from tsdyn.stress.gallery import four_bars

ROOT = Path(__file__).parents[2]
SHAPES = {
    "alone": {},
    "plane rows": {"planar": True},
    "equal links": {"base": 1.0},
    "a row of four": {"loops": 4},
    "without gravity": {"gravity": (0.0, 0.0, 0.0), "angle": 0.5},
    "from close by": {"angle": 0.02},
}


@pytest.mark.slow_for("*1e-0*")
@pytest.mark.parametrize("tol", [1e-6, 1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_parallelogram_turns_over_and_over(shape, tol):
    scene = closed_loops.parallelogram(**SHAPES[shape])
    solution = ts.simulate(scene, (0.0, 10.0), rtol=tol, atol=tol, t_eval=np.linspace(0.0, 10.0, 301))
    assert solution.success, solution.message
    turned = angles(solution)
    assert turned[0][-1] - turned[0][0] > 16.0 * np.pi
    assert max(np.abs(other - turned[0]).max() for other in turned) < CLOSE  # a crank that turns back is another branch
    assert np.ptp(solution.energy) < max(1e-6, 100.0 * tol) * np.abs(solution.energy).max()
    assert solution.constraint_error.position.max() < ALGEBRA
    assert (
        solution.constraint_error.acceleration.max() < COARSE
    )  # next to the flat place by the series: to the tolerance
    assert np.isfinite(solution.q).all()
    assert np.isfinite(solution.qdd).all()


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-9, 1e-7, 1e-5])
def test_outputs_at_the_flat_place_itself(planar, off):
    """Turning at 6 rad/s, flat at t = 0.1 s: the crank's middle is accelerated by 18 m/s^2 towards its foot."""
    scene = closed_loops.parallelogram(-0.6, planar=planar, gravity=(0.0, 0.0, 0.0))
    solution = ts.simulate(scene, (0.0, 1.0), t_eval=[0.0, 0.1 + off, 1.0]).raise_if_failed()
    angle = 6.0 * off
    wanted = -18.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
    np.testing.assert_allclose(solution.acceleration(scene.body("crank 0"))[1], wanted, atol=ROUGH)
    assert solution.constraint_error.position.max() < ROUNDING


@pytest.mark.parametrize("planar", [False, True])
def test_a_start_where_branches_meet_is_refused(planar):
    scene = closed_loops.parallelogram(0.0, planar=planar)
    with pytest.raises(
        ts.SingularConfiguration, match=r"16 are independent .* 2 directions are free .* and 1 next to it\. .* Branches"
    ):
        ts.simulate(scene, (0.0, 1.0))


I = ts.integrators
METHODS = {
    "dop853": {"integrator": I.DOP853(1e-10, 1e-10)},
    "rk45": {"integrator": I.RK45(1e-9, 1e-9)},
    "nystrom4": {"integrator": I.Nystrom4(step=2e-3)},
    "sdirk54": {"integrator": I.SDIRK54(1e-8, 1e-8)},
    "dop853, null-space": {"integrator": I.DOP853(1e-10, 1e-10), "formulation": "null-space"},
}


@pytest.mark.slow_but("*-alone", "!sdirk54-*", "!*null-space-*")
@pytest.mark.parametrize("shape", ["alone", "plane rows", "a row of four"])
@pytest.mark.parametrize("method", METHODS)
def test_every_method_passes(method, shape):
    """Ten turns alone; as many outputs lie in the parts that series carry as their share of the time is."""
    end = 9.0 if shape == "alone" else 2.0
    scene = closed_loops.parallelogram(**SHAPES[shape])
    solution = ts.simulate(scene, (0.0, end), t_eval=np.linspace(0.0, end, 301), **METHODS[method]).raise_if_failed()
    turned = angles(solution)
    fine = ts.simulate(scene, (0.0, end), t_eval=solution.t, rtol=1e-13, atol=1e-13)
    assert max(np.abs(other - turned[0]).max() for other in turned) < CLOSE
    assert np.abs(turned[0] - angles(fine)[0]).max() < ROUGH
    assert np.ptp(solution.energy) < ROUGH * np.abs(solution.energy).max()
    assert solution.constraint_error.position.max() < ALGEBRA
    assert solution.constraint_error.acceleration.max() < COARSE
    assert "Taylor series carried the motion past a singular configuration" in solution.message
    assert "step of a series" in solution.charts.reason
    if shape == "alone":
        assert turned[0][-1] - turned[0][0] > 20.0 * np.pi


def pull_of(loops, heavy):
    """Angular acceleration of level cranks in such a row, rad/s^2."""
    inertia = (loops + 1) * (1.0 / 12 + 0.01 + 0.25) + heavy * loops
    return 9.81 * (0.5 * (loops + 1) + heavy * loops) / inertia


def released(loops, heavy=2.0, **scene):
    """A row of parallelograms with equal links of 1 m, released upright with unit speed; and angle(t) of its cranks.

    Its cranks turn alike: one equation of motion.
    """
    pull = pull_of(loops, heavy)

    def angle(t):
        return solve_ivp(
            lambda t, y: (y[1], -pull * np.cos(y[0])), (0.0, t[-1]), (0.5 * np.pi, -1.0), "DOP853", t,
            rtol=3e-14, atol=1e-15,
        ).y[0]  # fmt: skip

    return closed_loops.parallelogram(0.5 * np.pi, -1.0, 1.0, loops=loops, heavy=heavy, **scene), angle


@pytest.mark.slow_for("40-*")
@pytest.mark.parametrize(
    ("loops", "options", "off"),
    [
        (1, {"rtol": 1e-11, "atol": 1e-11}, 1e-8),
        (2, {"rtol": 1e-11, "atol": 1e-11}, 1e-8),
        (40, {"rtol": 1e-10, "atol": 1e-10}, 1e-7),
        (1, {"integrator": I.Taylor(1e-13)}, 1e-9),
        (5, {"integrator": I.Taylor(1e-13)}, 3e-9),
    ],
)
def test_accuracy_is_kept_over_ten_turns(loops, options, off):
    """And message and stats say what was kept."""
    scene, angle = released(loops, heavy=1.0 if loops == 5 else 2.0)
    t = np.linspace(0.0, 19.5, 301)
    solution = ts.simulate(scene, (0.0, t[-1]), t_eval=t, **options).raise_if_failed()
    assert np.abs(np.array(angles(solution)) - angle(t)).max() < off
    stats, energy = solution.stats, solution.energy
    assert stats.steps_near_singular > 0
    kept = np.abs(energy - energy[0]).max() / solution.kinetic_energy.max()
    np.testing.assert_allclose(stats.energy_error, kept, rtol=ROUGH, atol=EXACT)
    assert 0.0 <= stats.largest_landing < CLOSE
    assert f"energy error is {stats.energy_error:.1e}" in solution.message


TEN_TURNS = np.linspace(0.0, 19.5, 301)
NEAR_BY = np.array([0.6, 0.8, 1.0, 1.2, 1.4, 1.6])  # of a tolerance


def worst(scene, wanted, word, tolerances):
    """The largest error of the angles over ten turns, at any of the tolerances."""
    runs = (ts.simulate(scene, (0.0, 19.5), t_eval=TEN_TURNS, rtol=tol, atol=tol) for tol in tolerances)
    return max(np.abs(np.array(angles(run.raise_if_failed(), word)) - wanted).max() for run in runs)


@pytest.mark.slow_but("2.0-*")
@pytest.mark.parametrize("loops", [1, 2, 5])
@pytest.mark.parametrize("heavy", [0.5, 2.0, 4.0])
def test_accuracy_is_kept_at_every_tolerance_near_by(heavy, loops):
    """Errors scatter with the places of the steps, from 1e-10 to 6e-9."""
    scene, angle = released(loops, heavy=heavy)
    assert worst(scene, angle(TEN_TURNS), "crank", 1e-11 * NEAR_BY) < 1e-8


@pytest.mark.slow_but("2.0")
@pytest.mark.parametrize("heavy", [0.5, 2.0, 4.0])
def test_flat_places_cost_no_accuracy(heavy):
    """A pendulum with the equation of motion of the row has no singular configuration, and the same errors.

    They are those of regular steps in the first turn: 2e-11 of the energy, by which all turns last longer.
    """
    row, angle = released(1, heavy=heavy)
    part, J = pull_of(1, heavy) / 9.81, 1e-2
    arm = 0.5 * (1.0 + np.sqrt(1.0 - 4.0 * part**2 * J)) / part  # part = arm / (arm^2 + J)
    plain, spin = ts.Scene(gravity=(0.0, -9.81, 0.0)), (0.0, 0.0, -1.0)
    bob = plain.add_body(1.0, (J, J, J), (0.0, arm, 0.0), velocity=(arm, 0.0, 0.0), angular_velocity=spin, name="bob")
    plain.add(ts.constraints.Revolute.at(plain.ground, bob, point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)))
    wanted = angle(TEN_TURNS)
    there, here = worst(plain, wanted - wanted[0], "bob", 1e-10 * NEAR_BY), worst(row, wanted, "crank", 1e-10 * NEAR_BY)
    assert here < 4.0 * there


def test_a_regular_run_says_nothing_of_singular_configurations():
    solution = ts.simulate(closed_loops.parallelogram(0.5, 0.5, gravity=(0.0, 0.0, 0.0)), (0.0, 1.0))
    assert solution.stats.steps_near_singular == 0
    assert solution.stats.energy_error is None
    assert "singular" not in solution.message


@pytest.mark.parametrize("loops", [2, 5])
@pytest.mark.parametrize("thin", [1e-4, 1e-6])
def test_rods_of_little_inertia_about_their_axes_pass(loops, thin):
    """Their charts are small at regular places, too: near the lowest place, at 0.97 s, one step left them."""
    scene, angle = released(loops, thin=thin, last="spherical" if thin > 1e-5 else "cylindrical")
    t = np.linspace(0.0, 1.2, 13)
    solution = ts.simulate(scene, (0.0, 1.2), t_eval=t, integrator=I.Nystrom4(step=2e-3)).raise_if_failed()
    assert np.abs(np.array(angles(solution)) - angle(t)).max() < ROUGH


def test_a_passage_is_a_part_of_one_run():
    """Steps, outputs, events, dense output and progress go on as if there were one method."""
    scene, fractions = closed_loops.parallelogram(), []
    lowest = lambda t, state: state.q[1]  # noqa: E731  zero at the flat places
    solution = ts.simulate(
        scene, (0.0, 1.0), integrator=I.DOP853(1e-10, 1e-10), events=lowest, dense_output=True,
        progress=fractions.append,
    ).raise_if_failed()  # fmt: skip
    assert (np.diff(solution.t) > 0.0).all()
    assert solution.t[[0, -1]].tolist() == [0.0, 1.0]
    steps = solution.steps
    assert steps.accepted.sum() == solution.stats.steps == solution.t.size - 1
    np.testing.assert_allclose(steps.t[steps.accepted] + steps.h[steps.accepted], solution.t[1:], atol=EXACT)
    assert solution.stats.charts == len(solution.charts.t)
    assert (np.diff(fractions) >= 0.0).all()
    assert fractions[-1] == 1.0
    times = np.linspace(0.0, 1.0, 101)
    fine = ts.simulate(scene, (0.0, 1.0), t_eval=times, events=lowest, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(solution.at(times).q, fine.q, atol=NEAR)
    np.testing.assert_allclose(solution.at(times[::-1]).qd, fine.qd[::-1], atol=ROUGH)
    assert fine.t_events[0].size == 2
    np.testing.assert_allclose(solution.t_events[0], fine.t_events[0], atol=CLOSE)
    for steps in (1, 40, solution.stats.steps - 1):
        partial = ts.simulate(scene, (0.0, 1.0), integrator=I.DOP853(1e-10, 1e-10), max_steps=steps)
        assert partial.status == ts.Status.MAX_STEPS
        assert partial.stats.steps == steps
        np.testing.assert_array_equal(partial.q, solution.q[: steps + 1])
    again = ts.simulate(scene, (partial.state.t, 1.0), integrator=I.DOP853(1e-10, 1e-10), state=partial.state)
    np.testing.assert_allclose(again.q[-1], solution.q[-1], atol=NEAR)


@pytest.mark.parametrize("step", [1e-3, 1e-2, 0.1])
def test_fixed_steps_keep_their_grid(step):
    """A parallelogram of point masses that turns at 1 rad/s: in closed form."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    arm, velocity = np.array([np.cos(0.5), np.sin(0.5), 0.0]), (-np.sin(0.5), np.cos(0.5), 0.0)
    pins = [scene.add_point_mass(1.0, arm + np.array([x, 0.0, 0.0]), velocity) for x in (0.0, 2.0)]
    for mass, x in zip(pins, (0.0, 2.0), strict=True):
        scene.add(ts.constraints.Dot2(scene.ground, mass, axis_a=(0, 0, 1)))
        scene.add(ts.constraints.Distance(mass, scene.ground, point_b=(x, 0.0, 0.0)))
    scene.add(ts.constraints.Distance(*pins))
    solution = ts.simulate(scene, (0.0, 7.0), integrator=I.Nystrom4(step=step)).raise_if_failed()
    for mass, x in zip(pins, (0.0, 2.0), strict=True):
        place = np.stack((x + np.cos(0.5 + solution.t), np.sin(0.5 + solution.t), 0.0 * solution.t), axis=1)
        np.testing.assert_allclose(solution.position(mass), place, atol=CLOSE + 0.5 * step**4)
    off = np.abs(solution.t / step - np.rint(solution.t / step))
    assert (off > 1e-9).sum() < 12  # of the steps of series
    assert np.count_nonzero(off < CLOSE) > 6.0 / step


@pytest.mark.slow_for("*-sdirk54")
@pytest.mark.parametrize("method", ["taylor", *METHODS])
@pytest.mark.parametrize("off", [0.0, 1e-9, -1e-9, 1e-8, 1e-6, 1e-4])
def test_a_run_may_end_at_the_flat_place(method, off):
    """Turning at 6 rad/s, flat at t = 0.1 s."""
    scene, end = closed_loops.parallelogram(-0.6, gravity=(0.0, 0.0, 0.0)), 0.1 + off
    solution = ts.simulate(scene, (0.0, end), **METHODS.get(method, {})).raise_if_failed()
    angle, crank = 6.0 * end - 0.6, scene.body("crank 0")
    toward = np.array([np.cos(angle), np.sin(angle), 0.0])
    assert solution.t[-1] == end
    np.testing.assert_allclose(solution.position(crank)[-1], 0.5 * toward, atol=FAIR)
    np.testing.assert_allclose(solution.velocity(crank)[-1], 3.0 * np.array([-toward[1], toward[0], 0.0]), atol=ROUGH)
    np.testing.assert_allclose(solution.acceleration(crank)[-1], -18.0 * toward, atol=LOOSE)
    np.testing.assert_allclose(angles(solution)[1], angles(solution)[0], atol=CLOSE)
    assert solution.constraint_error.position.max() < ROUNDING
    if method == "taylor":
        many = ts.simulate(scene, (0.0, end), t_eval=[0.05, 0.0999, end], dense_output=True).raise_if_failed()
        np.testing.assert_allclose(many.q[-1], solution.q[-1], atol=HELD)
        np.testing.assert_allclose(many.at(end).q, solution.q[-1], atol=HELD)


def test_a_scene_without_series_stops_and_says_why():
    scene = closed_loops.parallelogram(planar=True)
    scene.add(
        ts.forces.PointForce(scene.body("crank 0"), force=lambda t: (0.0 if t < 9.0 else 1.0, 0.0, 0.0), name="breeze")
    )
    solution = ts.simulate(scene, (0.0, 1.0), integrator="dop853")
    assert not solution.success
    assert "near to losing rank" in solution.message
    assert "Without a series: PointForce 'breeze'" in solution.message
    assert np.isfinite(solution.q).all()
    assert solution.t[-1] == pytest.approx(0.3477, abs=1e-3)


def test_a_motion_that_ends_there_stops_with_an_account():
    """A bead on two strings that are wound in until they are one straight line; they have their series."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    bead = scene.add_point_mass(1.0, position=(0.0, 0.0, np.sqrt(1.25)))
    for x in (1.0, -1.0):
        length = ts.motions.Polynomial([1.5, 0.0, -0.5])
        scene.add(ts.constraints.Distance(bead, scene.ground, point_b=(x, 0.0, 0.0), length=length))
    for method in ({"integrator": I.Nystrom4(step=1e-3)}, {"integrator": "dop853"}, {}):
        solution = ts.simulate(scene, (0.0, 2.0), **method)
        assert not solution.success
        assert "near to losing rank" in solution.message
        assert 0.98 < solution.t[-1] < 1.0 + CLOSE
        assert np.isfinite(solution.q).all()
        assert solution.constraint_error.position.max() < HELD


@pytest.mark.slow
def test_series_are_not_loaded_before_they_are_needed():
    code = """
from tests.helpers import closed_loops
import tsdyn as ts
from tsdyn.taylor.step_parts import expand_series, pass_singular, reach
loaded = lambda: [kernel._address is not None for kernel in (expand_series, reach, pass_singular)]
scene = closed_loops.parallelogram(0.2, gravity=(0.0, 0.0, 0.0))
print(ts.simulate(scene, (0.0, 0.4), integrator="nystrom4").success, *loaded())
print(ts.simulate(scene, (0.0, 0.6), integrator="nystrom4").success, *loaded())
"""
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert result.stdout.splitlines() == ["True False False False", "True True True False"]


@pytest.mark.parametrize(("loops", "tol"), [(2, 1e-6), (1, 1e-10)])
def test_output_times_change_no_step_across_flat_places(loops, tol):
    """Rows that are selected anew at an output time are those of the end of the step again."""
    one = ts.simulate(four_bars(loops), (0.0, 4.0), rtol=tol, atol=tol)
    two = ts.simulate(four_bars(loops), (0.0, 4.0), rtol=tol, atol=tol, t_eval=np.linspace(0.0, 4.0, 1001))
    np.testing.assert_array_equal(one.steps.h, two.steps.h)
    np.testing.assert_array_equal(one.q[-1], two.q[-1])
