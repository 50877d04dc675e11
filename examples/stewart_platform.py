"""A Stewart platform: six legs of prescribed length move a plate in six degrees of freedom.

The legs are massless: a Distance each, whose length is the inverse kinematics of the motion that is wanted. The check
compares the plate with that motion, and the legs' forces with Newton's and Euler's equations.

Run it: python examples/stewart_platform.py
"""

import numpy as np

import tsdyn as ts

BASE, TOP, HEIGHT, MASS, INERTIA = 1.0, 0.6, 0.9, 20.0, (2.0, 2.0, 3.5)  # m, m, m, kg, kg m^2
LIFT, SWAY, TILT, RATE = 0.15, 0.1, 0.25, 3.0  # m, m, rad, rad/s
END = 2.0 * np.pi / RATE
FEET = BASE * np.array([(np.cos(a), np.sin(a), 0.0) for a in np.radians((-20, 20, 100, 140, 220, 260))])
HEADS = TOP * np.array([(np.cos(a), np.sin(a), 0.0) for a in np.radians((-50, 50, 70, 170, 190, 290))])


def pose(t):
    """The plate's centroid (3,) and its tilt about x, m and rad."""
    wave = 1.0 - np.cos(RATE * t)
    return (SWAY * wave, 0.0 * t, HEIGHT + LIFT * wave), TILT * wave


def length(foot, head):
    """The length of a leg as a motion."""
    (x, y, z), tilt = pose(ts.motions.time)
    dx, dy = x + head[0] - foot[0], y + np.cos(tilt) * head[1] - foot[1]
    return np.sqrt(dx * dx + dy * dy + (z + np.sin(tilt) * head[1]) ** 2)


def build():
    """Return the scene, at rest in the middle."""
    scene = ts.Scene()
    plate = scene.add_body(MASS, INERTIA, position=(0.0, 0.0, HEIGHT), name="plate")
    for i, (foot, head) in enumerate(zip(FEET, HEADS, strict=True)):
        leg = {"point_a": head, "point_b": foot, "length": length(foot, head), "name": f"leg {i}"}
        scene.add(ts.constraints.Distance(plate, scene.ground, **leg))
    return scene


def check(solution, tol=1e-8):
    """The plate follows the motion; the six forces are those that its accelerations need."""
    solution.raise_if_failed()
    t = solution.t
    (x, y, z), tilt = pose(t)
    assert np.abs(solution.position("plate") - np.stack([x, y, z], axis=1)).max() < tol
    R = solution.rotation("plate")
    assert np.abs(np.arctan2(R[:, 2, 1], R[:, 1, 1]) - tilt).max() < tol
    wave = RATE**2 * np.cos(RATE * t)
    force = MASS * np.stack([SWAY * wave, 0 * t, LIFT * wave + 9.81], axis=1)
    torque = np.stack([INERTIA[0] * TILT * wave, 0 * t, 0 * t], axis=1)
    total, moment = 0.0, 0.0
    for i, head in enumerate(HEADS):
        pull, _ = solution.reaction(f"leg {i}", on="plate")
        total, moment = total + pull, moment + np.cross(R @ head, pull)
    assert np.abs(total - force).max() < 1e3 * tol
    assert np.abs(moment - torque).max() < 1e3 * tol


def forces(solution):
    """The legs' forces, N (k, 6), positive in compression."""
    found = []
    for i, head in enumerate(HEADS):
        pull, _ = solution.reaction(f"leg {i}", on="plate")
        leg = solution.position("plate", point=head) - FEET[i]
        found.append(np.einsum("ki,ki->k", pull, leg) / np.linalg.norm(leg, axis=1))
    return np.stack(found, axis=1)


def main():
    """Run a period and print the largest force of a leg; the same by kinematic analysis, without integration."""
    solution = ts.simulate(build(), (0.0, END), rtol=1e-10, atol=1e-10)
    check(solution)
    check(build().kinematics(np.linspace(0.0, END, 50)))
    print(solution)
    print(f"  a leg carries up to {np.abs(forces(solution)).max():.1f} N")


if __name__ == "__main__":
    main()
