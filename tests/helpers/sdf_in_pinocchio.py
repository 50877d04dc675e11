"""An SDF file in Pinocchio, read by the standard library: a tree of joints, and balls that close loops.

Poses of links are those in the model; a joint is in the frame of its child, or by its pose in it. Loops are constraints
without stabilisation.
"""

from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation


def pose(element):
    """The SE3 of a child <pose>."""
    import pinocchio as pin

    text = element.findtext("pose")
    values = np.array(text.split(), float) if text else np.zeros(6)
    return pin.SE3(Rotation.from_euler("xyz", values[3:]).as_matrix(), values[:3])


def model_of(path):
    """(model, loop constraints) of the first model of a file, whose root link is free."""
    import pinocchio as pin

    source, model = ElementTree.parse(path).getroot().find("model"), pin.Model()
    frames = {link.get("name"): pose(link) for link in source.findall("link")}
    links = {link.get("name"): link for link in source.findall("link")}
    joints = source.findall("joint")
    children = {joint.findtext("child") for joint in joints}
    hinged = {joint.findtext("child") for joint in joints if joint.get("type") == "revolute"}
    root = next(name for name in frames if name not in children)
    on = {root: model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")}
    at = {root: frames[root]}  # frames of joints in the model's
    waiting, loops = list(joints), pin.StdVec_RigidConstraintModel()
    while waiting:
        ready = [joint for joint in waiting if joint.findtext("parent") in on and joint.findtext("child") not in on
                 and (joint.get("type") == "revolute" or joint.findtext("child") not in hinged)]  # fmt: skip
        if not ready:
            break
        joint = max(ready, key=lambda joint: on[joint.findtext("parent")])  # depth first, as its algorithms need
        waiting.remove(joint)
        parent, child = joint.findtext("parent"), joint.findtext("child")
        at[child] = frames[child] * pose(joint)
        kind = pin.JointModelSpherical()
        if joint.get("type") == "revolute":
            axis = np.array(joint.findtext("axis/xyz").split(), float)
            kind = pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis))
        on[child] = model.addJoint(on[parent], kind, at[parent].inverse() * at[child], joint.get("name"))
    for name, link in links.items():
        _add_mass(pin, model, on[name], at[name].inverse() * frames[name], link.find("inertial"))
        model.addFrame(pin.Frame(name, on[name], 0, at[name].inverse() * frames[name], pin.FrameType.BODY))
    for joint in waiting:
        assert joint.get("type") == "ball"
        ends = [joint.findtext(tag) for tag in ("parent", "child")]
        point = frames[ends[1]] * pose(joint)
        places = [at[end].inverse() * point for end in ends]
        kind, local = pin.ContactType.CONTACT_3D, pin.ReferenceFrame.LOCAL
        loop = pin.RigidConstraintModel(kind, model, on[ends[0]], places[0], on[ends[1]], places[1], local)
        loops.append(loop)
    return model, loops


def _add_mass(pin, model, joint, frame, inertial):
    J = [float(inertial.findtext(f"inertia/i{axes}", "0")) for axes in ("xx", "xy", "xz", "yy", "yz", "zz")]
    matrix = np.array([[J[0], J[1], J[2]], [J[1], J[3], J[4]], [J[2], J[4], J[5]]])
    own = pin.Inertia(float(inertial.findtext("mass")), np.zeros(3), matrix)
    model.appendBodyToJoint(joint, own, frame * pose(inertial))


def accelerations(model, loops, q, v):
    """The accelerations of joints with closed loops."""
    import pinocchio as pin

    data, found = model.createData(), pin.StdVec_RigidConstraintData()
    found.extend(loop.createData() for loop in loops)
    pin.initConstraintDynamics(model, data, loops, found)
    settings = pin.ProximalSettings(1e-14, 1e-10, 100)
    return pin.constraintDynamics(model, data, q, v, np.zeros(model.nv), loops, found, settings).copy()


def closed(model, loops, q, rng):
    """Joint coordinates near q, and random velocities, that satisfy the loops."""
    import pinocchio as pin

    data = model.createData()

    def gaps(q):
        pin.forwardKinematics(model, data, q)
        pin.computeJointJacobians(model, data, q)
        rows, residual = [], []
        for loop in loops:
            points, jacobians = [], []
            for joint, place in ((loop.joint1_id, loop.joint1_placement), (loop.joint2_id, loop.joint2_placement)):
                M = data.oMi[joint] * place
                J = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
                offset = M.translation - data.oMi[joint].translation
                points.append(M.translation)
                jacobians.append(J[:3] - pin.skew(offset) @ J[3:])
            residual.append(points[0] - points[1])
            rows.append(jacobians[0] - jacobians[1])
        return np.concatenate(residual), np.concatenate(rows)

    for _ in range(50):
        residual, J = gaps(q)
        q = pin.integrate(model, q, -np.linalg.lstsq(J, residual, rcond=None)[0])
    residual, J = gaps(q)
    assert np.abs(residual).max() < 1e-13
    v = rng.normal(size=model.nv)
    return q, v - np.linalg.lstsq(J, J @ v, rcond=None)[0]
