"""The linearised equations of motion, reduced to minimal coordinates x.

With dq = T dx, dqd = T dxd + T1 dx and dqdd = T dxdd + 2 T1 dxd + T2 dx, where constraints and coordinates give

    [ H ]        [ 0 ]    [ H ]          [ G1 ]        [ H ]          [ G2 ]         [ G1 ]
    [ Z ] T  =   [ I ]    [ Z ] T1  =  - [ Zd ] T      [ Z ] T2  =  - [ Zdd ] T - 2  [ Zd ] T1

the equation M qdd + Phi_q^T lam = Q_A + Q_v gives M_r dxdd + C_r dxd + K_r dx = 0:

    M_r = T^T M T                                             C* = (Q_A + Q_v)_qd
    C_r = T^T (2 M T1 - C* T)                                 K* = (M qdd - Q_A - Q_v)_q + (Phi_q^T lam)_q
    K_r = T^T (M T2 - C* T1 + K* T)

T1 and T2 vanish at rest.
"""

from typing import NamedTuple

import numpy as np

from ..configuration.kinetic_metric import Metric
from ..elements.bodies import transform_g
from ..errors import SingularConfiguration
from .variations import stacked


class Reduced(NamedTuple):
    """Of k coordinates; hats are of coordinates y = R dx with unit mass."""

    M: np.ndarray  # (k, k)
    C: np.ndarray
    K: np.ndarray
    T: np.ndarray  # (n, k) dq = T dx
    T1: np.ndarray  # (n, k) of dqd
    C_hat: np.ndarray
    K_hat: np.ndarray
    R: np.ndarray  # (k, k) upper triangle, M = R^T R
    scale: float  # size of the terms that K_hat is a sum of


def reduce(motion, variations):
    """The `Reduced` equations at a `Motion`, in coordinates given as `Variation`s."""
    from scipy.linalg import solve_triangular

    n, k = motion.q.size, len(variations)
    found = motion.derivatives
    Z, Zd, Zdd = stacked(variations, n)
    solve = _solver(motion.H, Z)
    G1, G2 = (each[motion.kept] for each in (found.G1, found.G2))
    T = solve(np.zeros((motion.kept.size, k)), np.eye(k))
    still = not (G1.data.any() or Zd.data.any())
    T1 = np.zeros((n, k)) if still else solve(-(G1 @ T), -(Zd @ T))
    if still and motion.is_balanced:
        T2 = np.zeros((n, k))
    else:
        T2 = solve(-(G2 @ T) - 2.0 * (G1 @ T1), -(Zdd @ T) - 2.0 * (Zd @ T1))
    K_inertia, C_inertia = inertia_derivatives(motion)
    C_all = found.Q_qd + C_inertia

    def project(T, T1, T2):
        moved = 0.0 if still else motion.M @ T1
        stiffness = [motion.M @ T2 - C_all @ T1, K_inertia @ T, -(found.Q_q @ T), found.K @ T]
        return _across(T, 2.0 * moved - C_all @ T), [_across(T, part) for part in stiffness]

    C, parts = project(T, T1, T2)
    R = _root(motion, T)
    C_hat, parts_hat = project(*(solve_triangular(R, A.T, trans="T").T if A.any() else A for A in (T, T1, T2)))
    scale = sum(float(np.linalg.norm(part)) for part in parts_hat)
    return Reduced(R.T @ R, C, sum(parts), T, T1, C_hat, sum(parts_hat), R, scale)


def _across(T, part):
    """T^T part, of rows of the part that aren't zero."""
    rows = np.flatnonzero(part.any(axis=1))
    return T[rows].T @ part[rows] if rows.size < len(T) else T.T @ part


def _root(motion, T):
    """R (k, k) with M = R^T R, by orthogonal factorisation: less is lost than by Cholesky's of M."""
    metric, k = Metric(motion.packed), T.shape[1]
    rows = np.zeros((metric.size, k))
    rows[metric.move] = metric.root[:, :, None] * T[metric.r]
    rotations = 2.0 * transform_g(motion.q[metric.p]) @ T[metric.p]
    rows[metric.turn] = metric.fall @ rotations
    R = np.linalg.qr(rows, mode="r") if k else np.zeros((0, 0))
    if k and np.abs(np.diagonal(R)).min() == 0.0:
        raise SingularConfiguration("linearise: a coordinate carries no inertia.")
    return R


def _solver(H, Z):
    """Return solve(a, b) = x with H x = a, Z x = b."""
    from scipy.sparse import diags_array, vstack
    from scipy.sparse.linalg import splu

    A = vstack([H, Z], format="csc")
    weights = 1.0 / np.maximum(abs(A).max(axis=1).toarray().ravel(), np.finfo(float).tiny)
    try:
        factors = splu((diags_array(weights) @ A).tocsc())
    except RuntimeError as error:
        raise SingularConfiguration("linearise: the coordinates chosen are not independent here.") from error
    return lambda a, b: factors.solve(weights[:, None] * np.concatenate((a, b)))


def inertia_derivatives(motion):
    """(M qdd - Q_v)_q and Q_v_qd, sparse (n, n); blocks of p of the rigid bodies.

    M_p = 4 G^T J' G, Q_v = 8 Gd^T J' Gd p; H_h p = G(p)^T h.
    """
    from scipy.sparse import csr_array

    n, at = motion.q.size, motion.system.bodies[motion.rigid, :1] + np.arange(3, 7)
    J = motion.system.inertia[motion.rigid].reshape(-1, 3, 3)
    p, (G, Gd, Gdd) = motion.parameters(0), (transform_g(motion.parameters(level)) for level in range(3))
    h = np.einsum("bij,bjk,bk->bi", J, G, motion.parameters(2))
    g = np.einsum("bij,bjk,bk->bi", J, Gd, p)
    back = Gd.swapaxes(1, 2) @ J
    K = 4.0 * _crossed(h) - 4.0 * G.swapaxes(1, 2) @ J @ Gdd - 8.0 * back @ Gd
    C = 8.0 * _crossed(g) - 8.0 * back @ G
    i, j = np.broadcast_arrays(at[:, :, None], at[:, None, :])
    return [csr_array((blocks.ravel(), (i.ravel(), j.ravel())), (n, n)) for blocks in (K, C)]


def _crossed(h):
    """H_h (b, 4, 4) of vectors h (b, 3)."""
    x, y, z = h.T
    o = np.zeros_like(x)
    rows = [[o, -x, -y, -z], [x, o, z, -y], [y, -z, o, x], [z, y, -x, o]]
    return np.moveaxis(np.array(rows), (0, 1), (1, 2))
