"""The digits in tests/references, recomputed by SciPy: Newton-Euler equations with rotation matrices, one set a scene.

Nothing of tsdyn is used here; the tolerances are those of SciPy's DOP853, far above the error of the digits.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.helpers.reference import NAMES, load, read
from tests.helpers.scenes import rotation

RTOL = 1e-12
ERROR = 1e-8  # what RTOL leaves after END, and after the instability of the sleeping top
END = 10.0  # s; the later outputs of the sleeping tops rest on the same equations


def skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def cross(a, b):
    return skew(a) @ b


def body_rates(A, w, J, torque):
    """Ad and wd of a rigid body, from the torque about its centroid in its frame."""
    return A @ skew(w), np.linalg.solve(J, cross(J @ w, w) + torque)


def top(definition):
    """Start and rates of a top whose tip s slides on z = 0; state x, y, xd, yd, A, w."""
    (body,) = definition["bodies"]
    mass, J, g = body["mass"], np.array(body["inertia"]), definition["gravity"][2]
    s = np.array(definition["constraints"][0][3]["point_a"])

    def rates(t, y):
        A, w = y[4:13].reshape(3, 3), y[13:]
        up = A[2]  # the vertical in the body frame
        Ad, free = body_rates(A, w, J, 0.0)
        turn = np.linalg.solve(J, cross(s, up))  # wd per unit of contact force
        # zdd = -up . (wd x s + w x (w x s)) = N / m + g
        zdd_free = -up @ (cross(free, s) + cross(w, cross(w, s)))
        N = (zdd_free - g) / (1 / mass + up @ cross(turn, s))
        return np.concatenate((y[2:4], [0.0, 0.0], Ad.ravel(), free + N * turn))

    def outputs(y):
        A = y[4:13].reshape(3, 3)
        return np.array([[*y[:2], -(A @ s)[2]]]), A[None]

    begin = np.concatenate((np.zeros(4), np.eye(3).ravel(), body["angular_velocity"]))
    return begin, rates, outputs


def pendulum(definition):
    """A body held at its centroid and another on a rod of length one; state r2, v2, A1, w1, A2, w2."""
    one, two = definition["bodies"]
    J1, J2 = np.array(one["inertia"]), np.array(two["inertia"])
    rod = definition["constraints"][1][3]
    s1, s2 = np.array(rod["point_a"]), np.array(rod["point_b"])
    g = np.array(definition["gravity"])

    def split(y):
        return y[:3], y[3:6], y[6:15].reshape(3, 3), y[15:18], y[18:27].reshape(3, 3), y[27:]

    def rates(t, y):
        r, v, A1, w1, A2, w2 = split(y)
        d = A1 @ s1 - r - A2 @ s2
        dd = A1 @ cross(w1, s1) - v - A2 @ cross(w2, s2)

        def accelerations(tension):
            A1d, w1d = body_rates(A1, w1, J1, cross(s1, A1.T @ (-tension * d)))
            A2d, w2d = body_rates(A2, w2, J2, cross(s2, A2.T @ (tension * d)))
            a = g + tension * d / two["mass"]
            p1 = A1 @ (cross(w1d, s1) + cross(w1, cross(w1, s1)))
            p2 = A2 @ (cross(w2d, s2) + cross(w2, cross(w2, s2)))
            return np.concatenate((v, a, A1d.ravel(), w1d, A2d.ravel(), w2d)), d @ (p1 - a - p2) + dd @ dd

        at0, at1 = accelerations(0.0)[1], accelerations(1.0)[1]  # affine in the tension
        return accelerations(at0 / (at0 - at1))[0]

    def outputs(y):
        r, _, A1, _, A2, _ = split(y)
        return np.array([np.zeros(3), r]), np.array([A1, A2])

    begin = [two["position"], two["velocity"], np.eye(3).ravel(), one["angular_velocity"]]
    return np.concatenate((*begin, np.eye(3).ravel(), two["angular_velocity"])), rates, outputs


def sort(name):
    return next(word for word in ("top", "pendulum", "chain") if word in name)


def chain(definition):
    """Bodies on spherical joints; state r, v, A, w of each, joint forces from the accelerations of the joints."""
    bodies, g = definition["bodies"], np.array(definition["gravity"])
    n = len(bodies)
    mass, J = np.array([b["mass"] for b in bodies]), np.array([b["inertia"] for b in bodies])
    W = np.zeros((6 * n, 6 * n))  # inverse masses and inertias
    for i in range(n):
        W[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = np.eye(3) / mass[i]
        W[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = np.linalg.inv(J[i])
    pushes = [(j - 1, np.array(at["point_a"]), np.array(at["force"])) for _, j, at in definition["forces"]]

    def rates(t, y):
        y = y.reshape(n, 18)
        v, A, w = y[:, 3:6], y[:, 6:15].reshape(n, 3, 3), y[:, 15:]
        load, C, bias = np.zeros(6 * n), np.zeros((3 * n, 6 * n)), np.zeros(3 * n)
        for i in range(n):
            load[6 * i : 6 * i + 3] = mass[i] * g
            load[6 * i + 3 : 6 * i + 6] = cross(J[i] @ w[i], w[i])
        for i, s, F in pushes:
            load[6 * i : 6 * i + 3] += F
            load[6 * i + 3 : 6 * i + 6] += cross(s, A[i].T @ F)
        for row, (_, a, b, at) in enumerate(definition["constraints"]):
            rows = slice(3 * row, 3 * row + 3)
            for i, s, sign in ((a - 1, np.array(at["point_a"]), 1.0), (b - 1, np.array(at["point_b"]), -1.0)):
                if i >= 0:  # acceleration of a point: vd - A s~ wd + A w~ w~ s
                    C[rows, 6 * i : 6 * i + 3] = sign * np.eye(3)
                    C[rows, 6 * i + 3 : 6 * i + 6] = -sign * A[i] @ skew(s)
                    bias[rows] += sign * A[i] @ cross(w[i], cross(w[i], s))
        free = W @ load
        a = (free - W @ C.T @ np.linalg.solve(C @ W @ C.T, C @ free + bias)).reshape(n, 6)
        Ad = np.array([A[i] @ skew(w[i]) for i in range(n)]).reshape(n, 9)
        return np.hstack((v, a[:, :3], Ad, a[:, 3:])).ravel()

    def outputs(y):
        y = y.reshape(n, 18)
        return y[:, :3], y[:, 6:15].reshape(n, 3, 3)

    def begin(b):
        return np.concatenate((b["position"], b["velocity"], rotation(b["orientation"]).ravel(), b["angular_velocity"]))

    return np.concatenate([begin(b) for b in bodies]), rates, outputs


@pytest.mark.slow_but("sliding_top", "chain_4")
@pytest.mark.parametrize("name", NAMES)
def test_digits_from_other_equations(name):
    asleep, kind = "sleeping" in name, {"top": top, "pendulum": pendulum, "chain": chain}[sort(name)]
    reference = load(name)[1].until(0.3 if name == "chain_16" else END)
    begin, rates, outputs = kind(read(name)["definition"])
    atol = 1e-20 if asleep else RTOL  # the tilt of the sleeping top begins at 1e-12
    run = solve_ivp(rates, (0.0, reference.t[-1]), begin, "DOP853", reference.t, rtol=RTOL, atol=atol)
    r, A = map(np.array, zip(*map(outputs, run.y.T), strict=True))
    assert np.abs(r - reference.r).max() < ERROR
    assert np.abs(A - reference.A).max() < ERROR
    if asleep:
        tilt, expected = A[:, :, :2, 2], reference.A[:, :, :2, 2]
        assert np.abs(tilt - expected).max() < ERROR * np.abs(expected).max()
