"""SDF: models of links, joints and frames, each posed in another one; loops are joints as any other.

The specification is at http://sdformat.org/spec. Poses of links are those of the start, so a joint needs its place in
the ground frame alone.
"""

import numpy as np

from .description import GROUND, Description, JointItem, Link
from .frames import HERE
from .sdf_frames import Frames
from .sdf_joints import add_joints
from .urdf_shapes import add_sdf_shapes


def describe(root, outside, report):
    """The `Description` of a root element <sdf>."""
    root.get("version")
    worlds = root.all("world")
    models = [*root.all("model"), *(model for world in worlds for model in world.all("model"))]
    found = Description(models[0].get("name") or "model" if models else "model")
    for world in worlds[:1]:
        world.get("name")
        physics = world.one("physics")
        if world.one("gravity") is not None:
            found.gravity = world.value("gravity", 3, found.gravity)
        elif physics is not None and physics.one("gravity") is not None:
            found.gravity = physics.value("gravity", 3, found.gravity)
    if not models:
        root.wrong("<sdf> has no <model>.")
    for model in models:
        prefix = f"{model.get('name')}::" if len(models) > 1 else ""
        _add_model(found, model, HERE, prefix, outside, report)
    report.leave_unread(root)
    return found


def _add_model(found, model, outer, prefix, outside, report):
    """Add links and joints of a model, and of the models in it."""
    frames = Frames(model, outer, report)
    model.get("canonical_link")
    static, names = model.flag("static"), {}
    for node in model.all("link"):
        name = prefix + node.demand("name")
        if name in found.links:
            node.wrong(f"there are two links named {name!r}; rename one.")
        found.links[name] = _link(node, name, frames, outside, report)
        names[node.get("name")] = name
    for inner in model.all("model"):
        here = f"{inner.demand('name')}::"
        within = _add_model(found, inner, frames.resolve(inner.get("name")), prefix + here, outside, report)
        names |= {here + one: name for one, name in within.items()}
    for node in model.all("frame"):
        name, owner = node.get("name"), frames.link_of(node.get("name"))
        if owner in names and name not in found.links:
            found.frames[prefix + name] = names[owner], found.links[names[owner]].frame.inverse @ frames.resolve(name)
    add_joints(found, model, frames, names, prefix, report)
    if static:
        found.joints += [JointItem(f"{name} static", "fixed", GROUND, name) for name in names.values()]
    return names


def _link(node, name, frames, outside, report):
    """A link at the start."""
    link = Link(name, frames.resolve(node.get("name")), line=node.line)
    inertial = node.one("inertial")
    if inertial is None:
        link.mass, link.inertia = 1.0, np.eye(3)  # what the specification says
        report.note(f"{name}: mass 1 kg and inertia 1 kg m^2, the defaults of SDF")
    else:
        _set_mass(link, inertial, frames, name, report)
    add_sdf_shapes(link, node, frames, outside, report)
    return link


def _set_mass(link, node, frames, name, report):
    if node.get("auto", "false").lower() in ("1", "true"):
        report.leave("inertia of the densities of contact shapes", name)
    at, inertia = frames.pose(node), node.one("inertia")
    link.mass = node.scalar("mass", 1.0)
    if link.mass < 0.0:
        node.wrong(f"link {name!r}: the mass {link.mass:g} kg is negative.")
    J = np.eye(3)
    if inertia is not None:
        terms = ("xx", "xy", "xz", "yy", "yz", "zz")
        xx, xy, xz, yy, yz, zz = (inertia.scalar(f"i{axes}", float(axes[0] == axes[1])) for axes in terms)
        J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    link.centroid, link.inertia = at.p, at.R @ J @ at.R.T
