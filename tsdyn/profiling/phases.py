"""Phases of a run: times of timers, shared among the parts of a kernel by their prices.

The price of a part is its time at the final state of the run, from repetitions; counters tell how often it ran.
"""

from __future__ import annotations

import time
from typing import NamedTuple

from ..formulations.chart_coordinates import factorise_normal
from ..formulations.null_space import reduced_mass, velocities
from ..formulations.tangent import solve_velocities
from ..jit.kernels import entry, resident
from ..maths.dense_linalg import copy
from ..model.equations import acceleration_bias, applied_forces, constraint_jacobian, constraints, remember
from ..model.packed import members_of
from ..rows.interface import DYNAMICS, evaluate_bias, evaluate_rows, factorise_selected_rows
from ..taylor.coefficients import ADVANCE, RESIDUAL, run_forces, run_loops
from ..taylor.layout import load_series
from ..workspaces import load, load_run
from .timers import SERIES
from .tolerances import BRIEF, ROUNDS


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


ROWS, BIAS, FORCES, REMEMBER, SYSTEM, NORMAL, VELOCITIES, MASS, SERIES_ROWS, SERIES_FORCES = range(10)


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
    """What of a run tells its parts apart: its memory, and the watch's times of its kernels."""

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
    for part in parts:
        spent = min(part.seconds, max(seconds, 0.0))
        seconds -= spent
        yield part._replace(seconds=spent)
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
    if free:
        factors = run.part("accelerations", "factors of Phi_q W Phi_q^T", factored, SYSTEM)
        parts = [factors, run.part("positions", "factors of Phi_q U", normal, NORMAL)]
    else:
        parts = [run.part("accelerations", "D^T M D and its factors", placed, MASS)]
    parts = run.rows("positions", sweeps), *parts
    yield from _shared(parts, place, "positions", "corrections" if free else "corrections, B and D", placed)
    parts = (
        run.part("velocities", "freed of what leaves the constraints" if free else "qd = D vd", projected, VELOCITIES),
        run.rows("accelerations", evaluated, BIAS),
        *run.forces("accelerations", evaluated),
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
