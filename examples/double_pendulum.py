"""A double pendulum of two slender rods: chaotic, so that a small error grows by a factor of ten every second or so.

The check compares with Lagrange's equations of the two angles, integrated by SciPy.

Run it: python examples/double_pendulum.py
"""

import numpy as np
from scipy.integrate import solve_ivp

import tsdyn as ts

LENGTH, MASS, GRAVITY = 1.0, 1.0, 9.81  # m, kg, m/s^2, of each rod
START = np.radians([120.0, -10.0])  # of the rods, from hanging


def build():
    """Return the scene, at rest."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    rod = ts.shapes.rod(LENGTH, axis="z", mass=MASS)
    upper = scene.add_body(**rod, position=(0, 0, -LENGTH / 2), name="upper")
    lower = scene.add_body(**rod, position=(0, 0, -1.5 * LENGTH), name="lower")
    scene.add(ts.constraints.Revolute.at(scene.ground, upper, point=(0, 0, 0), axis=(0, 1, 0), name="shoulder"))
    scene.add(ts.constraints.Revolute.at(upper, lower, point=(0, 0, -LENGTH), axis=(0, 1, 0), name="elbow"))
    scene.set("shoulder", angle=START[0])
    scene.set("elbow", angle=START[1] - START[0])
    return scene


def angles(solution):
    """Of both rods from hanging, rad (2, k)."""
    first = START[0] + solution.angle("shoulder") - solution.angle("shoulder")[0]
    return np.array([first, first + START[1] - START[0] + solution.angle("elbow") - solution.angle("elbow")[0]])


def reference(times):
    """The angles by SciPy at 1e-12, (2, k)."""
    k, g = MASS * LENGTH**2, MASS * GRAVITY * LENGTH

    def rates(t, y):
        a, b, ad, bd = y
        cross, sine = 0.5 * k * np.cos(a - b), 0.5 * k * np.sin(a - b)
        M = [[4.0 * k / 3.0, cross], [cross, k / 3.0]]
        loads = [-1.5 * g * np.sin(a) - sine * bd**2, -0.5 * g * np.sin(b) + sine * ad**2]
        return [ad, bd, *np.linalg.solve(M, loads)]

    return solve_ivp(rates, (0.0, times[-1]), [*START, 0, 0], "DOP853", times, rtol=1e-12, atol=1e-12).y[:2]


def check(solution, tol=1e-8):
    """Both angles to tol, the energy to tol, constraints at rounding."""
    solution.raise_if_failed()
    assert np.abs(angles(solution) - reference(solution.t)).max() < tol
    assert np.ptp(solution.energy) < tol
    assert solution.constraint_error.position.max() < 1e-14


def main():
    """Run it for 3 s and print how good it is."""
    solution = ts.simulate(build(), (0.0, 3.0), rtol=1e-12, atol=1e-12)
    check(solution)
    print(solution)
    print(f"  distance from SciPy {np.abs(angles(solution) - reference(solution.t)).max():.1e} rad")


if __name__ == "__main__":
    main()
