"""`scene.assemble`: the nearest consistent positions, then the nearest consistent velocities."""

from dataclasses import dataclass

import numpy as np

from .bodies import transform_g
from .branch import demand_aligned
from .checks import number, positive
from .errors import InconsistentState, InvalidArgument, InvalidBody
from .evaluate import LARGE, constraint_arrays, mass_matrix, mass_matrix_sparse
from .initial import ROUNDING, demand_finite
from .rank import check_rank
from .sparse_rows import WIDTH, as_csr, with_short_rows
from .start import consistent

MOST_ITERATIONS = 100
NEXT_TO_NOTHING = 1e-13  # of rows of length one


@dataclass(frozen=True)
class AssemblyReport:
    """What `scene.assemble` did.

    Attributes
    ----------
    moved : float
        Largest change of a coordinate: m for positions, 1 for Euler parameters.
    residual : float
        Largest |Phi| left.
    velocity_changed : float
        Largest change of a velocity coordinate.
    velocity_residual : float
        Largest |Phi_q qd + Phi_t| left.
    iterations : int
    """

    moved: float
    residual: float
    velocity_changed: float
    velocity_residual: float
    iterations: int


def assemble(scene, tol=1e-12, fixed=(), t=0.0):
    """Move the bodies to the nearest consistent positions, then to the nearest consistent velocities.

    Parameters
    ----------
    tol : float
        Largest |Phi| accepted at the end, relative to 1 + max |q|.
    fixed : sequence of Body
        Bodies whose pose (not velocity) must stay as it is.
    t : float, s
        The time at which constraints that depend on time are met.

    Returns
    -------
    AssemblyReport
        `.moved`, `.residual` and more; the bodies hold the new values.

    Raises
    ------
    InconsistentState
        If the constraints can't be met, which names the rows that are left over, or if what was found is a mirrored
        joint. The bodies are as before.
    SingularConfiguration, RedundantConstraints
        If rows of Phi_q vanish or depend on each other at the configuration found.

    Notes
    -----
    Gauss-Newton steps, smallest in the kinetic-energy metric, with rotations of at most half a radian a step and
    halved until |Phi| falls; the velocity correction is the smallest in kinetic energy.
    """
    tol = positive(tol, "tol")
    if not np.isfinite(number(t)):
        raise InvalidArgument(f"t must be a finite time in s, got {t!r}.")
    system = scene.system
    q_start, qd = scene.start
    q = q_start.copy()
    held = np.zeros(q.size, bool)
    if isinstance(fixed, str) or not hasattr(fixed, "__iter__"):
        raise InvalidBody(f"fixed must be a sequence of bodies, such as (body,), got {fixed!r}.")
    for body in fixed:
        if body not in scene.bodies:
            raise InvalidBody(f"fixed: {body!r} is not a body of this scene.")
        at = int(system.bodies[body.index, 0])
        held[at : at + body.dimension] = True
    free, rigid = ~held, system.bodies[system.bodies[:, 1] == 7, :1] + np.arange(3, 7)
    form = _Sparse(scene.packed) if q.size > LARGE else _Dense(system)
    Phi, Phi_q, Phi_t = form.arrays(q, qd, t)
    demand_finite(scene, Phi, Phi_q, Phi_t)
    moved_rows = form.moved_by(Phi_q, free)
    iterations, size = 0, np.linalg.norm(Phi)
    while iterations < MOST_ITERATIONS:
        iterations += 1
        if not Phi.size or np.abs(Phi).max() <= 1e-15 * (1.0 + np.abs(q).max()):
            break
        step = np.zeros(q.size)
        step[free] = form.smallest(q, Phi_q, -Phi[moved_rows], moved_rows, free)
        turn = 2.0 * np.linalg.norm(step[rigid], axis=1).max(initial=0.0)
        factor = min(1.0, 0.5 / turn) if turn > 0.0 else 1.0
        improved = False
        for _ in range(12):
            trial = q + factor * step
            trial[rigid] /= np.linalg.norm(trial[rigid], axis=1)[:, None]
            trial_arrays = form.arrays(trial, qd, t)
            if np.linalg.norm(trial_arrays[0]) < size:
                improved = True
                break
            factor /= 2.0
        if not improved:
            break
        q, (Phi, Phi_q, Phi_t) = trial, trial_arrays
        size = np.linalg.norm(Phi)
    _demand_assembled(scene, Phi, tol * (1.0 + np.abs(q).max()), iterations)
    form.check_rank(scene, Phi_q)
    demand_aligned(scene.packed, q)
    turning = np.array([body.angular_velocity for body in scene.bodies if body.dimension == 7]).reshape(-1, 3)
    # the angular velocity is the user's, in the body's frame, however the body has been turned
    qd[rigid] = 0.5 * np.einsum("bij,bi->bj", transform_g(q[rigid]), turning)
    wanted, everything = qd.copy(), (np.ones(len(Phi), bool), np.ones(q.size, bool))
    for _ in range(2):
        residual = Phi_q @ qd + Phi_t
        if np.abs(residual).max(initial=0.0) > ROUNDING * (1.0 + np.abs(qd).max()):
            qd = qd + form.smallest(q, Phi_q, -residual, *everything)
    form.check_whole(scene, q, qd, t, tol)
    scene.place(q, qd)
    return AssemblyReport(
        moved=float(np.abs(q - q_start).max()),
        residual=float(np.abs(Phi).max(initial=0.0)),
        velocity_changed=float(np.abs(qd - wanted).max()),
        velocity_residual=float(np.abs(Phi_q @ qd + Phi_t).max(initial=0.0)),
        iterations=iterations,
    )


class _Dense:
    """Constraints and the metric as matrices."""

    def __init__(self, system):
        self.system = system

    def arrays(self, q, qd, t):
        """Phi, Phi_q and Phi_t."""
        return constraint_arrays(self.system, q, qd, t)[:3]

    def moved_by(self, Phi_q, free):
        """Which rows the free coordinates have a part in."""
        return np.abs(Phi_q[:, free]).max(axis=1, initial=0.0) > 0.0

    def smallest(self, q, Phi_q, residual, rows, free):
        """The change of the free coordinates, smallest in kinetic energy, with Phi_q dq = residual by least squares."""
        L = np.linalg.cholesky(self.metric(q)[np.ix_(free, free)])
        scaled = np.linalg.solve(L, Phi_q[np.ix_(rows, free)].T).T
        return np.linalg.solve(L.T, np.linalg.lstsq(scaled, residual, rcond=1e-12)[0])

    def metric(self, q):
        """M with the direction of p, and axes without inertia, made regular."""
        M = mass_matrix(self.system, q)
        for at, block in zip(*_regular(self.system, q), strict=True):
            M[at[:, None], at] += block
        return M

    def check_rank(self, scene, Phi_q):
        """Refuse dependent rows."""
        check_rank(scene, Phi_q)

    def check_whole(self, scene, q, qd, t, tol):
        """Nothing more to refuse."""


class _Sparse:
    """The same at a cost of O(N)."""

    def __init__(self, packed):
        self.packed, self.system = packed, with_short_rows(packed)

    def arrays(self, q, qd, t):
        Phi, rows, Phi_t, _ = constraint_arrays(self.system, q, qd, t, WIDTH)
        return Phi, as_csr(self.packed, rows), Phi_t

    def moved_by(self, Phi_q, free):
        return abs(Phi_q[:, free]).max(axis=1).toarray().ravel() > 0.0

    def smallest(self, q, Phi_q, residual, rows, free):
        """By [M, A^T; A, -d] (dq, lam) = (0, residual), d being next to nothing, and enough for dependent rows."""
        from scipy.sparse import block_array, diags_array
        from scipy.sparse.linalg import splu

        M, A = self.metric(q)[free][:, free], Phi_q[rows][:, free]
        weights = 1.0 / np.sqrt(M.diagonal())
        A, M = A @ diags_array(weights), diags_array(weights) @ M @ diags_array(weights)
        lengths = np.sqrt((A * A).sum(axis=1))
        A = diags_array(1.0 / lengths) @ A
        factors = splu(
            block_array([[M, A.T], [A, -diags_array(np.full(len(residual), NEXT_TO_NOTHING))]], format="csc")
        )
        found = factors.solve(np.concatenate((np.zeros(len(weights)), residual / lengths)))
        return weights * found[: len(weights)]

    def metric(self, q):
        from scipy.sparse import csr_array

        places, blocks = _regular(self.system, q)
        i, j = np.broadcast_to(places[:, :, None], blocks.shape), np.broadcast_to(places[:, None], blocks.shape)
        return mass_matrix_sparse(self.system, q) + csr_array(
            (blocks.ravel(), (i.ravel(), j.ravel())), (q.size, q.size)
        )

    def check_rank(self, scene, Phi_q):
        """With the velocities, below."""

    def check_whole(self, scene, q, qd, t, tol):
        """Refuse dependent rows as a run does."""
        consistent(scene, scene.system, q, qd, t, max(tol, 1e-9))


def _regular(system, q):
    """Where each rigid body's p is, (b, 4), and what makes its part of M regular, (b, 4, 4)."""
    rigid = system.bodies[:, 1] == 7
    at, J = system.bodies[rigid, :1] + np.arange(3, 7), system.inertia[rigid].reshape(-1, 3, 3)
    size = np.trace(J, axis1=1, axis2=2) / 3.0
    thin = np.linalg.eigvalsh(J)[:, 0] < 1e-6 * size
    p = q[at]
    blocks = 4.0 * size[:, None, None] * p[:, :, None] * p[:, None, :]
    return at, blocks + (1e-6 * size * thin)[:, None, None] * np.eye(4)


def _demand_assembled(scene, Phi, tol, iterations):
    bad = np.flatnonzero(~(np.abs(Phi) <= tol))
    if bad.size:
        names = scene.row_names()
        rows = ", ".join(f"{names[i]} ({Phi[i]:.3g})" for i in sorted(bad, key=lambda i: -abs(Phi[i]))[:8])
        raise InconsistentState(
            f"no configuration that meets all constraints was found in {iterations} iterations; left over: {rows}. "
            "Bring the bodies nearer to an assembled pose, or drop a constraint that contradicts the others."
        )
