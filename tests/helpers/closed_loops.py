"""Planar linkages of Revolute joints in space, which are over-constrained, and their like without redundant rows."""

import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts

AXIS = (0.0, 0.0, 1.0)


def rod(scene, first, last, mass=1.0, name="", velocity=(0.0, 0.0, 0.0), rate=0.0, thin=0.01):
    """A rod between two places, its x axis along it; thin is its inertia about that."""
    first, last = np.array(first, float), np.array(last, float)
    along = last - first
    J = mass * (along @ along) / 12 + 0.01
    turn = Rotation.from_rotvec((0.0, 0.0, np.arctan2(along[1], along[0])))
    return scene.add_body(mass, (thin, J, J), (first + last) / 2, turn, velocity, (0.0, 0.0, rate), name)


def pin(scene, a, b, place, planar=False, kind=None):
    """A Revolute, or of its rows the two that a plane motion needs; or a joint of another kind."""
    if kind == "spherical":
        return scene.add(ts.constraints.Spherical.at(a, b, point=place))
    if kind == "cylindrical":
        return scene.add(ts.constraints.Cylindrical.at(a, b, point=place, axis=AXIS))
    if not planar:
        return scene.add(ts.constraints.Revolute.at(a, b, point=place, axis=AXIS))
    for normal in np.eye(3)[:2]:
        scene.add(ts.constraints.PlaneContact.at(a, b, point=place, normal=normal))
    return None


def parallelogram(
    angle=1.0,
    rate=6.0,
    base=2.0,
    crank=1.0,
    loops=1,
    planar=False,
    gravity=(0.0, -9.81, 0.0),
    thin=0.01,
    last=None,
    heavy=2.0,
):
    """Cranks side by side, turning at a rate, and couplers between them: flat, and singular, twice a turn.

    `last` is the kind of the joint between a coupler and the crank after it, heavy a coupler's mass.
    """
    scene = ts.Scene(gravity=gravity)
    arm = crank * np.array([np.cos(angle), np.sin(angle), 0.0])
    speed = rate * np.array([-arm[1], arm[0], 0.0])
    cranks = []
    for i in range(loops + 1):
        foot = np.array([i * base, 0.0, 0.0])
        cranks.append(rod(scene, foot, foot + arm, name=f"crank {i}", velocity=speed / 2, rate=rate, thin=thin))
        pin(scene, scene.ground, cranks[i], foot)
    for i in range(loops):
        near, far = np.array([i * base, 0.0, 0.0]) + arm, np.array([(i + 1) * base, 0.0, 0.0]) + arm
        coupler = rod(scene, near, far, heavy, f"coupler {i}", speed, thin=thin)
        pin(scene, cranks[i], coupler, near)
        pin(scene, coupler, cranks[i + 1], far, planar, last)
    return scene


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


def bricard():
    """Five rods of 1 m and the ground, along edges of a cube, on six Revolutes: one row follows from the others."""
    scene = ts.Scene(gravity=(0.0, -9.81, 0.0))
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 0, 1)], float)
    links = [scene.ground]
    for i in range(5):
        along = corners[i + 1] - corners[i]
        turn = Rotation.align_vectors([along], [(1.0, 0.0, 0.0)])[0]
        links.append(scene.add_body(1.0, (1 / 1200, 1 / 12, 1 / 12), corners[i] + along / 2, turn, name=f"rod {i}"))
    for i in range(6):
        axis = np.cross(corners[i] - corners[i - 1], corners[(i + 1) % 6] - corners[i])
        scene.add(ts.constraints.Revolute.at(links[i], links[(i + 1) % 6], point=corners[i], axis=axis))
    return scene
