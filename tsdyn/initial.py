"""Consistent initial conditions: checked, projected when they nearly hold, or found by `scene.assemble`."""

from dataclasses import dataclass

import numpy as np

from .bodies import transform_g
from .checks import number, positive
from .errors import InconsistentState, InvalidArgument, InvalidBody, RedundantConstraints, SingularConfiguration
from .evaluate import constraint_arrays, mass_matrix

RANK_TOL = 1e-10  # of the singular values of Phi_q, its rows scaled to unit length

ROUNDING = 2e-16
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


def check_rank(scene, Phi_q):
    """Refuse dependent rows of Phi_q, by name."""
    m = Phi_q.shape[0]
    if m == 0:
        return
    lengths = np.linalg.norm(Phi_q, axis=1)
    names = scene.row_names()
    if (lengths == 0.0).any():
        row = names[int(np.argmin(lengths))]
        raise SingularConfiguration(
            f"the row of {row} in Phi_q is zero in this configuration: the constraint is singular here. "
            "Start from another configuration, or use a constraint that is regular here."
        )
    scaled = Phi_q / lengths[:, None]
    size = np.linalg.svd(scaled, compute_uv=False)
    rank = int((size > RANK_TOL * size[0]).sum())
    if rank == m:
        return
    order = _pivots(scaled)
    kept, dropped = order[:rank], order[rank:]
    stories = []
    for row in sorted(dropped):
        weights, *_ = np.linalg.lstsq(scaled[kept].T, scaled[row], rcond=None)
        partners = sorted(kept[np.abs(weights) > 1e-6])
        stories.append(f"  {names[row]} depends on " + (", ".join(names[i] for i in partners[:8]) or "nothing else"))
    raise RedundantConstraints(
        f"{m - rank} of the {m} constraint rows are redundant, Phi_q has rank {rank}:\n"
        + "\n".join(stories)
        + "\nRemove the rows that say nothing new, or use a joint with fewer rows."
    )


def check_inertia(scene, system, q, Phi_q):
    """Refuse a direction that the constraints leave free and that carries no inertia, by body and axis."""
    thin = [np.linalg.eigvalsh(J.reshape(3, 3))[0] <= 1e-12 * np.abs(J).max() for J in system.inertia]
    if not any(flag and length == 7 for flag, (_, length) in zip(thin, system.bodies, strict=True)):
        return
    free = np.linalg.svd(Phi_q)[2][Phi_q.shape[0] :].T
    size, ways = np.linalg.eigh(free.T @ mass_matrix(system, q) @ free)
    if size.size == 0 or size[0] > 1e-12 * size[-1]:
        return
    change = free @ ways[:, 0]
    turns = [
        2.0 * transform_g(q[at + 3 : at + 7]) @ change[at + 3 : at + 7] if length == 7 else np.zeros(3)
        for at, length in system.bodies
    ]
    worst = int(np.argmax([np.linalg.norm(turn) for turn in turns]))
    axis = np.round(turns[worst] / np.linalg.norm(turns[worst]), 3) + 0.0
    raise SingularConfiguration(
        f"{scene.bodies[worst].name}: turning about the axis {axis} of its frame is free and carries no inertia, so "
        "the accelerations are not determined. Give it inertia about that axis, or add the constraint that holds it."
    )


def weakest_row(scene, Phi_q):
    """Name the row of Phi_q nearest to depending on the others; and the share of its smallest singular value."""
    if not (Phi_q.size and np.isfinite(Phi_q).all()):
        return "", 1.0
    scaled = Phi_q / np.maximum(np.linalg.norm(Phi_q, axis=1), 1e-300)[:, None]
    size = np.linalg.svd(scaled, compute_uv=False)
    return scene.row_names()[_pivots(scaled)[-1]], size[-1] / size[0]


def _pivots(rows):
    """The rows in an order in which each is the farthest from those before it."""
    from scipy.linalg import qr  # imported here: it would double the time of `import tsdyn`

    return qr(rows.T, mode="economic", pivoting=True)[2]


def consistent(scene, system, q, qd, t, tol):
    """Check positions and velocities against the constraints, then remove what rounding is left. Returns (q, qd)."""
    Phi, Phi_q, Phi_t, _ = constraint_arrays(system, q, qd, t)
    _demand_finite(scene, Phi, Phi_q, Phi_t)
    _demand(scene, Phi, tol * (1.0 + np.abs(q).max()), "position", "Phi")
    check_rank(scene, Phi_q)
    check_inertia(scene, system, q, Phi_q)
    _demand(scene, Phi_q @ qd + Phi_t, tol * (1.0 + np.abs(qd).max()), "velocity", "Phi_q qd + Phi_t")
    if not Phi.size:
        return q, qd
    for _ in range(3):  # what is exact to rounding is left alone: a projection would only add noise
        if np.abs(Phi).max() <= ROUNDING * (1.0 + np.abs(q).max()):
            break
        q = q - _least(Phi_q, Phi)
        Phi, Phi_q, Phi_t, _ = constraint_arrays(system, q, qd, t)
    for _ in range(2):
        residual = Phi_q @ qd + Phi_t
        if np.abs(residual).max() <= ROUNDING * (1.0 + np.abs(qd).max()):
            break
        qd = qd - _least(Phi_q, residual)
    return q, qd


def _demand_finite(scene, *arrays):
    for array in arrays:
        bad = np.flatnonzero(~np.isfinite(array if array.ndim == 1 else array.sum(axis=1)))
        if bad.size:
            raise InconsistentState(
                f"{scene.row_names()[bad[0]]}: its constraint or a derivative of it is not finite at the start. Look "
                "at its parameters, its motion, or its kernels."
            )


def _demand(scene, residual, tol, level, formula):
    bad = np.flatnonzero(~(np.abs(residual) <= tol))
    if bad.size == 0:
        return
    names = scene.row_names()
    worst = sorted(bad, key=lambda i: -abs(residual[i]))
    lines = [f"  {names[i]}: {formula} = {residual[i]:.6g}" for i in worst[:8]]
    if bad.size > 8:
        lines.append(f"  ... and {bad.size - 8} more rows")
    raise InconsistentState(
        f"the initial {level} breaks {bad.size} constraint row{'s' if bad.size > 1 else ''} (allowed: {tol:.2g}):\n"
        + "\n".join(lines)
        + f"\nCorrect the bodies' {'poses' if level == 'position' else 'velocities'}, or call scene.assemble() to move "
        "them to the nearest consistent ones."
    )


def _least(Phi_q, residual):
    """The smallest change dq with Phi_q dq = residual."""
    return np.linalg.lstsq(Phi_q, residual, rcond=None)[0]


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
        If the constraints can't be met; names the rows that are left over. The bodies are as before.
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
    _demand_finite(scene, Phi, Phi_q, Phi_t)
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
