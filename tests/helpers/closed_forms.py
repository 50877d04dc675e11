"""Scenes whose motion is known in closed form, by elliptic integrals, with the times of their events."""

import numpy as np
from scipy.special import ellipk

import tsdyn as ts
from tests.helpers.tolerances import HELD

C = ts.constraints
GRAVITY, LENGTH, ANGLE = 9.81, 0.7, 2.0  # m/s^2, m, rad


def point_pendulum(angle=ANGLE):
    """A point mass on a rod in the x-z plane, at rest at an angle from below; and its quarter period, s."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    bob = scene.add_point_mass(1.3, position=(LENGTH * np.sin(angle), 0.0, -LENGTH * np.cos(angle)), name="bob")
    scene.add(C.Distance(bob, scene.ground, length=LENGTH))
    scene.assemble()
    return scene, ellipk(np.sin(angle / 2) ** 2) * np.sqrt(LENGTH / GRAVITY)


def compound_pendulum(angle=ANGLE):
    """A rigid body on a revolute joint along y, made of Spherical and two Dot1; and its quarter period, s."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    mass, inertia = 2.0, (0.3, 0.4, 0.5)
    body = scene.add_body(
        mass,
        inertia,
        position=(LENGTH * np.sin(angle), 0.0, -LENGTH * np.cos(angle)),
        orientation=(np.cos(angle / 2), 0.0, -np.sin(angle / 2), 0.0),
        name="body",
    )
    scene.add(C.Spherical(body, scene.ground, point_a=(0.0, 0.0, LENGTH)))
    for axis in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)):
        scene.add(C.Dot1(body, scene.ground, axis_a=axis, axis_b=(0.0, 1.0, 0.0)))
    scene.assemble()
    rate = np.sqrt(mass * GRAVITY * LENGTH / (mass * LENGTH**2 + inertia[1]))
    return scene, ellipk(np.sin(angle / 2) ** 2) / rate


def heavy_top(tilt=0.5, spin=40.0, precession=1.5):
    """A symmetric top on a fixed tip, nutating from an extreme of its tilt; and half the period of that, s.

    (du/dt)^2 = a (u - u1) (u - u2) (u - u3), u = cos(tilt), a = 2 m g l / I1, from energy and both momenta.
    """
    mass, l, j1, j3 = 1.0, 0.5, 0.1, 0.08
    I1 = j1 + mass * l**2
    axis = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    # body frame: x' in the plane of the axis, y' = y; precession about z, spin about the axis
    omega = np.array([-precession * np.sin(tilt), 0.0, spin + precession * np.cos(tilt)])
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    top = scene.add_body(
        mass,
        (j1, j1, j3),
        position=l * axis,
        orientation=(np.cos(tilt / 2), 0.0, np.sin(tilt / 2), 0.0),
        velocity=np.cross([0.0, 0.0, precession], l * axis),
        angular_velocity=omega,
        name="top",
    )
    scene.add(C.Spherical(top, scene.ground, point_a=(0.0, 0.0, -l)))
    u0, n = np.cos(tilt), omega[2]
    b, c = j3 * n, I1 * precession * np.sin(tilt) ** 2 + j3 * n * u0  # momenta along the axis and the vertical
    a = 2.0 * mass * GRAVITY * l / I1
    e = precession**2 * np.sin(tilt) ** 2 + a * u0
    u = np.polynomial.Polynomial([0.0, 1.0])
    cubic = (e - a * u) * (1.0 - u**2) - (c - b * u) ** 2 / I1**2
    u1, u2, u3 = np.sort(cubic.roots().real)
    assert min(abs(u0 - u1), abs(u0 - u2)) < HELD
    return scene, 2.0 / np.sqrt(a * (u3 - u1)) * ellipk((u2 - u1) / (u3 - u1))
