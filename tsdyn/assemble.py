"""`scene.assemble`: the nearest consistent positions, then the nearest consistent velocities."""

from dataclasses import dataclass

import numpy as np

from .bodies import transform_g
from .branch import demand_aligned
from .checks import number, positive
from .errors import InconsistentState, InvalidArgument, InvalidBody
from .evaluate import constraint_arrays, mass_matrix
from .initial import ROUNDING, demand_finite
from .rank import check_rank

MOST_ITERATIONS = 100


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
    free = ~held
    Phi, Phi_q, Phi_t, _ = constraint_arrays(system, q, qd, t)
    demand_finite(scene, Phi, Phi_q, Phi_t)
    moved_rows = np.abs(Phi_q[:, free]).max(axis=1, initial=0.0) > 0.0
    iterations, size = 0, np.linalg.norm(Phi)
    while iterations < MOST_ITERATIONS:
        iterations += 1
        if not Phi.size or np.abs(Phi).max() <= 1e-15 * (1.0 + np.abs(q).max()):
            break
        step = np.zeros(q.size)
        step[free] = _smallest(
            _metric(system, q)[np.ix_(free, free)], Phi_q[np.ix_(moved_rows, free)], -Phi[moved_rows]
        )
        rigid = [slice(at + 3, at + 7) for at, length in system.bodies if length == 7]
        turn = max((2.0 * np.linalg.norm(step[p]) for p in rigid), default=0.0)
        factor = min(1.0, 0.5 / turn) if turn > 0.0 else 1.0
        improved = False
        for _ in range(12):
            trial = q + factor * step
            for p in rigid:
                trial[p] /= np.linalg.norm(trial[p])
            trial_arrays = constraint_arrays(system, trial, qd, t)
            if np.linalg.norm(trial_arrays[0]) < size:
                improved = True
                break
            factor /= 2.0
        if not improved:
            break
        q, (Phi, Phi_q, Phi_t, _) = trial, trial_arrays
        size = np.linalg.norm(Phi)
    _demand_assembled(scene, Phi, tol * (1.0 + np.abs(q).max()), iterations)
    check_rank(scene, Phi_q)
    demand_aligned(scene.packed, q)
    for body, (at, length) in zip(scene.bodies, system.bodies, strict=True):
        if length == 7:  # the angular velocity is the user's, in the body's frame, however the body has been turned
            qd[at + 3 : at + 7] = 0.5 * transform_g(q[at + 3 : at + 7]).T @ body.angular_velocity
    M, wanted = _metric(system, q), qd.copy()
    for _ in range(2):
        residual = Phi_q @ qd + Phi_t
        if np.abs(residual).max(initial=0.0) > ROUNDING * (1.0 + np.abs(qd).max()):
            qd = qd + _smallest(M, Phi_q, -residual)
    scene.place(q, qd)
    return AssemblyReport(
        moved=float(np.abs(q - q_start).max()),
        residual=float(np.abs(Phi).max(initial=0.0)),
        velocity_changed=float(np.abs(qd - wanted).max()),
        velocity_residual=float(np.abs(Phi_q @ qd + Phi_t).max(initial=0.0)),
        iterations=iterations,
    )


def _metric(system, q):
    """M with the direction of p, and axes without inertia, made regular."""
    M = mass_matrix(system, q)
    for (at, length), J in zip(system.bodies, system.inertia, strict=True):
        if length == 7:
            size = (J[0] + J[4] + J[8]) / 3.0
            p, part = q[at + 3 : at + 7], slice(at + 3, at + 7)
            M[part, part] += 4.0 * size * np.outer(p, p)
            if np.linalg.eigvalsh(J.reshape(3, 3))[0] < 1e-6 * size:
                M[part, part] += 1e-6 * size * np.eye(4)
    return M


def _smallest(M, Phi_q, residual):
    """The change smallest in the metric M with Phi_q dq = residual, in the least-squares sense."""
    L = np.linalg.cholesky(M)
    scaled = np.linalg.solve(L, Phi_q.T).T
    return np.linalg.solve(L.T, np.linalg.lstsq(scaled, residual, rcond=1e-12)[0])


def _demand_assembled(scene, Phi, tol, iterations):
    bad = np.flatnonzero(~(np.abs(Phi) <= tol))
    if bad.size:
        names = scene.row_names()
        rows = ", ".join(f"{names[i]} ({Phi[i]:.3g})" for i in sorted(bad, key=lambda i: -abs(Phi[i]))[:8])
        raise InconsistentState(
            f"no configuration that meets all constraints was found in {iterations} iterations; left over: {rows}. "
            "Bring the bodies nearer to an assembled pose, or drop a constraint that contradicts the others."
        )
