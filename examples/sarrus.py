"""Sarrus linkage: one loop of six links and six revolute joints that guides a platform along a straight line.

    two legs of two links with three parallel hinges each; the planes of the legs are perpendicular
    30 rows for 30 degrees of freedom, one row redundant in every configuration: one degree of freedom

A spring carries the platform. The angle phi of the lower links from the ground obeys

    M thetadd + M' phid^2 / 2 = -V',   M = 2 (m l^2 / 4 + J) + 2 (m l^2 (sin^2 + 9 cos^2) / 4 + J) + 4 P l^2 cos^2
                                       V = 4 m g l sin + 2 P g l sin + k (2 l sin - l0)^2 / 2

Run it: python examples/sarrus.py
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import tsdyn as ts

LENGTH, MASS, PLATFORM = 0.5, 0.8, 3.0  # m, kg, kg
INERTIA = MASS * LENGTH**2 / 12  # of a link about its hinges' direction, at its middle
STIFFNESS, FREE, GRAVITY, START, OUT = 150.0, 0.9, 9.81, 1.1, 0.2  # N/m, m, m/s^2, rad, m


def build():
    """Return the scene at rest, the legs steep."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    top = np.array([0.0, 0.0, 2.0 * LENGTH * np.sin(START)])
    platform = scene.add_body(PLATFORM, (0.05, 0.05, 0.1), top, name="platform")
    for name, angle in (("A", 0.0), ("B", np.pi / 2)):
        round_ = Rotation.from_rotvec((0.0, 0.0, angle))
        hinge, foot = round_.apply((0.0, 1.0, 0.0)), round_.apply((OUT, 0.0, 0.0))
        links, knee = [], foot + round_.apply((LENGTH * np.cos(START), 0.0, LENGTH * np.sin(START)))
        for part, first, turn in (("lower", foot, START), ("upper", knee, np.pi - START)):
            pose = round_ * Rotation.from_rotvec((0.0, -turn, 0.0))
            middle = first + pose.apply((LENGTH / 2, 0.0, 0.0))
            links.append(
                scene.add_body(MASS, INERTIA * np.array([0.1, 1.0, 1.0]), middle, pose, name=f"{part} link {name}")
            )
        for a, b, place in (
            (scene.ground, links[0], foot),
            (links[0], links[1], knee),
            (links[1], platform, foot + top),
        ):
            scene.add(ts.constraints.Revolute.at(a, b, point=place, axis=hinge))
    scene.add(ts.forces.Spring(scene.ground, platform, stiffness=STIFFNESS, free_length=FREE))
    return scene


def reference(times):
    """The angle and its rate, (k,) each, by SciPy at 1e-12."""

    def rates(t, y):
        sin, cos, l = np.sin(y[0]), np.cos(y[0]), LENGTH
        inertia = MASS * l**2 / 2 + 4 * INERTIA + MASS * l**2 / 2 * (sin**2 + 9 * cos**2) + 4 * PLATFORM * l**2 * cos**2
        slope = -8 * (MASS + PLATFORM) * l**2 * sin * cos
        load = (4 * MASS + 2 * PLATFORM) * GRAVITY * l * cos + STIFFNESS * (2 * l * sin - FREE) * 2 * l * cos
        return [y[1], -(slope / 2 * y[1] ** 2 + load) / inertia]

    return solve_ivp(rates, (0.0, times[-1]), [START, 0.0], "DOP853", times, rtol=1e-12, atol=1e-12).y


def check(solution, tol=1e-9):
    """The platform's place to tol, and that it neither tilts nor leaves its line."""
    solution.raise_if_failed()
    phi, _ = reference(solution.t)
    place = 2.0 * LENGTH * np.outer(np.sin(phi), (0.0, 0.0, 1.0))
    assert np.abs(solution.position("platform") - place).max() < tol
    assert np.abs(solution.rotation("platform") - np.eye(3)).max() < 1e-13
    assert (np.isnan(solution.multipliers).sum(axis=1) == 1).all()
    assert solution.constraint_error.position.max() < 1e-14


def main():
    """Run it for 3 s and print how good it is."""
    solution = ts.simulate(build(), (0.0, 3.0), integrator=ts.integrators.DOP853(rtol=1e-11, atol=1e-11))
    check(solution)
    print(solution)
    height = solution.position("platform")[:, 2]
    print(f"  the platform goes up and down between {height.min():.3f} and {height.max():.3f} m")
    print(f"  distance from SciPy {np.abs(height - 2 * LENGTH * np.sin(reference(solution.t)[0])).max():.1e} m")


if __name__ == "__main__":
    main()
