"""Runs that end early: `max_steps`, interrupts, bodies without inertia; what they hand back, and going on from it."""

import math
import warnings

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.failures import FORMS, Status, check_every_step, check_outputs, check_partial, pendulum, run
from tests.helpers.tolerances import CLOSE

C = ts.constraints


# axes without inertia


@pytest.mark.slow_for("ball-*")
@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("joint", [None, "ball"])
def test_free_axis_without_inertia_is_refused_whatever_the_pose(joint, formulation, rng):
    for _ in range(40):
        scene = ts.Scene()
        scene.add_body(2.0, (1.0, 1.0, 1.0), (9.0, 9.0, 9.0), name="bystander")
        p = rng.normal(size=4)
        rod = scene.add_body(
            1.0,
            (1.0, 1.0, 0.0),
            rng.normal(size=3),
            p / np.linalg.norm(p),
            angular_velocity=rng.normal(size=3),
            name="rod",
        )
        if joint:
            scene.add(C.Spherical(rod, scene.ground, point_a=(0.0, 0.0, -1.0), name="joint"))
            scene.assemble()
        with pytest.raises(ts.SingularConfiguration, match=r"rod.*inertia") as caught:
            run(scene, 1.0, 1e-2, formulation=formulation)
        assert "Give it inertia" in str(caught.value)


def held_rod(speed):
    """A rod without inertia about its length, which a Dot1 holds but for the instant at which it points along y."""
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1.0, 1.0, 0.0), angular_velocity=(speed, 0.0, 0.0), name="rod")
    scene.add(C.Dot1(rod, scene.ground, axis_a=(1, 0, 0), axis_b=(0, 1, 0), name="key"))
    return scene


@pytest.mark.parametrize("formulation", FORMS)
def test_axis_without_inertia_that_is_held(formulation):
    solution = run(held_rod(0.5), 1.0, 1e-2, formulation=formulation).raise_if_failed()
    np.testing.assert_allclose(solution.angular_velocity(solution.scene.bodies[0]), [[0.5, 0.0, 0.0]] * 101, atol=CLOSE)


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("steps", [100, 1000])
def test_axis_without_inertia_that_comes_free(steps, formulation):
    step = math.pi / 2 / steps
    solution = check_partial(run(held_rod(1.0), 3.0, step, formulation=formulation), {Status.MASS_SINGULAR})
    check_every_step(solution)
    assert solution.t[-1] == pytest.approx(math.pi / 2 - step)


# ends that are asked for


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("most", [1, 10, 99])
def test_max_steps(most, formulation):
    scene = pendulum()
    whole = run(scene, 1.0, 1e-2, formulation=formulation).raise_if_failed()
    solution = check_partial(run(scene, 1.0, 1e-2, formulation=formulation, max_steps=most), {Status.MAX_STEPS})
    check_every_step(solution)
    assert solution.stats.steps == most
    assert "max_steps" in solution.message
    for name in ("t", "q", "qd", "qdd"):
        np.testing.assert_array_equal(getattr(solution, name), getattr(whole, name)[: most + 1])
    assert run(scene, 1.0, 1e-2, formulation=formulation, max_steps=100).success


@pytest.mark.parametrize("times", [[0.0, 0.005, 0.06, 0.1, 0.100001], [0.0, 1.0], [0.5]], ids=str)
def test_max_steps_with_t_eval(times):
    times = np.array(times)
    solution = check_partial(run(pendulum(), 1.0, 1e-2, max_steps=10, t_eval=times), {Status.MAX_STEPS})
    assert solution.state.t == pytest.approx(0.1)
    check_outputs(solution, times)


@pytest.mark.parametrize("formulation", FORMS)
def test_a_run_goes_on_from_its_state(formulation):
    scene = pendulum()
    whole = run(scene, 1.0, 1e-3, formulation=formulation)
    half = run(scene, 1.0, 1e-3, formulation=formulation, max_steps=400)
    begin = half.state.t
    rest = ts.simulate(scene, (begin, 1.0), integrator=ts.integrators.Nystrom4(1e-3), state=half.state)
    np.testing.assert_allclose(rest.raise_if_failed().q[-1], whole.q[-1], atol=CLOSE)


class Interrupt:
    """A progress function that raises at its n-th call, and keeps what it was told."""

    def __init__(self, error, call):
        self.error, self.call, self.fractions = error, call, []

    def __call__(self, fraction):
        self.fractions.append(fraction)
        if len(self.fractions) == self.call:
            raise self.error


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("call", [1, 2, 3])
def test_interrupt(call, formulation):
    scene = pendulum()
    progress = Interrupt(KeyboardInterrupt(), call)
    solution = check_partial(run(scene, 20.0, 1e-3, formulation=formulation, progress=progress), {Status.INTERRUPTED})
    check_every_step(solution)
    assert len(progress.fractions) == call
    assert progress.fractions[-1] == pytest.approx(solution.t[-1] / 20.0)
    assert 0 < solution.stats.steps < 20000
    whole = run(scene, 20.0, 1e-3, formulation=formulation, max_steps=solution.stats.steps)
    np.testing.assert_array_equal(solution.q, whole.q)


def test_interrupt_after_the_last_step_is_too_late():
    solution = run(pendulum(), 0.5, 1e-3, progress=Interrupt(KeyboardInterrupt(), 1))
    assert solution.t[-1] == 0.5
    assert solution.success


def test_interrupt_with_t_eval():
    times = np.linspace(0.0, 20.0, 77)
    solution = run(pendulum(), 20.0, 1e-3, progress=Interrupt(KeyboardInterrupt(), 2), t_eval=times)
    check_outputs(check_partial(solution, {Status.INTERRUPTED}), times)


@pytest.mark.parametrize("error", [ZeroDivisionError("oops"), RuntimeError("window closed"), StopIteration()], ids=repr)
def test_progress_that_raises(error):
    """Hours of computing are not lost to a progress bar: the solution so far comes back, a warning shows the error."""
    with pytest.warns(RuntimeWarning, match=f"progress raised {type(error).__name__}") as shown:
        solution = run(pendulum(), 20.0, 1e-3, progress=Interrupt(error, 2))
    assert "raise self.error" in str(shown[0].message)  # the traceback, to the line
    check_every_step(check_partial(solution, {Status.INTERRUPTED}))
    assert type(error).__name__ in solution.message
    assert str(error) in solution.message


def test_progress_that_raises_where_warnings_are_errors():
    with warnings.catch_warnings(action="error"):
        solution = run(pendulum(), 20.0, 1e-3, progress=Interrupt(RuntimeError("window closed"), 2))
    assert "window closed" in check_partial(solution, {Status.INTERRUPTED}).message


def test_progress_reaches_the_end():
    progress = Interrupt(None, 0)
    run(pendulum(), 5.0, 1e-3, progress=progress).raise_if_failed()
    assert progress.fractions == sorted(progress.fractions)
    assert progress.fractions[-1] == 1.0


def test_success_is_no_failure():
    solution = run(pendulum(), 1.0, 1e-2)
    assert solution.raise_if_failed() is solution
    assert solution.status == Status.SUCCESS


def test_every_status_has_a_sentence_and_failures_a_remedy():
    for status in Status:
        assert status.sentence.endswith(".")
        assert bool(status.remedy) == (
            status not in (Status.SUCCESS, Status.EVENT, Status.SLICE_DONE, Status.PASSAGE, Status.STIFF)
        )


@pytest.mark.parametrize("count", [1, 2])
def test_message_counts_in_english(count):
    message = run(pendulum(), 1.0, 1e-2, max_steps=count).message
    assert ("1 step." in message) if count == 1 else ("2 steps." in message)


def test_failed_runs_leave_the_scene_alone_and_do_not_matter_to_the_next():
    scene = pendulum()
    before = [part.copy() for part in scene.start]
    good = run(scene, 1.0, 1e-2)
    for arguments in ({"max_steps": 3}, {"progress": Interrupt(KeyboardInterrupt(), 1)}):
        run(scene, 1.0, 1e-2, **arguments)
    run(scene, 5.0, 1.0)
    for part, now in zip(before, scene.start, strict=True):
        np.testing.assert_array_equal(part, now)
    np.testing.assert_array_equal(run(scene, 1.0, 1e-2).q, good.q)
