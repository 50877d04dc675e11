"""The four-bar in Exudyn: planar bodies, revolute joints, generalised-alpha. pip install exudyn."""

import data
import exudyn as exu
import exudyn.itemInterface as items
import numpy as np

STEP = 1e-3  # s

container = exu.SystemContainer()
mbs = container.AddSystem()
ground = mbs.AddObject(items.ObjectGround())
bodies, spins = [], data.rates()
velocity = np.zeros(2)
for (first, last), mass, inertia, angle, rate in zip(
    data.LINKS, data.MASSES, data.INERTIAS, data.ANGLES, spins, strict=True
):
    half = (last - first) / 2
    turned = rate * np.array([-half[1], half[0]])
    node = mbs.AddNode(
        items.NodeRigidBody2D(
            referenceCoordinates=[*(first + half), angle], initialVelocities=[*(velocity + turned), rate]
        )
    )
    velocity = velocity + 2 * turned  # of the next pin
    body = mbs.AddObject(items.ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=node))
    weight = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=body))
    mbs.AddLoad(items.LoadMassProportional(markerNumber=weight, loadVector=[0, -data.GRAVITY, 0]))
    bodies.append((body, np.linalg.norm(half)))


def marker(body, x, y=0.0):
    """A point of a body."""
    return mbs.AddMarker(items.MarkerBodyPosition(bodyNumber=body, localPosition=[x, y, 0]))


ends = [marker(ground, *data.A)]
for body, half in bodies:
    ends += [marker(body, -half), marker(body, half)]
ends.append(marker(ground, *data.D))
for a, b in zip(ends[::2], ends[1::2], strict=True):
    mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=[a, b]))
mbs.Assemble()

settings = exu.SimulationSettings()
settings.timeIntegration.endTime = data.END
settings.timeIntegration.numberOfSteps = round(data.END / STEP)
settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
settings.timeIntegration.verboseMode = 0
settings.solution.file.write = False
mbs.SolveDynamic(settings)
angle = mbs.GetNodeOutput(0, exu.OutputVariableType.Coordinates)[2] + data.ANGLES[0]
places = [np.array(mbs.GetMarkerOutput(m, exu.OutputVariableType.Position)) for m in ends]
data.report("Exudyn", angle, max(np.linalg.norm(a - b) for a, b in zip(places[::2], places[1::2], strict=True)))
