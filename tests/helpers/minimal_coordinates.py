"""Chains of bodies in minimal coordinates, by formulas of their own: what joints are compared with.

A chain is a list of links. Each link is some moves, one coordinate each, about or along axes fixed in the frame that
has been reached, and then a body in the frame so reached. Everything is in the ground frame.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import tsdyn as ts

C = ts.constraints
X, Y, Z = np.eye(3)
TILT = 0.7  # rad, of ConstantAngle
LEAD = 0.2  # m/rad, of Screw
CONE = np.array([np.sin(TILT), 0.0, np.cos(TILT)])


class Link(NamedTuple):
    """A joint and the body beyond it; at x = 0 all frames are along the ground's."""

    kind: str  # a key of JOINTS
    step: np.ndarray  # (3,) from the centroid before to the joint
    frame: np.ndarray  # (3, 3) columns: the joint's x, y, z
    arm: np.ndarray  # (3,) from the joint to the body's centroid
    mass: float
    inertia: np.ndarray  # (3, 3) about the centroid
    turn: np.ndarray  # (3, 3) of the body's own frame in the frame reached


# relative coordinates of each joint, from its first body to its second: (what, axis in the joint's frame), what being
# "turn", "slide" or "screw", which is both;
# then the joint itself from the ground-frame geometry at x = 0: point P, columns Q of its frame
SLIDES = [("slide", X), ("slide", Y), ("slide", Z)]
TURNS = [("turn", X), ("turn", Y), ("turn", Z)]
JOINTS = {
    "Revolute": ([("turn", Z)], lambda a, b, P, Q, **o: C.Revolute.at(a, b, point=P, axis=Q[:, 2], **o)),
    "Cylindrical": (
        [("slide", Z), ("turn", Z)],
        lambda a, b, P, Q, **o: C.Cylindrical.at(a, b, point=P, axis=Q[:, 2], **o),
    ),
    "Screw": ([("screw", Z)], lambda a, b, P, Q, **o: C.Screw.at(a, b, point=P, axis=Q[:, 2], lead=LEAD, **o)),
    "Translational": ([("slide", Z)], lambda a, b, P, Q, **o: C.Translational.at(a, b, point=P, axis=Q[:, 2], **o)),
    "Universal": (
        [("turn", X), ("turn", Y)],
        lambda a, b, P, Q, **o: C.Universal.at(a, b, point=P, axis=Q[:, 0], axis_b=Q[:, 1], **o),
    ),
    "Fixed": ([], lambda a, b, P, Q, **o: C.Fixed.at(a, b, point=P, **o)),
    "Planar": (
        [("slide", X), ("slide", Y), ("turn", Z)],
        lambda a, b, P, Q, **o: C.Planar.at(a, b, point=P, axis=Q[:, 2], **o),
    ),
    "PointOnLine": ([*TURNS, ("slide", Z)], lambda a, b, P, Q, **o: C.PointOnLine.at(a, b, point=P, axis=Q[:, 2], **o)),
    "Parallel": ([*SLIDES, ("turn", Z)], lambda a, b, P, Q, **o: C.Parallel.at(a, b, axis=Q[:, 2], **o)),
    "ConstantAngle": (
        [*SLIDES, ("turn", Z), ("turn", CONE)],
        lambda a, b, P, Q, **o: C.ConstantAngle.at(a, b, axis_a=Q[:, 2], axis_b=Q @ CONE, **o),
    ),
    "Spherical": (TURNS, lambda a, b, P, Q, **o: C.Spherical.at(a, b, point=P, **o)),
}


def random_link(rng, kind):
    """A link of about half a metre and a kilogram."""
    cloud = 0.3 * rng.normal(size=(12, 3))
    second = np.cov(cloud.T)
    mass = rng.uniform(0.5, 2.0)
    return Link(
        kind,
        0.4 * rng.normal(size=3),
        Rotation.random(random_state=rng).as_matrix(),
        0.4 * rng.normal(size=3),
        mass,
        mass * (np.trace(second) * np.eye(3) - second),
        Rotation.random(random_state=rng).as_matrix(),
    )


def moves(links):
    """Every move in turn: (link, what, axis)."""
    return [(i, what, link.frame @ axis) for i, link in enumerate(links) for what, axis in JOINTS[link.kind][0]]


class Pose(NamedTuple):
    """A body: its centroid and frame, their rates, accelerations as far as xdd = 0, Jacobians (3, n)."""

    r: np.ndarray
    A: np.ndarray
    v: np.ndarray
    w: np.ndarray
    a: np.ndarray
    alpha: np.ndarray
    Jv: np.ndarray
    Jw: np.ndarray
    point: np.ndarray  # of the joint before it, as a point of the frame before


def poses(links, x, xd):
    """A `Pose` for each link."""
    n = len(x)
    A, r, v, w, a, alpha = np.eye(3), *np.zeros((5, 3))
    Jv, Jw = np.zeros((2, 3, n))
    result, k = [], 0

    def shifted(d):
        return (
            r + d,
            v + np.cross(w, d),
            a + np.cross(alpha, d) + np.cross(w, np.cross(w, d)),
            Jv + np.cross(Jw.T, d).T,
        )

    for link in links:
        r, v, a, Jv = shifted(A @ link.step)
        point = r
        for what, axis in JOINTS[link.kind][0]:
            local = link.frame @ axis
            u = A @ local
            if what == "screw":
                travel = LEAD * x[k]
                r, v, a, Jv = shifted(u * travel)
                v, a = v + u * LEAD * xd[k], a + 2.0 * np.cross(w, u) * LEAD * xd[k]
                Jv[:, k] += LEAD * u
            if what != "slide":
                alpha = alpha + np.cross(w, u) * xd[k]
                w = w + u * xd[k]
                Jw = Jw.copy()
                Jw[:, k] += u
                A = A @ Rotation.from_rotvec(local * x[k]).as_matrix()
            else:
                r, v, a, Jv = shifted(u * x[k])
                v, a = v + u * xd[k], a + 2.0 * np.cross(w, u) * xd[k]
                Jv[:, k] += u
            k += 1
        r, v, a, Jv = shifted(A @ link.arm)
        result.append(Pose(r, A, v, w, a, alpha, Jv, Jw, point))
    return result


def accelerations(links, x, xd, gravity):
    """xdd (n,) and the poses."""
    n = len(x)
    M, f, found = np.zeros((n, n)), np.zeros(n), poses(links, x, xd)
    for link, pose in zip(links, found, strict=True):
        J = pose.A @ link.inertia @ pose.A.T
        M += link.mass * pose.Jv.T @ pose.Jv + pose.Jw.T @ J @ pose.Jw
        f += link.mass * pose.Jv.T @ (gravity - pose.a)
        f -= pose.Jw.T @ (J @ pose.alpha + np.cross(pose.w, J @ pose.w))
    return np.linalg.solve(M, f) if n else f, found


def motion(links, x, xd, times, gravity):
    """x and xd (k, n) at the times, by SciPy at 1e-12."""
    n = len(x)
    if not n:
        return np.zeros((2, len(times), 0))

    def rates(t, y):
        return np.concatenate((y[n:], accelerations(links, y[:n], y[n:], gravity)[0]))

    y = solve_ivp(rates, (0.0, times[-1]), [*x, *xd], "DOP853", times, rtol=1e-12, atol=1e-13).y.T
    return y[:, :n], y[:, n:]


def reactions(links, x, xd, gravity):
    """What each joint exerts on the body beyond it: force, and torque about the joint's point of the frame before."""
    xdd, found = accelerations(links, x, xd, gravity)
    force, about_origin, result = np.zeros(3), np.zeros(3), []
    for link, pose in reversed(list(zip(links, found, strict=True))):
        J = pose.A @ link.inertia @ pose.A.T
        push = link.mass * (pose.a + pose.Jv @ xdd - gravity)
        force = force + push
        about_origin = about_origin + np.cross(pose.r, push) + J @ (pose.alpha + pose.Jw @ xdd)
        about_origin = about_origin + np.cross(pose.w, J @ pose.w)
        result.append((force, about_origin - np.cross(pose.point, force)))
    return result[::-1]


def build(links, gravity, swapped=()):
    """The scene of a chain, made at x = 0, and its joints; those swapped have their bodies the other way."""
    scene = ts.Scene(gravity=gravity)
    before, joints, n = scene.ground, [], len(moves(links))
    for i, (link, pose) in enumerate(zip(links, poses(links, np.zeros(n), np.zeros(n)), strict=True)):
        inertia = link.turn.T @ link.inertia @ link.turn
        body = scene.add_body(
            link.mass, (inertia + inertia.T) / 2, pose.r, Rotation.from_matrix(link.turn), name=f"body {i + 1}"
        )
        pair = (body, before) if i in swapped else (before, body)
        joints.append(scene.add(JOINTS[link.kind][1](*pair, pose.point, link.frame, name=f"joint {i + 1}")))
        before = body
    return scene, joints


def place(scene, links, x, xd):
    """Put the bodies where the coordinates say."""
    for body, link, pose in zip(scene.bodies, links, poses(links, x, xd), strict=True):
        A = pose.A @ link.turn
        body.position, body.velocity, body.orientation = pose.r, pose.v, Rotation.from_matrix(A)
        body.angular_velocity = A.T @ pose.w


def balance(solution):
    """What is missing to Newton's and Euler's equations of each body, relative to the largest term: the largest."""
    scene, worst = solution.scene, 0.0
    items = [*scene.constraints, *scene.forces]
    for body in scene.bodies:
        r, A = solution.position(body), solution.rotation(body)
        forces = [np.tile(body.mass * scene.gravity, (len(r), 1)), -body.mass * solution.acceleration(body)]
        w, wd = solution.angular_velocity(body), solution.angular_acceleration(body)
        torques = [-np.einsum("kij,kj->ki", A, wd @ body.inertia + np.cross(w, w @ body.inertia))]
        for item in items:
            if body not in (item.a, item.b):
                continue
            force, torque = solution.reaction(item, on=body)
            arm = A @ getattr(item, "point_a" if body is item.a else "point_b", np.zeros(3))
            if any(hasattr(type(part), "contact") for part in getattr(item, "parts", ())):
                arm = solution.contact_point(item) - r
            forces.append(force)
            torques += [torque, np.cross(arm, force)]
        size = max(np.abs(part).max() for part in (*forces, *torques))
        worst = max(worst, *(np.abs(sum(parts)).max() / size for parts in (forces, torques)))
    return worst
