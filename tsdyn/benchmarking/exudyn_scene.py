"""A ts.Scene in Exudyn: Euler parameters, joints by multipliers, generalised-alpha of index 3 or trapezoid."""

import time

import numpy as np

from ..elements.bodies import rotation_matrix

# Loads that other engines can have.


def is_constant(value):
    """Whether a load is finite numbers, not a function of time or state."""
    try:
        return bool(np.isfinite(np.asarray(value, float)).all())
    except (TypeError, ValueError):
        return False


# A ts.Scene in Exudyn: bodies with Euler parameters, joints by multipliers, generalised-alpha of index 3 or trapezoid.
#
# `refused` names what it has no counterpart for.

LOCKED = {  # displacements along and rotations about the axes of a joint, the last of which is its own
    "Revolute": (1, 1, 1, 1, 1, 0),
    "Cylindrical": (1, 1, 0, 1, 1, 0),
    "Planar": (0, 0, 1, 1, 1, 0),
    "Fixed": (1, 1, 1, 1, 1, 1),
    "Translational": (1, 1, 0, 1, 1, 1),
    "PlaneContact": (0, 0, 1, 0, 0, 0),
}
TAKEN = (
    *LOCKED,
    "EulerNormalization",
    "Spherical",
    "Distance",
    "Spring",
    "TorsionalSpring",
    "Bushing",
    "Torque",
    "PointForce",
)
OUTPUTS = 200
MANY = 100  # bodies from which on the sparse solver is the faster one


def frame(z, x=None):
    """A rotation matrix with columns x, z x x, z; any x across z where it isn't given."""
    z = np.asarray(z, float) / np.linalg.norm(z)
    x = np.cross(np.eye(3)[np.abs(z).argmin()], z) if x is None else np.asarray(x, float)
    x = x / np.linalg.norm(x)
    return np.stack((x, np.cross(z, x), z), axis=1)


def refused(scene):
    """Constraints and forces of a scene that have no counterpart, with the reason."""
    found = [(item, f"{item._kind()} has no counterpart") for item in (*scene.constraints, *scene.forces)
             if item._kind() not in TAKEN]  # fmt: skip
    for item in scene.forces:
        load = {"Torque": "torque", "PointForce": "force", "Spring": "actuator", "TorsionalSpring": "actuator"}.get(
            item._kind()
        )
        if load and not _is_plain(item, load):
            found.append((item, f"{load} must be constant, in ground axes"))
        elif load == "actuator" and getattr(item, load):
            found.append((item, "an actuator has no counterpart"))
    return found


def _is_plain(item, load):
    """Whether a load is constant, in the ground frame."""
    return is_constant(getattr(item, load)) and getattr(item, "frame", "ground") == "ground"


class ExudynScene:
    """The scene; `run` begins at its start."""

    def __init__(self, scene):
        import exudyn as exu
        from exudyn import utilities as ex

        self.exu, self.ex, self.scene = exu, ex, scene
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.bodies = {scene.ground: self.mbs.AddObject(ex.ObjectGround())}
        self.particles = {body for body in scene.bodies if not hasattr(body, "inertia")}
        for body in scene.bodies:
            self.bodies[body] = self._particle(body) if body in self.particles else self._rigid_body(body)
        for item in (*scene.constraints, *scene.forces):
            getattr(self, f"_{type(item).__name__.lower()}", self._joint)(item)
        output = exu.OutputVariableType
        kinds = output.Position, output.RotationMatrix, output.Velocity, output.AngularVelocityLocal
        self.sensors = [
            [self._sensor(body, kind) for body in scene.bodies if not i % 2 or body not in self.particles]
            for i, kind in enumerate(kinds)
        ]
        self.mbs.Assemble()

    def _particle(self, body):
        return self.mbs.CreateMassPoint(
            physicsMass=body.mass, referencePosition=list(body.position), initialVelocity=list(body.velocity),
            gravity=list(self.scene.gravity), returnDict=True,
        )["bodyNumber"]  # fmt: skip

    def _rigid_body(self, body):
        A = rotation_matrix(np.asarray(body.orientation))
        return self.mbs.CreateRigidBody(
            inertia=self.ex.RigidBodyInertia(body.mass, np.asarray(body.inertia)), gravity=list(self.scene.gravity),
            referencePosition=list(body.position), referenceRotationMatrix=A,
            initialVelocity=list(body.velocity), initialAngularVelocity=list(A @ body.angular_velocity),
            nodeType=self.exu.NodeType.RotationEulerParameters,
        )  # fmt: skip

    def _marker(self, body, place, turn=None):
        if body in self.particles:
            return self.mbs.AddMarker(self.ex.MarkerBodyPosition(bodyNumber=self.bodies[body]))
        at = self.exu.HT(rotation=np.eye(3) if turn is None else turn, translation=list(place))
        return self.mbs.AddMarker(self.ex.MarkerBodyRigid(bodyNumber=self.bodies[body], localHT=at))

    def _sensor(self, body, kind):
        return self.mbs.AddSensor(
            self.ex.SensorBody(bodyNumber=self.bodies[body], storeInternal=True, outputVariableType=kind)
        )

    def _pointforce(self, load):
        one = self._marker(load.a, load.coordinates[0])
        self.mbs.AddLoad(self.ex.LoadForceVector(markerNumber=one, loadVector=list(load.force)))

    def _eulernormalization(self, _):
        """Exudyn has its own."""

    def _joint(self, joint):
        """Planes are normal to the second axis, which the others share."""
        point_a, point_b, *axes = joint.coordinates
        turns = [frame(axes[-1])] * 2 if len(axes) == 1 else [frame(z, *x) for z, *x in (axes[::2], axes[1::2])]
        pair = [self._marker(joint.a, point_a, turns[0]), self._marker(joint.b, point_b, turns[1])]
        if type(joint).__name__ == "PlaneContact":
            pair = pair[::-1]  # the plane is of the first
        locked = list(LOCKED[type(joint).__name__])
        self.mbs.AddObject(self.ex.ObjectJointGeneric(markerNumbers=pair, constrainedAxes=locked))

    def _spherical(self, joint):
        pair = [self._marker(body, place) for body, place in zip((joint.a, joint.b), joint.coordinates, strict=True)]
        self.mbs.AddObject(self.ex.ObjectJointSpherical(markerNumbers=pair))

    def _distance(self, rod):
        pair = [self._marker(body, place) for body, place in zip((rod.a, rod.b), rod.coordinates, strict=True)]
        self.mbs.AddObject(self.ex.ObjectConnectorDistance(markerNumbers=pair, distance=rod.length))

    def _spring(self, spring):
        pair = [self._marker(body, place) for body, place in zip((spring.a, spring.b), spring.coordinates, strict=True)]
        self.mbs.AddObject(
            self.ex.ObjectConnectorSpringDamper(
                markerNumbers=pair, referenceLength=spring.free_length, stiffness=spring.stiffness,
                damping=spring.damping,
            )
        )  # fmt: skip

    def _torsionalspring(self, spring):
        axis, *references = spring.coordinates[:3]
        A, B = (rotation_matrix(np.asarray(body.orientation)) for body in (spring.a, spring.b))
        turns = [frame(z, x) for z, x in zip((axis, B.T @ A @ axis), references, strict=True)]
        pair = [self._marker(b, (0.0, 0.0, 0.0), A) for b, A in zip((spring.a, spring.b), turns, strict=True)]
        self.mbs.AddObject(
            self.ex.ObjectConnectorTorsionalSpringDamper(
                markerNumbers=pair, stiffness=spring.stiffness, damping=spring.damping, offset=spring.free_angle
            )
        )

    def _bushing(self, bushing):
        """With angles of another kind, equal to first order."""
        pair = [
            self._marker(body, place)
            for body, place in zip((bushing.a, bushing.b), bushing.coordinates[:2], strict=True)
        ]
        self.mbs.AddObject(
            self.ex.ObjectConnectorRigidBodySpringDamper(
                markerNumbers=pair,
                stiffness=np.diag(np.concatenate((bushing.stiffness, bushing.torsional_stiffness))),
                damping=np.diag(np.concatenate((bushing.damping, bushing.torsional_damping))),
            )
        )

    def _torque(self, motor):
        one = self._marker(motor.a, (0.0, 0.0, 0.0))
        self.mbs.AddLoad(self.ex.LoadTorqueVector(markerNumber=one, loadVector=list(motor.torque)))

    def run(self, end, step, outputs=OUTPUTS, dependent=False, solver=None):
        """((r, A, v, omega) at the outputs, seconds); None where the solver gave up. Particles have no A and omega.

        With dependent rows by a dense solver that allows for these. solver: the name of a DynamicSolverType.
        """
        settings = self.exu.SimulationSettings()
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = max(end / outputs, step)
        times = settings.timeIntegration
        times.numberOfSteps, times.endTime, times.verboseMode = round(end / step), end, 0
        if dependent:
            settings.linearSolver.solverType = self.exu.LinearSolverType.EigenDense
            settings.linearSolver.ignoreSingularJacobian = True
        elif len(self.scene.bodies) >= MANY:
            settings.linearSolver.solverType = self.exu.LinearSolverType.EigenSparse
        begun = time.perf_counter()
        try:
            kind = getattr(self.exu.DynamicSolverType, solver or "GeneralizedAlpha")
            done = self.mbs.SolveDynamic(settings, solverType=kind)
        except (ValueError, RuntimeError):
            return None
        seconds = time.perf_counter() - begun
        if not done:
            return None
        self.times = np.asarray(self.mbs.GetSensorStoredData(self.sensors[0][0]))[:, 0]
        found = [self._stored(row) for row in self.sensors]
        found[1] = found[1].reshape(*found[1].shape[:2], 3, 3)
        return tuple(found), seconds

    def _stored(self, row):
        """What sensors have stored, (outputs, sensors, numbers)."""
        stored = [np.asarray(self.mbs.GetSensorStoredData(one))[:, 1:] for one in row]
        return np.stack(stored, axis=1) if stored else np.zeros((len(self.times), 0, 9))
