"""Friction of joints where it is not unique, jams, is a plug-in, or is given wrongly."""

import pickle

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.rough_joints import PRECISE, BallFriction, demand_balance, four_bar, pendulum, rod
from tests.helpers.tolerances import CLOSE, ROUGH

C, F = ts.constraints, ts.forces


@pytest.mark.slow
def test_friction_from_a_reaction_that_is_not_unique_is_refused():
    scene, _ = four_bar(rough_at=(1,), length=0.1)
    with pytest.raises(ts.RedundantConstraints, match=r"RevoluteFriction\(pin1\).*not unique"):
        ts.simulate(scene, (0.0, 1.0))


@pytest.mark.slow
def test_a_mechanism_that_jams_says_so():
    """Above mu = (1 + 3 c^2) / (3 s c), 4 / 3 at 1.1 rad, no reaction is in balance with its friction."""
    assert ts.simulate(rod(1.1, 1.3), (0.0, 0.01), **PRECISE).success
    for method in ("taylor", "dop853"):
        with pytest.raises(ts.InconsistentState, match="mechanism may jam"):
            ts.simulate(rod(1.1, 1.4), (0.0, 0.01), integrator=method)
    with pytest.raises(ts.SingularConfiguration, match="mechanism may jam"):
        rod(1.1, 1.4).evaluate()


class SuddenFriction(F.ContactFriction):
    """Twice as much from one moment on."""

    @staticmethod
    def law(x, xd, par, t, out):
        more = 1.0 if t < 0.004 else 2.0
        f = -par[-1] * more * par[0] / np.sqrt(xd[0] * xd[0] + par[3] * par[3])
        out[0], out[6] = f * xd[0], -f * xd[0]


@pytest.mark.slow
def test_jamming_on_the_way_ends_the_run():
    scene = rod(1.1, 1.0, SuddenFriction)
    solution = ts.simulate(scene, (0.0, 1.0), **PRECISE)
    assert not solution.success
    assert solution.status == ts.Status.JAMMED
    assert solution.reached == pytest.approx(0.004, abs=ROUGH)
    assert "consistent with the friction" in solution.message
    for numbers in (solution.q, solution.qd, solution.qdd, solution.multipliers):
        assert np.isfinite(numbers).all()
        assert len(numbers) > 3


@pytest.mark.slow
def test_a_plug_in():
    ts.testing.check_force(BallFriction)
    scene = ts.Scene()
    body = scene.add_body(1.0, (0.1, 0.1, 0.1), position=(0.5, 0, 0), angular_velocity=(1, 2, 3))
    body.velocity = np.cross((1, 2, 3), (0.5, 0, 0))
    ball = scene.add(C.Spherical(body, scene.ground, point_a=(-0.5, 0, 0)))
    friction = scene.add(BallFriction(ball, radius=0.05, kinetic=0.2, slip_velocity=0.01))
    ends = [ts.simulate(scene, (0, 0.5), formulation=form, **PRECISE) for form in ("tangent", "null-space")]
    np.testing.assert_allclose(ends[0].q[-1], ends[1].q[-1], atol=CLOSE)
    assert (ends[0].dissipation > 0).all()
    demand_balance(scene, ends[0], (ball, friction))


@pytest.mark.slow
def test_attributes_can_be_set_and_geometry_is_the_joints():
    scene, _bar, pin, friction = pendulum()
    before = ts.simulate(scene, (0.0, 0.5), **PRECISE).q[-1]
    friction.static = None
    friction.kinetic = 0.0005
    smooth = ts.simulate(scene, (0.0, 0.5), **PRECISE).q[-1]
    assert np.abs(before - smooth).max() > 1e-3
    friction.kinetic, friction.static = 0.3, 0.4
    np.testing.assert_array_equal(ts.simulate(scene, (0.0, 0.5), **PRECISE).q[-1], before)
    np.testing.assert_array_equal(friction.axis_a, pin.axis_a)
    with pytest.raises(ts.InvalidForce, match="axis_a is that of its joint"):
        friction.axis_a = (1, 0, 0)
    with pytest.raises(ts.UnknownAttribute, match="radius"):
        friction.radus = 1.0


@pytest.mark.slow
def test_solutions_are_pickled():
    scene, _, _pin, _friction = pendulum()
    solution = ts.simulate(scene, (0.0, 0.5), **PRECISE)
    again = pickle.loads(pickle.dumps(solution))
    np.testing.assert_array_equal(again.multipliers, solution.multipliers)
    np.testing.assert_array_equal(again.dissipation, solution.dissipation)


def test_wrong_arguments():
    scene, bar, pin, _ = pendulum()
    other = ts.Scene()
    loose = C.Revolute(bar, scene.ground, axis_a=(0, 1, 0), axis_b=(0, 1, 0), name="loose")
    cases = [
        (lambda: F.RevoluteFriction(loose, radius=0.1, kinetic=0.1), "add its joint 'loose' to the scene first"),
        (lambda: F.RevoluteFriction(bar, radius=0.1, kinetic=0.1), "joint must be a Revolute"),
        (lambda: F.TranslationalFriction(pin, kinetic=0.1), "joint must be a Translational"),
        (lambda: F.ContactFriction(pin, kinetic=0.1), "joint must be a PlaneContact"),
        (lambda: F.RevoluteFriction(pin, radius=0.0, kinetic=0.1), "radius must be a positive"),
        (lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=-0.1), "kinetic must be a finite number"),
        (lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=np.nan), "kinetic must be a finite number"),
        (lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=0.0), "zero at all times"),
        (lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=0.3, static=0.2), "static must be at least kinetic"),
        (
            lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=0.3, slip_velocity=-1.0),
            "slip_velocity must be a finite number",
        ),
        (lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=0.3, length=-1.0), "length must be a positive"),
        (lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=0.3, preload="much"), "preload must be a finite number"),
    ]
    for make, message in cases:
        with pytest.raises(ts.InvalidForce, match=message):
            make()
    with pytest.raises(TypeError, match=r"RevoluteFriction\(\) has no argument slip. It has .*slip_velocity"):
        F.RevoluteFriction(pin, radius=0.1, kinetic=0.1, slip=0.1)
    friction = F.RevoluteFriction(pin, radius=0.1, kinetic=0.1)
    with pytest.raises(ts.InvalidForce, match="another scene"):
        other.add(friction)
    scene.add(friction)
    with pytest.raises(ts.InvalidForce, match="static must be at least"):
        friction.static = 0.01
    assert friction.static is None
