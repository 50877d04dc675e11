"""A definition in absolute coordinates, for solvers of differential-algebraic and of ordinary equations: kernels.

The state of a body is r, p, v, omega', 13 numbers. A row of a constraint acts along a direction e of the ground frame
on a point of each body: d = x_a - x_b, e = a unit axis (Spherical), d (Distance) or the normal (PlaneContact, on the
ground). Its Jacobian is with respect to (v_a, omega_a', v_b, omega_b'), 12 numbers; f = J^T lam on the right-hand side.

    m vd = F + f_v,   J' omegad = (J' omega) x omega + f_omega,   pd = G^T omega / 2              (1)
    J W J^T lam = -(gamma + J W Q)                                  index 1                      (2)
    rd = v + (J^T mu)_v / m,   pd = G^T (omega + J'^-1 (J^T mu)_omega) / 2 + nu p,                index 2, GGL
    0 = Phi,  0 = J v,  0 = (p.p - 1) / 2,  and (1) for v and omega                              (3)

The unknowns of (3) are ordered along the bodies, each followed by the multipliers of the constraints that end there.
"""

from typing import NamedTuple

import numba
import numpy as np

OPTIONS = {"error_model": "numpy", "cache": True}
STATE, BODY = 13, 14  # numbers of a body: r, p, v, omega; and nu
KINDS = {"Spherical": 0, "Distance": 1, "PlaneContact": 2}


class Packed(NamedTuple):
    """A definition in arrays; b bodies, c constraints, m rows, n unknowns of (3)."""

    mass: np.ndarray  # (b,)
    J: np.ndarray  # (b, 3, 3)
    J_inv: np.ndarray  # (b, 3, 3)
    load: np.ndarray  # (b, 3), constant forces at the centroid
    kind: np.ndarray  # (c,)
    on: np.ndarray  # (c, 2), bodies, -1 the ground
    point: np.ndarray  # (c, 2, 3)
    extra: np.ndarray  # (c, 3): length, or normal
    row: np.ndarray  # (c + 1,), first row of each
    at: np.ndarray  # (b,), where a body's unknowns begin in (3)
    at_row: np.ndarray  # (m,), lam of a row
    at_mu: np.ndarray  # (m,), mu


def pack(definition):
    """Return (integers, reals), which `unpack` makes a Packed of, and the state at the start (b, 13)."""
    bodies, constraints = definition["bodies"], definition["constraints"]
    J = np.array([body["inertia"] for body in bodies], float)
    mass = np.array([body["mass"] for body in bodies], float)
    load = mass[:, None] * np.array(definition["gravity"], float)
    for _, body, given in definition.get("forces", ()):
        load[body - 1] += given["force"]
    point, extra = np.zeros((len(constraints), 2, 3)), np.zeros((len(constraints), 3))
    for i, (kind, _, _, given) in enumerate(constraints):
        point[i] = given.get("point_a", (0, 0, 0)), given.get("point_b", (0, 0, 0))
        extra[i] = given["length"] if kind == "Distance" else given.get("normal_b", (0, 0, 0))
    size = [3 if row[0] == "Spherical" else 1 for row in constraints]
    row = np.cumsum([0, *size])
    on = np.array([[a - 1, b - 1] for _, a, b, _ in constraints]).reshape(-1, 2)
    at, at_row, at_mu, end = [], np.zeros(row[-1], np.int64), np.zeros(row[-1], np.int64), 0
    for body in range(len(bodies)):
        at.append(end)
        end += BODY
        for c in np.flatnonzero(on.max(axis=1) == body):
            at_row[row[c] : row[c + 1]] = end + np.arange(size[c])
            at_mu[row[c] : row[c + 1]] = end + size[c] + np.arange(size[c])
            end += 2 * size[c]
    x = [[*b["position"], *b["orientation"], *b["velocity"], *b["angular_velocity"]] for b in bodies]
    kind = [KINDS[c[0]] for c in constraints]
    integers = np.concatenate([[len(bodies), len(constraints), row[-1]], kind, on.ravel(), row, at, at_row, at_mu])
    reals = np.concatenate([part.ravel() for part in (mass, J, np.linalg.inv(J), load, point, extra)])
    return (integers.astype(np.int64), reals), np.array(x, float)


@numba.njit(**OPTIONS)
def unpack(integers, reals):
    """Return the Packed: Python hands two arrays to a kernel sooner than twelve."""
    b, c, m = integers[0], integers[1], integers[2]
    i, j, J, load = integers[3:], reals[22 * b :], reals[b : 19 * b], reals[19 * b : 22 * b]
    return Packed(
        reals[:b], J[: 9 * b].reshape(b, 3, 3), J[9 * b :].reshape(b, 3, 3), load.reshape(b, 3),
        i[:c], i[c : 3 * c].reshape(c, 2), j[: 6 * c].reshape(c, 2, 3), j[6 * c :].reshape(c, 3), i[3 * c : 4 * c + 1],
        i[4 * c + 1 : 4 * c + 1 + b], i[4 * c + 1 + b : 4 * c + 1 + b + m], i[4 * c + 1 + b + m :],
    )  # fmt: skip


@numba.njit(**OPTIONS)
def rotate(e0, a, b, c, s, out):
    """out = A(p) s for unit p = (e0, a, b, c)."""
    t0, t1, t2 = 2 * (b * s[2] - c * s[1]), 2 * (c * s[0] - a * s[2]), 2 * (a * s[1] - b * s[0])
    out[0] = s[0] + e0 * t0 + b * t2 - c * t1
    out[1] = s[1] + e0 * t1 + c * t0 - a * t2
    out[2] = s[2] + e0 * t2 + a * t1 - b * t0


@numba.njit(**OPTIONS)
def turned(x, s, out):
    """out = A(p) s; x is a body's state."""
    rotate(x[3], x[4], x[5], x[6], s, out)


@numba.njit(**OPTIONS)
def back(x, s, out):
    """out = A(p)^T s."""
    rotate(x[3], -x[4], -x[5], -x[6], s, out)


@numba.njit(**OPTIONS)
def cross(a, b, out):
    """out = a x b."""
    out[0], out[1], out[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@numba.njit(**OPTIONS)
def constrain(P, x, phi, phid, gamma, jac):
    """Residuals, their rates, gamma and Jacobians (m, 12) of all rows at x (b, 13)."""
    w = np.zeros((8, 3))
    for c in range(P.kind.size):
        d, dd, bias = w[0], w[1], w[2]
        for k in range(3):
            d[k], dd[k], bias[k] = 0.0, 0.0, 0.0
        for side in range(2):
            i, sign, s = P.on[c, side], 1.0 - 2.0 * side, P.point[c, side]
            if i < 0:
                for k in range(3):
                    d[k] += sign * s[k]
                continue
            y = x[i]
            cross(y[10:13], s, w[4])
            cross(y[10:13], w[4], w[5])
            turned(y, s, w[3])
            turned(y, w[4], w[6])
            turned(y, w[5], w[7])
            for k in range(3):
                d[k] += sign * (y[k] + w[3, k])
                dd[k] += sign * (y[7 + k] + w[6, k])
                bias[k] += sign * w[7, k]
        for j in range(P.row[c], P.row[c + 1]):
            e = w[3]
            for k in range(3):
                if P.kind[c] == 0:
                    e[k] = 1.0 if k == j - P.row[c] else 0.0
                elif P.kind[c] == 1:
                    e[k] = d[k]
                else:
                    e[k] = P.extra[c, k]
            phi[j] = e[0] * d[0] + e[1] * d[1] + e[2] * d[2]
            phid[j] = e[0] * dd[0] + e[1] * dd[1] + e[2] * dd[2]
            gamma[j] = e[0] * bias[0] + e[1] * bias[1] + e[2] * bias[2]
            if P.kind[c] == 1:
                phi[j] = 0.5 * (phi[j] - P.extra[c, 0] ** 2)
                gamma[j] += dd[0] * dd[0] + dd[1] * dd[1] + dd[2] * dd[2]
            for side in range(2):
                i, sign = P.on[c, side], 1.0 - 2.0 * side
                if i < 0:
                    for k in range(6):
                        jac[j, 6 * side + k] = 0.0
                    continue
                back(x[i], e, w[4])
                cross(P.point[c, side], w[4], w[5])
                for k in range(3):
                    jac[j, 6 * side + k], jac[j, 6 * side + 3 + k] = sign * e[k], sign * w[5, k]


@numba.njit(**OPTIONS)
def push(P, jac, lam, f):
    """f (b, 6) += J^T lam."""
    for c in range(P.kind.size):
        for side in range(2):
            i = P.on[c, side]
            if i >= 0:
                for j in range(P.row[c], P.row[c + 1]):
                    for k in range(6):
                        f[i, k] += jac[j, 6 * side + k] * lam[j]


@numba.njit(**OPTIONS)
def applied(P, x, f):
    """f (b, 6) = loads and gyroscopic torques."""
    for i in range(P.mass.size):
        w = x[i, 10:13]
        h = P.J[i] @ w
        for k in range(3):
            f[i, k] = P.load[i, k]
        cross(h, w, f[i, 3:])


@numba.njit(**OPTIONS)
def weigh(P, f):
    """f becomes W f."""
    for i in range(P.mass.size):
        f[i, :3] /= P.mass[i]
        f[i, 3:] = P.J_inv[i] @ f[i, 3:].copy()


@numba.njit(**OPTIONS)
def kinematics(x, turning, out):
    """out = pd of a body of state x that turns at `turning`."""
    e0, e1, e2, e3 = x[3], x[4], x[5], x[6]
    a, b, c = turning[0], turning[1], turning[2]
    out[0] = 0.5 * (-e1 * a - e2 * b - e3 * c)
    out[1] = 0.5 * (e0 * a - e3 * b + e2 * c)
    out[2] = 0.5 * (e3 * a + e0 * b - e1 * c)
    out[3] = 0.5 * (-e2 * a + e1 * b + e0 * c)


@numba.njit(**OPTIONS)
def accelerate(integers, reals, x, xd, lam):
    """The rate xd (b, 13) and the multipliers by (2), dense."""
    P = unpack(integers, reals)
    b, m = P.mass.size, P.row[-1]
    phi, phid, gamma, jac, f = np.empty(m), np.empty(m), np.empty(m), np.empty((m, 12)), np.empty((b, 6))
    constrain(P, x, phi, phid, gamma, jac)
    applied(P, x, f)
    free = f.copy()
    weigh(P, free)
    S, WJ = np.zeros((m, m)), jac.copy()
    for c in range(P.kind.size):
        for j in range(P.row[c], P.row[c + 1]):
            lam[j] = -gamma[j]
            for side in range(2):
                i = P.on[c, side]
                if i >= 0:
                    WJ[j, 6 * side : 6 * side + 3] /= P.mass[i]
                    WJ[j, 6 * side + 3 : 6 * side + 6] = P.J_inv[i] @ jac[j, 6 * side + 3 : 6 * side + 6]
                    for k in range(6):
                        lam[j] -= jac[j, 6 * side + k] * free[i, k]
    for c in range(P.kind.size):
        for g in range(c + 1):
            for side in range(2):
                for other in range(2):
                    if P.on[c, side] >= 0 and P.on[c, side] == P.on[g, other]:
                        for j in range(P.row[c], P.row[c + 1]):
                            for l in range(P.row[g], P.row[g + 1]):
                                for k in range(6):
                                    S[j, l] += WJ[j, 6 * side + k] * jac[l, 6 * other + k]
    for j in range(m):  # Cholesky
        for l in range(j + 1):
            s = S[j, l]
            for k in range(l):
                s -= S[j, k] * S[l, k]
            S[j, l] = np.sqrt(s) if j == l else s / S[l, l]
    for j in range(m):
        for k in range(j):
            lam[j] -= S[j, k] * lam[k]
        lam[j] /= S[j, j]
    for j in range(m - 1, -1, -1):
        for k in range(j + 1, m):
            lam[j] -= S[k, j] * lam[k]
        lam[j] /= S[j, j]
    push(P, jac, lam, f)
    weigh(P, f)
    for i in range(b):
        xd[i, :3] = x[i, 7:10]
        kinematics(x[i], x[i, 10:13], xd[i, 3:7])
        xd[i, 7:] = f[i]


@numba.njit(**OPTIONS)
def residual(integers, reals, y, yd, out):
    """The residual (n,) of (3)."""
    P = unpack(integers, reals)
    b, m = P.mass.size, P.row[-1]
    phi, phid, gamma, jac = np.empty(m), np.empty(m), np.empty(m), np.empty((m, 12))
    x, f, g, lam, mu, pd = (
        np.empty((b, STATE)),
        np.empty((b, 6)),
        np.zeros((b, 6)),
        np.empty(m),
        np.empty(m),
        np.empty(4),
    )
    for i in range(b):
        x[i] = y[P.at[i] : P.at[i] + STATE]
    for j in range(m):
        lam[j], mu[j] = y[P.at_row[j]], y[P.at_mu[j]]
    constrain(P, x, phi, phid, gamma, jac)
    for j in range(m):
        out[P.at_row[j]], out[P.at_mu[j]] = phi[j], phid[j]
    applied(P, x, f)
    push(P, jac, lam, f)
    push(P, jac, mu, g)
    weigh(P, f)
    weigh(P, g)
    for i in range(b):
        k, s = P.at[i], 0.0
        kinematics(x[i], x[i, 10:13] + g[i, 3:], pd)
        for j in range(3):
            out[k + j] = yd[k + j] - x[i, 7 + j] - g[i, j]
        for j in range(4):
            out[k + 3 + j] = yd[k + 3 + j] - pd[j] - y[k + STATE] * x[i, 3 + j]
            s += x[i, 3 + j] ** 2
        for j in range(6):
            out[k + 7 + j] = yd[k + 7 + j] - f[i, j]
        out[k + STATE] = 0.5 * (s - 1.0)


@numba.njit(**OPTIONS)
def differences(packed, y, yd, shift, group, first, rows, values):
    """Entries of dF/dy + shift dF/dyd by columns, rows[first[j]:first[j + 1]] of column j, a group at once."""
    integers, reals = packed
    n = y.size
    y, yd, f, g = y.copy(), yd.copy(), np.empty(n), np.empty(n)
    residual(integers, reals, y, yd, f)
    steps = np.zeros(n)
    for colour in range(group.max() + 1):
        for j in range(n):
            if group[j] == colour:
                old = y[j]
                y[j] += 1.5e-8 * max(abs(old), 1.0)
                steps[j] = y[j] - old
                yd[j] += shift * steps[j]
        residual(integers, reals, y, yd, g)
        for j in range(n):
            if group[j] == colour:
                for k in range(first[j], first[j + 1]):
                    values[k] = (g[rows[k]] - f[rows[k]]) / steps[j]
                y[j] -= steps[j]
                yd[j] -= shift * steps[j]
