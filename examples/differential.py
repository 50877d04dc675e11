"""A differential: a cage drives two half-shafts, whose mean turn is that of the cage.

    bearings      Revolute, ground and each of three bodies              15 rows
    differential  Coupler: cage = (left + right) / 2, on crossed axes     1 row: 16 for 18 degrees of freedom

With the load L on the right shaft alone, torque T on the cage and J = Jc / 4:

    (Js + J) left'' + J right'' = T / 2,    J left'' + (Js + J) right'' = T / 2 - L

Run it: python examples/differential.py
"""

import numpy as np

import tsdyn as ts

CAGE, SHAFT = 0.08, 0.05  # kg m^2 about the axes
TORQUE, LOAD = 6.0, 2.0  # N m


def build():
    """Return the scene at rest: the cage about y, the half-shafts about x."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    joints = {}
    for name, x, axis, inertia in (
        ("cage", 0.0, (0, 1, 0), (0.1, CAGE, 0.1)),
        ("left", -0.4, (1, 0, 0), (SHAFT, 0.04, 0.04)),
        ("right", 0.4, (1, 0, 0), (SHAFT, 0.04, 0.04)),
    ):
        body = scene.add_body(5.0, inertia, position=(x, 0.0, 0.0), name=name)
        bearing = ts.constraints.Revolute.at(scene.ground, body, point=(x, 0, 0), axis=axis, name=f"{name} bearing")
        joints[name] = scene.add(bearing)
    scene.add(ts.constraints.Coupler(joints["cage"], joints["left"], joints["right"], ratio=0.5, name="differential"))
    scene.add(ts.forces.Torque(scene.body("cage"), torque=(0.0, TORQUE, 0.0), name="engine"))
    scene.add(ts.forces.Torque(scene.body("right"), torque=(-LOAD, 0.0, 0.0), name="load"))
    return scene


def gains():
    """The angular accelerations of the shafts, rad/s^2."""
    J = CAGE / 4.0
    return np.linalg.solve([[SHAFT + J, J], [J, SHAFT + J]], [TORQUE / 2.0, TORQUE / 2.0 - LOAD])


def turns(solution):
    """The turns of cage, left and right shaft, (3, k) rad."""
    return np.array([solution.angle(f"{name} bearing") for name in ("cage", "left", "right")])


def check(solution, tol=1e-9):
    """The turns to tol, their sum to rounding."""
    solution.raise_if_failed()
    cage, *shafts = turns(solution)
    for turn, gain in zip(shafts, gains(), strict=True):
        assert np.abs(turn - gain * solution.t**2 / 2.0).max() < tol * max(1.0, np.abs(turn).max())
    assert np.abs(cage - 0.5 * sum(shafts)).max() < 1e-12
    assert solution.constraint_error.position.max() < 1e-12


def main():
    """Run it for 2 s and print how far all turn."""
    solution = ts.simulate(build(), (0.0, 2.0))
    check(solution, 1e-6)
    print(solution)
    for name, turn in zip(("cage", "left shaft", "right shaft"), turns(solution)[:, -1] / (2.0 * np.pi), strict=True):
        print(f"  {turn:.2f} turns of the {name}")


if __name__ == "__main__":
    main()
