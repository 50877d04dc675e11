"""The cost of a timer, by calls of a little callback with and without one."""

import time

import numpy as np

from ..jit.kernels import Callback, entry, vector
from ..runs.stepper import call_check
from .timers import CHECK, TARGETS, TIMERS, new_notes, start


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
