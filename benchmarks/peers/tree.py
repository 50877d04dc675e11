"""A definition as a tree of joints, for engines in minimal coordinates.

Every body hangs from the ground or another body by one constraint; what is left over closes loops. The way from a
parent to a body is a row of moves in frames that are all turned as the body is at the start:

    Spherical      ball at the point
    PlaneContact   two slides in the plane, ball at the point
    Distance       the rod, without mass: two hinges at its one end, across it, ball at its other end
"""

from typing import NamedTuple

import numpy as np

from tsdyn.elements.joint import across

from ..contender import Contender, rotation


class Move(NamedTuple):
    """A joint at zero."""

    kind: str  # "slide", "hinge" or "ball"
    step: np.ndarray  # (3,), m, from the place of the move before
    axis: np.ndarray  # (3,); none for a ball
    rate: np.ndarray  # of a slide (m/s), a hinge (rad/s), or (3,) of a ball (rad/s)


class Link(NamedTuple):
    """A body and the way to it."""

    body: int  # row of the definition
    parent: int  # the same, -1 for the ground
    place: np.ndarray  # (3,), m, of the first move in the parent's frame
    turn: np.ndarray  # (3, 3), from the body's frame to the parent's at the start
    moves: tuple
    centre: np.ndarray  # (3,), m, of the centroid from the place of the last move


class Unserved(ValueError):
    """A definition that is no tree of these joints."""


def links(definition):
    """Return the links, parents first, and the constraints left over as rows of the definition."""
    waiting, found, hung = list(enumerate(definition["constraints"])), [], {0}
    while True:
        row = next((c for c in waiting if (c[1][1] in hung) != (c[1][2] in hung)), None)
        if row is None:
            break
        waiting.remove(row)
        found.append(_link(definition, row[1], hung))
        hung.add(found[-1].body + 1)
    if len(found) != len(definition["bodies"]):
        raise Unserved("a body hangs from nothing")
    return found, [i for i, _ in waiting]


def _pose(definition, i):
    """r, A, v, omega' of a body or the ground."""
    if i == 0:
        return np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3)
    body = definition["bodies"][i - 1]
    A = rotation(np.array([body["orientation"]], float))[0]
    return np.array(body["position"], float), A, np.array(body["velocity"], float), np.array(body["angular_velocity"])


def _link(definition, constraint, hung):
    kind, a, b, given = constraint
    points = [np.array(given.get(name, (0, 0, 0)), float) for name in ("point_a", "point_b")]
    if a not in hung:
        a, b, points = b, a, points[::-1]
    ra, Aa, va, wa = _pose(definition, a)
    rb, Ab, vb, wb = _pose(definition, b)
    at, near = points
    turn = Aa.T @ Ab
    wa = turn.T @ wa  # in the child's frame, as everything below
    ball = Move("ball", np.zeros(3), None, wb - wa)
    tip = Ab.T @ vb + np.cross(wb, near)
    if kind == "Spherical":
        moves = (ball,)
    elif kind == "PlaneContact" and a == 0:
        normal = Ab.T @ np.array(given["normal_b"], float)
        at = rb + Ab @ near
        moves = (*(Move("slide", np.zeros(3), axis, tip @ axis) for axis in axes(normal).T[:2]), ball)
    elif kind == "Distance":
        foot = ra + Aa @ at
        rod = Ab.T @ (rb + Ab @ near - foot)
        rate = tip - (Ab.T @ va + np.cross(wa, turn.T @ at)) - np.cross(wa, rod)
        one = np.cross(rod, np.eye(3)[0])
        one /= np.linalg.norm(one)
        two = np.cross(one, rod) / np.linalg.norm(rod)
        rates = np.linalg.lstsq(np.stack([np.cross(one, rod), np.cross(two, rod)], axis=1), rate, rcond=None)[0]
        ball = Move("ball", rod, None, wb - wa - rates[0] * one - rates[1] * two)
        moves = (*(Move("hinge", np.zeros(3), axis, r) for axis, r in zip((one, two), rates, strict=True)), ball)
    else:
        raise Unserved(f"{kind} is no joint")
    return Link(b - 1, a - 1, at, turn, moves, -near)


def is_tree(scene):
    """Whether a scene is a tree of these joints."""
    if scene.definition is None:
        return False
    try:
        return not links(scene.definition())[1]
    except Unserved:
        return False


class OnTrees(Contender):
    """An engine in minimal coordinates."""

    def serves(self, scene):
        """Trees of 64 bodies at most."""
        return is_tree(scene) and scene.size <= 64


class Joint(NamedTuple):
    """A joint at zero, about or along the z axis of its own frame, or a ball; what it carries is in that frame."""

    kind: str
    parent: int  # row of the joints, -1 the ground
    turn: np.ndarray  # (3, 3), from its frame to the parent joint's
    place: np.ndarray  # (3,), m, in the parent joint's frame
    rate: np.ndarray
    mass: float  # kg; 0 between the moves of a link
    centre: np.ndarray  # (3,), m
    inertia: np.ndarray  # (3, 3), kg m^2, about the centre


class Tree(NamedTuple):
    """Joints, and of every body its joint and the turn from its own frame to the joint's."""

    joints: list
    on: list
    frames: list


def tree(definition, balls=True):
    """Return the joints of a definition, parents first; with balls=False a ball is three hinges, about y, x and z.

    Those are singular where the second is at 90 degrees.
    """
    joints, on, frames, centres = [], {-1: -1}, {-1: np.eye(3)}, {-1: np.zeros(3)}
    for link in links(definition)[0]:
        body = definition["bodies"][link.body]
        last, frame, at, turn = on[link.parent], frames[link.parent], centres[link.parent] + link.place, link.turn
        for move in link.moves if balls else _hinges(link):
            new = np.eye(3) if move.kind == "ball" else axes(move.axis)
            place = frame.T @ (at + turn @ move.step)
            joints.append(
                Joint(move.kind, last, frame.T @ turn @ new, place, move.rate, 0.0, np.zeros(3), np.zeros((3, 3)))
            )
            last, frame, at, turn = len(joints) - 1, new, np.zeros(3), np.eye(3)
        joints[-1] = joints[-1]._replace(
            mass=body["mass"], centre=frame.T @ link.centre, inertia=frame.T @ np.array(body["inertia"], float) @ frame
        )
        on[link.body], frames[link.body], centres[link.body] = last, frame, link.centre
    bodies = range(len(definition["bodies"]))
    return Tree(joints, [on[i] for i in bodies], [frames[i].T for i in bodies])


def axes(z):
    """A right-handed frame, by columns, with a given z axis (unit)."""
    return np.stack([*across(z), z], axis=1)


def _hinges(link):
    for move in link.moves:
        if move.kind != "ball":
            yield move
            continue
        for k, i in enumerate((1, 0, 2)):
            yield Move("hinge", np.zeros(3) if k else move.step, np.eye(3)[i], move.rate[i])
