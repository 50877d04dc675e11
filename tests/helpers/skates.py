"""Scenes with rows on velocities: skates, carriages and a conveyor, with closed forms where there are any."""

import numpy as np

import tsdyn as ts
from tsdyn.plugins import Motion

C = ts.constraints
SLOPE, TURN = 5.0, 1.3  # m/s^2 along x, rad/s


class Conveyor(ts.Primitive):
    """A plug-in: a point of a has a given velocity along a direction of b; b of A xd + b is minus the speed."""

    rate_rows = 1
    markers = (ts.Point("a"), ts.Vector("b"))
    prescribed = "speed"

    def __init__(self, a, b, *, speed=1.0, **places):
        super().__init__(a, b, **places)
        self.speed = speed

    def parameters(self):
        return Motion.places(self.speed)

    @staticmethod
    def rate(x, xd, par, t, out):
        out[0] = x[3] * xd[0] + x[4] * xd[1] + x[5] * xd[2] - par[0]

    @staticmethod
    def rate_jacobian(x, par, t, out):
        for i in range(3):
            out[0, i] = x[3 + i]

    @staticmethod
    def rate_gamma(x, xd, par, t, out):
        out[0] = xd[3] * xd[0] + xd[4] * xd[1] + xd[5] * xd[2] - par[1]

    @staticmethod
    def series(x, par, k, s, out):
        for i in range(3):
            out[0, i] = x[3 + i]

    @staticmethod
    def series_t(x, par, k, s, out):
        out[0] = -s[0][k]


def skate():
    """A skate that turns at a constant rate on a slope down x; see `skate_at`."""
    scene = ts.Scene(gravity=(SLOPE, 0, 0))
    skate = scene.add_body(1.0, (1, 1, 1), angular_velocity=(0, 0, TURN), name="skate")
    scene.add(C.KnifeEdge(skate, scene.ground, axis_a=(0, 1, 0), normal_b=(0, 0, 1), name="edge"))
    return scene


def skate_at(t):
    """x, y (m) and their rates: along the blade the speed is g sin(w t) / w."""
    speed, c, s = SLOPE * np.sin(TURN * t) / TURN, np.cos(TURN * t), np.sin(TURN * t)
    far = SLOPE / (2.0 * TURN**2)
    return far * s * s, far * (TURN * t - s * c), speed * c, speed * s


def sleigh(count=1):
    """A sleigh on three points and a blade, or on several in a line across, with a rod that swings below it."""
    scene = ts.Scene()
    v, w = (1.0, 0.21, 0.0), 0.7
    sleigh = scene.add_body(2.0, (0.3, 0.4, 0.5), velocity=v, angular_velocity=(0, 0, w), name="sleigh")
    for point in ((1, 0, 0), (-1, 1, 0), (-1, -1, 0)):
        scene.add(C.PlaneContact(sleigh, scene.ground, point_a=point, normal_b=(0, 0, 1)))
    for i in range(count):  # the row of each further blade follows from the first one's
        places = {"point_a": (-0.3, 0.5 * i, 0), "axis_a": (0, 1, 0), "normal_b": (0, 0, 1)}
        scene.add(C.KnifeEdge(sleigh, scene.ground, name=f"edge {i}", **places))
    swing = {"velocity": (1.0, 0.35, 0.0), "angular_velocity": (0, 0, 0.3)}
    rod = scene.add_body(0.5, (0.02, 0.02, 0.01), position=(0.2, 0, -0.5), name="rod", **swing)
    scene.add(C.Spherical(sleigh, rod, point_a=(0.2, 0, 0), point_b=(0, 0, 0.5)))
    return scene


def guided():
    """A carriage on a rail whose blade follows from the rail, with a rod that swings below it."""
    scene = ts.Scene(gravity=(3, 0, -9.81))
    carriage = scene.add_body(2.0, (0.3, 0.4, 0.5), velocity=(1, 0, 0), name="carriage")
    scene.add(C.Translational.at(carriage, scene.ground, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(C.KnifeEdge(carriage, scene.ground, axis_a=(0, 1, 0), normal_b=(0, 0, 1), name="edge"))
    rod = scene.add_body(0.5, (0.02, 0.02, 0.01), position=(0, 0, -0.5), velocity=(1, 0, 0), name="rod")
    scene.add(C.Spherical(carriage, rod, point_b=(0, 0, 0.5)))
    return scene


def on_a_table():
    """A skate on a table that turns on a hinge: a plane of a body that moves."""
    scene = ts.Scene()
    table = scene.add_body(5.0, (1, 1, 2), angular_velocity=(0, 0, 0.8), name="table")
    scene.add(C.Revolute.at(table, scene.ground, point=(0, 0, 0), axis=(0, 0, 1)))
    v = (0.5, 0.8, 0.0)  # 0.5 m/s along the blade, relative to the table
    skate = scene.add_body(
        1.0, (0.1, 0.1, 0.2), position=(1, 0, 0), velocity=v, angular_velocity=(0, 0, 1), name="skate"
    )
    for point in ((0.1, 0, 0), (-0.1, 0.1, 0), (-0.1, -0.1, 0)):
        scene.add(C.PlaneContact(skate, table, point_a=point, normal_b=(0, 0, 1)))
    scene.add(C.KnifeEdge(skate, table, axis_a=(0, 1, 0), normal_b=(0, 0, 1), name="edge"))
    return scene


def belt(speed):
    """A box that a conveyor takes along x, a number or a motion, with a rod that swings below it."""
    scene, first = ts.Scene(), speed if isinstance(speed, float) else speed(0.0)
    box = scene.add_body(1.0, (0.1, 0.2, 0.3), velocity=(first, 0, 0), angular_velocity=(0.3, 2.0, 0.1), name="box")
    scene.add(Conveyor(box, scene.ground, axis_b=(1, 0, 0), speed=speed, name="belt"))
    rod = scene.add_body(0.5, (0.02, 0.02, 0.01), position=(0, 0, -0.5), velocity=(first, 0, 0), name="rod")
    scene.add(C.Spherical(box, rod, point_b=(0, 0, 0.5)))
    return scene


def beside_hinges():
    """A ball that rolls, beside a pendulum of three links, the second of which has its hinge twice."""
    scene = ts.Scene()
    links = [scene.ground]
    for i in range(3):
        places = {"position": (i + 0.5, 0, 0), "velocity": (0, 0, -0.5 - i), "angular_velocity": (0, 1, 0)}
        links.append(scene.add_body(1.0, (0.2, 0.3, 0.4), **places))
        for y in (0.0, 1.0) if i == 1 else (0.0,):
            scene.add(C.Revolute.at(links[i], links[i + 1], point=(i, y, 0), axis=(0, 1, 0)))
    ball = scene.add_body(1.0, (0.1, 0.1, 0.1), (0, 5, 0.5), velocity=(1, 0, 0), angular_velocity=(0, 2, 0))
    scene.add(C.RollingBall(ball, scene.ground, radius=0.5, normal_b=(0, 0, 1)))
    return scene


def rough():
    """A sleigh on three points and a blade; a rod swings below it on a hinge whose friction depends on its reaction."""
    scene = ts.Scene()
    sleigh = scene.add_body(2.0, (0.3, 0.4, 0.5), velocity=(1, 0, 0), name="sleigh")
    for point in ((1, 0, 0), (-1, 1, 0), (-1, -1, 0)):
        scene.add(C.PlaneContact(sleigh, scene.ground, point_a=point, normal_b=(0, 0, 1)))
    scene.add(C.KnifeEdge(sleigh, scene.ground, point_a=(-0.3, 0, 0), axis_a=(0, 1, 0), normal_b=(0, 0, 1)))
    axis, w = np.array([0.3, 1.0, 0.0]), 2.0
    spin = w * axis / np.linalg.norm(axis)
    swing = {"velocity": np.add(np.cross(spin, (0, 0, -0.5)), (1, 0, 0)), "angular_velocity": spin}
    rod = scene.add_body(0.5, (0.02, 0.02, 0.01), position=(0.2, 0, -0.5), name="rod", **swing)
    hinge = scene.add(C.Revolute.at(sleigh, rod, point=(0.2, 0, 0), axis=axis, name="hinge"))
    scene.add(ts.forces.RevoluteFriction(hinge, kinetic=0.05, radius=0.05, slip_velocity=0.1))
    return scene
