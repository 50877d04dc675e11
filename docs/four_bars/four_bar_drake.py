"""The four-bar in Drake: revolute joints along a tree, a ball constraint that closes the loop. pip install drake."""

import data
import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator

STEP = 1e-3  # s

plant = MultibodyPlant(time_step=STEP)
plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
plant.mutable_gravity_field().set_gravity_vector([0, -data.GRAVITY, 0])
lengths = 0.3, 0.9, 0.7
bodies = []
for i, (mass, inertia, length) in enumerate(zip(data.MASSES, data.INERTIAS, lengths, strict=True)):
    unit = inertia / mass
    about_pin = UnitInertia(unit, unit, unit).ShiftFromCenterOfMass([-length / 2, 0, 0])
    spatial = SpatialInertia(mass, [length / 2, 0, 0], about_pin)
    bodies.append(plant.AddRigidBody(f"link{i}", spatial))
crank, coupler, rocker = bodies


def pin(name, parent, place, child):
    """A hinge about z at a place of the parent, at the start of the child."""
    frame = plant.AddFrame(FixedOffsetFrame(name, parent.body_frame(), RigidTransform([*place, 0])))
    return plant.AddJoint(RevoluteJoint(name, frame, child.body_frame(), [0, 0, 1]))


bearing = pin("bearing", plant.world_body(), data.A, crank)
knee = pin("knee", crank, (0.3, 0), coupler)
far = pin("far", plant.world_body(), data.D, rocker)
plant.AddBallConstraint(coupler, [0.9, 0, 0], rocker, [0.7, 0, 0])
plant.Finalize()

simulator = Simulator(plant)
context = simulator.get_mutable_context()
first, second, third = data.ANGLES
rates = data.rates()
for joint, angle, rate in (
    (bearing, first, rates[0]), (knee, second - first, rates[1] - rates[0]), (far, third + np.pi, rates[2]),
):  # fmt: skip
    joint.set_angle(context, angle)
    joint.set_angular_rate(context, rate)
simulator.AdvanceTo(data.END)
ends = [
    plant.EvalBodyPoseInWorld(context, body) @ np.array([length, 0, 0])
    for body, length in ((coupler, 0.9), (rocker, 0.7))
]
data.report("Drake", bearing.get_angle(context), np.linalg.norm(ends[0] - ends[1]))
