"""Phi, Phi_q, Phi_t, gamma and applied forces of a system: one call by address for each kind present."""

import math

from ..elements.loops.constraint_hessians import SIGNATURE as CURVATURE_SIGNATURE
from ..elements.loops.coordinate_rows import call_kind
from ..elements.loops.forces import JACOBIAN as FORCE_JACOBIAN_SIGNATURE
from ..jit.kernels import caller, entry, kernel
from ..motions.prescribed import call_motion
from ..motions.program import HOLD, call_smooth
from ..motions.signals import call_signal
from .packed import COUNT, CURVATURE, FIRST_INT, FIRST_REAL, GAMMA, JACOBIAN, PHI, PHI_T, REALS
from .packed_forces import F_COUNT, F_FIRST_INT, F_FIRST_REAL, F_KEPT, F_REALS, F_REMEMBER, FORCE, FORCE_JACOBIAN

call_curvature = caller(CURVATURE_SIGNATURE)

call_jacobian = caller(FORCE_JACOBIAN_SIGNATURE)


@kernel
def set_time(s, t):
    """Write every motion (value, rate, acceleration) and signal at t to its places; False where one is not finite."""
    total = 0.0
    for i in range(s.motions.shape[0]):
        place = s.motions[i, 3]
        if s.motions[i, 1] == 0:
            call_smooth(s.motions[i, 0], s.reals[s.motions[i, 4] :], t, 3, s.reals[place:])
            s.reals[place + 2] *= 2.0
        for j in range(3):
            if s.motions[i, 1] != 0:
                s.reals[place + j] = call_motion(s.motions[i, j], t)
            total += abs(s.reals[place + j])
    for i in range(s.signals.shape[0]):
        address, place, width, first = s.signals[i]
        if first >= 0:
            call_smooth(address, s.reals[first:], t, 1, s.reals[place:])
        else:
            call_signal(address, t, s.reals[place:])
        for j in range(width):
            total += abs(s.reals[place + j])
    return total < math.inf


@kernel
def hold_pieces(s, t):
    """Let piecewise motions and signals stay with their pieces at t, whatever time is set from now on."""
    for i in range(s.motions.shape[0]):
        if s.motions[i, 1] == 0:
            call_smooth(s.motions[i, 0], s.reals[s.motions[i, 4] :], t, HOLD, s.reals)
    for i in range(s.signals.shape[0]):
        address, _, _, first = s.signals[i]
        if first >= 0:
            call_smooth(address, s.reals[first:], t, HOLD, s.reals)


@kernel
def _run(s, column, q, qd, t, out):
    for i in range(s.kinds.shape[0]):
        if s.kinds[i, column] != 0:
            table, reals = s.table[s.kinds[i, FIRST_INT] :], s.reals[s.kinds[i, FIRST_REAL] :]
            call_kind(s.kinds[i, column], s.kinds[i, COUNT], s.kinds[i, REALS], table, reals, q, qd, t, out)


@kernel
def constraints(s, q, t, Phi):
    """Phi (m,), Eq. 1; time has been set."""
    _run(s, PHI, q, q, t, Phi)


@kernel
def constraint_jacobian(s, q, t, Phi_q):
    """Phi_q (m, n); entries off the segments are left alone: zero them once."""
    _run(s, JACOBIAN, q, q, t, Phi_q)


@kernel
def time_derivative(s, q, t, Phi_t):
    """Phi_t (m,); rows that don't depend on time are left alone: zero them once."""
    _run(s, PHI_T, q, q, t, Phi_t)


@kernel
def acceleration_bias(s, q, qd, t, gamma):
    """gamma (m,), Eq. 3: Phi_q qdd + gamma = 0."""
    _run(s, GAMMA, q, qd, t, gamma)


@kernel
def constraint_curvature(s, q, qd, qdd, t, lam, K, G1, G2):
    """K += (Phi_q^T lam)_q, G1 = (Phi_q qd + Phi_t)_q, G2 = (Phi_q qdd + gamma)_q; zero G1, G2 once."""
    for i in range(s.kinds.shape[0]):
        table, reals = s.table[s.kinds[i, FIRST_INT] :], s.reals[s.kinds[i, FIRST_REAL] :]
        call_curvature(
            s.kinds[i, CURVATURE], s.kinds[i, COUNT], s.kinds[i, REALS], table, reals,
            q, qd, qdd, t, lam, q.size, K, G1, G2,
        )  # fmt: skip


@kernel
def _run_forces(s, column, q, qd, t, out):
    for i in range(s.forces.shape[0]):
        kind = s.forces[i]
        if kind[column] != 0:
            table, reals = s.table[kind[F_FIRST_INT] :], s.reals[kind[F_FIRST_REAL] :]
            call_kind(kind[column], kind[F_COUNT], kind[F_REALS], table, reals, q, qd, t, out)


@kernel
def applied_forces(s, q, qd, t, Q):
    """Q (n,) += all forces but gravity; time has been set."""
    _run_forces(s, FORCE, q, qd, t, Q)


@kernel
def remember(s, q, qd, t, out):
    """Let the forces and constraints that do remember this accepted point; out (slots,) is what they remember."""
    if s.memory.size > 0:
        _run_forces(s, F_REMEMBER, q, qd, t, out)
        for i in range(s.counters.shape[0]):
            address, count, stride, table, reals = s.counters[i]
            call_kind(address, count, stride, s.table[table:], s.reals[reals:], q, qd, t, out)
        for i in range(s.memory.size):
            out[i] = s.reals[s.memory[i]]


@kernel
def force_jacobian(s, q, qd, t, Q_q, Q_qd, anew, kept):
    """Q_q, Q_qd (n, n) += the Jacobians of all forces but gravity, of a system from `with_force_jacobians`.

    anew is 1 to take the derivatives of the laws and keep them, 0 to use those kept.
    """
    for i in range(s.forces.shape[0]):
        kind = s.forces[i]
        table, reals = s.table[kind[F_FIRST_INT] :], s.reals[kind[F_FIRST_REAL] :]
        call_jacobian(
            kind[FORCE_JACOBIAN], kind[F_COUNT], kind[F_REALS], table, reals,
            q, qd, t, q.size, Q_q, Q_qd, anew, kept[kind[F_KEPT] :],
        )  # fmt: skip


@kernel
def is_rheonomic(s):
    """Whether any row depends on time."""
    return s.rheonomic[0] != 0


@entry
def evaluate_constraints(s, q, qd, t, Phi, Phi_q, Phi_t, gamma):
    """Fill Phi (m,), Phi_q (m, n), Phi_t (m,) and gamma (m,); the last three are zero on entry."""
    set_time(s, t)
    constraints(s, q, t, Phi)
    constraint_jacobian(s, q, t, Phi_q)
    time_derivative(s, q, t, Phi_t)
    acceleration_bias(s, q, qd, t, gamma)
