"""Two spheres: one rotates about its fixed centre, the other hangs from it on a massless rod (Haug 2018, section 7.2).

Run it: python examples/two_body_pendulum.py
"""

import numpy as np

import tsdyn as ts


def build(angular_velocities=((0.0, 0.0, 0.0), (0.0, 5.0, 0.0))):
    """Return the scene; the paper's start is planar, ((0.3, 0, 0), (1, 5, 2)) makes a spatial motion."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.6))
    mass = 75.0
    inertia = (0.4 * mass,) * 3
    one = scene.add_body(mass, inertia, angular_velocity=angular_velocities[0], name="sphere 1")
    two = scene.add_body(
        mass, inertia, position=(0.0, 0.0, -3.0), angular_velocity=angular_velocities[1], name="sphere 2"
    )
    scene.add(ts.constraints.Spherical(scene.ground, one, name="centre"))
    scene.add(ts.constraints.Distance(one, two, point_a=(0, 0, -1), point_b=(0, 0, 1), length=1.0, name="rod"))
    return scene


def check(solution):
    """Constraints at rounding, energy conserved, sphere 1 where it is, angular momentum about the vertical kept."""
    assert solution.success, solution.message
    errors = [error.max() for error in solution.constraint_error]
    assert np.less(errors, (1e-14, 1e-13, 1e-12)).all(), errors
    assert np.ptp(solution.energy) < 1e-6 * abs(solution.energy[0])
    assert np.abs(solution.position("sphere 1")).max() < 1e-14
    assert np.ptp(solution.angular_momentum[:, 2]) < 1e-6 * np.abs(solution.angular_momentum).max()


def main():
    """Run the planar and the spatial motion for 10 s."""
    for start in (((0, 0, 0), (0, 5, 0)), ((0.3, 0, 0), (1, 5, 2))):
        solution = ts.simulate(build(start), (0.0, 10.0), integrator=ts.integrators.Nystrom4(step=1e-3))
        check(solution)
        force, _ = solution.reaction("rod")
        print(solution)
        print(f"  tension in the rod from {np.linalg.norm(force, axis=1).min():.0f} N", end=" ")
        print(f"to {np.linalg.norm(force, axis=1).max():.0f} N")


if __name__ == "__main__":
    main()
