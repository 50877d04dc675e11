"""Outputs, histories and going on: what is asked for never changes what is computed."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.reference import Reference, error, load
from tests.helpers.scenes import EPS, build, random_chain, random_pair, rotation

FORMULATIONS = ("tangent", "null-space", "maggi-kane")
ARRAYS = ("t", "q", "qd", "qdd", "multipliers")
STEP = 1 / 256  # s; a power of two, so that times of steps are exact


def run(scene, span, step=STEP, **options):
    integrator = ts.integrators.Nystrom4(step=step)
    return ts.simulate(scene, span, integrator=integrator, **options).raise_if_failed()


def same(one, two, names=ARRAYS):
    for name in names:
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name), err_msg=name)


def same_history(one, two):
    for a, b in zip((*one.steps, *one.charts, *one.state), (*two.steps, *two.charts, *two.state), strict=True):
        np.testing.assert_array_equal(a, b)


SCENES = {
    "sliding_top": lambda: load("sliding_top")[0],
    "spatial": lambda: load("two_body_pendulum_spatial")[0],
    "chain": lambda: build(random_chain(np.random.default_rng(1), 3)),
    "driven": lambda: assembled(random_pair(np.random.default_rng(2), "Distance, driven", "body to ground")),
}
scenes = pytest.mark.parametrize("make", SCENES.values(), ids=SCENES.keys())
formulations = pytest.mark.parametrize("formulation", FORMULATIONS)


def assembled(definition):
    scene = build(definition)
    scene.assemble()
    return scene


# t_eval


@scenes
@formulations
def test_t_eval_changes_no_step(make, formulation, rng):
    plain = run(make(), (0.0, 1.7), formulation=formulation)
    dense = rng.uniform(0.0, 1.7, 300)
    for times in (
        np.sort(dense),
        np.linspace(0.0, 1.7, 7),
        [1.7],
        [0.0],
        [1e-9],
        plain.t,
        np.nextafter(plain.t[1:], 0),
    ):
        other = run(make(), (0.0, 1.7), formulation=formulation, t_eval=times)
        np.testing.assert_array_equal(other.t, times)
        same_history(plain, other)


@scenes
@formulations
def test_outputs_at_steps_are_the_steps(make, formulation):
    plain = run(make(), (0.0, 1.0), formulation=formulation)
    same(plain, run(make(), (0.0, 1.0), formulation=formulation, t_eval=plain.t))
    same(run(make(), (0.0, 1.0), formulation=formulation, t_eval=plain.t[3::5]), rows(plain, slice(3, None, 5)))


def rows(solution, which):
    return type("Rows", (), {name: getattr(solution, name)[which] for name in ARRAYS})


@scenes
def test_outputs_come_from_the_manifold(make, rng):
    """Between steps all three levels hold as they do on the steps."""
    solution = run(make(), (0.0, 1.0), t_eval=np.sort(rng.uniform(0.0, 1.0, 200)), constraint_tol=EPS)
    error = solution.constraint_error
    assert (error.position <= 50 * EPS * (1 + np.abs(solution.q).max(axis=1))).all()
    assert (error.velocity <= 500 * EPS * (1 + np.abs(solution.qd).max(axis=1))).all()
    assert (error.acceleration <= 5000 * EPS * (1 + np.abs(solution.qdd).max(axis=1))).all()


@pytest.mark.parametrize("name", ["sliding_top", "two_body_pendulum", "two_body_pendulum_spatial"])
@pytest.mark.parametrize("formulation", ["tangent", "maggi-kane"])
def test_dense_values_are_of_order_four(name, formulation):
    """At the references' times, none of which is the end of a step but the last."""
    scene, reference = load(name)
    easy = (name, formulation) == ("sliding_top", "maggi-kane")  # its errors meet rounding, and B_tol, sooner
    steps = (0.0122 if easy else 0.0061) / 2 ** np.arange(5)
    worst = []
    for step in steps:
        solution = run(scene, (0.0, 10.0), step, t_eval=reference.t, formulation=formulation)
        assert not np.isin(reference.t[1:-1], solution.steps.t).any()
        v = np.stack([solution.velocity(body) for body in scene.bodies], axis=1) - reference.v
        w = np.stack([solution.angular_velocity(body) for body in scene.bodies], axis=1) - reference.w_body
        worst.append([error(solution, reference), np.abs(v).max(), np.abs(w).max()])
    for column in np.transpose(worst):
        assert np.polyfit(np.log(steps), np.log(column), 1)[0] > 3.85


@pytest.mark.parametrize(("formulation", "order"), [("tangent", 4.85), ("maggi-kane", 3.85)])
def test_error_within_one_step(formulation, order):
    """Interpolation alone: all along a first step of h, against a run with steps a hundred times as small."""
    worst, steps = [], 0.01 / 2 ** np.arange(4)
    for step in steps:
        scene, _ = load("two_body_pendulum_spatial")
        times = np.linspace(0.0, step, 23)
        coarse = run(scene, (0.0, step), step, t_eval=times, formulation=formulation)
        fine = run(scene, (0.0, step), step / 110, t_eval=times)
        assert coarse.stats.steps == 1
        worst.append(np.abs(coarse.q - fine.q).max())
    assert np.polyfit(np.log(steps), np.log(worst), 1)[0] > order


@pytest.mark.parametrize(
    "times",
    [[], [[0.0]], [0.5, 0.5], [0.5, 0.2], [-0.1], [1.1], [np.nan], [np.inf], "soon", [0.0, None], 0.5],
    ids=str,
)
def test_impossible_times_are_refused(times):
    scene, _ = load("sliding_top")
    with pytest.raises(ts.InvalidArgument, match="t_eval"):
        ts.simulate(scene, (0.0, 1.0), t_eval=times)


# histories


@scenes
@formulations
@pytest.mark.parametrize("span", [(0.0, 1.0), (0.0, 1.001), (-0.3, 0.61), (0.0, 1e-4)])
def test_history_of_steps_and_charts(make, formulation, span):
    if span[0] and make is SCENES["driven"]:
        pytest.skip("this scene is consistent at t = 0")
    solution = run(make(), span, formulation=formulation)
    stats, (t, h, accepted), charts = solution.stats, solution.steps, solution.charts
    assert stats.steps == accepted.sum() == len(solution.t) - 1 == np.ceil((span[1] - span[0]) / STEP * (1 - 1e-12))
    assert stats.rejected == (~accepted).sum() == 0
    np.testing.assert_array_equal(solution.t[:-1], t)
    assert (solution.t[0], solution.t[-1]) == span
    np.testing.assert_allclose(h, np.diff(solution.t), rtol=0, atol=0)
    np.testing.assert_allclose(h[:-1], STEP, rtol=1e-12)
    assert 0 < h[-1] <= STEP * (1 + 1e-9)
    assert stats.charts == len(charts.t) == len(charts.reason)
    assert charts.steps.sum() == stats.steps
    assert charts.reason[0] == "start"
    assert charts.t[0] == span[0]
    np.testing.assert_array_equal(charts.t, solution.t[np.concatenate(([0], np.cumsum(charts.steps[:-1])))])
    assert all(charts.reason)
    assert (charts.condition >= 1.0).all()
    assert (charts.contraction >= 0.0).all()
    assert stats.evaluations == 4 * stats.steps + 1  # Nystrom4, and its first-order equivalent
    assert stats.placements >= 3 * stats.steps + 1
    solved = stats.newton_iterations + stats.solves_skipped
    assert solved >= (0 if formulation == "maggi-kane" else stats.placements)
    assert stats.factorizations > 0
    assert set(stats.seconds) == {"prepare", "run"}


@scenes
def test_dense_outputs_cost_one_evaluation_each(make):
    plain = run(make(), (0.0, 1.0))
    for count in (10, 100):
        times = plain.t[1 : count + 1] - STEP / 3
        other = run(make(), (0.0, 1.0), t_eval=times)
        assert other.stats.evaluations == plain.stats.evaluations + count


def test_forced_charts_are_where_they_are_asked_for():
    scene, _ = load("sliding_top")
    solution = run(scene, (0.0, 1.0), chart_interval=8)
    assert set(solution.charts.reason) == {"start", "chart_interval"}
    np.testing.assert_array_equal(solution.charts.t, np.arange(0, 256, 8) * STEP)
    assert (solution.charts.steps == 8).all()


@pytest.mark.parametrize("most", [1, 100, 1023, 1024, 1025, 5000])
def test_max_steps_ends_the_run_and_keeps_what_was_done(most):
    """Also around the sizes of the slices in which a run comes back to Python."""
    scene, _ = load("sliding_top")
    span, step = (0.0, 10.0), 1e-3
    whole = run(scene, span, step)
    part = ts.simulate(scene, span, integrator=ts.integrators.Nystrom4(step), max_steps=most)
    assert part.status == ts.Status.MAX_STEPS
    assert not part.success
    with pytest.raises(ts.StepFailure, match="max_steps"):
        part.raise_if_failed()
    assert part.stats.steps == most
    same(part, rows(whole, slice(0, most + 1)))
    assert part.state.t == whole.t[most]


# going on


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
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(solution.state, name), getattr(solution, name)[-1])
    solution.state.q[:] = 0.0  # a copy: the solution is not at its mercy
    assert solution.state.q.any()


def test_a_state_made_by_hand_is_checked():
    scene, _ = load("sliding_top")
    solution = run(scene, (0.0, 0.5))
    lifted = solution.state._replace(q=solution.state.q + np.eye(7)[2] * 1e-3)
    with pytest.raises(ts.InconsistentState, match="PlaneContact"):
        run(scene, (0.5, 1.0), state=lifted)
    with pytest.raises(ts.InvalidArgument, match=r"state\.q"):
        run(scene, (0.5, 1.0), state=lifted._replace(q=lifted.q[:3]))


# a scene is a description: running it leaves it as it was


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


CHANGES = {
    "mass": 2.5,
    "inertia": (1.0, 1.2, 1.5),
    "velocity": (0.2, -0.1, 0.0),
    "angular_velocity": (0.1, 0.2, 8.0),
    "position": (1.0, 2.0, 1.0),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_changed_body_changes_the_next_run(what):
    """As if the scene had been built so; and back again."""
    scene, _ = load("sliding_top")
    (body,) = scene.bodies
    original = getattr(body, what)
    before = run(scene, (0.0, 0.5))
    setattr(body, what, CHANGES[what])
    changed = run(scene, (0.0, 0.5))
    assert not np.array_equal(changed.q, before.q)
    fresh, _ = load("sliding_top")
    setattr(fresh.bodies[0], what, CHANGES[what])
    same(changed, run(fresh, (0.0, 0.5)))
    setattr(body, what, original)
    same(before, run(scene, (0.0, 0.5)))


def test_a_changed_gravity_changes_the_next_run():
    scene, _ = load("sliding_top")
    one = run(scene, (0.0, 0.5))
    scene.gravity = (0.0, 0.0, -1.6)
    assert not np.array_equal(one.q, run(scene, (0.0, 0.5)).q)


def test_a_constraint_added_later_counts():
    scene, _ = load("sliding_top")
    (body,) = scene.bodies
    free = run(scene, (0.0, 0.5))
    scene.add(ts.constraints.Spherical(body, scene.ground, point_a=(0, 0, -1), name="pin"))
    with pytest.raises(ts.RedundantConstraints, match="pin"):
        run(scene, (0.0, 0.5), redundancy="refuse")
    assert free.multipliers.shape[1] == 2


def test_a_result_outlives_a_change_of_its_scene():
    """What follows from a solution belongs to the scene as it was run."""
    scene, reference = load("two_body_pendulum_spatial")
    one, two = (run(scene, (0.0, 1.0), t_eval=reference.t[:2]) for _ in range(2))
    expected = {name: getattr(one, name).copy() for name in ("multipliers", "energy", "angular_momentum")}
    for body in scene.bodies:
        body.mass, body.inertia, body.position = 1.0, (1.0, 1.0, 1.0), (5.0, 5.0, 5.0)
    scene.gravity = (1.0, 0.0, 0.0)
    for name, value in expected.items():
        np.testing.assert_array_equal(getattr(two, name), value, err_msg=name)
    np.testing.assert_array_equal(one.reaction(scene.constraints[0]), two.reaction(scene.constraints[0]))
    assert two.constraint_error.acceleration.max() < 1e-10


# threads


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
        np.testing.assert_allclose(np.imag(rotation(p + 1e-40j * pd)) / 1e-40, A_d, atol=1e-12)
        at += 4
    assert at == solution.q.shape[1]


def skew(a):
    x, y, z = np.moveaxis(a, -1, 0)
    zero = np.zeros_like(x)
    return np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), (0, 1), (-2, -1))
