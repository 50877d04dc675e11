"""A cardan shaft: two Hooke joints whose errors cancel, if both bend by the same angle and the yokes are aligned.

One joint gives a ratio of speeds between cos(b) and 1 / cos(b), twice a turn; the second one takes the opposite.

Run it: python examples/cardan_shaft.py
"""

import numpy as np

import tsdyn as ts

BEND, RATE, MIDDLE = np.radians(30.0), 8.0, 0.6  # rad, rad/s, m
LINE = np.array([np.cos(BEND), np.sin(BEND), 0.0])  # of the middle shaft


def build():
    """Return the scene: driving shaft, middle shaft and driven shaft, the last parallel to the first."""
    scene, c = ts.Scene(gravity=(0.0, 0.0, 0.0)), ts.constraints
    shaft = ts.shapes.cylinder(0.03, 0.4, axis="x", mass=2.0)
    spin = np.cos(BEND) * RATE  # of the middle shaft: the arm of the driving shaft is across the plane of the shafts
    turned = (np.cos(BEND / 2), 0.0, 0.0, np.sin(BEND / 2))
    far = MIDDLE * LINE
    first = scene.add_body(**shaft, position=(-0.3, 0, 0), angular_velocity=(RATE, 0, 0), name="driving shaft")
    middle = scene.add_body(
        **shaft, position=far / 2, orientation=turned, angular_velocity=(spin, 0, 0), name="middle shaft"
    )
    last = scene.add_body(
        **shaft, position=far + np.array([0.3, 0, 0]), angular_velocity=(RATE, 0, 0), name="driven shaft"
    )
    bearing = scene.add(c.Revolute.at(scene.ground, first, point=(-0.3, 0, 0), axis=(1, 0, 0), name="bearing"))
    scene.add(c.RotationMotor.of(bearing, angle=RATE * ts.motions.time, name="motor"))
    across = np.cross((0.0, 0.0, 1.0), LINE)
    scene.add(c.Universal.at(first, middle, point=(0, 0, 0), axis_a=(0, 0, 1), axis_b=across, name="first cross"))
    scene.add(c.Universal.at(middle, last, point=far, axis_a=across, axis_b=(0, 0, 1), name="second cross"))
    scene.add(c.Cylindrical.at(scene.ground, last, point=far, axis=(1, 0, 0), name="far bearing"))
    return scene


def speeds(solution):
    """Of the three shafts about their axes, rad/s, (3, k)."""
    return np.array([solution.angular_velocity(body)[:, 0] for body in solution.scene.bodies])


def check(solution):
    """The driven shaft turns as the driving one, to rounding; the middle one has Hooke's ratio."""
    solution.raise_if_failed()
    first, middle, last = speeds(solution)
    assert np.abs(last - first).max() < 1e-12 * RATE
    hooke = np.cos(BEND) / (1.0 - (np.sin(BEND) * np.sin(RATE * solution.t)) ** 2)
    assert np.abs(middle / first - hooke).max() < 1e-12
    assert solution.constraint_error.position.max() < 1e-14


def main():
    """Run it for 2 s and print how even the shafts turn."""
    solution = ts.simulate(build(), (0.0, 2.0))
    check(solution)
    print(solution)
    first, middle, last = speeds(solution)
    print(f"  middle shaft from {(middle / first).min():.4f} to {(middle / first).max():.4f} of the driving one")
    print(f"  driven shaft off by {np.abs(last / first - 1).max():.1e}")


if __name__ == "__main__":
    main()
