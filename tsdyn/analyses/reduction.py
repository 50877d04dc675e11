"""The linearised equations of motion, reduced to minimal coordinates x, and their eigenvalues."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..configuration.continuation import kinetic_rows
from ..elements.bodies import transform_g
from ..elements.tolerances import FORCE_QUOTIENT
from ..errors import SingularConfiguration
from ..jit.interrupts import interruptible
from ..maths.dense_linalg import interruptible_solver, sparse_lu
from ..maths.tolerances import HALF_DIGITS, NEGLIGIBLE, PIVOT_ROUNDING, TINY
from ..model.equations import added_inertia
from .coordinates import stacked
from .tolerances import IN_TURN, STIFFNESS_ROUNDING

# The linearised equations of motion, reduced to minimal coordinates x.
#
# With dq = T dx, dqd = T dxd + T1 dx and dqdd = T dxdd + 2 T1 dxd + T2 dx, where constraints and coordinates give
#
#     [ H ]        [ 0 ]    [ H ]          [ G1 ]        [ H ]          [ G2 ]         [ G1 ]
#     [ Z ] T  =   [ I ]    [ Z ] T1  =  - [ Zd ] T      [ Z ] T2  =  - [ Zdd ] T - 2  [ Zd ] T1
#
# the equation M qdd + Phi_q^T lam = Q_A + Q_v gives M_r dxdd + C_r dxd + K_r dx = 0:
#
#     M_r = T^T M T                                             C* = (Q_A + Q_v)_qd
#     C_r = T^T (2 M T1 - C* T)                                 K* = (M qdd - Q_A - Q_v)_q + (Phi_q^T lam)_q
#     K_r = T^T (M T2 - C* T1 + K* T)
#
# T1 and T2 vanish at rest.


class Reduced:
    """Of k coordinates given as `Variation`s, at a `Motion`; hats are of coordinates y = R dx with unit mass.

    Attributes
    ----------
    T, T1 : ndarray (n, k)
        dq = T dx, dqd = T dxd + T1 dx.

    Without the accelerations left over if `balanced`.
    """

    def __init__(self, motion, variations, balanced=False):
        n, k = motion.q.size, len(variations)
        self._motion, self._found, self._inertial = motion, motion.derivatives, inertia_derivatives(motion)
        Z, Zd, Zdd = stacked(variations, n)
        solve, self._across = _solvers(motion.H, Z)
        G1, G2 = (each[motion.kept] for each in (self._found.G1, self._found.G2))
        self.T = T = solve(np.zeros((motion.kept.size, k)), np.eye(k))
        self.T1 = self._T2 = None
        self._still = not (G1.data.any() or Zd.data.any())
        if not self._still:
            self.T1 = solve(-(G1 @ T), -(Zd @ T))
        if not (self._still and (balanced or motion.is_balanced)):
            before = (0.0, 0.0) if self._still else (G1 @ self.T1, Zd @ self.T1)
            self._T2 = solve(-(G2 @ T) - 2.0 * before[0], -(Zdd @ T) - 2.0 * before[1])
        self._moving = self.T1, self._T2
        self.T1 = np.zeros((n, k)) if self.T1 is None else self.T1

    @cached_property
    def M(self):
        """(k, k)."""
        M = self._across(self._motion.M @ self.T)
        return 0.5 * (M + M.T)

    @cached_property
    def _C_and_K(self):
        k = self.T.shape[1]
        return [self._across(sum(parts)) if parts else np.zeros((k, k)) for parts in self._parts(self.T, *self._moving)]

    @property
    def C(self):
        """(k, k)."""
        return self._C_and_K[0]

    @property
    def K(self):
        """(k, k)."""
        return self._C_and_K[1]

    def _parts(self, T, T1, T2):
        """What C and K are sums of, (n, k) each, before the product with T^T; None for T1 and T2 that are zero."""
        M, found, (K_inertia, C_inertia) = self._motion.M, self._found, self._inertial
        C_all = found.Q_qd + C_inertia
        damping = [] if T1 is None else [2.0 * (M @ T1)]
        damping += [-(C_all @ T)] * bool(C_all.data.any())
        moving = [] if T2 is None else [M @ T2]
        moving += [] if T1 is None else [-(C_all @ T1)]
        stiffness = [sum(moving)] if moving else []
        parts = (1.0, K_inertia), (-1.0, found.Q_q), (1.0, found.K)
        return damping, stiffness + [sign * (part @ T) for sign, part in parts if part.data.any()]

    @cached_property
    def R(self):
        """R (k, k), an upper triangle, M = R^T R, by orthogonal factorisation: less is lost than by Cholesky's of M."""
        k = self.T.shape[1]
        rows = kinetic_rows(self._motion.system, self._motion.q, self.T)
        R = interruptible(lambda: np.linalg.qr(rows, mode="r")) if k else np.zeros((0, 0))
        if k and np.abs(np.diagonal(R)).min() == 0.0:
            raise SingularConfiguration(
                "linearise: a coordinate moves no inertia. Give the bodies that it moves some, or hold it by a joint."
            )
        return R

    @cached_property
    def _hats(self):
        from scipy.linalg import solve_triangular

        R, T = self.R, self.T

        def divided(A):
            return solve_triangular(R, A.T, trans="T").T

        moving = (None if each is None else divided(each) for each in self._moving)
        damping, stiffness = self._parts(T := divided(T), *moving)
        damping, stiffness = ([_across(T, part) for part in parts] for parts in (damping, stiffness))
        k = np.zeros(R.shape)
        return sum(damping, k), sum(stiffness, k), sum(float(np.linalg.norm(part)) for part in stiffness)

    @property
    def C_hat(self):
        """(k, k)."""
        return self._hats[0]

    @property
    def K_hat(self):
        """(k, k)."""
        return self._hats[1]

    @property
    def scale(self):
        """The size of the terms that K_hat is a sum of."""
        return self._hats[2]

    def way(self, y):
        """The displacement dq (n,) of coordinates y of unit mass."""
        from scipy.linalg import solve_triangular

        return self.T @ solve_triangular(self.R, y)


# With rows on velocities the rates of x are not free: A dqd + G1_A dq = 0 leaves w, some of them.
#
#     a dxd + b dx = 0        a = A T,  b = A T1 + G1_A T
#     dxd = W w + V dx        W^T a^T = 0, so reactions of these rows do no work on w
#     M wd + C w + K dx = 0   M = W^T M_r W,  C = W^T (C_r + M_r V) W,  K = W^T (K_r + (C_r + M_r V) V)
#
# M_r, C_r and K_r are those without these rows, whose reactions are loads. W and V are constant in a steady motion.


class Rolling:
    """Equations `Reduced` by the rows on positions, with those on velocities: k rates w of j coordinates x.

    Parameters
    ----------
    motion : NominalMotion
        With all rows.
    whole : Reduced
        Of the motion `placed`.
    every : list of Variation
        The coordinates, (j,).

    Attributes
    ----------
    free : ndarray (k,)
        Which of the rates w are.
    T, T1 : ndarray (n, j)
        Those of `Reduced`.
    W, V : ndarray (j, k), (j, j)
    M, C, K : ndarray (k, k), (k, k), (k, j)
    """

    def __init__(self, motion, whole, every):
        lengths = np.where([one.length for one in every], motion.packed.size or 1.0, 1.0)
        self.whole, self.T, self.T1 = whole, whole.T, whole.T1
        A, G1 = motion.Phi_q[motion.rates], motion.derivatives.G1[motion.rates]
        a, b = A @ whole.T, A @ whole.T1 + G1 @ whole.T
        bound = _last_independent(a * lengths)
        self.free = np.setdiff1d(np.arange(len(lengths)), bound)
        self.W, self.V = np.zeros((len(lengths), self.free.size)), np.zeros((len(lengths), len(lengths)))
        self.W[self.free] = np.eye(self.free.size)
        found = np.linalg.solve(a[:, bound], np.concatenate((a[:, self.free], b), axis=1))
        self.W[bound], self.V[bound] = -found[:, : self.free.size], -found[:, self.free.size :]
        damping = whole.C + whole.M @ self.V
        self.M, self.C = self.W.T @ whole.M @ self.W, self.W.T @ damping @ self.W
        self.K = self.W.T @ (whole.K + damping @ self.V)

    @cached_property
    def R(self):
        """(k, k), an upper triangle, M = R^T R."""
        return np.linalg.qr(self.whole.R @ self.W, mode="r")

    @cached_property
    def _hats(self):
        """V, W, C and K of coordinates y = R_r x and rates R w with unit mass."""
        from scipy.linalg import solve_triangular

        def right(X, R):
            return solve_triangular(R, X.T, trans="T").T

        R, Q = self.whole.R, right(self.whole.R @ self.W, self.R)
        C, K = (solve_triangular(self.R, X, trans="T") for X in (self.C, self.K))
        return R @ right(self.V, R), Q, right(C, self.R), right(K, R)

    @property
    def C_hat(self):
        """(k, k)."""
        return self._hats[2]

    @property
    def K_hat(self):
        """(k, k), of displacements that w lead to."""
        return self._hats[3] @ self._hats[1]

    @property
    def scale(self):
        """The size of the terms that K_hat is a sum of."""
        return self.whole.scale

    def way(self, y):
        """The displacement dq (n,) that rates y of unit mass lead to."""
        from scipy.linalg import solve_triangular

        return self.T @ self.W @ solve_triangular(self.R, y)

    def pairs(self):
        """Eigenvalues (j + k,) and vectors of coordinates y (j, j + k)."""
        V, W, C, K = self._hats
        kept = _not_ignorable(V, K, self.scale)
        A = np.block([[kept.T @ V @ kept, kept.T @ W], [-K @ kept, -C]])
        values, vectors = interruptible(lambda: np.linalg.eig(A))
        values = np.where(np.abs(values) <= NEGLIGIBLE * np.abs(values).max(initial=0.0), 0.0, values)
        places, speeds = kept @ vectors[: kept.shape[1]], W @ vectors[kept.shape[1] :]
        shapes = np.empty((len(V), len(values)), complex)
        for i, value in enumerate(values):
            # value y = V y + W w; of a vanishing value the displacement, or where it leads to
            if value != 0.0:
                shapes[:, i] = np.linalg.solve(value * np.eye(len(V)) - V, speeds[:, i])
            else:
                still = np.linalg.norm(places[:, i]) > np.linalg.norm(speeds[:, i]) * HALF_DIGITS
                shapes[:, i] = places[:, i] if still else speeds[:, i]
        shapes /= np.linalg.norm(shapes, axis=0)
        ignored = np.linalg.svd(kept.T)[2][kept.shape[1] :].T
        return np.concatenate((np.zeros(ignored.shape[1]), values)), np.concatenate((ignored, shapes), axis=1)


def _last_independent(a):
    """As many independent columns of a (r, j) as it has rows, the last ones first: joints come first among the x."""
    left, taken = a.copy(), []
    for _ in range(len(a)):
        sizes = np.linalg.norm(left, axis=0)
        sizes[taken] = 0.0
        column = int(np.flatnonzero(sizes >= IN_TURN * sizes.max())[-1])
        taken.append(column)
        unit = left[:, column] / sizes[column]
        left = left - np.outer(unit, unit @ left)
    return np.array(sorted(taken), int)


def _not_ignorable(V, K, scale):
    """An orthonormal basis (j, .) of displacements without those that act on nothing, not even on each other.

    Each of those has an eigenvalue zero, which rounding would otherwise make a pair or a triple.
    """
    kept, nothing = np.eye(len(V)), (PIVOT_ROUNDING * max(np.abs(V).max(initial=0.0), np.sqrt(scale)))
    while kept.shape[1]:
        effects = np.concatenate((kept.T @ V @ kept, K @ kept / max(np.sqrt(scale), TINY)))
        _, s, rows = np.linalg.svd(effects)
        count = int((s > nothing).sum())
        if count == kept.shape[1]:
            break
        kept = kept @ rows[:count].T
    return kept


def _across(T, part):
    """T^T part, of rows of the part that aren't zero."""
    rows = np.flatnonzero(part.any(axis=1))
    return interruptible(lambda: T[rows].T @ part[rows] if rows.size < len(T) else T.T @ part)


def _solvers(H, Z):
    """Return solve(a, b) = x with H x = a, Z x = b; and across(X) = T^T X, H T = 0, Z T = I, as cheap."""
    from scipy.sparse import diags_array, vstack

    A, m = vstack([H, Z], format="csc"), H.shape[0]
    weights = 1.0 / np.maximum(abs(A).max(axis=1).toarray().ravel(), np.finfo(float).tiny)
    try:
        factors = sparse_lu((diags_array(weights) @ A).tocsc())
    except RuntimeError as error:
        raise SingularConfiguration(
            "linearise: the coordinates chosen are not independent at this state. Linearise about another one."
        ) from error
    weights = weights[:, None]
    solve = interruptible_solver(factors)
    return (lambda a, b: solve(weights * np.concatenate((a, b))), lambda X: weights[m:] * solve(X, "T")[m:])


def inertia_derivatives(motion):
    """(M qdd - Q_v)_q and Q_v_qd, sparse (n, n); blocks of p of the rigid bodies.

    M_p = 4 G^T J' G, Q_v = 8 Gd^T J' Gd p; H_h p = G(p)^T h. Of h^T (h qdd + gamma_h) of inertia rows by central
    differences of fourth order.
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
    K, C = (csr_array((blocks.ravel(), (i.ravel(), j.ravel())), (n, n)) for blocks in (K, C))
    if not (motion.system.inertias.size and (motion.qd.any() or motion.qdd.any())):
        return K, C
    return K + csr_array(_added_slopes(motion, 1.0, 0.0)), C - csr_array(_added_slopes(motion, 0.0, 1.0))


def _added_slopes(motion, by_q, by_qd):
    """The derivative (n, n) of h^T (h qdd + gamma_h) by q or qd."""
    n, step, found = motion.q.size, FORCE_QUOTIENT, np.zeros((motion.q.size, motion.q.size))
    for k, weight in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)):
        moved = k * step * np.eye(n)
        for columns, h, gamma in added_inertia(motion.system, motion.q + by_q * moved, motion.qd + by_qd * moved):
            load = h @ motion.qdd[columns] + gamma
            found[columns] += weight / (12.0 * step) * (load[:, None] * h).T
    return found


def _crossed(h):
    """H_h (b, 4, 4) of vectors h (b, 3)."""
    x, y, z = h.T
    o = np.zeros_like(x)
    rows = [[o, -x, -y, -z], [x, o, z, -y], [y, -z, o, x], [z, y, -x, o]]
    return np.moveaxis(np.array(rows), (0, 1), (1, 2))


# Eigenvalues of M xdd + C xd + K x = 0, exact zeros included.
#
# With unit mass, that is in y = R x where M = R^T R. The null space of K is split off: each of its directions has an
# eigenvalue zero, which rounding would otherwise make a pair of the size of its root. Ctrl-C is answered within LAPACK.
# What is `nothing`, 1/s^2, is the stiffness up to which a direction belongs to the null space.


class EigenPairs(NamedTuple):
    """2 k eigenvalues and, in their order, vectors of coordinates (k, 2 k) complex, of unit kinetic energy norm."""

    values: np.ndarray
    vectors: np.ndarray


class Stiffnesses(NamedTuple):
    """Eigenvalues of the stiffness, in order, and its null space counted."""

    values: np.ndarray  # (k - neutral,) 1/s^2, of the symmetric part, without the null space
    neutral: int
    symmetric: bool

    @property
    def smallest(self):
        """Zero if all are neutral."""
        return float(self.values[0]) if len(self.values) else 0.0


def equations(motion, every, balanced=False):
    """Return `Reduced`, or with rows on velocities `Rolling`, in coordinates `chosen` for `motion.placed`."""
    whole = Reduced(motion.placed, every, balanced)
    return Rolling(motion, whole, every) if motion.rates.size else whole


def stiffnesses(reduced, nothing):
    """The `Stiffnesses` of `Reduced` equations."""
    K = reduced.K_hat
    K_s = 0.5 * (K + K.T)
    if np.abs(K - K.T).max(initial=0.0) <= STIFFNESS_ROUNDING * reduced.scale:
        w = interruptible(lambda: np.linalg.eigvalsh(K_s))
        stiff = w[np.abs(w) > nothing]
        return Stiffnesses(stiff, len(w) - len(stiff), True)
    _, s, V = interruptible(lambda: np.linalg.svd(K))
    kept = V[s > nothing]
    return Stiffnesses(interruptible(lambda: np.linalg.eigvalsh(kept @ K_s @ kept.T)), len(s) - len(kept), False)


def eigenpairs(reduced, nothing=None):
    """The `EigenPairs` of `Reduced` equations."""
    if isinstance(reduced, Rolling):
        return _ordered(*reduced.pairs(), reduced.whole.R)
    C, K, scale = reduced.C_hat, reduced.K_hat, reduced.scale
    nothing = PIVOT_ROUNDING * scale if nothing is None else nothing
    undamped = np.abs(C).max(initial=0.0) <= NEGLIGIBLE * np.sqrt(scale)
    if undamped and np.abs(K - K.T).max(initial=0.0) <= NEGLIGIBLE * scale:
        values, vectors = _symmetric(K, nothing)
    else:
        values, vectors = _general(C, K, nothing)
    return _ordered(values, vectors, reduced.R)


def _ordered(values, vectors, R):
    """The `EigenPairs` of vectors y = R x, by size."""
    from scipy.linalg import solve_triangular

    values = values + 0.0
    order = np.lexsort((-values.imag, np.abs(values.imag), np.abs(values)))
    values, vectors = values[order], vectors[:, order]
    return EigenPairs(values, interruptible(lambda: solve_triangular(R, vectors)))


def _symmetric(K, nothing):
    """Pairs +- of sqrt(-w)."""
    w, vectors = interruptible(lambda: np.linalg.eigh(0.5 * (K + K.T)))
    w = np.where(np.abs(w) <= nothing, 0.0, w)
    roots = np.sqrt(-w.astype(complex))
    return np.concatenate((roots, -roots)), np.concatenate((vectors, vectors), axis=1).astype(complex)


def _general(C, K, nothing):
    """Of the first-order form, without the positions in the null space of K."""
    k = len(K)
    _, s, V = interruptible(lambda: np.linalg.svd(K))
    stiff = s > nothing
    kept, free = V[stiff].T, V[~stiff].T  # K x = (K kept) kept^T x
    A = np.block([[np.zeros((stiff.sum(), stiff.sum())), kept.T], [-K @ kept, -C]])
    values, vectors = interruptible(lambda: np.linalg.eig(A))
    values = np.where(np.abs(values) <= NEGLIGIBLE * np.abs(values).max(initial=0.0), 0.0, values)
    speeds, places = vectors[-k:], kept @ vectors[: len(vectors) - k]
    moving = np.linalg.norm(speeds, axis=0) >= np.linalg.norm(places, axis=0) * np.abs(values) * 0.5
    shapes = np.where(moving & (np.linalg.norm(speeds, axis=0) > 0.0), speeds, places)
    shapes = shapes / np.linalg.norm(shapes, axis=0)
    return np.concatenate((np.zeros(free.shape[1]), values)), np.concatenate((free, shapes), axis=1).astype(complex)
