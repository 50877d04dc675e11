"""Residuals of the rows at all three levels, and what they change: positions, velocities, accelerations side by side.

levels (4 m,): of each row the values of the three levels and a zero.
"""

from ..elements.loops.body_poses import POSE, RD
from ..jit.kernels import kernel
from ..jit.simd import first, fma, four, lanes, put, second, splat, third, total
from ..sparse.three_sides import solve_three


@kernel
def level_residuals(graph, f, a, drift, levels):
    """levels = Phi, H (rd, omega') + Phi_t and H a + gamma at the poses of f, Phi being f.b."""
    H = f.rows.H
    for e in range(graph.sides.shape[0]):
        x, z = splat(0.0), splat(0.0)
        for k in range(2):
            at, b = 16 * e + 8 * k, graph.sides[e, k]
            h, turn = four(H, at), four(H, at + 4)
            x = fma(h, four(f.poses, b * POSE + RD), fma(turn, four(f.poses, b * POSE + RD + 4), x))
            z = fma(h, four(a, 8 * b), fma(turn, four(a, 8 * b + 4), z))
        put(levels, 4 * e, lanes(f.b[e], total(x) + drift[e], total(z) + f.gamma[e]))


@kernel
def correct_levels(graph, rows, lower, upper, levels, motions):
    """levels <- N^-1 levels; motions (4 (b + 1) 8,) -= Y^T levels, (b + 1) 8 floats of each level.

    lower and upper are the factors of N, rows those at q0 of the chart.
    """
    solve_three(graph.pattern, lower, upper, levels)
    step = motions.size // 3
    for e in range(graph.sides.shape[0]):
        f = four(levels, 4 * e)
        x, y, z = splat(-first(f)), splat(-second(f)), splat(-third(f))
        for k in range(2):
            at, o = 16 * e + 8 * k, 8 * graph.sides[e, k]
            for half in range(0, 8, 4):
                row, i = four(rows.Y, at + half), o + half
                put(motions, i, fma(row, x, four(motions, i)))
                put(motions, i + step, fma(row, y, four(motions, i + step)))
                put(motions, i + 2 * step, fma(row, z, four(motions, i + 2 * step)))
