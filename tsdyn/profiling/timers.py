"""Timers of a run: callbacks in place of the kernels that a driver calls by address, so that no kernel changes.

A timer reads the clock before and after its kernel. Time goes to the innermost timer that runs, the rest to the driver:
times add up to the driver's. Calls and times of all timers are numbers of one array, the notes, whose address stands
before the context.
"""

import ctypes
import sys
import time

import numpy as np

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
    specialised,
)
from ..methods.explicit import ACCELERATE, NORM, PLACE, STEP

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
ORDERS = 40  # of series, told apart; higher ones count as the last
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
            self._install(memory)

        def timed(log, most):
            first, began = read(self.notes), time.perf_counter()
            status = advance(log, most)
            self.seconds += time.perf_counter() - began
            self.units += read(self.notes) - first
            return status

        memory.advance = timed

    def _install(self, memory):
        records = dict(zip(("kernels", "stages"), memory.called, strict=False))
        self.notes[HALF] = self.half
        for i, (name, timer) in enumerate(TIMERS.items()):
            record, field = name.split(".")
            address = getattr(records.get(record), field, 0)
            if address:
                self.notes[RECORDS + WIDTH * i] = address
                setattr(records[record], field, timer.address)
        memory.bind(memory.context, (self.notes.ctypes.data,))

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
