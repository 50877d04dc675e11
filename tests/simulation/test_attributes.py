"""What is set after construction is checked, takes effect, or is refused; scenes survive pickling."""

import copy
import pickle

import numpy as np
import pytest

import tsdyn as ts
from examples import top
from tests.helpers.tolerances import EXACT

C = ts.constraints
MOTION = (lambda t: 2.0 + 0.1 * t, lambda t: 0.1 + 0.0 * t, lambda t: 0.0 * t)


def build():
    scene = ts.Scene()
    bob = scene.add_body(1.0, (1.0, 1.0, 1.0), name="bob")
    return scene, bob


def test_a_point_that_is_set_moves():
    scene, bob = build()
    ball = scene.add(C.Spherical(scene.ground, bob, point_b=(0, 0, -1)))
    np.testing.assert_array_equal(scene.evaluate().Phi[:3], (0, 0, 1))
    ball.point_b = (5, 5, 5)
    np.testing.assert_array_equal(ball.point_b, (5, 5, 5))
    np.testing.assert_array_equal(scene.evaluate().Phi[:3], (-5, -5, -5))
    with pytest.raises(ts.InvalidConstraint, match="point_b"):
        ball.point_b = (1, 2)


def test_an_axis_that_is_set_is_normalised():
    scene, bob = build()
    row = scene.add(C.Dot1(scene.ground, bob, axis_a=(1, 0, 0), axis_b=(0, 1, 0)))
    row.axis_b = (2, 2, 0)
    assert scene.evaluate().Phi[0] == pytest.approx(np.sqrt(0.5), rel=EXACT)


def test_a_length_that_is_set_is_checked():
    scene, bob = build()
    rod = scene.add(C.Distance(scene.ground, bob, point_b=(0, 0, 2.0)))
    for wrong in (-1.0, 0.0, "x", float("nan")):
        with pytest.raises(ts.InvalidConstraint, match="length"):
            rod.length = wrong
    assert rod.length == 2.0
    rod.length = MOTION
    scene.evaluate(t=1.0)
    assert scene.evaluate(t=1.0).Phi_t[0] == pytest.approx(-2.1 * 0.1 / 2.0)
    row = scene.add(C.Dot1(scene.ground, bob, axis_a=(1, 0, 0), axis_b=(0, 1, 0)))
    with pytest.raises(ts.InvalidConstraint, match="cosine"):
        row.value = 5.0


@pytest.mark.parametrize("which", ["scene", "body", "constraint"])
def test_misspelt_attributes_are_refused(which):
    scene, bob = build()
    owner = {"scene": scene, "body": bob, "constraint": scene.add(C.Distance(scene.ground, bob, point_b=(0, 0, 1)))}[
        which
    ]
    name = {"scene": "gravty", "body": "positon", "constraint": "lenght"}[which]
    with pytest.raises(ts.UnknownAttribute, match="did you mean"):
        setattr(owner, name, 1.0)


def test_a_motion_needs_phi_t():
    class Forgot(C.Distance):
        phi_t = None

    scene, bob = build()
    with pytest.raises(ts.InvalidConstraint, match="phi_t"):
        scene.add(Forgot(scene.ground, bob, length=MOTION))


def test_scenes_and_solutions_survive_pickling_and_compile_nothing():
    from tsdyn.jit.cache import statistics

    solution = ts.simulate(top.build(), (0.0, 0.1))
    misses = statistics["misses"]
    for twin in (pickle.loads(pickle.dumps(solution)), copy.deepcopy(solution)):
        again = ts.simulate(twin.scene, (0.0, 0.1))
        np.testing.assert_array_equal(again.q, solution.q)
        np.testing.assert_array_equal(twin.multipliers, solution.multipliers)
        np.testing.assert_array_equal(twin.position(twin.scene.body("top")), solution.q[:, :3])
    assert statistics["misses"] == misses


def test_a_phi_that_is_not_analytic_is_called_so():
    class Norm(C.Distance):
        @staticmethod
        def phi(x, par, t, out):
            out[0] = abs(x[0] - x[3])

    with pytest.raises(ts.testing.CheckFailed, match="not analytic"):
        ts.testing.check_primitive(Norm)


def test_status_reads_as_a_word():
    assert f"{ts.Status.SUCCESS}" == str(ts.Status.SUCCESS) == "success"


def test_plots_are_there_when_asked_for():
    assert callable(ts.plots.constraint_error)
    with pytest.raises(AttributeError, match="nonsense"):
        ts.nonsense  # noqa: B018
