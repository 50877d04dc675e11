"""Boxes fall onto each other, rock, and come to rest; each on four corners, of which three would do.

The contacts of a box that rests are redundant: how its corners share the weight is not determined, their sum is. The
contacts have no friction: they push along their normals.

Run it: python examples/box_stack.py
"""

import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts

GRAVITY, MASS, RESTITUTION = 9.81, 2.0, 0.3  # m/s^2, kg, -
SIZES = (0.6, 0.5, 0.2), (0.45, 0.4, 0.2), (0.3, 0.3, 0.2)  # m, from below
TILTS = (0.05, -0.08, 0.0), (-0.06, 0.05, 0.1), (0.0, 0.1, 0.2)  # rad


def build():
    """Boxes above each other, askew."""
    scene, below, lift = ts.Scene(gravity=(0, 0, -GRAVITY)), None, 0.0
    for i, (size, tilt) in enumerate(zip(SIZES, TILTS, strict=True)):
        solid = ts.shapes.box(size, mass=MASS)
        place = 0, 0, 0.2 + 0.35 * i
        box = scene.add_body(**solid, position=place, orientation=Rotation.from_euler("xyz", tilt), name=f"box {i}")
        for k, (x, y) in enumerate([(1, 1), (1, -1), (-1, -1), (-1, 1)]):
            corner = np.array([x, y, -1]) * size / 2
            plane = {"point_b": (0, 0, lift), "normal_b": (0, 0, 1), "unilateral": True, "restitution": RESTITUTION}
            below_it = scene.ground if below is None else below
            scene.add(ts.constraints.PlaneContact(box, below_it, point_a=corner, **plane, name=f"corner {i}{k}"))
        below, lift = box, size[2] / 2
    return scene


def heights(solution):
    """Heights of the centres (k, 3), m."""
    return np.stack([solution.position(f"box {i}")[:, 2] for i in range(len(SIZES))], axis=1)


def check(solution, tol=1e-9):
    """All corners are closed at the end, and carry the weight above them; the energy never grows."""
    solution.raise_if_failed()
    assert len(solution.phases[-1][2]) == 4 * len(SIZES)
    for i in range(len(SIZES)):
        carried = sum(solution.reaction(f"corner {i}{k}")[0][-1] for k in range(4))
        np.testing.assert_allclose(carried, [0, 0, (len(SIZES) - i) * MASS * GRAVITY], atol=tol)
    np.testing.assert_allclose(heights(solution)[-1], 0.2 * (0.5 + np.arange(len(SIZES))), atol=tol)
    assert np.diff(solution.energy).max() < 1e-7


def main():
    """Until they rest."""
    solution = ts.simulate(build(), (0.0, 2.0))
    check(solution)
    print(solution)
    print(f"{len(solution.impulses)} impulses; at rest from {solution.phases[-1][0]:.6f} s")


if __name__ == "__main__":
    main()
