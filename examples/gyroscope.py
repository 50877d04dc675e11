"""Steady precession of a gyroscope: a disc on a rod whose end is fixed by a ball joint.

With the axis at an angle c from the vertical, A the moment of inertia about the joint across the axis, C about the
axis, and s the spin relative to the axis that precesses, the precession p is steady if

    (A - C) cos(c) p^2 - C s p + m g l = 0

which has a slow and a fast root. Run it: python examples/gyroscope.py
"""

import numpy as np

import tsdyn as ts

MASS, RADIUS, ARM, TILT, SPIN, GRAVITY = 1.0, 0.15, 0.2, np.radians(60.0), 150.0, 9.81  # kg, m, m, rad, rad/s, m/s^2
DISC = ts.shapes.cylinder(RADIUS, 0.02, axis="z", mass=MASS)
C = DISC.inertia[2, 2]
A = DISC.inertia[0, 0] + MASS * ARM**2


def precessions():
    """The slow and the fast rate, rad/s."""
    return np.sort(np.roots([(A - C) * np.cos(TILT), -C * SPIN, MASS * GRAVITY * ARM]))


def build(fast=False):
    """Return the scene: the axis in the plane of x and z, precessing about z."""
    p = precessions()[int(fast)]
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    axis = np.array([np.sin(TILT), 0.0, np.cos(TILT)])
    disc = scene.add_body(
        **DISC,
        position=ARM * axis,
        orientation=(np.cos(TILT / 2), 0.0, np.sin(TILT / 2), 0.0),
        velocity=np.cross((0.0, 0.0, p), ARM * axis),
        angular_velocity=(-p * np.sin(TILT), 0.0, SPIN + p * np.cos(TILT)),
        name="disc",
    )
    scene.add(ts.constraints.Spherical.at(disc, scene.ground, point=(0, 0, 0), name="pivot"))
    return scene


def turn_and_tilt(solution):
    """Angles of precession and of tilt, rad."""
    x, y, z = solution.position("disc").T
    return np.unwrap(np.arctan2(y, x)), np.arctan2(np.hypot(x, y), z)


def check(solution, fast=False, tol=1e-8):
    """The tilt stays, and the precession is that of the closed form."""
    solution.raise_if_failed()
    turn, tilt = turn_and_tilt(solution)
    assert np.abs(tilt - TILT).max() < tol
    assert np.abs(turn - precessions()[int(fast)] * solution.t).max() < 1e2 * tol
    assert solution.constraint_error.position.max() < 1e-14


def main():
    """Run both precessions for 3 s."""
    for fast in (False, True):
        solution = ts.simulate(build(fast), (0.0, 3.0), rtol=1e-11, atol=1e-11)
        check(solution, fast)
        print(solution)
        found, expected = turn_and_tilt(solution)[0][-1] / 3.0, precessions()[int(fast)]
        print(f"  precession {found:.8f} rad/s; closed form {expected:.8f}")


if __name__ == "__main__":
    main()
