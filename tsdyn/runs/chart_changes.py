"""New charts along a run, and what is recorded of the old ones."""

from ..errors import Status
from ..formulations.chart_coordinates import turned_most
from ..formulations.chart_validity import AT_START
from ..jit.kernels import kernel
from ..maths.dense_linalg import copy
from ..rows.interface import is_next_to_singular, note_indicator
from .run_state import CHART_ROWS, IN_CHART, MAY_PASS, T
from .trajectory import A_CHART, call_chart

PASSAGE = int(Status.PASSAGE)
LITTLE = 0.1  # |d|: a step that turns bodies by less is no long one, and a chart that it loses a small one


@kernel
def begin_chart(context, c, r, log, at, reason):
    """A new chart at the present q, qd, qdd; closes the record of the old one. PASSAGE next to a singular place."""
    w, i = c.work, r.numbers[CHART_ROWS]
    if reason != AT_START:
        row = log.charts[i]
        row[2], row[3], row[4] = w.control.condition, w.control.contraction, r.numbers[IN_CHART]
        i += 1
        r.numbers[CHART_ROWS] = i
    log.charts[i, 0], log.charts[i, 1] = r.clock[T], reason
    r.numbers[IN_CHART] = 0
    for j in range(r.x.size):
        r.x_low[j] = 0.0
    for j in range(r.y.size):
        r.y_low[j] = 0.0
    if log.points.shape[0] > 0:
        copy(w.q, log.points[i])
    status = call_chart(at[A_CHART], context, r.clock[T], r.x, r.y, r.yd, r.xd)
    if r.numbers[MAY_PASS] == 1:
        note_indicator(c.network, c.free, c.local.rows0)
        if status == 0 and reason != AT_START and is_next_to_singular(c.free):
            return PASSAGE
    return status


@kernel
def has_hardly_turned(c):
    """Whether bodies have turned on the present chart, but by little."""
    return 0.0 < turned_most(c.local) < LITTLE
