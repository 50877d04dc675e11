"""A rattleback: an ellipsoid whose axes of inertia are turned from its own. Spun the wrong way it turns back by itself.

The stone is that of Kane and Levinson (1982), Realistic mathematical modeling of the rattleback, Int. J. Non-Linear
Mechanics 17. It rolls without slip, so its energy is constant; its spin isn't.

Run it: python examples/rattleback.py
"""

import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts

AXES, LOW = (0.2, 0.03, 0.02), 0.01  # m: semi-axes; centroid below their centre
INERTIA = ((2e-4, -2e-5, 0), (-2e-5, 1.6e-3, 0), (0, 0, 1.7e-3))  # kg m^2, of a stone of 1 kg


def build(spin=-5.0):
    """The stone, tilted by half a degree, with a spin in rad/s about the vertical."""
    scene = ts.Scene()
    stone = scene.add_body(1.0, INERTIA, position=(0, 0, AXES[2] - LOW), name="stone")
    stone.orientation, stone.angular_velocity = Rotation.from_euler("x", 0.5, degrees=True), (0, 0, spin)
    places = {"center_a": (0, 0, LOW), "normal_b": (0, 0, 1), "name": "contact"}
    scene.add(ts.constraints.RollingEllipsoid(stone, scene.ground, semi_axes=AXES, **places))
    scene.assemble()
    return scene


def spin(solution):
    """About the vertical, rad/s."""
    return np.einsum("ki,ki->k", solution.rotation("stone")[:, 2], solution.angular_velocity("stone"))


def check(solution):
    """The spin is reversed, and no energy is lost."""
    solution.raise_if_failed()
    assert spin(solution)[0] < -4.9
    assert spin(solution)[-1] > 1.0
    assert np.ptp(solution.energy) < 1e-9
    assert solution.constraint_error.velocity.max() < 1e-13


def main():
    """Spin it both ways for 5 s."""
    for start in (-5.0, 5.0):
        solution = ts.simulate(build(start), (0.0, 5.0), rtol=1e-12, atol=1e-12).raise_if_failed()
        print(f"spin {start:g} rad/s, after 5 s {spin(solution)[-1]:.3f} rad/s")
        if start < 0.0:
            check(solution)
            print(solution)


if __name__ == "__main__":
    main()
