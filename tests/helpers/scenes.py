"""Scenes as plain data, the same in reference files and in random tests, and formulas of their own for what they mean.

A definition is a dictionary: gravity; bodies, each a dictionary of the arguments of `add_body` (or, without an inertia,
of `add_point_mass`); constraints, each (class name, body a, body b, arguments), the ground being body 0; forces, if
there are any, each (class name, bodies, arguments).
"""

from itertools import pairwise

import numpy as np

import tsdyn as ts


def build(definition):
    """The scene of a definition."""
    scene = ts.Scene(gravity=definition["gravity"])
    bodies = [scene.ground]
    for body in definition["bodies"]:
        bodies.append(scene.add_body(**body) if "inertia" in body else scene.add_point_mass(**body))
    for kind, a, b, arguments in definition["constraints"]:
        scene.add(getattr(ts.constraints, kind)(bodies[a], bodies[b], **arguments))
    for kind, *on, arguments in definition.get("forces", ()):
        scene.add(getattr(ts.forces, kind)(*(bodies[i] for i in on), **arguments))
    return scene


# random definitions


def unit(rng, n=3):
    """A random direction."""
    x = rng.normal(size=n)
    return x / np.linalg.norm(x)


def random_body(rng, position=(0.0, 0.0, 0.0), speed=1.0):
    """A rigid body of 0.5 to 2 kg about 0.3 m large, its inertia a full matrix."""
    mass = rng.uniform(0.5, 2.0)
    cloud = 0.3 * rng.normal(size=(12, 3))
    second = np.cov(cloud.T)
    return {
        "mass": mass,
        "inertia": mass * (np.trace(second) * np.eye(3) - second),
        "position": np.add(position, 0.3 * rng.normal(size=3)),
        "orientation": unit(rng, 4),
        "velocity": speed * rng.normal(size=3),
        "angular_velocity": 3.0 * speed * rng.normal(size=3),
    }


def random_chain(rng, links, gravity=(0.0, 0.0, -9.81)):
    """Links on spherical joints, the first on the ground, consistent in position and velocity as they are built."""
    bodies, constraints = [], []
    joint, joint_velocity, last, point = np.zeros(3), np.zeros(3), 0, np.zeros(3)
    for i in range(links):
        body = random_body(rng)
        near, far = 0.5 * unit(rng), 0.5 * unit(rng)
        A, w = rotation(body["orientation"]), body["angular_velocity"]
        body["position"] = joint - A @ near
        body["velocity"] = joint_velocity - A @ np.cross(w, near)
        bodies.append(body)
        constraints.append(("Spherical", last, i + 1, {"point_a": point, "point_b": near}))
        joint = body["position"] + A @ far
        joint_velocity = body["velocity"] + A @ np.cross(w, far)
        last, point = i + 1, far
    return {"gravity": gravity, "bodies": bodies, "constraints": constraints}


def length(t):
    return 1.5 + 0.2 * np.sin(3.0 * t)


def length_d(t):
    return 0.6 * np.cos(3.0 * t)


def length_dd(t):
    return -1.8 * np.sin(3.0 * t)


def cosine(t):
    return 0.3 * np.sin(2.0 * t + 0.5)


def cosine_d(t):
    return 0.6 * np.cos(2.0 * t + 0.5)


def cosine_dd(t):
    return -1.2 * np.sin(2.0 * t + 0.5)


MOTION = {"length": (length, length_d, length_dd), "value": (cosine, cosine_d, cosine_dd)}

# every primitive, constant and driven: the arguments that it needs, at random
PRIMITIVES = {
    "Spherical": ("Spherical", ("point_a", "point_b"), {}),
    "Distance": ("Distance", ("point_a", "point_b"), {"length": 1.5}),
    "Distance, length as it starts": ("Distance", ("point_a", "point_b"), {}),
    "Distance, driven": ("Distance", ("point_a", "point_b"), {"length": MOTION["length"]}),
    "PlaneContact": ("PlaneContact", ("point_a", "point_b", "normal_b"), {}),
    "Dot1": ("Dot1", ("axis_a", "axis_b"), {}),
    "Dot1, at an angle": ("Dot1", ("axis_a", "axis_b"), {"value": 0.4}),
    "Dot1, driven": ("Dot1", ("axis_a", "axis_b"), {"value": MOTION["value"]}),
    "Dot2": ("Dot2", ("axis_a", "point_a", "point_b"), {}),
    "Dot2, at an offset": ("Dot2", ("axis_a", "point_a", "point_b"), {"value": -0.3}),
    "Dot2, driven": ("Dot2", ("axis_a", "point_a", "point_b"), {"value": MOTION["value"]}),
}
BETWEEN = {"body to body": (1, 2), "body to ground": (1, 0), "ground to body": (0, 1)}


def random_primitive(rng, name, a, b):
    """One of PRIMITIVES between bodies a and b; its points are 0.4 m from the centroids."""
    kind, places, arguments = PRIMITIVES[name]
    random = {place: (0.4 if place.startswith("point") else 2.0) * unit(rng) for place in places}
    return kind, a, b, random | arguments


def random_pair(rng, name, between):
    """Two bodies, moving freely but for one primitive; `scene.assemble()` makes them consistent."""
    bodies = [random_body(rng), random_body(rng, position=(1.2, 0.4, -0.3))]
    if 0 in BETWEEN[between]:
        bodies[0]["position"] = bodies[0]["position"] + [0.9, -0.7, 0.5]
    constraint = random_primitive(rng, name, *BETWEEN[between])
    return {"gravity": (0.3, -0.2, -9.6), "bodies": bodies, "constraints": [constraint]}


# formulas of their own: quaternions, complex numbers allowed


def product(p, q):
    """Quaternion product, (..., 4)."""
    p0, p1, p2, p3 = np.moveaxis(np.asarray(p), -1, 0)
    q0, q1, q2, q3 = np.moveaxis(np.asarray(q), -1, 0)
    return np.stack(
        [
            p0 * q0 - p1 * q1 - p2 * q2 - p3 * q3,
            p0 * q1 + p1 * q0 + p2 * q3 - p3 * q2,
            p0 * q2 - p1 * q3 + p2 * q0 + p3 * q1,
            p0 * q3 + p1 * q2 - p2 * q1 + p3 * q0,
        ],
        axis=-1,
    )


def rotate(p, s):
    """p s p*: a body's vector in the ground frame, times |p|^2."""
    p = np.asarray(p)
    s = np.broadcast_to(np.concatenate(([0.0], s)), p.shape)
    return product(product(p, s), p * [1, -1, -1, -1])[..., 1:]


def rotation(p):
    """The rotation matrix of p, by columns."""
    return np.stack([rotate(p, e) for e in np.eye(3)], axis=-1)


def slices(definition):
    """Where the coordinates of each body are in q."""
    sizes = [7 if "inertia" in body else 3 for body in definition["bodies"]]
    ends = np.cumsum([0, *sizes])
    return [slice(i, j) for i, j in pairwise(ends)]


def start(definition):
    """(q, qd) that a definition says: pd = p omega / 2."""
    q, qd = [], []
    for body in definition["bodies"]:
        q.append(body["position"])
        qd.append(body["velocity"])
        if "inertia" in body:
            q.append(body["orientation"])
            qd.append(product(body["orientation"], np.concatenate(([0.0], body["angular_velocity"]))) / 2)
    return np.concatenate(q), np.concatenate(qd)


def constraints(definition, q, t):
    """Phi (..., m) at q (..., n) and t: rows as in the reference of each class, then the normalisations."""
    where = [None, *slices(definition)]

    def vector(body, s):
        s = np.asarray(s, float)
        return rotate(q[..., where[body]][..., 3:], s) if body else np.broadcast_to(s, (*q.shape[:-1], 3))

    def point(body, s):
        if body == 0:
            return vector(0, s)
        r = q[..., where[body]]
        return r[..., :3] + vector(body, s) if r.shape[-1] == 7 else r

    def axis(body, s):
        return vector(body, np.divide(s, np.linalg.norm(s)))

    def value(x):
        return x[0](t) if isinstance(x, tuple) else x

    rows = []
    for kind, a, b, given in definition["constraints"]:
        get = {"point_a": np.zeros(3), "point_b": np.zeros(3), "value": 0.0, "length": None} | given
        if kind in ("Spherical", "Distance", "PlaneContact"):
            d = point(a, get["point_a"]) - point(b, get["point_b"])
        if kind == "Spherical":
            rows += list(np.moveaxis(d, -1, 0))
        elif kind == "Distance":
            now, first = get["length"], get["length"]
            if now is None:
                q0 = start(definition)[0]
                two = {"constraints": [("Spherical", a, b, given)], "bodies": definition["bodies"]}
                now = first = np.linalg.norm(constraints(two, q0, 0.0)[:3])
            first = first[0](0.0) if isinstance(first, tuple) else first
            rows.append(((d * d).sum(-1) - value(now) ** 2) / (2 * first))
        elif kind == "PlaneContact":
            rows.append((axis(b, get["normal_b"]) * d).sum(-1))
        elif kind == "Dot1":
            rows.append((axis(a, get["axis_a"]) * axis(b, get["axis_b"])).sum(-1) - value(get["value"]))
        elif kind == "Dot2":
            d = point(b, get["point_b"]) - point(a, get["point_a"])
            rows.append((axis(a, get["axis_a"]) * d).sum(-1) - value(get["value"]))
        else:
            raise ValueError(kind)
    for part, body in zip(where[1:], definition["bodies"], strict=True):
        if "inertia" in body:
            p = q[..., part][..., 3:]
            rows.append(((p * p).sum(-1) - 1) / 2)
    return np.stack(rows, axis=-1) if rows else np.zeros((*q.shape[:-1], 0))


def taylor(f, radius=0.1):
    """f(0), f'(0) and f''(0) of an analytic function of a complex number, by Cauchy's integral on 16 points.

    Exact but for rounding, about eps |f| / radius^k, where f is a polynomial of degree below 16.
    """
    z = radius * np.exp(2j * np.pi * np.arange(16) / 16)
    coefficients = np.fft.fft(np.stack([f(s) for s in z]), axis=0)[:3].real / 16
    return coefficients[0], coefficients[1] / radius, 2 * coefficients[2] / radius**2


def levels(definition, t, q, qd, qdd):
    """Phi and its first two time derivatives along a motion, m each."""
    scale = 1 / (1 + np.abs(qd).max() + np.sqrt(np.abs(qdd).max()))
    return taylor(lambda s: constraints(definition, q + s * qd + s * s / 2 * qdd, t + s), scale)
