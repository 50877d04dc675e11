"""A ts.Scene in other engines: MuJoCo, a tree of joints in minimal coordinates, and Exudyn, joints by multipliers.

An `Engine` is a scene there; `refused` names what of a scene has no counterpart, `run` begins at the scene's start.
`ENGINES` has them by the names of their packages, which are imported when a scene is made.
"""

from __future__ import annotations

import time
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..elements.bodies import rotation_matrix
from ..elements.element import angles
from ..elements.joint import across, beside
from ..errors import InvalidArgument, MissingDependency, StepFailure
from ..validation import floats

OUTPUTS = 200
OPENS = "it opens and closes, at events that other engines have not: leave it out, or closed by unilateral=False"


class EngineMotion(NamedTuple):
    """Where the bodies of a scene are; k times, b bodies. A particle has A = I and no omega."""

    t: np.ndarray  # (k,), s, from the start
    r: np.ndarray  # (k, b, 3), m
    A: np.ndarray  # (k, b, 3, 3)
    v: np.ndarray  # (k, b, 3), m/s
    omega: np.ndarray  # (k, b, 3), rad/s, body frame
    seconds: float  # that the steps took


class Engine:
    """A scene in another engine.

    Attributes
    ----------
    title, package : str
    methods : tuple of str
        The default one first.
    options : tuple of str
        Arguments of the class beside the scene that `compare` hands on.
    """

    title, package = "", ""
    methods: tuple[str, ...] = ()
    options: tuple[str, ...] = ()

    @classmethod
    def version(cls):
        """Name and version; raises MissingDependency where the engine isn't installed."""
        try:
            return f"{cls.title} {import_module(cls.package).__version__}"
        except ImportError as error:
            text = f"compare(with_={cls.package!r}) needs {cls.title}: pip install {cls.package}."
            raise MissingDependency(text) from error

    @classmethod
    def demand(cls, scene):
        """Raise InvalidArgument where the engine can't have a scene, with the reason of each constraint and force."""
        timed = [
            (item, "it depends on time") for item in scene.constraints if any(part.rheonomic for part in item.parts)
        ]
        changing = [
            (item, OPENS if getattr(item, "unilateral", False) else "it is switched off")
            for item in (*scene.constraints, *scene.forces)
            if getattr(item, "unilateral", False) or not item.active
        ]
        found = [*cls.refused(scene), *timed, *changing]
        if found:
            lines = "\n".join(f"  {item.name}: {reason}" for item, reason in found[:10])
            more = f"\n  and {len(found) - 10} more" if len(found) > 10 else ""
            raise InvalidArgument(f"compare: {cls.title} can't have this scene:\n{lines}{more}")


def _ends(item):
    """The two bodies of a constraint or force, each with its point."""
    return zip((item.a, item.b), item.coordinates[:2], strict=True)


def _turn(body):
    """A of a body at the start; of a particle I."""
    return rotation_matrix(np.asarray(body.orientation)) if body.dimension != 3 else np.eye(3)


def _is_constant(value):
    """Whether a load is finite numbers, not a function of time or state."""
    try:
        return bool(np.isfinite(np.asarray(value, float)).all())
    except (TypeError, ValueError):
        return False


LOADS = {"Torque": "torque", "PointForce": "force", "Spring": "actuator", "TorsionalSpring": "actuator"}


def _load_refused(item):
    """Why an engine can't have a load or an actuator, or nothing."""
    kind = item._kind()
    if kind not in LOADS:
        return ""
    load = getattr(item, LOADS[kind])
    if not _is_constant(load) or getattr(item, "frame", "ground") != "ground":
        return f"{LOADS[kind]} must be constant, in ground axes"
    return "an actuator has no counterpart" if LOADS[kind] == "actuator" and load else ""


# Exudyn: bodies with Euler parameters, joints by multipliers, generalised-alpha of index 3 or trapezoid.

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
MANY = 100  # bodies from which on the sparse solver is the faster one


def _frame(z, x=None):
    """A rotation matrix with columns x, z x x, z, all unit; any x across z where it isn't given."""
    z = z / np.linalg.norm(z)
    return np.stack((*(across(z) if x is None else beside(z, x)), z), axis=1)


class Exudyn(Engine):
    """The scene in Exudyn; nodes: the name of a NodeType for the orientations of bodies."""

    title, package = "Exudyn", "exudyn"
    methods = ("GeneralizedAlpha", "TrapezoidalIndex2", "RK44", "RK67", "ODE23", "DOPRI5")

    @staticmethod
    def refused(scene):
        """Constraints and forces that have no counterpart, with the reason."""
        items = (*scene.constraints, *scene.forces)
        missing = [(item, f"{item._kind()} has no counterpart") for item in items if item._kind() not in TAKEN]
        missing += [(item, "PlaneContact of a point mass has no counterpart") for item in scene.constraints
                    if item._kind() == "PlaneContact" and item.a.dimension == 3]  # fmt: skip
        return missing + [(item, reason) for item in scene.forces if (reason := _load_refused(item))]

    def __init__(self, scene, nodes="RotationEulerParameters"):
        import exudyn as exu
        from exudyn import utilities as ex

        self.exu, self.ex, self.scene, self.nodes = exu, ex, scene, getattr(exu.NodeType, nodes)
        self.dependent = bool(scene.mobility().redundant)
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
            mass=body.mass, referencePosition=list(body.position), initialVelocity=list(body.velocity),
            gravity=list(self.scene.gravity),
        )  # fmt: skip

    def _rigid_body(self, body):
        A = _turn(body)
        return self.mbs.CreateRigidBody(
            inertia=self.ex.RigidBodyInertia(body.mass, np.asarray(body.inertia)), gravity=list(self.scene.gravity),
            referencePosition=list(body.position), referenceRotationMatrix=A,
            initialVelocity=list(body.velocity), initialAngularVelocity=list(A @ body.angular_velocity),
            nodeType=self.nodes,
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
        turns = [_frame(axes[-1])] * 2 if len(axes) == 1 else [_frame(z, *x) for z, *x in (axes[::2], axes[1::2])]
        pair = [self._marker(joint.a, point_a, turns[0]), self._marker(joint.b, point_b, turns[1])]
        if type(joint).__name__ == "PlaneContact":
            pair = pair[::-1]  # the plane is of the first
        locked = list(LOCKED[type(joint).__name__])
        self.mbs.AddObject(self.ex.ObjectJointGeneric(markerNumbers=pair, constrainedAxes=locked))

    def _spherical(self, joint):
        pair = [self._marker(*end) for end in _ends(joint)]
        self.mbs.AddObject(self.ex.ObjectJointSpherical(markerNumbers=pair))

    def _distance(self, rod):
        pair = [self._marker(*end) for end in _ends(rod)]
        self.mbs.AddObject(self.ex.ObjectConnectorDistance(markerNumbers=pair, distance=rod.length))

    def _spring(self, spring):
        pair = [self._marker(*end) for end in _ends(spring)]
        self.mbs.AddObject(
            self.ex.ObjectConnectorSpringDamper(
                markerNumbers=pair, referenceLength=spring.free_length, stiffness=spring.stiffness,
                damping=spring.damping,
            )
        )  # fmt: skip

    def _torsionalspring(self, spring):
        axis, *references = spring.coordinates[:3]
        A, B = _turn(spring.a), _turn(spring.b)
        turns = [_frame(z, x) for z, x in zip((axis, B.T @ A @ axis), references, strict=True)]
        pair = [self._marker(b, (0.0, 0.0, 0.0), A) for b, A in zip((spring.a, spring.b), turns, strict=True)]
        self.mbs.AddObject(
            self.ex.ObjectConnectorTorsionalSpringDamper(
                markerNumbers=pair, stiffness=spring.stiffness, damping=spring.damping, offset=spring.free_angle
            )
        )

    def _bushing(self, bushing):
        """With angles of another kind, equal to first order."""
        pair = [self._marker(*end) for end in _ends(bushing)]
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

    def run(self, end, step, outputs=OUTPUTS, method=methods[0], clock=time.perf_counter, **newton):
        """The `EngineMotion`; newton: further settings of Newton's method. Raises StepFailure.

        Where rows depend on others, by a dense solver that allows for these.
        """
        exu, settings = self.exu, self.exu.SimulationSettings()
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = max(end / outputs, step)
        times = settings.timeIntegration
        times.numberOfSteps, times.endTime, times.verboseMode = max(round(end / step), 1), end, 0
        for name, value in newton.items():
            setattr(times.newton, name, value)
        if self.dependent:
            settings.linearSolver.solverType = exu.LinearSolverType.EigenDense
            settings.linearSolver.ignoreSingularJacobian = True
        elif len(self.scene.bodies) >= MANY:
            settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
        begun, reason = clock(), ""
        try:
            done = self.mbs.SolveDynamic(settings, solverType=getattr(exu.DynamicSolverType, method))
        except (ValueError, RuntimeError) as error:
            done, reason = False, f": {str(error).partition(' [Python file')[0]}"
        seconds = clock() - begun
        if not done:
            said = f"compare: {self.title} gave up with {method} and the step {step:g} s{reason}."
            raise StepFailure(f"{said} Take a smaller step or another method.")
        t = np.asarray(self.mbs.GetSensorStoredData(self.sensors[0][0]))[:, 0]
        shape, bodies = (len(t), len(self.scene.bodies)), self.scene.bodies
        A, omega = np.tile(np.eye(3), (*shape, 1, 1)), np.zeros((*shape, 3))
        for k, body in enumerate(body for body in bodies if body not in self.particles):
            A[:, bodies.index(body)] = self._stored(self.sensors[1][k]).reshape(-1, 3, 3)
            omega[:, bodies.index(body)] = self._stored(self.sensors[3][k])
        r, v = (np.stack([*map(self._stored, self.sensors[i])], axis=1) for i in (0, 2))
        return EngineMotion(t, r, A, v, omega, seconds)

    def _stored(self, sensor):
        return np.asarray(self.mbs.GetSensorStoredData(sensor))[:, 1:]


# MuJoCo: joints of a tree hold exactly; those that close loops are soft, by solref and solimp of the user's.

LOOPS = ("Spherical", "Revolute", "Fixed", "Distance")
TREE = ("Revolute", "Translational", "Cylindrical", "Spherical", "Universal", "Planar", "PlaneContact", "Fixed")
ALONG = 1e-9  # sine between the axis of a spring and that of its joint
LEAST = 1e-9  # of the largest principal moment of inertia: MuJoCo takes none that is zero, as that of a slender rod
PARTICLE = 1e-12  # kg m^2, of a particle, which turns with what it hangs from: MuJoCo takes no smaller than 1e-15
SOFTNESS = {"solref": 2, "solimp": 5}  # how many numbers they are
INTEGRATORS = {"euler": "EULER", "rk4": "RK4", "implicit": "IMPLICIT", "implicitfast": "IMPLICITFAST"}


class Move(NamedTuple):
    """A joint of MuJoCo: hinge, slide, ball or free, in the frame of the child."""

    kind: str
    at: Any = None
    axis: Any = None


class TreeLink(NamedTuple):
    """A body, what it hangs from, and how it moves there."""

    body: Any
    parent: Any
    moves: tuple
    joint: Any = None


def spanning_tree(scene, kinds=TREE):
    """`TreeLink`s, parents first, by constraints of these kinds, and the constraints that are left over."""
    waiting = [item for item in scene.constraints if not getattr(item, "normalises", False)]
    placed, links = {scene.ground}, []
    while len(links) < len(scene.bodies):
        item = next((one for one in waiting if _kind(one) in kinds and (one.a in placed) != (one.b in placed)), None)
        if item is None:
            body = next(body for body in scene.bodies if body not in placed)
            links.append(TreeLink(body, scene.ground, _free(body)))
        else:
            waiting.remove(item)
            body, parent = (item.b, item.a) if item.a in placed else (item.a, item.b)
            links.append(TreeLink(body, parent, moves_of(item, body), item))
        placed.add(links[-1].body)
    return links, waiting


def _kind(item):
    return type(item).__name__


def _slides(axes):
    return tuple(Move("slide", np.zeros(3), axis) for axis in axes)


def _free(body):
    """A body of its own; a particle slides in three directions."""
    return (Move("free"),) if body.dimension == 7 else _slides(np.eye(3))


def moves_of(joint, child):
    """What a joint lets the child do."""
    (own, parent), kind = ("b", joint.a) if child is joint.b else ("a", joint.b), _kind(joint)
    other = "a" if own == "b" else "b"
    at, axis = getattr(joint, f"point_{own}"), getattr(joint, f"axis_{own}", None)
    A, B = _turn(parent), _turn(child)
    ball = (Move("ball", at),) if child.dimension == 7 else ()
    if kind == "Fixed":
        return ()
    if kind == "Spherical":
        return ball
    if kind == "PlaneContact":  # the point turns last in a plane of the parent, and first in one of the child
        slides = _slides(across(B.T @ _turn(joint.b) @ joint.normal_b))
        if own == "a":
            return *slides, *ball
        point = B.T @ (parent.position + A @ getattr(joint, f"point_{other}") - child.position)
        return Move("ball", point), *slides
    if kind == "Distance":  # a rod without mass: two hinges across it where it begins
        foot = B.T @ (parent.position + A @ getattr(joint, f"point_{other}") - child.position)
        f, g = across(at - foot)
        return Move("hinge", foot, f), Move("hinge", foot, g), *ball
    if kind == "Universal":
        return Move("hinge", at, B.T @ A @ getattr(joint, f"axis_{other}")), Move("hinge", at, axis)
    slides = {"Translational": (axis,), "Cylindrical": (axis,), "Planar": across(axis)}.get(kind, ())
    return *_slides(slides), *(() if kind == "Translational" else (Move("hinge", at, axis),))


class MuJoCo(Engine):
    """The scene in MuJoCo.

    Parameters
    ----------
    scene : Scene
    joints : tuple of str
        Kinds of constraints that are joints of the tree, where they can be. A Distance as one is two hinges, which are
        singular where the second one is at 90 degrees.
    solref, solimp
        Of the equality constraints that close loops.
    """

    title, package, methods, options = "MuJoCo", "mujoco", tuple(INTEGRATORS), tuple(SOFTNESS)

    @staticmethod
    def refused(scene):
        """Constraints that have no counterpart, with the reason; where there are none, forces."""
        links, loops = spanning_tree(scene)
        found = []
        for item in scene.constraints:
            kind = item._kind()
            if getattr(item, "normalises", False):
                continue
            if kind not in (*TREE, *LOOPS):
                found.append((item, f"{kind} has no counterpart"))
            elif any(item is one for one in loops) and kind not in LOOPS:
                found.append((item, f"{kind} closes a loop, for which there is no equality constraint"))
        return found or [(item, reason) for item in scene.forces if (reason := _force_refused(item, links))]

    def __init__(self, scene, joints=TREE, **softness):
        import mujoco

        self.mj, self.scene = mujoco, scene
        self.softness = {name: _numbers(values, name, SOFTNESS[name]) for name, values in softness.items()}
        self.spec = mujoco.MjSpec()
        self.spec.compiler.degree = False
        self.spec.option.gravity = scene.gravity
        self.links, loops = spanning_tree(scene, joints)
        flags = mujoco.mjtDisableBit
        self.spec.option.disableflags |= flags.mjDSBL_CONTACT if loops else flags.mjDSBL_CONSTRAINT
        self.made, self.joints, self.names = {scene.ground: self.spec.worldbody}, {}, {}
        for link in self.links:
            self._add_body(link)
        for item in loops:
            getattr(self, f"_{type(item).__name__.lower()}")(item)
        self.loads = []  # constant ones: body, force, torque
        for item in scene.forces:
            getattr(self, f"_{item._kind().lower()}")(item)
        try:
            self.model = self.spec.compile()
        except ValueError as error:
            raise InvalidArgument(f"compare: MuJoCo can't have this scene: {' '.join(str(error).split())}") from error
        self.ids = [self.model.body(self.names[body]).id for body in scene.bodies]

    def _add_body(self, link):
        """A body at its centroid, in its own axes, with the joints to its parent."""
        body, parent, name = link.body, link.parent, f"body{len(self.names)}"
        A = _turn(parent)
        at = A.T @ (np.asarray(body.position) - np.asarray(parent.position))
        made = self.made[parent].add_body(name=name, pos=at, quat=_quaternion(A.T @ _turn(body)))
        self.made[body], self.names[body] = made, name
        made.mass, made.ipos, made.explicitinertial = float(body.mass), (0, 0, 0), True
        moments, axes = np.linalg.eigh(np.asarray(getattr(body, "inertia", PARTICLE * np.eye(3))))
        made.inertia = np.maximum(moments, LEAST * moments[2])
        made.iquat = _quaternion(axes * np.linalg.det(axes))
        self.joints[body] = []
        for i, move in enumerate(link.moves):
            kind = getattr(self.mj.mjtJoint, f"mjJNT_{move.kind.upper()}")
            given = {name: value for name, value in (("pos", move.at), ("axis", move.axis)) if value is not None}
            self.joints[body].append(made.add_joint(name=f"{name} joint{i}", type=kind, **given))

    def _sites(self, item, name="", turns=(None, None), along=None):
        """Names of sites on both bodies at the points of an item, or at a distance from them along its axes."""
        found = []
        for side, (body, point), turn in zip("ab", _ends(item), turns, strict=True):
            place = point if along is None else point + along * getattr(item, f"axis_{side}")
            label = f"{item.name} {side}{name}"
            quat = _quaternion(np.eye(3) if turn is None else turn)
            self.made[body].add_site(name=label, pos=np.asarray(place, float), quat=quat)
            found.append(label)
        return found

    def _equality(self, kind, name, one, other=""):
        made = self.spec.add_equality(name=name, type=getattr(self.mj.mjtEq, f"mjEQ_{kind}"), name1=one, name2=other)
        if other:
            made.objtype = self.mj.mjtObj.mjOBJ_SITE
        for option, values in self.softness.items():
            setattr(made, option, [*values, *list(getattr(made, option))[len(values) :]])

    def _spherical(self, joint):
        self._equality("CONNECT", joint.name, *self._sites(joint))

    def _revolute(self, joint):
        """Two points on the axis."""
        for k, along in enumerate((-0.5, 0.5)):
            self._equality("CONNECT", f"{joint.name} {k}", *self._sites(joint, k, along=along))

    def _fixed(self, joint):
        pairs = zip(joint.frames, (joint.axis_a, joint.axis_b), strict=True)
        turns = [np.stack((f, g, u), axis=1) for (f, g), u in pairs]
        self._equality("WELD", joint.name, *self._sites(joint, turns=turns))

    def _distance(self, rod):
        self._equality("TENDON", rod.name, self._tendon(rod).name)

    def _tendon(self, item, **given):
        tendon = self.spec.add_tendon(name=item.name, **given)
        for site in self._sites(item):
            tendon.wrap_site(site)
        return tendon

    def _spring(self, spring):
        _add_to(self._tendon(spring, springlength=(spring.free_length,) * 2), spring.stiffness, spring.damping)

    def _torsionalspring(self, spring):
        joint, sign = _hinge_of(self.links, self.joints, spring)
        _add_to(joint, spring.stiffness, spring.damping)
        if spring.stiffness:
            joint.springref = sign * (spring.free_angle - _angle_now(spring))

    def _armature(self, rotor):
        self.joints[_link_between(self.links, rotor).body][0].armature += rotor.inertia * rotor.ratio**2

    def _viscousfriction(self, friction):
        _add_to(
            self.joints[_link_between(self.links, friction).body][0],
            0.0,
            friction.damping or friction.torsional_damping,
        )

    def _torque(self, load):
        self.loads.append((load.a, np.concatenate((np.zeros(3), load.torque))))

    def _pointforce(self, load):
        self.loads.append((load.a, np.concatenate((load.force, np.zeros(3)))))

    def run(self, end, step, outputs=OUTPUTS, method=methods[0], clock=time.perf_counter):
        """The `EngineMotion`, at about so many outputs; it ends where it is not finite."""
        mj, model = self.mj, self.model
        count = max(round(end / step), 1)
        model.opt.timestep, stride = end / count, max(count // outputs, 1)
        model.opt.integrator = getattr(mj.mjtIntegrator, f"mjINT_{INTEGRATORS[method]}")
        data, rows, seconds, done = mj.MjData(model), [], 0.0, 0
        self._start(data)
        while True:
            rows.append((done * end / count, *self._state(data)))
            if done >= count or not np.isfinite(data.qpos).all():
                return EngineMotion(*(np.array(column) for column in zip(*rows, strict=True)), seconds)
            now = min(stride, count - done)
            begun = clock()
            mj.mj_step(model, data, now)
            seconds, done = seconds + clock() - begun, done + now

    def _start(self, data):
        """Velocities at the start, by least squares over those of all bodies; constant loads."""
        mj, model = self.mj, self.model
        mj.mj_forward(model, data)
        rows, values = [], []
        for body, i in zip(self.scene.bodies, self.ids, strict=True):
            jacobians = np.zeros((2, 3, model.nv))
            mj.mj_jacBodyCom(model, data, *jacobians, i)
            rigid = body.dimension == 7
            rows += [*jacobians[: 1 + rigid]]
            values += [body.velocity, _turn(body) @ body.angular_velocity] if rigid else [body.velocity]
        if model.nv:
            data.qvel[:] = np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0]
        for body, load in self.loads:
            data.xfrc_applied[self.ids[self.scene.bodies.index(body)]] += load

    def _state(self, data):
        """(r, A, v, omega) of all bodies."""
        mj, model = self.mj, self.model
        mj.mj_kinematics(model, data)
        mj.mj_comPos(model, data)
        mj.mj_comVel(model, data)
        (v, omega), found, A = np.zeros((2, len(self.ids), 3)), np.zeros(6), np.tile(np.eye(3), (len(self.ids), 1, 1))
        for k, (body, i) in enumerate(zip(self.scene.bodies, self.ids, strict=True)):
            mj.mj_objectVelocity(model, data, mj.mjtObj.mjOBJ_XBODY, i, found, 0)
            v[k] = found[3:]
            if body.dimension == 7:
                A[k] = data.xmat[i].reshape(3, 3)
                omega[k] = A[k].T @ found[:3]
        return data.xpos[self.ids].copy(), A, v, omega


def _numbers(values, name, most):
    found = floats(values)
    if found.ndim != 1 or not 1 <= found.size <= most or not np.isfinite(found).all():
        raise InvalidArgument(f"compare: {name} of MuJoCo must be a list of up to {most} numbers, got {values!r}.")
    return found


def _quaternion(A):
    return np.roll(Rotation.from_matrix(A).as_quat(), 1)


def _add_to(made, stiffness, damping):
    """Add to the coefficients, or the first of several, of a joint or a tendon of MuJoCo."""
    for name, value in (("stiffness", stiffness), ("damping", damping)):
        before = getattr(made, name)
        more = float(before) + value if np.ndim(before) == 0 else [float(before[0]) + value, *list(before)[1:]]
        setattr(made, name, more)


def _angle_now(spring):
    """The angle of a torsional spring in the present poses."""
    found = angles(spring)[0]
    v = _turn(found.own).T @ _turn(found.other) @ np.array(found.h)
    return float(np.arctan2(np.dot(found.g, v), np.dot(found.f, v)))


def _link_between(links, item):
    """The link of the tree whose joint is between the two bodies of an item, or None."""
    return next((link for link in links if {link.body, link.parent} == {item.a, item.b}), None)


def _hinge_at(link, item):
    """Which move of a link is a hinge along the axis of an item, and that axis in the child's frame; or None."""
    own = item.axis_b if link.body is item.b else item.axis_a
    for i, move in enumerate(link.moves):
        if move.kind == "hinge" and np.linalg.norm(np.cross(move.axis, own)) < ALONG:
            return i, own
    return None


def _hinge_of(links, joints, item):
    """The joint that a torsional spring acts on; 1 if it turns b, -1 if it turns a."""
    link = _link_between(links, item)
    i, own = _hinge_at(link, item)
    along = np.sign(link.moves[i].axis @ own)
    return joints[link.body][i], along if link.body is item.b else -along


def _force_refused(item, links):
    """Why a force has no counterpart in MuJoCo, or nothing."""
    kind, reason = item._kind(), _load_refused(item)
    if reason or kind in ("Spring", "Torque"):
        return reason
    if kind == "PointForce":
        return "PointForce must act at the centroid" if np.any(item.coordinates[0]) else ""
    if kind not in ("TorsionalSpring", "ViscousFriction", "Armature"):
        return f"{kind} has no counterpart"
    link = _link_between(links, item)
    if link is None:
        return f"{kind} has no counterpart but at a joint of the tree"
    if kind == "TorsionalSpring":
        return "" if _hinge_at(link, item) else "no hinge of the tree is along its axis"
    kinds = [move.kind for move in link.moves]
    if kind == "Armature":
        return "" if kinds in (["hinge"], ["slide"]) else "its joint has several coordinates"
    fits = (kinds in (["hinge"], ["ball"]) and not item.damping) or (kinds == ["slide"] and item.damping)
    return "" if fits else "it damps more than one joint"


ENGINES = {"mujoco": MuJoCo, "exudyn": Exudyn}
