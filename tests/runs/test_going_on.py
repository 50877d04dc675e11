"""Going on from states, scenes that change between runs, and runs in threads."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.calls import PARTS
from tests.helpers.fixed_steps import SCENES, STEP, formulations, rows, run, same, same_history, scenes
from tests.helpers.reference import Reference, error, load
from tests.helpers.scenes import build, random_chain, rotation
from tests.helpers.tolerances import EPS, FINE, HELD

FORMULATIONS = ("tangent", "null-space", "maggi-kane")


@scenes
@pytest.mark.parametrize("formulation", ["tangent", "null-space"])
def test_two_runs_joined_are_one_run_where_a_chart_changes(make, formulation):
    """There the first run would have begun a chart too, from the same point. (Maggi/Kane starts without its drift.)"""
    whole = run(make(), (0.0, 1.0), formulation=formulation)
    middle = len(whole.charts.t) // 2
    split = whole.charts.t[middle]
    (row,) = np.flatnonzero(whole.t == split)
    first = run(make(), (0.0, split), formulation=formulation)
    second = run(make(), (first.state.t, 1.0), formulation=formulation, state=first.state)
    same(first, rows(whole, slice(0, row + 1)))
    np.testing.assert_array_equal(second.charts.t, whole.charts.t[middle:])
    growth = 1e3  # of rounding, by the motion itself
    for name in ("q", "qd"):
        expected = getattr(whole, name)[row:]
        tolerance = growth * EPS * (1 + np.abs(expected).max())
        np.testing.assert_allclose(getattr(second, name), expected, atol=tolerance, rtol=0)


@pytest.mark.parametrize("name", ["sliding_top", "two_body_pendulum", "two_body_pendulum_spatial"])
def test_two_runs_joined_are_as_good_as_one(name):
    scene, reference = load(name)
    whole = run(scene, (0.0, 10.0), 1e-3, t_eval=reference.t)
    first = run(scene, (0.0, 3.3), 1e-3)
    second = run(scene, (first.state.t, 10.0), 1e-3, t_eval=reference.t[4:], state=first.state)
    tail = Reference(*(array[4:] for array in reference))
    assert error(second, tail) < 1.5 * error(whole, reference)


def test_state_is_the_last_output():
    scene, _ = load("two_body_pendulum_spatial")
    solution = run(scene, (0.0, 1.0))
    for name in PARTS:
        np.testing.assert_array_equal(getattr(solution.state, name), getattr(solution, name)[-1])
    solution.state.q[:] = 0.0  # a copy: the solution is not at its mercy
    assert solution.state.q.any()


def snapshot(scene):
    names = ("mass", "inertia", "position", "orientation", "velocity", "angular_velocity")
    return [np.array(getattr(body, name)) for body in scene.bodies for name in names]


@scenes
@formulations
def test_a_run_leaves_the_scene_as_it_was(make, formulation):
    scene = make()
    before, started = snapshot(scene), scene.evaluate()
    one = run(scene, (0.0, 1.0), formulation=formulation)
    for a, b in zip(before, snapshot(scene), strict=True):
        np.testing.assert_array_equal(a, b)
    for a, b in zip(started, scene.evaluate(), strict=True):
        np.testing.assert_array_equal(a, b)
    two = run(scene, (0.0, 1.0), formulation=formulation)
    same(one, two)
    same_history(one, two)


def test_a_result_outlives_a_change_of_its_scene():
    """What follows from a solution belongs to the scene as it was run."""
    scene, reference = load("two_body_pendulum_spatial")
    one, two = (run(scene, (0.0, 1.0), t_eval=reference.t[:2]) for _ in range(2))
    expected = {name: getattr(one, name).copy() for name in ("multipliers", "energy", "angular_momentum")}
    for body in scene.bodies:
        body.mass, body.inertia, body.position = 1.0, (1.0, 1.0, 1.0), (5.0, 5.0, 5.0)
    scene.gravity = (1.0, 0.0, 0.0)
    scene.add(ts.constraints.Distance(scene.bodies[0], scene.ground, length=9.0, name="late"))
    scene.add_body(1.0, (1.0, 1.0, 1.0), name="late body")
    for name, value in expected.items():
        np.testing.assert_array_equal(getattr(two, name), value, err_msg=name)
    np.testing.assert_array_equal(one.reaction(scene.constraints[0]), two.reaction(scene.constraints[0]))
    assert two.constraint_error.acceleration.max() < FINE


@pytest.mark.slow
def test_runs_in_threads_are_the_runs_one_after_the_other():
    """Scenes of their own, and one scene for all."""
    shared = SCENES["chain"]()
    jobs = [make() for make in SCENES.values()] * 2 + [shared] * 4
    formulations = [FORMULATIONS[i % 3] for i in range(len(jobs))]

    def work(job):
        return run(job[0], (0.0, 2.0), STEP / 4, formulation=job[1])

    serial = list(map(work, zip(jobs, formulations, strict=True)))
    with ThreadPoolExecutor(4) as pool:
        threaded = list(pool.map(work, zip(jobs, formulations, strict=True)))
    for one, two in zip(serial, threaded, strict=True):
        same(one, two)
        same_history(one, two)


def test_results_by_body_are_slices_of_q(rng):
    """position, orientation, rotation and their rates, against the coordinates."""
    definition = random_chain(rng, 2)
    definition["bodies"].insert(0, {"mass": 1.0, "position": rng.normal(size=3), "velocity": rng.normal(size=3)})
    definition["constraints"] = [
        (kind, a + 1 if a else 0, b + 1, given) for kind, a, b, given in definition["constraints"]
    ]
    scene = build(definition)
    solution = run(scene, (0.0, 0.2))
    at = 0
    for body in scene.bodies:
        np.testing.assert_array_equal(solution.position(body), solution.q[:, at : at + 3])
        np.testing.assert_array_equal(solution.velocity(body), solution.qd[:, at : at + 3])
        np.testing.assert_array_equal(solution.acceleration(body), solution.qdd[:, at : at + 3])
        at += 3
        if body is scene.bodies[0]:
            for name in ("orientation", "rotation", "angular_velocity", "angular_acceleration"):
                with pytest.raises(ts.InvalidBody, match="no orientation"):
                    getattr(solution, name)(body)
            continue
        p, pd = solution.q[:, at : at + 4], solution.qd[:, at : at + 4]
        np.testing.assert_array_equal(solution.orientation(body), p)
        np.testing.assert_allclose(solution.rotation(body), rotation(p), atol=8 * EPS)
        A_d = np.einsum("kij,kjl->kil", solution.rotation(body), skew(solution.angular_velocity(body)))
        np.testing.assert_allclose(np.imag(rotation(p + 1e-40j * pd)) / 1e-40, A_d, atol=HELD)
        at += 4
    assert at == solution.q.shape[1]


def skew(a):
    x, y, z = np.moveaxis(a, -1, 0)
    zero = np.zeros_like(x)
    return np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), (0, 1), (-2, -1))
