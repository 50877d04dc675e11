"""A chain of N rods joined by spherical joints, released from horizontal with a sideways swing.

Run it: python examples/pendulum_chain.py [N]
"""

import sys

import numpy as np

import tsdyn as ts

LENGTH = 1.0


def build(links=4, swing=0.5):
    """Return the scene: rods of 1 m and 1 kg along x, turning at `swing` rad/s about the vertical through the pivot."""
    scene = ts.Scene()
    along_x = (np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0)  # turns the body's z axis to -x
    before = scene.ground
    for i in range(links):
        rod = scene.add_body(
            mass=1.0,
            inertia=(0.1, 0.1, 0.02),
            position=((i + 0.5) * LENGTH, 0.0, 0.0),
            orientation=along_x,
            velocity=(0.0, swing * (i + 0.5) * LENGTH, 0.0),
            angular_velocity=(swing, 0.0, 0.0),  # the ground's z axis is the body's x axis
            name=f"rod {i + 1}",
        )
        end = (0.0, 0.0, -LENGTH / 2) if i else (0.0, 0.0, 0.0)
        scene.add(
            ts.constraints.Spherical(before, rod, point_a=end, point_b=(0.0, 0.0, LENGTH / 2), name=f"joint {i + 1}")
        )
        before = rod
    return scene


def check(solution):
    """Constraints at rounding, energy and angular momentum about the vertical conserved."""
    assert solution.success, solution.message
    reach = 1.0 + np.abs(solution.q).max()
    error = solution.constraint_error
    assert error.position.max() < 1e-14 * reach
    assert error.velocity.max() < 1e-13 * (1.0 + np.abs(solution.qd).max())
    assert error.acceleration.max() < 1e-12 * (1.0 + np.abs(solution.qdd).max())
    assert np.ptp(solution.energy) < 1e-5 * np.ptp(solution.kinetic_energy)
    assert np.ptp(solution.angular_momentum[:, 2]) < 1e-6 * abs(solution.angular_momentum[0, 2])


def main():
    """Run a chain for one second."""
    links = int(sys.argv[1]) if len(sys.argv) > 1 else 4
    solution = ts.simulate(build(links), (0.0, 1.0), integrator=ts.integrators.Nystrom4(step=5e-4))
    check(solution)
    print(solution)
    print(f"  tip at {np.round(solution.position(solution.scene.bodies[-1])[-1], 6)} m")


if __name__ == "__main__":
    main()
