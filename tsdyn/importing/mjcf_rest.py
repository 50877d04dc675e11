"""What a model of MuJoCo has and a scene lacks, listed."""

import numpy as np

OBJECTS = {  # of the model before it is compiled: what they are, and the names of those without one
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
    for name, (what, kind) in OBJECTS.items():
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
