"""Stops: times at which a step must end, such as knots of motions and loads and sampling times.

A step that would pass a stop is shortened to end there. At the stop all piecewise functions switch to their next piece,
and accelerations are re-evaluated for the output and for the next step. After a shortened step of fixed length, the
next step ends on the original time grid. A short change of a function is a stop for steps that begin before it alone.
"""

import math

from ..jit.kernels import kernel
from ..model.equations import hold_pieces
from ..motions.tolerances import TOGETHER
from .outputs import record
from .tolerances import SLIVER


@kernel
def next_stop(r, log):
    """The next time at which a step has to end, but for the end of the run; inf where there is none."""
    i = r.numbers.next_stop
    # Stops behind, and changes of functions that begin before t
    while i < log.stops.shape[0] and (log.stops[i, 0] <= r.clock.t or log.stops[i, 2] < r.clock.t):
        i += 1
    r.numbers.next_stop = i
    return log.stops[i, 0] if i < log.stops.shape[0] else math.inf


@kernel
def fixed_end(r, stop):
    """The end of the next step of fixed length, whether it is the run's last, and whether a stop cuts it.

    t_k = t_origin + k h, but for steps that end at stops; a stop within SLIVER h, or rounding, of t_k stands for it.
    """
    # End k of the grid, counted without steps that stops have cut
    done, h = r.numbers.steps + 1 - r.numbers.cuts, r.clock.h
    last = done == r.numbers.steps_wanted
    t1 = r.clock.t_end if last else r.clock.t_origin + done * h
    # A stop within a sliver of the grid point replaces it
    near = max(SLIVER * h, TOGETHER * abs(t1))
    if stop < t1 - near or (last and stop < t1):
        return stop, False, True
    return stop if stop < t1 + near and not last else t1, last, False


@kernel
def take_pieces(system, r, log):
    """Let piecewise motions and loads stay with their pieces up to the next stop."""
    # The piece is the one half way to the next stop
    end = min(next_stop(r, log), r.clock.t_end)
    hold_pieces(system, 0.5 * (r.clock.t + end))


@kernel
def is_sampled(r, log, t1):
    """Whether Python is asked at this stop, before the run goes on."""
    i = r.numbers.next_stop
    if i < log.stops.shape[0] and log.stops[i, 0] == t1 and log.stops[i, 1] != 0.0:
        r.numbers.waiting = 1
        return True
    return False


@kernel
def amend(r, log, q, qd, qdd):
    """The output at a stop, if there is one, with the accelerations after it."""
    i = r.numbers.rows - 1
    if i >= 0 and log.out[i, 0] == r.clock.t:
        r.numbers.rows = i
        record(r, log, r.clock.t, q, qd, qdd)
