"""Stacks of boxes with Coulomb friction at their corners."""

import numpy as np

import tsdyn as ts

C = ts.constraints
G = 10.0
FLOOR = {"normal_b": (0, 0, 1), "unilateral": True}


def boxes(count, angle=0.0, mu=0.5, size=(0.6, 0.4, 0.2), velocity=(0, 0, 0), spin=0.0):
    """A stack, each box on four corners, on a slope of this angle."""
    scene = ts.Scene(gravity=(G * np.sin(angle), 0, -G * np.cos(angle)))
    size, below = np.array(size), scene.ground
    for i in range(count):
        start = {"velocity": velocity, "angular_velocity": (0, 0, spin)}
        middle = (0, 0, (i + 0.5) * size[2])
        box = scene.add_body(**ts.shapes.box(size, mass=1.0), position=middle, **start, name=f"{i}")
        top = (0, 0, 0.0 if below is scene.ground else size[2] / 2)
        for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            corner = np.array([x, y, -1]) * size / 2
            scene.add(C.PlaneContact(box, below, point_a=corner, point_b=top, **FLOOR, kinetic=mu))
        below = box
    return scene
