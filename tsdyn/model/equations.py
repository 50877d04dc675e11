"""Phi, Phi_q, Phi_t, gamma and applied forces of a system: one call by address for each kind present."""

import math

from ..elements.loops.constraint_hessians import SIGNATURE as CURVATURE_SIGNATURE
from ..elements.loops.coordinate_rows import call_kind
from ..elements.loops.forces import JACOBIAN as FORCE_JACOBIAN_SIGNATURE
from ..jit.kernels import caller, entry, kernel
from ..motions.prescribed import call_motion
from ..motions.program import HOLD, call_smooth
from ..motions.signals import call_signal

call_curvature = caller(CURVATURE_SIGNATURE)

call_jacobian = caller(FORCE_JACOBIAN_SIGNATURE)


@kernel
def set_time(s, t):
    """Write every motion (value, rate, acceleration) and signal at t to its places; False where one is not finite."""
    total = 0.0
    for i in range(s.motions.shape[0]):
        motion = s.motions[i]
        out = s.reals[motion.place :]
        if motion.rate == 0:
            call_smooth(motion.value, s.reals[motion.program :], t, 3, out)
            out[2] *= 2.0
        else:
            out[0] = call_motion(motion.value, t)
            out[1] = call_motion(motion.rate, t)
            out[2] = call_motion(motion.acceleration, t)
        for j in range(3):
            total += abs(out[j])
    for i in range(s.signals.shape[0]):
        signal = s.signals[i]
        if signal.program >= 0:
            call_smooth(signal.address, s.reals[signal.program :], t, 1, s.reals[signal.place :])
        else:
            call_signal(signal.address, t, s.reals[signal.place :])
        for j in range(signal.width):
            total += abs(s.reals[signal.place + j])
    return total < math.inf


@kernel
def hold_pieces(s, t):
    """Let piecewise motions and signals stay with their pieces at t, whatever time is set from now on."""
    for i in range(s.motions.shape[0]):
        if s.motions[i].rate == 0:
            call_smooth(s.motions[i].value, s.reals[s.motions[i].program :], t, HOLD, s.reals)
    for i in range(s.signals.shape[0]):
        if s.signals[i].program >= 0:
            call_smooth(s.signals[i].address, s.reals[s.signals[i].program :], t, HOLD, s.reals)


@kernel
def _run(s, kind, address, q, qd, t, out):
    """Run one loop over the instances of a kind, if there is one."""
    if address != 0:
        call_kind(address, kind.count, kind.stride, s.table[kind.table :], s.reals[kind.reals :], q, qd, t, out)


@kernel
def constraints(s, q, t, Phi):
    """Phi (m,), Eq. 1; time has been set."""
    for i in range(s.kinds.shape[0]):
        _run(s, s.kinds[i], s.kinds[i].phi, q, q, t, Phi)


@kernel
def constraint_jacobian(s, q, t, Phi_q):
    """Phi_q (m, n); entries off the segments are left alone: zero them once."""
    for i in range(s.kinds.shape[0]):
        _run(s, s.kinds[i], s.kinds[i].jacobian, q, q, t, Phi_q)


@kernel
def time_derivative(s, q, t, Phi_t):
    """Phi_t (m,); rows that don't depend on time are left alone: zero them once."""
    for i in range(s.kinds.shape[0]):
        _run(s, s.kinds[i], s.kinds[i].phi_t, q, q, t, Phi_t)


@kernel
def acceleration_bias(s, q, qd, t, gamma):
    """gamma (m,), Eq. 3: Phi_q qdd + gamma = 0."""
    for i in range(s.kinds.shape[0]):
        _run(s, s.kinds[i], s.kinds[i].gamma, q, qd, t, gamma)


@kernel
def constraint_curvature(s, q, qd, qdd, t, lam, K, G1, G2):
    """K += (Phi_q^T lam)_q, G1 = (Phi_q qd + Phi_t)_q, G2 = (Phi_q qdd + gamma)_q; zero G1, G2 once."""
    for i in range(s.kinds.shape[0]):
        kind = s.kinds[i]
        table, reals = s.table[kind.table :], s.reals[kind.reals :]
        call_curvature(kind.curvature, kind.count, kind.stride, table, reals, q, qd, qdd, t, lam, K, G1, G2)


@kernel
def applied_forces(s, q, qd, t, Q):
    """Q (n,) += all forces but gravity; time has been set."""
    for i in range(s.forces.shape[0]):
        _run(s, s.forces[i], s.forces[i].force, q, qd, t, Q)


@kernel
def remember(s, q, qd, t, out):
    """Let the forces and constraints that do remember this accepted point; out (slots,) is what they remember."""
    if s.memory.size > 0:
        for i in range(s.forces.shape[0]):
            _run(s, s.forces[i], s.forces[i].remember, q, qd, t, out)
        for i in range(s.kinds.shape[0]):
            _run(s, s.kinds[i], s.kinds[i].remember, q, qd, t, out)
        for i in range(s.memory.size):
            out[i] = s.reals[s.memory[i]]


@kernel
def force_jacobian(s, q, qd, t, Q_q, Q_qd, renew, kept):
    """Q_q, Q_qd (n, n) += the Jacobians of all forces but gravity, of a system from `with_force_jacobians`.

    renew is 1 to evaluate and store the derivatives of the laws, 0 to use the stored ones.
    """
    for i in range(s.forces.shape[0]):
        kind = s.forces[i]
        table, reals, own = s.table[kind.table :], s.reals[kind.reals :], kept[kind.kept :]
        call_jacobian(kind.jacobian, kind.count, kind.stride, table, reals, q, qd, t, q.size, Q_q, Q_qd, renew, own)


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
