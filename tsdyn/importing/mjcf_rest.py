"""What a model of MuJoCo has and a scene lacks, listed."""

import numpy as np

COUNTED = {  # of objects with names
    "ncam": ("camera", "camera"),
    "nlight": ("light", "light"),
    "nsensor": ("sensor", "sensor"),
    "nkey": ("keyframe", "key"),
    "npair": ("contact pair", "pair"),
    "nexclude": ("pair of bodies without contact", "exclude"),
    "nflex": ("flexible body", "flex"),
    "nplugin": ("plugin", "plugin"),
    "nnumeric": ("number of the user's", "numeric"),
    "ntext": ("text of the user's", "text"),
    "ntuple": ("tuple of the user's", "tuple"),
}


def leave_rest(mujoco, model, names, report):
    """List objects, and options of the physics, that have no counterpart."""
    for count, (what, kind) in COUNTED.items():
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
