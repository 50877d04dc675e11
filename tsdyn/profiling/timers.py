"""Timers: callbacks that wrap callbacks, so that profiling needs no change of a kernel; what a timer costs."""

import ctypes
import sys
import time

import numpy as np

from ..elements.loops.constraint_rows import SIGNATURE as BODY_LOOP
from ..elements.loops.constraint_rows import call_body_loop
from ..elements.loops.constraint_series import SIGNATURE as SERIES
from ..elements.loops.constraint_series import call_series
from ..elements.loops.coordinate_rows import SIGNATURE as LOOP
from ..elements.loops.coordinate_rows import call_kind
from ..jit.kernels import (
    ANY,
    HAS_CYCLES,
    Callback,
    caller,
    cycles,
    data_of,
    entry,
    integers,
    kernel,
    specialised,
    vector,
)
from ..methods.collocation_step import call_balance, call_factorise, call_solve
from ..methods.diagonally_implicit import call_correct, call_reduce, call_residual, call_soften
from ..methods.explicit import ACCELERATE as ACCELERATE_SIGNATURE
from ..methods.explicit import NORM as NORM_SIGNATURE
from ..methods.explicit import PLACE as PLACE_SIGNATURE
from ..methods.explicit import STEP as STEP_SIGNATURE
from ..methods.explicit import call_accelerate, call_norm, call_place, call_step
from ..runs.dense_output import call_chart, call_complete
from ..runs.stepper import call_check
from ..taylor.step_parts import call_expand, call_reach

# Timers: callbacks that wrap callbacks, so that profiling needs no change of a kernel.
#
# A profiled run replaces each called address by the address of a timer. The timer reads the clock, calls the original
# and reads the clock again; time between two readings is attributed to the phase that was running, so the phases add up
# to the whole run. A timer finds its record through a word stored in front of its argument: the context, or the table
# of a kind of constraint or force.

# roles: the driver, and the kernels called by address; ROWS is any loop over constraints or forces
DRIVER, PLACE, ACCELERATE, COMPLETE, CHECK, CHART, STEP, NORM = range(8)
LINEARISE, REDUCE, FACTORISE, SOLVE, SOFTEN, EXPAND, REACH = range(8, 15)
RESIDUAL, CORRECT, DISTANCE, BALANCE, FACTORISE_STAGES, SOLVE_STAGES, ROWS, ROLES = range(15, 23)
# roles of the kernels whose addresses drivers are given, by their names in `Kernels` and `StageKernels`
OF_DRIVERS = {
    "place": PLACE,
    "accelerate": ACCELERATE,
    "complete": COMPLETE,
    "check": CHECK,
    "start_chart": CHART,
    "step": STEP,
    "error_norm": NORM,
    "expand": EXPAND,
    "reach": REACH,
}
OF_STAGES = {
    "linearise": LINEARISE,
    "reduce": REDUCE,
    "factorise": FACTORISE,
    "solve": SOLVE,
    "soften": SOFTEN,
    "error_norm": NORM,
    "residual": RESIDUAL,
    "correct": CORRECT,
    "distance": DISTANCE,
    "balance_stage": BALANCE,
    "factorise_stages": FACTORISE_STAGES,
    "solve_stages": SOLVE_STAGES,
}
# the notes: the clock where the processor has none, what it is given first, what it writes, the factor of its first
# number; the time last read; the slot and role of what runs in what; addresses that timers stand for; then the slots:
# pairs of calls and time
CLOCK, FIRST, BUFFER, SCALE, LAST, DEPTH, STACK, DEEPEST = 0, 1, 2, 4, 5, 6, 7, 32
TARGETS = STACK + 2 * DEEPEST
SLOTS = TARGETS + ROLES
# slots: role by the role it runs in, the orders of series, then kinds, by loop and by the role they run in
ORDERS = 40
FIRST_ORDER = ROLES * ROLES
FIRST_KIND = FIRST_ORDER + ORDERS
# before the table of a kind: where the notes are, its first slot, and the loops that timers stand for: those of
# constraints at 0 to 3, or of forces at 0 and 1, and of series, whose mode says which slot, at 4
T_NOTES, T_SLOT, T_LOOPS, IN_ORDERS, LOOPS, HEADER = 0, 1, 2, 4, 6, 8

call_clock = caller("pp")


@kernel
def _now(notes):
    """Return the time, in units of the clock."""
    if notes[CLOCK] == 0:
        return cycles()
    call_clock(notes[CLOCK], notes[FIRST], data_of(notes) + 8 * BUFFER)
    return notes[BUFFER] * notes[SCALE] + notes[BUFFER + 1]


@kernel
def _enter(notes, slot, role):
    """Attribute time to a slot from now on, offset by the role that was running."""
    now, top = _now(notes), notes[DEPTH]
    running = STACK + 2 * top
    slot += notes[running + 1]
    notes[SLOTS + 2 * notes[running] + 1] += now - notes[LAST]
    notes[running + 2], notes[running + 3] = slot, role
    notes[SLOTS + 2 * slot] += 1
    notes[DEPTH], notes[LAST] = top + 1, now


@kernel
def _leave(notes):
    """Return to the slot that was running before."""
    now, top = _now(notes), notes[DEPTH]
    notes[SLOTS + 2 * notes[STACK + 2 * top] + 1] += now - notes[LAST]
    notes[DEPTH], notes[LAST] = top - 1, now


@kernel
def _before(context):
    return integers(context - 8, 1)[0]


# The templates; ROLE and COLUMN are filled in by `_timer`. Each has the arguments of the kernels that it stands for.
ROLE = COLUMN = 0


def _place(context, t, x):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    status = call_place(notes[TARGETS + ROLE], context, t, x)
    _leave(notes)
    return status


def _accelerate(context, t, y, yd, xd):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    status = call_accelerate(notes[TARGETS + ROLE], context, t, y, yd, xd)
    _leave(notes)
    return status


def _vector(context, x):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    status = call_complete(notes[TARGETS + ROLE], context, x)
    _leave(notes)
    return status


def _alone(context):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    status = call_check(notes[TARGETS + ROLE], context)
    _leave(notes)
    return status


def _chart(context, t, x, y, yd, xd):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    status = call_chart(notes[TARGETS + ROLE], context, t, x, y, yd, xd)
    _leave(notes)
    return status


def _step(context, run, t, h):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    status = call_step(notes[TARGETS + ROLE], context, run, t, h)
    _leave(notes)
    return status


def _norm(context, ex, ey, old, rtol, atol):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    size = call_norm(notes[TARGETS + ROLE], context, ex, ey, old, rtol, atol)
    _leave(notes)
    return size


def _number(context, x):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    status = call_reduce(notes[TARGETS + ROLE], context, x)
    _leave(notes)
    return status


def _soften(context, x, g, y):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    status = call_soften(notes[TARGETS + ROLE], context, x, g, y)
    _leave(notes)
    return status


def _residual(context, t, g, x, y, k):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    status = call_residual(notes[TARGETS + ROLE], context, t, g, x, y, k)
    _leave(notes)
    return status


def _correct(context, g, k):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    size = call_correct(notes[TARGETS + ROLE], context, g, k)
    _leave(notes)
    return size


def _balance(context, i, k):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    status = call_balance(notes[TARGETS + ROLE], context, i, k)
    _leave(notes)
    return status


def _factorise_stages(context, h, tableau, i):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    status = call_factorise(notes[TARGETS + ROLE], context, h, tableau, i)
    _leave(notes)
    return status


def _solve_stages(context, h, tableau, memory):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    size = call_solve(notes[TARGETS + ROLE], context, h, tableau, memory)
    _leave(notes)
    return size


def _expand(context, start, end):
    notes, status = integers(_before(context), ANY), 0
    for k in range(start, end):
        _enter(notes, FIRST_ORDER + min(k, ORDERS - 1), ROLE)
        status = call_expand(notes[TARGETS + ROLE], context, k, k + 1)
        _leave(notes)
    return status


def _reach(context, t, h):
    notes = integers(_before(context), ANY)
    _enter(notes, ROLE * ROLES, ROLE)
    status = call_reach(notes[TARGETS + ROLE], context, t, h)
    _leave(notes)
    return status


def _loop(count, stride, table, reals, q, qd, t, out):
    header = integers(table - 8 * HEADER, HEADER)
    notes = integers(header[T_NOTES], ANY)
    _enter(notes, header[T_SLOT] + COLUMN * ROLES, ROWS)
    status = call_kind(header[T_LOOPS + COLUMN], count, stride, table, reals, q, qd, t, out)
    _leave(notes)
    return status


def _body_loop(count, stride, table, reals, poses, unused, t, out, H):
    header = integers(table - 8 * HEADER, HEADER)
    notes = integers(header[T_NOTES], ANY)
    _enter(notes, header[T_SLOT] + COLUMN * ROLES, ROWS)
    status = call_body_loop(header[T_LOOPS + COLUMN], count, stride, table, reals, poses, unused, t, out, H)
    _leave(notes)
    return status


def _series(mode, k, kind, table, reals, bodies, values, b, Z):
    header = integers(table - 8 * HEADER, HEADER)
    notes = integers(header[T_NOTES], ANY)
    part = mode if mode < LOOPS - IN_ORDERS else 0  # of a force it is the address of what runs its program
    _enter(notes, header[T_SLOT] + (IN_ORDERS + part) * ROLES, ROWS)
    status = call_series(header[T_LOOPS + IN_ORDERS], mode, k, kind, table, reals, bodies, values, b, Z)
    _leave(notes)
    return status


def _timer(template, signature, name, result="i", **constants):
    return Callback(specialised(template, f"time_{name}", template, **constants), signature, result)


# by role
TIMERS = {
    PLACE: _timer(_place, PLACE_SIGNATURE, "place", ROLE=PLACE),
    ACCELERATE: _timer(_accelerate, ACCELERATE_SIGNATURE, "accelerate", ROLE=ACCELERATE),
    COMPLETE: _timer(_vector, "pp", "complete", ROLE=COMPLETE),
    CHECK: _timer(_alone, "p", "check", ROLE=CHECK),
    CHART: _timer(_chart, "pdpppp", "chart", ROLE=CHART),
    STEP: _timer(_step, STEP_SIGNATURE, "step", ROLE=STEP),
    NORM: _timer(_norm, NORM_SIGNATURE, "norm", "d", ROLE=NORM),
    LINEARISE: _timer(_place, PLACE_SIGNATURE, "linearise", ROLE=LINEARISE),
    REDUCE: _timer(_number, "pd", "reduce", ROLE=REDUCE),
    FACTORISE: _timer(_number, "pd", "factorise", ROLE=FACTORISE),
    SOLVE: _timer(_vector, "pp", "solve", ROLE=SOLVE),
    SOFTEN: _timer(_soften, "ppdp", "soften", ROLE=SOFTEN),
    RESIDUAL: _timer(_residual, "pddppp", "residual", ROLE=RESIDUAL),
    CORRECT: _timer(_correct, "pdp", "correct", "d", ROLE=CORRECT),
    DISTANCE: _timer(_norm, NORM_SIGNATURE, "distance", "d", ROLE=DISTANCE),
    BALANCE: _timer(_balance, "pip", "balance", ROLE=BALANCE),
    FACTORISE_STAGES: _timer(_factorise_stages, "pdpi", "factorise_stages", ROLE=FACTORISE_STAGES),
    SOLVE_STAGES: _timer(_solve_stages, "pdpp", "solve_stages", "d", ROLE=SOLVE_STAGES),
    EXPAND: _timer(_expand, "pii", "expand", ROLE=EXPAND),
    REACH: _timer(_reach, "pdd", "reach", ROLE=REACH),
}
# by column
LOOP_TIMERS = [_timer(_loop, LOOP, f"loop_{column}", COLUMN=column) for column in range(IN_ORDERS)]
BODY_TIMERS = [_timer(_body_loop, BODY_LOOP, f"body_loop_{column}", COLUMN=column) for column in range(IN_ORDERS)]
SERIES_TIMER = _timer(_series, SERIES, "series")


def new_notes(kinds):
    """Return the notes of a run, for a number of kinds of constraints and forces."""
    notes = np.zeros(SLOTS + 2 * (FIRST_KIND + kinds * LOOPS * ROLES), np.int64)
    if HAS_CYCLES:
        return notes
    if sys.platform == "win32":
        function = ctypes.windll.kernel32.QueryPerformanceCounter
        notes[FIRST], notes[SCALE] = notes.ctypes.data + 8 * BUFFER, 1
    else:
        function = ctypes.CDLL(None).clock_gettime
        notes[FIRST], notes[SCALE] = time.CLOCK_MONOTONIC, 10**9
    notes[CLOCK] = ctypes.cast(function, ctypes.c_void_p).value
    return notes


@entry
def start(notes):
    """Start the clock of the driver."""
    notes[DEPTH] = 0
    notes[LAST] = _now(notes)


@entry
def stop(notes):
    """Stop the clock of the driver."""
    now = _now(notes)
    notes[SLOTS + 1] += now - notes[LAST]


# The cost of a timer, by calls of a little callback with and without one.


@entry
def _call_often(address, context, count):
    for _ in range(count):
        call_check(address, context)


LITTLE = 20  # numbers


def _do_little(context):
    """Work of a typical callback: it hides part of the cost of a reading."""
    x = vector(context, LITTLE)
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for i in range(0, LITTLE, 4):
        a += x[i] * x[i + 1]
        b += x[i + 1] * x[i + 2]
        c += x[i + 2] * x[i + 3]
        d += x[i + 3] * x[i]
    x[0] = a + b + c + d
    return 0


_little = Callback(_do_little, "p")


def own_cost(count=10000, rounds=15):
    """Return the seconds of a timer, half of them in the timed phase: least time with it, less least time without."""
    notes, context = new_notes(0), np.zeros(1 + LITTLE)
    notes[TARGETS + CHECK] = _little.address
    context[:1].view(np.int64)[0] = notes.ctypes.data
    least = [np.inf, np.inf]
    for _ in range(1 + rounds):  # the first loads
        start(notes)
        for i, address in enumerate((_little.address, TIMERS[CHECK].address)):
            began = time.perf_counter()
            _call_often(address, context.ctypes.data + 8, count)
            least[i] = min(least[i], (time.perf_counter() - began) / count)
    return max(least[1] - least[0], 0.0)
