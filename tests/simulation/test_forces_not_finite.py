"""A force that gives nan is named, at the start of a run and where the run ends; what was computed is kept."""

import numpy as np
import pytest

import tsdyn as ts
from tsdyn.motions.signals import Signal


def pushed(force):
    scene = ts.Scene(gravity=(0, 0, -10))
    bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    scene.add(ts.forces.Spring(bob, scene.ground, stiffness=10.0, name="spring"))
    scene.add(ts.forces.PointForce(bob, force=force, name="wind"))
    return scene


def test_at_the_start():
    with pytest.raises(ts.InconsistentState, match=r"'wind' is inf or nan at t = 0 s\."):
        ts.simulate(pushed(lambda t, state: (np.log(-1.0 - t), 0.0, 0.0)), (0, 1))


@pytest.mark.parametrize("method", [None, "dop853", ts.integrators.Nystrom4(step=1e-2)], ids=str)
def test_where_the_run_ends(method):
    solution = ts.simulate(pushed(lambda t, state: (np.sqrt(0.5 - t), 0.0, 0.0)), (0, 1), integrator=method)
    assert not solution.success
    assert solution.t[-1] == pytest.approx(0.5, abs=0.02)
    assert np.isfinite(solution.q).all()
    assert "'wind' is inf or nan at t = 0.5" in solution.message
    assert "spring" not in solution.message


def late(t):
    if t > 0.3:
        raise ValueError("too late")
    return (1.0, 0.0, 0.0)


def late_by_state(t, state):
    if t > 0.3:
        raise ValueError("too late")
    return (state[0], 0.0, 0.0)


def late_by_both(t, a, b, par, out):
    if t > 0.3:
        raise ValueError("too late")
    out[0] = par[0] * (a[0] - b[0])


def late_by_joint(t, coordinate, rate):
    if t > 0.3:
        raise ValueError("too late")
    return coordinate + rate


def pushed_joint(kind):
    scene = ts.Scene(gravity=(0, 0, -10))
    body = scene.add_body(1.0, (1, 1, 1), (1.0, 0, 0), name="body")
    if kind == "force":
        slide = scene.add(ts.constraints.Translational.at(scene.ground, body, point=(0, 0, 0), axis=(1, 0, 0)))
        scene.add(ts.forces.JointForce(slide, function=late_by_joint, name="wind"))
    else:
        pin = scene.add(ts.constraints.Revolute.at(scene.ground, body, point=(0, 0, 0), axis=(0, 1, 0)))
        scene.add(ts.forces.JointTorque(pin, function=late_by_joint, name="wind"))
    return scene


def pushed_by_both():
    scene = pushed(lambda t, state: (1.0, 0.0, 0.0))
    scene.remove("wind")
    bob = scene.bodies[0]
    scene.add(ts.forces.UserForce(bob, function=late_by_both, parameters=(2.0,), name="wind"))
    return scene


MADE = {
    "of time": lambda: pushed(late),
    "of state": lambda: pushed(late_by_state),
    "of two states": pushed_by_both,
    "of an angle": lambda: pushed_joint("torque"),
    "of a displacement": lambda: pushed_joint("force"),
}


@pytest.mark.slow_for("of two states", "of a displacement", "of an angle")
@pytest.mark.parametrize("made", MADE)
def test_exceptions_of_functions_are_told(made):
    solution = ts.simulate(MADE[made](), (0, 1))
    assert "The function of 'wind' raises ValueError: too late, at t = 0." in solution.message
    with pytest.raises(ts.StepFailure, match="ValueError: too late") as caught:
        solution.raise_if_failed()
    assert isinstance(caught.value.__cause__, ValueError)
    assert np.isfinite(solution.q).all()


def test_samples_of_a_function_that_raises_are_not_numbers():
    """All three of them: what is left of other arrays in memory is no load."""
    for _ in range(20):
        junk = np.full((2049, 3), 1e300)
        del junk
        found = Signal(late, 3, "force", ts.InvalidForce).sampled(np.linspace(0.0, 1.0, 2049))
        assert all(np.isnan(each[-1]) for each in found)


def quotient(t, state):
    return (1.0 / (state[0] - 1.0), 0.0, 0.0)


def entry(t, state):
    values = np.array([1.0, 2.0])
    return (values[2 + int(t)], 0.0, 0.0)


@pytest.mark.slow_for("entry*")
@pytest.mark.parametrize(("function", "kind"), [(quotient, ZeroDivisionError), (entry, IndexError)])
def test_exceptions_at_the_start_are_told(function, kind):
    """A division by zero is an exception, as it is with Python's own numbers."""
    with pytest.raises(ts.InconsistentState, match=f"'wind' raises {kind.__name__}: .*, at t = 0 s") as caught:
        ts.simulate(pushed(function), (0, 1))
    assert isinstance(caught.value.__cause__, kind)


@pytest.mark.slow
def test_points_and_rates_are_those_of_kernels():
    """The function is called once more with the point, Euler parameters, velocity and angular velocity there."""

    def watch(t, state):
        if state[4] ** 2 > 0.01:
            raise ValueError(state[2], state[7:])
        return (0.0, 0.0, 1.0)

    scene = ts.Scene(gravity=(0, 0, 0))
    spun = scene.add_body(1.0, (1, 1, 1), angular_velocity=(2.0, 0, 0), velocity=(0.5, 0, 0), name="body")
    scene.add(ts.forces.PointForce(spun, force=watch, point_a=(0, 1.0, 0), name="wind"))
    solution = ts.simulate(scene, (0, 1))
    assert solution.status == ts.Status.NOT_FINITE
    with pytest.raises(ts.StepFailure) as caught:
        solution.raise_if_failed()
    z, rates = caught.value.__cause__.args
    body = solution.state
    np.testing.assert_allclose(z, body.position(spun, (0, 1.0, 0))[2], atol=0.05)
    np.testing.assert_allclose(rates[:3], body.velocity(spun, (0, 1.0, 0)), atol=0.05)
    np.testing.assert_allclose(rates[3:], body.rotation(spun) @ body.angular_velocity(spun), atol=0.05)
