"""Instrumentation of a run: timers in its workspace; costs that timers can't separate, measured at its final state."""

import time
from typing import NamedTuple

import numpy as np

from ..elements.loops import constraint_rows, coordinate_rows, force_series
from ..elements.loops import forces as force_loops
from ..formulations.chart_coordinates import factorise_normal
from ..formulations.locked_orientations import instances
from ..formulations.null_space import reduced_mass, velocities
from ..formulations.tangent import solve_velocities
from ..jit.kernels import entry, kernel
from ..maths.dense_linalg import copy
from ..model.packed import members_of
from ..rows.constraint_graph import LOOPS
from ..rows.interface import DYNAMICS, factorise_selected_rows
from ..taylor.layout import load_series
from ..workspaces import load, load_run
from . import timers
from .tolerances import BRIEF, ROUNDS

# Micro-benchmarks, at the final state of a run, of costs that timers can't separate.

SYSTEM, NORMAL, VELOCITIES, MASS = range(4)


@kernel
def _system(graph, f):
    """W H^T, H W H^T and its factors."""
    factorise_selected_rows(graph, f, f.rows, DYNAMICS)


@entry
def again(context, run, what, count):
    """Repeat a part of the tangent form."""
    c, r = load(context), load_run(run)
    w, f, l = c.work, c.tangent, c.chart
    for _ in range(count):
        if what == SYSTEM:
            _system(c.graph, f)
        elif what == NORMAL:
            factorise_normal(c.graph, w, f, l)
        else:
            copy(r.y, l.y)
            solve_velocities(c.graph, c.system, w, f, l, r.clock.t)


@entry
def again_with_basis(context, run, what, count):
    """Repeat a part of the forms with a basis."""
    c, r = load(context), load_run(run)
    for _ in range(count):
        if what == MASS:
            reduced_mass(c.system, c.work)
        else:
            velocities(c.system, c.work, r.clock.t, r.y)


@entry
def again_in_series(context, run, what, count):
    """Repeat a part of a Taylor step."""
    c = load_series(context)
    for _ in range(count):
        _system(c.graph, c.tangent)


def prices(memory):
    """Return seconds of each part of the memory's form, by name, at the final state of its run."""
    if hasattr(memory, "series"):
        function, parts = again_in_series, {"system": SYSTEM}
    elif memory.basis_free:
        function, parts = again, {"system": SYSTEM, "normal": NORMAL, "velocities": VELOCITIES}
    else:
        function, parts = again_with_basis, {"mass": MASS, "velocities": VELOCITIES}
    return {name: _seconds(lambda n, what=what: function(*memory.where, what, n)) for name, what in parts.items()}


def _seconds(call):
    """Return seconds of one of n repetitions in call(n): the least of several samples."""
    call(1)
    n, spent = 1, 0.0
    while True:
        began = time.perf_counter()
        call(n)
        spent = time.perf_counter() - began
        if spent > BRIEF / 2 or n > 1 << 20:
            break
        n *= 4
    least = spent / n
    for _ in range(ROUNDS if spent < 0.1 else 0):
        began = time.perf_counter()
        call(n)
        least = min(least, (time.perf_counter() - began) / n)
    return least


# Instrumentation of a run: timers installed in its workspace before the run and read afterwards.

OF_KIND = "phi", "jacobian", "gamma", "phi_t"  # the loops of System.kinds and of System.forces that are timed
OF_FORCE = "force", "remember"


class Entry(NamedTuple):
    """Calls and exclusive time of one role within another."""

    role: int
    within: int  # the role
    order: int  # of series; otherwise -1
    kind: int  # of constraint or force, as in Timekeeper.kinds; otherwise -1
    loop: int  # which of its loops
    calls: int
    seconds: float


class Kind(NamedTuple):
    """A kind of constraint or force whose instances one loop runs over."""

    force: bool
    label: str


class Stopwatch:
    """Seconds in the compiled driver; a driver calls `observe` with the memory of a run before it starts."""

    def __init__(self):
        self.seconds, self.memory = 0.0, None

    def observe(self, memory):
        """Time the memory's advances."""
        self.memory, advance = memory, memory.advance

        def timed(log, most):
            began = time.perf_counter()
            self.begin()
            status = advance(log, most)
            self.end()
            self.seconds += time.perf_counter() - began
            return status

        memory.advance = timed

    def release(self):
        """Release the memory after the run, which refers to this object."""
        self.memory.__dict__.pop("advance", None)

    def begin(self):
        """Before an advance."""

    def end(self):
        """After it."""


class Timekeeper(Stopwatch):
    """Times of the phases of a run."""

    def __init__(self):
        super().__init__()
        self.notes, self.kinds = None, []

    def begin(self):
        """Before an advance."""
        timers.start(self.notes)

    def end(self):
        """After it."""
        timers.stop(self.notes)

    def observe(self, memory):
        """Install the timers."""
        super().observe(memory)
        c, series = memory.context, hasattr(memory, "series")
        graph, system = c.graph, c.system
        forces = [members_of(row, memory.packed.loads) for row in system.forces]
        classes = list(dict.fromkeys(map(type, memory.packed.constraints)))
        joints = [kind for kind, _ in instances(memory.packed, graph)]
        self.notes = timers.new_notes(len(joints) + len(classes) + 2 * len(forces))
        places = c.expansion.places["loop"] if series else [0] * len(joints)

        rows = [
            (
                row.table,
                row.count * constraint_rows.INTS,
                [*(row[loop] for loop in LOOPS), place],
                _of_constraints(kind),
            )
            for kind, row, place in zip(joints, graph.kinds, places, strict=True)
        ]
        table, firsts = self._headed(graph.table, rows)
        kinds = graph.kinds.copy()
        kinds["table"] = firsts
        _instead(kinds, LOOPS, timers.BODY_TIMERS)
        graph = graph._replace(table=table, kinds=kinds)

        rows = [
            (row.table, row.count * coordinate_rows.INTS, [row[name] for name in OF_KIND], _of_constraints(kind))
            for kind, row in zip(classes, system.kinds, strict=True)
        ]
        rows += [
            (row.table, row.count * force_loops.FORCE_INTS, [row[name] for name in OF_FORCE], _of_forces(members))
            for members, row in zip(forces, system.forces, strict=True)
        ]
        table, firsts = self._headed(system.table, rows)
        kinds, loads = system.kinds.copy(), system.forces.copy()
        kinds["table"], loads["table"] = firsts[: len(kinds)], firsts[len(kinds) :]
        _instead(kinds, OF_KIND, timers.LOOP_TIMERS)
        _instead(loads, OF_FORCE, timers.LOOP_TIMERS)
        c = c._replace(graph=graph, system=system._replace(table=table, kinds=kinds, forces=loads))
        if series:
            c = c._replace(expansion=self._in_series(c.expansion, forces))
        elif memory.implicit:
            self._in_driver(c.linear.kernels, timers.OF_STAGES)
        self._in_driver(memory.run.kernels, timers.OF_DRIVERS)
        memory.bind(c, (self.notes.ctypes.data,))

    def _in_series(self, x, forces):
        rows = [
            (row.table, row.count * force_series.INTS, [0] * timers.IN_ORDERS + [row.loop], _of_forces(members))
            for members, row in zip(forces, x.forces, strict=True)
        ]
        table, firsts = self._headed(x.table, rows)
        places, loads = x.places.copy(), x.forces.copy()
        loads["table"] = firsts
        for rows in (places, loads):
            _instead(rows, ["loop"], [timers.SERIES_TIMER])
        return x._replace(places=places, table=table, forces=loads)

    def _in_driver(self, kernels, roles):
        """Replace addresses by timers; an address may be zero."""
        for name, role in roles.items():
            address = getattr(kernels, name)
            if address:
                self.notes[timers.TARGETS + role] = address
                setattr(kernels, name, timers.TIMERS[role].address)

    def _headed(self, table, rows):
        """Return a table with a header before the rows of each kind, and the first row of each kind."""
        parts, firsts, at = [np.zeros(0, np.int64)], [], 0
        for first, length, loops, kind in rows:
            header = np.zeros(timers.HEADER, np.int64)
            header[timers.T_NOTES], header[timers.T_SLOT] = (
                self.notes.ctypes.data,
                timers.FIRST_KIND + len(self.kinds) * timers.LOOPS * timers.ROLES,
            )
            header[timers.T_LOOPS : timers.T_LOOPS + len(loops)] = loops
            self.kinds.append(kind)
            parts += [header, table[first : first + length]]
            firsts.append(at + timers.HEADER)
            at += timers.HEADER + int(length)
        return np.concatenate(parts), np.array(firsts, np.int64)

    def entries(self, cost):
        """Return the readings, a list of `Entry`, the driver first, less the timers' cost (`timer_cost.own_cost`)."""
        half = 0.5 * cost
        slots = self.notes[timers.SLOTS :].reshape(-1, 2)
        unit, found = self.seconds / slots[:, 1].sum(), []
        for i in np.flatnonzero(slots[:, 0]).tolist():
            calls = int(slots[i, 0])
            found.append(Entry(*_what(i), calls, slots[i, 1] * unit - calls * half))
        within = np.bincount([e.within for e in found], [e.calls for e in found], timers.ROLES)
        calls = np.bincount([e.role for e in found], [e.calls for e in found], timers.ROLES)
        driver = Entry(timers.DRIVER, timers.DRIVER, -1, -1, -1, 1, slots[0, 1] * unit - within[timers.DRIVER] * half)
        return [driver] + [
            e._replace(seconds=e.seconds - within[e.role] * half * e.calls / calls[e.role]) for e in found
        ]


def _what(slot):
    """Role, role it runs in, order, kind and loop of a slot."""
    if slot < timers.FIRST_ORDER:
        return *divmod(slot, timers.ROLES), -1, -1, -1
    if slot < timers.FIRST_KIND:
        return timers.EXPAND, timers.DRIVER, slot - timers.FIRST_ORDER, -1, -1
    kind, rest = divmod(slot - timers.FIRST_KIND, timers.LOOPS * timers.ROLES)
    loop, within = divmod(rest, timers.ROLES)
    return timers.ROWS, within, -1, kind, loop


def _instead(columns, names, timers):
    """Timers in place of those loops that there are in the columns of these names."""
    for name, timer in zip(names, timers, strict=False):
        there = columns[name] != 0
        if there.any():
            columns[name][there] = timer.address


def _of_constraints(kind):
    return Kind(False, kind.__name__)


def _of_forces(members):
    force = members[0].force
    return Kind(True, force.name if len(members) == 1 else f"{type(force).__name__} ({len(members)})")
