"""A motor drives a wheel through a flexible shaft, against a friction brake and a weight on a spring at the rim.

Forces of several kinds: a torque as a function of time, a torsional spring and damper, Coulomb friction, a spring. The
check is the energy balance: energy minus the work of motor, damper and brake is constant.

Run it: python examples/drive_train.py
"""

import numpy as np

import tsdyn as ts

AXIS = (0.0, 1.0, 0.0)


def torque(t):
    """Torque of the motor, N m, ground frame: it swells and fades in two seconds."""
    return (0.0, 8.0 * np.sin(0.5 * np.pi * t) ** 2, 0.0)


def bearing(scene, body):
    """Let a body turn about its own y axis on the ground."""
    name = f"bearing of {body.name}"
    scene.add(ts.constraints.Revolute.at(scene.ground, body, point=body.position, axis=AXIS, name=name))


def build():
    """Return the scene."""
    scene = ts.Scene()
    rotor = scene.add_body(2.0, (0.02, 0.03, 0.02), position=(0.0, -0.5, 0.0), name="rotor")
    wheel = scene.add_body(5.0, (0.15, 0.25, 0.15), name="wheel")
    weight = scene.add_point_mass(1.5, position=(0.3, 0.0, -0.4), name="weight")
    bearing(scene, rotor)
    bearing(scene, wheel)
    scene.add(ts.forces.Torque(rotor, torque=torque, name="motor"))
    scene.add(
        ts.forces.TorsionalSpring(
            rotor,
            wheel,
            axis_a=AXIS,
            reference_a=(1, 0, 0),
            reference_b=(1, 0, 0),
            stiffness=40.0,
            damping=0.2,
            name="shaft",
        )
    )
    scene.add(ts.forces.CoulombFriction(wheel, scene.ground, torque=1.0, slip_rate=0.05, name="brake"))
    scene.add(ts.forces.Spring(wheel, weight, point_a=(0.3, 0, 0), stiffness=400.0, damping=2.0, name="cord"))
    return scene


def check(solution):
    """The balance of energy and work, and the shaft's torque against the rotor's equation of motion."""
    solution.raise_if_failed()
    moments = solution.reaction("motor")[1][:, 1] + solution.reaction("shaft")[1][:, 1]
    rates = 0.03 * solution.angle_acceleration("bearing of rotor")
    assert np.abs(moments - rates).max() < 1e-9 * np.abs(rates).max()
    balance = solution.energy - solution.work
    assert np.ptp(balance) < 1e-6 * np.ptp(solution.energy)
    assert solution.dissipation.min() >= 0.0


def main():
    """Run it for 4 s and print where the motor's work has gone."""
    solution = ts.simulate(build(), (0.0, 4.0), rtol=1e-9, atol=1e-9, dense_output=True)
    check(solution)
    print(solution)
    speed = np.abs(solution.angle_rate("bearing of wheel")).max()
    print(f"  the wheel turns at up to {speed:.2f} rad/s")
    for name in ("motor", "shaft", "brake", "cord"):
        print(f"  work of the {name:6}{solution.work_of(name)[-1]:14.9f} J")
    print(f"  gain in energy    {solution.energy[-1] - solution.energy[0]:14.9f} J")


if __name__ == "__main__":
    main()
