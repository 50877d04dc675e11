"""Stiffness and damping blocks of bodies: exact derivatives of their loads by (r, pi') and (rd, omega').

    K_b = (F - H^T lam)_(r, pi') at constant lam,    C_b = F_(rd, omega')

Forces and constraints give derivatives of generalised forces Q in the coordinates of their two bodies. With dp =
G^T dpi' / 2 and the body torque tau' = G Q_p / 2, a change of p also turns what Q_p is a torque about, and, at
constant omega', changes pd:

    dtau' = G dQ_p / 2 - G(Q_p) G^T dpi' / 4
    dpd   = G^T (domega' + dpi' x omega' / 2) / 2 - (omega' . dpi') p / 4
"""

from ..elements.loops.coordinate_rows import call_kind
from ..jit.kernels import kernel, long_kernel, stack, stack2
from ..maths.dense_linalg import copy
from ..model.equations import applied_forces, call_curvature, call_jacobian
from ..sparse.saddle_graph import BLOCK
from .dense_products import clear_matrix


@kernel
def _half_g(p, i, G):
    """G(p) / 2, p being p[i : i + 4]."""
    e0, e1, e2, e3 = 0.5 * p[i], 0.5 * p[i + 1], 0.5 * p[i + 2], 0.5 * p[i + 3]
    G[0, 0], G[0, 1], G[0, 2], G[0, 3] = -e1, e0, e3, -e2
    G[1, 0], G[1, 1], G[1, 2], G[1, 3] = -e2, -e3, e0, e1
    G[2, 0], G[2, 1], G[2, 2], G[2, 3] = -e3, e2, -e1, e0


@kernel
def _frames(s, dimension, i, G, P):
    """G(p) / 2 of a body at s.q[i], and dpd by dpi', transposed; zero for what has no orientation."""
    if dimension != 7:
        clear_matrix(G)
        clear_matrix(P)
        return
    _half_g(s.q, i + 3, G)
    # omega' = 2 G pd
    omega = stack(3)
    for c in range(3):
        omega[c] = 0.0
        for d in range(4):
            omega[c] += 4.0 * G[c, d] * s.qd[i + 3 + d]
    # Row c is dpd for dpi' = e_c: G^T (e_c x omega') / 4 - omega'_c p / 4
    for c in range(3):
        x, y = (c + 1) % 3, (c + 2) % 3  # e_c x omega' = -omega'_y e_x + omega'_x e_y
        for d in range(4):
            P[c, d] = 0.5 * (omega[x] * G[y, d] - omega[y] * G[x, d]) - 0.5 * (0.5 * omega[c] * s.q[i + 3 + d])


@kernel
def _add_columns(X, i, j, G, scale, out):
    """Add to a block its columns of translations: scale times rows i and columns j on of X."""
    # K_rr += X_rr,  K_pi'r += G X_pr / 2
    for c in range(3):
        for r in range(3):
            total = 0.0
            for d in range(4):
                total += G[r, d] * X[i + 3 + d, j + c]
            out[6 * r + c] += scale * X[i + r, j + c]
            out[18 + 6 * r + c] += scale * total


@kernel
def _add_turns(X, i, j, G, H, scale, out):
    """The same of its columns of rotations, H being dp or dpd by them, transposed."""
    y = stack(4)
    for c in range(3):
        # X_pp times the change of p, or of pd, by a rotation about axis c
        for d in range(4):
            y[d] = 0.0
            for e in range(4):
                y[d] += X[i + 3 + d, j + 3 + e] * H[c, e]
        # K_r,pi' += X_rp dp,  K_pi',pi' += G X_pp dp / 2
        for r in range(3):
            total, turned = 0.0, 0.0
            for d in range(4):
                total += X[i + r, j + 3 + d] * H[c, d]
                turned += G[r, d] * y[d]
            out[6 * r + 3 + c] += scale * total
            out[21 + 6 * r + c] += scale * turned


@kernel
def _add_turned_torque(Q, q, i, scale, out):
    """Add -scale G(Q_p) G(p)^T / 4, Q_p and p being at i + 3."""
    G, H = stack2(3, 4), stack2(3, 4)
    # The torque G(p) Q_p / 2 changes with G at constant Q_p
    _half_g(Q, i + 3, G)
    _half_g(q, i + 3, H)
    for r in range(3):
        for c in range(3):
            total = 0.0
            for d in range(4):
                total += G[r, d] * H[c, d]
            out[21 + 6 * r + c] -= scale * total


@kernel
def _block(one, k, l):
    """The block of the loads on body k by the motion of body l, 0 for a and 1 for b; -1 for none."""
    if k == 0:
        return one.aa if l == 0 else one.ab
    return one.ba if l == 0 else one.bb


@long_kernel
def _spread(s, one, scale, damped):
    """Add scale s.X to K; with damping, scale s.Xd to C and its effect on rotated velocities to K."""
    G0, G1, P0, P1 = stack2(3, 4), stack2(3, 4), stack2(3, 4), stack2(3, 4)
    # dp and dpd of a rotation, for both bodies
    _frames(s, s.own[2], 0, G0, P0)
    _frames(s, s.own[3], 7, G1, P1)
    for k in range(2):
        for l in range(2):
            block = _block(one, k, l)
            if block >= 0:
                # Loads on body k by the motion of body l
                G, H, P = G0 if k == 0 else G1, G0 if l == 0 else G1, P0 if l == 0 else P1
                K, C = s.K[BLOCK * block :], s.C[BLOCK * block :]
                _add_columns(s.X, 7 * k, 7 * l, G, scale, K)
                _add_turns(s.X, 7 * k, 7 * l, G, H, scale, K)
                # At constant omega' a rotation changes pd: that part of the damping is a stiffness
                if damped:
                    _add_columns(s.Xd, 7 * k, 7 * l, G, scale, C)
                    _add_turns(s.Xd, 7 * k, 7 * l, G, H, scale, C)
                    _add_turns(s.Xd, 7 * k, 7 * l, G, P, scale, K)


@kernel
def _take_bodies(w, s, one):
    """Coordinates and velocities of an instance's bodies, and its table as if there were no others."""
    for k in range(2):
        at, dimension = (one.at_a, one.size_a) if k == 0 else (one.at_b, one.size_b)
        s.own[2 + k] = dimension
        for c in range(7):
            s.q[7 * k + c] = w.q[at + c] if c < dimension else 0.0
            s.qd[7 * k + c] = w.qd[at + c] if c < dimension else 0.0
    clear_matrix(s.X)


@kernel
def add_forces(system, w, s, t, renew, kept, Q):
    """K and C of the forces; with `renew` derivatives of the laws are evaluated and stored, else stored ones serve."""
    for i in range(Q.size):
        Q[i] = 0.0
    applied_forces(system, w.q, w.qd, t, Q)
    # Each instance has coordinates of its own, as if there were no other bodies
    for i in range(s.graph.forces.shape[0]):
        one = s.graph.forces[i]
        _take_bodies(w, s, one)
        clear_matrix(s.Xd)
        reals, own = system.reals[one.reals :], kept[one.kept :]
        call_jacobian(one.loop, 1, one.stride, s.own, reals, s.q, s.qd, t, 14, s.X, s.Xd, renew, own)
        _spread(s, one, 1.0, True)
    # tau' = G Q_p / 2 of all applied forces turns with the body
    for b in range(system.bodies.shape[0]):
        if system.bodies[b, 1] == 7:
            _add_turned_torque(Q, w.q, system.bodies[b, 0], 1.0, s.K[BLOCK * b :])


@kernel
def add_constraints(system, w, s, t, lam):
    """K -= (H^T lam)_(r, pi'): the geometric stiffness of the reactions."""
    most = s.lam.size
    for i in range(s.graph.constraints.shape[0]):
        one, size = s.graph.constraints[i], 0.0
        copy(lam[one.row : one.row + one.rows], s.lam)
        for r in range(one.rows):
            size += abs(s.lam[r])
        # No reaction, no geometric stiffness
        if size == 0.0:
            continue
        _take_bodies(w, s, one)
        clear_matrix(s.rows)
        reals, G1, G2 = system.reals[one.reals :], s.rows[most:], s.rows[2 * most :]
        # Phi_q of the instance, then X = (Phi_q^T lam)_q
        call_kind(one.rows_loop, 1, one.stride, s.own, reals, s.q, s.qd, t, s.rows)
        call_curvature(one.loop, 1, one.stride, s.own, reals, s.q, s.qd, s.zero, t, s.lam, s.X, G1, G2)
        # R = Phi_q^T lam, whose torque turns with the body
        for c in range(14):
            s.R[c] = 0.0
            for r in range(one.rows):
                s.R[c] += s.lam[r] * s.rows[r, c]
        _spread(s, one, -1.0, False)
        for k in range(2):
            block = _block(one, k, k)
            if block >= 0 and s.own[2 + k] == 7:
                _add_turned_torque(s.R, s.q, 7 * k, -1.0, s.K[BLOCK * block :])
