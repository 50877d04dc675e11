"""Phi, Phi_q, Phi_t, gamma and applied forces of a system: one call by address for each kind present."""

import dis
import math

import numpy as np

from ..elements.element import address, checked_parameters
from ..elements.force import Force
from ..elements.laws import SceneLaw
from ..elements.loops.constraint_hessians import SLOPES, STIFFNESS
from ..elements.loops.coordinate_rows import BLOCK, INTS, ROW, STRIDE, call_kind
from ..elements.loops.forces import FORCE_INTS, kept_size
from ..elements.loops.forces import JACOBIAN as FORCE_JACOBIAN_SIGNATURE
from ..elements.loops.template import AT, DIMENSION
from ..errors import InvalidConstraint, InvalidForce
from ..jit.code_hash import is_ours
from ..jit.kernels import caller, entry, kernel
from ..maths.dense_linalg import clear_matrix
from ..motions.prescribed import Motion, call_motion
from ..motions.program import HOLD, call_smooth
from ..motions.signals import Signal, call_signal
from ..motions.tracing import Untraceable, may_change
from .handles import classes, handles_of, inertia_classes, instances_of_kinds
from .laws import demand_callable, interrupts_answered
from .packed import WIDTH, checked_motions, members_of, no_system

call_stiffness, call_slopes = caller(STIFFNESS), caller(SLOPES)
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
def recall(s, memory):
    """Let forces and constraints have the memory (slots,) of an output; none where it is shorter."""
    for i in range(s.memory.size if memory.size >= s.memory.size else 0):
        s.reals[s.memory[i]] = memory[i]


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
def _clear_sums(s, out):
    """out = 0 of rows that several instances add to."""
    for i in range(s.sums.size):
        out[s.sums[i]] = 0.0


@kernel
def clear_rows(s, Phi_q):
    """Phi_q = 0, or its short rows, where several instances add to a row."""
    if s.sums.size > 0:
        clear_matrix(Phi_q)


@kernel
def constraints(s, q, t, Phi):
    """Phi (m,), Eq. 1; time has been set."""
    _clear_sums(s, Phi)
    for i in range(s.kinds.shape[0]):
        _run(s, s.kinds[i], s.kinds[i].phi, q, q, t, Phi)


@kernel
def constraint_jacobian(s, q, t, Phi_q):
    """Phi_q (m, n); entries off the segments are left alone: zero them once."""
    clear_rows(s, Phi_q)
    for i in range(s.kinds.shape[0]):
        _run(s, s.kinds[i], s.kinds[i].jacobian, q, q, t, Phi_q)


@kernel
def time_derivative(s, q, t, Phi_t):
    """Phi_t (m,); rows that don't depend on time are left alone: zero them once."""
    _clear_sums(s, Phi_t)
    for i in range(s.kinds.shape[0]):
        _run(s, s.kinds[i], s.kinds[i].phi_t, q, q, t, Phi_t)


@kernel
def acceleration_bias(s, q, qd, t, gamma):
    """gamma (m,), Eq. 3: Phi_q qdd + gamma = 0."""
    _clear_sums(s, gamma)
    for i in range(s.kinds.shape[0]):
        _run(s, s.kinds[i], s.kinds[i].gamma, q, qd, t, gamma)


@kernel
def inertia_rows(s, q, h):
    """h (i, 14) of the inertia rows: the mass matrix is M + h^T h."""
    for i in range(s.inertias.shape[0]):
        _run(s, s.inertias[i], s.inertias[i].jacobian, q, q, 0.0, h)


@kernel
def inertia_bias(s, q, qd, gamma):
    """gamma (i,) of the inertia rows: h qdd + gamma is the acceleration of their coordinates."""
    for i in range(s.inertias.shape[0]):
        _run(s, s.inertias[i], s.inertias[i].gamma, q, qd, 0.0, gamma)


@kernel
def multiply_inertia_row(s, h, e, x):
    """Return h_e x, x (n,)."""
    total = 0.0
    for side in range(2):
        at = s.inertia_segments[e, 2 * side]
        for c in range(s.inertia_segments[e, 2 * side + 1]):
            total += h[e, 7 * side + c] * x[at + c]
    return total


@kernel
def add_inertia_row(s, h, e, scale, out):
    """out (n,) += scale h_e."""
    for side in range(2):
        at = s.inertia_segments[e, 2 * side]
        for c in range(s.inertia_segments[e, 2 * side + 1]):
            out[at + c] += scale * h[e, 7 * side + c]


@kernel
def constraint_curvature(s, q, qd, qdd, t, lam, K, G1, G2):
    """K += (Phi_q^T lam)_q, G1 = (Phi_q qd + Phi_t)_q, G2 = (Phi_q qdd + gamma)_q; zero G1, G2 once."""
    for i in range(s.kinds.shape[0]):
        kind = s.kinds[i]
        table, reals = s.table[kind.table :], s.reals[kind.reals :]
        call_stiffness(kind.stiffness, kind.count, kind.stride, table, reals, q, t, lam, K)
        call_slopes(kind.slopes, kind.count, kind.stride, table, reals, q, qd, qdd, t, G1, G2)


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
        call_jacobian(kind.jacobian, kind, table, reals, q, qd, t, Q_q, Q_qd, renew, own)


@kernel
def is_rheonomic(s):
    """Whether any row depends on time."""
    return s.rheonomic[0] != 0


@entry(no_system(), "vvdvmvv")
def evaluate_constraints(s, q, qd, t, Phi, Phi_q, Phi_t, gamma):
    """Fill Phi (m,), Phi_q (m, n), Phi_t (m,) and gamma (m,); the last three are zero on entry."""
    set_time(s, t)
    constraints(s, q, t, Phi)
    constraint_jacobian(s, q, t, Phi_q)
    time_derivative(s, q, t, Phi_t)
    acceleration_bias(s, q, qd, t, gamma)


def constraint_arrays(system, q, qd, t, width=None):
    """Return Phi, Phi_q, Phi_t and gamma by the kernels; width: length of short rows."""
    system = system._replace(reals=system.reals.copy())  # kernels write motions there
    lines, n = system.segments.shape[0], width or q.size
    m = lines - (system.tails.size if width else 0)
    Phi, Phi_q, Phi_t, gamma = np.zeros(m), np.zeros((lines, n)), np.zeros(m), np.zeros(m)
    evaluate_constraints(system, q, qd, float(t), Phi, Phi_q, Phi_t, gamma)
    return Phi, Phi_q, Phi_t, gamma


@entry(no_system(), "mmmm")
def _fill_inertia_rows(s, q, qd, h, gamma):
    """h (k, 14 i) and gamma (k, i) of the inertia rows at states q, qd (k, n)."""
    for k in range(q.shape[0]):
        inertia_rows(s, q[k], h[k].reshape(-1, WIDTH))
        inertia_bias(s, q[k], qd[k], gamma[k])


def added_inertia(system, q, qd):
    """Yield of each inertia row its columns (c,), h (k, c) and gamma (k,) at states q, qd (k, n): M + h^T h."""
    count = len(system.inertia_segments)
    if count:
        h, gamma = np.zeros((len(q), WIDTH * count)), np.zeros((len(q), count))
        _fill_inertia_rows(system, q, qd, h, gamma)
        used = np.arange(WIDTH // 2) < system.inertia_segments[:, 1::2, None]
        columns = system.inertia_segments[:, ::2, None] + np.arange(WIDTH // 2)
        for i in range(count):
            yield columns[i][used[i]], h.reshape(-1, count, *used[i].shape)[:, i][:, used[i]], gamma[:, i]


# Sparse Phi_q: 14 numbers a row, 7 for body a and 7 for body b; storage and products cost O(N). A row that is a sum has
# 14 numbers for each of its terms: those of the first in its own place, those of the `tails` behind all rows.


def with_short_rows(packed):
    """The system, to whose kernels Phi_q is an array (m, 14); made once."""
    known = packed.derived
    if known.short_rows is None:
        system = packed.system
        table, m = system.table.copy(), len(system.segments)
        segments = np.concatenate((system.segments, np.zeros((system.tails.size, 4), np.int64)))
        tail = {id(part): m + i for i, part in enumerate(part for part in packed.constraints if not part.all_rows)}
        for kind, members in zip(system.kinds, instances_of_kinds(packed), strict=True):
            first, count = kind.table, kind.count
            own = table[first : first + INTS * count].reshape(count, INTS)
            line = own[:, ROW]
            if members[0].summed:
                line = np.array([tail.get(id(part), row) for part, row in zip(members, line, strict=True)])
                segments[line] = own[:, [AT, DIMENSION, AT + 1, DIMENSION + 1]]
            own[:, BLOCK] = WIDTH * line
            own[:, BLOCK + 1] = WIDTH * line + WIDTH // 2
            own[:, STRIDE] = WIDTH
        known.short_rows = system._replace(table=table, segments=segments)
    return known.short_rows


def places(packed):
    """Where in q the two halves of each short row belong, (lines, 2), and their lengths, (lines, 2)."""
    segments = with_short_rows(packed).segments
    return segments[:, 0::2].copy(), segments[:, 1::2].copy()


def as_csr(packed, rows):
    """Phi_q (m, n) as a SciPy sparse array, of short rows (lines, 14)."""
    from scipy.sparse import csr_array

    at, length = places(packed)
    half = np.arange(WIDTH // 2)
    columns = (at[:, :, None] + half).reshape(len(at), WIDTH)
    used = (half < length[:, :, None]).reshape(len(at), WIDTH)
    system, m = packed.system, len(packed.system.segments)
    i = np.broadcast_to(np.concatenate((np.arange(m), system.tails))[:, None], used.shape)
    n = int(system.bodies[:, 1].sum())
    return csr_array((rows[used], (i[used], columns[used])), shape=(m, n))


# Samples of forces that depend on time by a function or a law of the user's, at states that stay the same.


@entry(no_system(), "vvvwvv")
def _sample(s, q, qd, t, at, Q, out):
    """out (k,): sums of all forces on the coordinates `at`, at times t (k,); Q (n,): zeros.

    Weights 1 + 0.37 j: forces that cancel in a plain sum, such as those on both ends of a load, don't.
    """
    set_time(s, t[0])
    for i in range(t.size):
        for j in range(s.forces.shape[0]):
            kind = s.forces[j]
            call_kind(kind.force, kind.count, kind.stride, s.table[kind.table :], s.reals[kind.reals :], q, qd, t[i], Q)
        total = 0.0
        for j in range(at.size):
            total += (1.0 + 0.37 * j) * Q[at[j]]
            Q[at[j]] = 0.0
        out[i] = total


def is_of_user(item):
    """Whether the law of a force, or a function of time and state in it, is a user's."""
    return hasattr(item, "function_of_state") or not is_ours(type(item).__module__)


def changes_with_state(load):
    """Whether the law of a `Load` is a user's, and may change within any part of a step."""
    force = load.force
    if load.law is not None:
        return load.law.changes
    if not is_of_user(force) or "normal_load" in force.kernels:
        return False
    try:
        return not hasattr(force.kernels, "program") or may_change(force.kernels.program(len(load.parameters)))
    except Untraceable:
        return True


def depends_on_time(force):
    """Whether what a user has written for a force reads the time."""
    function, place = (force.function_of_state, 0) if hasattr(force, "function_of_state") else (type(force).law, 3)
    code = getattr(getattr(function, "py_func", function), "__code__", None)
    if code is None:  # an object to be called
        return True
    t = code.co_varnames[place]
    read = [each.argval for each in dis.get_instructions(code) if "LOAD" in each.opname]  # pairs in some versions
    return any(t == name or (isinstance(name, tuple) and t in name) for name in read)


def user_kinds(packed):
    """The rows of System.forces that run what a user has written: their numbers, a force of each."""
    return [(i, load.force) for i, load in enumerate(_first(packed)) if is_of_user(load.force)]


def _first(packed):
    """A `Load` of each row of System.forces."""
    first = {int(load.alone[0].reals): load for load in packed.loads}
    return [first[int(row.reals)] for row in packed.system.forces]


def _spans(system, row):
    """Where the coordinates begin that the forces of a kind act on, and how many they are, (k, 2)."""
    places = system.table[row.table : row.table + row.count * FORCE_INTS].reshape(-1, FORCE_INTS)
    return np.column_stack((places[:, AT : AT + 2].ravel(), places[:, DIMENSION : DIMENSION + 2].ravel()))


def watched_loads(packed):
    """Rows of System.forces that are sampled along steps (k,), and the bodies that they act on (nb,)."""
    rows = [i for i, load in enumerate(_first(packed)) if changes_with_state(load)]
    found = [_spans(packed.system, packed.system.forces[i]) for i in rows]
    begins = np.unique([begin for spans in found for begin, size in spans if size])
    bodies = np.searchsorted(packed.system.bodies[:, 0], begins)
    return np.array(rows, np.int64), bodies.astype(np.int64)


def sampled_loads(packed, kinds, t):
    """Titles of the forces of each kind, and their sums (k,) at times t (k,): at the bodies' start, and nearby.

    At the start a force may be zero at all times that is not so in motion. Nearby all coordinates differ by up to a
    half, of any unit; where the function is not finite there, that state is left out.
    """
    system, found = packed.system, []
    if not kinds:
        return found
    q, qd = (np.concatenate([getattr(body, x) for body in packed.bodies]) for x in ("q", "qd"))
    near = 0.5 * np.cos(np.arange(q.size))
    for i, force in kinds:
        spans = _spans(system, system.forces[i])
        at = np.unique(np.concatenate([np.arange(begin, begin + size) for begin, size in spans]))
        own = system._replace(forces=system.forces[i : i + 1], reals=system.reals.copy())
        for move in (0.0, near):
            out = np.empty(t.size)
            with interrupts_answered():
                _sample(own, q + move, qd + move, t, at, np.zeros(q.size), out)
            if move is not near or np.isfinite(out).all():
                found.append((force.title, out))
    return found


# Compilation of a user's functions where their owner is added, so that they are refused there.


def demand_compilable(item):
    """Compile the user's functions of a constraint or force.

    Raises
    ------
    InvalidConstraint, InvalidForce
        If Numba can't compile one; what Numba says is the cause.
    """
    if not isinstance(item, Force):
        for part in item.parts:
            for value in checked_motions(part):
                if isinstance(value, Motion):
                    value.addresses  # noqa: B018  compiled when asked for
        return
    for value in checked_parameters(item, Signal, "loads"):
        if isinstance(value, Signal) and value.is_function:
            value.address  # noqa: B018
    if isinstance(item, SceneLaw):
        if item.period is None:
            packed = item.scene.packed
            handles, start = handles_of(packed), item.scene.start
            demand_callable(item, handles, 0.0, *start, handles.angles_at_start(0.0, start[0]))
        return
    if item.kernels is not item.own_kernels or not is_ours(type(item).__module__):
        address(item.kernels, "force", item.name, item.error, getattr(item, "hint", ""))


def with_force_jacobians(packed, n=0):
    """The system of a packed scene with the forces' Jacobian loops, which are loaded now; and the floats they keep.

    Their matrices have n columns, by default as many as q.
    """
    rows, total, n = packed.system.forces.copy(), 0, n or int(packed.system.bodies[:, 1].sum())
    for row in rows:
        force = members_of(row, packed.loads)[0].force
        row.jacobian, row.kept, row.columns = address(force.kernels, "jacobian", force.name, InvalidForce), total, n
        total += row.count * kept_size(force.markers)
    return packed.system._replace(forces=rows), int(total)


def second_derivatives(basis_free):
    """What implicit methods load of constraint_hessians.py, by its names in `ConstraintKind`."""
    return ("stiffness",) if basis_free else ("stiffness", "slopes")


def with_curvatures(packed, basis_free=False):
    """The system with the kernels of second derivatives, which only implicit methods load."""
    kinds, inertias = packed.system.kinds.copy(), packed.system.inertias.copy()
    for name in second_derivatives(basis_free):
        kinds[name] = [address(kind.kernels, name, kind.__name__, InvalidConstraint) for kind in classes(packed)]
        inertias[name] = [
            address(row.kernels, name, row.__name__, InvalidConstraint) for row in inertia_classes(packed)
        ]
    return packed.system._replace(kinds=kinds, inertias=inertias)
