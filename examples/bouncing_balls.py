"""Three balls bounce with different coefficients of restitution, until they rest on the floor, and slide on.

A ball that falls from the height h above its rest hits the floor first after T = sqrt(2 h / g). With the coefficient of
restitution e its flights last 2 T e, 2 T e^2, ...: infinitely many within a finite time, after which it slides on.

    at rest from    T (1 + e) / (1 - e)

Run it: python examples/bouncing_balls.py
"""

import numpy as np

import tsdyn as ts

GRAVITY, RADIUS, HEIGHT, SPEED = 9.81, 0.08, 1.0, 0.4  # m/s^2, m, m, m/s
RESTITUTIONS = 0.0, 0.5, 0.8


def build():
    """Balls side by side, thrown along x; the names are those of their coefficients."""
    scene = ts.Scene(gravity=(0, 0, -GRAVITY))
    for i, e in enumerate(RESTITUTIONS):
        place = 0, 0.3 * i, HEIGHT + RADIUS
        ball = scene.add_body(
            **ts.shapes.sphere(RADIUS, mass=0.2), position=place, velocity=(SPEED, 0, 0), name=f"e = {e}"
        )
        floor = {"radius_a": RADIUS, "normal_b": (0, 0, 1), "restitution": e, "name": f"floor, {e}"}
        scene.add(ts.constraints.SphereContact(ball, scene.ground, **floor))
    return scene


def heights(solution):
    """Heights of the lowest points (k, 3), m."""
    return np.stack([solution.position(f"e = {e}")[:, 2] - RADIUS for e in RESTITUTIONS], axis=1)


def check(solution, tol=1e-11):
    """Impacts and rest of each ball are at the instants of the closed form."""
    solution.raise_if_failed()
    first = np.sqrt(2 * HEIGHT / GRAVITY)
    for e in RESTITUTIONS:
        name = f"floor, {e}"
        times = np.array([t for t, contact, _ in solution.impulses if contact == name])[:12]
        flights = np.append(0.0, np.cumsum(2 * e ** np.arange(1, times.size)))
        assert np.abs(times - first * (1 + flights)).max() < tol
        rest = next(start for start, _, names in solution.phases if name in names)
        assert abs(rest - first * (1 + e) / (1 - e)) < tol
    assert heights(solution).min() > -1e-12


def main():
    """Until all are at rest."""
    solution = ts.simulate(build(), (0.0, 5.0))
    check(solution)
    print(solution)
    print(f"{len(solution.impulses)} impacts; all at rest from {solution.phases[-1][0]:.9f} s")


if __name__ == "__main__":
    main()
