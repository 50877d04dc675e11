"""Joints of MJCF: of a body with several, all but the last one carry a link without mass."""

import numpy as np

from .description import JointItem, Link
from .names import fresh

KINDS = {"mjJNT_FREE": "free", "mjJNT_BALL": "spherical", "mjJNT_SLIDE": "prismatic", "mjJNT_HINGE": "revolute"}


def add_joints(mujoco, model, data, found, names, report):
    """Add the joints of all bodies; a body without one is fixed to its parent."""
    kinds = {int(getattr(mujoco.mjtJoint, name)): kind for name, kind in KINDS.items()}
    for i in range(1, model.nbody):
        name, last = names.body(i), names.body(int(model.body_parentid[i]))
        count, first = int(model.body_jntnum[i]), int(model.body_jntadr[i])
        if model.body_mocapid[i] >= 0:
            report.leave("body that is moved by hand (mocap), held", name)
        if not count:
            found.joints.append(JointItem(f"{name} weld", "fixed", last, name))
        for j in range(first, first + count):
            follower = name if j == first + count - 1 else fresh(f"{name}/{names.of('joint', j)}", found.links)
            if follower != name:
                found.links[follower] = Link(follower, found.links[name].frame)
            joint = JointItem(
                names.of("joint", j), kinds[int(model.jnt_type[j])], last, follower, data.xanchor[j].copy(),
                data.xaxis[j].copy(),
            )  # fmt: skip
            _spring_and_damper(mujoco, model, j, joint, report)
            _leave_limits(model, j, joint, report)
            found.joints.append(joint)
            last = follower
    order = {joint.b: k for k, joint in enumerate(found.joints)}  # links of a body in the order of its joints
    found.links = dict(sorted(found.links.items(), key=lambda item: order[item[0]]))


def _spring_and_damper(mujoco, model, j, joint, report):
    off, bits = model.opt.disableflags, mujoco.mjtDisableBit
    dof, at = int(model.jnt_dofadr[j]), int(model.jnt_qposadr[j])
    if not off & bits.mjDSBL_SPRING:
        joint.stiffness = float(model.jnt_stiffness[j])
        if joint.kind in ("revolute", "prismatic"):
            joint.free = float(model.qpos_spring[at] - model.qpos0[at])
    if not off & bits.mjDSBL_DAMPER:
        joint.damping = float(model.dof_damping[dof])
    for name, index in (("jnt_stiffnesspoly", j), ("dof_dampingpoly", dof)):
        if np.any(getattr(model, name, np.zeros((index + 1, 1)))[index]):
            report.leave("nonlinear stiffness or damping", joint.name)


def _leave_limits(model, j, joint, report):
    """List limits, friction and armature."""
    dof = int(model.jnt_dofadr[j])
    if model.jnt_limited[j]:
        low, high = model.jnt_range[j]
        report.leave("limits of a joint", joint.name, f"[{low:g}, {high:g}]")
    if friction := float(model.dof_frictionloss[dof]):
        report.leave("friction of a joint", joint.name, f"{friction:g}")
    if armature := float(model.dof_armature[dof]):
        report.leave("armature of a joint", joint.name, f"{armature:g}")
