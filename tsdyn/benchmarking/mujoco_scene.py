"""A ts.Scene in MuJoCo: a tree of bodies, equality constraints for the joints that close loops, forces."""

import time
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..elements.bodies import rotation_matrix
from ..elements.element import angles
from ..elements.joint import across
from ..errors import InvalidArgument
from .exudyn_scene import is_constant

# The joints of a scene as a tree, which MuJoCo has in minimal coordinates, and those that close loops.

LOOPS = ("Spherical", "Revolute", "Fixed", "Distance")
TREE = ("Revolute", "Translational", "Cylindrical", "Spherical", "Universal", "Planar", "Fixed")


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


def spanning_tree(scene):
    """`TreeLink`s, parents first, and the constraints that are left over."""
    waiting = [item for item in scene.constraints if not getattr(item, "normalises", False)]
    placed, links = {scene.ground}, []
    while len(links) < len(scene.bodies):
        item = next((one for one in waiting if _kind(one) in TREE and (one.a in placed) != (one.b in placed)), None)
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


def _free(body):
    """A body of its own; a particle slides in three directions."""
    if body.dimension == 7:
        return (Move("free"),)
    return tuple(Move("slide", np.zeros(3), axis) for axis in np.eye(3))


def moves_of(joint, child):
    """What a joint lets the child do."""
    own, kind = "b" if child is joint.b else "a", _kind(joint)
    at, axis = getattr(joint, f"point_{own}"), getattr(joint, f"axis_{own}", None)
    if kind == "Fixed":
        return ()
    if kind == "Spherical":
        return (Move("ball", at),) if child.dimension == 7 else ()
    if kind == "Universal":
        other = "a" if own == "b" else "b"
        parent = joint.a if own == "b" else joint.b
        A, B = (rotation_matrix(np.asarray(body.orientation)) for body in (parent, child))
        return Move("hinge", at, B.T @ A @ getattr(joint, f"axis_{other}")), Move("hinge", at, axis)
    slides = {"Translational": (axis,), "Cylindrical": (axis,), "Planar": across(axis)}.get(kind, ())
    hinge = () if kind == "Translational" else (Move("hinge", at, axis),)
    return (*(Move("slide", at, direction) for direction in slides), *hinge)


def refused_joints(scene):
    """Constraints that have no counterpart, with the reason."""
    _, loops = spanning_tree(scene)
    found = []
    for item in scene.constraints:
        kind = item._kind()
        if getattr(item, "normalises", False):
            continue
        if kind not in (*TREE, *LOOPS):
            found.append((item, f"{kind} has no counterpart"))
        elif any(item is one for one in loops) and kind not in LOOPS:
            found.append((item, f"{kind} closes a loop, for which there is no equality constraint"))
    return found


# Forces of a scene in MuJoCo: springs as tendons, springs and dampers of joints, constant loads.

ALONG = 1e-9  # sine between the axis of a spring and that of its joint


def add_forces(made):
    """Add the forces of a `MujocoScene`; return the constant loads: (body, force, torque)."""
    loads = []
    for item in made.scene.forces:
        kind = item._kind()
        if kind == "Spring":
            _spring(made, item)
        elif kind == "TorsionalSpring":
            joint, sign = _hinge_of(made, item)
            joint.stiffness = _first(joint.stiffness, item.stiffness)
            joint.damping = _first(joint.damping, item.damping)
            if item.stiffness:
                joint.springref = sign * (item.free_angle - angle_now(item))
        elif kind == "ViscousFriction":
            joint = _only_joint(made, item)
            joint.damping = _first(joint.damping, item.damping or item.torsional_damping)
        else:
            loads.append(_load(item, kind))
    return loads


def _first(before, value):
    """A coefficient, or the first of several, raised by a value."""
    if np.ndim(before) == 0:
        return float(before) + value
    return [float(before[0]) + value, *list(before)[1:]]


def _spring(made, item):
    tendon = made.spec.add_tendon(name=item.name, springlength=(item.free_length, item.free_length))
    tendon.stiffness, tendon.damping = (
        _first(getattr(tendon, name), getattr(item, name)) for name in ("stiffness", "damping")
    )
    for side, body, place in zip("ab", (item.a, item.b), item.coordinates, strict=True):
        tendon.wrap_site(made.site(body, place, f"{item.name} {side}").name)


def _load(item, kind):
    zero = np.zeros(3)
    if kind == "Torque":
        return item.a, zero, np.asarray(item.torque, float)
    return item.a, np.asarray(item.force, float), zero


def angle_now(spring):
    """The angle of a torsional spring in the present poses."""
    found = angles(spring)[0]
    A, B = (rotation_matrix(np.asarray(body.orientation)) for body in (found.own, found.other))
    v = A.T @ B @ np.array(found.h)
    return float(np.arctan2(np.dot(found.g, v), np.dot(found.f, v)))


def _link_between(links, item):
    """The link of the tree whose joint is between the two bodies of an item, or None."""
    return next((link for link in links if {link.body, link.parent} == {item.a, item.b}), None)


def _hinge_of(made, item):
    """The hinge that a torsional spring acts on; 1 if it turns b, -1 if it turns a."""
    link = _link_between(made.links, item)
    own = item.axis_b if link.body is item.b else item.axis_a
    for move, joint in zip(link.moves, made.joints[link.body], strict=True):
        if move.kind == "hinge" and np.linalg.norm(np.cross(move.axis, own)) < ALONG:
            along = np.sign(move.axis @ own)
            return joint, along if link.body is item.b else -along
    return None


def _only_joint(made, item):
    link = _link_between(made.links, item)
    return made.joints[link.body][0]


def refused_forces(scene, links):
    """Forces that have no counterpart, with the reason."""
    return [(item, reason) for item in scene.forces if (reason := _reason(item, links))]


def _reason(item, links):
    kind = item._kind()
    if kind in ("Torque", "PointForce"):
        given = getattr(item, "torque" if kind == "Torque" else "force")
        if item.frame != "ground" or not is_constant(given):
            return f"{kind} must be constant, in ground axes"
        return "PointForce must act at the centroid" if kind == "PointForce" and np.any(item.coordinates[0]) else ""
    if kind in ("Spring", "TorsionalSpring") and not (is_constant(item.actuator) and not item.actuator):
        return "an actuator has no counterpart"
    if kind == "Spring":
        return ""
    link = _link_between(links, item) if kind in ("TorsionalSpring", "ViscousFriction") else None
    if link is None:
        return f"{kind} has no counterpart" + (
            " but at a joint of the tree" if kind in ("TorsionalSpring", "ViscousFriction") else ""
        )
    if kind == "TorsionalSpring":
        own = item.axis_b if link.body is item.b else item.axis_a
        fits = any(move.kind == "hinge" and np.linalg.norm(np.cross(move.axis, own)) < ALONG for move in link.moves)
        return "" if fits else "no hinge of the tree is along its axis"
    kinds = [move.kind for move in link.moves]
    fits = (kinds in (["hinge"], ["ball"]) and not item.damping) or (kinds == ["slide"] and item.damping)
    return "" if fits else "it damps more than one joint"


# A ts.Scene in MuJoCo: a tree of bodies with joints, and equality constraints for the joints that close loops.
#
# Joints of the tree hold exactly there; those that close loops are soft, by solref and solimp of the user's.

LEAST = 1e-9  # of the largest principal moment of inertia: MuJoCo takes none that is zero, as that of a slender rod
PARTICLE = 1e-6  # kg m^2, of a particle, which doesn't turn
INTEGRATORS = {"euler": "EULER", "rk4": "RK4", "implicit": "IMPLICIT", "implicitfast": "IMPLICITFAST"}


class MujocoScene:
    """The model; `run` begins at the scene's start."""

    def __init__(self, scene, **softness):
        import mujoco

        self.mj, self.scene = mujoco, scene
        self.spec = mujoco.MjSpec()
        self.spec.compiler.degree = False
        self.spec.option.gravity = scene.gravity
        self.spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.links, loops = spanning_tree(scene)
        self.made, self.joints, self.names = {scene.ground: self.spec.worldbody}, {}, {}
        for link in self.links:
            self._add_body(link)
        for item in loops:
            getattr(self, f"_{type(item).__name__.lower()}")(item, softness)
        self.loads = add_forces(self)
        try:
            self.model = self.spec.compile()
        except ValueError as error:
            raise InvalidArgument(f"compare: MuJoCo can't have this scene: {' '.join(str(error).split())}") from error
        self.ids = [self.model.body(self.names[body]).id for body in scene.bodies]

    def _add_body(self, link):
        """A body at its centroid, in its own axes, with the joints to its parent."""
        body, parent, name = link.body, link.parent, f"body{len(self.names)}"
        A, B = (rotation_matrix(np.asarray(self._orientation(one))) for one in (parent, body))
        at = A.T @ (np.asarray(body.position) - np.asarray(parent.position))
        turn = np.roll(Rotation.from_matrix(A.T @ B).as_quat(), 1)
        made = self.made[parent].add_body(name=name, pos=at, quat=turn)
        self.made[body], self.names[body] = made, name
        made.mass, made.ipos, made.explicitinertial = float(body.mass), (0, 0, 0), True
        moments, axes = np.linalg.eigh(np.asarray(getattr(body, "inertia", PARTICLE * np.eye(3))))
        made.inertia = np.maximum(moments, LEAST * moments[2])
        made.iquat = np.roll(Rotation.from_matrix(axes * np.linalg.det(axes)).as_quat(), 1)
        self.joints[body] = []
        for i, move in enumerate(link.moves):
            kind = getattr(self.mj.mjtJoint, f"mjJNT_{move.kind.upper()}")
            places = {} if move.kind == "free" else {"pos": move.at}
            axis = {} if move.axis is None else {"axis": move.axis}
            self.joints[body].append(made.add_joint(name=f"{name} joint{i}", type=kind, **places, **axis))

    @staticmethod
    def _orientation(body):
        return body.orientation if body.dimension != 3 else (1.0, 0.0, 0.0, 0.0)

    def site(self, body, place, name, turn=None):
        """A site on a body, at a point in its frame."""
        quat = (1, 0, 0, 0) if turn is None else np.roll(Rotation.from_matrix(turn).as_quat(), 1)
        return self.made[body].add_site(name=name, pos=np.asarray(place, float), quat=quat)

    def _equality(self, kind, pair, softness, name):
        one = self.spec.add_equality(
            name=name, type=getattr(self.mj.mjtEq, f"mjEQ_{kind}"), objtype=self.mj.mjtObj.mjOBJ_SITE
        )
        one.name1, one.name2 = (site.name for site in pair)
        self._soften(one, softness)

    @staticmethod
    def _soften(one, softness):
        for name, values in softness.items():
            setattr(one, name, [*values, *list(getattr(one, name))[len(values) :]])

    def _spherical(self, joint, softness):
        pair = [self.site(body, place, f"{joint.name} {side}")
                for side, body, place in zip("ab", (joint.a, joint.b), joint.coordinates, strict=True)]  # fmt: skip
        self._equality("CONNECT", pair, softness, joint.name)

    def _revolute(self, joint, softness):
        """Two points on the axis."""
        for k, along in enumerate((-0.5, 0.5)):
            points = joint.point_a + along * joint.axis_a, joint.point_b + along * joint.axis_b
            pair = [self.site(body, place, f"{joint.name} {side}{k}")
                    for side, body, place in zip("ab", (joint.a, joint.b), points, strict=True)]  # fmt: skip
            self._equality("CONNECT", pair, softness, f"{joint.name} {k}")

    def _fixed(self, joint, softness):
        turns = [
            np.stack((f, g, u), axis=1) for (f, g), u in zip(joint.frames, (joint.axis_a, joint.axis_b), strict=True)
        ]
        pair = [self.site(body, place, f"{joint.name} {side}", turn) for side, body, place, turn in
                zip("ab", (joint.a, joint.b), joint.coordinates[:2], turns, strict=True)]  # fmt: skip
        self._equality("WELD", pair, softness, joint.name)

    def _distance(self, rod, softness):
        tendon = self.spec.add_tendon(name=rod.name)
        for side, body, place in zip("ab", (rod.a, rod.b), rod.coordinates, strict=True):
            tendon.wrap_site(self.site(body, place, f"{rod.name} {side}").name)
        self._soften(self.spec.add_equality(name=rod.name, type=self.mj.mjtEq.mjEQ_TENDON, name1=tendon.name), softness)

    def run(self, end, step, outputs, method="euler"):
        """(t, r, p, v, omega) at about so many outputs, and the seconds that the steps took."""
        mj, model = self.mj, self.model
        count = max(round(end / step), 1)
        model.opt.timestep, stride = end / count, max(count // outputs, 1)
        model.opt.integrator = getattr(mj.mjtIntegrator, f"mjINT_{INTEGRATORS[method]}")
        data, rows, seconds = mj.MjData(model), [], 0.0
        self._start(data)
        done = 0
        while True:
            rows.append((done * end / count, *self._state(data)))
            if done >= count or not np.isfinite(data.qpos).all():
                return [np.array(column) for column in zip(*rows, strict=True)], seconds
            now = min(stride, count - done)
            begun = time.perf_counter()
            mj.mj_step(model, data, now)
            seconds, done = seconds + time.perf_counter() - begun, done + now

    def _start(self, data):
        """Velocities at the start, by least squares over those of all bodies; constant loads."""
        mj, model = self.mj, self.model
        mj.mj_forward(model, data)
        rows, values = [], []
        for body, i in zip(self.scene.bodies, self.ids, strict=True):
            jacobians = np.zeros((2, 3, model.nv))
            mj.mj_jacBodyCom(model, data, *jacobians, i)
            rows.append(jacobians[0])
            values.append(body.velocity)
            if body.dimension == 7:
                rows.append(jacobians[1])
                values.append(rotation_matrix(np.asarray(body.orientation)) @ body.angular_velocity)
        if model.nv:
            data.qvel[:] = np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0]
        for body, force, torque in self.loads:
            data.xfrc_applied[self.ids[self.scene.bodies.index(body)]] += np.concatenate((force, torque))

    def _state(self, data):
        """(r, p, v, omega) of all bodies."""
        mj, model = self.mj, self.model
        mj.mj_kinematics(model, data)
        mj.mj_comPos(model, data)
        mj.mj_comVel(model, data)
        (v, omega), found = np.zeros((2, len(self.ids), 3)), np.zeros(6)
        for k, i in enumerate(self.ids):
            mj.mj_objectVelocity(model, data, mj.mjtObj.mjOBJ_XBODY, i, found, 1)
            omega[k], v[k] = found[:3], data.xmat[i].reshape(3, 3) @ found[3:]
        return data.xpos[self.ids].copy(), data.xquat[self.ids].copy(), v, omega
