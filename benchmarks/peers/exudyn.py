"""Exudyn: a kinematic tree in minimal coordinates with DOPRI5, and redundant coordinates with the index-2 trapezoid."""

import numpy as np

from tsdyn.measuring import engines

from .. import contender
from .tree import OnTrees, tree


class ExudynTree(OnTrees):
    """Hinges and slides one after another; a ball is three of them."""

    name, package, get = "Exudyn, tree", "exudyn", "pip install exudyn"
    values = tuple(10.0**-k for k in range(2, 12))  # below, its steps collapse

    def prepare(self, scene):
        """Build the system."""
        import exudyn as exu

        mbs = exu.SystemContainer().AddSystem()
        sensors, frames = self.fill(exu, mbs, scene.definition())
        mbs.Assemble()

        def run(tol):
            settings = exu.SimulationSettings()
            settings.solution.file.write = False
            settings.solution.sensors.writePeriod = scene.end
            times = settings.timeIntegration
            times.verboseMode, times.endTime = 0, scene.end
            times.numberOfSteps, times.initialStepSize = 1, 1e-3
            times.absoluteTolerance = times.relativeTolerance = tol
            times.minimumStepSize = 1e-12
            solver = exu.DynamicSolverType.DOPRI5
            seconds, reached = contender.timed(mbs.SolveDynamic, settings, solverType=solver)
            if not reached:
                raise RuntimeError("the solver didn't reach the end")
            r, A = (np.array([mbs.GetSensorValues(sensor) for sensor in row]) for row in zip(*sensors, strict=True))
            return contender.Outcome(seconds, r, A.reshape(-1, 3, 3) @ frames)

        return run

    def fill(self, exu, mbs, definition):
        """One kinematic tree; a pair of sensors a body, and its frame in the last hinge's."""
        from exudyn import utilities as ex

        joints, on, frames = tree(definition, balls=False)
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
        sensors = [
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
        return sensors, np.array(frames)


class ExudynConstraints(contender.Contender):
    """Bodies with Euler parameters, joints by multipliers, steps of one size."""

    name, package, get = "Exudyn, constraints", "exudyn", "pip install exudyn"
    setting, largest = "step", 64
    values = tuple(10.0 ** (-k / 2) for k in range(4, 11))

    def prepare(self, scene):
        """Build the system; Euler angles serve the top best, being far from where they are singular."""
        nodes = "RotationRxyz" if scene.family == "top" else "RotationEulerParameters"
        made = engines.Exudyn(scene.build(), nodes)

        def run(step):
            given = scene.end, step, 1, "TrapezoidalIndex2", contender.clock
            motion = made.run(*given, useModifiedNewton=True)
            return contender.Outcome(motion.seconds, motion.r[-1], motion.A[-1])

        return run
