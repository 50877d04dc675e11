"""A catapult: a latch holds the cocked arm, and a grip lets go of the stone where the arm is upright.

    hinge    Revolute, ground and arm           5 rows
    latch    Distance, ground and arm           1 row, up to the release
    grip     Spherical, tip of the arm, stone   3 rows, until the arm is upright

The spring of the hinge is released at 0.5 s. Its energy goes into arm and stone, which then flies as a particle.
Run it: python examples/catapult.py
"""

import numpy as np

import tsdyn as ts

LENGTH, ARM, STONE, STIFFNESS = 1.5, 2.0, 0.5, 60.0  # m, kg, kg, N m/rad
RELEASE, HEIGHT = 0.5, 0.4  # s; m, of the hinge


def build():
    """Return the scene: cocked, the arm level, behind the hinge."""
    scene = ts.Scene()
    shape = ts.shapes.rod(LENGTH, axis="x", mass=ARM)
    arm = scene.add_body(**shape, position=(-LENGTH / 2, 0, HEIGHT), name="arm")
    stone = scene.add_point_mass(STONE, position=(-LENGTH, 0, HEIGHT), name="stone")
    ground, axis = scene.ground, (0, 1, 0)
    scene.add(ts.constraints.Revolute.at(ground, arm, point=(0, 0, HEIGHT), axis=axis, name="hinge"))
    scene.add(ts.constraints.Spherical(arm, stone, point_a=(-LENGTH / 2, 0, 0), name="grip"))
    scene.add(ts.constraints.Distance(ground, arm, point_a=(-1, 0, 0), point_b=(-0.25, 0, 0), name="latch"))
    places = {"axis_a": axis, "reference_a": (1, 0, 0), "reference_b": (1, 0, 0)}
    scene.add(
        ts.forces.TorsionalSpring(ground, arm, **places, stiffness=STIFFNESS, free_angle=np.pi / 2, name="spring")
    )
    return scene


def release(t, state):
    """The time of the release."""
    return t - RELEASE


def upright(t, state):
    """How far the tip is behind the hinge, m."""
    return state.position("arm")[0]


release.action = lambda change: change.deactivate("latch")
upright.direction, upright.action = 1, lambda change: change.deactivate("grip")


def shoot():
    """Return the run up to the time at which the stone is at the ground."""

    def ground(t, state):
        return state.position("stone")[2]

    ground.terminal = True
    return ts.simulate(build(), (0.0, 5.0), events=[release, upright, ground], rtol=1e-11, atol=1e-11)


def check(solution, tol=1e-8):
    """Rest before the release, velocity from the energy of the spring, parabola after the grip has opened."""
    solution.raise_if_failed()
    assert [names for _, _, names in solution.phases] == [("grip", "latch"), ("grip",), ()]
    assert np.ptp(solution.q[solution.t < RELEASE], axis=0).max() < tol
    # (J + m L^2) w^2 / 2 = k (pi / 2)^2 / 2 - g L (M / 2 + m)
    g, inertia = 9.81, ARM * LENGTH**2 / 3.0 + STONE * LENGTH**2
    speed = LENGTH * np.sqrt((STIFFNESS * (np.pi / 2) ** 2 - 2.0 * g * LENGTH * (ARM / 2.0 + STONE)) / inertia)
    distance = speed * np.sqrt(2.0 * (HEIGHT + LENGTH) / g)
    assert abs(solution.state.position("stone")[0] - distance) < tol * distance
    assert np.ptp(solution.energy) < tol * np.abs(solution.energy).max()


def main():
    """Shoot and print the distance."""
    solution = shoot()
    print(solution)
    print(f"  the stone comes down at {solution.state.position('stone')[0]:.6f} m, after {solution.reached:.6f} s")
    check(solution)


if __name__ == "__main__":
    main()
