"""A symmetric top on its tip."""

import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.hanging_chains import DOWN, G


def spinning_top(theta, spin, precession, mass=2.0, arm=0.3, across=0.05, along=0.02):
    """A symmetric top on its tip in steady motion: spin is the angular velocity about its axis."""
    scene = ts.Scene(gravity=DOWN)
    tilt = Rotation.from_rotvec([0.0, theta, 0.0])
    axis = tilt.apply([0.0, 0.0, 1.0])
    omega = precession * np.array([0.0, 0.0, 1.0]) + (spin - precession * np.cos(theta)) * axis
    top = scene.add_body(
        mass, (across, across, along), arm * axis, tilt, np.cross(omega, arm * axis), tilt.inv().apply(omega), "top"
    )
    scene.add(ts.constraints.Spherical(top, scene.ground, point_a=(0, 0, -arm), point_b=(0, 0, 0)))
    return scene, across + mass * arm * arm, along, mass * G * arm
