"""A planetary gear: sun, three planets on a carrier, and a fixed ring; one planet transmits, the others follow.

Willis' equation for the angular velocities of sun, ring and carrier, z being numbers of teeth:

    w_sun + (z_ring / z_sun) w_ring = (1 + z_ring / z_sun) w_carrier

A torque on the sun drives the carrier against a viscous load; it is one equation, of the reduced inertia.

Run it: python examples/planetary_gear.py
"""

import numpy as np

import tsdyn as ts

TEETH = {"sun": 24, "planet": 18, "ring": 60}
MODULE = 0.004  # m
RADII = {name: MODULE * z / 2 for name, z in TEETH.items()}
ARM = RADII["sun"] + RADII["planet"]
DRIVE, LOAD = 2.0, 0.8  # N m, N m s/rad
RATIO = 1.0 + TEETH["ring"] / TEETH["sun"]


def build():
    """Return the scene, at rest; axes are along z."""
    scene, c, z = ts.Scene(gravity=(0.0, 0.0, 0.0)), ts.constraints, (0, 0, 1)
    sun = scene.add_body(**ts.shapes.cylinder(RADII["sun"], 0.02, density=7850), name="sun")
    plate = ts.shapes.cylinder(1.3 * ARM, 0.01, density=7850)
    carrier = scene.add_body(**plate, position=(0, 0, -0.02), name="carrier")
    scene.add(c.Revolute.at(scene.ground, sun, point=(0, 0, 0), axis=z, name="sun bearing"))
    scene.add(c.Revolute.at(scene.ground, carrier, point=(0, 0, 0), axis=z, name="carrier bearing"))
    for i, angle in enumerate(2 * np.pi * np.arange(3) / 3):
        place = ARM * np.array([np.cos(angle), np.sin(angle), 0.0])
        planet = scene.add_body(
            **ts.shapes.cylinder(RADII["planet"], 0.02, density=7850), position=place, name=f"planet {i}"
        )
        scene.add(c.Revolute.at(carrier, planet, point=place, axis=z, name=f"pin {i}"))
        scene.add(c.Gear(sun, planet, axis_a=z, ratio=-TEETH["sun"] / TEETH["planet"], name=f"sun mesh {i}"))
        mesh = c.Gear(planet, scene.ground, axis_a=z, ratio=TEETH["planet"] / TEETH["ring"], name=f"ring mesh {i}")
        scene.add(mesh)
    scene.add(ts.forces.Torque(sun, torque=(0, 0, DRIVE), name="drive"))
    scene.add(ts.forces.ViscousFriction(carrier, scene.ground, torsional_damping=LOAD, name="load"))
    return scene


def reference(scene, t):
    """The carrier's angular velocity from rest, rad/s (k,)."""
    bodies = {body.name: body for body in scene.bodies}
    planet, inertia = bodies["planet 0"], {name: body.inertia[2, 2] for name, body in bodies.items()}
    spin = 1.0 - TEETH["ring"] / TEETH["planet"]  # of a planet, per angular velocity of the carrier
    reduced = inertia["carrier"] + RATIO**2 * inertia["sun"]
    reduced += 3 * (planet.mass * ARM**2 + spin**2 * inertia["planet 0"])
    return DRIVE * RATIO / LOAD * (1.0 - np.exp(-LOAD * t / reduced))


def rates(solution):
    """Angular velocities of sun and carrier, rad/s."""
    return (solution.angular_velocity(name)[:, 2] for name in ("sun", "carrier"))


def check(solution, tol=1e-7):
    """Willis' equation to rounding, the carrier's rate to tol, and the same number of turns."""
    solution.raise_if_failed()
    sun, carrier = rates(solution)
    expected = reference(solution.scene, solution.t)
    assert np.abs(carrier - expected).max() < tol * expected.max()
    assert np.abs(sun - RATIO * carrier).max() < 1e-12 * sun.max()
    turned = solution.angle("sun bearing") - RATIO * solution.angle("carrier bearing")
    assert np.abs(turned).max() < 1e-11


def main():
    """Run it for 0.5 s and print the speeds."""
    solution = ts.simulate(build(), (0.0, 0.5))
    check(solution)
    print(solution)
    sun, carrier = rates(solution)
    print(f"  sun {sun[-1]:.4f} rad/s, carrier {carrier[-1]:.4f} rad/s, ratio {sun[-1] / carrier[-1]:.12f}")


if __name__ == "__main__":
    main()
