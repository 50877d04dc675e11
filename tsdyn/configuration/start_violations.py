"""Checks of initial conditions against the constraints; messages name the violated rows."""

import numpy as np

from ..errors import InconsistentState, SingularConfiguration
from ..sparse.length_metric import MASS_REMEDY, mass_ratio
from .motor_starts import elsewhere


def demand_finite(scene, *arrays):
    """Refuse rows that are not finite, by name."""
    for array in arrays:
        bad = np.flatnonzero(~np.isfinite(array if array.ndim == 1 else array.sum(axis=1)))
        if bad.size:
            raise InconsistentState(
                f"{scene.row_names()[bad[0]]}: its constraint or a derivative of it is not finite at the start. Look "
                "at its parameters, its motion, or its kernels."
            )


def demand_small(scene, residual, tol, level, formula, start):
    """Refuse residuals (m,) above tol, by name; start is (t, q) or (t, q, qd)."""
    bad = np.flatnonzero(~(np.abs(residual) <= tol))
    if bad.size == 0:
        return
    names = scene.row_names()
    worst = sorted(bad, key=lambda i: -abs(residual[i]))
    lines = [f"  {names[i]}: {formula} = {residual[i]:.6g}" for i in worst[:8]]
    if bad.size > 8:
        lines.append(f"  ... and {bad.size - 8} more rows")
    said = elsewhere(scene.packed, *start)
    raise InconsistentState(
        f"the initial {level} breaks {bad.size} constraint row{'s' if bad.size > 1 else ''} (allowed: {tol:.2g}):\n"
        + "\n".join(lines + said)
        + f"\nCorrect the bodies' {'poses' if level == 'position' else 'velocities'}, or call scene.assemble() to move "
        "them to the nearest consistent ones."
    )


def refuse_vanished(row):
    """Refuse a row of Phi_q, by its name, that is zero."""
    raise SingularConfiguration(
        f"the row of {row} in Phi_q is zero in this configuration: the constraint is singular here. Start from another "
        "configuration, or use a constraint that is regular here."
    )


def refuse_masses(scene, graph, row):
    """Refuse masses so unequal that S is singular to rounding at a row of the graph."""
    where = scene.row_names()[graph.row[row]] if graph.row[row] >= 0 else "a body with many joints"
    raise SingularConfiguration(f"{mass_ratio(scene.packed)}, found at {where}. {MASS_REMEDY}")
