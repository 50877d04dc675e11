"""New charts along a run, and what is recorded of the old ones."""

from ..errors import Status
from ..formulations.chart_coordinates import turned_most
from ..formulations.chart_validity import AT_START
from ..jit.kernels import kernel, long_kernel
from ..maths.dense_linalg import copy
from ..rows.interface import is_next_to_singular, note_indicator, note_selection
from .dense_output import call_chart
from .run_log import close_chart, open_chart
from .tolerances import HARDLY_TURNED

PASSAGE = int(Status.PASSAGE)


@long_kernel
def begin_chart(context, c, r, log, reason):
    """New chart at the present q, qd, qdd; closes the record of the old one. PASSAGE near a singular configuration."""
    w = c.work
    # Record of the chart before
    if reason != AT_START:
        close_chart(r, log, w.control.condition, w.control.contraction)
    open_chart(r, log, r.clock.t, reason)
    # Chart coordinates begin at zero: nothing is left to compensate
    for j in range(r.x.size):
        r.x_low[j] = 0.0
    for j in range(r.y.size):
        r.y_low[j] = 0.0
    # Dense output rebuilds a chart from q0 and the selection of rows
    kept = log.points.shape[0] > 0
    if kept:
        copy(w.q, log.points[r.numbers.chart_rows])
    status = call_chart(r.kernels.start_chart, context, r.clock.t, r.x, r.y, r.yd, r.xd)
    if kept:
        note_selection(c.tangent, log.points[r.numbers.chart_rows, w.q.size :])
    # Distance to a singular configuration
    if r.numbers.first_order == 0:
        note_indicator(c.graph, c.tangent, c.chart.rows0)
        if r.numbers.may_pass == 1 and status == 0 and reason != AT_START and is_next_to_singular(c.tangent):
            return PASSAGE
    return status


@kernel
def has_hardly_turned(c):
    """Whether bodies have rotated on the present chart, by a small angle."""
    return 0.0 < turned_most(c.chart) < HARDLY_TURNED
