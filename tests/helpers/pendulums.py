"""The physical pendulum, runs of fixed steps, and small vector algebra."""

import numpy as np
from scipy.linalg import expm

import tsdyn as ts

C = ts.constraints
GRAVITY = 9.6


def run(scene, end, step=1e-3, **options):
    integrator = ts.integrators.Nystrom4(step=step)
    return ts.simulate(scene, (0.0, end), integrator=integrator, **options).raise_if_failed()


def skew(a):
    return np.cross(np.eye(3), a)  # row i is e_i x a


def turn(axis_rate, t):
    """Rotation by axis_rate t."""
    return expm(skew(axis_rate) * t)


def size(x):
    return 1.0 + np.abs(x).max()


LENGTH, MASS, INERTIA = 0.8, 2.0, (0.3, 0.25, 0.1)


def pendulum(angle, joint="Spherical"):
    """A rigid pendulum in the plane y = 0, at rest at an angle from the vertical."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    body = scene.add_body(
        MASS,
        INERTIA,
        position=(LENGTH * np.sin(angle), 0.0, -LENGTH * np.cos(angle)),
        orientation=(np.cos(angle / 2), 0.0, -np.sin(angle / 2), 0.0),
    )
    hinge = scene.add(C.Spherical(body, scene.ground, point_a=(0.0, 0.0, LENGTH)))
    if joint == "hinge":
        for axis in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)):
            scene.add(C.Dot1(body, scene.ground, axis_a=(0.0, 1.0, 0.0), axis_b=axis))
    return scene, body, hinge


def pulled_straight():
    """Two links that a growing distance pulls straight: no motion goes beyond that."""
    scene = ts.Scene()
    knee = scene.add_point_mass(1.0, (0.6, 0.0, -0.8), name="knee")
    hand = scene.add_point_mass(1.0, (1.2, 0.0, 0.0), name="hand")
    scene.add(C.Distance(knee, scene.ground, name="upper"))
    scene.add(C.Distance(hand, knee, name="lower"))
    reach = (lambda t: 1.2 + 0.8 * t, lambda t: 0.8 + 0.0 * t, lambda t: 0.0 * t)
    scene.add(C.Distance(hand, scene.ground, length=reach, name="reach"))
    scene.assemble()
    return scene
