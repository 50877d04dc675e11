"""Hard cases: redundant rows, singular configurations, stiffness, instability, hundreds of bodies.

Each function builds a scene by the public interface, and may be called with other sizes. CASES lists the cases of
`tsdyn stress` with their durations, and what makes each one hard.
"""

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..constraints import (
    Cylindrical,
    Distance,
    PlaneContact,
    PointDriver,
    Revolute,
    RotationMotor,
    Spherical,
    Translational,
)
from ..forces import Spring, Torque
from ..motions import Sine, time
from ..simulation.scene import Scene
from . import rods
from .squeezer import squeezer

# Planar linkages of Revolute joints in space: three of the rows of every loop are redundant.

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
    angle=1.0, rate=6.0, base=2.0, crank=1.0, loops=1, planar=False, gravity=GRAVITY, thin=0.01, last=None, heavy=2.0
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


# Bricard's six-bar in space: mobile only by its geometry.

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 0, 1)], float)  # m


def bricard():
    """Five rods of 1 m and the ground, along edges of a cube, on six Revolutes: one row follows from the others."""
    scene = Scene(gravity=(0.0, -9.81, 0.0))
    links = [scene.ground]
    for i in range(5):
        along = CORNERS[i + 1] - CORNERS[i]
        turn = Rotation.align_vectors([along], [(1.0, 0.0, 0.0)])[0]
        links.append(scene.add_body(1.0, (1 / 1200, 1 / 12, 1 / 12), CORNERS[i] + along / 2, turn, name=f"rod {i}"))
    for i in range(6):
        axis = np.cross(CORNERS[i] - CORNERS[i - 1], CORNERS[(i + 1) % 6] - CORNERS[i])
        scene.add(Revolute.at(links[i], links[(i + 1) % 6], point=CORNERS[i], axis=axis))
    return scene


# A flyball governor.


def governor(stiffness=300.0, damping=5.0):
    """Return a flyball governor: a spinning shaft, a sleeve on a damped spring, two balls."""
    scene, angle, arm, rate = Scene(), 0.6, 0.5, 8.0
    omega, low = (0.0, 0.0, rate), (0.0, 0.0, -2.0 * arm * np.cos(angle))
    shaft = scene.add_body(2.0, (0.02, 0.02, 0.01), angular_velocity=omega, name="shaft")
    sleeve = scene.add_body(1.0, (0.01, 0.01, 0.01), position=low, angular_velocity=omega, name="sleeve")
    scene.add(Revolute.at(scene.ground, shaft, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(Translational.at(shaft, sleeve, point=low, axis=(0, 0, 1)))
    for side in (1.0, -1.0):
        x = side * arm * np.sin(angle)
        ball = scene.add_body(
            3.0, (0.05, 0.06, 0.04), (x, 0.0, low[2] / 2), velocity=(0.0, rate * x, 0.0), angular_velocity=omega
        )
        scene.add(Revolute.at(shaft, ball, point=(0, 0, 0), axis=(0, 1, 0)))
        scene.add(Distance(ball, sleeve))
    scene.add(Spring(shaft, sleeve, stiffness=stiffness, damping=damping))
    return scene


# One body each: a sleeping top, Kapitza's pendulum, upside down on a pivot that shakes, and one that is struck.

HEIGHT, FREQUENCY = 0.05, 120.0  # m, rad/s: of Kapitza's pivot
STRUCK, WIDTH = 61.8, 0.05  # s: when a pendulum is struck, and for how long


def sleeping_top(spin=11.5):
    """Return a heavy top upright on its tip, which slides: unstable for spins below sqrt(115.2) = 10.73 rad/s."""
    scene = Scene(gravity=(0.0, 0.0, -9.6))
    top = scene.add_body(30.0, (90.0, 90.0, 30.0), (0.0, 0.0, 1.0), angular_velocity=(1e-12, 1e-12, spin), name="top")
    scene.add(PlaneContact(top, scene.ground, point_a=(0.0, 0.0, -1.0), normal_b=(0.0, 0.0, 1.0), name="tip"))
    return scene


def kapitza(start=0.3, length=0.5):
    """Return a rod upside down, off by an angle, on a pivot that shakes by HEIGHT cos(FREQUENCY t): it stays up."""
    scene = Scene()
    rod = scene.add_body(
        1.0,
        (0.1, 0.1, 0.02),
        (length * np.sin(start), 0.0, HEIGHT + length * np.cos(start)),
        (np.cos(start / 2), 0.0, np.sin(start / 2), 0.0),
        name="rod",
    )
    path = 0.0, 0.0, Sine(HEIGHT, FREQUENCY, phase=np.pi / 2)
    scene.add(PointDriver(scene.ground, rod, point_b=(0.0, 0.0, -length), path=path, name="pivot"))
    return scene


def struck():
    """Return a pendulum that swings slowly, until a bump of torque strikes it."""
    scene = Scene(gravity=(0.0, 0.0, -0.01))
    rod = scene.add_body(1.0, (0.1, 0.1, 0.02), (0.1, 0.0, -0.49), (np.cos(0.1), 0.0, -np.sin(0.1), 0.0), name="rod")
    scene.add(Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    bump = 4.0 * np.exp(-(((time - STRUCK) / WIDTH) ** 2))
    scene.add(Torque(rod, torque=(0.0, bump, 0.0), name="strike"))
    return scene


# The cases of `tsdyn stress`.


class Case(NamedTuple):
    """A scene, how long it runs, and the fixed steps that show the order of a method."""

    name: str
    build: Callable  # () -> Scene
    end: float  # s
    steps: tuple[float, int]  # end, s, and number of the coarsest steps of the runs with fixed steps
    hard: str  # what makes it hard
    agree: float = 0.0  # s, until when two methods are compared, where the motion is chaotic; 0 for the end


def hub(bodies=500):
    """Return a heavy wheel on a spherical joint, and rods around it."""
    return rods.build(rods.hub(bodies - 1))


def net(rows=20, columns=25):
    """Return a flat net of square meshes, a rod an edge, hung from two corners."""
    return rods.build(rods.net(rows, columns))


def _four_bars(loops, end):
    count = "one loop" if loops == 1 else f"{loops} loops"
    return Case(
        f"four-bars, {count}",
        partial(four_bars, loops),
        end,
        (0.5, 50),
        f"{3 * loops} redundant rows; flat twice a turn, where {loops + 1} directions are free and branches meet",
    )


CASES = (
    *(_four_bars(loops, 100.0 if loops < 40 else 10.0) for loops in (1, 2, 5, 40)),
    Case("Bricard's six-bar", bricard, 100.0, (1.0, 100), "mobile by its geometry alone: one row is redundant"),
    Case(
        "Andrews' squeezer",
        squeezer,
        0.03,
        (0.01, 300),
        "three loops, 9 redundant rows; the crank turns 16 rad within 0.03 s",
    ),
    Case("flyball governor", governor, 100.0, (1.0, 100), "a spring and damper between bodies that spin fast"),
    Case(
        "slider-crank",
        slider_crank,
        100.0,
        (0.15, 20),
        "equal crank and rod: at its dead centre the slider may stay, and branches meet",
    ),
    Case("six-bars, 5 loops", six_bars, 5.0, (0.5, 100), "15 redundant rows; chaotic", agree=1.5),
    Case(
        "driven six-bar",
        driven_six_bar,
        2.0,
        (0.5, 100),
        "8 redundant rows, five of them of a doubled hinge; rows that are kept at the start become dependent",
    ),
    Case("sleeping top", sleeping_top, 600.0, (0.5, 160), "upright, 7 % above the spin at which it falls"),
    Case("Kapitza's pendulum", kapitza, 10.0, (0.2, 200), "upside down, held up by a pivot that shakes at 19 Hz"),
    Case("struck pendulum", struck, 100.0, (2.0, 20), "a torque acts for a thousandth of the run"),
    Case("hub of 500 bodies", hub, 1.0, (0.1, 10), "499 rods on one body: a dense block in the Schur complement"),
    Case("net of 500 loops", net, 0.25, (0.02, 4), "1045 rods, 500 loops: the factors of the Schur complement fill"),
)
