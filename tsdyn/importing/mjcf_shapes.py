"""Shapes to draw of MJCF: geoms of the groups that MuJoCo's viewer shows; contacts are listed."""

from pathlib import Path

import numpy as np

from .description import GROUND
from .frames import posed, shifted
from .meshes import DrawnShape, hexadecimal
from .xml_file import OUTSIDE, exists

TETRAHEDRON = (0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1)  # vertices
SHOWN = 3  # groups of geoms that are drawn: 0, 1, 2


def drop_missing_meshes(mujoco, spec, sources, root, report):
    """Replace meshes that can't be read, undrawn; where a body's inertia is that of its geoms, this is a mistake.

    Each deletion would take the compiler a time in proportion to the file.
    """
    folder = sources.path.parent / (spec.meshdir or "")
    missing = {
        mesh.name or Path(mesh.file).stem: mesh
        for mesh in spec.meshes
        if mesh.file and (mesh.file in sources.hidden or not _is_there(mesh, folder))
    }
    if not missing:
        return
    for geom in list(spec.geoms):
        if geom.meshname not in missing:
            continue
        body, file = geom.parent, missing[geom.meshname].file
        if not body.explicitinertial and body.name != "world":
            reason = OUTSIDE if file in sources.hidden else "is not found"
            root.wrong(f"mesh {file!r} {reason}; the inertia of {body.name or 'a body without name'} needs it.")
        report.leave(f"mesh that {OUTSIDE if file in sources.hidden else 'is not found'}", body.name or "body", file)
        geom.type, geom.meshname, geom.size = int(mujoco.mjtGeom.mjGEOM_SPHERE), "", (1.0, 0.0, 0.0)
        geom.mass, geom.contype, geom.conaffinity, geom.group = 0.0, 0, 0, SHOWN
    for mesh in missing.values():
        mesh.file, mesh.content_type, mesh.uservert = "", "", TETRAHEDRON
    root.mistakes.demand_none()


def _is_there(mesh, folder):
    return exists(folder / mesh.file) or exists(Path(mesh.file))


def add_shapes(mujoco, model, found, names, report):
    """Add the shapes of all bodies."""
    kinds = {int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}")): kind for kind in
             ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")}  # fmt: skip
    for i in range(model.ngeom):
        body, kind = names.body(int(model.geom_bodyid[i])), kinds.get(int(model.geom_type[i]), "other")
        if model.geom_contype[i] or model.geom_conaffinity[i]:
            report.leave("contact shape", body or "world", names.of("geom", i))
        if model.geom_group[i] >= SHOWN:
            continue
        shapes = _shapes(model, i, kind)
        if not shapes:
            report.leave(f"shape {kind}", body or "world", names.of("geom", i))
        elif body == GROUND:
            found.ground_shapes += shapes
        else:
            found.links[body].shapes += shapes


def _shapes(model, i, kind):
    """`DrawnShape`s of a geom: a capsule is a cylinder and two spheres."""
    at, size = posed(model.geom_pos[i], model.geom_quat[i]), model.geom_size[i].tolist()
    rgba = model.mat_rgba[model.geom_matid[i]] if model.geom_matid[i] >= 0 else model.geom_rgba[i]
    colour = hexadecimal(rgba)
    if kind == "sphere":
        return [DrawnShape("Sphere", (size[0],), at, colour)]
    if kind == "box":
        return [DrawnShape("Box", (2.0 * np.array(size),), at, colour)]
    if kind in ("cylinder", "capsule"):
        ends = (-size[1], size[1]) if kind == "capsule" else ()
        caps = [DrawnShape("Sphere", (size[0],), at @ shifted((0.0, 0.0, z)), colour) for z in ends]
        return [DrawnShape("Cylinder", (size[0], 2.0 * size[1]), at, colour), *caps]
    if kind == "mesh":
        m = int(model.geom_dataid[i])
        vertices = model.mesh_vert[model.mesh_vertadr[m] :][: model.mesh_vertnum[m]].astype(float)
        faces = model.mesh_face[model.mesh_faceadr[m] :][: model.mesh_facenum[m]].astype(int)
        return [DrawnShape("Mesh", ((vertices, faces), 1.0), at, colour)]
    return []
