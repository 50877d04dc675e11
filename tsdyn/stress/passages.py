"""Random scenes that pass places where a law is not analytic, where series end and methods of stages don't.

Zero length of springs, exactly and nearly; roots, powers and quotients in loads and motions of a user; slip that
reverses; half turns; knots.
"""

import numpy as np

from .. import constraints as joints
from .. import forces
from ..motions import time
from ..motions.tables import Table
from ..simulation.scene import Scene
from .random_scenes import Case


def _size(t, a, b, par, out):
    out[0] = par[1] * (-np.sqrt(a[0] * a[0]))


def _larger(t, a, b, par, out):
    out[0] = par[1] * (-0.5 * (a[0] + np.sqrt(a[0] * a[0])))


def _sign(t, a, b, par, out):
    out[0] = par[1] * (-a[0] / np.sqrt(a[0] * a[0] + par[0] * par[0]))


def _root(t, a, b, par, out):
    out[0] = par[1] * (-a[0] / np.sqrt(np.sqrt(a[0] * a[0] + par[0] * par[0])))


def _power(t, a, b, par, out):
    out[0] = par[1] * (-a[0] * (a[0] * a[0] + par[0] * par[0]) ** 0.25)


def _drag(t, a, b, par, out):
    out[0] = par[1] * (-a[7] * np.sqrt(a[7] * a[7]) - a[0])


def _pole(t, a, b, par, out):
    out[0] = par[1] * (-a[0] / (par[0] + a[0] * a[0]))


def _step(t, a, b, par, out):
    out[0] = par[1] * (-np.tanh(a[0] / par[0]))


def _angle(t, a, b, par, out):
    out[0] = par[1] * (-np.arctan(a[0] / par[0]))


def _bump(t, a, b, par, out):
    out[0] = par[1] * (np.exp(-((a[0] / par[0]) ** 2)) - a[0])


def _waves(t, a, b, par, out):
    out[0] = par[1] * (-a[0] * np.sqrt((t - 0.5) ** 2 + par[0] * par[0]))


LAWS = _size, _larger, _sign, _root, _power, _drag, _pole, _step, _angle, _bump, _waves


def _unit(rng):
    u = rng.normal(size=3)
    return u / np.linalg.norm(u)


def _miss(rng):
    """A distance by which a place is missed: zero, rounding, or any size."""
    return rng.choice((0.0, 10.0 ** rng.uniform(-16.0, -1.0)))


def _flight(rng, scene, u, place=0.0):
    """A body that flies along u through the origin, or misses it; sometimes rigid, and held to a plane."""
    w = np.cross(u, _unit(rng))
    start = place - rng.uniform(0.3, 1.5) * u
    velocity = rng.uniform(0.5, 4.0) * u + _miss(rng) * w
    if rng.random() < 0.5:
        return scene.add_point_mass(mass=rng.uniform(0.3, 3.0), position=start, velocity=velocity)
    body = scene.add_body(rng.uniform(0.3, 3.0), rng.uniform(0.1, 0.15, 3), start, velocity=velocity)
    if rng.random() < 0.5:
        normal = w / np.linalg.norm(w)
        scene.add(joints.PlaneContact.at(body, scene.ground, point=start, normal=normal))
        scene.assemble()
    return body


def anchors(rng, scene):
    """Through the anchor of a spring, or those of several on a line; or two bodies through each other."""
    u = rng.choice((0.0, 1.0)) * _unit(rng)
    u = u if u.any() else np.eye(3)[rng.integers(3)]
    body = _flight(rng, scene, u)
    for i in range(int(rng.integers(1, 4))):
        point = u * (0.0 if i == 0 else rng.uniform(-1.0, 1.0))
        given = {"stiffness": rng.uniform(1.0, 60.0), "free_length": rng.uniform(0.0, 1.0)}
        given["damping"] = rng.choice((0.0, rng.uniform(0.0, 1.0)))
        scene.add(forces.Spring(scene.ground, body, point_a=point, **given))
    if rng.random() < 0.3:
        other = scene.add_point_mass(mass=rng.uniform(0.3, 3.0), position=0.7 * u + _miss(rng) * _unit(rng))
        scene.add(forces.Spring(body, other, stiffness=rng.uniform(1.0, 60.0), free_length=rng.uniform(0.0, 0.5)))


def pendulum(rng, scene):
    """A pendulum whose tip swings through the anchor of a spring."""
    body = scene.add_body(rng.uniform(0.5, 2.0), rng.uniform(0.1, 0.15, 3), (1.0, 0.0, 0.0))
    scene.add(joints.Revolute.at(scene.ground, body, point=(0, 0, 0), axis=(0, 1, 0)))
    angle = rng.uniform(0.2, 1.5)
    anchor = np.array((np.cos(angle), _miss(rng), -np.sin(angle)))
    scene.gravity = (0.0, 0.0, -9.81)
    given = {"stiffness": rng.uniform(1.0, 30.0), "free_length": rng.uniform(0.0, 1.0)}
    scene.add(forces.Spring(scene.ground, body, point_a=anchor, damping=rng.choice((0.0, 0.3)), **given))


def loads(rng, scene):
    """A load of a user with roots, powers and quotients, along x."""
    body = _flight(rng, scene, np.array((1.0, 0.0, 0.0)))
    law, eps = LAWS[rng.integers(len(LAWS))], 10.0 ** rng.uniform(-6.0, 0.0)
    scene.add(forces.UserForce(body, function=law, parameters=(eps, rng.uniform(0.5, 10.0))))


def of_time(rng, scene):
    """A load or a length that is a function of time, with a place where it is not analytic nearby; or a table."""
    eps, a, gain = 10.0 ** rng.uniform(-4.0, 0.0), rng.uniform(0.2, 0.8), rng.uniform(0.05, 0.3)
    s = time - a
    size = np.sqrt(s * s + eps * eps)
    pulses = 1.0 / (1.0 + (s / eps) ** 2), np.exp(-((s / eps) ** 2))
    found = size, s * size, np.tanh(s / eps), np.arctan(s / eps), *pulses
    motion = gain * found[rng.integers(len(found))]
    if rng.random() < 0.2:
        motion = Table(np.sort(np.append(rng.uniform(0.0, 1.0, 5), (0.0, 1.0))), rng.normal(size=7) * gain)
    body = scene.add_body(1.0, (0.1, 0.12, 0.15), (1.0, 0.0, 0.0), velocity=rng.normal(size=3))
    if rng.random() < 0.5 and not isinstance(motion, Table):
        scene.add(joints.Distance(scene.ground, body, length=1.0 + motion))
        scene.assemble()
    elif rng.random() < 0.5:
        scene.add(forces.Spring(scene.ground, body, stiffness=5.0, free_length=0.5, actuator=motion))
    else:
        scene.add(forces.PointForce(body, force=(motion, 0.0, 0.0), point_a=(0.1, 0.2, 0.0)))


def friction(rng, scene):
    """A block on a spring, whose slip reverses; sometimes with a Stribeck velocity."""
    scene.gravity = (0.0, 0.0, -9.81)
    block = scene.add_body(1.0, (0.1, 0.12, 0.15), velocity=(rng.uniform(0.5, 2.0), 0.0, 0.0))
    given = {"kinetic": rng.uniform(0.05, 0.5), "slip_velocity": 10.0 ** rng.uniform(-4.0, -1.0)}
    if rng.random() < 0.5:
        given |= {"static": given["kinetic"] * 1.3, "stribeck_velocity": 10.0 ** rng.uniform(-3.0, -1.0)}
    if rng.random() < 0.5:
        slide = scene.add(joints.Translational.at(scene.ground, block, point=(0, 0, 0), axis=(1, 0, 0)))
        scene.add(forces.TranslationalFriction(slide, **given))
    else:
        table = scene.add(joints.PlaneContact(block, scene.ground, normal_b=(0, 0, 1)))
        scene.add(joints.Parallel(block, scene.ground, axis_a=(0, 0, 1), axis_b=(0, 0, 1)))
        scene.add(forces.ContactFriction(table, **given))
    stiffness = rng.uniform(5.0, 60.0)
    scene.add(forces.Spring(scene.ground, block, point_a=(0.3, 0, 0), stiffness=stiffness, free_length=0.1))


def turns(rng, scene):
    """A body that turns past half a turn on a bushing, or on a torsional spring that it may leave the axis of."""
    body = scene.add_body(1.0, (0.1, 0.12, 0.15), angular_velocity=rng.normal(size=3) * 6.0)
    if rng.random() < 0.5:
        given = {"stiffness": 20.0, "torsional_stiffness": rng.uniform(0.1, 3.0, 3), "torsional_damping": 0.01}
        scene.add(forces.Bushing(scene.ground, body, **given))
    else:
        axis = _unit(rng)
        scene.add(forces.TorsionalSpring.at(scene.ground, body, axis=axis, stiffness=rng.uniform(0.1, 3.0)))


KINDS = anchors, anchors, anchors, pendulum, loads, loads, of_time, friction, turns


def draw(seed):
    """Return the `Case` of a seed."""
    rng = np.random.default_rng((seed, 2))
    scene = Scene(gravity=rng.choice((0.0, 1.0)) * rng.normal(size=3))
    kind = KINDS[rng.integers(len(KINDS))]
    kind(rng, scene)
    tolerance = float(rng.choice((1e-8, 1e-11, 1e-14)))
    options = {"rtol": tolerance, "atol": tolerance}
    if rng.random() < 0.5:
        options["integrator"] = "taylor"
    return Case(f"{kind.__name__} by series", scene, (0.0, float(rng.uniform(0.5, 1.0))), options)
