"""`state.reaction` of one instant is `solution.reaction` there."""

import pickle

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import HELD, NEAR

GRAVITY, LENGTH, MASS = 10.0, 2.0, 3.0


def swinging():
    """A point mass on a rod, from the horizontal: the tension is 3 m g cos(angle from below); and a damper beside."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    bob = scene.add_point_mass(MASS, position=(LENGTH, 0.0, 0.0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, length=LENGTH, name="rod"))
    scene.add(ts.forces.Spring(bob, scene.ground, point_b=(0, 0, 1), stiffness=1e-3, free_length=0.0, name="spring"))
    return scene


def test_events_of_a_reaction():
    """The vertical force of the rod is 3 m g cos^2: 1.5 m g at 45 degrees."""

    def half(t, state):
        force, torque = state.reaction("rod")
        assert force.shape == torque.shape == (3,)
        np.testing.assert_array_equal(state.reaction("rod", on="bob")[0], force)
        return force[2] - 1.5 * MASS * GRAVITY

    scene = swinging()
    scene["spring"].stiffness = 1e-12
    solution = ts.simulate(scene, (0.0, 1.0), integrator=ts.integrators.Taylor(), events=half)
    (first, *_), (place, *_) = solution.t_events[0], solution.q_events[0]
    assert first > 0.0
    np.testing.assert_allclose(place, [LENGTH * 0.5**0.5, 0.0, -LENGTH * 0.5**0.5], rtol=0, atol=NEAR)


def test_states_of_a_solution():
    solution = ts.simulate(swinging(), (0.0, 1.0), dense_output=True)
    some = solution.at(solution.t)
    for item in ("rod", "spring"):
        for i, whole in enumerate(solution.reaction(item)):
            size = np.abs(whole).max() + 1.0
            np.testing.assert_allclose(some.reaction(item)[i], whole, rtol=0, atol=HELD * size)
            for k in (3, -1):
                one = solution.at(float(solution.t[k]))
                np.testing.assert_allclose(one.reaction(item)[i], whole[k], rtol=0, atol=HELD * size)
            for state in (solution.state, pickle.loads(pickle.dumps(solution.state)), solution.state._replace(t=0.0)):
                np.testing.assert_allclose(state.reaction(item)[i], whole[-1], rtol=0, atol=HELD * size)


@pytest.mark.slow
def test_reactions_with_joint_friction():
    """Normal loads of friction are found from the reactions of the instant."""
    scene = ts.Scene()
    arm = scene.add_body(1.0, (0.1, 0.2, 0.3), (0.5, 0, 0), name="arm")
    hinge = scene.add(ts.constraints.Revolute.at(arm, scene.ground, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    scene.add(ts.forces.RevoluteFriction(hinge, kinetic=0.2, radius=0.05, name="rub"))
    solution = ts.simulate(scene, (0.0, 0.5), integrator="dop853")
    for item in ("hinge", "rub"):
        for one, whole in zip(solution.state.reaction(item), solution.reaction(item), strict=True):
            np.testing.assert_allclose(one, whole[-1], rtol=0, atol=HELD * 100.0)


def test_wrong_arguments():
    scene = swinging()
    state = ts.simulate(scene, (0.0, 0.1)).state
    with pytest.raises(ts.InvalidConstraint, match="did you mean 'rod'"):
        state.reaction("rods")
    with pytest.raises(ts.InvalidConstraint, match="not a constraint or force"):
        state.reaction(state)
    with pytest.raises(ts.InvalidBody, match="on the ground"):
        state.reaction("rod", on=scene.ground)
    with pytest.raises(ts.InvalidArgument, match="knows no bodies"):
        ts.State(0.0, *np.zeros((3, 3)), np.zeros(1)).reaction("rod")


def test_states_of_runs_and_events_are_shown_as_states():
    scene = ts.Scene(gravity=(0, 0, -10))
    bob = scene.add_point_mass(mass=2.0, position=(0, 0, -1), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    seen = []

    def half(t, state):
        return t - 0.5

    half.action = lambda change: seen.append(repr(change.state))
    solution = ts.simulate(scene, (0, 1.0), events=half)
    assert seen[0].startswith("State(t=0.5, q=array([")
    assert "multipliers=array([" in seen[0]
    assert repr(solution.state).startswith("State(t=1.0, q=array([")
