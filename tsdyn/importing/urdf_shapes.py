"""Shapes to draw of URDF: visuals, and collisions where a link has no visual that can be drawn."""

import numpy as np

from .frames import HERE, Frame, roll_pitch_yaw
from .meshes import DrawnShape, hexadecimal, mesh


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


def add_shapes(link, node, outside, report, materials):
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
    made = _primitive(shape, name, outside, report)
    return None if made is None else DrawnShape(*made, place, colour)


def placed(node):
    """The frame of an element <origin>."""
    return Frame(node.attribute("xyz", 3, np.zeros(3)), roll_pitch_yaw(node.attribute("rpy", 3, np.zeros(3))))


def _primitive(shape, name, outside, report):
    """Kind and arguments of a shape."""
    if shape.tag == "mesh":
        uri, scale = shape.demand("filename"), shape.attribute("scale", 3, np.ones(3))
        return None if report is None else mesh(uri, scale, outside, report, name)
    if shape.tag == "box":
        kind, sizes = "Box", shape.attribute("size", 3, np.ones(3))
        arguments = (sizes,)
    elif shape.tag in ("cylinder", "capsule"):
        kind, sizes = "Cylinder", np.array([shape.number("radius", 1.0), shape.number("length", 1.0)])
        arguments = tuple(sizes.tolist())
    elif shape.tag == "sphere":
        kind, sizes = "Sphere", np.array([shape.number("radius", 1.0)])
        arguments = tuple(sizes.tolist())
    else:
        shape.skip()
        if report is not None:
            report.leave(f"shape <{shape.tag}>", name)
        return None
    if not (sizes > 0.0).all():
        if report is not None:
            report.leave("shape without extent", name)
        return None
    return kind, arguments


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
    made = _sdf_primitive(shape, name, outside, report)
    return None if made is None else DrawnShape(*made, place, colour)


def _sdf_primitive(shape, name, outside, report):
    """Kind and arguments of a shape; capsules are drawn as cylinders."""
    if shape.tag == "mesh":
        uri, scale = shape.one("uri"), shape.value("scale", 3, np.ones(3))
        return None if report is None or uri is None else mesh(uri.text, scale, outside, report, name)
    sizes = {
        "box": lambda: (shape.value("size", 3, np.ones(3)),),
        "cylinder": lambda: (shape.scalar("radius", 1.0), shape.scalar("length", 1.0)),
        "capsule": lambda: (shape.scalar("radius", 0.5), shape.scalar("length", 1.0)),
        "sphere": lambda: (shape.scalar("radius", 1.0),),
    }.get(shape.tag)
    if sizes is None:
        shape.skip()
        if report is not None:
            report.leave(f"shape <{shape.tag}>", name)
        return None
    found = sizes()
    if not all(np.all(size > 0.0) for size in found):
        return None
    return {"box": "Box", "sphere": "Sphere"}.get(shape.tag, "Cylinder"), found
