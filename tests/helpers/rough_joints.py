"""Scenes with friction in their joints, and what balances in them."""

import numpy as np

import tsdyn as ts
from tsdyn.plugins import direction_series, dot, root

C, F = ts.constraints, ts.forces
G = 9.81
PRECISE = {"integrator": "dop853", "rtol": 1e-11, "atol": 1e-11}


def coefficient(v, mu, static, stribeck, slip):
    return (mu + (static - mu) * np.exp(-((v / stribeck) ** 2))) * v / np.hypot(v, slip)


def block(mu, angle, speed=0.0, **more):
    """A point mass on an inclined plane."""
    scene = ts.Scene()
    along = np.array([np.cos(angle), 0.0, np.sin(angle)])
    body = scene.add_point_mass(2.0, velocity=speed * along)
    contact = scene.add(C.PlaneContact(body, scene.ground, normal_b=(-np.sin(angle), 0, np.cos(angle))))
    friction = scene.add(F.ContactFriction(contact, kinetic=mu, **more))
    return scene, body, contact, friction, along


def pendulum(mu=0.3, **more):
    """A bar that falls about a rough pin along y."""
    scene = ts.Scene()
    bar = scene.add_body(2.0, (0.2, 0.3, 0.25), position=(0.8, 0, 0), name="bar")
    pin = scene.add(C.Revolute(bar, scene.ground, point_a=(-0.8, 0, 0), axis_a=(0, 1, 0), axis_b=(0, 1, 0), name="pin"))
    given = {"static": 0.4, "slip_velocity": 0.01, "stribeck_velocity": 0.05} | more
    return scene, bar, pin, scene.add(F.RevoluteFriction(pin, radius=0.05, kinetic=mu, **given))


def pendulum_rates(t, y):
    """Minimal coordinates: the angle below the horizontal; the reaction by fixed-point iteration."""
    angle, rate = y
    c, s = np.cos(angle), np.sin(angle)
    mu, N = coefficient(0.05 * rate, 0.3, 0.4, 0.05, 0.01), 2.0 * G
    for _ in range(60):
        acceleration = (2.0 * G * 0.8 * c - 0.05 * mu * N) / (0.3 + 2.0 * 0.64)
        x, z = -0.8 * (s * acceleration + c * rate**2), -0.8 * (c * acceleration - s * rate**2)
        N = 2.0 * np.hypot(x, z + G)
    return rate, acceleration


def demand_balance(scene, solution, items, tol=1e-12):
    """Newton's and Euler's equations of every body, from the reactions of these constraints and forces."""
    for body in scene.bodies:
        force = body.mass * (np.array(scene.gravity) - solution.acceleration(body))
        torque = np.zeros_like(force)
        for item in items:
            if body not in (item.a, item.b):
                continue
            f, n = solution.reaction(item, on=body)
            force += f
            letter = "a" if body is item.a else "b"
            arm = getattr(item, f"point_{letter}", np.zeros(3))
            if body.dimension == 7:
                arm = solution.rotation(body) @ arm
                torque += n + np.cross(arm, f)
        assert np.abs(force).max() < tol * 100
        if body.dimension == 7:
            A, w = solution.rotation(body), solution.angular_velocity(body)
            spin = w @ body.inertia if np.ndim(body.inertia) == 2 else w * body.inertia
            change = solution.angular_acceleration(body) @ np.atleast_2d(body.inertia) + np.cross(w, spin)
            assert np.abs(np.einsum("kij,kj->ki", A, change) - torque).max() < tol * 100


def slide(length=None, width=None):
    """A slide that is pulled beside its guide, along x; the guide is the ground."""
    scene = ts.Scene()
    body = scene.add_body(2.0, (0.1, 0.2, 0.3), velocity=(1.5, 0, 0), name="slide")
    guide = scene.add(C.Translational(body, scene.ground, axis_a=(1, 0, 0), axis_b=(1, 0, 0), name="guide"))
    friction = scene.add(F.TranslationalFriction(guide, kinetic=0.25, slip_velocity=1e-6, length=length, width=width))
    scene.add(F.PointForce(body, point_a=(0, 0.2, 0.3), force=(6, 0, 4)))
    return scene, body, guide, friction


def chain(count, rough=True):
    """Links that hang from rough pins, spinning about skewed axes."""
    scene, rng = ts.Scene(), np.random.default_rng(3)
    last, joints = scene.ground, []
    for i in range(count):
        link = scene.add_body(1.0, (0.02, 0.03, 0.04), position=(0.4 * (i + 0.5), 0, 0), name=f"link{i}")
        axis = (0.3 * rng.normal(), 1.0, 0.3 * rng.normal())
        joints.append(scene.add(C.Revolute.at(link, last, point=(0.4 * i, 0, 0), axis=axis)))
        last = link
    if rough:
        for joint in joints:
            given = {"collar_radius": 0.02, "length": 0.05, "slip_velocity": 0.02}
            scene.add(F.RevoluteFriction(joint, radius=0.03, kinetic=0.3, static=0.5, **given))
    return scene, joints


def four_bar(rough_at=(0, 1, 2, 3), **more):
    """A planar four-bar of four revolutes: three rows too many."""
    scene = ts.Scene()
    points = np.array([(0, 0, 0), (0, 0, 0.3), (0.8, 0, 0.7), (0.9, 0, 0)])
    last, joints = scene.ground, []
    for i in range(3):
        a, b = points[i], points[i + 1]
        d = (b - a) / np.linalg.norm(b - a)
        half = 0.5 * np.arctan2(-d[2], d[0])
        link = scene.add_body(
            1.0 + i, (0.01, 0.1, 0.1), (a + b) / 2, (np.cos(half), 0, np.sin(half), 0), name=f"bar{i}"
        )
        joints.append(scene.add(C.Revolute.at(link, last, point=a, axis=(0, 1, 0), name=f"pin{i}")))
        last = link
    joints.append(scene.add(C.Revolute.at(last, scene.ground, point=points[3], axis=(0, 1, 0), name="pin3")))
    for i in rough_at:
        scene.add(F.RevoluteFriction(joints[i], radius=0.02, kinetic=0.2, slip_velocity=0.01, **more))
    return scene, joints


def rod(angle, mu, kind=F.ContactFriction):
    """A rod that slides over a plane on its lower end, leaning away from where it goes: Painleve's."""
    scene = ts.Scene()
    turn = (np.cos(-0.5 * angle), 0, np.sin(-0.5 * angle), 0)
    body = scene.add_body(
        1.0, (1e-3, 1 / 3, 1 / 3), (np.cos(angle), 0, np.sin(angle)), turn, velocity=(-3, 0, 0), name="rod"
    )
    scene.add(C.Planar.at(body, scene.ground, point=(0, 0, 0), axis=(0, 1, 0)))
    contact = scene.add(C.PlaneContact(body, scene.ground, point_a=(-1, 0, 0), normal_b=(0, 0, 1)))
    scene.add(kind(contact, kinetic=mu, slip_velocity=1e-4))
    return scene


class BallFriction(ts.JointFriction, ts.Force):
    """Friction of a ball joint in all directions: a plug-in."""

    joints = (C.Spherical,)
    markers = (ts.Point("a"), ts.Turn("a"), ts.Point("b"), ts.Turn("b"))
    quantities = {**ts.JointFriction.quantities, "radius": lambda value, *where: float(value)}  # noqa: RUF012

    def geometry(self):
        return (self.radius,)

    @staticmethod
    def law(x, xd, par, t, out):
        w0, w1, w2 = xd[3] - xd[9], xd[4] - xd[10], xd[5] - xd[11]
        v = par[5] * np.sqrt(w0 * w0 + w1 * w1 + w2 * w2 + (par[3] / par[5]) ** 2)
        n = -par[-1] * par[5] * par[5] * par[0] / v
        out[3], out[4], out[5] = n * w0, n * w1, n * w2
        out[9], out[10], out[11] = -n * w0, -n * w1, -n * w2

    @staticmethod
    def normal_load(x, f, par):
        return np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])

    @staticmethod
    def dissipation(x, xd, par, t):
        w0, w1, w2 = xd[3] - xd[9], xd[4] - xd[10], xd[5] - xd[11]
        ww = w0 * w0 + w1 * w1 + w2 * w2
        return par[-1] * par[5] * par[0] * ww / np.sqrt(ww + (par[3] / par[5]) ** 2)

    @classmethod
    def sizes(cls, rng):
        return {"radius": rng.uniform(0.5, 1.0)}


class SmoothBall(BallFriction):
    """The same with series."""

    slots = 10

    @staticmethod
    def series(x, xd, par, k, s, out):
        for i in range(3):
            s[i, k] = xd[3 + i] - xd[9 + i]
        n0, n1, n2 = direction_series(s, 0, 3, par[3] / par[5], k)
        f = -par[5] * par[0]
        out[3], out[4], out[5] = f * n0, f * n1, f * n2
        out[9], out[10], out[11] = -f * n0, -f * n1, -f * n2

    @staticmethod
    def normal_series(x, f, par, k, s):
        for i in range(3):
            s[5 + i, k] = f[i]
        s[8, k] = dot(s, 5, 5, k)
        s[9, k] = root(s[8], s[9], k)
        return s[9, k]
