"""`scene.linearise` about steady motion: tops, a free body, a governor."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.hanging_chains import DOWN, G
from tests.helpers.spinning_tops import spinning_top
from tests.helpers.tolerances import CLOSE

C = ts.constraints


@pytest.mark.parametrize("fast", [True, False])
def test_top_in_steady_precession(fast):
    theta, spin = 0.5, 150.0
    _, A, J, moment = spinning_top(theta, spin, 0.0)
    root = np.sqrt((J * spin) ** 2 - 4.0 * A * np.cos(theta) * moment)
    precession = (J * spin + (root if fast else -root)) / (2.0 * A * np.cos(theta))
    linear = spinning_top(theta, spin, precession)[0].linearise()
    nutation = np.sqrt(A**2 * precession**4 - 2.0 * A * moment * precession**2 * np.cos(theta) + moment**2)
    nutation /= A * precession
    assert linear.steady
    np.testing.assert_allclose(linear.rotation_rate, (0, 0, precession), atol=CLOSE)
    found = linear.eigenvalues()
    np.testing.assert_allclose(found[:4], 0.0, atol=CLOSE)
    np.testing.assert_allclose(np.sort(found.imag)[[0, -1]], (-nutation, nutation), rtol=CLOSE)
    np.testing.assert_allclose(found.real, 0.0, atol=CLOSE)


@pytest.mark.parametrize("spin", [150.0, 40.0])
def test_sleeping_top(spin):
    scene, A, J, moment = spinning_top(0.0, spin, 0.0)
    linear = scene.linearise()
    root = np.sqrt(complex((J * spin) ** 2 - 4.0 * A * moment))
    assert linear.steady
    assert not linear.rotation_rate.any()
    for value in ((J * spin + root) / (2.0 * A), (J * spin - root) / (2.0 * A)):
        for expected in (1j * value, -1j * value.conjugate()):
            assert np.abs(linear.eigenvalues() - expected).min() < CLOSE * abs(value)


def test_free_body_spinning_about_its_middle_axis():
    """Euler's equations about the axis of the middle moment: +-spin sqrt((C - B) (B - A) / (A C)), and zeros."""
    J, spin = np.array([1.0, 2.0, 2.5]), 3.0
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(1.0, J, angular_velocity=(0.0, spin, 0.0), name="book")
    linear = scene.linearise()
    rate = spin * np.sqrt((J[2] - J[1]) * (J[1] - J[0]) / (J[0] * J[2]))
    assert linear.steady
    assert np.abs(linear.eigenvalues() - rate).min() < CLOSE
    assert np.abs(linear.eigenvalues() + rate).min() < CLOSE


def test_governor_turning_steadily():
    """Two arms about a shaft that turns steadily: the frequency of both opening together, shaft free to slow down."""
    length, mass, shaft, own, rate = 0.5, 1.2, 0.3, 0.01, 7.0
    theta = np.arccos(G / (length * rate**2))
    scene = ts.Scene(gravity=DOWN)
    post = scene.add_body(1.0, (shaft, shaft, shaft), angular_velocity=(0, 0, rate), name="post")
    scene.add(C.Revolute.at(scene.ground, post, point=(0, 0, 0), axis=(0, 0, 1), name="bearing"))
    for sign in (1.0, -1.0):
        place = length * np.array([sign * np.sin(theta), 0.0, -np.cos(theta)])
        ball = scene.add_body(
            mass,
            (own, own, own),
            place,
            velocity=(0, rate * place[0], 0),
            angular_velocity=(0, 0, rate),
            name=f"ball {sign}",
        )
        scene.add(C.Revolute.at(post, ball, point=(0, 0, 0), axis=(0, 1, 0), name=f"arm {sign}"))
    linear = scene.linearise()
    assert linear.steady
    # (m l^2 + j) thetadd = m l^2 w^2 s c - m g l s, I(theta) w constant
    s, c = np.sin(theta), np.cos(theta)
    square = mass * length**2
    inertia = shaft + 2.0 * own + 2.0 * square * s * s
    apart = square * rate**2 * s * s / (square + own)
    expected = np.sqrt([apart * (1.0 + 8.0 * square * c * c / inertia), apart])
    found = linear.eigenvalues()
    for value in expected:
        assert np.abs(found - 1j * value).min() < CLOSE * value


def test_slider_on_a_rotor_that_a_motor_turns():
    """Along the arm of a driven rotor k / m - rate^2 is left of the stiffness."""
    rate, stiffness = 5.0, 100.0
    scene = ts.Scene(gravity=(0, 0, 0))
    arm = scene.add_body(2.0, (1, 2, 2.5), (0.3, 0, 0), velocity=(0, 0.3 * rate, 0), angular_velocity=(0, 0, rate))
    shaft = scene.add(C.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 0, 1), name="shaft"))
    scene.add(C.RotationMotor.of(shaft, angle=rate * ts.motions.time))
    slider = scene.add_point_mass(mass=1.0, position=(1, 0, 0), velocity=(0, rate, 0), name="slider")
    scene.add(C.Dot2(arm, slider, axis_a=(0, 1, 0), value=0.0))
    scene.add(C.PlaneContact(slider, scene.ground, normal_b=(0, 0, 1)))
    free_length = 1.0 - rate**2 / stiffness
    scene.add(ts.forces.Spring(arm, slider, point_a=(-0.3, 0, 0), stiffness=stiffness, free_length=free_length))
    linear = scene.linearise()
    assert linear.steady
    assert linear.coordinates == ("slider.x",)
    np.testing.assert_allclose(linear.eigenvalues()[0], 1j * np.sqrt(stiffness - rate**2), rtol=CLOSE)


def test_orbit_about_a_spring():
    """A circular orbit on a table: the radius swings with k / m + 3 rate^2, and the angle is cyclic."""
    scene = ts.Scene(gravity=DOWN)
    ball = scene.add_point_mass(mass=1.0, position=(1, 0, 0), velocity=(0, 3, 0), name="ball")
    scene.add(C.PlaneContact(ball, scene.ground, normal_b=(0, 0, 1)))
    scene.add(ts.forces.Spring(ball, scene.ground, point_b=(0, 0, 0), stiffness=18.0, free_length=0.5))
    linear = scene.linearise()
    assert linear.steady
    np.testing.assert_allclose(linear.rotation_rate, (0, 0, 3), atol=CLOSE)
    expected = np.sqrt(18.0 + 3.0 * 9.0)
    np.testing.assert_allclose(linear.eigenvalues(), [0, 0, 1j * expected, -1j * expected], atol=CLOSE)
