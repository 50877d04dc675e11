"""Bodies, joints, motors, springs and friction of the random scenes, in random units."""

import numpy as np

from .. import constraints as joints
from .. import forces
from ..integrators import Nystrom4
from ..motions import Sine
from ..simulation.scene import Scene

PINS = ("Revolute", "Spherical", "Universal", "Cylindrical", "Translational", "Fixed", "PlaneContact", "Distance")
WEIGHTS = np.array((8, 5, 3, 2, 1, 1, 2, 3)) / 25.0
IN_UNITS = 0.25  # of the scenes are in other units than SI
DECADES = {"length": 6.0, "mass": 9.0, "time": 3.0}  # that the units are away from SI at most


class Draw:
    """A scene that is drawn, its random numbers, and its units in terms of SI."""

    def __init__(self, rng):
        self.rng, self.origin, self.spread, self.assembled = rng, np.zeros(3), 0.0, False
        other = rng.random() < IN_UNITS
        self.length, self.mass, self.time = (
            10.0 ** rng.uniform(-decades, decades) if other else 1.0 for decades in DECADES.values()
        )
        self.is_si = not other
        self.scene = Scene(gravity=rng.normal(size=3) * 5.0 * self.length / self.time**2)

    def unit(self):
        """Return a direction."""
        v = self.rng.normal(size=3)
        return v / np.linalg.norm(v)

    def place(self, point):
        """Return a point in m, from one in units of length from the scene's origin."""
        return (self.origin + point) * self.length

    def body(self, position, lean=False, rigid=False, mass=None):
        """Add a body at a random orientation; one that is lean has no inertia about an axis."""
        rng = self.rng
        scale = self.mass * 10.0 ** (0.5 * self.spread * rng.uniform(-1.0, 1.0))
        mass = scale * (rng.uniform(0.1, 3.0) if mass is None else mass)
        if not rigid and rng.random() < 0.05:
            return self.scene.add_point_mass(mass=mass, position=self.place(position))
        a, b, share = rng.uniform(0.02, 0.3, 3)
        inertia = np.array((0.0, a, a) if lean else (a, b, abs(a - b) + share * min(a, b))) * scale * self.length**2
        p = rng.normal(size=4)
        return self.scene.add_body(mass, inertia, self.place(position), p / np.linalg.norm(p))

    def fixed_step(self):
        """Return a method of fixed steps, a thousandth of the unit of time long."""
        return Nystrom4(step=1e-3 * self.time)


def join(d, a, b, kinds=PINS, axis=None, point=None):
    """Join two bodies by some joint that holds where they stand; `point` in units of length."""
    ends = [np.asarray(body.position) if body.dimension else d.place(np.zeros(3)) for body in (a, b)]
    rigid = [body for body in (a, b) if body.dimension != 3]
    kind = str(d.rng.choice(kinds, p=WEIGHTS if kinds is PINS else None)) if len(rigid) == 2 else "Distance"
    between = ends[0] + d.rng.uniform(0.2, 0.8) * (ends[1] - ends[0])
    point = between if point is None else d.place(point)
    axis = d.unit() if axis is None else axis
    if kind == "Distance":
        arms = {f"point_{x}": d.rng.normal(size=3) * 0.1 * d.length for x in "ab"}
        if a.dimension == 0:
            arms["point_a"] = arms["point_a"] + ends[0]
        if b.dimension == 0:
            arms["point_b"] = arms["point_b"] + ends[1]
        arms = {name: arm for name, arm in arms.items() if (a if name == "point_a" else b) in rigid}
        return d.scene.add(joints.Distance(a, b, **arms))
    if kind == "PlaneContact":
        return d.scene.add(joints.PlaneContact.at(a, b, point=point, normal=axis))
    if kind in ("Spherical", "Fixed"):
        return d.scene.add(getattr(joints, kind).at(a, b, point=point))
    if kind == "Universal":
        other = np.cross(axis, d.unit())
        return d.scene.add(joints.Universal.at(a, b, point=point, axis=axis, axis_b=other / np.linalg.norm(other)))
    return d.scene.add(getattr(joints, kind).at(a, b, point=point, axis=axis))


def motor(d, body):
    """Drive a body relative to the ground: its angle, a point of it, or its distance."""
    ground, rate = d.scene.ground, d.rng.uniform(0.5, 8.0) / d.time
    way = d.rng.integers(3) if body.dimension != 3 else 2
    if way == 0:
        angle = Sine(d.rng.uniform(0.05, 0.6), rate)
        d.scene.add(joints.RotationMotor.at(ground, body, point=body.position, axis=d.unit(), angle=angle))
    elif way == 1:
        path = [place + Sine(0.1 * d.length, rate) for place in np.asarray(body.position)]
        d.scene.add(joints.PointDriver(ground, body, path=tuple(path)))
    else:
        anchor = np.asarray(body.position) + d.unit() * d.length
        d.scene.add(joints.Distance(ground, body, point_a=anchor, length=d.length + Sine(0.1 * d.length, rate)))
    d.assembled = True  # for its velocities


def spring(d, body):
    """Hang a body on a spring and damper, soft or stiff."""
    stiffness = 10.0 ** d.rng.uniform(0.0, 5.0) * d.mass / d.time**2
    damping = d.rng.uniform(0.0, 1.0) * d.mass / d.time
    point = np.asarray(body.position) + d.unit() * d.length
    d.scene.add(forces.Spring(d.scene.ground, body, point_a=point, stiffness=stiffness, damping=damping))


def joint_friction(d):
    """Put friction into the revolute and translational joints, and drag on the first body."""
    for joint in d.scene.constraints:
        given = {"kinetic": d.rng.uniform(0.05, 0.5), "slip_velocity": 1e-2 * d.length / d.time}
        if isinstance(joint, joints.Revolute):
            d.scene.add(forces.RevoluteFriction(joint, radius=0.02 * d.length, **given))
        elif isinstance(joint, joints.Translational):
            d.scene.add(forces.TranslationalFriction(joint, **given))
    body = d.scene.bodies[0]
    if body.dimension != 3:
        damping = 0.1 * d.mass / d.time
        d.scene.add(forces.ViscousFriction(d.scene.ground, body, damping=damping))
