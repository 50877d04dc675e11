"""Actuators and tendons of MJCF: servos with the control that MuJoCo starts with, and springs between two sites.

force = gain u + b0 + b1 l + b2 ld,  l = gear q,  torque = gear force     u: 0, or the nearest control in its range
"""

import numpy as np

from .description import Servo, SpringItem
from .frames import of_body

PLAIN = ("mjGAIN_FIXED", "mjGAIN_AFFINE")
BIAS = ("mjBIAS_NONE", "mjBIAS_AFFINE")


def add_forces(mujoco, model, data, found, names, report):
    """Add actuators of joints and springs of tendons; others are listed."""
    joints = {joint.name: joint for joint in found.joints}
    off, bits = model.opt.disableflags, mujoco.mjtDisableBit
    for i in range(_actuators(model)):
        if not off & bits.mjDSBL_ACTUATION:
            _add_actuator(mujoco, model, i, joints, names, report)
    for i in range(model.ntendon):
        _add_tendon(mujoco, model, data, i, found, names, report)


def _actuators(model):
    return int(getattr(model, "nactuator", model.nu))


def _add_actuator(mujoco, model, i, joints, names, report):
    name = names.of("actuator", i)
    on = _joint_of(mujoco, model, i, joints, names)
    gain, bias = int(model.actuator_gaintype[i]), int(model.actuator_biastype[i])
    known = gain in _codes(mujoco.mjtGain, PLAIN) and bias in _codes(mujoco.mjtBias, BIAS)
    if on is None or not known or int(model.actuator_dyntype[i]) == int(mujoco.mjtDyn.mjDYN_MUSCLE):
        report.leave("actuator", name)
        return
    u, gear = _control(mujoco, model, i), float(model.actuator_gear[i, 0])
    joint, q0 = on
    b = np.array(model.actuator_biasprm[i, :3]) * (bias != int(mujoco.mjtBias.mjBIAS_NONE))
    g = np.array(model.actuator_gainprm[i, :3]) * (1.0, *(2 * [gain != int(mujoco.mjtGain.mjGAIN_FIXED)]))
    constant, stiffness, damping = (
        gear * (b[0] + g[0] * u),
        -gear * gear * (b[1] + g[1] * u),
        -gear * gear * (b[2] + g[2] * u),
    )
    if model.actuator_forcelimited[i]:
        low, high = model.actuator_forcerange[i]
        report.leave("limit of force", name, f"[{low:g}, {high:g}]")
    if not (constant or stiffness or damping):
        report.leave(
            "motor", name, f"(of {joint.name}, gear {gear:g}: no torque without control; see ts.forces.JointTorque)"
        )
        return
    load = constant - stiffness * q0  # stiffness counts from q = 0, not from the start
    free = 0.0
    if stiffness > 0.0:
        free, load = load / stiffness, 0.0
    joint.servos.append(
        Servo(
            f"{name} actuator" if name in joints else name, float(stiffness), float(damping), float(free), float(load)
        )
    )
    report.note(f"actuator {name}: with the control {u:g}, as a spring and damper of {joint.name}")


def _codes(kinds, names):
    return [int(getattr(kinds, name)) for name in names]


def _joint_of(mujoco, model, i, joints, names):
    """The hinge or slide of an actuator, and its coordinate at the start; None if it acts on something else."""
    if int(model.actuator_trntype[i]) not in _codes(mujoco.mjtTrn, ("mjTRN_JOINT", "mjTRN_JOINTINPARENT")):
        return None
    j = int(model.actuator_trnid[i, 0])
    joint = joints[names.of("joint", j)]
    return (joint, float(model.qpos0[model.jnt_qposadr[j]])) if joint.kind in ("revolute", "prismatic") else None


def _control(mujoco, model, i):
    """The control nearest to zero."""
    at = int(getattr(model, "actuator_ctrladr", np.arange(model.nu))[i])
    free = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
    if free or at < 0 or not model.actuator_ctrllimited[i]:
        return 0.0
    low, high = model.actuator_ctrlrange[i]
    return float(min(max(0.0, low), high))


def _add_tendon(mujoco, model, data, i, found, names, report):
    """A spring, where a tendon has two sites and one free length."""
    name, first, count = names.of("tendon", i), int(model.tendon_adr[i]), int(model.tendon_num[i])
    stiffness, damping = float(model.tendon_stiffness[i]), float(model.tendon_damping[i])
    low, high = model.tendon_lengthspring[i]
    sites = all(int(kind) == int(mujoco.mjtWrap.mjWRAP_SITE) for kind in model.wrap_type[first : first + count])
    straight = sites and count == 2 and low == high
    if straight and (stiffness or damping):
        ends = [int(s) for s in model.wrap_objid[first : first + 2]]
        bodies = [names.body(int(model.site_bodyid[s])) for s in ends]
        if bodies[0] != bodies[1]:
            points = [_place(model, data, s) for s in ends]
            found.springs.append(SpringItem(name, *bodies, *points, stiffness, damping, float(low)))
    elif stiffness or damping:
        report.leave("spring of a tendon", name)
    if model.tendon_limited[i]:
        report.leave("limits of a tendon", name)
    if model.tendon_frictionloss[i]:
        report.leave("friction of a tendon", name)
    if getattr(model, "tendon_armature", np.zeros(i + 1))[i]:
        report.leave("armature of a tendon", name)
    if not (stiffness or damping):
        report.leave("tendon", name)


def _place(model, data, site):
    """A site in the ground frame."""
    return of_body(data, int(model.site_bodyid[site])).point(model.site_pos[site])
