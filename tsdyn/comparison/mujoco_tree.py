"""The joints of a scene as a tree, which MuJoCo has in minimal coordinates, and those that close loops."""

from typing import Any, NamedTuple

import numpy as np

from ..elements.bodies import rotation_matrix
from ..elements.joint import across

LOOPS = ("Spherical", "Revolute", "Fixed", "Distance")
TREE = ("Revolute", "Translational", "Cylindrical", "Spherical", "Universal", "Planar", "Fixed")


class Move(NamedTuple):
    """A joint of MuJoCo: hinge, slide, ball or free, in the frame of the child."""

    kind: str
    at: Any = None
    axis: Any = None


class Link(NamedTuple):
    """A body, what it hangs from, and how it moves there."""

    body: Any
    parent: Any
    moves: tuple
    joint: Any = None


def spanning_tree(scene):
    """`Link`s, parents first, and the constraints that are left over."""
    waiting = [item for item in scene.constraints if not getattr(item, "normalises", False)]
    placed, links = {scene.ground}, []
    while len(links) < len(scene.bodies):
        item = next((one for one in waiting if _kind(one) in TREE and (one.a in placed) != (one.b in placed)), None)
        if item is None:
            body = next(body for body in scene.bodies if body not in placed)
            links.append(Link(body, scene.ground, _free(body)))
        else:
            waiting.remove(item)
            body, parent = (item.b, item.a) if item.a in placed else (item.a, item.b)
            links.append(Link(body, parent, moves_of(item, body), item))
        placed.add(links[-1].body)
    return links, waiting


def _kind(item):
    return type(item).__name__


def _free(body):
    """A body of its own; a particle slides in three directions."""
    if body.dimension == 7:
        return (Move("free"),)
    return tuple(Move("slide", np.zeros(3), axis) for axis in np.eye(3))


def moves_of(joint, child):
    """What a joint lets the child do."""
    own, kind = "b" if child is joint.b else "a", _kind(joint)
    at, axis = getattr(joint, f"point_{own}"), getattr(joint, f"axis_{own}", None)
    if kind == "Fixed":
        return ()
    if kind == "Spherical":
        return (Move("ball", at),) if child.dimension == 7 else ()
    if kind == "Universal":
        other = "a" if own == "b" else "b"
        parent = joint.a if own == "b" else joint.b
        A, B = (rotation_matrix(np.asarray(body.orientation)) for body in (parent, child))
        return Move("hinge", at, B.T @ A @ getattr(joint, f"axis_{other}")), Move("hinge", at, axis)
    slides = {"Translational": (axis,), "Cylindrical": (axis,), "Planar": across(axis)}.get(kind, ())
    hinge = () if kind == "Translational" else (Move("hinge", at, axis),)
    return (*(Move("slide", at, direction) for direction in slides), *hinge)


def refused(scene):
    """Constraints that have no counterpart, with the reason."""
    _, loops = spanning_tree(scene)
    found = []
    for item in scene.constraints:
        kind = item._kind()
        if getattr(item, "normalises", False):
            continue
        if kind not in (*TREE, *LOOPS):
            found.append((item, f"{kind} has no counterpart"))
        elif any(item is one for one in loops) and kind not in LOOPS:
            found.append((item, f"{kind} closes a loop, for which there is no equality constraint"))
    return found
