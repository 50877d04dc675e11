"""Right-hand side of a Newton correction of a stage: the normal part of accelerations, and the unbalanced loads."""

import math

from ..jit.kernels import kernel
from ..jit.simd import put, splat
from ..maths.dense_linalg import copy
from ..rows.interface import (
    DYNAMICS,
    apply_multipliers,
    clear_redundant,
    factorise_selected_rows,
    multiply_rows,
    solve_product,
    solve_rows,
    take_reactions,
    weigh,
    weigh_bodies,
)
from .chart_coordinates import to_bodies
from .projection import largest_residual
from .saddle_point import degrees
from .tolerances import REACTION_SWEEPS, REACTIONS_LEFT, SLOW


@kernel
def add_to(x, out):
    """Add x to out."""
    for i in range(x.size):
        out[i] += x[i]


@kernel
def solve_normal(c):
    """f.b <- N^-1 f.b, by factors that may be of an older configuration, such as q0."""
    l = c.chart
    lower, upper = (l.lower, l.upper) if l.state.made == 1 else (l.rows0.S, l.rows0.S)
    solve_product(c.graph, lower, upper, c.tangent.b)


@kernel
def find_normal_part(c):
    """s.r = n for the accelerations s.a; f.b are its multipliers, n = -Y0 f.b."""
    f, s = c.tangent, c.saddle
    # N^-1 (H a + gamma)
    if f.b.size > 0:
        multiply_rows(c.graph, f.rows, s.a, f.b)
        add_to(f.gamma, f.b)
        solve_normal(c)
    spread_normal(c, f.b)


@kernel
def spread_normal(c, b):
    """s.r = -Y0 b."""
    s = c.saddle
    for i in range(s.r.size):
        s.r[i] = 0.0
    apply_multipliers(c.graph, c.chart.rows0, b, s.r)


@kernel
def find_imbalance(c):
    """s.x = F - M (a + C n) - H^T lam, n = s.r, and zero for the rows. False if S is singular."""
    f, l, s, graph = c.tangent, c.chart, c.saddle, c.graph
    # M (a + C n)
    to_bodies(graph, l, s.r, f.Z)
    add_to(s.a, f.Z)
    for b in range(graph.bodies.shape[0]):
        weigh(graph.mass, b, f.Z, 8 * b, f.Z, 8 * b)
    # e = F - M (a + C n) - H^T lam
    for i in range(s.e.size):
        s.e[i] = s.loads[i] - f.Z[i]
    take_reactions(graph, f.rows, s.multipliers, s.e)
    if f.b.size > 0 and not _correct_multipliers(c):
        return False
    # In the order of elimination
    for i in range(s.x.size):
        s.x[i] = 0.0
    for b in range(graph.bodies.shape[0]):
        at, o = s.graph.body_at[b], 8 * b
        for i in range(degrees(graph, b)):
            s.x[at + i] = s.e[o + i + i // 3]
    return True


@kernel
def _correct_multipliers(c):
    """Correct lam by S^-1 H W e until H W e, e = F - M (a + C n) - H^T lam, is small; s.e = e. False if S is singular.

    The saddle-point matrix was formed with an older H, so the residual normal to the constraints is eliminated with the
    present one. S may be older, too, as long as corrections contract: at first it is that of the step's start.
    """
    w, f, s, graph, least, before, renewed = c.work, c.tangent, c.saddle, c.graph, 0.0, math.inf, False
    lean = graph.axes.rows.shape[0] > 0  # S is of another metric than W
    for sweep in range(REACTION_SWEEPS):
        # H W e, the part of the imbalance that multipliers can balance
        copy(s.e, f.Z)
        put(f.Z, 8 * graph.bodies.shape[0], splat(0.0))  # the ground
        put(f.Z, 8 * graph.bodies.shape[0] + 4, splat(0.0))
        weigh_bodies(graph, f.Z)
        multiply_rows(graph, f.rows, f.Z, f.b)
        worst = largest_residual(graph, w, f)
        if sweep == 0:
            least = REACTIONS_LEFT * worst
        if worst <= least:
            return True
        # Where W is that of raised inertias, N of the chart takes the place of S
        if lean:
            solve_normal(c)
        else:
            # S of an older configuration contracts no more
            if worst > SLOW * before and not renewed:
                w.counters.factorizations += 1
                if factorise_selected_rows(graph, f, f.rows, DYNAMICS) >= 0:
                    return False
                renewed = True
            solve_rows(graph, f.rows, f.b)
            clear_redundant(f, f.b)  # which others may have been when S was made
        # lam <- lam + dlam,  e <- e - H^T dlam
        add_to(f.b, s.multipliers)
        take_reactions(graph, f.rows, f.b, s.e)
        before = worst
    return True
