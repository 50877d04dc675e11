"""A heavy top whose tip slides on a plane without friction (Haug 2018, section 7.1), nutating or asleep.

Run it: python examples/top.py
"""

import numpy as np

import tsdyn as ts


def build(angular_velocity=(0.5, 0.0, 12.0)):
    """Return the scene: 30 kg, upright on its tip, with a spin about its own axis in rad/s."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.6))
    top = scene.add_body(
        mass=30.0, inertia=(90.0, 90.0, 30.0), position=(0.0, 0.0, 1.0), angular_velocity=angular_velocity, name="top"
    )
    scene.add(
        ts.constraints.PlaneContact(top, scene.ground, point_a=(0.0, 0.0, -1.0), normal_b=(0.0, 0.0, 1.0), name="tip")
    )
    return scene


def build_sleeping(spin=10.0):
    """Return the sleeping top: upright but for 1e-12 rad/s; it stays up for a spin above sqrt(115.2) = 10.73 rad/s."""
    return build((1e-12, 1e-12, spin))


def tilt(solution):
    """Angle between the top's axis and the vertical, rad."""
    axis = solution.rotation(solution.scene.body("top"))[:, :, 2]
    return np.arctan2(np.linalg.norm(axis[:, :2], axis=1), axis[:, 2])


def check(solution):
    """Constraints at rounding; energy, momenta along the plane and about the vertical conserved."""
    assert solution.success, solution.message
    errors = [error.max() for error in solution.constraint_error]
    assert np.less(errors, (1e-14, 1e-13, 5e-12)).all(), errors
    assert np.ptp(solution.energy) < 1e-6 * abs(solution.energy[0])
    assert np.abs(solution.linear_momentum[:, :2]).max() < 1e-10
    assert np.ptp(solution.angular_momentum[:, 2]) < 1e-6 * solution.angular_momentum[0, 2]


def main():
    """Run the lively top for 10 s and the sleeping tops for 60 s."""
    lively = ts.simulate(build(), (0.0, 10.0), integrator=ts.integrators.Nystrom4(step=1e-3))
    check(lively)
    print(lively)
    print(f"  largest tilt {np.degrees(tilt(lively).max()):.1f} degrees")
    for spin in (10.0, 11.5):
        asleep = ts.simulate(
            build_sleeping(spin), (0.0, 60.0), integrator=ts.integrators.Nystrom4(step=1e-3), t_eval=np.arange(61.0)
        )
        print(f"  spin {spin:4.1f} rad/s: tilt at 30 s {tilt(asleep)[30]:.2e} rad, at 60 s {tilt(asleep)[60]:.2e} rad")


if __name__ == "__main__":
    main()
