"""Stiff scenes, fully stated: what they are made of, and how stiff they are.

jointed   a planar double pendulum of rods 1 m long, m = 1 kg, I = 0.1 kg m^2, released at rest from the horizontal;
a torsional spring and damper at the second joint, k = 1e6 N m/rad and c = 1e3 N m s/rad, keeps it straight
hung      three particles of 1 kg in a row, 1 m apart, on springs and dampers, k = 1e5 N/m and c = 1e5 N s/m, the
first at the end of a rigid 1 m link; released from the horizontal. The fast modes are overdamped,
|lambda| from 1e5 to 3e5 1/s, the slow modes of the springs decay with k / c = 1 s
"""

from itertools import pairwise

import tsdyn as ts

Y = (0.0, 1.0, 0.0)


def hinge(scene, a, b, point_a, point_b):
    """A revolute joint about y, of five rows."""
    scene.add(ts.constraints.Spherical(a, b, point_a=point_a, point_b=point_b))
    for axis in ((1, 0, 0), (0, 0, 1)):
        scene.add(ts.constraints.Dot1(a, b, axis_a=axis, axis_b=Y))


def jointed(scale=1.0):
    """The double pendulum with a stiff joint; scale multiplies stiffness and damping."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81))
    rods = [
        scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0.5 + i, 0.0, 0.0), name=name)
        for i, name in enumerate(("upper", "lower"))
    ]
    hinge(scene, scene.ground, rods[0], (0, 0, 0), (-0.5, 0, 0))
    hinge(scene, rods[0], rods[1], (0.5, 0, 0), (-0.5, 0, 0))
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


def hung(scale=1.0):
    """Particles on overdamped springs below a link; scale multiplies stiffness and damping."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81))
    beads = [scene.add_point_mass(1.0, (1.0 + i, 0.0, 0.0), name=f"bead{i + 1}") for i in range(3)]
    scene.add(ts.constraints.Distance(beads[0], scene.ground))
    for a, b in pairwise(beads):
        scene.add(ts.forces.Spring(a, b, stiffness=1e5 * scale, damping=1e5 * scale))
    return scene
