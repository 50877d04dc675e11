"""The nominal motion: accelerations and multipliers at one state, and the factors of the saddle-point matrix there.

    [ M    H^T ] [ qdd ]   [ Q_A + Q_v ]
    [ H    0   ] [ lam ] = [ -gamma    ]        H: independent rows of Phi_q, normalisations included

Sparse, so the cost is O(N) for chains and trees.
"""

from functools import cached_property

import numpy as np

from ..elements.bodies import rotation_matrix, transform_g
from ..errors import InvalidForce, SingularConfiguration
from ..formulations.dependent_rows import dependent_rows
from ..maths.row_rank import dependent
from ..maths.sparse_lu import sparse_lu
from ..model.sparse_jacobian import WIDTH, as_csr, with_short_rows
from ..observables.evaluate import NOT_UNIQUE, constraint_arrays, mass_matrix_sparse
from ..observables.generalised_forces import applied_loads, velocity_forces
from ..sparse.constraint_graph import REDUCED
from ..sparse.constraint_graphs import graph_of, redundant_rows
from ..sparse.length_metric import are_unequal, coordinate_scales
from .pairwise import derivatives
from .tolerances import DENSE, LEAST_DIVISOR, REDUNDANT_SHARE, ROUNDED, SINGULAR, UNEQUAL_SWEEPS


class Motion:
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
    """

    def __init__(self, packed, memory, t, q, qd, still=False):
        self.packed, self.memory, self.t, self.q, self.qd = packed, memory, float(t), q, qd
        short = with_short_rows(packed)
        self.system = short._replace(reals=short.reals.copy())
        self.system.reals[self.system.memory] = memory
        self.Phi, rows, self.Phi_t, gamma = constraint_arrays(self.system, q, qd, self.t, WIDTH)
        self.Phi_q = as_csr(packed, rows)
        self.kept = np.setdiff1d(np.arange(len(self.Phi)), self._redundant())
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
        from ..observables.friction_balance import normal_loads  # imported here: few scenes need it

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
        known = graph_of(self.packed, REDUCED).row[redundant_rows(self.packed)]
        if not known.size:
            return known
        if self.q.size <= DENSE:
            found = dependent(self.Phi_q.toarray() * coordinate_scales(self.packed))
        else:
            found = dependent_rows(self.packed, self.q, self.t, REDUNDANT_SHARE)
        if found is not None and found.size > known.size and self.q.size <= DENSE:
            raise SingularConfiguration(NOT_UNIQUE)
        return known if found is None or found.size != known.size else found

    def _factor(self):
        self._factors, self._weights = self._factored(self.H)
        pivots = np.abs(self._factors.U.diagonal())
        if pivots.min() < SINGULAR * pivots.max():
            raise SingularConfiguration(NOT_UNIQUE)

    def _factored(self, H):
        """Factors of [M, H^T; H, 0] with unit masses and unit rows, and the weights that make it so."""
        from scipy.sparse import block_array, diags_array  # imported here, as everywhere: `import tsdyn` is quicker

        unit = diags_array(1.0 / self.root)
        M, H = unit @ self.M @ unit, H @ unit
        lengths = np.maximum(np.sqrt(H.multiply(H).sum(axis=1)), LEAST_DIVISOR)
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
        for _ in range(UNEQUAL_SWEEPS if are_unequal(self.system) else 0):
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
        return bool(np.abs(self.qdd).max(initial=0.0) <= ROUNDED * loads)

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
