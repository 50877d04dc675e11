"""Error norm of the tangent form: errors of chart coordinates without their normal part, in terms of q and qd."""

import math

from ..jit.kernels import callback, kernel, vector
from ..maths.dense_linalg import copy
from ..methods.explicit import NORM
from ..rows.interface import project
from ..workspaces.workspace import load


@kernel
def _tangent_part(graph, f, l, e):
    """f.Z = P0 e."""
    copy(e, f.Z)
    for i in range(e.size, f.Z.size):
        f.Z[i] = 0.0
    if f.b.size > 0:
        project(graph, l.rows0, f.Z, f.b)


@kernel
def weighted_square(graph, l, Z, values, old, at, rtol, atol):
    """(dq_i / (atol + rtol |value|))^2 summed, dq the change of coordinates (n,) that Z makes at q0.

    Eight arguments: the graph, the chart, the change Z, values at both ends of the step, and tolerances.
    """
    total = 0.0
    for b in range(graph.bodies.shape[0]):
        i, o = graph.bodies[b, 0], 8 * b
        # dr
        for c in range(3):
            x = Z[o + c] / (atol + rtol * max(abs(values[i + c]), abs(old[at + i + c])))
            total += x * x
        if graph.bodies[b, 1] == 7:
            # dp = G(p0)^T eta / 2
            i += 3
            e0, e1, e2, e3 = l.base[o + 4], l.base[o + 5], l.base[o + 6], l.base[o + 7]
            x, y, z = 0.5 * Z[o + 4], 0.5 * Z[o + 5], 0.5 * Z[o + 6]
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
    # The normal component of the error is removed by the position solve
    _tangent_part(graph, f, l, vector(ex, k))
    total = weighted_square(graph, l, f.Z, w.q, old, 0, rtol, atol)
    _tangent_part(graph, f, l, vector(ey, k))
    total += weighted_square(graph, l, f.Z, w.qd, old, n, rtol, atol)
    return math.sqrt(total / (2 * n))
