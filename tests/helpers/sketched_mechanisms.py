"""Planar and spatial mechanisms to sketch, by name."""

import numpy as np

import tsdyn as ts
from tests.helpers.sketches import Builder, along, angle, arcsine, axes, clear, frame, from_straight, meet, polar, side

Z = np.array([0.0, 0.0, 1.0])
C = ts.constraints


@clear
def four_bar(rng, lengths=(2.0, 1.0, 2.2, 1.8)):
    """Ground, crank, coupler, rocker; four Revolute: three rows too many."""
    ground, crank, coupler, rocker = lengths
    a, d = np.zeros(3), np.array([ground, 0.0, 0.0])
    b = crank * polar(rng.uniform(-np.pi, np.pi))
    c = meet(b, coupler, d, rocker, side(rng))
    if c is None:
        return None
    m = Builder()
    one, two, three = m.link("crank", a, b), m.link("coupler", b, c), m.link("rocker", d, c)
    m.pin(None, one, a), m.pin(one, two, b), m.pin(two, three, c), m.pin(three, None, d)
    return m.done(lambda: from_straight(angle(along(two), along(three))))


def double_rocker(rng):
    """A four-bar that doesn't turn over, so that both its branches are on one circuit."""
    return four_bar(rng, (2.0, 1.5, 1.2, 1.6))


@clear
def slider_crank(rng):
    """Three Revolute and a Translational."""
    b = 1.0 * polar(rng.uniform(-np.pi, np.pi))
    way = side(rng)
    c = np.array([b[0] + way * np.sqrt(2.0**2 - b[1] ** 2), 0.0, 0.0])
    m = Builder()
    crank, rod, slider = m.link("crank", np.zeros(3), b), m.link("rod", b, c), m.block("slider", c, 0.5)
    m.pin(None, crank, np.zeros(3)), m.pin(crank, rod, b), m.pin(rod, slider, c)
    m.scene.add(C.Translational.at(slider, m.scene.ground, point=c, axis=(1, 0, 0), name="guide"))
    return m.done(lambda: from_straight(np.pi / 2 - angle(np.array([1.0, 0.0, 0.0]), along(rod))))


@clear
def six_bar(rng):
    """Watt: the rocker of a four-bar has an arm that drives a second four-bar; seven Revolute."""
    a, d, g = np.zeros(3), np.array([2.0, 0.0, 0.0]), np.array([4.0, 0.2, 0.0])
    b = polar(rng.uniform(-np.pi, np.pi))
    c = meet(b, 2.2, d, 1.8, side(rng))
    if c is None:
        return None
    u = (c - d) / 1.8
    e = d + 1.2 * (np.cos(0.9) * u - np.sin(0.9) * np.cross(Z, u))
    f = meet(e, 1.7, g, 1.6, side(rng))
    if f is None:
        return None
    m = Builder()
    crank, coupler, rocker = m.link("crank", a, b), m.link("coupler", b, c), m.link("rocker", d, c)
    second, last = m.link("second coupler", e, f), m.link("second rocker", g, f)
    m.pin(None, crank, a), m.pin(crank, coupler, b), m.pin(coupler, rocker, c), m.pin(rocker, None, d)
    m.pin(rocker, second, e), m.pin(second, last, f), m.pin(last, None, g)
    return m.done(
        lambda: [
            from_straight(angle(along(coupler), along(rocker))),
            from_straight(angle(along(second), along(last))),
        ]
    )


@clear
def rssr(rng):
    """Two cranks on axes at right angles, a rod with ball ends between them; the rod turns about itself freely."""
    a, d = np.zeros(3), np.array([1.8, 0.5, 0.3])
    b = 0.7 * polar(rng.uniform(-np.pi, np.pi))
    theta = np.linspace(-np.pi, np.pi, 721)  # the rocker turns about x
    points = d + 1.2 * np.stack((0 * theta, np.cos(theta), np.sin(theta)), axis=1)
    miss = np.linalg.norm(points - b, axis=1) - 2.2
    roots = np.flatnonzero(miss[:-1] * miss[1:] < 0.0)
    if roots.size == 0:
        return None
    i = rng.choice(roots)
    low, high = theta[i], theta[i + 1]

    def at(x):
        return d + 1.2 * np.array([0.0, np.cos(x), np.sin(x)])

    for _ in range(60):
        x = (low + high) / 2
        if (np.linalg.norm(at(x) - b) - 2.2) * miss[i] > 0.0:
            low = x
        else:
            high = x
    c, X = at(low), np.array([1.0, 0.0, 0.0])
    m = Builder()
    crank, rod, rocker = m.link("crank", a, b), m.link("rod", b, c), m.link("rocker", d, c, X)
    m.pin(None, crank, a), m.ball(crank, rod, b), m.ball(rod, rocker, c), m.pin(rocker, None, d, X)
    return m.done(lambda: arcsine(along(rod) @ np.cross(X, along(rocker))))


@clear
def hooke_joint(rng):
    """Two shafts in bearings at an angle, a universal joint between them; a Revolute bearing on both: rows too many."""
    bend = rng.uniform(0.4, 0.9)
    line, turn = polar(bend), rng.uniform(-np.pi, np.pi)
    arm = np.array([0.0, np.cos(turn), np.sin(turn)])
    other = np.cross(line, arm)
    m = Builder()
    one, two = m.link("driving", -polar(0.0), np.zeros(3), arm), m.link("driven", np.zeros(3), line, other)
    m.pin(None, one, -polar(0.0), polar(0.0))
    m.scene.add(C.Universal.at(one, two, point=np.zeros(3), axis=arm, name="cross"))
    m.scene.add(C.Cylindrical.at(two, m.scene.ground, point=line, axis=line, name="far bearing"))
    # the arms are the shafts' z axes
    return m.done(lambda: arcsine(np.cross(axes(one)[:, 2], axes(two)[:, 2]) @ polar(bend / 2) / np.cos(bend / 2)))


@clear
def parallelogram(rng):
    """Equal cranks, the coupler as long as the ground: four Revolute, not flat."""
    a, d = np.zeros(3), np.array([2.0, 0.0, 0.0])
    out = 1.2 * polar(rng.uniform(-np.pi, np.pi))
    m = Builder()
    one, two, three = m.link("left", a, a + out), m.link("coupler", a + out, d + out), m.link("right", d, d + out)
    m.pin(None, one, a), m.pin(one, two, a + out), m.pin(two, three, d + out), m.pin(three, None, d)
    return m.done(lambda: from_straight(angle(along(two), along(three))))


@clear
def sarrus(rng):
    """Two folding arms in planes across each other lift a plate straight up; six Revolute, one row too many."""
    m, knees = Builder(), []
    height = rng.uniform(0.5, 1.85)
    top = np.array([0.0, 0.0, height])
    plate = m.scene.add_body(1.0, (0.1, 0.1, 0.2), top, name="plate")
    m.lengths[plate] = 1.0
    for name, out in (("first", polar(0.0)), ("second", polar(np.pi / 2))):
        way = side(rng)
        low, high = 0.5 * out, 0.5 * out + top
        knee = (low + high) / 2 + way * out * np.sqrt(1.0 - (height / 2) ** 2)
        pin = np.cross(Z, out)
        lower, upper = m.link(f"{name} lower", low, knee, pin), m.link(f"{name} upper", knee, high, pin)
        m.pin(None, lower, low, pin), m.pin(lower, upper, knee, pin), m.pin(upper, plate, high, pin)
        knees.append((lower, upper, pin))
    return m.done(lambda: [from_straight(angle(along(a), along(b), n)) for a, b, n in knees])


@clear
def scissor(rng):
    """Two crossed bars under a plate, one foot fixed, one sliding, and so at the top."""
    tilt = rng.uniform(0.25, 1.2)
    m, wide, high = Builder(), 2.0 * np.cos(tilt), 2.0 * np.sin(tilt)
    corners = np.array([[0, 0, 0], [wide, high, 0], [wide, 0, 0], [0, high, 0]], float)
    one, two = m.link("rising", corners[0], corners[1]), m.link("falling", corners[3], corners[2])
    plate = m.link("plate", corners[3], corners[3] + 2.0 * polar(0.0))
    m.pin(None, one, corners[0]), m.pin(one, two, (corners[0] + corners[1]) / 2)
    m.scene.add(C.PointOnLine.at(two, m.scene.ground, point=corners[2], axis=polar(0.0), name="foot"))
    m.pin(two, plate, corners[3])
    m.scene.add(C.PointOnLine.at(one, plate, point=corners[1], axis=polar(0.0), name="head"))
    return m.done(lambda: from_straight(angle(along(two), along(one))))


@clear
def five_bar(rng):
    """Two cranks, two rods that meet: two degrees of freedom, five Revolute."""
    a, e = np.zeros(3), np.array([1.5, 0.0, 0.0])
    b, d = a + polar(rng.uniform(-np.pi, np.pi)), e + polar(rng.uniform(-np.pi, np.pi))
    if np.linalg.norm(d - b) < 0.3:
        return None
    c = meet(b, 1.6, d, 1.6, side(rng))
    if c is None:
        return None
    m = Builder()
    one, two = m.link("left crank", a, b), m.link("left rod", b, c)
    three, four = m.link("right crank", e, d), m.link("right rod", d, c)
    m.pin(None, one, a), m.pin(one, two, b), m.pin(two, four, c), m.pin(four, three, d), m.pin(three, None, e)
    return m.done(lambda: from_straight(angle(along(two), along(four))))


def door(rng):
    """A door on three hinges: ten rows too many; its branch is which way up it is."""
    turn = rng.uniform(-np.pi, np.pi)
    m = Builder()
    leaf = m.scene.add_body(20.0, (7.0, 8.2, 1.3), 0.45 * polar(turn) + Z, frame(polar(turn), Z), name="leaf")
    m.lengths[leaf] = 0.9
    for i, height in enumerate((0.2, 1.0, 1.8)):
        m.pin(None, leaf, height * Z, Z, f"hinge {i + 1}")
    return m.done(lambda: arcsine(axes(leaf)[2, 2]))


@clear
def tripod(rng):
    """Three rods on ball joints that meet in a point above the ground, or below it; each turns about itself freely."""
    feet = [1.2 * polar(x) for x in np.array([0.0, 2.0, 4.2]) + rng.uniform(-0.3, 0.3, 3)]
    top = np.array([*rng.uniform(-0.3, 0.3, 2), side(rng) * rng.uniform(0.4, 1.5)])
    m = Builder()
    rods = [m.link(f"rod {i + 1}", foot, top, (0.3, 0.1, 0.9)) for i, foot in enumerate(feet)]
    for rod, foot in zip(rods, feet, strict=True):
        m.ball(None, rod, foot)
    m.ball(rods[0], rods[1], top), m.ball(rods[1], rods[2], top)
    return m.done(lambda: arcsine(np.linalg.det(np.array([along(rod) for rod in rods]))))


MECHANISMS = {
    make.__name__: make
    for make in (
        four_bar, slider_crank, six_bar, rssr, hooke_joint, parallelogram, sarrus, scissor, five_bar, door, tripod,
    )
}  # fmt: skip
MECHANISMS["double_rocker"] = double_rocker
