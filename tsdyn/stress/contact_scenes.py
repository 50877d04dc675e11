"""Random scenes with contacts, stops and ropes that go slack: stacks, cradles, chains over a floor, pins with play.

Some beside friction of joints, or on bodies that are driven.
"""

from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from .. import constraints as joints
from .. import forces
from ..motions import Sine
from ..shapes import box, sphere

UP = (0.0, 0.0, 1.0)
RESTITUTIONS, FRICTIONS = (0.0, 0.0, 0.3, 0.8, 1.0), (0.0, 0.0, 0.2, 0.6)


def _upright(d):
    """Let gravity act down, and return a coefficient of restitution that all contacts share, or None: each its own."""
    d.scene.gravity = (0.0, 0.0, -9.81 * d.length / d.time**2)
    return float(d.rng.choice(RESTITUTIONS)) if d.rng.random() < 0.7 else None


def _law(d, e):
    return {"restitution": float(d.rng.choice(RESTITUTIONS)) if e is None else e}


def _thrown(d, share):
    """Velocities of a body: of a random direction, in this share of the scenes."""
    size = d.rng.random() < share
    return size * d.rng.normal(size=3) * d.length / d.time, size * 3.0 * d.rng.normal(size=3) / d.time


def _floor(d, body, point, e, kinetic, base=None, at=(0.0, 0.0, 0.0)):
    base = base or d.scene.ground
    given = {"point_a": point, "point_b": at, "normal_b": UP, "unilateral": True}
    d.scene.add(joints.PlaneContact(body, base, **given, **_law(d, e), kinetic=kinetic))


def balls(d, n):
    """Balls above each other, exactly or nearly, perhaps in a large ball."""
    e, radius, found = _upright(d), 0.1 * d.length, []
    shell = {"radius_a": radius, "radius_b": 3.0 * d.length, "inside": True}
    shift, is_in_shell = 0.02 * d.rng.choice((0.0, 1.0)), d.rng.random() < 0.5
    pitch = 0.3 if shift else d.rng.choice((0.2, 0.3))
    for i in range(min(n, 6)):
        place = np.append(shift * d.rng.uniform(-1.0, 1.0, 2), 0.3 + pitch * i)
        ball = d.body(place, rigid=bool(d.rng.integers(2)))
        ball.velocity = _thrown(d, 0.5)[0]
        d.scene.add(joints.SphereContact(ball, d.scene.ground, radius_a=radius, normal_b=UP, **_law(d, e)))
        if is_in_shell:
            d.scene.add(joints.SphereContact(ball, d.scene.ground, **shell, **_law(d, e)))
        for other in found:
            d.scene.add(joints.SphereContact(ball, other, radius_a=radius, radius_b=radius, **_law(d, e)))
        found.append(ball)


def cradle(d, n):
    """Balls on rods beside each other, that touch or don't; the first one is drawn aside."""
    e, radius, last = _upright(d), 0.1 * d.length, None
    gap = d.rng.choice((0.0, 1e-3)) * d.length
    for i in range(max(min(n, 7), 2)):
        x, tilt = i * (2.0 * radius + gap), d.rng.uniform(0.2, 1.0) * (i == 0)
        place = np.array((x - d.length * np.sin(tilt), 0.0, -d.length * np.cos(tilt)))
        ball = d.scene.add_point_mass(d.mass * d.rng.choice((1.0, d.rng.uniform(0.2, 3.0))), place)
        d.scene.add(joints.Distance(ball, d.scene.ground, point_b=(x, 0.0, 0.0)))
        if last is not None:
            d.scene.add(joints.SphereContact(last, ball, radius_a=radius, radius_b=radius, **_law(d, e)))
        last = ball


def stack(d, n):
    """Boxes on each other, at rest or with gaps, straight or shifted; or one that is thrown, with all its corners."""
    e, base, top, half, n = _upright(d), d.scene.ground, np.zeros(3), 0.0, min(n, 4)
    kinetic = float(d.rng.choice(FRICTIONS))
    gap, is_straight = d.rng.choice((0.0, 0.05)) * d.length, n > 1 and d.rng.random() < 0.5
    for _ in range(n):
        size = d.length * (np.array((0.6, 0.5, 0.4)) if is_straight else d.rng.uniform(0.3, 1.0, 3))
        solid = box(size, mass=d.mass * d.rng.uniform(0.5, 3.0))
        shift = np.zeros(2) if is_straight else 0.1 * size[:2] * d.rng.uniform(-1.0, 1.0, 2)
        body = d.scene.add_body(**solid)
        body.position = top + np.append(shift, gap + size[2] / 2)
        corners = size / 2 * np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
        if n == 1:
            body.position, body.orientation = (0.0, 0.0, d.length), Rotation.from_rotvec(d.rng.normal(size=3))
            body.velocity, body.angular_velocity = _thrown(d, 0.8)
        for corner in corners if n == 1 else corners[corners[:, 2] < 0.0]:
            _floor(d, body, corner, e, kinetic, base, (0.0, 0.0, half))
        base, top, half = body, body.position + np.array((0.0, 0.0, size[2] / 2)), size[2] / 2


def chain_over_floor(d, n):
    """Links over a floor, free or hung up, straight or bent, with stops between them."""
    e, L, last = _upright(d), 0.4 * d.length, d.scene.ground
    is_planar, is_free, has_stops, is_bent = d.rng.integers(2, size=4)
    tip, kinetic = np.array((0.0, 0.0, d.rng.uniform(0.1, 0.8) * d.length)), float(d.rng.choice(FRICTIONS))
    for i in range(min(n, 8)):
        along = np.array((1.0, 0.0, is_bent * d.rng.uniform(0.0, 1.0)))
        along *= L / np.linalg.norm(along)
        turned = Rotation.from_euler("y", -np.arctan2(along[2], along[0]))
        link = d.scene.add_body(
            d.mass, np.array((0.001, 0.0133, 0.0133)) * d.mass * d.length**2, tip + along / 2, turned
        )
        if i or not is_free:
            kind, axis = (joints.Revolute, {"axis": (0, 1, 0)}) if is_planar else (joints.Spherical, {})
            joint = d.scene.add(kind.at(last, link, point=tip, **axis))
            if is_planar and has_stops and d.rng.integers(2):
                bounds = -d.rng.uniform(0.1, 1.0), d.rng.uniform(0.1, 1.0)
                d.scene.add(joints.Stop(joint, *bounds, **_law(d, e)))
        for x in (-L / 2, L / 2) if i == 0 and is_free else (L / 2,):
            _floor(d, link, (x, 0.0, 0.0), e, kinetic)
        last, tip = link, tip + along


def stops(d, n):
    """Hinges and slides, each with one stop or two, one after the other."""
    e, last, place = _upright(d), d.scene.ground, np.zeros(3)
    for _ in range(min(n, 5)):
        place = place + d.unit()
        body = d.body(place, rigid=True)
        is_hinge, axis = d.rng.random() < 0.7, d.unit()
        kind = joints.Revolute if is_hinge else joints.Translational
        joint = d.scene.add(kind.at(last, body, point=d.place(place - 0.5 * d.unit()), axis=axis))
        unit = 1.0 if is_hinge else d.length
        lower, upper = -d.rng.uniform(0.0, 0.5) * unit, d.rng.uniform(0.01, 0.5) * unit
        which = d.rng.integers(3)
        d.scene.add(joints.Stop(joint, lower if which < 2 else None, upper if which else None, **_law(d, e)))
        last = body


def ropes(d, n):
    """Bodies on ropes that are slack at first, or taut: from the ground, from each other, or over a pulley."""
    e, last, place = _upright(d), d.scene.ground, np.zeros(3)
    for _ in range(min(n, 5)):
        place = place + np.array((*(0.3 * d.rng.normal(size=2)), -d.rng.uniform(0.3, 1.0)))
        body = d.body(place)
        body.velocity = _thrown(d, 0.5)[0]
        start = d.place(np.zeros(3)) if last is d.scene.ground else np.zeros(3)
        points = [(last, start), (body, np.zeros(3))]
        if d.rng.random() < 0.3:
            points.insert(1, (d.scene.ground, d.place(place + np.array((0.7, 0.0, 0.8)))))
        ends = [s if one is d.scene.ground else np.asarray(one.position) for one, s in points]
        length = sum(np.linalg.norm(b - a) for a, b in pairwise(ends))
        d.scene.add(
            joints.Rope(points, length=length * d.rng.choice((1.0, 1.0 + d.rng.uniform(0.0, 0.3))), **_law(d, e))
        )
        last = body


def play(d, n):
    """A pendulum whose pin has play in its eye; others hang on it by joints."""
    e, last, place = _upright(d), d.scene.ground, np.zeros(3)
    clearance = 10.0 ** d.rng.uniform(-3.0, -1.0) * d.length
    for i in range(min(n, 4)):
        body = d.body(place + np.array((0.5, 0.0, 0.0)), rigid=True)
        body.orientation = (1.0, 0.0, 0.0, 0.0)
        pin = np.array((-0.5, 0.0, 0.0)) * d.length
        if i == 0:
            given = {
                "center_a": pin,
                "radius_a": 0.1 * d.length,
                "radius_b": 0.1 * d.length + clearance,
                "inside": True,
            }
            d.scene.add(joints.SphereContact(body, last, **given, **_law(d, e)))
        else:
            d.scene.add(joints.Spherical.at(last, body, point=d.place(place)))
        last, place = body, place + np.array((1.0, 0.0, 0.0))


# Those that were added later.


def _rubs(d):
    """Coefficients of friction; that of sticking is larger in half of the scenes."""
    kinetic = float(d.rng.choice(FRICTIONS[2:]))
    return {"kinetic": kinetic} | ({"static": 1.3 * kinetic} if d.rng.random() < 0.5 else {})


def bowl(d, n):
    """Balls that roll and slip in a large ball that is held or hangs, and on each other."""
    e, rubs, found = _upright(d), _rubs(d), []
    shell = d.scene.ground
    if d.rng.random() < 0.3:
        shell = d.body(np.zeros(3), rigid=True, mass=5.0)
        d.scene.add(joints.Spherical.at(d.scene.ground, shell, point=d.place((0.0, 0.0, 1.5))))
    for i in range(min(n, 4)):
        radius = 0.1 * d.length
        ball = d.scene.add_body(**sphere(radius, mass=d.mass * d.rng.uniform(0.3, 3.0)))
        ball.position = d.place((0.25 * (i - 1.5), *(0.1 * d.rng.uniform(-1.0, 1.0, 2))))
        ball.velocity, ball.angular_velocity = _thrown(d, 0.5)
        inner = {"radius_a": radius, "radius_b": d.length, "inside": True}
        d.scene.add(joints.SphereContact(ball, shell, **inner, **_law(d, e), **rubs))
        for other in found:
            d.scene.add(joints.SphereContact(ball, other, radius_a=radius, radius_b=radius, **_law(d, e), **rubs))
        found.append(ball)


def coins(d, n):
    """Discs and balls that roll, slip, and jump on a floor."""
    e, rubs, radius = _upright(d), _rubs(d), 0.3 * d.length
    for i in range(min(n, 4)):
        is_disc, axis = d.rng.random() < 0.6, d.unit()
        reach = np.linalg.norm(axis[:2]) if is_disc else 1.0
        center = np.array((0.7 * i, 0.0, 0.3 * reach + d.rng.choice((0.0, 0.2))))
        body = d.body(center, rigid=True)
        body.velocity, body.angular_velocity = _thrown(d, 0.8)
        if not reach * radius < body.position[2]:  # it touches
            body.velocity = body.velocity * (1.0, 1.0, 0.0)
        given = {"center": body.position, "point": (0.0, 0.0, 0.0), "normal": UP, "radius": radius}
        if is_disc:
            d.scene.add(joints.RollingDisc.at(body, d.scene.ground, axis=axis, **given, **_law(d, e), **rubs))
        else:
            d.scene.add(joints.RollingBall.at(body, d.scene.ground, **given, **_law(d, e), **rubs))


def shaken(d, n):
    """A table that is shaken, and boxes on it."""
    e, rubs, L = _upright(d), _rubs(d), d.length
    table = d.body(np.zeros(3), rigid=True, mass=5.0)
    table.orientation = (1.0, 0.0, 0.0, 0.0)
    way, rate = d.rng.choice(((1.0, 0.0, 0.0), UP, (0.6, 0.0, 0.8))), d.rng.uniform(3.0, 20.0) / d.time
    size = d.rng.uniform(0.2, 1.5) * 9.81 * L / (d.time * rate) ** 2
    slide = d.scene.add(joints.Translational.at(d.scene.ground, table, point=table.position, axis=way))
    d.scene.add(joints.TranslationMotor.of(slide, displacement=Sine(size, rate)))
    for i in range(min(n, 2)):
        box_ = d.scene.add_body(**box(L * np.array((0.4, 0.3, 0.2)), mass=d.mass * d.rng.uniform(0.5, 3.0)))
        box_.position = L * np.array((0.6 * i, 0.0, 0.1))
        box_.velocity = size * rate * np.array(way)
        for x in (-0.2, 0.2):
            for y in (-0.15, 0.15):
                given = {"point_a": L * np.array((x, y, -0.1)), "normal_b": UP, "unilateral": True}
                d.scene.add(joints.PlaneContact(box_, table, **given, **_law(d, e), **rubs))
    table.velocity = size * rate * np.array(way)


def rough_ropes(d, n):
    """Pendulums with friction in their bearings, on ropes from arm to arm, or between stops."""
    e, last, place = _upright(d), d.scene.ground, np.zeros(3)
    for i in range(min(n, 4)):
        body, axis = d.body(place + np.array((0.5, 0.0, 0.0)), rigid=True), (0.0, 1.0, 0.0)
        hinge = d.scene.add(joints.Revolute.at(last, body, point=d.place(place), axis=axis))
        d.scene.add(forces.RevoluteFriction(hinge, radius=0.1 * d.length, **_rubs(d)))
        if d.rng.random() < 0.5:
            d.scene.add(joints.Stop(hinge, -d.rng.uniform(0.1, 1.0), d.rng.uniform(0.1, 1.0), **_law(d, e)))
        if i == 0 or d.rng.random() < 0.5:
            anchor = np.array((*d.rng.uniform(0.0, 1.0, 2), 0.8)) + place
            slack = d.length * d.rng.uniform(0.0, 0.3) + np.linalg.norm(body.position - d.place(anchor))
            ends = [(d.scene.ground, d.place(anchor)), (body, np.zeros(3))]
            d.scene.add(joints.Rope(ends, length=slack, **_law(d, e)))
        last, place = body, place + np.array((1.0, 0.0, 0.0))


class Intervention:
    """An event at an instant, or where a body is as high as at the start, with an action.

    asked: name of a method of `Change`, and its arguments; gives: impulse of the user's (3,), N s, on a body, or None.
    """

    def __init__(self, asked, t=None, body=None, gives=None):
        self.asked, self.t, self.gives = asked, t, gives
        self.place = None if body is None else body.position[2]
        self.body, self.direction = body, -1 if t is None else 0

    def __call__(self, t, state):
        """Zero at the event."""
        return t - self.t if self.t is not None else state.position(self.body)[2] - self.place

    def action(self, change):
        """Ask for it."""
        name, *given = self.asked
        getattr(change, name)(*given)


def hybrid(d, n):
    """Balls on a rough floor, tied by rods that are let go, and kicked; a pendulum between stops with a sampled law."""
    e, rubs, L, T, tied, actions = _upright(d), _rubs(d), d.length, d.time, [], []
    for i in range(min(n, 3)):
        ball = d.scene.add_body(**sphere(0.1 * L, mass=d.mass * d.rng.uniform(0.3, 3.0)), name=f"ball {i}")
        ball.position = L * np.array((0.5 * i, 0.0, 0.1 + d.rng.choice((0.0, 0.2))))
        ball.velocity = _thrown(d, 0.5)[0] * (1.0, 1.0, 0.0)
        floor = {"radius_a": 0.1 * L, "normal_b": UP, "name": f"floor {i}"}
        d.scene.add(joints.SphereContact(ball, d.scene.ground, **floor, **_law(d, e), **rubs))
        d.scene.add(forces.PointForce(ball, force=0.5 * d.mass * L / T**2 * d.unit(), name=f"wind {i}"))
        asked = [("set", f"floor {i}.restitution", float(d.rng.choice(RESTITUTIONS))), ("deactivate", f"wind {i}")]
        if tied:
            d.scene.add(joints.Distance(tied[-1], ball, name=f"rod {i}"))
            asked += [("deactivate", f"rod {i}"), ("activate", f"wind {i - 1}")]
        tied.append(ball)
        actions += [Intervention(each, t) for each, t in zip(asked, T * d.rng.uniform(0.0, 0.5, 4), strict=False)]
        kick = ball.mass * L / T * d.rng.normal(size=3)
        given = {"t": T * d.rng.uniform(0.0, 0.5)} if d.rng.random() < 0.7 else {"body": ball}
        actions.append(Intervention(("impulse", ball, kick), **given, gives=(ball, kick)))
    arm = d.body(np.array((0.5, 2.0, 0.5)), rigid=True)
    hinge = d.scene.add(joints.Revolute.at(d.scene.ground, arm, point=d.place((0.0, 2.0, 0.5)), axis=(0.0, 1.0, 0.0)))
    d.scene.add(joints.Stop(hinge, -d.rng.uniform(0.0, 0.4), d.rng.uniform(0.1, 0.6), **_law(d, e)))
    size, gain = arm.mass * 9.81 * L**2 / T**2, d.rng.uniform(0.0, 0.05)

    def law(t, state):
        return size * (np.sin(20.0 * t / T) - gain * T * state.angle_rate(hinge))

    d.scene.add(forces.Control(law, actuators=[hinge], period=d.rng.uniform(0.01, 0.1) * T))
    d.options["events"], d.assembled = actions, True


CONTACTS = {each.__name__: each for each in (balls, cradle, stack, chain_over_floor, stops, ropes, play)}
LATER_CONTACTS = {each.__name__: each for each in (bowl, coins, shaken, rough_ropes)}
ACTIONS = {hybrid.__name__: hybrid}
