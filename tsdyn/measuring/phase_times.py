"""Phases of a run: kernels are timed, and their times are shared among their parts by the prices of these."""

from __future__ import annotations

import ctypes
import sys
import time
from typing import NamedTuple

import numpy as np

from ..formulations.charts import factorise_normal
from ..formulations.null_space import reduced_mass, velocities
from ..formulations.tangent import solve_velocities
from ..jit.kernels import (
    ANY,
    HAS_CYCLES,
    Callback,
    callback,
    caller,
    cycles,
    data_of,
    entry,
    integers,
    kernel,
    part,
    resident,
    specialised,
)
from ..maths.dense_linalg import copy
from ..methods.explicit import ACCELERATE, NORM, PLACE, STEP
from ..model.equations import acceleration_bias, applied_forces, constraint_jacobian, constraints, remember
from ..model.packed import members_of
from ..rows.interface import DYNAMICS, evaluate_bias, evaluate_rows, factorise_selected_rows, form_selected_rows
from ..taylor.coefficients import ADVANCE, RESIDUAL, run_forces, run_loops
from ..taylor.layout import load_series
from ..workspaces import load, load_run
from .tolerances import BRIEF, ROUNDS

# Timers of a run: callbacks in place of the kernels that a driver calls by address, so that no kernel changes.
#
# A timer reads the clock before and after its kernel. Time goes to the innermost timer that runs, the rest to the
# driver: times add up to the driver's. Calls and times of all timers are numbers of one array, the notes, whose address
# stands before the context.
# Signatures of the kernels whose addresses stand in `RunKernels` and in `StageKernels`; that of a series is the last.
TIMED = {
    "kernels.place": PLACE, "kernels.accelerate": ACCELERATE, "kernels.stage_place": PLACE,
    "kernels.stage_accelerate": ACCELERATE, "kernels.complete": "pp", "kernels.check": "p",
    "kernels.start_chart": "pdpppp", "kernels.step": STEP, "kernels.error_norm": NORM, "kernels.reach": "pdd",
    "stages.linearise": PLACE, "stages.reduce": "pd", "stages.factorise": "pd", "stages.solve": "pp",
    "stages.soften": "ppdp", "stages.error_norm": NORM, "stages.residual": "pddppp", "stages.correct": "pdp",
    "stages.distance": NORM, "stages.balance_stage": "pip", "stages.factorise_stages": "pdpi",
    "stages.solve_stages": "pdpp", "kernels.expand": "pii",
}  # fmt: skip
SERIES, FLOATS = "kernels.expand", ("error_norm", "correct", "distance", "solve_stages")  # which return a float
ORDERS = 40  # of series, distinguished; higher ones count as the last
# The notes: the clock where the processor has none, what it is given first, what it writes, the factor of its first
# number; the time of all timers so far; half the time that a timer takes; then of each timer the address of its kernel,
# calls and time, and of the last one, of series, calls and time of each order.
CLOCK, FIRST, BUFFER, SCALE, SPENT, HALF, RECORDS, WIDTH = 0, 1, 2, 4, 5, 6, 7, 3
ORDERS_AT = RECORDS + WIDTH * (len(TIMED) - 1) + 1

call_clock, call_check = caller("pp"), caller("p")


@kernel
def _now(notes):
    """The time, in units of the clock."""
    if notes[CLOCK] == 0:
        return cycles()
    call_clock(notes[CLOCK], notes[FIRST], data_of(notes) + 8 * BUFFER)
    return notes[BUFFER] * notes[SCALE] + notes[BUFFER + 1]


@kernel
def _before(context):
    return integers(context - 8, 1)[0]


@kernel
def _begin(notes):
    """The time without that of timers so far."""
    return _now(notes) - notes[SPENT]


@kernel
def _end(notes, at, begun):
    """Add a call, and its time without that of timers within it. Half a timer's own time is its caller's."""
    own = _now(notes) - notes[SPENT] - begun
    notes[SPENT] += own + notes[HALF]
    notes[at + 1] += 1
    notes[at + 2] += own - notes[HALF]


# The templates, by the number of arguments; AT, the place of a timer in the notes, and call are filled in by `_timer`.
AT, call = 0, None


@part
def _timed(context, *more):
    notes = integers(_before(context), ANY)
    begun = _begin(notes)
    found = call(notes[AT], context, *more)
    _end(notes, AT, begun)
    return found


OF_ARGUMENTS = {
    1: lambda a: _timed(a),
    2: lambda a, b: _timed(a, b),
    3: lambda a, b, c: _timed(a, b, c),
    4: lambda a, b, c, d: _timed(a, b, c, d),
    5: lambda a, b, c, d, e: _timed(a, b, c, d, e),
    6: lambda a, b, c, d, e, f: _timed(a, b, c, d, e, f),
}


def _of_orders(context, start, end):
    """Each order of series by itself."""
    notes, status = integers(_before(context), ANY), 0
    for k in range(start, end):
        begun = _begin(notes)
        status = call(notes[AT], context, k, k + 1)
        _end(notes, AT + 2 * min(k, ORDERS - 1), begun)
    return status


def _timer(name, at):
    signature, result = TIMED[name], "d" if name.endswith(FLOATS) else "i"
    template = _of_orders if name == SERIES else OF_ARGUMENTS[len(signature)]
    made = specialised(template, f"time_{name}", _of_orders, AT=at, call=caller(signature, result))
    return Callback(made, signature, result)


TIMERS = {name: _timer(name, RECORDS + WIDTH * i) for i, name in enumerate(TIMED)}


def new_notes():
    """The notes of a run."""
    notes = np.zeros(ORDERS_AT + 2 * ORDERS, np.int64)
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
def read(notes):
    """The time, in units of the clock."""
    return _now(notes)


@entry
def _call_often(address, context, count):
    for _ in range(count):
        call_check(address, context)


@callback("p")
def _nothing(context):
    return 0


def calibrate(count=20000, rounds=15):
    """The unit of the clock, s, and half the time of a timer, in units: the least with it, less that without."""
    notes, name = new_notes(), "kernels.check"
    notes[RECORDS + WIDTH * list(TIMED).index(name)] = _nothing.address
    context, times = np.array([notes.ctypes.data, 0]), np.empty((1 + rounds, 2))
    read(notes)  # which loads
    began, first = time.perf_counter(), read(notes)
    for row in times:  # the first loads
        for i, address in enumerate((_nothing.address, TIMERS[name].address)):
            now = read(notes)
            _call_often(address, context.ctypes.data + 8, count)
            row[i] = (read(notes) - now) / count
    without, with_timer = times.min(axis=0)
    return (time.perf_counter() - began) / (read(notes) - first), round(0.5 * max(with_timer - without, 0.0))


class Timing:
    """The time of a run in its compiled driver and, with `half` the time of a timer, in the kernels that it calls."""

    def __init__(self, half=None):
        self.half, self.notes, self.seconds, self.units = half, new_notes(), 0.0, 0

    def observe(self, memory):
        """Time the advances of a memory, before its run."""
        self.memory, advance = memory, memory.advance
        if self.half is not None:
            records = dict(zip(("kernels", "stages"), memory.called, strict=False))
            self.notes[HALF] = self.half
            for i, (name, timer) in enumerate(TIMERS.items()):
                record, field = name.split(".")
                address = getattr(records.get(record), field, 0)
                if address:
                    self.notes[RECORDS + WIDTH * i] = address
                    setattr(records[record], field, timer.address)
            memory.bind(memory.context, (self.notes.ctypes.data,))

        def timed(log, most):
            first, began = read(self.notes), time.perf_counter()
            status = advance(log, most)
            self.seconds += time.perf_counter() - began
            self.units += read(self.notes) - first
            return status

        memory.advance = timed

    def release(self):
        """Let go of the memory after the run, whose advance refers to this watch."""
        self.memory.__dict__.pop("advance", None)

    def times(self, unit):
        """Calls and seconds of the kernels by their names, of the "driver", and of "orders" a list, an order each."""
        kernels, orders = self.notes[RECORDS : ORDERS_AT - 1].reshape(-1, WIDTH), self.notes[ORDERS_AT:].reshape(-1, 2)
        found = {name: (calls, units * unit) for name, (_, calls, units) in zip(TIMED, kernels.tolist(), strict=False)}
        found["orders"] = [(calls, units * unit) for calls, units in orders.tolist() if calls]
        found[SERIES] = int(orders[:, 0].sum()), float(orders[:, 1].sum()) * unit
        return found | {"driver": (1, (self.units - int(self.notes[SPENT])) * unit)}


# Phases of a run: times of timers, shared among the parts of a kernel by their prices.
#
# The price of a part is its time at the final state of the run, from repetitions; counters say how often it ran.


class Phase(NamedTuple):
    """A part of a call: group, name, number of calls, total time in s."""

    group: str
    part: str
    calls: int
    seconds: float

    @property
    def each(self) -> float:
        """Seconds per call; nan without calls."""
        return self.seconds / self.calls if self.calls else float("nan")


ROWS, BIAS, FORCES, REMEMBER, SYSTEM, FORMED, NORMAL, VELOCITIES, MASS, SERIES_ROWS, SERIES_FORCES = range(11)


@entry
def _repeat(context, run, what, count):
    """Repeat a part of the tangent form."""
    c, r = load(context), load_run(run)
    w, f, l, graph, t = c.work, c.tangent, c.chart, c.graph, r.clock.t
    for _ in range(count):
        if what == ROWS:
            evaluate_rows(graph, c.system, f, f.rows, t)
        elif what == BIAS:
            evaluate_bias(graph, c.system, f, t)
        elif what == FORCES:
            applied_forces(c.system, w.q, w.qd, t, f.Q)
        elif what == REMEMBER:
            remember(c.system, w.q, w.qd, t, r.remembered)
        elif what == SYSTEM:
            factorise_selected_rows(graph, f, f.rows, DYNAMICS)
        elif what == FORMED:
            form_selected_rows(graph, f, f.rows, DYNAMICS)
        elif what == NORMAL:
            factorise_normal(graph, w, f, l)
        else:
            copy(r.y, l.y)
            solve_velocities(graph, c.system, w, f, l, t)


@entry
def _repeat_with_basis(context, run, what, count):
    """Repeat a part of the forms with a basis."""
    c, r = load(context), load_run(run)
    w, t = c.work, r.clock.t
    for _ in range(count):
        if what == ROWS:
            constraints(c.system, w.q, t, w.Phi)
            constraint_jacobian(c.system, w.q, t, w.Phi_q)
        elif what == BIAS:
            acceleration_bias(c.system, w.q, w.qd, t, w.gamma)
        elif what == FORCES:
            applied_forces(c.system, w.q, w.qd, t, w.Q)
        elif what == REMEMBER:
            remember(c.system, w.q, w.qd, t, r.remembered)
        elif what == MASS:
            reduced_mass(c.system, w)
        else:
            velocities(c.system, w, t, r.y)


@entry
def _repeat_in_series(context, run, what, count):
    """Repeat a part of a Taylor step; of series all orders in turn."""
    c, r = load_series(context), load_run(run)
    w, f, x, graph, t = c.work, c.tangent, c.expansion, c.graph, r.clock.t
    for i in range(count):
        k = i % max(x.order.top, 1)
        if what == ROWS:
            evaluate_rows(graph, c.system, f, f.rows, t)
        elif what == REMEMBER:
            remember(c.system, w.q, w.qd, t, r.remembered)
        elif what == SYSTEM:
            factorise_selected_rows(graph, f, f.rows, DYNAMICS)
        elif what == SERIES_ROWS:
            run_loops(graph, c.system.reals, ADVANCE, k, x, f)
            run_loops(graph, c.system.reals, RESIDUAL, k, x, f)
        else:
            run_forces(c.system.reals, x, k, f)


def _price(function, context, run, what):
    """Seconds of one of many repetitions: the least of several samples."""

    def seconds(count):
        began = time.perf_counter()
        function(context, run, what, count)
        return (time.perf_counter() - began) / count

    count, least = 1, seconds(1)  # which loads
    while (least := seconds(count)) * count < BRIEF and count < 1 << 20:
        count *= 4
    return min(least, *(seconds(count) for _ in range(ROUNDS)))


class _Run:
    """By what the parts of a run are distinguished: its memory, and the watch's times of its kernels."""

    def __init__(self, memory, times, stats):
        self.memory, self.times, self.stats, c = memory, times, stats, memory.context
        self.series = hasattr(memory, "series")
        self.free = self.series or memory.basis_free
        self.repeat = _repeat_in_series if self.series else _repeat if self.free else _repeat_with_basis
        self.kinds = len(c.graph.kinds if self.free else c.system.kinds)

    def of(self, *names):
        """Calls and seconds of kernels."""
        return tuple(map(sum, zip(*(self.times[name] for name in names), strict=True)))

    def part(self, group, part, calls, what, each=1):
        """A part by its price, `each` of which are told at once."""
        price = _price(self.repeat, *self.memory.where, what) / each if calls else 0.0
        return Phase(group, part, calls, calls * price)

    def rows(self, group, times, what=ROWS, loops=1):
        """The rows of all kinds, evaluated so many times by so many loops each."""
        return self.part(group, "constraint rows", loops * self.kinds * times, what, loops * self.kinds)

    def forces(self, group, calls, what=FORCES):
        """The forces of each kind, called so often."""
        c, run = self.memory.context, self.memory.where[1]
        for i, row in enumerate(c.system.forces):
            if calls == 0 or (what == REMEMBER and not row.remember):
                continue
            one = c._replace(system=c.system._replace(forces=c.system.forces[i : i + 1], kinds=c.system.kinds[:0]))
            if self.series:
                one = one._replace(expansion=c.expansion._replace(forces=c.expansion.forces[i : i + 1]))
            context, _kept = resident(one)
            (load, *others), price = members_of(row, self.memory.packed.loads), _price(self.repeat, context, run, what)
            name = f"{type(load.force).__name__} ({1 + len(others)})" if others else load.force.name
            yield Phase(group, f"force: {name}", calls, calls * price)


def _shared(parts, seconds, *rest):
    """The parts of some seconds, at most all of them, and the rest, a `Phase` without them."""
    for one in parts:
        spent = min(one.seconds, max(seconds, 0.0))
        seconds -= spent
        yield one._replace(seconds=spent)
    yield Phase(*rest, seconds)


def phases(memory, times, stats):
    """The phases of a run in its driver, by groups: those that ran; stats are its `Solution.stats`."""
    run = _Run(memory, times, stats)
    found = [*(_of_series if run.series else _of_steps)(run)]
    groups = list(dict.fromkeys(phase.group for phase in found))
    ran = [phase._replace(seconds=max(phase.seconds, 0.0)) for phase in found if phase.calls]  # timers' own taken off
    return sorted(ran, key=lambda phase: groups.index(phase.group))


def _of_steps(run):
    free, stats = run.free, run.stats
    placed, place = run.of("kernels.place", "kernels.stage_place")
    evaluated, accelerate = run.of("kernels.accelerate", "kernels.stage_accelerate")
    projected = run.of("kernels.accelerate")[0] if run.memory.run.numbers.free_stages else evaluated
    stages, stage = run.of("stages.residual")
    # Newton's sweeps are those of stages where these are placed by `residual`
    sweeps = placed + (stats.newton_iterations if free and not stages else 0)
    factored = placed if stats.factorizations else 0
    normal = max(stats.factorizations - placed - stats.charts, 0)
    factors = []
    if free:
        formed = run.part("accelerations", "Phi_q W Phi_q^T", factored, FORMED)
        system = run.part("accelerations", "factors of Phi_q W Phi_q^T", factored, SYSTEM)
        factors = [system._replace(seconds=max(system.seconds - formed.seconds, 0.0))]
        parts = [formed, run.part("positions", "factors of Phi_q U", normal, NORMAL)]
        # Stages without friction factor in `accelerate`
        if not run.memory.run.numbers.free_stages or len(run.memory.context.graph.frictions):
            parts, factors = parts + factors, []
    else:
        parts = [run.part("accelerations", "D^T M D and its factors", placed, MASS)]
    parts = run.rows("positions", sweeps), *parts
    yield from _shared(parts, place, "positions", "corrections" if free else "corrections, B and D", placed)
    parts = (
        run.part("velocities", "freed of what leaves the constraints" if free else "qd = D vd", projected, VELOCITIES),
        run.rows("accelerations", evaluated, BIAS),
        *run.forces("accelerations", evaluated),
        *factors,
    )
    accelerate += run.of("kernels.complete")[1]
    yield from _shared(parts, accelerate, "accelerations", "bodies and solves", evaluated)
    yield Phase("charts", "made", *run.of("kernels.start_chart"))
    yield Phase("charts", "looked at", *run.of("kernels.check"))
    group = "stage equations"
    yield Phase(group, "Jacobians", *run.of("stages.linearise"))
    matrices = run.of("stages.factorise", "stages.factorise_stages")
    yield Phase(group, "iteration matrices", matrices[0], matrices[1] + run.of("stages.reduce")[1])
    parts = run.rows(group, stages and stats.newton_iterations), *run.forces(group, stages)
    yield from _shared(parts, stage, group, "positions, velocities and loads", stages)
    solves = "stages.solve", "stages.correct", "stages.balance_stage", "stages.solve_stages"
    yield Phase(group, "solves", *run.of(*solves))
    yield Phase(group, "norms of corrections", *run.of("stages.error_norm", "stages.distance"))
    yield Phase("steps", "sums over stages", *run.of("kernels.step"))
    norms = run.of("kernels.error_norm")
    yield Phase("steps", "error norms", norms[0], norms[1] + run.of("stages.soften")[1])
    yield from _driver(run, "control and records")


def _of_series(run):
    (orders, expand), (landings, reach), stats = run.of(SERIES), run.of("kernels.reach"), run.stats
    parts = run.rows("coefficients", orders, SERIES_ROWS, 2), *run.forces("coefficients", orders, SERIES_FORCES)
    yield from _shared(parts, expand, "coefficients", "bodies and solves", orders)
    rows = run.rows("landing", landings + stats.newton_iterations)
    parts = rows, run.part("landing", "factors", stats.factorizations, SYSTEM)
    yield from _shared(parts, reach, "landing", "series summed, corrections", landings)
    yield from _driver(run, "lengths and records")


def _driver(run, part):
    """The driver itself; a chart's, or a series', start and each step remember what forces do."""
    remembering = run.forces("steps", run.stats.steps + 1, REMEMBER)
    yield from _shared(remembering, run.of("driver")[1], "steps", part, run.stats.steps + run.stats.rejected)


def duration(seconds):
    """Seconds with a unit, three digits."""
    for scale, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "us")):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
