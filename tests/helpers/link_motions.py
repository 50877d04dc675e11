"""Motions of links by Pinocchio and by MuJoCo, and scenes that are placed by them."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

FOLDER = Path(__file__).parents[1] / "importing" / "references"


class LinkMotion(NamedTuple):
    """Frame of a link and its motion: velocities in its own axes, acceleration of its origin in those of the ground."""

    p: Any  # (3,), m
    quaternion: Any  # (4,), scalar first
    v: Any  # (3,), own frame
    omega: Any  # (3,), own frame
    a: Any  # (3,), ground frame
    alpha: Any  # (3,), own frame


def write(name, motions):
    """Write motions by link as a reference."""
    data = {link: [np.asarray(part).tolist() for part in motion] for link, motion in motions.items()}
    (FOLDER / f"{name}.json").write_text(json.dumps(data, indent=1))


def read(name):
    """Motions of a reference."""
    data = json.loads((FOLDER / f"{name}.json").read_text())
    return {link: LinkMotion(*map(np.array, parts)) for link, parts in data.items()}


def place(scene, motions):
    """Place the bodies of an imported scene as their links are."""
    for body in scene.bodies:
        at, motion = scene.imported.frames[body.name], motions[body.name]
        R, centroid = Rotation.from_quat(np.roll(motion.quaternion, -1)).as_matrix(), -at.position
        body.position, body.orientation = motion.p + R @ centroid, motion.quaternion
        body.velocity = R @ (motion.v + np.cross(motion.omega, centroid))
        body.angular_velocity = motion.omega


def acceleration_error(scene, motions):
    """Largest difference of the centroids' accelerations from those of the links, per largest of these."""
    qdd, at, wrong, size = scene.evaluate().qdd, 0, 0.0, 0.0
    for body in scene.bodies:
        motion, centroid = motions[body.name], -scene.imported.frames[body.name].position
        R = Rotation.from_quat(np.roll(motion.quaternion, -1)).as_matrix()
        turning = np.cross(motion.alpha, centroid) + np.cross(motion.omega, np.cross(motion.omega, centroid))
        expected = motion.a + R @ turning
        wrong = max(wrong, np.abs(qdd[at : at + 3] - expected).max())
        size, at = max(size, np.abs(expected).max()), at + body.dimension
    return wrong / size


def of_pinocchio(model, q, v, qdd, names):
    """Motions of links by their names."""
    import pinocchio as pin

    data = model.createData()
    pin.forwardKinematics(model, data, q, v, qdd)
    pin.updateFramePlacements(model, data)
    found = {}
    for name in names:
        frame = model.getFrameId(name, pin.BODY)
        M, velocity = data.oMf[frame], pin.getFrameVelocity(model, data, frame, pin.LOCAL)
        acceleration = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL)
        quaternion = np.roll(Rotation.from_matrix(M.rotation).as_quat(), 1)
        found[name] = LinkMotion(
            M.translation.copy(), quaternion, velocity.linear.copy(), velocity.angular.copy(),
            M.rotation @ acceleration.linear, acceleration.angular.copy(),
        )  # fmt: skip
    return found


def of_mujoco(model, data, names):
    """Motions of bodies by their names; "body/joint" is a body before the joints behind this one."""
    import mujoco as mj

    kind, found, six = mj.mjtObj.mjOBJ_XBODY, {}, np.zeros(6)
    gravity = np.zeros(3) if model.opt.disableflags & mj.mjtDisableBit.mjDSBL_GRAVITY else model.opt.gravity
    for name in names:
        body, _, joint = name.partition("/")
        i = mj.mj_name2id(model, mj.mjtObj.mjOBJ_BODY, body)
        i = int(name.removeprefix("body")) if i < 0 else i
        at = before(model, data, i, joint) if joint else data
        mj.mj_objectVelocity(model, at, kind, i, six, 1)
        omega, v = six[:3].copy(), six[3:].copy()
        mj.mj_objectAcceleration(model, at, kind, i, six, 1)
        R = at.xmat[i].reshape(3, 3)
        found[name] = LinkMotion(
            at.xpos[i].copy(),
            at.xquat[i] / np.linalg.norm(at.xquat[i]),
            v,
            omega,
            R @ six[3:] + gravity,
            six[:3].copy(),
        )
    return found


def before(model, data, body, joint):
    """The data with the joints of a body behind this one at their start and at rest."""
    import mujoco as mj

    new, widths = mj.MjData(model), {0: (7, 6), 1: (4, 3), 2: (1, 1), 3: (1, 1)}
    new.qpos[:], new.qvel[:], new.qacc[:] = data.qpos, data.qvel, data.qacc
    last = model.body_jntadr[body] + model.body_jntnum[body]
    for j in range(mj.mj_name2id(model, mj.mjtObj.mjOBJ_JOINT, joint) + 1, last):
        wide, rates = widths[int(model.jnt_type[j])]
        q, v = model.jnt_qposadr[j], model.jnt_dofadr[j]
        new.qpos[q : q + wide] = model.qpos0[q : q + wide]
        new.qvel[v : v + rates] = new.qacc[v : v + rates] = 0.0
    mj.mj_fwdPosition(model, new)
    mj.mj_fwdVelocity(model, new)
    mj.mj_rnePostConstraint(model, new)
    return new
