"""Stiff scenes: their parameters and the eigenvalues that make them stiff.

jointed   a planar double pendulum of rods 1 m long, m = 1 kg, I = 0.1 kg m^2, released at rest 45 degrees from hanging;
a torsional spring and damper at the second joint, k = 1e6 N m/rad and c = 1e3 N m s/rad, keeps it straight. The fast
mode has |lambda| near 1e4 1/s
hung      two particles of 1 kg in a row, 1 m apart, on a spring and damper, k = 1e5 N/m and c = 1e5 N s/m, the first at
the end of a rigid 1 m link; released at rest 45 degrees from hanging. The fast mode is overdamped, |lambda| near 2e5
1/s, the slow mode of the spring decays with k / c = 1 1/s
mounted   four blocks in a row on bushings, critically damped or more
pushed    eight blocks in a row on springs and rough ground, friction 2 N v / |(v, 1 mm/s)|: while a block sticks,
|lambda| is 2e3 1/s
net       32 x 32 particles on springs along the lines of a grid
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

import tsdyn as ts

Y = (0.0, 1.0, 0.0)
RELEASE = np.radians(45.0)  # from hanging


def hinge(scene, a, b, point_a, point_b):
    """A revolute joint about y, of five rows."""
    scene.add(ts.constraints.Spherical(a, b, point_a=point_a, point_b=point_b))
    for axis in ((1, 0, 0), (0, 0, 1)):
        scene.add(ts.constraints.Dot1(a, b, axis_a=axis, axis_b=Y))


def revolute(scene, a, b, point_a, point_b):
    """The same as one joint, which other engines have."""
    scene.add(ts.constraints.Revolute(a, b, point_a=point_a, point_b=point_b, axis_a=Y, axis_b=Y))


def jointed(scale=1.0, release=RELEASE, joint=hinge):
    """The double pendulum with a stiff joint; scale multiplies stiffness and damping."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81))
    along, turn = np.array([np.sin(release), 0.0, -np.cos(release)]), np.pi / 4 - release / 2
    rods = [
        scene.add_body(
            mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0.5 + i) * along,
            orientation=(np.cos(turn), 0.0, np.sin(turn), 0.0), name=name,
        )
        for i, name in enumerate(("upper", "lower"))
    ]  # fmt: skip
    joint(scene, scene.ground, rods[0], (0, 0, 0), (-0.5, 0, 0))
    joint(scene, rods[0], rods[1], (0.5, 0, 0), (-0.5, 0, 0))
    scene.add(
        ts.forces.TorsionalSpring(
            rods[0],
            rods[1],
            axis_a=Y,
            reference_a=(1, 0, 0),
            reference_b=(1, 0, 0),
            stiffness=1e6 * scale,
            damping=1e3 * scale,
        )
    )
    return scene


def hung(scale=1.0, release=RELEASE, count=2):
    """Particles on overdamped springs below a link; scale multiplies stiffness and damping."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81))
    along = np.array([np.sin(release), 0.0, -np.cos(release)])
    beads = [scene.add_point_mass(1.0, (1.0 + i) * along, name=f"bead{i + 1}") for i in range(count)]
    scene.add(ts.constraints.Distance(beads[0], scene.ground))
    for a, b in pairwise(beads):
        scene.add(ts.forces.Spring(a, b, stiffness=1e5 * scale, damping=1e5 * scale))
    return scene


def mounted(stiffness, count=4):
    """Blocks in a row, each on a bushing at the one before, critically damped or more; the first is pushed."""
    scene, before = ts.Scene(gravity=(0.0, 0.0, -9.81)), None
    mount = {"stiffness": stiffness, "damping": 1e-2 * stiffness}
    mount |= {"torsional_stiffness": stiffness, "torsional_damping": 1e-2 * stiffness}
    for i in range(count):
        block = scene.add_body(1.0, (0.01, 0.02, 0.02), (0.3 * (i + 0.5), 0.0, 0.0), velocity=(0.0, 0.5, 0.0))
        a, point = (scene.ground, (0.0, 0.0, 0.0)) if before is None else (before, (0.15, 0.0, 0.0))
        scene.add(ts.forces.Bushing(a, block, point_a=point, point_b=(-0.15, 0.0, 0.0), **mount))
        before = block
    return scene


class Row(NamedTuple):
    """What a row of blocks is made of."""

    stiffness: float = 1e4  # N/m
    damping: float = 2.0  # N s/m
    friction: float = 2.0  # N, on each block
    slip: float = 1e-3  # m/s
    push: float = 25.0  # N
    rate: float = 10.0  # rad/s


ROW = Row()


def pushed(blocks=8):
    """Blocks of 1 kg on rough ground in a row on springs, the first pushed to and fro: they stick and slip in turn."""
    scene, last = ts.Scene(gravity=(0.0, 0.0, 0.0)), None
    for i in range(blocks):
        block = scene.add_point_mass(1.0, (0.1 * i, 0.0, 0.0))
        scene.add(ts.forces.CoulombFriction(block, scene.ground, force=ROW.friction, slip_velocity=ROW.slip))
        if last is None:
            scene.add(ts.forces.PointForce(block, force=_push))
        else:
            scene.add(ts.forces.Spring(last, block, stiffness=ROW.stiffness, damping=ROW.damping))
        last = block
    return scene


def _push(t):
    return (ROW.push * np.sin(ROW.rate * t), 0.0, 0.0)


def net(side=32):
    """Particles on stiff damped springs along the lines of a grid, held at its corners; sags under its weight."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81))
    knots = {(i, j): scene.add_point_mass(0.01, (0.1 * i, 0.1 * j, 0.0)) for i in range(side) for j in range(side)}
    law = {"stiffness": 1e5, "damping": 10.0}
    for (i, j), knot in knots.items():
        for other in ((i + 1, j), (i, j + 1)):
            if other in knots:
                scene.add(ts.forces.Spring(knot, knots[other], **law))
        if {i, j} <= {0, side - 1}:
            scene.add(ts.constraints.Spherical(knot, scene.ground, point_b=knot.position))
    return scene
