"""The nominal motion: accelerations and multipliers at one state, and the factors of the saddle-point matrix there.

    [ M    H^T ] [ qdd ]   [ Q_A + Q_v ]
    [ H    0   ] [ lam ] = [ -gamma    ]        H: independent rows of Phi_q, normalisations included

Sparse, so the cost is O(N) for chains and trees.
"""

import numpy as np

from ..elements.bodies import rotation_matrix, transform_g
from ..errors import InvalidForce, SingularConfiguration
from ..model.sparse_jacobian import WIDTH, as_csr, with_short_rows
from ..observables.evaluate import NOT_UNIQUE, constraint_arrays, mass_matrix_sparse
from ..observables.generalised_forces import applied_loads, velocity_forces
from ..sparse.constraint_graph import REDUCED
from ..sparse.constraint_graphs import graph_of, redundant_rows
from .tolerances import LEAST_DIVISOR, SINGULAR


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

    Attributes
    ----------
    qdd : ndarray (n,)
    lam : ndarray (m,)
        Multipliers, zero for redundant rows.
    M, H : sparse (n, n), (m', n)
    kept : ndarray (m',)
        Rows of Phi that are independent.
    """

    def __init__(self, packed, memory, t, q, qd):
        self.packed, self.memory, self.t, self.q, self.qd = packed, memory, float(t), q, qd
        short = with_short_rows(packed)
        self.system = short._replace(reals=short.reals.copy())
        self.system.reals[self.system.memory] = memory
        self.Phi, rows, self.Phi_t, gamma = constraint_arrays(self.system, q, qd, self.t, WIDTH)
        self.Phi_q = as_csr(packed, rows)
        redundant = graph_of(packed, REDUCED).row[redundant_rows(packed)]
        self.kept = np.setdiff1d(np.arange(len(self.Phi)), redundant)
        self.H, self.M = self.Phi_q[self.kept], mass_matrix_sparse(self.system, q)
        self._factor()
        at = self.t * np.ones(1)
        self.Q_A = applied_loads(self.system, at, q[None], qd[None], memory[None])[0]
        Q = self.Q_A + velocity_forces(self.system, q[None], qd[None])[0]
        self.qdd, found = self.solve(Q, -gamma[self.kept])
        self.lam = np.zeros(len(self.Phi))
        self.lam[self.kept] = found
        if self.system.normals.size:
            self._press()

    def _press(self):
        """Take over the normal loads of friction in joints, whose friction vanishes at rest."""
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

    def _factor(self):
        from scipy.sparse import block_array, diags_array  # imported here, as everywhere: `import tsdyn` is quicker
        from scipy.sparse.linalg import splu

        kkt = block_array([[self.M, self.H.T], [self.H, None]], format="csc")
        self._weights = 1.0 / np.sqrt(np.maximum(abs(kkt).max(axis=1).toarray().ravel(), LEAST_DIVISOR))
        weights = diags_array(self._weights)
        try:
            self._factors = splu((weights @ kkt @ weights).tocsc())
        except RuntimeError as error:
            raise SingularConfiguration(NOT_UNIQUE) from error
        pivots = np.abs(self._factors.U.diagonal())
        if pivots.min() < SINGULAR * pivots.max():
            raise SingularConfiguration(NOT_UNIQUE)

    def solve(self, load, bias):
        """Return (x, lam) with M x + H^T lam = load, H x = bias; vectors, or matrices of as many columns."""
        weights = self._weights if load.ndim == 1 else self._weights[:, None]
        found = weights * self._factors.solve(weights * np.concatenate((load, bias)))
        return found[: self.q.size], found[self.q.size :]

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
