"""Exudyn: a kinematic tree in minimal coordinates with DOPRI5, and redundant coordinates with the index-2 trapezoid."""

import numpy as np

from ..contender import Contender, Outcome, rotation, timed
from .tree import axes, is_tree, tree


class Exudyn(Contender):
    """What both have in common."""

    get = "pip install exudyn"

    def version(self):
        """The package's."""
        import exudyn

        return f"Exudyn {exudyn.__version__}"

    def prepare(self, scene):
        """Build the system."""
        import exudyn as exu

        mbs = exu.SystemContainer().AddSystem()
        sensors = self.fill(exu, mbs, scene.definition())
        mbs.Assemble()

        def run(value):
            settings = exu.SimulationSettings()
            settings.solution.file.write = False
            settings.solution.sensors.writePeriod = scene.end
            settings.timeIntegration.verboseMode = 0
            settings.timeIntegration.endTime = scene.end
            solver = self.tune(exu, settings, scene.end, value)
            seconds, reached = timed(lambda: mbs.SolveDynamic(settings, solverType=solver))
            if not reached:
                raise RuntimeError("the solver didn't reach the end")
            r, A = (np.array([mbs.GetSensorValues(sensor) for sensor in row]) for row in zip(*sensors, strict=True))
            return Outcome(seconds, r, A.reshape(-1, 3, 3))

        return run


class ExudynTree(Exudyn):
    """Hinges and slides one after another; a ball is three of them."""

    name = "Exudyn, tree"
    values = tuple(10.0**-k for k in range(2, 12))  # below, its steps collapse

    def serves(self, scene):
        """Trees."""
        return is_tree(scene) and scene.size <= 64

    def fill(self, exu, mbs, definition):
        """One kinematic tree; returns a pair of sensors a body."""
        from exudyn import utilities as ex

        joints, on, self.frames = tree(definition, balls=False)
        kinds = {"hinge": exu.JointType.RevoluteZ, "slide": exu.JointType.PrismaticZ}
        n = len(joints)
        node = mbs.AddNode(
            ex.NodeGenericODE2(
                numberOfODE2Coordinates=n, referenceCoordinates=[0.0] * n, initialCoordinates=[0.0] * n,
                initialCoordinates_t=[joint.rate for joint in joints],
            )
        )  # fmt: skip
        one = mbs.AddObject(
            ex.ObjectKinematicTree(
                nodeNumber=node, gravity=list(definition["gravity"]),
                jointTypes=[kinds[joint.kind] for joint in joints],
                linkParents=[joint.parent for joint in joints], linkMasses=[joint.mass for joint in joints],
                jointTransformations=exu.Matrix3DList([joint.turn for joint in joints]),
                jointOffsets=exu.Vector3DList([joint.place for joint in joints]),
                linkInertiasCOM=exu.Matrix3DList([joint.inertia for joint in joints]),
                linkCOMs=exu.Vector3DList([joint.centre for joint in joints]),
            )
        )  # fmt: skip
        for _, body, arguments in definition.get("forces", ()):
            link = on[body - 1]
            marker = mbs.AddMarker(
                ex.MarkerKinematicTreeRigid(objectNumber=one, linkNumber=link, localPosition=joints[link].centre)
            )
            mbs.AddLoad(ex.LoadForceVector(markerNumber=marker, loadVector=arguments["force"]))
        return [
            tuple(
                mbs.AddSensor(
                    ex.SensorKinematicTree(
                        objectNumber=one,
                        linkNumber=link,
                        localPosition=joints[link].centre,
                        writeToFile=False,
                        outputVariableType=kind,
                    )
                )
                for kind in (exu.OutputVariableType.Position, exu.OutputVariableType.RotationMatrix)
            )
            for link in on
        ]

    def prepare(self, scene):
        """Turn the frames of the last hinges back to those of the bodies."""
        inner = super().prepare(scene)
        frames = np.array(self.frames)

        def run(value):
            outcome = inner(value)
            return outcome._replace(A=outcome.A @ frames)

        return run

    def tune(self, exu, settings, end, tol):
        """Adaptive steps."""
        time = settings.timeIntegration
        time.numberOfSteps, time.initialStepSize = 1, 1e-3
        time.absoluteTolerance = time.relativeTolerance = tol
        time.minimumStepSize = 1e-12
        return exu.DynamicSolverType.DOPRI5


class ExudynConstraints(Exudyn):
    """Bodies with Euler parameters, joints by multipliers."""

    name, setting, largest = "Exudyn, constraints", "step", 64
    values = tuple(10.0 ** (-k / 2) for k in range(4, 11))

    def fill(self, exu, mbs, definition):
        """Bodies and joints; returns a pair of sensors a body."""
        from exudyn import utilities as ex

        # Euler angles serve the top best, being far from where they are singular
        sliding = any(row[0] == "PlaneContact" for row in definition["constraints"])
        node = exu.NodeType.RotationRxyz if sliding else exu.NodeType.RotationEulerParameters
        ground = mbs.AddObject(ex.ObjectGround())
        bodies = [ground]
        for body in definition["bodies"]:
            A = rotation(np.array([body["orientation"]], float))[0]
            bodies.append(
                mbs.CreateRigidBody(
                    inertia=ex.RigidBodyInertia(body["mass"], np.array(body["inertia"], float)),
                    referencePosition=list(body["position"]), referenceRotationMatrix=A,
                    initialVelocity=list(body["velocity"]), gravity=list(definition["gravity"]),
                    initialAngularVelocity=list(A @ np.array(body["angular_velocity"], float)), nodeType=node,
                )
            )  # fmt: skip
        for kind, a, b, given in definition["constraints"]:
            points = [list(given.get(name, (0.0, 0.0, 0.0))) for name in ("point_a", "point_b")]
            if kind == "Distance":
                markers = [
                    mbs.AddMarker(ex.MarkerBodyPosition(bodyNumber=bodies[i], localPosition=at))
                    for i, at in zip((a, b), points, strict=True)
                ]
                mbs.AddObject(ex.ObjectConnectorDistance(markerNumbers=markers, distance=given["length"]))
                continue
            one = mbs.AddMarker(ex.MarkerBodyRigid(bodyNumber=bodies[a], localPosition=points[0]))
            if kind == "Spherical":
                other = mbs.AddMarker(ex.MarkerBodyRigid(bodyNumber=bodies[b], localPosition=points[1]))
                mbs.AddObject(ex.ObjectJointSpherical(markerNumbers=[one, other]))
            else:  # a plane of the ground, through its point_b
                frame = exu.HT(rotation=axes(np.array(given["normal_b"], float)), translation=points[1])
                plane = mbs.AddMarker(ex.MarkerBodyRigid(bodyNumber=ground, localHT=frame))
                mbs.AddObject(ex.ObjectJointGeneric(markerNumbers=[plane, one], constrainedAxes=[0, 0, 1, 0, 0, 0]))
        for _, body, arguments in definition.get("forces", ()):
            marker = mbs.AddMarker(ex.MarkerBodyPosition(bodyNumber=bodies[body], localPosition=[0.0, 0.0, 0.0]))
            mbs.AddLoad(ex.LoadForceVector(markerNumber=marker, loadVector=list(arguments["force"])))
        return [
            tuple(
                mbs.AddSensor(ex.SensorBody(bodyNumber=body, writeToFile=False, outputVariableType=kind))
                for kind in (exu.OutputVariableType.Position, exu.OutputVariableType.RotationMatrix)
            )
            for body in bodies[1:]
        ]

    def tune(self, exu, settings, end, step):
        """Steps of one size."""
        time = settings.timeIntegration
        time.numberOfSteps = round(end / step)
        time.newton.useModifiedNewton = True
        return exu.DynamicSolverType.TrapezoidalIndex2
