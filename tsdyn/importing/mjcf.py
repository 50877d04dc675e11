"""MJCF: what MuJoCo's own compiler makes of it, at qpos0; joints, loops, actuators and tendons."""

from __future__ import annotations

import warnings
from contextlib import contextmanager

import numpy as np

from ..errors import MissingDependency
from . import description, drawn_shapes
from .xml_file import Node, Sources

# Actuators and tendons of MJCF: servos with the control that MuJoCo starts with; springs, cables, ropes through sites.
#
# force = gain u + b0 + b1 l + b2 ld,  l = gear q,  torque = gear force     u: 0, or the nearest control in its range

PLAIN = ("mjGAIN_FIXED", "mjGAIN_AFFINE")
BIAS = ("mjBIAS_NONE", "mjBIAS_AFFINE")


def add_forces(mujoco, model, data, found, names, report):
    """Add actuators of joints and springs of tendons; others are listed."""
    joints = {joint.name: joint for joint in found.joints}
    off, bits = model.opt.disableflags, mujoco.mjtDisableBit
    for i in range(int(getattr(model, "nactuator", model.nu))):
        if not off & bits.mjDSBL_ACTUATION:
            _add_actuator(mujoco, model, i, joints, names, report)
    for i in range(model.ntendon):
        _add_tendon(mujoco, model, data, i, found, names, report)


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
        description.Servo(
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
    """A spring between two sites, or a cable through several, which pulls only."""
    name, points = names.of("tendon", i), _sites(mujoco, model, data, i, names)
    stiffness, damping = float(model.tendon_stiffness[i]), float(model.tendon_damping[i])
    low, high = map(float, model.tendon_lengthspring[i])
    acts, pulls = bool(stiffness or damping), low <= 0.0 < high
    if acts and points and (pulls or low == high):
        kind = "cable" if pulls or len(points) > 2 else "spring"
        if len({link for link, _ in points}) > 1:
            found.tendons.append(description.TendonItem(name, kind, points, high, stiffness, damping))
        if kind == "cable" and (damping or not pulls):
            report.note(f"{name}: a cable, which pulls only; MuJoCo's tendon damps and pushes where it would be slack")
    elif acts:
        report.leave("spring of a tendon", name, "" if points else "(around geoms, over pulleys or of joints)")
    if model.tendon_limited[i]:
        low, high = map(float, model.tendon_range[i])
        report.leave("limits of a tendon", name, f"[{low:g}, {high:g}]")
        if len({link for link, _ in points}) > 1 and low <= 0.0 < high:
            found.tendons.append(description.TendonItem(name, "limit", points, high))
    if model.tendon_frictionloss[i]:
        report.leave("friction of a tendon", name)
    if getattr(model, "tendon_armature", np.zeros(i + 1))[i]:
        report.leave("armature of a tendon", name)
    if not acts and not _is_tied(mujoco, model, i):
        report.leave("tendon", name)


def _is_tied(mujoco, model, i):
    """Whether an equality holds the length of a tendon."""
    kinds, tendons = np.array(model.eq_type), np.array([model.eq_obj1id, model.eq_obj2id])
    return bool(((kinds == int(mujoco.mjtEq.mjEQ_TENDON)) & (tendons == i).any(axis=0)).any())


def _sites(mujoco, model, data, i, names):
    """The points of a tendon through sites alone, as of a `TendonItem`; [] of any other."""
    w = slice(int(model.tendon_adr[i]), int(model.tendon_adr[i] + model.tendon_num[i]))
    if not all(int(kind) == int(mujoco.mjtWrap.mjWRAP_SITE) for kind in model.wrap_type[w]):
        return []
    sites = [int(site) for site in model.wrap_objid[w]]
    return [(names.body(int(model.site_bodyid[site])), _place(model, data, site)) for site in sites]


def _place(model, data, site):
    """A site in the ground frame."""
    return description.of_body(data, int(model.site_bodyid[site])).point(model.site_pos[site])


# Joints of MJCF: of a body with several, all but the last one carry a link without mass.

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
            found.joints.append(description.JointItem(f"{name} weld", "fixed", last, name))
        for j in range(first, first + count):
            follower = (
                name if j == first + count - 1 else description.fresh(f"{name}/{names.of('joint', j)}", found.links)
            )
            if follower != name:
                found.links[follower] = description.Link(follower, found.links[name].frame)
            joint = description.JointItem(
                names.of("joint", j), kinds[int(model.jnt_type[j])], last, follower, data.xanchor[j].copy(),
                data.xaxis[j].copy(),
            )  # fmt: skip
            _dynamics(mujoco, model, j, joint, report)
            _leave_limits(model, j, joint, report)
            found.joints.append(joint)
            last = follower
    order = {joint.b: k for k, joint in enumerate(found.joints)}  # links of a body in the order of its joints
    found.links = dict(sorted(found.links.items(), key=lambda item: order[item[0]]))


def _dynamics(mujoco, model, j, joint, report):
    off, bits = model.opt.disableflags, mujoco.mjtDisableBit
    dof, at = int(model.jnt_dofadr[j]), int(model.jnt_qposadr[j])
    if not off & bits.mjDSBL_SPRING:
        joint.stiffness = float(model.jnt_stiffness[j])
        if joint.kind in ("revolute", "prismatic"):
            joint.free = float(model.qpos_spring[at] - model.qpos0[at])
    if joint.kind in ("revolute", "prismatic"):
        joint.armature = float(model.dof_armature[dof])
    if not off & bits.mjDSBL_DAMPER:
        joint.damping = float(model.dof_damping[dof])
    for name, index in (("jnt_stiffnesspoly", j), ("dof_dampingpoly", dof)):
        if np.any(getattr(model, name, np.zeros((index + 1, 1)))[index]):
            report.leave("nonlinear stiffness or damping", joint.name)


def _leave_limits(model, j, joint, report):
    """List limits, friction, and armature of more than one coordinate."""
    dof = int(model.jnt_dofadr[j])
    if model.jnt_limited[j]:
        low, high = model.jnt_range[j]
        zero = model.qpos0[int(model.jnt_qposadr[j])] if joint.kind in ("revolute", "prismatic") else np.inf
        report.leave_limits(joint.name, low - zero, high - zero, f"[{low:g}, {high:g}]")
    if friction := float(model.dof_frictionloss[dof]):
        report.leave("friction of a joint", joint.name, f"{friction:g}")
    if joint.kind not in ("revolute", "prismatic") and (armature := float(model.dof_armature[dof])):
        report.leave("armature of a ball or free joint", joint.name, f"{armature:g}")


# Equality constraints of MJCF: connect, weld and joint, held exactly.
#
# connect    x_1 + A_1 s_1 = x_2 + A_2 s_2
# weld       x_1 + A_1 s_1 = x_2 + A_2 s_2,  A_1 R = A_2
# joint      q_1 - q_1(0) = a0 + a1 (q_2 - q_2(0)) + a2 (q_2 - q_2(0))^2 + ...
# tendon     the same of the lengths of fixed tendons, sums of joint coordinates


def add_loops(mujoco, model, data, found, names, report):
    """Add the constraints that are active."""
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_EQUALITY:
        return
    for i in range(model.neq):
        name, kind = names.of("equality", i), int(model.eq_type[i])
        if not model.eq_active0[i]:
            report.leave("equality that is not active", name)
        elif kind in (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)):
            _add_loop(mujoco, model, data, i, found, names, report)
        elif kind == int(mujoco.mjtEq.mjEQ_JOINT):
            _add_coupling(model, i, found, names, report)
        elif kind == int(mujoco.mjtEq.mjEQ_TENDON):
            _add_tendon_coupling(mujoco, model, data, i, found, names, report)
        else:
            report.leave("equality of flexible bodies", name)


def _add_loop(mujoco, model, data, i, found, names, report):
    name, kind = names.of("equality", i), int(model.eq_type[i])
    pair = [int(model.eq_obj1id[i]), max(int(model.eq_obj2id[i]), 0)]
    if int(model.eq_objtype[i]) == int(mujoco.mjtObj.mjOBJ_SITE):
        bodies = [int(model.site_bodyid[s]) for s in pair]
        frames = [
            description.of_body(data, body) @ description.posed(model.site_pos[s], model.site_quat[s])
            for body, s in zip(bodies, pair, strict=True)
        ]
    else:
        bodies, numbers = pair, model.eq_data[i]
        one, other = (description.of_body(data, body) for body in bodies)
        if kind == int(mujoco.mjtEq.mjEQ_WELD):
            frames = [one @ description.posed(numbers[3:6], numbers[6:10]), other @ description.shifted(numbers[0:3])]
        else:
            frames = [frame @ description.shifted(numbers[k : k + 3]) for k, frame in ((0, one), (3, other))]
    weld = kind == int(mujoco.mjtEq.mjEQ_WELD)
    if weld and not model.eq_data[i, 10]:
        weld = False
        report.note(f"{name}: a weld without torque holds a point")
    links = [names.body(body) for body in bodies]
    found.joints.append(
        description.JointItem(
            name, "fixed" if weld else "spherical", *links, loop=True, frame_a=frames[0], frame_b=frames[1]
        )
    )  # fmt: skip
    report.note("equality constraints are held exactly: their solref and solimp are those of a soft one")


def _add_coupling(model, i, found, names, report):
    """A joint that follows a polynomial of another one, or is held."""
    name, follower = names.of("equality", i), names.of("joint", int(model.eq_obj1id[i]))
    a = np.array(model.eq_data[i, :5])
    if int(model.eq_obj2id[i]) < 0:
        _hold(found, name, follower, float(a[0]), report)
    else:
        _follow(found, name, follower, names.of("joint", int(model.eq_obj2id[i])), a, report)


def _hold(found, name, held, at, report):
    """A joint that is held at its start becomes fixed; elsewhere it depends on nothing."""
    if at:
        found.couplings.append(description.Coupling(name, (held, 0), (), (), at))
    else:
        next(joint for joint in found.joints if joint.name == held).kind = "fixed"
        report.note(f"{name}: the joint {held} is held")
    _note_offset(name, at, report)


def _follow(found, name, follower, driver, a, report):
    """A joint that follows the polynomial a_0 + a_1 q + ... of another one."""
    polynomial = np.trim_zeros(a, "b").tolist() if a[2:].any() else ()
    found.couplings.append(
        description.Coupling(name, (follower, 0), ((driver, 0),), (float(a[1]),), float(a[0]), tuple(polynomial))
    )
    _note_offset(name, float(a[0]), report)


def _note_offset(name, offset, report):
    if offset:
        report.note(f"{name}: it starts {offset:g} off; scene.assemble() takes it there")


def _add_tendon_coupling(mujoco, model, data, i, found, names, report):
    """A rope through sites; fixed tendons in proportion, whose lengths are sums of joint coordinates."""
    name, a = names.of("equality", i), np.array(model.eq_data[i, :5])
    tendon = int(model.eq_obj1id[i])
    points = _sites(mujoco, model, data, tendon, names)
    if points and int(model.eq_obj2id[i]) < 0:
        length = float(model.tendon_length0[tendon] + a[0])
        found.tendons.append(description.TendonItem(name, "rope", points, length))
        _note_offset(name, float(a[0]), report)
        return
    one, other = (_coefficients(mujoco, model, int(t[i]), names) for t in (model.eq_obj1id, model.eq_obj2id))
    if not other:
        a[1:] = 0.0
    if one and other and len(one) == len(other) == 1 and a[2:].any() and all(one.values()):
        ((follower, c),), ((driver, d),) = one.items(), other.items()  # c q = a0 + a1 d q' + a2 (d q')^2 + ...
        _follow(found, name, follower, driver, a * d ** np.arange(5) / c, report)
        return
    if one is None or other is None or a[2:].any():
        report.leave("equality of tendons", name, "(around geoms, of two through sites, or by a polynomial of several)")
        return
    # sum c q = a0 + a1 sum d q, solved for the joint of the largest coefficient
    terms = dict(one)
    for joint, d in other.items():
        terms[joint] = terms.get(joint, 0.0) - a[1] * d
    follower = max(terms, key=lambda joint: abs(terms[joint]))
    drivers = {joint: -c / terms[follower] for joint, c in terms.items() if joint != follower and c}
    if not terms[follower]:
        report.leave("equality of tendons", name, "(of no joint)")
        return
    offset = float(a[0] / terms[follower])
    if not drivers:
        _hold(found, name, follower, offset, report)
        return
    drivers, ratios = tuple((joint, 0) for joint in drivers), tuple(float(c) for c in drivers.values())
    found.couplings.append(description.Coupling(name, (follower, 0), drivers, ratios, offset))
    _note_offset(name, offset, report)


def _coefficients(mujoco, model, tendon, names):
    """The coefficient of each joint of a fixed tendon, {} for none; None of one through sites."""
    if tendon < 0:
        return {}
    first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    found = {}
    for w in range(first, first + count):
        if int(model.wrap_type[w]) != int(mujoco.mjtWrap.mjWRAP_JOINT):
            return None
        joint = names.of("joint", int(model.wrap_objid[w]))
        found[joint] = found.get(joint, 0.0) + float(model.wrap_prm[w])
    return found


# What a model of MuJoCo has and a scene lacks, listed.

UNNAMED = {  # of the model before it is compiled: what they are, and the names of those without one
    "keys": ("keyframe", "key"),
    "tuples": ("tuple of the user's", "tuple"),
    "numerics": ("number of the user's", "numeric"),
    "texts": ("text of the user's", "text"),
    "sensors": ("sensor", "sensor"),
    "cameras": ("camera", "camera"),
    "lights": ("light", "light"),
    "pairs": ("contact pair", "pair"),
    "excludes": ("pair of bodies without contact", "exclude"),
    "skins": ("skin", "skin"),
    "textures": ("texture", "texture"),
}
ROOMS = ("memory", "nstack", "njmax", "nconmax", "nuser_body", "nuser_jnt", "nuser_geom", "nuser_site", "nuser_cam",
         "nuser_tendon", "nuser_actuator", "nuser_sensor")  # fmt: skip
LEFT = {"nflex": ("flexible body", "flex"), "nplugin": ("plugin", "plugin")}


def strip(mujoco, spec, report):
    """List objects without counterpart; leave no pictures, and no room for data of the user's, to be compiled."""
    for name, (what, kind) in UNNAMED.items():
        for i, one in enumerate(getattr(spec, name)):
            report.leave(what, one.name or f"{kind}{i}")
    for texture in spec.textures:
        texture.file, texture.content_type, texture.cubefiles = "", "", 6 * [""]
        texture.builtin, texture.gridsize = int(mujoco.mjtBuiltin.mjBUILTIN_FLAT), [1, 1]
        texture.width = texture.height = 1
    for camera in spec.cameras:
        camera.resolution = [1, 1]
    for skin in list(spec.skins):
        spec.delete(skin)
    for name in ROOMS:
        setattr(spec, name, -1)
    spec.nkey = spec.nuserdata = 0
    for name in ("bodies", "joints", "geoms", "sites", "cameras", "tendons", "actuators", "sensors"):
        for one in getattr(spec, name):
            if len(one.userdata):
                one.userdata = []


def leave_rest(model, names, report):
    """List objects, and options of the physics, that have no counterpart."""
    for count, (what, kind) in LEFT.items():
        for i in range(int(getattr(model, count, 0))):
            report.leave(what, names.of(kind, i))
    for i in np.flatnonzero(model.body_gravcomp):
        report.leave("compensation of gravity", names.body(int(i)), f"{model.body_gravcomp[i]:g}")
    for name in ("density", "viscosity"):
        if value := float(getattr(model.opt, name)):
            report.leave("drag of a fluid", name, f"{value:g}")
    for name in ("actuator_damping", "actuator_armature"):
        for i in np.flatnonzero(np.asarray(getattr(model, name, ()))):
            report.leave(name.replace("actuator_", "") + " of an actuator", names.of("actuator", int(i)))


# MJCF: what MuJoCo's own compiler makes of it, at qpos0.
#
# So defaults, included files, units of angles, Euler sequences, inertia from geoms and all other options of the
# compiler mean what they mean in MuJoCo. A body with several joints becomes as many links, of which the last one has
# the mass.


def describe(root, path, report, outside):
    """The `Description` of a file with the root element <mujoco>."""
    try:
        import mujoco
    except ImportError as error:
        raise MissingDependency("MJCF files need MuJoCo's compiler: pip install 'tsdyn[import]'.") from error
    sources = Sources(path, outside)
    sources.judge(root)
    with _warnings(mujoco, report):
        model = _compiled(mujoco, root, sources, report)
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
    names = Names(mujoco, model)
    found = description.Description(root.get("model") or "mujoco", gravity=_gravity(mujoco, model))
    for i in range(1, model.nbody):
        found.links[names.body(i)] = _link(model, data, i, names)
    add_joints(mujoco, model, data, found, names, report)
    for i in range(model.nsite):
        at = description.posed(model.site_pos[i], model.site_quat[i])
        found.frames[names.of("site", i)] = names.body(int(model.site_bodyid[i])), at
    add_forces(mujoco, model, data, found, names, report)
    add_loops(mujoco, model, data, found, names, report)
    drawn_shapes.add_geoms(mujoco, model, found, names, report)
    leave_rest(model, names, report)
    leave_unread(sources, report)
    return found


COUNTS = {  # fields of a model, by kind of objects
    "body": "nbody",
    "joint": "njnt",
    "site": "nsite",
    "geom": "ngeom",
    "actuator": "nactuator",
    "tendon": "ntendon",
    "equality": "neq",
    "flex": "nflex",
    "plugin": "nplugin",
}


class Names:
    """Names of a model's objects; those without one are numbered in the order of the file."""

    def __init__(self, mujoco, model):
        self._kinds, self._find, self.model = mujoco.mjtObj, mujoco.mj_id2name, model
        self._made = {}

    def of(self, kind, i):
        """The name of object i of a kind, such as "joint"."""
        if kind not in self._made:
            code = getattr(self._kinds, f"mjOBJ_{kind.upper()}")
            given = [self._find(self.model, code, i) for i in range(getattr(self.model, COUNTS[kind]))]
            taken = set(given)
            self._made[kind] = [name or description.fresh(f"{kind}{i}", taken) for i, name in enumerate(given)]
        return self._made[kind][i]

    def body(self, i):
        """The name of a body, empty for the world."""
        return self.of("body", i) if i > 0 else description.GROUND


@contextmanager
def _warnings(mujoco, report):
    """Note what MuJoCo warns of, which it would write to a log file."""
    before = mujoco.get_mju_user_warning() if hasattr(mujoco, "get_mju_user_warning") else None
    mujoco.set_mju_user_warning(lambda text: report.note(f"MuJoCo: {text}"))
    try:
        with warnings.catch_warnings(record=True, action="always") as said:
            yield
    finally:
        mujoco.set_mju_user_warning(before)
    for one in said:
        report.note(f"MuJoCo: {one.message}")


def _compiled(mujoco, root, sources, report):
    """The model of a file, without what a scene has no counterpart for; missing meshes don't matter."""
    try:
        spec = mujoco.MjSpec.from_file(str(sources.path))
        strip(mujoco, spec, report)
        drawn_shapes.drop_missing_meshes(mujoco, spec, sources, root, report)
        spec.compiler.fusestatic = spec.compiler.discardvisual = False
        return spec.compile()
    except (ValueError, TypeError, OSError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        root.wrong(f"MuJoCo: {' '.join(str(error).split())}")
        root.mistakes.demand_none()


def _gravity(mujoco, model):
    off = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    return np.zeros(3) if off else model.opt.gravity.copy()


def _link(model, data, i, names):
    """A body at qpos0; its inertia is given about principal axes."""
    R = description.of_quaternion(model.body_iquat[i])
    inertia = R @ np.diag(model.body_inertia[i]) @ R.T
    inertia = (inertia + inertia.T) / 2.0
    return description.Link(
        names.body(i), description.of_body(data, i), float(model.body_mass[i]), model.body_ipos[i].copy(), inertia
    )


# Elements and attributes of MJCF that are carried over, or listed by name; all others are listed by their lines.

# what places and sizes things, and what the compiler alone reads
COMPILED = ("compiler", "default", "size", "include", "worldbody", "asset", "frame", "replicate", "attach", "model",
            "mesh", "inertial", "composite", "equality", "tendon", "actuator", "contact", "keyframe",
            "custom", "deformable", "pulley", "freejoint")  # fmt: skip
# listed by name, with all that they contain
LISTED = ("camera", "light", "texture", "skin", "pair", "exclude", "key", "numeric", "text", "tuple", "flexcomp",
          "flex", "plugin", "hfield", "sensor")  # fmt: skip
COMMON = "name class group "
PLACE = "pos quat axisangle xyaxes zaxis euler "
SPRING = "springdamper springref stiffness damping frictionloss armature limited range "
SOFT = "solref solimp "  # of equality constraints, which are held exactly: noted
CONTACT = ("type contype conaffinity condim priority friction solmix solref solimp margin gap mesh fitscale fromto "
           "size mass density shellinertia material rgba hfield ")  # fmt: skip
DRIVE = ("joint jointinparent gear ctrllimited ctrlrange forcelimited forcerange gaintype biastype gainprm biasprm kp "
         "kv dampratio inheritrange armature damping")  # fmt: skip
READ = {
    "mujoco": "model",
    "body": "name childclass mocap gravcomp " + PLACE,
    "joint": COMMON + SPRING + "type pos axis ref joint1 joint2 joint coef polycoef active " + SOFT,
    "geom": COMMON + PLACE + CONTACT + "geom sidesite",
    "site": COMMON + PLACE + "type fromto size material rgba site",
    "connect": "name class active body1 body2 anchor site1 site2 " + SOFT,
    "weld": "name class active body1 body2 anchor relpose site1 site2 torquescale " + SOFT,
    "option": "gravity density viscosity",
    "flag": "gravity equality spring damper actuation clampctrl contact limit frictionloss",
    "material": "name class rgba",
    "spatial": COMMON + SPRING + "springlength width material rgba",
    "fixed": COMMON + SPRING + "springlength",
    **dict.fromkeys(("general", "motor", "position", "velocity", "damper"), COMMON + DRIVE),
}
NUMERICS = ("timestep", "integrator", "solver", "iterations", "tolerance", "ls_iterations", "ls_tolerance", "jacobian",
            "noslip_iterations", "noslip_tolerance", "ccd_iterations", "ccd_tolerance", "sdf_iterations",
            "sdf_initpoints", "apirate", "cone", "impratio")  # fmt: skip


def leave_unread(sources, report):
    """List what nobody has read, and note settings of MuJoCo's integrator."""
    for root, path in sources.trees:
        _read(root, report)
        report.leave_unread(root, "" if path == sources.path else f"{path.name}, ")


def _read(root: Node, report):
    """Mark as read what the rest of the import reads, or lists."""
    known = (*COMPILED, *LISTED, *READ)
    for node in root.walk():
        if node.tag in LISTED:
            node.skip()
            continue
        node.all(*known)
        names = READ.get(node.tag, "").split() if node.tag not in COMPILED else node.element.keys()
        if node.tag == "option":
            given = [name for name in NUMERICS if node.get(name) is not None]
            if given:
                report.note(f"settings of MuJoCo's own solver, which tsdyn has no use for: {', '.join(given)}")
        for name in names:
            node.get(name)


# What an MJCF file names and makes, judged before MuJoCo's compiler reads it.
#
# objects of an element = (1 + characters / TEXT + objects of its children) x copies
