"""Chains of equal planar pendulums, and their mass and stiffness in absolute angles."""

import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts

G = 9.81
DOWN = np.array([0.0, 0.0, -G])


def pendulums(angles, length=0.7, mass=1.3, inertia=0.02):
    """A chain of equal planar pendulums at absolute angles from the vertical, about y."""
    scene, top, before = ts.Scene(gravity=DOWN), np.zeros(3), None
    for i, angle in enumerate(angles):
        rotation = Rotation.from_rotvec([0.0, angle, 0.0])
        down = rotation.apply([0.0, 0.0, -length])
        body = scene.add_body(mass, (inertia, inertia, 1e-3), top + down / 2, rotation, name=f"link {i}")
        scene.add(ts.constraints.Revolute.at(before or scene.ground, body, point=top, axis=(0, 1, 0), name=f"pin {i}"))
        top, before = top + down, body
    return scene


def pendulum_matrices(count, length=0.7, mass=1.3, inertia=0.02):
    """M and K in absolute angles about the hanging position."""
    M = np.zeros((count, count))
    for j in range(count):
        arms = np.where(np.arange(count) < j, length, np.where(np.arange(count) == j, length / 2, 0.0))
        M += mass * np.outer(arms, arms)
    K = np.diag([mass * G * length * (count - j - 0.5) for j in range(count)])
    return M + inertia * np.eye(count), K
