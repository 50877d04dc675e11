"""A Scotch yoke: a pin on a wheel in a slot of a slider, which moves by exactly r cos(angle).

PlaneContact keeps the pin in the slot. The wheel turns freely against a spring on the slider; a is the angle,

    (J + m r^2 sin(a)^2) add + m r^2 sin(a) cos(a) ad^2 = k r^2 sin(a) cos(a)

Run it: python examples/scotch_yoke.py
"""

import numpy as np
from scipy.integrate import solve_ivp

import tsdyn as ts

RADIUS, MASS, STIFFNESS, RATE = 0.1, 1.5, 300.0, 25.0  # m, kg, N/m, rad/s
WHEEL = ts.shapes.cylinder(0.12, 0.02, axis="z", density=7850)
INERTIA = WHEEL.inertia[2, 2]


def build():
    """Return the scene: the pin on the right, the slider moves along x."""
    scene, c = ts.Scene(gravity=(0.0, 0.0, 0.0)), ts.constraints
    wheel = scene.add_body(**WHEEL, angular_velocity=(0, 0, RATE), name="wheel")
    yoke = scene.add_body(**ts.shapes.box((0.02, 0.3, 0.02), mass=MASS), position=(RADIUS, 0, 0.02), name="yoke")
    scene.add(c.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1), name="bearing"))
    scene.add(c.Translational.at(scene.ground, yoke, point=(RADIUS, 0, 0.02), axis=(1, 0, 0), name="guide"))
    scene.add(c.PlaneContact.at(wheel, yoke, point=(RADIUS, 0, 0), normal=(1, 0, 0), name="slot"))
    hook = {"point_a": (0, 0, 0.02), "stiffness": STIFFNESS, "free_length": 0.0}
    scene.add(ts.forces.Spring(scene.ground, yoke, **hook, name="spring"))
    return scene


def reference(times):
    """The wheel's angle by SciPy at 1e-12, rad (k,)."""

    def rates(t, y):
        sine, both = np.sin(y[0]), np.sin(y[0]) * np.cos(y[0]) * RADIUS**2
        return [y[1], both * (STIFFNESS - MASS * y[1] ** 2) / (INERTIA + MASS * (RADIUS * sine) ** 2)]

    return solve_ivp(rates, (0.0, times[-1]), [0.0, RATE], "DOP853", times, rtol=1e-12, atol=1e-12).y[0]


def check(solution, tol=1e-8):
    """The slider is at r cos(angle) to rounding, the angle as SciPy says."""
    solution.raise_if_failed()
    angle, x = solution.angle("bearing"), solution.position("yoke")[:, 0]
    assert np.abs(x - RADIUS * np.cos(angle)).max() < 1e-15
    assert np.abs(angle - reference(solution.t)).max() < tol


def main():
    """Run it for 2 s and print how uneven the wheel turns."""
    solution = ts.simulate(build(), (0.0, 2.0), rtol=1e-10, atol=1e-10)
    check(solution)
    print(solution)
    rate = solution.angle_rate("bearing")
    print(f"  the wheel turns at {rate.min():.3f} to {rate.max():.3f} rad/s")


if __name__ == "__main__":
    main()
