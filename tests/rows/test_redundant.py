"""Redundant constraints: the same motion as without them, all rows held, and nothing said to be unique that is not."""

import pickle
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import tsdyn as ts
from examples import door, four_bar, sarrus
from tests.helpers import closed_loops
from tests.helpers.closed_loops import angles, rod
from tests.helpers.minimal_coordinates import balance
from tests.helpers.tolerances import ALGEBRA, CLOSE, FAIR, HELD, NEAR, ROUNDING, TIGHT
from tsdyn.jit.kernels import twin
from tsdyn.rows.interface import return_to_selection, save_selection

C = ts.constraints
I = ts.integrators
METHODS = {
    "taylor": {"integrator": I.Taylor(rtol=1e-11, atol=1e-11)},
    "dop853": {"integrator": I.DOP853(rtol=1e-11, atol=1e-11)},
    "rk45": {"integrator": I.RK45(rtol=1e-10, atol=1e-10)},
    "nystrom4": {"integrator": I.Nystrom4(step=5e-4)},
    "dop853, null-space": {"integrator": I.DOP853(rtol=1e-11, atol=1e-11), "formulation": "null-space"},
    "sdirk54": {"integrator": I.SDIRK54(rtol=1e-10, atol=1e-10)},
}


@pytest.mark.slow_for("sdirk54")
@pytest.mark.parametrize("method", METHODS)
def test_the_motion_is_that_without_the_redundant_rows(method):
    whole, reduced = (
        ts.simulate(closed_loops.four_bar(planar), (0.0, 2.0), t_eval=np.linspace(0, 2, 21), **METHODS[method])
        for planar in (False, True)
    )
    assert whole.success
    assert reduced.success
    np.testing.assert_allclose(whole.q, reduced.q, atol=TIGHT)
    np.testing.assert_allclose(whole.qdd, reduced.qdd, atol=CLOSE)
    error = whole.constraint_error
    assert error.position.max() < 2 * ROUNDING
    assert error.velocity.max() < 2 * ROUNDING
    assert error.acceleration.max() < HELD
    assert np.isnan(reduced.multipliers).sum() == 0
    assert (np.isnan(whole.multipliers).sum(axis=1) == 3).all()


@pytest.mark.parametrize("module", [four_bar, door, sarrus])
def test_reactions_balance_newton_and_euler(module):
    solution = ts.simulate(module.build(), (0.0, 1.0), t_eval=np.linspace(0.0, 1.0, 11)).raise_if_failed()
    assert balance(solution) < HELD


def test_reactions_that_no_redundancy_touches_are_unique():
    """A pendulum hangs on a crank of the loop: its own joint is, the loop's are not, and a force is."""
    scene = closed_loops.four_bar()
    crank = scene.body("crank")
    end = crank.position + np.array([0.25, 0.4, 0.0])
    bob = rod(scene, end, end - np.array([0.0, 0.5, 0.0]), name="bob")
    joint = scene.add(C.Spherical.at(crank, bob, point=end))
    spring = scene.add(ts.forces.Spring(scene.ground, bob, stiffness=10.0))
    arm = end  # the crank turns about the origin
    bob.velocity = 3.0 * np.array([-arm[1], arm[0], 0.0])
    solution = ts.simulate(scene, (0.0, 0.5)).raise_if_failed()
    assert solution.reaction_unique(joint).all()
    assert solution.reaction_unique(spring).all()
    assert not solution.reaction_unique(scene.constraints[0]).any()
    assert not np.isnan(solution.reaction(scene.constraints[0])[0]).any()
    assert not np.isnan(solution.multipliers[:, solution.rows(joint)]).any()


def test_without_redundancy_all_is_unique():
    solution = ts.simulate(closed_loops.four_bar(planar=True), (0.0, 0.2)).raise_if_failed()
    assert all(solution.reaction_unique(joint).all() for joint in solution.scene.constraints[:3])


@pytest.mark.slow_for("sdirk54")
@pytest.mark.parametrize("method", METHODS)
def test_rows_are_chosen_anew_on_the_way(method):
    """A flap on two ball joints, carried round: which of the balls' rows is one too many turns with it.

    The row left out at first is the only one that is independent a quarter of a turn later.
    """

    def build(balls):
        scene = ts.Scene(gravity=(0.0, 0.0, -9.81))
        arm = scene.add_body(2.0, (0.1, 0.3, 0.3), (0.5, 0.0, 0.0), velocity=(0, 2.0, 0), angular_velocity=(0, 0, 4.0))
        flap = scene.add_body(
            1.0, (0.05, 0.1, 0.1), (1.0, 0.2, 0.0), velocity=(-0.8, 4.0, 0.0), angular_velocity=(0, 0, 4.0)
        )
        scene.add(C.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 0, 1)))
        if balls:
            scene.add(C.Spherical.at(arm, flap, point=(0.7, 0, 0), name="inner"))
            scene.add(C.Spherical.at(arm, flap, point=(1.2, 0, 0), name="outer"))
        else:
            scene.add(C.Revolute.at(arm, flap, point=(0.7, 0, 0), axis=(1, 0, 0)))
        return scene

    times = np.linspace(0.0, 2.0, 21)
    hinge, balls = (
        ts.simulate(build(kind), (0.0, 2.0), t_eval=times, **METHODS[method]).raise_if_failed()
        for kind in (False, True)
    )
    dropped = np.isnan(balls.multipliers)
    assert (dropped.sum(axis=1) == 1).all()
    assert len(np.unique(dropped, axis=0)) > 1
    np.testing.assert_allclose(balls.q, hinge.q, atol=NEAR)
    assert balls.constraint_error.position.max() < ROUNDING
    assert balls.constraint_error.acceleration.max() < TIGHT
    assert not balls.reaction_unique(balls.scene.constraints[1]).any()


def test_many_loops_side_by_side():
    """The sparse path: each of forty loops moves as one alone does, three rows of each left out."""
    alone = ts.simulate(closed_loops.parallelogram(0.6, 1.0), (0.0, 0.4)).raise_if_failed()
    scene = closed_loops.parallelogram(0.6, 1.0, loops=40)
    row = ts.simulate(scene, (0.0, 0.4)).raise_if_failed()
    assert row.constraint_error.position.max() < ALGEBRA
    assert (np.isnan(row.multipliers).sum(axis=1) == 3 * 40).all()
    assert max(np.abs(a - angles(row)[0]).max() for a in angles(row)) < TIGHT
    assert np.ptp(row.energy) < FAIR * np.abs(row.energy).max()
    assert alone.success


@pytest.mark.slow_for("400", "150")
@pytest.mark.parametrize("count", [20, 150, 400])
def test_a_closed_ring_of_many_links(count):
    """What a link may turn by without shifting those far away by more than their length falls with the size."""
    solution = ts.simulate(closed_loops.ring(count), (0.0, 0.1)).raise_if_failed()
    assert (np.isnan(solution.multipliers).sum(axis=1) == 3).all()
    assert np.ptp(solution.energy) < CLOSE * np.ptp(solution.kinetic_energy)
    assert solution.constraint_error.position.max() < HELD


def test_states_between_the_steps():
    scene = closed_loops.four_bar()
    solution = ts.simulate(scene, (0.0, 1.0), dense_output=True, events=lambda t, state: state.q[1])
    state = solution.at(np.linspace(0.0, 1.0, 23))
    assert np.isnan(state.multipliers).sum(axis=1).tolist() == [3] * 23
    fine = ts.simulate(scene, (0.0, 1.0), t_eval=np.linspace(0.0, 1.0, 23), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(state.q, fine.q, atol=FAIR)
    assert solution.t_events[0].size > 0


def test_a_run_goes_on_from_a_state_and_a_solution_is_kept():
    scene = closed_loops.four_bar()
    first = ts.simulate(scene, (0.0, 0.7))
    second = ts.simulate(scene, (0.7, 1.0), state=first.state).raise_if_failed()
    whole = ts.simulate(scene, (0.0, 1.0)).raise_if_failed()
    np.testing.assert_allclose(second.q[-1], whole.q[-1], atol=FAIR)
    again = pickle.loads(pickle.dumps(first))
    np.testing.assert_array_equal(again.multipliers, first.multipliers)
    assert not again.reaction_unique(again.scene.constraints[0]).any()


def test_the_baseline_drifts_with_redundant_rows_too():
    solution = ts.simulate(closed_loops.four_bar(), (0.0, 1.0), formulation="maggi-kane", integrator=I.Nystrom4(1e-3))
    assert solution.success
    assert 1e-15 < solution.constraint_error.position.max() < NEAR


def test_strict_policy():
    with pytest.raises(ts.RedundantConstraints, match="3 of the 23 constraint rows are redundant"):
        ts.simulate(closed_loops.four_bar(), (0.0, 1.0), redundancy="refuse")
    scene = closed_loops.four_bar()
    assert ts.simulate(scene, (0.0, 0.1)).success
    with pytest.raises(ts.RedundantConstraints, match="depends on"):
        ts.simulate(scene, (0.0, 0.1), redundancy="refuse")
    with pytest.raises(ts.TsdynError, match="'drop' or 'refuse', got 'keep'"):
        ts.simulate(scene, (0.0, 0.1), redundancy="keep")


def test_constraints_that_contradict_each_other_later():
    """Two rods of one length between the same points, one of which begins to grow: t^4 is nothing at the start."""
    scene = ts.Scene()
    bob = scene.add_body(1.0, (0.1, 0.1, 0.1), (1.0, 0.0, 0.0))
    scene.add(C.Distance(scene.ground, bob, length=1.0))
    growing = (lambda t: 1.0 + t**4, lambda t: 4.0 * t**3, lambda t: 12.0 * t**2)
    scene.add(C.Distance(scene.ground, bob, length=growing))
    solution = ts.simulate(scene, (0.0, 1.0))
    assert not solution.success
    assert solution.status == ts.Status.UNHELD
    assert "no longer hold" in solution.message
    assert solution.t[-1] < 0.1


@pytest.mark.parametrize(
    "method", [*(m for m in METHODS if m != "sdirk54"), pytest.param("sdirk54", marks=pytest.mark.slow)]
)
def test_no_output_is_off_a_row_that_was_redundant_at_the_start(method):
    """Its rate and acceleration are off before its length is: by 4e-8 and 1e-5 where that is off by 1e-10."""
    scene = ts.Scene()
    bob = scene.add_body(1.0, (0.1, 0.1, 0.1), (1.0, 0.0, 0.0))
    growing = ts.motions.Polynomial([1.0, 0.0, 0.0, 0.0, 1e-2])
    for length in (1.0, growing):
        scene.add(C.Distance(scene.ground, bob, length=length))
    solution = ts.simulate(scene, (0.0, 0.01), **METHODS[method])
    assert solution.status == ts.Status.UNHELD
    assert solution.t[-1] < 1e-3
    error = solution.constraint_error
    assert error.velocity.max() < 1e-9 * max(np.abs(solution.qd).max(), 1e-3)
    assert error.acceleration.max() < 1e-8


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e-6])
def test_a_flat_start_is_refused_in_any_unit_of_length(size):
    """A parallelogram with links in line: rows that depend on others here alone."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    ends = {"crank": (0.0, 1.0), "coupler": (1.0, 3.0), "rocker": (2.0, 3.0)}
    inertia = size**2 * np.array((0.01, 0.1, 0.1))
    crank, coupler, rocker = (
        scene.add_body(1.0, inertia, (0.5 * (a + b) * size, 0.0, 0.0), name=name) for name, (a, b) in ends.items()
    )
    joints = (scene.ground, crank, 0.0), (crank, coupler, 1.0), (coupler, rocker, 3.0), (rocker, scene.ground, 2.0)
    for a, b, x in joints:
        scene.add(C.Revolute.at(a, b, point=(x * size, 0.0, 0.0), axis=(0.0, 0.0, 1.0)))
    with pytest.raises(ts.SingularConfiguration, match="Branches of the motion meet"):
        ts.simulate(scene, (0.0, 1.0))


def test_a_start_that_breaks_a_redundant_row_is_refused_by_name():
    scene = door.build()
    crooked = C.Revolute(
        scene.ground, scene.bodies[0], point_a=(0.0, 0.001, 0.0), point_b=(-door.WIDTH / 2, 0, 0),
        axis_a=door.AXIS, axis_b=(0, 0, 1), name="crooked hinge",
    )  # fmt: skip
    scene.add(crooked)
    with pytest.raises(ts.InconsistentState, match=r"crooked hinge' point\[1\]: Phi = -?0.001"):
        ts.simulate(scene, (0.0, 1.0))


def test_a_door_on_hinges_of_two_axes_is_told_to_be_locked():
    scene = door.build()
    scene.add(C.Revolute.at(scene.ground, scene.bodies[0], point=(0.0, 0.1, 0.0), axis=door.AXIS))
    solution = ts.simulate(scene, (0.0, 0.5)).raise_if_failed()
    assert "leave no degree of freedom" in solution.message
    assert np.abs(solution.qd).max() < HELD


def test_what_the_solver_sees_of_redundant_rows():
    scene = closed_loops.four_bar()
    found = scene.evaluate()
    first = ts.simulate(scene, (0.0, 0.01))
    np.testing.assert_allclose(found.qdd, first.qdd[0], atol=TIGHT * np.abs(first.qdd[0]).max())
    assert np.isnan(found.multipliers).sum() == 3
    assert found.Phi_q.shape == (23, 21)
    assert np.abs(found.Phi_q @ found.qdd + found.gamma).max() < TIGHT


def test_a_scene_that_is_changed_is_looked_at_anew():
    scene = closed_loops.four_bar()
    assert ts.simulate(scene, (0.0, 0.1)).success
    scene.bodies[0].mass = 2.0
    changed = ts.simulate(scene, (0.0, 0.1)).raise_if_failed()
    assert (np.isnan(changed.multipliers).sum(axis=1) == 3).all()


def test_a_hub_with_redundant_joints():
    """Sixteen hinged flaps on one block, each on two hinges of one axis."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81))
    block = scene.add_body(20.0, (2.0, 2.0, 2.0), name="block")
    scene.add(C.Fixed.at(scene.ground, block, point=(0, 0, 0)))
    for i in range(16):
        y = 0.3 * i
        flap = rod(scene, (0.0, y, 0.0), (1.0, y, 0.0), name=f"flap {i}")
        for place in (y - 0.1, y + 0.1):
            scene.add(C.Revolute.at(block, flap, point=(0.0, place, 0.0), axis=(0, 1, 0)))
    solution = ts.simulate(scene, (0.0, 0.5)).raise_if_failed()
    assert (np.isnan(solution.multipliers).sum(axis=1) == 16 * 5).all()
    heights = np.array([solution.position(body)[:, 2] for body in scene.bodies[1:]])
    np.testing.assert_allclose(heights, np.broadcast_to(heights[0], heights.shape), atol=TIGHT)
    assert solution.constraint_error.position.max() < ALGEBRA


def test_a_redundant_row_is_found_wherever_a_loop_starts():
    """Elimination without pivoting leaves 1e-16 over the least pivot of a redundant row: more than zero at times."""
    scene = closed_loops.bricard()
    run = ts.simulate(scene, (0.0, 20.0), integrator=I.Taylor(1e-12), t_eval=np.linspace(0.0, 20.0, 60))
    for state in map(ts.State, run.t, run.q, run.qd, run.qdd, run.multipliers):
        first = ts.simulate(scene, (state.t, state.t + 1e-3), integrator=I.Taylor(1e-12), state=state, max_steps=1)
        assert np.isnan(first.multipliers[0]).sum() == 1


@pytest.mark.slow_but("Nystrom4*")
@pytest.mark.parametrize(
    "method", [I.Nystrom4(1e-3), I.DOP853(1e-9, 1e-9), I.RK45(1e-8, 1e-8), I.Radau(1e-8, 1e-8)], ids=repr
)
def test_a_driven_six_bar_with_a_doubled_hinge(method):
    """Eight rows are redundant, and the best selection changes along the motion; fixed steps can't be shortened."""
    scene = ts.load(Path(__file__).with_name("doubled_hinge.toml"))
    run = ts.simulate(scene, (0.0, 0.5), integrator=method)
    expected = ts.simulate(scene, (0.0, 0.5), rtol=1e-12, atol=1e-12)
    assert run.success, run.message
    np.testing.assert_allclose(run.q[-1], expected.q[-1], atol=1e-5)
    assert run.constraint_error.position.max() < 1e-12


def test_a_selection_of_redundant_rows_is_restored_whole():
    """After a passing one, of other rows and of another number."""
    best, none = np.array([0.5, 1.0, 0.25, 1.0, 0.125]), np.zeros(5)
    f = SimpleNamespace(dropped=np.array([2, 4, 1, 0, 0, 0]), saved=np.zeros(6, int), best=best.copy(), saved_best=none)
    twin(save_selection)(f)
    f.dropped[:] = 3, 0, 2, 3, 0, 0
    f.best[:] = 2.0
    twin(return_to_selection)(f)
    assert f.dropped[:3].tolist() == [2, 4, 1]
    assert f.best.tolist() == best.tolist()
