"""Shapes to draw: meshes that a description names, visuals of URDF, geoms of MJCF."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import unquote

import numpy as np

from .. import shapes
from .description import GROUND, HERE, Frame, posed, roll_pitch_yaw
from .xml_file import OUTSIDE, exists

if TYPE_CHECKING:
    from .description import ImportReport
    from .xml_file import OutsideFiles


# Files of meshes that a description names, and shapes that are read when they are drawn.

FORMATS = (".stl", ".obj")  # that `shapes.Mesh` reads
FOLDERS = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "GZ_SIM_RESOURCE_PATH", "GAZEBO_MODEL_PATH")


class DrawnShape(NamedTuple):
    """A shape to draw, in the frame of its link."""

    kind: str  # Box, Sphere, Cylinder, Capsule or Mesh
    arguments: tuple
    frame: Frame = HERE
    colour: str = ""

    def within(self, outer: Frame) -> DrawnShape:
        """The shape in the frame in which `outer` is given."""
        return self._replace(frame=outer @ self.frame)

    def make(self) -> Any:
        """The `shapes` object; the file of a mesh is read."""
        placed = {"position": self.frame.p, "rotation": self.frame.R, "colour": self.colour}
        if self.kind != "Mesh":
            return getattr(shapes, self.kind)(*self.arguments, **placed)
        source, scale = self.arguments
        if np.ndim(scale) == 0:
            return shapes.Mesh(source, scale=float(scale), **placed)
        mesh = shapes.Mesh(source)
        faces = mesh.faces if np.prod(scale) > 0.0 else mesh.faces[:, ::-1]  # a mirrored one
        return shapes.Mesh((mesh.vertices * scale, faces), **placed)


def mesh(uri: str, scale: Any, outside: OutsideFiles, report: ImportReport, where: str) -> tuple[str, tuple] | None:
    """Kind and arguments of the mesh of a URI; None, with an entry in the report, where it can't be drawn."""
    there = find(uri, outside.folder)
    path = next((path for path in there if not outside.reason(path)), None)
    if path is None:
        report.leave(f"mesh that {OUTSIDE}" if there else "mesh that is not found", where, uri)
        return None
    if path.suffix.lower() not in FORMATS:
        report.leave("mesh of another format than STL and OBJ", where, uri)
        return None
    scale = np.asarray(scale, float)
    if not scale.all():
        report.leave("mesh of scale zero", where, uri)
        return None
    return "Mesh", (str(path), float(scale[0]) if (scale == scale[0]).all() and scale[0] > 0.0 else scale)


def find(uri: str, folder: Path) -> list[Path]:
    """Files that a URI may mean, best first: package:// and model:// are looked for above the folder of the file."""
    scheme, mark, rest = unquote(uri.strip()).partition("://")
    if not mark:
        tried = [folder / scheme]
    elif scheme == "file":
        tried = [Path(rest), folder / rest]
    elif scheme in ("package", "model"):
        tried = _in_packages(rest, folder)
    else:
        return []
    return [path for path in tried if exists(path)]


def _in_packages(rest, folder):
    """Where package/path may be: above the folder, in a package that it is in, or in a folder of the environment."""
    package, _, inner = rest.partition("/")
    above = [folder.resolve(), *folder.resolve().parents]
    roots = [Path(root) for name in FOLDERS for root in re.split(os.pathsep, os.environ.get(name, "")) if root]
    for root in (*above, *roots):
        yield root / rest
        yield root / "share" / rest
        if root.name == package:
            yield root / inner
    for root in above[:4]:  # a package that was copied under another name
        yield root / inner


def hexadecimal(rgba: Any) -> str:
    """Colour of red, green and blue from 0 to 1."""
    return "#" + "".join(f"{round(255 * min(max(x, 0.0), 1.0)):02x}" for x in rgba[:3])


# Shapes to draw of URDF: visuals, and collisions where a link has no visual that can be drawn.


def colours(root):
    """Colours of materials by name."""
    found = {}
    for node in root.all("material"):
        found[node.get("name") or ""] = _colour(node, {})
    return found


def _colour(node, known):
    """The colour of an element <material>."""
    named, colour = node.get("name") or "", node.one("color")
    return known.get(named, "") if colour is None else hexadecimal(colour.attribute("rgba", 4, [0.5, 0.5, 0.5, 1.0]))


def add_visuals(link, node, outside, report, materials):
    """Add the shapes of an element <link>; contact shapes are listed."""
    _add(link, node, report, lambda one, report: _shape(one, link.name, outside, report, materials))


def _add(link, node, report, shape_of):
    """Add the shapes of <visual>, or of <collision>: `shape_of(node, report)`, None where it can't be drawn."""
    drawn = [shape_of(one, report) for one in node.all("visual")]
    link.shapes = [shape for shape in drawn if shape is not None]
    for one in node.all("collision"):
        shape = shape_of(one, report if not link.shapes else None)
        report.leave("contact shape", link.name)
        if shape is not None and not any(drawn):
            link.shapes.append(shape)


def _shape(node, name, outside, report, materials):
    """The `DrawnShape` of an element <visual> or <collision>, or None."""
    node.get("name")
    at, geometry, material = node.one("origin"), node.one("geometry"), node.one("material")
    colour = "" if material is None else _colour(material, materials)
    if geometry is None or not geometry.nodes:
        node.wrong(f"link {name!r}: <{node.tag}> lacks <geometry> with a shape.")
        return None
    place, shape = HERE if at is None else placed(at), geometry.nodes[0]
    geometry.all(shape.tag)
    uri = shape.demand("filename") if shape.tag == "mesh" else None
    made = _primitive(shape, name, outside, report, uri, shape.attribute)
    return None if made is None else DrawnShape(*made, place, colour)


def placed(node):
    """The frame of an element <origin>."""
    return Frame(node.attribute("xyz", 3, np.zeros(3)), roll_pitch_yaw(node.attribute("rpy", 3, np.zeros(3))))


SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "capsule": ("radius", "length"), "sphere": ("radius",)}


def _primitive(shape, name, outside, report, uri, read):
    """Kind and arguments of a shape; read(word, count, default) gives its numbers, (count,), and `uri` is of a mesh."""
    if shape.tag == "mesh":
        scale = read("scale", 3, np.ones(3))
        return None if report is None or uri is None else mesh(uri, scale, outside, report, name)
    if shape.tag not in SIZES:
        shape.skip()
        if report is not None:
            report.leave(f"shape <{shape.tag}>", name)
        return None
    radius = 0.5 if shape.tag == "capsule" else 1.0  # of one that says none
    usual = {"size": np.ones(3), "radius": [radius], "length": [1.0]}
    sizes = [read(word, len(usual[word]), usual[word]) for word in SIZES[shape.tag]]
    if not all((size > 0.0).all() for size in sizes):
        if report is not None:
            report.leave("shape without extent", name)
        return None
    return shape.tag.capitalize(), tuple(size if size.size == 3 else float(size[0]) for size in sizes)


def add_sdf_shapes(link, node, frames, outside, report):
    """Add the shapes of an SDF element <link>."""
    _add(link, node, report, lambda one, report: _sdf_shape(one, link.name, frames, outside, report))
    for one in node.all("collision"):
        one.skip()


def _sdf_shape(node, name, frames, outside, report):
    node.get("name")
    place, geometry, material = frames.pose(node), node.one("geometry"), node.one("material")
    colour = ""
    if material is not None:
        for tag in ("diffuse", "ambient"):
            child = material.one(tag)
            if child is not None and not colour:
                colour = hexadecimal(child.numbers(" ".join(child.text.split()[:3]), 3, np.full(3, 0.5), f"<{tag}>"))
    if geometry is None or not geometry.nodes:
        return None
    shape = geometry.nodes[0]
    geometry.all(shape.tag)
    uri = shape.one("uri") if shape.tag == "mesh" else None
    made = _primitive(shape, name, outside, report, None if uri is None else uri.text, shape.value)
    return None if made is None else DrawnShape(*made, place, colour)


# Shapes to draw of MJCF: geoms of the groups that MuJoCo's viewer shows; contacts are listed.

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
        if mesh.file and (mesh.file in sources.hidden or not (exists(folder / mesh.file) or exists(Path(mesh.file))))
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


def add_geoms(mujoco, model, found, names, report):
    """Add the shapes of all bodies."""
    kinds = {int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}")): kind for kind in
             ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")}  # fmt: skip
    for i in range(model.ngeom):
        body, kind = names.body(int(model.geom_bodyid[i])), kinds.get(int(model.geom_type[i]), "other")
        if model.geom_contype[i] or model.geom_conaffinity[i]:
            report.leave("contact shape", body or "world", names.of("geom", i))
        if model.geom_group[i] >= SHOWN:
            continue
        shape = _drawn_geom(model, i, kind)
        if shape is None:
            report.leave(f"shape {kind}", body or "world", names.of("geom", i))
        elif body == GROUND:
            found.ground_shapes.append(shape)
        else:
            found.links[body].shapes.append(shape)


def _drawn_geom(model, i, kind):
    """The `DrawnShape` of a geom, or None."""
    at, size = posed(model.geom_pos[i], model.geom_quat[i]), model.geom_size[i].tolist()
    rgba = model.mat_rgba[model.geom_matid[i]] if model.geom_matid[i] >= 0 else model.geom_rgba[i]
    colour = hexadecimal(rgba)
    if kind == "sphere":
        return DrawnShape("Sphere", (size[0],), at, colour)
    if kind == "box":
        return DrawnShape("Box", (2.0 * np.array(size),), at, colour)
    if kind in ("cylinder", "capsule"):
        return DrawnShape(kind.capitalize(), (size[0], 2.0 * size[1]), at, colour)
    if kind == "mesh":
        m = int(model.geom_dataid[i])
        vertices = model.mesh_vert[model.mesh_vertadr[m] :][: model.mesh_vertnum[m]].astype(float)
        faces = model.mesh_face[model.mesh_faceadr[m] :][: model.mesh_facenum[m]].astype(int)
        return DrawnShape("Mesh", ((vertices, faces), 1.0), at, colour)
    return None
