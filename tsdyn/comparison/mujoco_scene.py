"""A ts.Scene in MuJoCo: a tree of bodies with joints, and equality constraints for the joints that close loops.

Joints of the tree hold exactly there; those that close loops are soft, by solref and solimp of the user's.
"""

import time

import numpy as np
from scipy.spatial.transform import Rotation

from ..elements.bodies import rotation_matrix
from ..errors import InvalidArgument
from .mujoco_forces import add_forces
from .mujoco_tree import spanning_tree

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
