"""Linkages that run through singular configurations: on the smooth branch, or with an account of why not."""

import closed_loops
import numpy as np
import pytest
from closed_loops import angles

import tsdyn as ts

SHAPES = {
    "alone": {},
    "plane rows": {"planar": True},
    "equal links": {"base": 1.0},
    "a row of four": {"loops": 4},
    "without gravity": {"gravity": (0.0, 0.0, 0.0), "angle": 0.5},
    "from close by": {"angle": 0.02},
}


@pytest.mark.parametrize("tol", [1e-6, 1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_parallelogram_turns_over_and_over(shape, tol):
    scene = closed_loops.parallelogram(**SHAPES[shape])
    solution = ts.simulate(scene, (0.0, 10.0), rtol=tol, atol=tol, t_eval=np.linspace(0.0, 10.0, 301))
    assert solution.success, solution.message
    turned = angles(solution)
    assert turned[0][-1] - turned[0][0] > 16.0 * np.pi
    assert max(np.abs(other - turned[0]).max() for other in turned) < 1e-9  # a crank that turns back is another branch
    assert np.ptp(solution.energy) < max(1e-6, 100.0 * tol) * np.abs(solution.energy).max()
    assert solution.constraint_error.position.max() < 1e-13
    assert solution.constraint_error.acceleration.max() < 1e-5  # next to the flat place by the series: to the tolerance
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
    np.testing.assert_allclose(solution.acceleration(scene.body("crank 0"))[1], wanted, atol=1e-6)
    assert solution.constraint_error.position.max() < 1e-14


@pytest.mark.parametrize("planar", [False, True])
def test_a_start_where_branches_meet_is_refused(planar):
    scene = closed_loops.parallelogram(0.0, planar=planar)
    with pytest.raises(ts.SingularConfiguration, match=r"16 are independent here .* 2 directions are free .* Branches"):
        ts.simulate(scene, (0.0, 1.0))


def test_a_method_that_can_not_pass_says_who_can():
    solution = ts.simulate(closed_loops.parallelogram(planar=True), (0.0, 1.0), integrator="dop853")
    assert not solution.success
    assert "near to losing rank" in solution.message
    assert "Taylor" in solution.message
    assert np.isfinite(solution.q).all()
    assert solution.t[-1] == pytest.approx(0.3477, abs=1e-3)
