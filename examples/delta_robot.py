"""A delta robot from a URDF file, which holds a tree: five of its six rods end in the open until `loops=` ties them.

    hinges 3 x 5 rows, balls 12 x 3, motors 3      for 10 bodies; 6 freedoms are left: each rod turns about itself

The rods come in pairs, so the plate stays level. Its centre follows from the angles theta_k of the arms alone,

    |x - c_k| = L,   c_k = (R - r + A cos theta_k) e_k - A sin theta_k z        three spheres, k = 1, 2, 3

and `check` compares with the lower point where these meet.

Run it: python examples/delta_robot.py
"""

from pathlib import Path

import numpy as np

import tsdyn as ts

FILE = Path(__file__).with_name("delta_robot.urdf")
LOOPS = [(f"tip {rod}", f"seat {rod}", "ball") for rod in ("1b", "2a", "2b", "3a", "3b")]
BASE, PLATE, ARM, ROD = 0.2, 0.06, 0.2, 0.45  # m: R, r, A, L
OUT = 2.0 * np.pi / 3.0 * np.arange(3)  # directions e_k of the arms, rad
START, SWING, RATE = (0.3, 0.5, 0.2), 0.25, 8.0  # rad, rad, rad/s
HINGES = ("hinge 1", "hinge 2", "hinge 3")


def build():
    """Return the scene, assembled with the arms at START; motors swing them one after the other."""
    scene = ts.load(FILE, loops=LOOPS)
    scene.assemble(joints=dict(zip(HINGES, START, strict=True)))
    for k, hinge in enumerate(HINGES):
        swing = ts.motions.Sine(SWING, RATE, k, START[k] - SWING * np.sin(k))
        scene.add(ts.constraints.RotationMotor.of(scene[hinge], angle=swing, name=f"motor {k + 1}"))
    scene.assemble()  # velocities
    return scene


def centre(angles):
    """Where the plate is, (k, 3), of the angles of the arms (k, 3)."""
    reach = BASE - PLATE + ARM * np.cos(angles)
    c = np.stack([reach * np.cos(OUT), reach * np.sin(OUT), -ARM * np.sin(angles)], axis=-1)
    one, other = c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]
    normal = np.cross(one, other)
    rows = np.stack([one, other, normal], axis=1)
    sizes = [(one * one).sum(axis=1) / 2.0, (other * other).sum(axis=1) / 2.0, np.zeros(len(c))]
    foot = np.linalg.solve(rows, np.stack(sizes, axis=1)[..., None])[..., 0]  # of the height on the three centres
    height = np.sqrt(ROD**2 - (foot * foot).sum(axis=1))
    return c[:, 0] + foot - height[:, None] * normal / np.linalg.norm(normal, axis=1)[:, None]


def check(solution, tol=1e-12):
    """The plate's centre to tol, its attitude, and the arms where the motors want them."""
    solution.raise_if_failed()
    angles = np.stack([solution.angle(hinge) for hinge in HINGES], axis=1)
    assert np.abs(solution.position("plate") - centre(angles)).max() < tol
    assert np.abs(solution.rotation("plate") - np.eye(3)).max() < tol
    assert solution.constraint_error.position.max() < 1e-13


def torques(solution):
    """Of the motors on the arms, N m (k, 3)."""
    found = []
    for k, direction in enumerate(OUT):
        _, torque = solution.reaction(f"motor {k + 1}", on=f"arm {k + 1}")
        found.append(torque @ (-np.sin(direction), np.cos(direction), 0.0))
    return np.stack(found, axis=1)


def main():
    """Run a swing and print how good it is."""
    solution = ts.simulate(build(), (0.0, 1.0))
    check(solution)
    print(solution)
    print(f"  a motor needs up to {np.abs(torques(solution)).max():.2f} N m")


if __name__ == "__main__":
    main()
