"""MJCF: what MuJoCo's own compiler makes of it, at qpos0.

So defaults, included files, units of angles, Euler sequences, inertia from geoms and all other options of the compiler
mean what they mean in MuJoCo. A body with several joints becomes as many links, of which the last one has the mass.
"""

import warnings
from contextlib import contextmanager

import numpy as np

from ..errors import MissingDependency
from . import mjcf_forces, mjcf_joints, mjcf_loops, mjcf_rest, mjcf_shapes
from .description import GROUND, Description, Link
from .frames import of_body, of_quaternion, posed
from .mjcf_files import Sources
from .mjcf_unread import leave_unread
from .names import fresh


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
    found = Description(root.get("model") or "mujoco", gravity=_gravity(mujoco, model))
    for i in range(1, model.nbody):
        found.links[names.body(i)] = _link(model, data, i, names)
    mjcf_joints.add_joints(mujoco, model, data, found, names, report)
    for i in range(model.nsite):
        at = posed(model.site_pos[i], model.site_quat[i])
        found.frames[names.of("site", i)] = names.body(int(model.site_bodyid[i])), at
    mjcf_forces.add_forces(mujoco, model, data, found, names, report)
    mjcf_loops.add_loops(mujoco, model, data, found, names, report)
    mjcf_shapes.add_shapes(mujoco, model, found, names, report)
    mjcf_rest.leave_rest(model, names, report)
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
            self._made[kind] = [name or fresh(f"{kind}{i}", taken) for i, name in enumerate(given)]
        return self._made[kind][i]

    def body(self, i):
        """The name of a body, empty for the world."""
        return self.of("body", i) if i > 0 else GROUND


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
        mjcf_rest.strip(mujoco, spec, report)
        mjcf_shapes.drop_missing_meshes(mujoco, spec, sources, root, report)
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
    R = of_quaternion(model.body_iquat[i])
    inertia = R @ np.diag(model.body_inertia[i]) @ R.T
    inertia = (inertia + inertia.T) / 2.0
    return Link(names.body(i), of_body(data, i), float(model.body_mass[i]), model.body_ipos[i].copy(), inertia)
