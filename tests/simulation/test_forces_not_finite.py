"""A force that gives nan is named, at the start of a run and where the run ends; what was computed is kept."""

import numpy as np
import pytest

import tsdyn as ts


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
