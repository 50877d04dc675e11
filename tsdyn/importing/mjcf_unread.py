"""Elements and attributes of MJCF that are carried over, or listed by name; all others are listed by their lines."""

from .xml_file import Node

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
