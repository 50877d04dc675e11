"""The nominal motion: accelerations and multipliers at one state, derivatives of all constraints and forces there."""

from copy import copy
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..configuration.mobility import divide
from ..elements.bodies import rotation_matrix, transform_g
from ..elements.loops.coordinate_rows import INTS, STRIDE
from ..elements.loops.forces import FORCE_INTS
from ..elements.loops.template import AT
from ..errors import InvalidForce, SingularConfiguration
from ..formulations.tolerances import REFINEMENTS
from ..jit.kernels import entry
from ..maths.dense_linalg import dependent, sparse_lu
from ..maths.tolerances import PIVOT_ROUNDING, ROUNDING, TINY
from ..model.equations import (
    WIDTH,
    applied_forces,
    as_csr,
    call_jacobian,
    constraint_curvature,
    set_time,
    with_curvatures,
    with_force_jacobians,
    with_short_rows,
)
from ..model.handles import first_rows, instances_of_kinds, of_rates
from ..model.laws import interrupts_answered
from ..model.packed import no_system
from ..observables.evaluate import NOT_UNIQUE, constraint_arrays, dependent_rows, mass_matrix_sparse
from ..observables.generalised_forces import applied_loads, velocity_forces
from ..rows.constraint_graph import are_unequal, coordinate_scales, redundant_rows
from .tolerances import DENSE, REDUNDANT_SHARE

# Derivatives of all constraints and forces, each as a block of the 14 coordinates of its two bodies.
#
# The loops of implicit methods write into matrices of n columns. Here n is 14 and the instances' bodies are taken to be
# two of their own, so one pass fills separate blocks, and storage is O(N). Terms that read further bodies are the
# exception: theirs are matrices of n columns, for such terms alone.

STEP = WIDTH * WIDTH + WIDTH  # floats from a block to the next


class Derivatives(NamedTuple):
    """Of constraints and forces at one motion, sparse."""

    K: object  # (n, n) (Phi_q^T lam)_q
    G1: object  # (m, n) (Phi_q qd + Phi_t)_q
    G2: object  # (m, n) (Phi_q qdd + gamma)_q
    Q_q: object  # (n, n) of applied forces
    Q_qd: object


@entry(no_system(), "mvmvvv")
def fill_blocks(s, x, lam, rows, Q_q, Q_qd, kept):
    """Blocks of all instances: s has the table of `Pairs`; x (4, 14 instances) q, qd, qdd and, first of all, t.

    rows (3, .): K, G1, G2 one after the other. Sums; zero on entry.
    """
    t = x[3, 0]
    set_time(s, t)
    constraint_curvature(s, x[0], x[1], x[2], t, lam, rows[0], rows[1], rows[2])
    for i in range(s.forces.shape[0]):
        kind = s.forces[i]
        table, reals, own = s.table[kind.table :], s.reals[kind.reals :], kept[kind.kept :]
        call_jacobian(kind.jacobian, kind, table, reals, x[0], x[1], t, Q_q, Q_qd, 1, own)


@entry(no_system(), "vvdv")
def see_state(s, q, qd, t, Q):
    """Let laws of the whole scene see a state, at which their derivatives are then taken; Q (n,): zeros."""
    set_time(s, t)
    applied_forces(s, q, qd, t, Q)


class Pairs:
    """Constraints and forces of a packed scene, each on the 14 coordinates of its two bodies.

    Attributes
    ----------
    counts : (int, int)
        Of constraints and of forces, which follow them.
    columns, used : ndarray (instances, 14)
        Coordinates of the two bodies, zero where there are none, and whether there are.
    """

    def __init__(self, packed):
        self.packed = packed
        system, self._size = with_force_jacobians(packed._replace(system=with_curvatures(packed)), WIDTH)
        constraints, forces = _entries(system, system.kinds, INTS), _entries(system, system.forces, FORCE_INTS)
        place = {id(part): i for i, part in enumerate(packed.constraints)}
        order = [place[id(part)] for members in instances_of_kinds(packed) for part in members]
        constraints = constraints[np.argsort(order, kind="stable")]
        places = np.concatenate((constraints[:, 1 + AT : 5 + AT], forces[:, 1 + AT : 5 + AT]))
        table = system.table.copy()
        table[constraints[:, 0] + STRIDE] = WIDTH
        first = np.concatenate((constraints[:, 0], forces[:, 0]))
        for k in range(2):
            table[first + AT + k] = WIDTH * np.arange(len(first)) + k * (WIDTH // 2)
        reading = np.array([members[0].others != () for members in instances_of_kinds(packed)], bool)
        self._reading = system._replace(kinds=system.kinds[reading], forces=system.forces[:0])
        self._system = system._replace(table=table, kinds=system.kinds[~reading])
        self.columns, self.used = _columns(places)
        self.counts = len(constraints), len(forces)

    def blocks(self, motion, lam):
        """(Phi_q^T lam)_q (constraints, 14, 14); rows of G1 and G2 (2, .); Q_q and Q_qd (forces, 14, 14).

        A motion has q, qd, qdd (n,), t, and the system with its memory.
        """
        nc, nf = self.counts
        x = np.zeros((4, max(self.columns.size, 1)))
        for level, values in enumerate((motion.q, motion.qd, motion.qdd)):
            x[level, : self.columns.size] = np.where(self.used, values[self.columns], 0.0).ravel()
        x[3] = motion.t
        rows = np.zeros((3, max(STEP * nc, WIDTH * (len(lam) + nc))))
        Q = np.zeros((2, STEP * (nc + nf)))
        system = self._system._replace(reals=motion.system.reals.copy())
        with interrupts_answered():
            if any(load.law is not None for load in self.packed.loads):
                whole = motion.system._replace(reals=system.reals)
                see_state(whole, motion.q, motion.qd, motion.t, np.zeros(motion.q.size))
            fill_blocks(system, x, lam, rows, *Q, np.zeros(self._size))
        return _whole(rows[0, : STEP * nc]), rows[1:], *(_whole(one[STEP * nc :]) for one in Q)

    def whole(self, motion, lam):
        """K (n, n), G1 and G2 (m, n) of terms that read further bodies; None without any."""
        m, n = len(lam), motion.q.size
        if not self._reading.kinds.size:
            return None
        x = np.stack((motion.q, motion.qd, motion.qdd, np.full(n, motion.t)))
        rows, none = np.zeros((3, max(m, n) * n)), np.zeros(0)
        fill_blocks(self._reading._replace(reals=motion.system.reals.copy()), x, lam, rows, none, none, none)
        return rows[0, : n * n].reshape(n, n), *rows[1:, : m * n].reshape(2, m, n)


def derivatives(motion):
    """The `Derivatives` at a `NominalMotion`."""
    from scipy.sparse import csr_array

    packed, pairs = motion.packed, Pairs(motion.packed)
    (nc, _), m, n = pairs.counts, len(motion.lam), motion.q.size
    K, rows, Q_q, Q_qd = pairs.blocks(motion, motion.lam)
    # Lines of G1 and G2: of every row, then of the later terms of sums
    found = [
        [row + i + r for r in range(part.all_rows or 1)] for i, (part, row) in enumerate(first_rows(packed.constraints))
    ]
    lines = [lines for part, lines in zip(packed.constraints, found, strict=True) if part.all_rows]
    lines += [lines for part, lines in zip(packed.constraints, found, strict=True) if not part.all_rows]
    lines = np.array([line for each in lines for line in each], int)
    G1, G2 = (as_csr(packed, one[: WIDTH * (m + nc)].reshape(-1, WIDTH)[lines]) for one in rows)
    K = _scatter(K, pairs.columns[:nc], pairs.used[:nc], n)
    Q_q, Q_qd = (_scatter(one, pairs.columns[nc:], pairs.used[nc:], n) for one in (Q_q, Q_qd))
    whole = pairs.whole(motion, motion.lam)
    if whole is not None:
        K, G1, G2 = (sparse + csr_array(dense) for sparse, dense in zip((K, G1, G2), whole, strict=True))
    return Derivatives(K, G1, G2, Q_q, Q_qd)


def _whole(blocks):
    """Blocks (instances, 14, 14) without the floats between them."""
    return blocks.reshape(-1, STEP)[:, : WIDTH * WIDTH].reshape(-1, WIDTH, WIDTH)


def _entries(system, kinds, width):
    """Of every instance of some kinds: where its entry in the table begins, and the entry."""
    found = [np.zeros((0, 1 + width), np.int64)]
    for kind in kinds:
        first = kind.table + width * np.arange(kind.count)
        found.append(np.column_stack((first, system.table[first[:, None] + np.arange(width)])))
    return np.concatenate(found)


def _columns(places):
    """Coordinates (instances, 14) of the two bodies, zero where there are none, and whether there are."""
    half = np.arange(WIDTH // 2)
    columns = (places[:, :2, None] + half).reshape(len(places), WIDTH)
    used = (half < places[:, 2:, None]).reshape(len(places), WIDTH)
    return np.where(used, columns, 0), used


def _scatter(blocks, columns, used, n):
    """Sum of blocks as a sparse (n, n)."""
    from scipy.sparse import csr_array

    both = used[:, :, None] & used[:, None, :]
    i, j = np.broadcast_arrays(columns[:, :, None], columns[:, None, :])
    return csr_array((blocks[both], (i[both], j[both])), (n, n))


# The nominal motion: accelerations and multipliers at one state, and the factors of the saddle-point matrix there.
#
#     [ M    H^T ] [ qdd ]   [ Q_A + Q_v ]
#     [ H    0   ] [ lam ] = [ -gamma    ]        H: independent rows of Phi_q, normalisations included
#
# Sparse, so the cost is O(N) for chains and trees.


class NominalMotion:
    """Equations of motion at a consistent state of a packed scene.

    Parameters
    ----------
    packed : Packed
        Its redundant rows have been selected, as for a run.
    memory : ndarray (slots,)
        Memory of forces and constraints.
    t : float, s
    q, qd : ndarray (n,)
    still : bool
        Whether constraints are taken as they are at t, whatever their rates.

    Attributes
    ----------
    qdd : ndarray (n,)
    lam : ndarray (m,)
        Multipliers, zero for redundant rows.
    M, H : sparse (n, n), (m', n)
    kept : ndarray (m',)
        Rows of Phi that are independent.
    rates : ndarray (r,)
        Those of them that are on velocities.
    """

    def __init__(self, packed, memory, t, q, qd, still=False):
        self.packed, self.memory, self.t, self.q, self.qd = packed, memory, float(t), q, qd
        short = with_short_rows(packed)
        self.system = short._replace(reals=short.reals.copy())
        self.system.reals[self.system.memory] = memory
        self.Phi, rows, self.Phi_t, gamma = constraint_arrays(self.system, q, qd, self.t, WIDTH)
        self.Phi_q = as_csr(packed, rows)
        self._on_rates = of_rates(packed)
        self.kept = np.setdiff1d(np.arange(len(self.Phi)), self._redundant())
        self.rates = self.kept[self._on_rates[self.kept]]
        self.H, self.M = self.Phi_q[self.kept], mass_matrix_sparse(self.system, q)
        self._factor()
        at = self.t * np.ones(1)
        self.Q_A = applied_loads(self.system, at, q[None], qd[None], memory[None])[0]
        Q = self.Q_A + velocity_forces(self.system, q[None], qd[None])[0]
        self.qdd, found = self.solve(Q, -gamma[self.kept] * (not still))
        self.lam = np.zeros(len(self.Phi))
        self.lam[self.kept] = found
        if self.system.normals.size:
            self._press()

    def _press(self):
        """Set the normal loads of joint friction, which vanishes at rest."""
        from ..observables.evaluate import normal_loads  # imported here: few scenes need it

        N, friction = normal_loads(self.packed, self.t, self.q, self.qd, self.Phi_q, self.lam)
        moving = np.flatnonzero(np.abs(friction).max(axis=1))
        if moving.size:
            load = next(load for load in self.packed.loads if load.normal == moving[0])
            raise InvalidForce(
                f"{load.force.name}: friction that depends on the reaction of its joint is linearised at rest only: "
                "here the joint slips. Linearise without it, or with a friction of given magnitude."
            )
        self.system.reals[self.system.normals] = N

    def _redundant(self):
        """Redundant rows of Phi at this state: as many as at the start, reselected."""
        known = redundant_rows(self.packed)
        if not known.size:
            return known
        if self.q.size <= DENSE:
            found = dependent(self.Phi_q.toarray() * coordinate_scales(self.packed))
        else:
            found = dependent_rows(self.packed, self.q, self.t, REDUNDANT_SHARE)
        if found is not None and found.size > known.size and self.q.size <= DENSE:
            raise SingularConfiguration(NOT_UNIQUE)
        if found is None or found.size != known.size:
            return known
        return self._rates_first(found) if self._on_rates.any() else found

    def _rates_first(self, found):
        """As many redundant rows, of those on velocities where rows on positions say the same."""
        groups = np.flatnonzero(~self._on_rates), np.flatnonzero(self._on_rates)
        _, other = divide(self.Phi_q.toarray() * coordinate_scales(self.packed), groups)
        return np.array(other, int) if len(other) == found.size else found

    @cached_property
    def placed(self):
        """The same motion with the rows on positions alone as constraints; those on velocities push with `lam`."""
        if not self.rates.size:
            return self
        other = copy(self)
        other.kept, other.rates = np.setdiff1d(self.kept, self.rates), self.rates[:0]
        other.H = self.Phi_q[other.kept]
        other._factor()
        return other

    def _factor(self):
        self._factors, self._weights = self._factored(self.H)
        pivots = np.abs(self._factors.U.diagonal())
        if pivots.min() < ROUNDING * pivots.max():
            raise SingularConfiguration(NOT_UNIQUE)

    def _factored(self, H):
        """Factors of [M, H^T; H, 0] with unit masses and unit rows, and the weights that make it so."""
        from scipy.sparse import block_array, diags_array  # imported here, as everywhere: `import tsdyn` is quicker

        unit = diags_array(1.0 / self.root)
        M, H = unit @ self.M @ unit, H @ unit
        lengths = np.maximum(np.sqrt(H.multiply(H).sum(axis=1)), TINY)
        H = diags_array(1.0 / lengths) @ H
        try:
            factors = sparse_lu(block_array([[M, H.T], [H, None]], format="csc"))
        except RuntimeError as error:
            raise SingularConfiguration(NOT_UNIQUE) from error
        return factors, np.concatenate((1.0 / self.root, 1.0 / lengths))

    def solve(self, load, bias):
        """Return (x, lam) with M x + H^T lam = load, H x = bias; vectors, or matrices of as many columns."""
        weights, n = self._weights if load.ndim == 1 else self._weights[:, None], self.q.size
        found = weights * self._factors.solve(weights * np.concatenate((load, bias)))
        for _ in range(REFINEMENTS if are_unequal(self.system) else 0):
            x, lam = found[:n], found[n:]
            left = np.concatenate((load - self.M @ x - self.H.T @ lam, bias - self.H @ x))
            found = found + weights * self._factors.solve(weights * left)
        return found[:n], found[n:]

    def holding(self, Z):
        """Return free(load) = x with M x + H^T lam + Z^T held = load, H x = 0, Z x = 0; loads (n, c) are columns."""
        from scipy.sparse import vstack

        factors, weights = self._factored(vstack([self.H, Z])) if Z.shape[0] else (self._factors, self._weights)
        n = self.q.size

        def free(load):
            whole = np.zeros((weights.size, load.shape[1]))
            whole[:n] = weights[:n, None] * load
            return weights[:n, None] * factors.solve(whole)[:n]

        return free

    def residuals(self, q):
        """Phi (m,) at other positions."""
        return constraint_arrays(self.system, q, np.zeros(q.size), self.t, WIDTH)[0]

    @cached_property
    def derivatives(self):
        """The `Derivatives` of constraints and forces."""
        return derivatives(self)

    @cached_property
    def root(self):
        """Square roots of the masses that go with the coordinates, of a body turning about any axis alike, (n,)."""
        return roots_of_masses(self.system, self.q.size)

    @cached_property
    def stiffness(self):
        """The largest entry of the static stiffness (Phi_q^T lam)_q - Q_A,q over that of M, 1/s^2."""
        K = (self.derivatives.K - self.derivatives.Q_q).tocoo()
        i, j = K.coords
        return float(np.abs(K.data / self.root[i] / self.root[j]).max(initial=0.0))

    @property
    def is_balanced(self):
        """Whether the accelerations are rounding of contributions that cancel."""
        loads = max(float(np.abs(load / self.root**2).max(initial=0.0)) for load in (self.Q_A, self.Phi_q.T @ self.lam))
        return bool(np.abs(self.qdd).max(initial=0.0) <= PIVOT_ROUNDING * loads)

    def acceleration_scale(self, size):
        """The acceleration, m/s^2, that others are compared with: of loads, reactions, a spring stretched by size.

        The last stands for loads that balance each other.
        """
        loads = (self.Q_A, self.Phi_q.T @ self.lam)
        largest = max(float(np.abs(load / self.root**2).max(initial=0.0)) for load in loads)
        return max(largest, float(np.abs(self.system.gravity).max()), self.stiffness * size) or 1.0

    @property
    def accelerations(self):
        """qdd (n,) of the nominal motion."""
        return self.qdd

    @property
    def freedom(self):
        """Degrees of freedom, k."""
        return self.q.size - self.kept.size

    @property
    def rigid(self):
        """Which bodies are rigid, (b,) bool."""
        return self.system.bodies[:, 1] == 7

    def translations(self, level):
        """r, rd or rdd of all bodies, (b, 3)."""
        return (self.q, self.qd, self.qdd)[level][self.system.bodies[:, :1] + np.arange(3)]

    def parameters(self, level):
        """p, pd or pdd of the rigid bodies, (b', 4)."""
        return (self.q, self.qd, self.qdd)[level][self.system.bodies[self.rigid, :1] + np.arange(3, 7)]

    def spins(self, level):
        """omega (level 1) or its derivative (level 2) of the rigid bodies, ground frame, (b', 3)."""
        p = self.parameters(0)
        return 2.0 * np.einsum("bij,bjk,bk->bi", rotation_matrix(p), transform_g(p), self.parameters(level))


def roots_of_masses(system, n):
    """Square roots of the masses that go with the coordinates, of a body turning about any axis alike, (n,)."""
    root, rigid = np.ones(n), system.bodies[:, 1] == 7
    root[system.bodies[:, :1] + np.arange(3)] = np.sqrt(system.mass)[:, None]
    mean = np.trace(system.inertia[rigid].reshape(-1, 3, 3), axis1=1, axis2=2) / 3.0
    root[system.bodies[rigid, :1] + np.arange(3, 7)] = 2.0 * np.sqrt(mean)[:, None]
    return root
