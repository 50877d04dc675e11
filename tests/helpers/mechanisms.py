"""Random mechanisms of every primitive, and their residuals, speeds and mass matrices in NumPy."""

import numpy as np

import tsdyn as ts

C = ts.constraints


def unit(rng, n):
    x = rng.normal(size=n)
    return x / np.linalg.norm(x)


def skew(e):
    """The matrix of e x."""
    return np.cross(np.eye(3), e)


def rotation(p):
    """A(p), body to ground, by the formula of Rodrigues: not the package's own."""
    e0, e = p[0], p[1:]
    return (e0 * e0 - e @ e) * np.eye(3) + 2.0 * np.outer(e, e) + 2.0 * e0 * skew(e)


def body(scene, rng, near=(0.0, 0.0, 0.0)):
    cloud = rng.normal(size=(8, 3)) * (0.3, 0.2, 0.1)
    second = cloud.T @ cloud / 8.0
    return scene.add_body(
        rng.uniform(0.5, 3.0),
        np.trace(second) * np.eye(3) - second,
        np.add(near, 0.2 * rng.normal(size=3)),
        unit(rng, 4),
        rng.normal(size=3),
        3.0 * rng.normal(size=3),
    )


LENGTH = (
    lambda t: 0.9 + 0.1 * np.sin(2.0 * t),
    lambda t: 0.2 * np.cos(2.0 * t),
    lambda t: -0.4 * np.sin(2.0 * t),
)


def mechanism(rng):
    """Three bodies and a bead, every primitive, one of them driven; nothing fits yet."""
    scene = ts.Scene()
    one, two, three = (body(scene, rng, near) for near in ((0.3, 0, 0), (1, 0, 0), (1.6, 0.4, 0)))
    bead = scene.add_point_mass(0.7, rng.normal(size=3), rng.normal(size=3), name="bead")
    scene.add(C.Spherical(one, scene.ground, point_a=(-0.3, 0.0, 0.1), name="pivot"))
    scene.add(C.Spherical(one, two, point_a=(0.3, 0, 0), point_b=(-0.2, 0.1, 0), name="knee"))
    scene.add(C.Distance(two, three, point_a=(0.1, 0.3, 0), point_b=(0, 0, 0.1), length=LENGTH, name="piston"))
    scene.add(C.Dot1(three, scene.ground, axis_a=(1, 0, 0), axis_b=(0, 0, 1), value=0.3, name="tilt"))
    scene.add(C.Dot2(two, bead, axis_a=(0, 1, 1), point_a=(0.1, 0, 0), value=0.2, name="offset"))
    scene.add(C.PlaneContact(bead, three, point_b=(0, 0.2, 0), normal_b=(1, 2, 3), name="table"))
    return scene


def residuals(scene, t=0.0):
    """Largest |Phi| and |Phi_q qd + Phi_t| at the bodies' values."""
    found = scene.evaluate(t=t)
    return np.abs(found.Phi).max(), np.abs(found.Phi_q @ scene.start[1] + found.Phi_t).max()


def speeds(scene):
    """Velocities and angular velocities, body by body."""
    parts = [(b.velocity, b.angular_velocity) if hasattr(b, "inertia") else (b.velocity,) for b in scene.bodies]
    return np.concatenate([x for part in parts for x in part])


def map_of_speeds(scene):
    """T with qd = T speeds: pd = (-e.w', e0 w' + e x w') / 2."""
    T, row, column = np.zeros((scene.start[0].size, speeds(scene).size)), 0, 0
    for b in scene.bodies:
        T[row : row + 3, column : column + 3] = np.eye(3)
        row, column = row + 3, column + 3
        if hasattr(b, "inertia"):
            e0, e = b.orientation[0], b.orientation[1:]
            T[row, column : column + 3] = -e / 2.0
            T[row + 1 : row + 4, column : column + 3] = (e0 * np.eye(3) + skew(e)) / 2.0
            row, column = row + 4, column + 3
    return T


def masses(scene):
    """The mass matrix of the speeds."""
    blocks = [x for b in scene.bodies for x in ([b.mass * np.eye(3)] + ([b.inertia] if hasattr(b, "inertia") else []))]
    M = np.zeros((speeds(scene).size,) * 2)
    for i, block in enumerate(blocks):
        M[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = block
    return M


def nearest_speeds(scene, wanted, t=0.0):
    """The consistent speeds nearest to those wanted in the kinetic-energy metric: least squares by its KKT system."""
    found = scene.evaluate(t=t)
    A, M = found.Phi_q @ map_of_speeds(scene), masses(scene)
    keep = np.abs(A).max(axis=1) > 1e-12  # the normalisations are met by any speeds
    A, b = A[keep], -found.Phi_t[keep]
    m = A.shape[0]
    kkt = np.block([[M, A.T], [A, np.zeros((m, m))]])
    return np.linalg.solve(kkt, np.concatenate((M @ wanted, b)))[: wanted.size]


def snapshot(scene):
    return [
        (b.position, b.velocity, *((b.orientation, b.angular_velocity) if hasattr(b, "inertia") else ()))
        for b in scene.bodies
    ]


def assert_same(before, after):
    for parts, now in zip(before, after, strict=True):
        for x, y in zip(parts, now, strict=True):
            np.testing.assert_array_equal(x, y)


SEEDS = range(6)
