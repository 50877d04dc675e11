"""Planar linkages of Revolute joints in space: three of the rows of every loop are redundant."""

from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from ...constraints import Cylindrical, PlaneContact, Revolute, RotationMotor, Spherical, Translational
from ...motions import Sine
from ...simulation.scene import Scene

AXIS = (0.0, 0.0, 1.0)
GRAVITY = (0.0, -9.81, 0.0)  # m/s^2


def polar(angle, length=1.0):
    """Return the vector of a length at an angle from x towards y."""
    return length * np.array([np.cos(angle), np.sin(angle), 0.0])


def rod(scene, first, last, mass=1.0, name="", velocity=(0.0, 0.0, 0.0), rate=0.0, thin=0.01):
    """Add a rod between two points, its x axis along it; `thin` is its inertia about that axis."""
    first, last = np.array(first, float), np.array(last, float)
    along = last - first
    J = mass * (along @ along) / 12 + 0.01
    turn = Rotation.from_rotvec((0.0, 0.0, np.arctan2(along[1], along[0])))
    return scene.add_body(mass, (thin, J, J), (first + last) / 2, turn, velocity, (0.0, 0.0, rate), name)


def pin(scene, a, b, place, planar=False, kind=None):
    """Add a Revolute, or the two of its rows that a planar motion needs, or a joint of another kind."""
    if kind == "spherical":
        return scene.add(Spherical.at(a, b, point=place))
    if kind == "cylindrical":
        return scene.add(Cylindrical.at(a, b, point=place, axis=AXIS))
    if not planar:
        return scene.add(Revolute.at(a, b, point=place, axis=AXIS))
    for normal in np.eye(3)[:2]:
        scene.add(PlaneContact.at(a, b, point=place, normal=normal))
    return None


def parallelogram(  # many arguments, by name: each makes another mechanism
    angle=1.0,
    rate=6.0,
    base=2.0,
    crank=1.0,
    loops=1,
    planar=False,
    gravity=GRAVITY,
    thin=0.01,
    last=None,
    heavy=2.0,
):
    """Cranks side by side, turning at a rate, and couplers between them: flat, and singular, twice a turn.

    `last` is the kind of the joint between a coupler and the crank after it, `heavy` a coupler's mass.
    """
    scene = Scene(gravity=gravity)
    arm = polar(angle, crank)
    speed = rate * np.array([-arm[1], arm[0], 0.0])
    cranks = []
    for i in range(loops + 1):
        foot = np.array([i * base, 0.0, 0.0])
        cranks.append(rod(scene, foot, foot + arm, name=f"crank {i}", velocity=speed / 2, rate=rate, thin=thin))
        pin(scene, scene.ground, cranks[i], foot)
    for i in range(loops):
        near, far = np.array([i * base, 0.0, 0.0]) + arm, np.array([(i + 1) * base, 0.0, 0.0]) + arm
        coupler = rod(scene, near, far, heavy, f"coupler {i}", speed, thin=thin)
        pin(scene, cranks[i], coupler, near)
        pin(scene, coupler, cranks[i + 1], far, planar, last)
    return scene


def four_bars(loops=1):
    """Parallelograms of equal links in a row, released upright with unit speed of the couplers."""
    return parallelogram(0.5 * np.pi, -1.0, base=1.0, loops=loops, heavy=1.0)


def six_bars(loops=5):
    """Loops of six links in a row: legs of a shank and a thigh, released from rest with bent knees."""
    scene = Scene(gravity=GRAVITY)
    shank, thigh = polar(1.1), polar(1.9)
    ends = []
    for i in range(loops + 1):
        foot = np.array([1.2 * i, 0.0, 0.0])
        lower = rod(scene, foot, foot + shank, name=f"shank {i}")
        upper = rod(scene, foot + shank, foot + shank + thigh, name=f"thigh {i}")
        pin(scene, scene.ground, lower, foot)
        pin(scene, lower, upper, foot + shank)
        ends.append((upper, foot + shank + thigh))
    for i, ((left, near), (right, far)) in enumerate(pairwise(ends)):
        coupler = rod(scene, near, far, name=f"coupler {i}")
        pin(scene, left, coupler, near)
        pin(scene, coupler, right, far)
    return scene


PINS = (0.0, 0.0), (-0.99, -0.68), (-1.13, -1.01), (0.15, -0.87), (0.37, -0.93), (0.43, -0.35)  # m, in the plane
TILT = -1.54, 0.85, -0.75  # rad, rotation vector of the plane
FRAMES = (0.4, 1.4, 2.0), (-2.4, 0.1, -1.8), (-2.2, 1.4, 0.0), (-0.6, 0.5, -1.6), (-0.4, -0.5, -0.6)  # of the rods


def driven_six_bar():
    """Loop of six links in a tilted plane, its third hinge doubled; a motor swings the first link by 0.27 rad.

    Body frames are in general position: which rows of the loop are nearly dependent changes along the motion.
    """
    scene, tilt = Scene(gravity=(-8.2, 1.3, -5.2)), Rotation.from_rotvec(TILT)
    pins, axis, links = tilt.apply([(*pin, 0.0) for pin in PINS]), tilt.apply(AXIS), [scene.ground]
    for i, mass in enumerate((0.73, 0.58, 0.83, 2.14, 0.87)):
        frame, middle = Rotation.from_rotvec(FRAMES[i]), (pins[i] + pins[i + 1]) / 2
        links.append(scene.add_body(mass, (0.1, 0.12, 0.15), middle, frame, name=f"rod {i}"))
    for i, pin in enumerate(pins):
        scene.add(Revolute.at(links[i], links[(i + 1) % 6], point=pin, axis=axis))
    scene.add(Revolute.at(links[2], links[3], point=pins[2] + 0.5 * axis, axis=axis))
    scene.add(RotationMotor.at(scene.ground, links[1], point=pins[0], axis=axis, angle=Sine(0.27, 5.4), name="motor"))
    scene.assemble()
    return scene


def slider_crank(rate=4.0):
    """Crank and rod of equal lengths: at its dead centre the slider is at the crank's foot, where branches meet."""
    scene = Scene(gravity=GRAVITY)
    angle = 0.25 * np.pi
    knee, slide = polar(angle), np.array([2.0 * np.cos(angle), 0.0, 0.0])
    turn = rate * np.array([-knee[1], knee[0], 0.0])  # of the knee
    push = np.array([-2.0 * rate * np.sin(angle), 0.0, 0.0])
    crank = rod(scene, np.zeros(3), knee, name="crank", velocity=turn / 2, rate=rate)
    link = rod(scene, knee, slide, name="rod", velocity=(turn + push) / 2, rate=-rate)
    slider = scene.add_body(2.0, (0.1, 0.1, 0.1), slide, velocity=push, name="slider")
    pin(scene, scene.ground, crank, np.zeros(3))
    pin(scene, crank, link, knee)
    pin(scene, link, slider, slide)
    scene.add(Translational.at(slider, scene.ground, point=slide, axis=(1.0, 0.0, 0.0)))
    return scene
