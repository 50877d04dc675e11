"""A point mass on a rod whose length is a function of time."""

import numpy as np

import tsdyn as ts

C, I = ts.constraints, ts.integrators


def driven():
    """A point mass on a rod whose length is a function of time."""
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, (1.0, 0.0, 0.0), name="bead")
    motion = (lambda t: 1.0 + 0.2 * np.sin(3.0 * t), lambda t: 0.6 * np.cos(3.0 * t), lambda t: -1.8 * np.sin(3.0 * t))
    scene.add(C.Distance(bead, scene.ground, length=motion))
    scene.assemble()
    return scene
