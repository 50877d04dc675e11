"""Newton's cradle: balls on rods, with small gaps between them; the first one is drawn aside.

Elastic impacts of two equal balls exchange their velocities. With gaps the impacts come one after the other, and the
last ball leaves alone, as fast as the first one came. Balls that touch are hit together: the first one then rebounds.

Run it: python examples/cradle.py
"""

import numpy as np

import tsdyn as ts

COUNT, RADIUS, ROD, GAP, DRAWN = 5, 0.02, 0.2, 1e-4, 0.6  # -, m, m, m, rad
GRAVITY = 9.81  # m/s^2


def build():
    """Rods straight down, but for the first."""
    scene = ts.Scene(gravity=(0, 0, -GRAVITY))
    balls = []
    for i in range(COUNT):
        pivot, tilt = np.array([i * (2 * RADIUS + GAP), 0, 0]), DRAWN * (i == 0)
        place = pivot - ROD * np.array([np.sin(tilt), 0, np.cos(tilt)])
        balls.append(scene.add_point_mass(0.05, place, name=f"ball {i}"))
        scene.add(ts.constraints.Distance(balls[i], scene.ground, point_b=pivot, name=f"rod {i}"))
        scene.add(ts.constraints.PlaneContact(balls[i], scene.ground, normal_b=(0, 1, 0), name=f"glass {i}"))
    radii = {"radius_a": RADIUS, "radius_b": RADIUS, "restitution": 1.0}
    for i in range(COUNT - 1):
        scene.add(ts.constraints.SphereContact(balls[i], balls[i + 1], **radii, name=f"gap {i}"))
    return scene


def ends(solution):
    """How far the first and the last ball are from below their pivots (k, 2), m."""
    places = [solution.position(f"ball {i}")[:, 0] - i * (2 * RADIUS + GAP) for i in (0, COUNT - 1)]
    return np.stack(places, axis=1)


def check(solution, tol=1e-9):
    """The last ball is hit last, as hard as the second; no energy is lost."""
    solution.raise_if_failed()
    names, impulses = zip(*((name, p) for _, name, p in solution.impulses[: COUNT - 1]), strict=True)
    assert names == tuple(f"gap {i}" for i in range(COUNT - 1))
    assert np.ptp(impulses) < 2e-3 * impulses[0]  # the gaps tilt the rods
    speed = np.sqrt(2 * GRAVITY * ROD * (1 - np.cos(DRAWN)))
    assert abs(impulses[0] - 0.05 * speed) < 2e-3 * 0.05 * speed
    assert np.ptp(solution.energy) < tol


def main():
    """A few swings."""
    solution = ts.simulate(build(), (0.0, 1.2))
    check(solution)
    print(solution)
    print(f"{len(solution.impulses)} impacts")


if __name__ == "__main__":
    main()
