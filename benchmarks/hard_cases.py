"""The gallery of hard cases in Exudyn, beside tsdyn: largest gap of a joint, energy error, time.

Exudyn: bodies with Euler parameters, joints by multipliers, generalised-alpha of index 3, its usual choice, with steps
of one size; where rows depend on others, its dense solver, which allows that. Kapitza's pendulum, whose pivot is
driven, and scenes of hundreds of bodies with dependent rows are left out. tsdyn: the default method.

Energy errors are relative to the largest kinetic energy; those of cases with dampers and motors aren't given.

Run it: python -m benchmarks.hard_cases [case ...] [--step 1e-3] [--seconds 10]
"""

import argparse
import time

import numpy as np

import tsdyn as ts
from tsdyn.elements.bodies import rotation_matrix
from tsdyn.stress.gallery.cases import CASES

LOCKED = {  # displacements along and rotations about the axes of a joint, the last of which is its own
    "Revolute": (1, 1, 1, 1, 1, 0),
    "Translational": (1, 1, 0, 1, 1, 1),
    "PlaneContact": (0, 0, 1, 0, 0, 0),
}
DENSE = 600  # rows that a dense solver takes in a reasonable time
MANY = 100  # bodies of a case that is taken by a sparse solver; none of these has dependent rows
OUTPUTS = 200


def frame(z, x=None):
    """A rotation matrix with columns x, z x x, z; any x across z where it isn't given."""
    z = np.asarray(z, float) / np.linalg.norm(z)
    x = np.cross(np.eye(3)[np.abs(z).argmin()], z) if x is None else np.asarray(x, float)
    x = x / np.linalg.norm(x)
    return np.stack((x, np.cross(z, x), z), axis=1)


class Exudyn:
    """A scene of the gallery in Exudyn."""

    def __init__(self, scene):
        import exudyn as exu
        from exudyn import utilities as ex

        self.exu, self.ex, self.scene = exu, ex, scene
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.bodies = {scene.ground: self.mbs.AddObject(ex.ObjectGround())}
        for body in scene.bodies:
            A = rotation_matrix(np.asarray(body.orientation))
            self.bodies[body] = self.mbs.CreateRigidBody(
                inertia=ex.RigidBodyInertia(body.mass, np.asarray(body.inertia)), gravity=list(scene.gravity),
                referencePosition=list(body.position), referenceRotationMatrix=A,
                initialVelocity=list(body.velocity), initialAngularVelocity=list(A @ body.angular_velocity),
                nodeType=exu.NodeType.RotationEulerParameters,
            )  # fmt: skip
        for item in (*scene.constraints, *scene.forces):
            getattr(self, f"_{type(item).__name__.lower()}", self._joint)(item)
        output = exu.OutputVariableType
        self.sensors = [
            [self._sensor(body, kind) for body in scene.bodies]
            for kind in (output.Position, output.RotationMatrix, output.Velocity, output.AngularVelocityLocal)
        ]
        self.mbs.Assemble()

    def _marker(self, body, place, turn=None):
        at = self.exu.HT(rotation=np.eye(3) if turn is None else turn, translation=list(place))
        return self.mbs.AddMarker(self.ex.MarkerBodyRigid(bodyNumber=self.bodies[body], localHT=at))

    def _sensor(self, body, kind):
        return self.mbs.AddSensor(
            self.ex.SensorBody(bodyNumber=self.bodies[body], storeInternal=True, outputVariableType=kind)
        )

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

    def _torque(self, motor):
        one = self._marker(motor.a, (0.0, 0.0, 0.0))
        self.mbs.AddLoad(self.ex.LoadTorqueVector(markerNumber=one, loadVector=list(motor.torque)))

    def run(self, end, step, dependent):
        """(t, r, A, v, omega) at the outputs, seconds; None where the solver gave up."""
        settings = self.exu.SimulationSettings()
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = max(end / OUTPUTS, step)
        times = settings.timeIntegration
        times.numberOfSteps, times.endTime, times.verboseMode = round(end / step), end, 0
        if dependent:
            settings.linearSolver.solverType = self.exu.LinearSolverType.EigenDense
            settings.linearSolver.ignoreSingularJacobian = True
        elif len(self.scene.bodies) >= MANY:
            settings.linearSolver.solverType = self.exu.LinearSolverType.EigenSparse
        begun = time.perf_counter()
        try:
            done = self.mbs.SolveDynamic(settings)
        except ValueError:
            return None
        seconds = time.perf_counter() - begun
        if not done:
            return None
        r, A, v, omega = (
            np.stack([np.asarray(self.mbs.GetSensorStoredData(one))[:, 1:] for one in row], axis=1)
            for row in self.sensors
        )
        return (r, A.reshape(*A.shape[:2], 3, 3), v, omega), seconds


def figures(scene, r, A, v, omega):
    """Largest gap of points that a joint holds together, m, and energy error relative to the kinetic energy."""
    index, gap = {body: i for i, body in enumerate(scene.bodies)}, 0.0

    def place(item, k):
        body = (item.a, item.b)[k]
        if body is scene.ground:
            return np.broadcast_to(item.coordinates[k], r[:, 0].shape)
        return r[:, index[body]] + A[:, index[body]] @ item.coordinates[k]

    for item in (*scene.constraints, *scene.forces):
        kind = type(item).__name__
        if kind in ("Revolute", "Spherical"):
            gap = max(gap, np.linalg.norm(place(item, 0) - place(item, 1), axis=1).max())
        elif kind == "Distance":
            gap = max(gap, np.abs(np.linalg.norm(place(item, 0) - place(item, 1), axis=1) - item.length).max())
        elif kind == "PlaneContact":
            gap = max(gap, np.abs((place(item, 0) - place(item, 1)) @ item.coordinates[2]).max())
    mass = np.array([body.mass for body in scene.bodies])
    J = np.array([body.inertia for body in scene.bodies])
    kinetic = 0.5 * ((mass * (v**2).sum(-1)).sum(-1) + np.einsum("kbi,bij,kbj->k", omega, J, omega))
    energy = kinetic - np.einsum("b,kbi,i->k", mass, r, scene.gravity)
    off = np.nan if scene.forces else np.abs(energy - energy[0]).max() / kinetic.max()
    return gap, off


def ours(scene, end):
    """The figures of the default method, and seconds."""
    ts.simulate(scene, (0.0, end / 100))
    begun = time.perf_counter()
    solution = ts.simulate(scene, (0.0, end), t_eval=np.linspace(0.0, end, OUTPUTS + 1)).raise_if_failed()
    seconds = time.perf_counter() - begun
    each = (solution.position, solution.rotation, solution.velocity, solution.angular_velocity)
    return *figures(scene, *(np.stack([get(body) for body in scene.bodies], axis=1) for get in each)), seconds


def main():
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="case", help="cases, by a part of their names")
    parser.add_argument("--step", type=float, default=1e-3, help="s, of Exudyn (1e-3)")
    parser.add_argument("--seconds", type=float, default=10.0, help="of the motion, at most (10)")
    given = parser.parse_args()
    print("| case | engine | gap (m) | energy error | time (s) |\n|---|---|---:|---:|---:|")
    for case in CASES:
        if "Kapitza" in case.name or (given.cases and not any(word in case.name for word in given.cases)):
            continue
        end, scene = min(case.end, given.seconds), case.build()
        rows = [("tsdyn", *ours(scene, end))]
        dependent = len(scene.bodies) < MANY and bool(scene.mobility().redundant)
        if not (dependent and len(scene.row_names()) > DENSE):
            found = Exudyn(scene).run(end, min(given.step, end / 300), dependent)
            rows.append(("Exudyn", *((np.nan,) * 3 if found is None else (*figures(scene, *found[0]), found[1]))))
        for name, gap, off, seconds in rows:
            cells = (
                "gives up | | " if np.isnan(seconds) else f"{gap:.1e} | {off:.1e} | {seconds:.2f}".replace("nan", "-")
            )
            print(f"| {case.name} | {name} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
