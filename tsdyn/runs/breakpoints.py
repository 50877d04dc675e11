"""Stops: times at which a step must end, such as knots of motions and loads and sampling times.

A step that would pass a stop is shortened to end there. At the stop all piecewise functions switch to their next piece,
and accelerations are re-evaluated for the output and for the next step. After a shortened step of fixed length, the
next step ends on the original time grid.
"""

import math

from ..jit.kernels import kernel
from ..model.equations import hold_pieces
from .outputs import record
from .run_state import NEXT_STOP, ROWS, T_END, WAITING, T

SLIVER = 1e-6  # of a fixed step: a stop that is nearer to a time of the grid stands for it
SHORT = 0.5  # of the step wanted: a step cut to less says nothing of the next one


@kernel
def next_stop(r, log):
    """The next time at which a step has to end, but for the end of the run; inf where there is none."""
    i = r.numbers[NEXT_STOP]
    while i < log.stops.shape[0] and log.stops[i, 0] <= r.clock[T]:
        i += 1
    r.numbers[NEXT_STOP] = i
    return log.stops[i, 0] if i < log.stops.shape[0] else math.inf


@kernel
def cut_fixed(stop, t1, h, last):
    """The end of a fixed step of h that would end at t1, the last of its grid or not, and whether it is cut."""
    if stop < t1 - SLIVER * h or (last and stop < t1):
        return stop, True
    return stop if stop < t1 + SLIVER * h and not last else t1, False


@kernel
def take_pieces(system, r, log):
    """Let piecewise motions and loads stay with their pieces up to the next stop."""
    end = min(next_stop(r, log), r.clock[T_END])
    hold_pieces(system, 0.5 * (r.clock[T] + end))


@kernel
def is_sampled(r, log, t1):
    """Whether Python is asked at this stop, before the run goes on."""
    i = r.numbers[NEXT_STOP]
    if i < log.stops.shape[0] and log.stops[i, 0] == t1 and log.stops[i, 1] != 0.0:
        r.numbers[WAITING] = 1
        return True
    return False


@kernel
def amend(r, log, q, qd, qdd):
    """The output at a stop, if there is one, with the accelerations after it."""
    i = r.numbers[ROWS] - 1
    if i >= 0 and log.out[i, 0] == r.clock[T]:
        r.numbers[ROWS] = i
        record(r, log, r.clock[T], q, qd, qdd)
