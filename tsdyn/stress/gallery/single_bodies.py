"""One body each: a sleeping top, Kapitza's pendulum, upside down on a pivot that shakes, and one that is struck."""

import numpy as np

from ...constraints import PlaneContact, PointDriver, Revolute
from ...forces import Torque
from ...motions import Sine, time
from ...simulation.scene import Scene

HEIGHT, FREQUENCY = 0.05, 120.0  # m, rad/s: of Kapitza's pivot
STRUCK, WIDTH = 61.8, 0.05  # s: when a pendulum is struck, and for how long


def sleeping_top(spin=11.5):
    """Return a heavy top upright on its tip, which slides: unstable for spins below sqrt(115.2) = 10.73 rad/s."""
    scene = Scene(gravity=(0.0, 0.0, -9.6))
    top = scene.add_body(30.0, (90.0, 90.0, 30.0), (0.0, 0.0, 1.0), angular_velocity=(1e-12, 1e-12, spin), name="top")
    scene.add(PlaneContact(top, scene.ground, point_a=(0.0, 0.0, -1.0), normal_b=(0.0, 0.0, 1.0), name="tip"))
    return scene


def kapitza(start=0.3, length=0.5):
    """Return a rod upside down, off by an angle, on a pivot that shakes by HEIGHT cos(FREQUENCY t): it stays up."""
    scene = Scene()
    rod = scene.add_body(
        1.0,
        (0.1, 0.1, 0.02),
        (length * np.sin(start), 0.0, HEIGHT + length * np.cos(start)),
        (np.cos(start / 2), 0.0, np.sin(start / 2), 0.0),
        name="rod",
    )
    path = 0.0, 0.0, Sine(HEIGHT, FREQUENCY, phase=np.pi / 2)
    scene.add(PointDriver(scene.ground, rod, point_b=(0.0, 0.0, -length), path=path, name="pivot"))
    return scene


def struck():
    """Return a pendulum that swings slowly, until a bump of torque strikes it."""
    scene = Scene(gravity=(0.0, 0.0, -0.01))
    rod = scene.add_body(1.0, (0.1, 0.1, 0.02), (0.1, 0.0, -0.49), (np.cos(0.1), 0.0, -np.sin(0.1), 0.0), name="rod")
    scene.add(Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    bump = 4.0 * np.exp(-(((time - STRUCK) / WIDTH) ** 2))
    scene.add(Torque(rod, torque=(0.0, bump, 0.0), name="strike"))
    return scene
