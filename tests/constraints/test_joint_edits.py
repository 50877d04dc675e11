"""Joints that are set later or copied, and starts on a mirrored branch."""

import copy
import pickle

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.joints import X, Y, Z, build, made, residuals
from tests.helpers.tolerances import EPS


def test_what_is_set_on_a_joint_reaches_its_rows():
    scene, rod, arm = build()
    hinge = scene.add(made("Revolute", rod, arm, name="hinge"))
    assert np.abs(residuals(scene)).max() == 0.0
    hinge.point_b = (-1.0, 0.0, 0.5)
    np.testing.assert_array_equal(residuals(scene)[:3], (0, 0, -0.5))
    hinge.axis_b = (0, 2, 0)
    assert np.abs(residuals(scene)[3:5]).max() == 1.0
    with pytest.raises(ts.InvalidConstraint, match=r"hinge: axis_b has length zero"):
        hinge.axis_b = (0, 0, 0)
    with pytest.raises(ts.UnknownAttribute, match="did you mean"):
        hinge.axsi_a = X
    with pytest.raises(ts.InvalidConstraint, match=r"Revolute 'hinge' axis\[0\].*set axis_b there"):
        hinge.parts[1].axis_b = X
    cone = scene.add(made("ConstantAngle", rod, arm))
    cone.angle = 1.0
    assert residuals(scene)[5] == pytest.approx(-np.cos(1.0))
    with pytest.raises(ts.InvalidConstraint, match="angle"):
        cone.angle = 0.0
    assert cone.angle == 1.0
    slide = scene.add(made("Translational", rod, arm))
    with pytest.raises(ts.InvalidConstraint, match="reference_a is parallel"):
        slide.reference_a = slide.axis_a


def test_a_solution_keeps_the_joint_it_was_run_with():
    scene, rod, arm = build()
    hinge = scene.add(made("Revolute", scene.ground, rod))
    scene.add(made("Universal", rod, arm))
    solution, expected = (ts.simulate(scene, (0.0, 0.1)) for _ in range(2))
    before = expected.reaction(hinge)
    hinge.point_b = hinge.point_a = (5.0, 0.0, 0.0)
    np.testing.assert_array_equal(solution.reaction(hinge), before)
    for twin in (pickle.loads(pickle.dumps(solution)), copy.deepcopy(solution)):
        again = twin.scene.constraints[0]
        np.testing.assert_array_equal(twin.reaction(again), before)
        np.testing.assert_array_equal(twin.q, solution.q)


def test_scenes_with_joints_survive_copies():
    scene, rod, arm = build()
    scene.add(made("Revolute", scene.ground, rod))
    scene.add(made("Translational", rod, arm, name="slide"))
    end = ts.simulate(scene, (0.0, 0.1)).q[-1]
    for twin in (pickle.loads(pickle.dumps(scene)), copy.deepcopy(scene)):
        np.testing.assert_array_equal(ts.simulate(twin, (0.0, 0.1)).q[-1], end)
        assert twin.row_names() == scene.row_names()
        twin.constraints[1].point_a = (0, 0, 9)
        assert np.abs(residuals(twin)).max() > 1.0
    assert np.abs(residuals(scene)).max() < EPS


MIRRORED = {
    "Revolute": ("Revolute", Y),
    "Cylindrical": ("Cylindrical", Y),
    "Parallel": ("Parallel", Y),
    "Planar": ("Planar", Y),
    "Translational, axis turned over": ("Translational", Y),
    "Translational, half a turn about the axis": ("Translational", X),
    "Fixed, half a turn about x": ("Fixed", X),
    "Fixed, half a turn about y": ("Fixed", Y),
    "Fixed, half a turn about z": ("Fixed", Z),
}


@pytest.mark.parametrize(("kind", "axis"), MIRRORED.values(), ids=MIRRORED)
def test_a_mirrored_start_is_refused(kind, axis):
    """Half a turn of b about the joint's point meets every row, and is another joint."""
    scene, rod, arm = build()
    scene.add(made(kind, rod, arm, name="mine"))
    ts.simulate(scene, (0.0, 0.01))
    turn = Rotation.from_rotvec(np.pi * axis)
    arm.orientation, arm.position = turn, np.add((2, 0, 0), turn.apply((1, 0, 0)))
    assert np.abs(residuals(scene)).max() < 4 * EPS
    for call in (lambda: ts.simulate(scene, (0.0, 0.01)), scene.assemble):
        with pytest.raises(ts.InconsistentState, match=f"{kind} 'mine'.*opposite ways.*other sign"):
            call()
    np.testing.assert_array_equal(arm.position, np.add((2, 0, 0), turn.apply((1, 0, 0))))


@pytest.mark.parametrize("kind", ["Universal", "PointOnLine", "ConstantAngle"])
def test_joints_that_have_no_mirrored_branch_start_anywhere(kind):
    scene, rod, arm = build()
    scene.add(made(kind, rod, arm))
    turn = Rotation.from_rotvec(np.pi * X)
    arm.orientation, arm.position = turn, np.add((2, 0, 0), turn.apply((1, 0, 0)))
    ts.simulate(scene, (0.0, 0.01)).raise_if_failed()


def test_a_state_to_go_on_from_is_checked_too():
    scene, rod, arm = build()
    scene.add(made("Revolute", rod, arm, name="hinge"))
    state = ts.simulate(scene, (0.0, 0.1)).state
    q = state.q.copy()
    q[7:10], q[10:] = (1.0, 0.0, 0.0), (0, 0, 1, 0)
    with pytest.raises(ts.InconsistentState, match="'hinge'"):
        ts.simulate(scene, (0.0, 1.0), state=state._replace(q=q, qd=np.zeros(14)))
