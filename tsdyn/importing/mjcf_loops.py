"""Equality constraints of MJCF: connect, weld and joint, held exactly.

connect    x_1 + A_1 s_1 = x_2 + A_2 s_2
weld       x_1 + A_1 s_1 = x_2 + A_2 s_2,  A_1 R = A_2
joint      q_1 - q_1(0) = a1 (q_2 - q_2(0))
"""

import numpy as np

from .description import Coupling, JointItem
from .frames import of_body, posed, shifted


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
        else:
            report.leave("equality of tendons or flexible bodies", name)


def _add_loop(mujoco, model, data, i, found, names, report):
    name, kind = names.of("equality", i), int(model.eq_type[i])
    pair = [int(model.eq_obj1id[i]), max(int(model.eq_obj2id[i]), 0)]
    if int(model.eq_objtype[i]) == int(mujoco.mjtObj.mjOBJ_SITE):
        bodies = [int(model.site_bodyid[s]) for s in pair]
        frames = [
            of_body(data, body) @ posed(model.site_pos[s], model.site_quat[s])
            for body, s in zip(bodies, pair, strict=True)
        ]
    else:
        bodies, numbers = pair, model.eq_data[i]
        one, other = (of_body(data, body) for body in bodies)
        if kind == int(mujoco.mjtEq.mjEQ_WELD):
            frames = [one @ posed(numbers[3:6], numbers[6:10]), other @ shifted(numbers[0:3])]
        else:
            frames = [frame @ shifted(numbers[k : k + 3]) for k, frame in ((0, one), (3, other))]
    weld = kind == int(mujoco.mjtEq.mjEQ_WELD)
    if weld and not model.eq_data[i, 10]:
        weld = False
        report.note(f"{name}: a weld without torque holds a point")
    links = [names.body(body) for body in bodies]
    found.joints.append(
        JointItem(
            name, "fixed" if weld else "spherical", *links, loop=True, frame_a=frames[0], frame_b=frames[1]
        )
    )  # fmt: skip
    report.note("equality constraints are held exactly: their solref and solimp are those of a soft one")


def _add_coupling(model, i, found, names, report):
    """Proportional joints; one that is held becomes fixed."""
    name, follower = names.of("equality", i), names.of("joint", int(model.eq_obj1id[i]))
    a = np.array(model.eq_data[i, :5])
    if int(model.eq_obj2id[i]) < 0 and not a[0]:
        for joint in found.joints:
            if joint.name == follower:
                joint.kind = "fixed"
        report.note(f"{name}: the joint {follower} is held")
    elif int(model.eq_obj2id[i]) < 0 or a[0] or a[2:].any():
        report.leave("polynomial of joints", name, f"({follower})")
    else:
        driver = names.of("joint", int(model.eq_obj2id[i]))
        found.couplings.append(Coupling(name, driver, follower, float(a[1])))
