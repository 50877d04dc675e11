"""Initial conditions: checked against the constraints, and freed of the last rounding errors."""

import numpy as np

from .errors import InconsistentState
from .evaluate import constraint_arrays
from .rank import check_inertia, check_rank, independent

ROUNDING = 2e-16


def consistent(scene, system, q, qd, t, tol):
    """Check positions and velocities against the constraints, then remove what rounding is left. Returns (q, qd)."""
    Phi, Phi_q, Phi_t, _ = constraint_arrays(system, q, qd, t)
    size, speed = 1.0 + float(np.abs(q).max()), 1.0 + float(np.abs(qd).max())
    with np.errstate(all="ignore"):
        residual = Phi_q @ qd + Phi_t
        off, slip = _largest(Phi), _largest(residual)
        clear = off <= tol * size and slip <= tol * speed and independent(Phi_q)
    if not clear:
        demand_finite(scene, Phi, Phi_q, Phi_t)
        demand_small(scene, Phi, tol * size, "position", "Phi")
        check_rank(scene, Phi_q)
    check_inertia(scene, system, q, Phi_q)
    if not clear:
        demand_small(scene, residual, tol * speed, "velocity", "Phi_q qd + Phi_t")
    if off > ROUNDING * size:  # what is exact to rounding is left alone: a projection would only add noise
        for _ in range(3):
            q = q - _least(Phi_q, Phi)
            Phi, Phi_q, Phi_t, _ = constraint_arrays(system, q, qd, t)
            if _largest(Phi) <= ROUNDING * (1.0 + np.abs(q).max()):
                break
        slip = _largest(residual := Phi_q @ qd + Phi_t)
    for _ in range(2):
        if slip <= ROUNDING * (1.0 + np.abs(qd).max()):
            break
        qd = qd - _least(Phi_q, residual)
        slip = _largest(residual := Phi_q @ qd + Phi_t)
    return q, qd


def _largest(residual):
    return float(np.abs(residual).max(initial=0.0))


def demand_finite(scene, *arrays):
    """Refuse rows that are not finite, by name."""
    for array in arrays:
        bad = np.flatnonzero(~np.isfinite(array if array.ndim == 1 else array.sum(axis=1)))
        if bad.size:
            raise InconsistentState(
                f"{scene.row_names()[bad[0]]}: its constraint or a derivative of it is not finite at the start. Look "
                "at its parameters, its motion, or its kernels."
            )


def demand_small(scene, residual, tol, level, formula):
    """Refuse residuals (m,) above tol, by name."""
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
