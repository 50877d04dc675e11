"""Error norm of the tangent form: errors of chart coordinates without their normal part, in terms of q and qd."""

import math

from ..jit.kernels import callback, kernel, vector
from ..maths.dense_linalg import copy
from ..methods.explicit import NORM
from ..rows.interface import project
from ..workspaces.workspace import load


@kernel
def _weighted_square(graph, f, l, e, values, old, at, rtol, atol):
    """(dq_i / (atol + rtol |value|))^2 summed, dq the change of coordinates (n,) that P0 e makes at q0.

    Nine arguments: the graph, two workspaces, the error e, values at both ends of the step, and tolerances.
    """
    copy(e, f.Z)
    for i in range(e.size, f.Z.size):
        f.Z[i] = 0.0
    if f.b.size > 0:
        project(graph, l.rows0, f.Z, f.b)
    total = 0.0
    for b in range(graph.bodies.shape[0]):
        i, o = graph.bodies[b, 0], 8 * b
        for c in range(3):
            x = f.Z[o + c] / (atol + rtol * max(abs(values[i + c]), abs(old[at + i + c])))
            total += x * x
        if graph.bodies[b, 1] == 7:
            i += 3
            e0, e1, e2, e3 = l.base[o + 4], l.base[o + 5], l.base[o + 6], l.base[o + 7]
            x, y, z = 0.5 * f.Z[o + 4], 0.5 * f.Z[o + 5], 0.5 * f.Z[o + 6]
            for c in range(4):
                if c == 0:
                    part = -e1 * x - e2 * y - e3 * z
                elif c == 1:
                    part = e0 * x - e3 * y + e2 * z
                elif c == 2:
                    part = e3 * x + e0 * y - e1 * z
                else:
                    part = -e2 * x + e1 * y + e0 * z
                part /= atol + rtol * max(abs(values[i + c]), abs(old[at + i + c]))
                total += part * part
    return total


@callback(NORM, "d")
def error_norm(context, ex, ey, old, rtol, atol):
    """Root mean square of the errors P0 ex of q and P0 ey of qd, over atol + rtol times the larger end of the step."""
    c = load(context)
    w, f, l, graph = c.work, c.tangent, c.chart, c.graph
    n, k = w.q.size, l.x.size - 8
    old = vector(old, 3 * n)
    total = _weighted_square(graph, f, l, vector(ex, k), w.q, old, 0, rtol, atol)
    total += _weighted_square(graph, f, l, vector(ey, k), w.qd, old, n, rtol, atol)
    return math.sqrt(total / (2 * n))
