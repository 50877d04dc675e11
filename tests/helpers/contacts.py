"""Scenes that open and close: a bouncing ball, a box on its corners, a pendulum with a stop."""

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

import tsdyn as ts

C = ts.constraints
G = 9.81


def bouncing(e, height=1.0, vx=1.0):
    scene = ts.Scene(gravity=(0, 0, -G))
    ball = scene.add_point_mass(mass=0.5, position=(0, 0, height), velocity=(vx, 0, 0), name="ball")
    contact = {"normal_b": (0, 0, 1), "unilateral": True, "restitution": e, "name": "floor"}
    scene.add(C.PlaneContact(ball, scene.ground, **contact))
    return scene, np.sqrt(2 * height / G)


def pendulum(e):
    scene = ts.Scene(gravity=(0, 0, -G))
    bar = scene.add_body(mass=2.0, inertia=(0.2, 0.2, 0.01), position=(0, 0, -1), name="bar")
    hinge = scene.add(C.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    scene.set(hinge, angle=1.0)
    scene.add(C.Stop(hinge, lower=0.0, restitution=e, name="stop"))
    return scene, 4 * ellipk(np.sin(0.5) ** 2) / np.sqrt(2.0 * G / 2.2)


def box(tilt, e, spin=(0, 0, 0)):
    scene, size = ts.Scene(gravity=(0, 0, -G)), np.array([1.0, 0.6, 0.4])
    orientation = Rotation.from_euler("xyz", (tilt, 0.7 * tilt, 0.3))
    solid = ts.shapes.box(size, mass=2.0)
    body = scene.add_body(**solid, position=(0, 0, 1.0), orientation=orientation, angular_velocity=spin, name="box")
    for i in range(8):
        corner = size / 2 * [2 * (i & 1) - 1, (i & 2) - 1, (i & 4) / 2 - 1]
        contact = {"normal_b": (0, 0, 1), "unilateral": True, "restitution": e, "name": f"corner {i}"}
        scene.add(C.PlaneContact(body, scene.ground, point_a=corner, **contact))
    return scene
