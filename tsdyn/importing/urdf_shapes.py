"""Shapes to draw of URDF: visuals, and collisions where a link has no visual that can be drawn."""

import numpy as np

from .frames import Frame, roll_pitch_yaw
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
    for texture in node.all("texture"):
        texture.skip()
    return known.get(named, "") if colour is None else hexadecimal(colour.attribute("rgba", 4, [0.5, 0.5, 0.5, 1.0]))


def add_shapes(link, node, folder, report, materials):
    """Add the shapes of an element <link>; contact shapes are listed."""
    collisions = node.all("collision")
    drawn = [_shape(one, link.name, folder, report, materials) for one in node.all("visual")]
    link.shapes = [shape for shape in drawn if shape is not None]
    for one in collisions:
        shape = _shape(one, link.name, folder, report if not link.shapes else None, materials)
        report.leave("contact shape", link.name)
        if shape is not None and not any(drawn):
            link.shapes.append(shape)


def _shape(node, name, folder, report, materials):
    """The `DrawnShape` of an element <visual> or <collision>, or None."""
    node.get("name")
    at, geometry, material = node.one("origin"), node.one("geometry"), node.one("material")
    colour = "" if material is None else _colour(material, materials)
    if geometry is None or not geometry.nodes:
        node.wrong(f"link {name!r}: <{node.tag}> lacks <geometry> with a shape.")
        return None
    place = Frame(np.zeros(3), np.eye(3))
    if at is not None:
        place = Frame(at.attribute("xyz", 3, np.zeros(3)), roll_pitch_yaw(at.attribute("rpy", 3, np.zeros(3))))
    shape = geometry.nodes[0]
    geometry.all(shape.tag)
    made = _primitive(shape, name, folder, report)
    return None if made is None else DrawnShape(*made, place, colour)


def _primitive(shape, name, folder, report):
    """Kind and arguments of a shape."""
    if shape.tag == "mesh":
        uri, scale = shape.demand("filename"), shape.attribute("scale", 3, np.ones(3))
        return None if report is None else mesh(uri, scale, folder, report, name)
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
