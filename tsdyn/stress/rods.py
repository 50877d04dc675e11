"""Chains, trees, hubs, loops and nets of rods as plain data, which other engines can read, too.

A definition is a dictionary: gravity (m/s^2); bodies, each the arguments of `Scene.add_body`; constraints, each (class
of ts.constraints, body a, body b, arguments), the ground being body 0; forces, each (class of ts.forces, body,
arguments).

Rods are 1 m long, of 1 kg, (0.1, 0.1, 0.02) kg m^2, along their body z axis, the near end at z = +0.5 m.
"""

import numpy as np

from .. import constraints, forces
from ..simulation.scene import Scene

GRAVITY = (0.0, 0.0, -9.81)
HALF = 0.5  # m, from a rod's centroid to its ends
NEAR, FAR = (0.0, 0.0, HALF), (0.0, 0.0, -HALF)


def build(definition):
    """Make the ts.Scene of a definition."""
    scene = Scene(gravity=definition["gravity"])
    bodies = [scene.ground, *(scene.add_body(**body) for body in definition["bodies"])]
    for kind, a, b, arguments in definition["constraints"]:
        scene.add(getattr(constraints, kind)(bodies[a], bodies[b], **arguments))
    for kind, a, arguments in definition.get("forces", ()):
        scene.add(getattr(forces, kind)(bodies[a], **arguments))
    return scene


def rod(near, along):
    """A rod at rest, from a point in a direction (unit vector), turned the shortest way from the body's -z axis."""
    along = np.asarray(along, float)
    axis = np.array([along[1], -along[0], 0.0])  # -z x along
    p = np.array([1.0 - along[2], *axis])
    if np.linalg.norm(p) < 1e-9:  # upwards
        p = np.array([0.0, 1.0, 0.0, 0.0])
    return {
        "mass": 1.0,
        "inertia": [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.02]],
        "position": (np.asarray(near) + HALF * along).tolist(),
        "orientation": (p / np.linalg.norm(p)).tolist(),
        "velocity": [0.0, 0.0, 0.0],
        "angular_velocity": [0.0, 0.0, 0.0],
    }


def end(body, sign):
    """The near (1) or far (-1) end of a rod, m."""
    return np.asarray(body["position"]) - sign * HALF * direction(body)


def direction(body):
    """From the near end to the far end."""
    e0, e1, e2, e3 = body["orientation"]
    return -np.array([2 * (e1 * e3 + e0 * e2), 2 * (e2 * e3 - e0 * e1), 1 - 2 * (e1 * e1 + e2 * e2)])


def joint(a, b, point_a, point_b):
    """A spherical joint."""
    return ["Spherical", a, b, {"point_a": list(point_a), "point_b": list(point_b)}]


def chain(links):
    """Rods in a row, hung at one end, released from horizontal; a small side force on the last.

    For 4 and 16 links it is what the reference files define.
    """
    turned = [np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0]
    bodies = [rod((i, 0.0, 0.0), (1.0, 0.0, 0.0)) | {"orientation": turned} for i in range(links)]
    joints = [joint(i, i + 1, FAR if i else (0.0, 0.0, 0.0), NEAR) for i in range(links)]
    push = ["PointForce", links, {"point_a": [0.0, 0.0, 0.0], "force": [0.0, 0.1, 0.0]}]
    return {"gravity": GRAVITY, "bodies": bodies, "constraints": joints, "forces": [push]}


def tree(levels):
    """A binary tree of 2^levels - 1 rods, hung at its root, released from horizontal; each fork opens by 70 degrees."""
    bodies, joints = [rod((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))], [joint(0, 1, (0.0, 0.0, 0.0), NEAR)]
    turn = np.radians(35.0)
    for i in range(1, 2**levels - 1):
        parent = bodies[(i - 1) // 2]
        along = direction(parent)
        level = int(np.log2(i + 1))
        across = np.cross(along, [0.0, 1.0, 0.0] if level % 2 else [0.3, 0.0, 1.0])
        across *= (1.0 if i % 2 else -1.0) / np.linalg.norm(across)
        bodies.append(rod(end(parent, -1), np.cos(turn) * along + np.sin(turn) * across))
        joints.append(joint((i - 1) // 2 + 1, i + 1, FAR, NEAR))
    return {"gravity": GRAVITY, "bodies": bodies, "constraints": joints}


def hub(rods):
    """A heavy wheel on a spherical joint at its middle, and rods around it, released from horizontal."""
    radius = max(1.0, rods / 30.0)  # m
    body = {
        "mass": float(rods),
        "inertia": (np.array([0.3, 0.3, 0.5]) * rods * radius**2).tolist(),
        "position": [0.0, 0.0, 0.0],
        "orientation": [1.0, 0.0, 0.0, 0.0],
        "velocity": [0.0, 0.0, 0.0],
        "angular_velocity": [0.0, 0.0, 0.0],
    }
    bodies, joints = [body], [joint(0, 1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))]
    for angle in 2.0 * np.pi * np.arange(rods) / rods:
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        at = radius * out
        bodies.append(rod(at, out))
        joints.append(joint(1, len(bodies), at.tolist(), NEAR))
    return {"gravity": GRAVITY, "bodies": bodies, "constraints": joints}


def loop(links):
    """Rods in a half circle in the horizontal plane, both ends hung from the ground: one closed loop."""
    turn = np.pi / links
    angles = np.pi / 2 - turn * (np.arange(links) + 0.5)
    bodies, at = [], np.zeros(3)
    for angle in angles:
        bodies.append(rod(at, (np.cos(angle), np.sin(angle), 0.0)))
        at = end(bodies[-1], -1)
    joints = [joint(i, i + 1, FAR if i else (0.0, 0.0, 0.0), NEAR) for i in range(links)]
    joints.append(joint(links, 0, FAR, at))
    return {"gravity": GRAVITY, "bodies": bodies, "constraints": joints}


def net(rows, columns):
    """A flat net of rows x columns square meshes, a rod an edge, hung from two opposite corners, released at rest.

    Rods meet in spherical joints; each mesh is a loop.
    """
    bodies, ends = [], {}  # node -> [(body, which end)]
    for i in range(rows + 1):
        for j in range(columns + 1):
            for other, along in (((i, j + 1), (1.0, 0.0, 0.0)), ((i + 1, j), (0.0, 1.0, 0.0))):
                if other[0] <= rows and other[1] <= columns:
                    bodies.append(rod((j, i, 0.0), along))
                    ends.setdefault((i, j), []).append((len(bodies), NEAR))
                    ends.setdefault(other, []).append((len(bodies), FAR))
    joints = []
    for (i, j), meeting in ends.items():
        first, point = meeting[0]
        if (i, j) in ((0, 0), (rows, columns)):
            joints.append(joint(0, first, (float(j), float(i), 0.0), point))
        joints += [joint(first, body, point, other) for body, other in meeting[1:]]
    return {"gravity": GRAVITY, "bodies": bodies, "constraints": joints}
