"""A flyball governor: balls on two massless arms each, a heavy sleeve, a shaft that speeds up to a constant rate.

The balls settle where the moments of weight and centrifugal force balance,

    cos(theta) = g (m + M) / (m l w^2)    theta: arm and shaft, w: angular velocity

Run it: python examples/flyball_governor.py
"""

import numpy as np

import tsdyn as ts

BALL, SLEEVE, ARM, GRAVITY = 1.5, 2.0, 0.3, 9.81  # kg, kg, m, m/s^2
RATE, START, DAMPING = 12.0, 0.4, 60.0  # rad/s, rad, N s/m


def build():
    """Return the scene: the shaft turns from 4 rad/s to 12 rad/s within a second."""
    scene, c = ts.Scene(gravity=(0.0, 0.0, -GRAVITY)), ts.constraints
    t = ts.motions.time
    turn = 4.0 * t + (RATE - 4.0) * (t - (1.0 - np.exp(-8.0 * t)) / 8.0)
    shaft = scene.add_body(1.0, (0.02, 0.02, 0.01), angular_velocity=(0.0, 0.0, 4.0), name="shaft")
    bearing = scene.add(c.Revolute.at(scene.ground, shaft, point=(0, 0, 0), axis=(0, 0, 1), name="bearing"))
    scene.add(c.RotationMotor.of(bearing, angle=turn, name="motor"))
    low = (0.0, 0.0, -2.0 * ARM * np.cos(START))
    sleeve = scene.add_point_mass(SLEEVE, low, name="sleeve")
    scene.add(c.PointOnLine(sleeve, scene.ground, axis_b=(0, 0, 1), name="guide"))
    for side, name in ((1.0, "right"), (-1.0, "left")):
        x = side * ARM * np.sin(START)
        ball = scene.add_point_mass(BALL, (x, 0.0, low[2] / 2), velocity=(0.0, 4.0 * x, 0.0), name=name)
        scene.add(c.Distance(ball, scene.ground))
        scene.add(c.Distance(ball, sleeve))
        scene.add(c.PlaneContact(ball, shaft, normal_b=(0, 1, 0)))  # the arms turn with the shaft
    anchor = (0.0, 0.0, -4.0 * ARM)
    scene.add(ts.forces.Spring(sleeve, scene.ground, point_b=anchor, damping=DAMPING, name="damper"))
    return scene


def angle(solution):
    """Of an arm from the shaft, rad."""
    return np.arccos(-solution.position("sleeve")[:, 2] / (2.0 * ARM))


def steady():
    """The angle at which weight and centrifugal force balance, rad."""
    return np.arccos(GRAVITY * (BALL + SLEEVE) / (BALL * ARM * RATE**2))


def check(solution, tol=1e-6):
    """The governor has settled at the angle of the closed form, and its motor does no more work."""
    solution.raise_if_failed()
    assert np.abs(angle(solution)[-1] - steady()) < tol
    assert solution.constraint_error.position.max() < 1e-14
    assert abs(solution.power_of("motor")[-1]) < 1e3 * tol


def main():
    """Run it for 10 s and print the angle."""
    solution = ts.simulate(build(), (0.0, 10.0))
    check(solution)
    print(solution)
    print(f"  arms at {np.degrees(angle(solution)[-1]):.6f} degrees; closed form {np.degrees(steady()):.6f}")


if __name__ == "__main__":
    main()
