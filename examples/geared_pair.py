"""A geared pair: a pinion drives a wheel against a torsional spring, over many turns of the pinion.

    bearings  Revolute, ground and pinion, ground and wheel    10 rows
    teeth     Gear, pinion and wheel                            1 row: 11 for 12 degrees of freedom

With ratio = -R1 / R2 it is an oscillator in the pinion angle theta, from rest:

    (J1 + ratio^2 J2) thetadd + k ratio^2 theta = torque

Run it: python examples/geared_pair.py
"""

import numpy as np

import tsdyn as ts

R1, R2 = 0.05, 0.31  # m, pitch radii
RATIO = -R1 / R2
J1, J2 = 0.001, 0.15  # kg m^2 about the axes
STIFFNESS, TORQUE = 6.0, 4.0  # N m/rad, N m


def build():
    """Return the scene at rest: axes along y, the wheel's spring relaxed."""
    scene = ts.Scene()
    pinion = scene.add_body(0.8, (0.001, J1, 0.001), position=(0.0, 0.0, 0.0), name="pinion")
    wheel = scene.add_body(12.0, (0.1, J2, 0.1), position=(0.0, 0.0, R1 + R2), name="wheel")
    for body in (pinion, wheel):
        joint = ts.constraints.Revolute.at(
            scene.ground, body, point=body.position, axis=(0, 1, 0), name=f"bearing of the {body.name}"
        )
        scene.add(joint)
    scene.add(
        ts.constraints.Gear.at(
            pinion, wheel, point_a=pinion.position, point_b=wheel.position, axis=(0, 1, 0), ratio=RATIO, name="teeth"
        )
    )
    scene.add(
        ts.forces.TorsionalSpring(
            scene.ground, wheel, axis_a=(0, 1, 0), reference_a=(1, 0, 0), reference_b=(1, 0, 0), stiffness=STIFFNESS
        )
    )
    scene.add(ts.forces.Torque(pinion, torque=(0.0, TORQUE, 0.0), name="motor"))
    return scene


def reference(times):
    """The pinion's turn and its angular acceleration, (k,) each."""
    inertia, stiffness = J1 + RATIO**2 * J2, STIFFNESS * RATIO**2
    w = np.sqrt(stiffness / inertia)
    return TORQUE / stiffness * (1.0 - np.cos(w * times)), TORQUE / inertia * np.cos(w * times)


def turn(solution, name):
    """The turn of a body about y, rad, counted over turns."""
    return solution.angle(f"bearing of the {name}")


def check(solution, tol=1e-9):
    """The turns to tol, their ratio to rounding, the torque through the teeth to 1e3 tol of itself."""
    solution.raise_if_failed()
    theta, gain = reference(solution.t)
    pinion, wheel = turn(solution, "pinion"), turn(solution, "wheel")
    assert np.abs(pinion - theta).max() < tol * max(1.0, np.abs(theta).max())
    assert np.abs(wheel - RATIO * pinion).max() < 1e-12
    _, torque = solution.reaction("teeth", on="pinion")
    through = J1 * gain - TORQUE
    assert np.abs(torque[:, 1] - through).max() < 1e3 * tol * np.abs(through).max()
    assert solution.constraint_error.position.max() < 1e-13


def main():
    """Run it for 1.5 s and print how far both turn."""
    solution = ts.simulate(build(), (0.0, 1.5), integrator=ts.integrators.DOP853(rtol=1e-11, atol=1e-11))
    check(solution)
    print(solution)
    for name in ("pinion", "wheel"):
        print(f"  {np.ptp(turn(solution, name)) / (2.0 * np.pi):.2f} turns of the {name}")
    print(
        f"  distance from the closed form {np.abs(turn(solution, 'pinion') - reference(solution.t)[0]).max():.1e} rad"
    )


if __name__ == "__main__":
    main()
