"""Coupled friction and reactions at one state, in plain NumPy, for `scene.evaluate`."""

import numpy as np

from ..elements.bodies import rotation_matrix, transform_g
from ..errors import SingularConfiguration
from ..jit.kernels import twin
from .diagnostics import starts_of
from .generalised_forces import force_loads
from .power import marker_states
from .tolerances import BALANCED, COMPLEX_STEP

SWEEPS = 50
JAMMED = (
    "no reactions are consistent with the friction of the joints: with large coefficients of friction the mechanism "
    "may jam here."
)


def balance(packed, t, q, qd, Phi_q, solve):
    """Return friction forces (n,) and the solution of the equations of motion; solve(load) is affine in the load.

    Newton's method for the normal loads N = N(lam_0 + sum_i lam_i N_i).
    """
    system, n = packed.system, q.size
    found = sorted((load for load in packed.loads if load.normal >= 0), key=lambda load: load.normal)
    units = [_unit(system, load, t, q, qd) for load in found]
    first = solve(np.zeros(n))
    parts = np.array([solve(unit) - first for unit in units])
    reactions = [_reaction(packed, load, q, qd, Phi_q) for load in found]
    N = np.zeros(len(found))
    for _ in range(SWEEPS):
        lam = np.nan_to_num((first + N @ parts)[n:])
        values, changes = zip(*(reaction(lam) for reaction in reactions), strict=True)
        J = np.eye(N.size) - np.array(changes) @ np.nan_to_num(parts[:, n:]).T
        try:
            step = np.linalg.solve(J, np.array(values) - N)
        except np.linalg.LinAlgError as error:
            raise SingularConfiguration(JAMMED) from error
        N = N + step
        if not np.abs(step).max() > BALANCED * np.abs(N).max():
            return N @ np.array(units), first + N @ parts
    raise SingularConfiguration(JAMMED)


def normal_loads(packed, t, q, qd, Phi_q, lam):
    """Return the normal loads (frictions,) by multipliers (m,), and the friction forces of unit ones (frictions, n)."""
    found = sorted((load for load in packed.loads if load.normal >= 0), key=lambda load: load.normal)
    loads = np.array([_reaction(packed, load, q, qd, Phi_q)(lam)[0] for load in found])
    return loads, np.array([_unit(packed.system, load, t, q, qd) for load in found])


def _unit(system, load, t, q, qd):
    """Return the generalised forces g (n,) of one friction for unit normal load."""
    memory = np.zeros((1, system.memory.size + system.normals.size))
    memory[0, system.memory.size + load.normal] = 1.0
    return force_loads(system._replace(forces=load.alone), np.array([t]), q[None], qd[None], memory)[0]


def _reaction(packed, load, q, qd, Phi_q):
    """Return a normal load as a function of multipliers (m,), with its derivative (m,)."""
    force, member = load.force, next(m for m in packed.members if m.constraint is load.force.joint)
    rows = Phi_q[member.rows]
    rows = rows if isinstance(rows, np.ndarray) else rows.toarray()
    at, (jets, _) = starts_of(packed)[force.on], marker_states(packed, load, q[None], qd[None])
    x = [float(np.squeeze(jet.x)) for jet in jets]
    s = np.array(x[:3] if force.on is force.a else x[6:9]) - q[at : at + 3]
    wrench = np.zeros((6, rows.shape[0]))  # for unit multipliers: force, and torque about the point
    wrench[:3] = -rows[:, at : at + 3].T
    if force.on.dimension == 7:
        p = q[at + 3 : at + 7]
        wrench[3:] = -0.5 * rotation_matrix(p) @ transform_g(p) @ rows[:, at + 3 : at + 7].T
    wrench[3:] -= np.cross(s, wrench[:3], axisb=0, axisc=0)
    normal, par = twin(type(force).normal_load), [*load.parameters, 1.0]

    def find(lam):
        f = wrench @ lam[member.rows]
        values = [normal(x, f + COMPLEX_STEP * 1j * e, par) for e in np.eye(6)]
        change = np.zeros(lam.size)
        change[member.rows] = np.imag(values) / COMPLEX_STEP @ wrench
        return np.real(values[0]), change

    return find
