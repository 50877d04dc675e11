"""The tangent form for implicit methods: accelerations of a stage, and rates of another configuration, in a chart.

Newton's method for its stages is that of stage_equations.py; the matrices are those of saddle_point.py.
"""

from ..errors import Status
from ..jit.kernels import callback, vector
from ..jit.simd import add, cross, fma, lanes, put, splat, times, total
from ..maths.vectors import spin
from ..workspaces.workspace import load
from .chart_coordinates import turn_accelerations
from .chart_validity import measure_turns
from .saddle_point import factorise, linearise, reduce, soften, solve
from .stage_equations import correct, distance, residual
from .tangent import COLUMNS, accelerate, check_chart, error_norm, place, start_chart, write_state

__all__ = [  # parts of the form
    "COLUMNS",
    "accelerate",
    "check",
    "correct",
    "distance",
    "error_norm",
    "factorise",
    "linearise",
    "place",
    "reduce",
    "residual",
    "soften",
    "solve",
    "start_chart",
]
OK = int(Status.SUCCESS)


@callback("p")
def check(context):
    """As tangent.check; N is factorised at the present configuration: the stages of the next step begin with it."""
    c = load(context)
    c.chart.state.factored = 0
    return check_chart(c)


@callback("pp")
def complete(context, yd):
    """Write q, qd and qdd after `accelerate`, yd being accelerations of chart coordinates.

    They are projected onto H (rdd, omega'd) + gamma = 0.
    """
    c = load(context)
    f, l, graph = c.tangent, c.chart, c.graph
    yd = vector(yd, l.x.size - 8)
    turn_accelerations(graph, l, f.poses, yd, f.Z)
    write_state(graph, c.work, f)
    return OK


@callback("ppp")
def recall(context, y, yd):
    """Rates and accelerations of chart coordinates (8 b,) at the point before, in this chart; moves l.d."""
    c = load(context)
    l, graph, before = c.chart, c.graph, c.linear.before
    y, yd = vector(y, l.x.size - 8), vector(yd, l.x.size - 8)
    measure_turns(graph, l, before[0])
    for b in range(graph.bodies.shape[0]):
        i, o = graph.bodies[b, 0], 8 * b
        put(y, o, lanes(before[1, i], before[1, i + 1], before[1, i + 2]))
        put(yd, o, lanes(before[2, i], before[2, i + 1], before[2, i + 2]))
        put(y, o + 4, splat(0.0))
        put(yd, o + 4, splat(0.0))
        if graph.bodies[b, 1] == 7:
            # omega' = 2 G pd of the point before, and omega'd likewise
            p, d = before[0, i + 3 : i + 7], lanes(l.d[4 * b], l.d[4 * b + 1], l.d[4 * b + 2])
            wx, wy, wz = spin(p, before[1, i + 3 : i + 7])
            omega, d0 = lanes(wx, wy, wz), splat(1.0 + l.d[4 * b + 3])
            wx, wy, wz = spin(p, before[2, i + 3 : i + 7])
            change = lanes(wx, wy, wz)
            # etad = (d0 I + d~) omega'
            put(y, o + 4, fma(omega, d0, cross(d, omega)))
            # etadd = (d0 I + d~) omega'd - |omega'|^2 d / 2
            square = splat(-0.5 * total(times(omega, omega)))
            put(yd, o + 4, add(fma(change, d0, cross(d, change)), times(d, square)))
    return OK
