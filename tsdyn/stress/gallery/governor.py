"""A flyball governor."""

import numpy as np

from ...constraints import Distance, Revolute, Translational
from ...forces import Spring
from ...simulation.scene import Scene


def governor(stiffness=300.0, damping=5.0):
    """Return a flyball governor: a spinning shaft, a sleeve on a damped spring, two balls."""
    scene, angle, arm, rate = Scene(), 0.6, 0.5, 8.0
    omega, low = (0.0, 0.0, rate), (0.0, 0.0, -2.0 * arm * np.cos(angle))
    shaft = scene.add_body(2.0, (0.02, 0.02, 0.01), angular_velocity=omega, name="shaft")
    sleeve = scene.add_body(1.0, (0.01, 0.01, 0.01), position=low, angular_velocity=omega, name="sleeve")
    scene.add(Revolute.at(scene.ground, shaft, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(Translational.at(shaft, sleeve, point=low, axis=(0, 0, 1)))
    for side in (1.0, -1.0):
        x = side * arm * np.sin(angle)
        ball = scene.add_body(
            3.0, (0.05, 0.06, 0.04), (x, 0.0, low[2] / 2), velocity=(0.0, rate * x, 0.0), angular_velocity=omega
        )
        scene.add(Revolute.at(shaft, ball, point=(0, 0, 0), axis=(0, 1, 0)))
        scene.add(Distance(ball, sleeve))
    scene.add(Spring(shaft, sleeve, stiffness=stiffness, damping=damping))
    return scene
