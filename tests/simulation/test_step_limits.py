"""What is said where steps are short: `max_step` and `first_step` that are given too short, rounding of the forces."""

import re
import warnings

import pytest

import tsdyn as ts

I = ts.integrators
ADAPTIVE = (None, "dop853", "rk45", "taylor")


def sprung(stiffness, stretch):
    """A mass on a spring of 1 m."""
    scene = ts.Scene(gravity=(0, 0, -9.81))
    bob = scene.add_point_mass(1.0, (0, 0, -1.0 - stretch), name="bob")
    scene.add(ts.forces.Spring(scene.ground, bob, stiffness=stiffness, free_length=1.0))
    return scene


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("span", [(0, 1), (1e6, 1e6 + 1)])
def test_max_step_below_the_rounding_of_the_time_is_refused(method, span):
    with pytest.raises(ts.InvalidArgument, match=r"max_step=1e-30 s is too small for the interval"):
        ts.simulate(sprung(10.0, 0.1), span, integrator=method, max_step=1e-30)


@pytest.mark.parametrize("kind", [I.DOP853, I.RK45, I.Taylor])
def test_first_step_below_the_rounding_of_the_time_is_refused(kind):
    scene = sprung(10.0, 0.1)
    with pytest.raises(ts.InvalidArgument, match=r"first_step=1e-25 s is too small for the interval"):
        ts.simulate(scene, (0, 1), integrator=kind(first_step=1e-25))
    assert ts.simulate(scene, (0, 1), integrator=kind(first_step=1e-17)).success
    with pytest.raises(ts.InvalidArgument, match="first_step=1e-17"):
        ts.simulate(scene, (1, 2), integrator=kind(first_step=1e-17))


@pytest.mark.parametrize("method", ADAPTIVE)
def test_short_max_step_is_blamed_and_no_tolerance(method):
    scene = sprung(10.0, 0.1)
    hopeless = ts.simulate(scene, (0, 1), integrator=method, max_step=1e-12)
    assert hopeless.status == ts.Status.STEP_COLLAPSED
    assert hopeless.message.startswith("The steps are as long as max_step=1e-12 s allows.")
    assert "loosen" not in hopeless.message
    short = ts.simulate(scene, (0, 1), integrator=method, max_step=1e-6, max_steps=50)
    assert short.message.endswith("Raise max_steps, or give a longer max_step.")


@pytest.mark.parametrize("method", ["dop853", "rk45"])
def test_tolerances_below_the_rounding_of_the_forces(method):
    scene = sprung(1e9, 1e-6)
    run = ts.simulate(scene, (0, 1), integrator=method, rtol=1e-14, atol=1e-14, max_steps=2000)
    assert run.status == ts.Status.MAX_STEPS
    assert "The tolerances are below what rounding of the forces allows" in run.message
    assert "the acceleration of bob" in run.message
    assert "max_steps, or" not in run.message
    loosened = [float(x) for x in re.findall(r"[ra]tol=([\d.e-]+)[ ,]", run.message)]
    after = ts.simulate(scene, (0, 1), integrator=method, rtol=loosened[0], atol=loosened[1], max_steps=2000)
    assert "rounding of the forces" not in after.message
    assert after.reached > 10.0 * run.reached


def test_rounding_of_the_forces_is_told_after_an_interrupt():
    def stop(fraction):
        raise RuntimeError

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = ts.simulate(sprung(1e9, 1e-6), (0, 1), integrator="dop853", rtol=1e-14, atol=1e-14, progress=stop)
    assert run.status == ts.Status.INTERRUPTED
    assert "rounding of the forces allows" in run.message
    assert "Continue with" in run.message


@pytest.mark.parametrize(("stiffness", "tolerance"), [(10.0, 1e-14), (1e9, 1e-8)])
def test_other_runs_are_told_nothing_of_rounding(stiffness, tolerance):
    run = ts.simulate(
        sprung(stiffness, 1e-3), (0, 10), integrator="dop853", rtol=tolerance, atol=tolerance, max_steps=100
    )
    assert run.message.endswith("Raise max_steps, or loosen rtol and atol.")
