"""What every run that ends early has to hand back."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import HELD

C = ts.constraints
Status = ts.Status
FORMS = ["tangent", "maggi-kane"]
LOST = {Status.NEWTON_FAILED, Status.CHART_LOST, Status.SINGULAR}  # of a step that cannot be made


def zero(t):
    return 0.0


def run(scene, end, step, **arguments):
    return ts.simulate(scene, (0.0, end), integrator=ts.integrators.Nystrom4(step=step), **arguments)


def check_partial(solution, statuses, begin=0.0):
    """Everything that a solution of a run that ended early has to be."""
    assert not solution.success, solution
    assert solution.status in statuses, solution.message
    reached = solution.state.t
    assert f"t = {reached:.9g} s" in solution.message
    assert solution.status.sentence in solution.message
    assert solution.status.remedy
    assert solution.status.remedy in solution.message or Status.SINGULAR.remedy in solution.message
    with pytest.raises(ts.StepFailure) as caught:
        solution.raise_if_failed()
    assert caught.value.solution is solution
    assert str(caught.value) == solution.message

    k, n = solution.t.size, solution.scene.start[0].size
    m = sum(constraint.rows for constraint in solution.scene.constraints)
    assert solution.q.shape == solution.qd.shape == solution.qdd.shape == (k, n)
    assert solution.multipliers.shape == (k, m)
    assert solution.energy.shape == (k,)
    assert solution.angular_momentum.shape == (k, 3)
    for constraint in solution.scene.constraints:
        force, torque = solution.reaction(constraint)
        assert force.shape == torque.shape == (k, 3)
    for name in ("t", "q", "qd", "qdd", "multipliers", "energy"):
        assert np.isfinite(getattr(solution, name)).all(), name
    for name, part in solution.state._asdict().items():
        assert np.isfinite(part).all(), f"state.{name}"
    assert (np.diff(solution.t) > 0.0).all()
    assert (solution.t >= begin).all()
    assert (solution.t <= reached).all()
    for part in solution.constraint_error:
        assert part.shape == (k,)
    if solution.formulation != "maggi-kane":
        assert solution.constraint_error.position.max(initial=0.0) < HELD
    steps = solution.steps
    assert steps.t.shape == steps.h.shape == steps.accepted.shape
    assert steps.accepted.sum() == solution.stats.steps
    assert (~steps.accepted).sum() == solution.stats.rejected
    return solution


def check_every_step(solution, begin=0.0):
    """Of a run without t_eval: the start and the end of every accepted step, the last of which is the state."""
    assert solution.t.size == solution.stats.steps + 1
    assert solution.t[0] == begin
    assert solution.t[-1] == solution.state.t
    for i, name in enumerate(("q", "qd", "qdd")):
        np.testing.assert_array_equal(getattr(solution, name)[-1], solution.state[1 + i])


def check_outputs(solution, times):
    """Of a run with t_eval: all the times that it asks for up to the end, and no other."""
    np.testing.assert_array_equal(solution.t, times[times <= solution.state.t])


def pendulum(spin=0.0):
    """A rod on a pivot, level; spin turns it about its own axis."""
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1.0, 1.0, 1.0), (1.0, 0.0, 0.0), angular_velocity=(spin, 0.0, 0.0), name="rod")
    scene.add(C.Spherical(rod, scene.ground, point_a=(-1.0, 0.0, 0.0), name="pivot"))
    return scene
