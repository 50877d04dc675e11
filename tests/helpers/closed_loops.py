"""Planar linkages of Revolute joints in space, which are over-constrained, and their like without redundant rows."""

import numpy as np

import tsdyn as ts
from tsdyn.stress.gallery import bricard, parallelogram, pin, rod

__all__ = ["angles", "bricard", "four_bar", "parallelogram", "pin", "ring", "rod"]


def angles(solution, word="crank"):
    """Angles of bodies whose names begin with a word, rad, (k,) each, counted over turns."""
    found = [body for body in solution.scene.bodies if body.name.startswith(word)]
    matrices = [solution.rotation(body) for body in found]
    return [np.unwrap(np.arctan2(A[:, 1, 0], A[:, 0, 0])) for A in matrices]


def four_bar(planar=False, angle=1.0, rate=3.0, lengths=(1.0, 2.5, 2.0, 2.2)):
    """A crank, a coupler and a rocker, the crank turning at a rate; the last pin may be one of a plane motion."""
    scene = ts.Scene(gravity=(0.0, -9.81, 0.0))
    a, b, c, base = lengths
    foot, far = np.zeros(3), np.array([base, 0.0, 0.0])
    knee = a * np.array([np.cos(angle), np.sin(angle), 0.0])
    way = far - knee
    along = (b * b - c * c + way @ way) / (2.0 * way @ way)
    beside = np.sqrt(b * b / (way @ way) - along**2)
    top = knee + along * way + beside * np.array([-way[1], way[0], 0.0])
    speed = rate * np.array([-knee[1], knee[0], 0.0])
    p, r = top - knee, top - far
    rates = np.linalg.solve([[-p[1], r[1]], [p[0], -r[0]]], -speed[:2])
    middle = speed + rates[0] * np.array([-p[1], p[0], 0.0]) / 2
    crank = rod(scene, foot, knee, 1.0, "crank", speed / 2, rate)
    coupler = rod(scene, knee, top, 1.0, "coupler", middle, rates[0])
    rocker = rod(scene, far, top, 1.0, "rocker", rates[1] * np.array([-r[1], r[0], 0.0]) / 2, rates[1])
    pin(scene, scene.ground, crank, foot)
    pin(scene, crank, coupler, knee)
    pin(scene, coupler, rocker, top)
    pin(scene, rocker, scene.ground, far, planar)
    return scene


def ring(count):
    """Links of 1 m in a closed regular polygon that stands on its first corner and is free to fold."""
    scene = ts.Scene(gravity=(0.0, -9.81, 0.0))
    turn = 2.0 * np.pi * np.arange(count + 1) / count
    corners = 0.5 / np.sin(np.pi / count) * np.stack((np.cos(turn), np.sin(turn), 0.0 * turn), axis=1)
    links = [rod(scene, corners[i], corners[i + 1], name=f"link {i}") for i in range(count)]
    pin(scene, scene.ground, links[0], corners[0])
    for i in range(count):
        pin(scene, links[i - 1], links[i], corners[i])
    return scene
