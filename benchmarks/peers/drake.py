"""Drake with its Runge-Kutta method of order 5 and error control: a tree of slides and hinges, in minimal coordinates.

A ball is three hinges, about y, x and z: Drake's ball joint is singular where a chain hangs down from horizontal.
"""

import numpy as np

from ..contender import Outcome, timed
from .tree import OnTrees, tree

SCHEME = "runge_kutta5"
LONGEST = 0.1  # s, its own default for steps


class DrakeTree(OnTrees):
    """Trees of hinges and slides."""

    name = f"Drake, {SCHEME}"
    values = tuple(10.0**-k for k in range(1, 13))
    calls = 3
    get = "pip install drake"

    def version(self):
        """The package's."""
        from importlib.metadata import version

        import pydrake.multibody.plant  # noqa: F401

        return f"Drake {version('drake')}"

    def prepare(self, scene):
        """Build the plant."""
        from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

        definition = scene.definition()
        parts = tree(definition, balls=False)
        plant, carried = _plant(definition, parts)
        simulator = Simulator(plant)
        context = simulator.get_mutable_context()
        loads = [_load(parts, carried, body - 1, given["force"]) for _, body, given in definition.get("forces", ())]
        plant.get_applied_spatial_force_input_port().FixValue(context, loads)
        rates = np.array([float(one.rate) for one in parts.joints])

        def run(accuracy):
            config = SimulatorConfig(
                integration_scheme=SCHEME, accuracy=accuracy, max_step_size=LONGEST, use_error_control=True
            )
            ApplySimulatorConfig(config, simulator)
            context.SetTime(0.0)
            plant.SetPositions(context, np.zeros(rates.size))
            plant.SetVelocities(context, rates)
            simulator.Initialize()
            seconds, _ = timed(simulator.AdvanceTo, scene.end)
            poses = [plant.EvalBodyPoseInWorld(context, carried[on]) for on in parts.on]
            A = np.stack([pose.rotation().matrix() @ turn for pose, turn in zip(poses, parts.frames, strict=True)])
            r = np.stack([pose @ parts.joints[on].centre for pose, on in zip(poses, parts.on, strict=True)])
            return Outcome(seconds, r, A)

        return run


def _load(parts, carried, body, force):
    """A force at the centroid, in the ground's frame."""
    from pydrake.multibody.math import SpatialForce
    from pydrake.multibody.plant import ExternallyAppliedSpatialForce

    load, on = ExternallyAppliedSpatialForce(), parts.on[body]
    load.body_index, load.p_BoBq_B = carried[on].index(), parts.joints[on].centre
    load.F_Bq_W = SpatialForce(np.zeros(3), np.array(force, float))
    return load


def _plant(definition, parts):
    """The plant, and the bodies that its joints carry."""
    from pydrake.math import RigidTransform, RotationMatrix
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import (
        FixedOffsetFrame,
        PrismaticJoint,
        RevoluteJoint,
        RotationalInertia,
        SpatialInertia,
        UnitInertia,
    )

    plant = MultibodyPlant(time_step=0.0)
    plant.mutable_gravity_field().set_gravity_vector(definition["gravity"])
    kinds, bodies = {"hinge": RevoluteJoint, "slide": PrismaticJoint}, []
    for i, one in enumerate(parts.joints):
        if one.mass:
            J, mass = np.asarray(one.inertia), one.mass
            about = RotationalInertia(J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
            inertia = SpatialInertia.MakeFromCentralInertia(mass, one.centre, about)
        else:
            inertia = SpatialInertia(0.0, np.zeros(3), UnitInertia(0.0, 0.0, 0.0))
        body = plant.AddRigidBody(f"body{i}", inertia)
        parent = plant.world_body() if one.parent < 0 else bodies[one.parent]
        place = RigidTransform(RotationMatrix(one.turn), one.place)
        frame = plant.AddFrame(FixedOffsetFrame(f"frame{i}", parent.body_frame(), place))
        plant.AddJoint(kinds[one.kind](f"joint{i}", frame, body.body_frame(), [0, 0, 1]))
        bodies.append(body)
    plant.Finalize()
    return plant, bodies
