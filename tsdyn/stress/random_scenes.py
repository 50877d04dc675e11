"""Random scenes, whole and broken: trees, loops, nets, driven, rolling, past places where laws aren't analytic."""

from typing import NamedTuple

import numpy as np

from .. import constraints as joints
from .. import forces
from ..integrators import Nystrom4
from ..motions import Sine, time
from ..motions.tables import Table
from ..simulation.scene import Scene
from . import contact_scenes

# Bodies, joints, motors, springs, ropes, rollers and friction of the random scenes, in random units.

PINS = ("Revolute", "Spherical", "Universal", "Cylindrical", "Translational", "Fixed", "PlaneContact", "Distance")
WEIGHTS = np.array((8, 5, 3, 2, 1, 1, 2, 3)) / 25.0
IN_UNITS = 0.25  # of the scenes are in other units than SI
DECADES = {"length": 6.0, "mass": 9.0, "time": 3.0}  # that the units are away from SI at most


class Draw:
    """A scene that is drawn, its random numbers, and its units in terms of SI."""

    def __init__(self, rng):
        self.rng, self.origin, self.spread, self.assembled, self.options = rng, np.zeros(3), 0.0, False, {}
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


def coupled_joints(d):
    """Couple hinges to others, and give some a rotor."""
    hinges = [joint for joint in d.scene.constraints if isinstance(joint, joints.Revolute)]
    for one, other in zip(hinges[::4], hinges[1::4], strict=False):
        d.scene.add(joints.Coupler(one, other, ratio=d.rng.uniform(-2.0, 2.0)))
    for hinge in hinges[::3]:
        inertia = d.rng.uniform(0.001, 0.1) * d.mass * d.length**2
        d.scene.add(forces.Armature(hinge, inertia=inertia, ratio=d.rng.uniform(1.0, 3.0)))


def rope(d):
    """Run a rope from the ground through some bodies and back, or an elastic cable."""
    through = d.rng.choice(d.scene.bodies, min(len(d.scene.bodies), int(d.rng.integers(1, 4))), replace=False)
    arms = [(0.0 if body.dimension == 3 else 0.1 * d.length) * d.rng.normal(size=3) for body in through]
    ends = [(d.scene.ground, d.place(2.0 * d.unit())) for _ in range(2)]
    points = [ends[0], *zip(through, arms, strict=True), ends[1]]
    if d.rng.random() < 0.5:
        d.scene.add(joints.Rope(points, always_taut=True))
    else:
        stiffness = 10.0 ** d.rng.uniform(0.0, 3.0) * d.mass / d.time**2
        d.scene.add(forces.Cable(points, stiffness=stiffness, free_length=3.0 * d.length))


def roller(d, base, normal, place):
    """A ball, a disc or a skate on a plane of a body; its velocities fit when it is at rest."""
    body, radius = d.body(place, rigid=True), 0.5 * d.length
    way, axis = d.rng.integers(3), d.unit()
    if way == 0:
        point = body.position - radius * normal
        d.scene.add(joints.RollingBall.at(body, base, center=body.position, point=point, normal=normal, radius=radius))
    elif way == 1:
        point = body.position - radius * np.linalg.norm(np.cross(axis, normal)) * normal
        given = {"center": body.position, "axis": axis, "point": point, "normal": normal, "radius": radius}
        d.scene.add(joints.RollingDisc.at(body, base, **given))
    else:
        d.scene.add(joints.KnifeEdge.at(body, base, point=body.position, axis=axis, normal=normal))
    return body


# Random scenes, whole and broken: trees, loops, nets, driven, rough, redundant, degenerate, far away, in any units.
#
# `generate(seed)` is the scene of a seed. A run of it, by judgement.py, must succeed within the laws, or be refused, or
# end with a message.

METHODS = ("default", "default", "default", "taylor", "dop853", "rk45", "nystrom4")
SIZES = ((0.9, 2, 12), (0.99, 12, 60), (1.0, 60, 400))  # share of scenes up to here, bodies from, to


class DrawnCase(NamedTuple):
    """A scene and how it is to be run."""

    name: str
    scene: Scene
    span: tuple  # s
    options: dict
    assembled: bool = False  # whether `scene.assemble` comes first
    length: float = 1.0  # its unit of length, m


def tree(d, n, lean=0.0):
    """Each body hangs on one before it, or on the ground."""
    places, bodies = [np.zeros(3)], [d.scene.ground]
    for _ in range(n):
        i = int(d.rng.integers(len(bodies))) if d.rng.random() < 0.4 else len(bodies) - 1
        places.append(places[i] + d.unit())
        bodies.append(d.body(places[-1], d.rng.random() < lean))
        join(d, bodies[i], bodies[-1])


def lean_tree(d, n):
    """The same of bodies without inertia about an axis, many of which nothing holds about it."""
    tree(d, n, d.rng.choice((1.0 / n, 0.3)))


def floating(d, n):
    """A tree that touches the ground nowhere."""
    places, bodies = [np.zeros(3)], [d.body(np.zeros(3))]
    for _ in range(n - 1):
        i = int(d.rng.integers(len(bodies)))
        places.append(places[i] + d.unit())
        bodies.append(d.body(places[-1]))
        join(d, bodies[i], bodies[-1])


def loops(d, n):
    """A tree whose bodies are joined to others here and there."""
    tree(d, n)
    if len(d.scene.bodies) < 2:
        return
    for _ in range(int(d.rng.integers(1, 2 + n // 10))):
        a, b = d.rng.choice(d.scene.bodies, 2, replace=False)
        join(d, a, b, ("Distance", "Spherical", "PlaneContact"))


def net(d, n):
    """A cloth: bodies on a grid, each joined to its neighbours by balls or rods."""
    side = max(int(np.sqrt(n)), 2)
    kinds = (("Distance",), ("Spherical", "Distance"), ("Spherical",))[d.rng.integers(3)]
    grid = {}
    for i in range(side):
        for j in range(side):
            grid[i, j] = d.body(np.array((i, j, 0.0)) + d.rng.normal(size=3) * d.rng.choice((0.0, 0.05)))
            for other in ((i - 1, j), (i, j - 1)):
                if other in grid:
                    join(d, grid[other], grid[i, j], kinds)
    join(d, d.scene.ground, grid[0, 0], ("Spherical",))


def planar(d, n):
    """A planar row of four-bars with revolutes: redundant; sometimes flat, which is singular."""
    flat, last = d.rng.random() < 0.3, None
    for i in range(max(n // 3, 1)):
        angle = 0.0 if flat else d.rng.uniform(0.5, 2.5)
        foot = np.array((i, 0.0, 0.0))
        tip = foot + np.array((np.cos(angle), np.sin(angle), 0.0))
        crank = d.body(0.5 * (foot + tip))
        joins = [(d.scene.ground, crank, foot)]
        if last is not None:
            rod = d.body(0.5 * (last[1] + tip))
            joins += [(last[0], rod, last[1]), (rod, crank, tip)]
        for a, b, point in joins:
            if all(body.dimension != 3 for body in (a, b)):
                join(d, a, b, ("Revolute",), axis=(0.0, 0.0, 1.0), point=point)
        last = crank, tip


def star(d, n):
    """Everything hangs on one body."""
    hub = d.body(np.zeros(3), rigid=True, mass=10.0)
    join(d, d.scene.ground, hub, ("Revolute", "Spherical", "Cylindrical"))
    for _ in range(n):
        join(d, hub, d.body(d.unit()))


def crowd(d, n):
    """Joints between bodies at random: overconstrained as a rule, locked or singular."""
    bodies = [d.body(d.rng.normal(size=3) * 3.0) for _ in range(n)]
    for _ in range(int(n * d.rng.uniform(0.5, 1.5))):
        a, b = d.rng.choice([d.scene.ground, *bodies], 2, replace=False)
        join(d, a, b)


def degenerate(d, n):
    """A chain along a line, its axes all parallel or along it, with joints there twice, and some that contradict."""
    axis = np.append(d.rng.choice((0.0, 1.0), 2), 1e-9)
    last = d.scene.ground
    for i in range(n):
        body = d.body(np.array((i + 1.0, 0.0, 0.0)))
        for _ in range(1 + int(d.rng.random() < 0.2)):
            join(d, last, body, axis=axis / np.linalg.norm(axis))
        last = body if body.dimension != 3 else last
    if d.rng.random() < 0.3 and n > 1:
        join(d, d.scene.bodies[0], d.scene.bodies[-1], ("Distance",))


def far(d, n):
    """A tree a long way from the origin."""
    d.origin = d.unit() * 10.0 ** d.rng.uniform(2.0, 7.0)
    post = d.body(np.zeros(3), rigid=True)
    join(d, d.scene.ground, post, ("Fixed",), point=np.zeros(3))
    last, place = post, np.zeros(3)
    for _ in range(n):
        place = place + d.unit()
        body = d.body(place)
        join(d, last, body)
        last = body if body.dimension != 3 else last


def driven(d, n):
    """A tree, some joints of which are motors or drivers."""
    tree(d, n)
    for body in d.scene.bodies[:: max(n // 3, 1)]:
        motor(d, body)


def rough(d, n):
    """A tree with friction in its joints."""
    tree(d, n)
    joint_friction(d)


def coupled(d, n):
    """A tree with couplers, rotors, ropes and cables."""
    tree(d, n)
    coupled_joints(d)
    for _ in range(int(d.rng.integers(1, 3))):
        rope(d)


def rolling(d, n):
    """Balls, discs and skates on a plane of the ground and on each other, with a joint here and there."""
    normal, bases = d.unit(), [d.scene.ground]
    for i in range(n):
        base = bases[int(d.rng.integers(len(bases)))]
        bases.append(roller(d, base, normal, np.array((2.0 * i, 0.0, 0.0))))
        if d.rng.random() < 0.4:
            other = d.body(np.array((2.0 * i, 1.0, 0.0)))
            join(d, bases[-1], other)


def lopsided(d, n):
    """A tree, whose masses differ by up to twelve decades."""
    d.spread = d.rng.uniform(1.0, 12.0)
    tree(d, n)


def limited(d, n):
    """A tree, whose hinges and slides have stops."""
    tree(d, n)
    for joint in d.scene.constraints:
        if isinstance(joint, (joints.Revolute, joints.Translational)) and d.rng.random() < 0.7:
            bounds = d.rng.uniform(0.0, 0.5, 2) * (1.0 if isinstance(joint, joints.Revolute) else d.length)
            e = float(d.rng.choice(contact_scenes.RESTITUTIONS))
            d.scene.add(joints.Stop(joint, -bounds[0], bounds[1], restitution=e))


FIRST = {
    each.__name__: each
    for each in (
        tree, lean_tree, floating, loops, net, planar, star, crowd, degenerate, far, driven, rough, lopsided,
    )
}  # fmt: skip
LATER = {each.__name__: each for each in (coupled, rolling)}
LATER_CONTACTS = contact_scenes.LATER_CONTACTS | {"limited": limited}
CONTACTS = contact_scenes.CONTACTS | LATER_CONTACTS | contact_scenes.ACTIONS
KINDS = FIRST | LATER | CONTACTS
KINDS_OF_SEEDS = {0: LATER, 10: LATER, 4: contact_scenes.CONTACTS, 14: LATER_CONTACTS, 16: contact_scenes.ACTIONS}


def generate(seed, least=None, most=None):
    """Return the `DrawnCase` of a seed; of so many bodies, about, where that is given.

    Kinds that were added later have seeds of their own, so that scenes of known seeds stay the same.
    """
    return drawn(np.random.default_rng(seed), least, most, KINDS_OF_SEEDS.get(seed % 20, FIRST))


def drawn(rng, least=None, most=None, kinds=KINDS):
    """Return the `DrawnCase` that a generator of random numbers draws."""
    share = rng.random()
    if least is None:
        least, most = next(sizes for limit, *sizes in SIZES if share < limit)
    name, n = str(rng.choice(list(kinds))), int(np.exp(rng.uniform(np.log(least), np.log(most))))
    d = Draw(rng)
    kinds[name](d, n)
    if rng.random() < 0.3:
        for body in d.scene.bodies[:: max(n // 5, 1)]:
            spring(d, body)
    if name not in CONTACTS:
        moving(d)
    method = str(rng.choice(METHODS))
    options = dict(d.options) if method == "default" else d.options | {"integrator": method}
    if method == "nystrom4":
        options = d.options | {"integrator": d.fixed_step()}
    elif method != "taylor":
        options |= {"rtol": 1e-8, "atol": 1e-8 * min(d.length, 1.0)}
    if rng.random() < 0.1 and len(d.scene.bodies) < 15 and method != "taylor" and d.is_si:
        options["formulation"] = "null-space"
    span = 0.0, float(rng.uniform(0.02, 0.5)) * d.time * (3.0 if name in CONTACTS else 1.0)
    return DrawnCase(f"{name}, {len(d.scene.bodies)} bodies, {method}", d.scene, span, options, d.assembled, d.length)


def moving(d):
    """Give the bodies velocities, or put them off the constraints; most of which are assembled after that."""
    way = d.rng.random()
    if way < 0.4:
        for body in d.scene.bodies:
            body.velocity = d.rng.normal(size=3) * 0.3 * d.length / d.time
            if body.dimension != 3:
                body.angular_velocity = d.rng.normal(size=3) / d.time
    if 0.3 < way < 0.5:
        for body in d.scene.bodies:
            body.position = body.position + d.rng.normal(size=3) * 10.0 ** d.rng.uniform(-9.0, -1.0) * d.length
    d.assembled = (d.assembled or way < 0.5) and d.rng.random() < 0.8


# Random scenes that pass places where a law is not analytic, where series end and methods of stages don't.
#
# Zero length of springs, exactly and nearly; roots, powers and quotients in loads and motions of a user; slip that
# reverses; half turns; knots.


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


def control(rng, scene):
    """A double pendulum; torque at one joint and force on a point, each by both joints and the height of the tip."""
    lower = scene.add_body(1.0, (0.1, 0.12, 0.15), (0.5, 0.0, 0.0), name="lower")
    upper = scene.add_body(0.7, (0.1, 0.12, 0.15), (1.5, 0.0, 0.0), name="upper")
    scene.add(joints.Revolute.at(scene.ground, lower, point=(0, 0, 0), axis=(0, 1, 0), name="hip"))
    scene.add(joints.Universal.at(lower, upper, point=(1, 0, 0), axis_a=(0, 1, 0), axis_b=(0, 0, 1), name="knee"))
    gains = rng.normal(size=(2, 5))

    def law(t, state):
        angles, rates = state.angle("knee"), state.angle_rate("knee")
        height = state.position("upper", (0.5, 0.0, 0.0))[2]
        return gains @ np.array([state.angle("hip"), angles[0], rates[1], height, np.sin(t)])

    push = forces.PointForce(upper, point_a=rng.normal(size=3), force=_unit(rng), frame="body")
    scene.add(forces.Control(law, ["hip", push], period=rng.choice((None, 0.05))))


PASSAGES = anchors, anchors, anchors, pendulum, loads, loads, of_time, friction, turns, control


def draw(seed):
    """Return the `DrawnCase` of a seed."""
    rng = np.random.default_rng((seed, 2))
    scene = Scene(gravity=rng.choice((0.0, 1.0)) * rng.normal(size=3))
    kind = PASSAGES[rng.integers(len(PASSAGES))]
    kind(rng, scene)
    tolerance = float(rng.choice((1e-8, 1e-11, 1e-14)))
    options = {"rtol": tolerance, "atol": tolerance}
    if rng.random() < 0.5:
        options["integrator"] = "taylor"
    return DrawnCase(f"{kind.__name__} by series", scene, (0.0, float(rng.uniform(0.5, 1.0))), options)
