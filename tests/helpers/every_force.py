"""A scene in which every force acts."""

import numpy as np

import tsdyn as ts
from tests.helpers.scenes import unit

C, F = ts.constraints, ts.forces


def everything(rng):
    """Two bodies, one on a driven rod, with every force."""
    scene = ts.Scene()
    a = scene.add_body(1.2, (0.3, 0.4, 0.5), rng.normal(size=3), unit(rng, 4), name="a")
    b = scene.add_body(0.8, (0.2, 0.3, 0.4), rng.normal(size=3) + 3, unit(rng, 4), name="b")
    dot = scene.add_point_mass(0.5, (0, 0, 2), name="dot")
    scene.add(C.Spherical(a, b, point_a=(0.5, 0, 0), point_b=(0, 0.5, 0)))
    rod = scene.add(
        C.Distance(
            a, scene.ground, point_b=(0, 0, 3),
            length=(lambda t: 3 + 0.2 * np.sin(t), lambda t: 0.2 * np.cos(t), lambda t: -0.2 * np.sin(t)),
        )
    )  # fmt: skip
    scene.assemble()
    table = ts.Table(np.linspace(0, 2, 9), np.cos(np.arange(9.0)))
    scene.add(F.Spring(a, scene.ground, point_a=(0, 0, 0.3), stiffness=5, damping=0.3, actuator=table))
    scene.add(F.Spring(scene.ground, dot, stiffness=30, free_length=1.0, actuator=0.4))
    scene.add(F.TorsionalSpring(a, b, axis_a=(0, 1, 1), reference_a=(1, 0, 0), reference_b=(1, 0, 0), stiffness=2.0))
    scene.add(F.Bushing(scene.ground, b, stiffness=3, damping=0.2, torsional_stiffness=1, torsional_damping=0.1))
    scene.add(F.ViscousFriction(dot, b, damping=0.3))
    scene.add(F.CoulombFriction(a, b, force=0.3, torque=0.2, slip_velocity=0.3, slip_rate=0.3))
    scene.add(F.PointForce(dot, force=drag))
    scene.add(F.PointForce(b, force=lambda t: (np.sin(t), 0.2, t), point_a=(0.1, 0.2, 0.3), frame="body"))
    scene.add(F.Torque(a, torque=(0.1, 0.2, 0.3)))
    scene.add(F.UserForce(a, dot, function=pull, point_a=(0.1, 0, 0), parameters=(2.0,)))
    return scene, rod


def drag(t, state):
    return (-0.2 * state[7], -0.2 * state[8], 1.0 - 0.2 * state[9])


def pull(t, a, b, par, out):
    for i in range(3):
        out[i] = par[0] * (b[i] - a[i])
        out[3 + i] = -0.1 * a[10 + i]
