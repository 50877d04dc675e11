"""The saddle-point matrix of a stage in the tangent form, without a basis: linearisation, factors, solves.

A Newton correction k of the accelerations of chart coordinates, with a = (rhodd, C etadd) of its tangent part, changes
positions by g^2 a and velocities by g a + B g^2 a:

    [ M - g C_b - g^2 K_b    H^T ] [ a    ]     [ M r ]
    [ H                      0   ] [ dlam ]  =  [ 0   ]       r = f(k) - k, its tangent part

K_b and C_b are those of body_stiffness.py and chart_derivatives.py. The normal part of a correction is that of r: the
position solve removes it. Changes of the normal parts of velocities and accelerations with the configuration, of the
order of g omega, are neglected.
"""

from ..elements.loops.body_poses import OMEGA, POSE, write_positions, write_velocities
from ..errors import Status
from ..jit.kernels import callback, kernel, stack, stack2, vector
from ..jit.simd import add, cross, fma, four, lanes, put, splat, sub
from ..maths.dense_linalg import copy
from ..rows.interface import (
    DYNAMICS,
    apply_multipliers,
    factorise_saddle,
    factorise_selected_rows,
    inner,
    more,
    multiply_rows,
    solve_product,
    solve_saddle,
    weigh,
    write_saddle_rows,
)
from ..sparse.constraint_graph import W_MASS, W_ROTATION, WEIGHTS
from ..sparse.saddle_graph import BLOCK, LOWER, OWN, UPPER
from ..workspaces.workspace import load
from .accelerations import solve_accelerations
from .body_stiffness import add_constraints, add_forces
from .chart_coordinates import factorise_normal, to_bodies
from .chart_derivatives import acceleration_by_turn, add_gyroscopic, add_inertia, rate_by_turn
from .friction_loads import body_of

OK, SINGULAR = int(Status.SUCCESS), int(Status.SINGULAR)


@callback("pdp")
def linearise(context, t, yd):
    """Request new derivatives of the force laws from the next `reduce`, and solve for multipliers. Status."""
    c = load(context)
    system, w, f, graph = c.system, c.work, c.tangent, c.graph
    c.linear.numbers.fresh = 1
    w.counters.jacobians += 1
    # Multipliers of the present state, for the geometric stiffness
    if is_direct(graph):
        w.counters.factorizations += 1
        if f.b.size > 0 and factorise_selected_rows(graph, f, f.rows, DYNAMICS) >= 0:
            return SINGULAR
        solve_accelerations(graph, system, w, f, t)
    return OK


@kernel
def is_direct(graph):
    """Whether stage_equations.py solves the stages: reactions on which friction depends are found by `accelerate`."""
    return graph.frictions.shape[0] == 0


@callback("pd")
def reduce(context, t):
    """Set K and C at the state of the last accelerations.

    Multipliers and accelerations are those after the last Newton correction, since stiff forces make those of an
    unconverged state large. After `linearise` they are those of the state.
    """
    c = load(context)
    system, w, f, s, graph = c.system, c.work, c.tangent, c.saddle, c.graph
    if c.linear.numbers.fresh == 1:
        copy(f.b, s.multipliers)
        copy(f.Z, s.a)
    for i in range(s.K.size):
        s.K[i] = s.C[i] = 0.0
    # K_b = (F - H^T lam)_(r, pi'),  C_b = F_(rd, omega')
    write_positions(graph.bodies, f.poses, w.q)
    write_velocities(graph.bodies, f.poses, w.qd)
    if system.forces.shape[0] > 0:
        add_forces(system, w, s, t, c.linear.numbers.fresh, c.linear.kept, f.Q)
    c.linear.numbers.fresh = 0
    add_constraints(system, w, s, t, s.multipliers)
    _add_turns(graph, f, c.chart, s)
    return OK


@kernel
def _add_turns(graph, f, l, s):
    """What the rotations of bodies add to K and C, which hold forces and constraints."""
    B, E = stack2(3, 3), stack2(3, 3)
    for b in range(graph.bodies.shape[0]):
        if graph.bodies[b, 1] == 7:
            # C: the gyroscopic torque. B: omega' by pi' at constant rates of chart coordinates
            add_gyroscopic(graph.mass, WEIGHTS * b + W_ROTATION, f.poses, POSE * b + OMEGA, s.C[BLOCK * b :])
            rate_by_turn(l.d, 4 * b, l.y, 8 * b + 4, B)
            for i in range(9):
                s.B[9 * b + i] = B[i // 3, i % 3]
    for i in range(s.graph.blocks.shape[0]):
        # K += C B: velocities that a rotation changes are damped
        column = s.graph.blocks[i].column
        if graph.bodies[column, 1] == 7:
            _turn_damping(s, BLOCK * i, 9 * column)
    for b in range(graph.bodies.shape[0]):
        if graph.bodies[b, 1] == 7:
            # J' times the change of C etadd
            acceleration_by_turn(l.d, 4 * b, f.poses, POSE * b + OMEGA, s.a, 8 * b + 4, E)
            for i in range(9):
                B[i // 3, i % 3] = s.B[9 * b + i]
            K, C = s.K[BLOCK * b :], s.C[BLOCK * b :]
            add_inertia(graph.mass, WEIGHTS * b + W_ROTATION, E, B, l.d, 4 * b, f.poses, POSE * b + OMEGA, K, C)


@kernel
def _turn_damping(s, i, j):
    """K += C B of a block, its columns of rotations."""
    for r in range(6):
        at = i + 6 * r + 3
        x, y, z = s.C[at], s.C[at + 1], s.C[at + 2]
        for c in range(3):
            s.K[at + c] += x * s.B[j + c] + y * s.B[j + 3 + c] + z * s.B[j + 6 + c]


@kernel
def degrees(graph, b):
    """Unknowns of a body."""
    return 6 if graph.bodies[b, 1] == 7 else 3


@kernel
def _mass(graph, b, r, c):
    """An entry of the mass matrix of a body in (r, pi')."""
    if r < 3 and c < 3:
        return graph.mass[WEIGHTS * b + W_MASS] if r == c else 0.0
    return graph.mass[WEIGHTS * b + W_ROTATION + 4 * (c - 3) + r - 3] if r >= 3 and c >= 3 else 0.0


@kernel
def add_blocks(graph, s, upper, lower, g, masses):  # six: the graph, a matrix and what is added to it
    """Add - g C_b - g^2 K_b, and M if asked for, to the entries of the factors; g and the factors may be complex."""
    for i in range(s.graph.blocks.shape[0]):
        block, o = s.graph.blocks[i], BLOCK * i
        rows, columns = degrees(graph, block.row), degrees(graph, block.column)
        for r in range(rows):
            for c in range(columns):
                # M - g C_b - g^2 K_b
                x = -g * (s.C[o + 6 * r + c] + g * s.K[o + 6 * r + c])
                if masses and block.place == OWN:
                    x += _mass(graph, block.row, r, c)
                # A block on the diagonal is in both factors; `lower` holds its transpose
                if block.place != LOWER:
                    more(upper, block.target + block.stride * r + c, x)
                if block.place != UPPER:
                    more(lower, block.target + block.stride * c + r, x)


@kernel
def _write_frictions(graph, f, s):
    """H^T - g N_lam in place of H^T: what the reactions of a joint change of its friction."""
    change = stack(8)
    for i in range(graph.frictions.shape[0]):
        friction = graph.frictions[i]
        # F_n,i by the reaction
        change[3] = change[7] = 0.0
        for c in range(3):
            change[c], change[4 + c] = f.friction.load[7 * i + 1 + c], f.friction.load[7 * i + 4 + c]
        for k in range(2):
            # g_i as a load: M times W g_i
            b = body_of(friction, k)
            if b < graph.bodies.shape[0]:
                weigh(graph.mass, b, f.friction.g, 16 * i + 8 * k, s.e, 8 * b)
        for j in range(friction.first, friction.first + friction.count):
            # - g_i F_n,i,lam in the columns of the joint's multipliers
            e, side = graph.friction_rows[j]
            n = inner(f.rows.H, 16 * e + 8 * side, change, 0)
            for k in range(2):
                b, base, step = graph.sides[e, k], s.graph.sides[e, k, 0], s.graph.sides[e, k, 1]
                if base >= 0 and b in (friction.body_a, friction.body_b):
                    right = s.lower if step == 1 else s.upper  # where the row is eliminated before the body, or not
                    for c in range(degrees(graph, b)):
                        more(right, base + step * c, n * s.e[8 * b + c + c // 3])


@callback("pd")
def factorise(context, g):
    """Factors of the saddle-point matrix at the present H. Status."""
    c = load(context)
    f, s, graph = c.tangent, c.saddle, c.graph
    # H and H^T, then the blocks of bodies between them
    write_saddle_rows(graph, f, s)
    add_blocks(graph, s, s.upper, s.lower, g, True)
    _write_frictions(graph, f, s)
    c.work.counters.iteration_matrices += 1
    # Stages that solve for u and z by themselves begin with these factors of N
    if is_direct(graph) and f.b.size > 0 and not factorise_normal(graph, c.work, f, c.chart):
        return SINGULAR
    return OK if factorise_saddle(s) else SINGULAR


@kernel
def _take_tangent_part(graph, f, l, x, factored, out):
    """out ((nb + 1) 8,) = x - Y0 n, n = N^-1 H (x as a motion of bodies); Z = out as one.

    Where there are no factors of N, those of S serve, twice: normal parts and those of stiff modes may be large.
    """
    # x, the ground at rest
    for i in range(x.size):
        out[i] = x[i]
    for i in range(x.size, out.size):
        out[i] = 0.0
    lower, upper = l.lower if factored else f.rows.S, l.upper if factored else f.rows.S
    for _ in range((1 if factored else 2) if f.b.size > 0 else 0):
        # n = N^-1 H x,  x <- x - Y0 n
        to_bodies(graph, l, out, f.Z)
        multiply_rows(graph, f.rows, f.Z, f.b)
        solve_product(graph, lower, upper, f.b)
        apply_multipliers(graph, l.rows0, f.b, out)
    to_bodies(graph, l, out, f.Z)


@kernel
def _weigh(graph, s, Z):
    """s.x = M Z, and zero for the rows."""
    for i in range(s.x.size):
        s.x[i] = 0.0
    for b in range(graph.bodies.shape[0]):
        # Unknowns are in the order of elimination
        at, o, m = s.graph.body_at[b], 8 * b, WEIGHTS * b
        for c in range(3):
            s.x[at + c] = graph.mass[m + W_MASS] * Z[o + c]
        if graph.bodies[b, 1] == 7:
            for c in range(3):
                j = m + W_ROTATION + c
                s.x[at + 3 + c] = graph.mass[j] * Z[o + 4] + graph.mass[j + 4] * Z[o + 5] + graph.mass[j + 8] * Z[o + 6]


@kernel
def _add_stiffness(graph, s, g, Z):
    """s.x += g K Z."""
    for i in range(s.graph.blocks.shape[0]):
        block, o = s.graph.blocks[i], BLOCK * i
        at, z = s.graph.body_at[block.row], 8 * block.column
        columns = degrees(graph, block.column)
        for r in range(degrees(graph, block.row)):
            x = 0.0
            for c in range(columns):
                x += s.K[o + 6 * r + c] * Z[z + c + c // 3]
            s.x[at + r] += g * x


@kernel
def turned_back(l, b, s, at):
    """The rotation s.x[at : at + 3] of body b in chart coordinates: C^-1 = d0 I + d~."""
    d0 = 1.0 + l.d[4 * b + 3]
    d = lanes(l.d[4 * b], l.d[4 * b + 1], l.d[4 * b + 2])
    a = lanes(s.x[at], s.x[at + 1], s.x[at + 2])
    return fma(a, splat(d0), cross(d, a))


@kernel
def _correct(graph, l, s, x, r):
    """Solve for s.x, and replace the tangent part r of x by the solution in chart coordinates."""
    solve_saddle(s)
    for b in range(graph.bodies.shape[0]):
        # x <- x - r + C^-1 times the solution
        at, o = s.graph.body_at[b], 8 * b
        for c in range(3):
            x[o + c] += s.x[at + c] - r[o + c]
        if graph.bodies[b, 1] == 7:
            turned = turned_back(l, b, s, at + 3)
            put(x, o + 4, add(four(x, o + 4), sub(turned, four(r, o + 4))))


@kernel
def take_solution(graph, s):
    """Add s.x to multipliers and accelerations."""
    for e in range(s.multipliers.size):
        if s.graph.row_at[e] >= 0:
            s.multipliers[e] += s.x[s.graph.row_at[e]]
    for b in range(graph.bodies.shape[0]):
        for i in range(degrees(graph, b)):
            s.a[8 * b + i + i // 3] += s.x[s.graph.body_at[b] + i]


@callback("pp")
def solve(context, x):
    """x (8 b,) <- the Newton correction for the residual x of the accelerations."""
    c = load(context)
    f, l, s, graph = c.tangent, c.chart, c.saddle, c.graph
    x = vector(x, l.x.size - 8)
    # Accelerations and multipliers of the iterate k: those of the state, less the residual x
    copy(f.b, s.multipliers)
    to_bodies(graph, l, x, s.e)
    for i in range(s.a.size):
        s.a[i] = f.Z[i] - s.e[i]
    # Right-hand side M r
    _take_tangent_part(graph, f, l, x, l.state.factored == 1, s.r)
    _weigh(graph, s, f.Z)
    _correct(graph, l, s, x, s.r)
    take_solution(graph, s)
    return OK


@callback("ppdp")
def soften(context, ex, g, ey):
    """(ex, ey) <- (I - g J)^-1 (ex, ey), as linearisation.soften.

    (M - g C - g^2 K) a + H^T dlam = M ey + g K ex,    ey <- a,    ex <- ex + g a
    """
    c = load(context)
    f, l, s, graph = c.tangent, c.chart, c.saddle, c.graph
    ex, ey = vector(ex, l.x.size - 8), vector(ey, l.x.size - 8)
    # M ey
    _take_tangent_part(graph, f, l, ey, True, s.r)  # N is that of the chart's check
    _weigh(graph, s, f.Z)
    # + g K ex
    _take_tangent_part(graph, f, l, ex, True, s.e)
    _add_stiffness(graph, s, g, f.Z)
    _correct(graph, l, s, ey, s.r)
    for i in range(ex.size):
        ex[i] += g * ey[i]
    return OK
