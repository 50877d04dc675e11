"""Bricard's six-bar: six links, six revolute joints, one loop, mobile by its geometry alone.

A count of rows says that nothing moves: 5 bodies have 30 degrees of freedom, 6 joints 30 rows. The axes are at right
angles and all links equal, so one row is redundant, and the linkage turns inside out. Joints alternate between
two angles, for which

    cos(a) cos(b) + cos(a) + cos(b) = 0

Run it: python examples/bricard.py
"""

import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 0, 1)], float)  # m, of a cube
ROD = ts.shapes.cylinder(0.04, 1.0, axis="x", mass=1.0)


def build():
    """Return the scene: five rods and the ground along edges of a cube, released from rest."""
    scene = ts.Scene(gravity=(0.0, -9.81, 0.0))
    links = [scene.ground]
    for i in range(5):
        along = CORNERS[i + 1] - CORNERS[i]
        turn = Rotation.align_vectors([along], [(1.0, 0.0, 0.0)])[0]
        links.append(scene.add_body(**ROD, position=CORNERS[i] + along / 2, orientation=turn, name=f"rod {i}"))
    for i in range(6):
        axis = np.cross(CORNERS[i] - CORNERS[i - 1], CORNERS[(i + 1) % 6] - CORNERS[i])
        joint = ts.constraints.Revolute.at(links[i], links[(i + 1) % 6], point=CORNERS[i], axis=axis, name=f"joint {i}")
        scene.add(joint)
    return scene


def angles(solution):
    """Of the joints, rad (k, 6), a right angle in the cube."""
    return np.stack([np.pi / 2 + solution.angle(f"joint {i}") for i in range(6)], axis=1)


def check(solution, tol=1e-11):
    """Joints alternate between two angles, which satisfy the closure condition; the energy is constant."""
    solution.raise_if_failed()
    found = angles(solution)
    assert np.ptp(found[:, ::2], axis=1).max() < tol
    assert np.ptp(found[:, 1::2], axis=1).max() < tol
    a, b = np.cos(found[:, 0]), np.cos(found[:, 1])
    assert np.abs(a * b + a + b).max() < tol
    assert np.ptp(found[:, 0]) > 1.0  # it moves
    assert np.ptp(solution.energy) < 1e-6
    assert solution.constraint_error.position.max() < 1e-13


def main():
    """Count its degrees of freedom, run it for 3 s and print the range of a joint."""
    mobility = build().mobility()
    print(f"{mobility.degrees_of_freedom} degree of freedom, redundant: {mobility.redundant[0].name}")
    solution = ts.simulate(build(), (0.0, 3.0))
    check(solution)
    print(solution)
    print(f"  joint 0 turns by {np.degrees(np.ptp(angles(solution)[:, 0])):.1f} degrees")


if __name__ == "__main__":
    main()
