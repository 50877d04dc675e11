"""A slider-crank whose slider has play in its guide: restitution and friction (Flores, Leine and Glocker 2010).

    crank, rod   on hinges, in the plane of x and z
    slider       on a hinge of the rod; its four corners touch the walls of the guide, 1 mm away

The crank starts at 150 rad/s, and isn't driven. The slider is thrown from wall to wall, slides along them on one corner
or two, and tilts: energy goes with impacts and friction.

Run it: python examples/clearance.py
"""

import numpy as np

import tsdyn as ts

GRAVITY = 9.81  # m/s^2
CRANK, ROD = 0.153, 0.306  # m: lengths; the centroids are in the middle
MASSES, INERTIAS = (0.038, 0.038, 0.076), (7.4e-5, 5.9e-4, 2.7e-6)  # kg, kg m^2: crank, rod, slider
HALF_LENGTH, HALF_HEIGHT, PLAY = 0.05, 0.025, 0.001  # m: of the slider
RESTITUTION, FRICTION = 0.4, 0.01
RATES = 150.0, -75.0, 0.0  # rad/s: crank, rod, slider
AXIS = np.array([0.0, -1.0, 0.0])  # angles count from x to z
CORNERS = {"low left": (-1, -1), "low right": (1, -1), "high left": (-1, 1), "high right": (1, 1)}


def build(friction=FRICTION, restitution=RESTITUTION):
    """All in line, the slider in the middle of its guide."""
    scene, x, speed = ts.Scene(gravity=(0, 0, -GRAVITY)), 0.0, 0.0
    last, C = scene.ground, ts.constraints
    for name, length, m, J, rate in zip(
        ("crank", "rod", "slider"), (CRANK, ROD, 0), MASSES, INERTIAS, RATES, strict=True
    ):
        middle = speed + rate * length / 2
        body = scene.add_body(
            m, (J,) * 3, (x + length / 2, 0, 0), velocity=(0, 0, middle), angular_velocity=rate * AXIS, name=name
        )
        scene.add(C.Revolute.at(last, body, point=(x, 0, 0), axis=AXIS, name=f"{name} hinge"))
        last, x, speed = body, x + length, speed + rate * length
    law = {"unilateral": True, "restitution": restitution, "kinetic": friction}
    for name, (right, up) in CORNERS.items():
        corner, wall = (right * HALF_LENGTH, 0, up * HALF_HEIGHT), (x, 0, up * (HALF_HEIGHT + PLAY))
        scene.add(
            C.PlaneContact(last, scene.ground, point_a=corner, point_b=wall, normal_b=(0, 0, -up), **law, name=name)
        )
    return scene


def offset(solution):
    """Height of the slider's centre over the play (k,): at 1 and -1 both corners of a side touch."""
    return solution.position("slider")[:, 2] / PLAY


def check(solution):
    """The slider stays within its guide; it hits both walls; energy goes with impacts and friction alone."""
    solution.raise_if_failed()
    assert np.abs(offset(solution)).max() < 1.0 + 1e-9
    assert {name for _, name, _ in solution.impulses} == {*CORNERS}
    assert np.ptp(solution.energy - solution.work) < 1e-7 * solution.energy[0]
    assert solution.energy[-1] < 0.97 * solution.energy[0]


def main():
    """A turn of the crank and a half."""
    solution = ts.simulate(build(), (0.0, 0.1), rtol=1e-10, atol=1e-10, dense_output=True)
    check(solution)
    print(solution)
    lost = 1.0 - solution.energy[-1] / solution.energy[0]
    print(f"{len(solution.impulses)} impulses, {100 * lost:.1f} % of the energy lost")


if __name__ == "__main__":
    main()
