"""Energy error of an undriven and undamped run near singular configurations."""

from types import SimpleNamespace

import numpy as np

from ..observables import diagnostics, power
from .tolerances import NO_POWER

MOST_OUTPUTS = 200  # examined


def energy_error(solution, task):
    """Return the largest change of energy since the start over the largest kinetic energy; None if it isn't conserved.

    Outputs and the last state are compared.
    """
    system, packed = solution.system, solution.packed
    if system.rheonomic[0] or system.normals.size:
        return None
    some, slots = solution[:: max(solution._length() // MOST_OUTPUTS, 1)], system.memory.size
    t = np.concatenate(([task.span[0]], some.t, [solution.reached]))
    q, qd = (
        np.vstack((first, rows, last))
        for first, rows, last in zip((task.q, task.qd), (some.q, some.qd), solution._last[:2], strict=True)
    )
    memory = np.vstack((task.remembered[-slots:] if slots else np.zeros(0), some._remembers, solution._remembered))
    forces = power.force_powers(SimpleNamespace(t=t, q=q, qd=qd, _memory=memory, packed=packed))
    kinetic = diagnostics.kinetic_energy(system, q, qd)
    largest = kinetic.max()
    if not (
        largest > 0.0 and max(np.abs(forces.applied).max(), np.abs(forces.dissipation).max()) <= NO_POWER * largest
    ):
        return None
    energy = kinetic + diagnostics.potential_energy(system, q) + forces.potential
    return float(np.abs(energy - energy[0]).max() / largest)
