"""`scene.equilibrium(spin=)`: governors, tops, rotors, free bodies, and what has no steady motion."""

import numpy as np
import pytest
from scipy.optimize import brentq

import tsdyn as ts
from tests.helpers.hanging_chains import DOWN, G, pendulums
from tests.helpers.spinning_tops import spinning_top
from tests.helpers.tolerances import CLOSE, FINE, HELD

C, F, M = ts.constraints, ts.forces, ts.motions
X, Y, Z = np.eye(3)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.4])
@pytest.mark.parametrize("driven", [False, True])
def test_governor_opens_to_its_angle(angle, driven):
    """Two arms on a shaft: cos(theta) = m g l / ((m l^2 + J - J_z) rate^2); hanging down is unstable."""
    length, mass, own, rate = 0.5, 1.2, np.array([0.012, 0.012, 0.002]), 7.0
    scene = ts.Scene(gravity=DOWN)
    post = scene.add_body(1.0, (0.3, 0.3, 0.3), name="post")
    bearing = scene.add(C.Revolute.at(scene.ground, post, point=(0, 0, 0), axis=Z, name="bearing"))
    if driven:
        scene.add(C.RotationMotor.of(bearing, angle=rate * M.time))
    for sign in (1.0, -1.0):
        turned = (np.cos(angle / 2), 0, -sign * np.sin(angle / 2), 0)
        place = length * np.array([sign * np.sin(angle), 0.0, -np.cos(angle)])
        ball = scene.add_body(mass, own, place, turned, name=f"ball {sign:g}")
        scene.add(C.Revolute.at(post, ball, point=(0, 0, 0), axis=Y, name=f"arm {sign:g}"))
    found = scene.equilibrium(spin=(0, 0, rate))
    theta = np.arccos(mass * G * length / ((mass * length**2 + own[0] - own[2]) * rate**2))
    place = found.state.position("ball 1")
    assert found.stable
    assert found.neutral == (0 if driven else 1)
    np.testing.assert_allclose(np.arctan2(abs(place[0]), -place[2]), theta, atol=FINE)
    np.testing.assert_array_equal(found.rotation_rate, (0, 0, rate))
    force = found.reaction("arm 1", on="ball 1")[0]
    np.testing.assert_allclose(force, mass * np.array([-place[0] * rate**2, 0, G]), atol=1e-9)
    assert scene.linearise(found.state).steady
    run = ts.simulate(scene, (0.0, 1.0), state=found.state)
    np.testing.assert_allclose(run.position("ball 1")[:, 2], place[2], atol=CLOSE)
    assert not scene.start[1].any()


def test_porter_governor_in_closed_loops():
    """Balls between the shaft and a sleeve: rate^2 cos(theta) = (1 + M / m) g / l."""
    mass, sleeve_mass, length, rate = 1.0, 3.0, 0.4, 14.0
    scene = ts.Scene(gravity=DOWN)
    sleeve = scene.add_point_mass(sleeve_mass, (0, 0, -0.7), name="sleeve")
    for normal in (X, Y):
        scene.add(C.PlaneContact(sleeve, scene.ground, normal_b=normal))
    out = np.sqrt(length**2 - 0.35**2)
    for sign in (1.0, -1.0):
        ball = scene.add_point_mass(mass, (sign * out, 0, -0.35), name=f"ball {sign:g}")
        scene.add(C.Distance(ball, scene.ground, length=length))
        scene.add(C.Distance(ball, sleeve, length=length, name=f"lower {sign:g}"))
    found = scene.equilibrium(spin=(0, 0, rate))
    cosine = (1.0 + sleeve_mass / mass) * G / (length * rate**2)
    np.testing.assert_allclose(found.state.position("sleeve")[2], -2.0 * length * cosine, atol=FINE)
    tension = sleeve_mass * G / (2.0 * cosine)
    np.testing.assert_allclose(np.linalg.norm(found.reaction("lower 1")[0]), tension, rtol=CLOSE)
    assert found.stable


@pytest.mark.parametrize(("rate", "hangs"), [(2.8, True), (6.0, False)])
def test_double_pendulum_whirls(rate, hangs):
    """Two links on a shaft; above sqrt((2 - sqrt 2) g / l) they leave the vertical: roots of the moments, by SciPy."""
    scene = ts.Scene(gravity=DOWN)
    shaft = scene.add_body(1.0, (1.0, 1.0, 1.0), name="shaft")
    scene.add(C.Revolute.at(scene.ground, shaft, point=(0, 0, 0), axis=Z))
    top, before, mass, length = np.zeros(3), shaft, 1.3, 0.7
    for i in range(2):
        ball = scene.add_point_mass(mass, top + 0.05 * X - np.sqrt(length**2 - 0.05**2) * Z, name=f"ball {i}")
        scene.add(C.Distance(ball, before, length=length))
        scene.add(C.Dot2(shaft, ball, axis_a=Y, value=0.0))
        top, before = ball.position, ball
    found = scene.equilibrium(spin=(0, 0, rate))
    one, two = (found.state.position(f"ball {i}") for i in range(2))
    assert found.stable
    if hangs:
        np.testing.assert_allclose([one[0], two[0]], 0.0, atol=CLOSE)
        return

    # tan of the lower link: m w^2 x2 / m g; of the upper: m w^2 (x1 + x2) / 2 m g
    def misfit(upper):
        x1 = length * np.sin(upper)
        lower = brentq(lambda b: np.tan(b) - rate**2 * (x1 + length * np.sin(b)) / G, 0.01, 1.57)
        return 2.0 * G * np.tan(upper) - rate**2 * (2.0 * x1 + length * np.sin(lower))

    upper = brentq(misfit, 0.05, 1.5)
    np.testing.assert_allclose(abs(one[0]), length * np.sin(upper), atol=CLOSE)
    assert abs(two[0]) > abs(one[0])


@pytest.mark.parametrize("theta", [0.2, 0.6, 1.0])
def test_top_precesses_at_its_tilt(theta):
    """(A - J) W^2 cos(theta) - J s W + m g l = 0 for precession W and spin s relative to it."""
    scene, A, J, moment = spinning_top(theta, 0.0, 0.0)
    for precession, spin in ((13.0, 150.0), (-13.0, -150.0)):
        found = scene.equilibrium(spin=(0, 0, precession), rotors={"top": spin})
        cosine = (J * spin * precession - moment) / ((A - J) * precession**2)
        assert found.stable
        assert found.state.position("top")[2] == pytest.approx(0.3 * cosine, abs=FINE)
        linear = scene.linearise(found.state)
        np.testing.assert_allclose(linear.rotation_rate, (0, 0, precession), atol=CLOSE)
    assert repr(found).startswith("<Equilibrium in steady motion: stable, 2 neutral")


@pytest.mark.parametrize(("spin", "upright"), [(150.0, True), (20.0, False)])
def test_sleeping_top_falls_below_its_critical_spin(spin, upright):
    found = spinning_top(0.0, 0.0, 0.0)[0].equilibrium(rotors={"top": (0, 0, spin)})
    assert found.stable
    assert found.state.position("top")[2] == pytest.approx(0.3 if upright else -0.3, abs=CLOSE)


@pytest.mark.parametrize("rate", [0.5, 2.0])
@pytest.mark.parametrize("stiffness", [0.0, 1e8])
def test_neutral_directions_are_none_of_the_stiffness(rate, stiffness):
    """A shaft that turns freely, with a hanging arm: the stiffness is that of the arm, not rounding."""
    mass, length, offset, own = 1.2, 0.5, 0.1, 0.01
    scene = ts.Scene(gravity=DOWN)
    shaft = scene.add_body(1.0, (0.3, 0.3, 0.3), name="shaft")
    scene.add(C.Revolute.at(scene.ground, shaft, point=(0, 0, 0), axis=Z))
    ball = scene.add_body(mass, (own, own, own), (offset, 0, -length), name="ball")
    scene.add(C.Revolute.at(shaft, ball, point=(offset, 0, 0), axis=Y, name="arm"))
    if stiffness:
        damper = scene.add_point_mass(1.0, (0, 0, 2.0), name="damper")
        for normal in (X, Y):
            scene.add(C.PlaneContact(damper, scene.ground, normal_b=normal))
        scene.add(F.Spring(damper, scene.ground, stiffness=stiffness, point_b=(0, 0, 1.0)))
    found = scene.equilibrium(spin=(0, 0, rate))
    theta = found.state.angle("arm")
    sine, cosine = abs(np.sin(theta)), np.cos(theta)
    moment = G * cosine - rate**2 * ((offset + length * sine) * -sine + length * cosine**2)
    assert found.stable
    assert found.neutral == 1
    assert found.smallest_stiffness == pytest.approx(mass * length * moment / (mass * length**2 + own), rel=CLOSE)
    assert ": stable, 1 neutral, smallest other stiffness " in repr(found)


def test_free_body_leaves_its_middle_axis():
    """It spins about the axis of largest moment at last; nearly about the smallest it stays, for that is stable too."""
    for start, settled in ((1, 2), (0, 0)):
        scene = ts.Scene(gravity=(0, 0, 0))
        tilt = {1: (np.cos(np.pi / 4), -np.sin(np.pi / 4), 0, 0), 0: (np.cos(np.pi / 4), 0, np.sin(np.pi / 4), 0)}[
            start
        ]
        body = scene.add_body(1.0, (1.0, 2.0, 2.5), orientation=tilt, name="book")
        found = scene.equilibrium(spin=(0, 0, 3.0))
        axis = found.state.rotation(body).T @ Z
        assert found.stable
        np.testing.assert_allclose(np.abs(axis), np.eye(3)[settled], atol=CLOSE)


def test_slider_on_a_rotor_stretches_its_spring():
    """k (x - l0) = m x rate^2, about an axis away from the origin."""
    rate, stiffness, place = 5.0, 100.0, np.array([2.0, 1.0, 0.0])
    scene = ts.Scene(gravity=(0, 0, 0))
    arm = scene.add_body(2.0, (1, 2, 2.5), place, name="arm")
    shaft = scene.add(C.Revolute.at(scene.ground, arm, point=place, axis=Z, name="shaft"))
    scene.add(C.RotationMotor.of(shaft, angle=rate * M.time))
    slider = scene.add_point_mass(mass=1.0, position=place + X, name="slider")
    scene.add(C.Dot2(arm, slider, axis_a=Y, value=0.0))
    scene.add(C.PlaneContact(slider, scene.ground, normal_b=Z))
    scene.add(F.Spring(arm, slider, stiffness=stiffness, free_length=0.6))
    found = scene.equilibrium(spin=(0, 0, rate), about=place)
    assert found.state.position(slider)[0] - place[0] == pytest.approx(0.6 / (1.0 - rate**2 / stiffness), abs=FINE)
    assert found.smallest_stiffness == pytest.approx(stiffness - rate**2, rel=CLOSE)
    with pytest.raises(ts.InconsistentState, match=r"shaft.* doesn't admit this spin"):
        scene.equilibrium(spin=(0, 0, rate))
    with pytest.raises(ts.InconsistentState, match=r"give the spin="):
        scene.equilibrium()


def test_reactions_are_of_constraints_and_forces():
    found = pendulums([0.0]).equilibrium()
    for wrong in (None, 3.0, found.state.handles.bodies[0], np.zeros(3)):
        with pytest.raises(ts.InvalidConstraint, match="is not a constraint or force"):
            found.reaction(wrong)


def test_what_has_no_steady_motion():
    scene = ts.Scene(gravity=DOWN)
    scene.add_point_mass(1.0, (1, 0, 0), name="stone")
    with pytest.raises(ts.NoEquilibrium, match="stone would accelerate by"):
        scene.equilibrium(spin=(0, 0, 1.0))
    swing = pendulums([0.3])
    with pytest.raises(ts.InconsistentState, match=r"pin 0.* doesn't admit this spin"):
        swing.equilibrium(spin=(0, 0, 1.0))
    with pytest.raises(ts.NoEquilibrium, match=r"doesn't look the same|no steady motion"):
        swing.equilibrium(spin=(0, 2.0, 0.0))


def test_rotor_of_a_scene_with_another_axis_of_symmetry():
    """A rate is about the axis of symmetry that the body has with the scene's own numbers."""
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(1.0, (1.0, 1.0, 2.0), name="top")
    other = scene.with_parameters({"top.inertia": (2.0, 1.0, 1.0)})
    found = other.equilibrium(rotors={other["top"]: 3.0}).state
    np.testing.assert_allclose(found.angular_velocity("top"), (3.0, 0.0, 0.0), atol=HELD)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"spin": 3.0}, "spin"),
        ({"spin": (0, 0, 1), "about": (0, 0)}, "about"),
        ({"rotors": {"moon": 1.0}}, "moon"),
        ({"rotors": {"top": (1.0, 0, 0)}}, "no axis of symmetry"),
        ({"rotors": {"book": 1.0}}, "has no axis of symmetry"),
        ({"rotors": {"ball": 1.0}}, "no rigid body"),
    ],
)
def test_wrong_arguments_are_refused(arguments, said):
    scene = spinning_top(0.2, 0.0, 0.0)[0]
    scene.add_body(1.0, (1, 2, 2.5), name="book")
    scene.add_point_mass(1.0, name="ball")
    with pytest.raises(ts.TsdynError, match=said):
        scene.equilibrium(**arguments)
