"""Joints of every class on two random bodies."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tsdyn.observables.evaluate import constraint_arrays

C = ts.constraints
X, Y, Z = np.eye(3)
NAN, INF = math.nan, math.inf


def build():
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1.0, 1.1, 1.2), position=(1.0, 0.0, 0.0), name="rod")
    arm = scene.add_body(1.0, (1.0, 1.1, 1.2), position=(3.0, 0.0, 0.0), name="arm")
    return scene, rod, arm


def posed(rng):
    scene, rod, arm = build()
    for body in (rod, arm):
        body.position, body.orientation = rng.normal(size=3), Rotation.random(random_state=rng)
    return scene, rod, arm


def made(kind, a, b, **arguments):
    """A joint on the x axis at x = 2, between rod and arm as `build` has them, or the ground."""
    geometry = {
        "Parallel": {"axis": X},
        "ConstantAngle": {"axis_a": X, "axis_b": Y},
        "Universal": {"point": (2, 0, 0), "axis": Z},
    }.get(kind, {"point": (2, 0, 0), "axis": X})
    return getattr(C, kind).at(a, b, **geometry, **arguments)


def residuals(scene):
    """Phi at the start, singular or not."""
    return constraint_arrays(scene.system, *scene.start, 0.0)[0]
