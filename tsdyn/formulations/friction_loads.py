"""Joint friction, shared by all forms: forces for unit normal load, normal loads, convergence of the loads."""

from ..elements.loops.forces import INTS
from ..elements.loops.friction import call_load_slope, call_normal_load, call_unit_friction
from ..jit.kernels import caller, kernel
from .tolerances import DAMPED, DAMPED_SHARE

SOLVE_FRICTION = "pdp"  # context, t, vdd where the form has a basis: solves for friction and accelerations
call_friction = caller(SOLVE_FRICTION)


@kernel
def body_of(friction, side):
    """The body of a side, 0 for a and 1 for b."""
    return friction.body_a if side == 0 else friction.body_b


@kernel
def _instance(system, friction):
    """Floats of the instance; where its table and its floats begin."""
    kind = system.forces[friction.kind]
    index = friction.index
    return kind.stride, kind.table + INTS * index, kind.reals + kind.stride * index


@kernel
def unit_friction(system, friction, q, qd, t, out):
    """out (14,) = generalised forces on the bodies a and b, for a normal load of one."""
    stride, own, real = _instance(system, friction)
    call_unit_friction(friction.unit, stride, system.table[own:], system.reals[real:], q, qd, t, out)


@kernel
def normal_load(system, friction, q, qd, t, derive, reaction, out):
    """out (7,) = the normal load of a reaction (6,) and, with derive = 1, its derivative by that."""
    stride, own, real = _instance(system, friction)
    call_normal_load(
        friction.normal, stride, system.table[own:], system.reals[real:], q, qd, t, friction.on, derive,
        reaction, out,
    )  # fmt: skip


@kernel
def load_slope(system, slope, friction, q, qd, t, reaction, out):
    """out (13,) = the same by the series of the load, whose kernel is at `slope`; then the reaction about the point."""
    stride, own, real = _instance(system, friction)
    call_load_slope(slope, stride, system.table[own:], system.reals[real:], q, qd, t, friction.on, reaction, out)


@kernel
def forget_loads(system):
    """Set joint friction to zero in the sum of forces."""
    for i in range(system.normals.size):
        system.reals[system.normals[i]] = 0.0


@kernel
def step_share(sweep):
    """Return the share of a Newton correction of the loads that is applied."""
    return 1.0 if sweep < DAMPED else DAMPED_SHARE


@kernel
def has_converged(change, before, share, sweep, least):
    """Return True if a correction is at most `least`, or if quadratic convergence makes the next one so."""
    return change <= least or (share == 1.0 and sweep > 0 and change * change <= least * before)
