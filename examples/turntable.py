"""A ball on a turntable: it rolls without slip and runs on a circle, at 2/7 of the turntable's rate.

    v' = k / (1 + k) W x v        W: of the turntable, k = 2/5 of a solid ball: inertia k m r^2

The circle is anywhere: where the ball is put, and how it is pushed, decide.

Run it: python examples/turntable.py
"""

import numpy as np

import tsdyn as ts

RATE, RADIUS, MASS = 7.0, 0.1, 0.5  # rad/s, m, kg
START, VELOCITY = np.array((0.3, 0.0, RADIUS)), np.array((0.0, 0.3, 0.0))  # m, m/s


def build():
    """The turntable, its motor, and the ball, which rolls at the start."""
    scene, c = ts.Scene(), ts.constraints
    table = scene.add_body(**ts.shapes.cylinder(0.8, 0.04, mass=5.0), position=(0, 0, -0.02), name="table")
    table.angular_velocity = (0, 0, RATE)
    hinge = scene.add(c.Revolute.at(scene.ground, table, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    scene.add(c.RotationMotor.of(hinge, angle=RATE * ts.motions.time, name="motor"))
    ball = scene.add_body(**ts.shapes.sphere(RADIUS, mass=MASS), position=START, velocity=VELOCITY, name="ball")
    ball.angular_velocity = np.cross(np.cross((0, 0, RATE), START) - VELOCITY, (0, 0, 1)) / RADIUS
    scene.add(
        c.RollingBall.at(ball, table, center=START, radius=RADIUS, point=(0, 0, 0), normal=(0, 0, 1), name="contact")
    )
    return scene


def circle(t):
    """Position of the ball on its circle (k, 2), m."""
    rate = 2.0 / 7.0 * RATE
    start, velocity = complex(*START[:2]), complex(*VELOCITY[:2])
    path = start + velocity / (1j * rate) * (np.exp(1j * rate * t) - 1.0)
    return np.stack((path.real, path.imag), axis=1)


def check(solution, tol=1e-9):
    """The ball is on its circle, and needs little friction for it."""
    solution.raise_if_failed()
    assert np.abs(solution.position("ball")[:, :2] - circle(solution.t)).max() < tol
    demand = 2.0 / 7.0 * RATE * np.linalg.norm(VELOCITY) / 9.81
    assert np.abs(solution.friction_demand("contact") - demand).max() < tol


def main():
    """One turn of the ball."""
    solution = ts.simulate(build(), (0.0, np.pi))
    check(solution)
    print(solution)
    print("ball after one of its turns", solution.position("ball")[-1].round(9))
    print(f"friction that it needs {solution.friction_demand('contact').max():.6f}")


if __name__ == "__main__":
    main()
