"""The saddle-point matrix of a stage in the tangent form: stiffness of bodies, linearisation, factors, solves."""

from ..elements.loops.constraint_rows import OMEGA, POSE, write_positions, write_velocities
from ..elements.loops.coordinate_rows import call_kind
from ..elements.loops.friction import DERIVE
from ..errors import Status
from ..jit.kernels import callback, kernel, long_kernel, stack, stack2, vector
from ..jit.simd import add, cross, fma, four, lanes, put, splat, sub
from ..maths.dense_linalg import clear_matrix, copy
from ..model.equations import applied_forces, call_jacobian, call_stiffness
from ..rows.constraint_graph import W_MASS, W_ROTATION, WEIGHTS
from ..rows.interface import (
    DYNAMICS,
    apply_multipliers,
    factorise_saddle,
    factorise_selected_rows,
    inner,
    more,
    multiply_inertia_rows,
    multiply_rows,
    solve_product,
    solve_saddle,
    weigh,
    weigh_selected_rows,
    write_saddle_rows,
)
from ..rows.saddle_matrix import BLOCK, LOWER, OWN, UPPER
from ..workspaces import load
from .accelerations import body_of, call_friction, find_loads, solve_accelerations
from .charts import acceleration_by_turn, add_gyroscopic, add_inertia, factorise_normal, rate_by_turn, to_bodies

# Stiffness and damping blocks of bodies: exact derivatives of their loads by (r, pi') and (rd, omega').
#
#     K_b = (F - H^T lam)_(r, pi') at constant lam,    C_b = F_(rd, omega')
#
# Forces and constraints give derivatives of generalised forces Q in the coordinates of their two bodies. With dp =
# G^T dpi' / 2 and the body torque tau' = G Q_p / 2, a change of p also turns what Q_p is a torque about, and, at
# constant omega', changes pd:
#
#     dtau' = G dQ_p / 2 - G(Q_p) G^T dpi' / 4
#     dpd   = G^T (domega' + dpi' x omega' / 2) / 2 - (omega' . dpi') p / 4


@kernel
def _half_g(p, i, G):
    """G(p) / 2, p being p[i : i + 4]."""
    e0, e1, e2, e3 = 0.5 * p[i], 0.5 * p[i + 1], 0.5 * p[i + 2], 0.5 * p[i + 3]
    G[0, 0], G[0, 1], G[0, 2], G[0, 3] = -e1, e0, e3, -e2
    G[1, 0], G[1, 1], G[1, 2], G[1, 3] = -e2, -e3, e0, e1
    G[2, 0], G[2, 1], G[2, 2], G[2, 3] = -e3, e2, -e1, e0


@kernel
def _frames(s, dimension, i, G, P):
    """G(p) / 2 of a body at s.q[i], and dpd by dpi', transposed; zero for what has no orientation."""
    if dimension != 7:
        clear_matrix(G)
        clear_matrix(P)
        return
    _half_g(s.q, i + 3, G)
    # omega' = 2 G pd
    omega = stack(3)
    for c in range(3):
        omega[c] = 0.0
        for d in range(4):
            omega[c] += 4.0 * G[c, d] * s.qd[i + 3 + d]
    # Row c is dpd for dpi' = e_c: G^T (e_c x omega') / 4 - omega'_c p / 4
    for c in range(3):
        x, y = (c + 1) % 3, (c + 2) % 3  # e_c x omega' = -omega'_y e_x + omega'_x e_y
        for d in range(4):
            P[c, d] = 0.5 * (omega[x] * G[y, d] - omega[y] * G[x, d]) - 0.5 * (0.5 * omega[c] * s.q[i + 3 + d])


@kernel
def _add_columns(X, i, j, G, scale, out):
    """Add to a block its columns of translations: scale times rows i and columns j on of X."""
    # K_rr += X_rr,  K_pi'r += G X_pr / 2
    for c in range(3):
        for r in range(3):
            total = 0.0
            for d in range(4):
                total += G[r, d] * X[i + 3 + d, j + c]
            out[6 * r + c] += scale * X[i + r, j + c]
            out[18 + 6 * r + c] += scale * total


@kernel
def _add_rotations(X, i, j, G, H, scale, out):
    """The same of its columns of rotations, H being dp or dpd by them, transposed."""
    y = stack(4)
    for c in range(3):
        # X_pp times the change of p, or of pd, by a rotation about axis c
        for d in range(4):
            y[d] = 0.0
            for e in range(4):
                y[d] += X[i + 3 + d, j + 3 + e] * H[c, e]
        # K_r,pi' += X_rp dp,  K_pi',pi' += G X_pp dp / 2
        for r in range(3):
            total, turned = 0.0, 0.0
            for d in range(4):
                total += X[i + r, j + 3 + d] * H[c, d]
                turned += G[r, d] * y[d]
            out[6 * r + 3 + c] += scale * total
            out[21 + 6 * r + c] += scale * turned


@kernel
def _add_turned_torque(Q, q, i, scale, out):
    """Add -scale G(Q_p) G(p)^T / 4, Q_p and p being at i + 3."""
    G, H = stack2(3, 4), stack2(3, 4)
    # The torque G(p) Q_p / 2 changes with G at constant Q_p
    _half_g(Q, i + 3, G)
    _half_g(q, i + 3, H)
    for r in range(3):
        for c in range(3):
            total = 0.0
            for d in range(4):
                total += G[r, d] * H[c, d]
            out[21 + 6 * r + c] -= scale * total


@kernel
def _block(one, k, l):
    """The block of the loads on body k by the motion of body l, 0 for a and 1 for b; -1 for none."""
    if k == 0:
        return one.aa if l == 0 else one.ab
    return one.ba if l == 0 else one.bb


@long_kernel
def _spread(s, one, scale, damped):
    """Add scale s.X to K; with damping, scale s.Xd to C and its effect on rotated velocities to K."""
    G0, G1, P0, P1 = stack2(3, 4), stack2(3, 4), stack2(3, 4), stack2(3, 4)
    # dp and dpd of a rotation, for both bodies
    _frames(s, s.own[2], 0, G0, P0)
    _frames(s, s.own[3], 7, G1, P1)
    for k in range(2):
        for l in range(2):
            block = _block(one, k, l)
            if block >= 0:
                # Loads on body k by the motion of body l
                G, H, P = G0 if k == 0 else G1, G0 if l == 0 else G1, P0 if l == 0 else P1
                K, C = s.K[BLOCK * block :], s.C[BLOCK * block :]
                _add_columns(s.X, 7 * k, 7 * l, G, scale, K)
                _add_rotations(s.X, 7 * k, 7 * l, G, H, scale, K)
                # At constant omega' a rotation changes pd: that part of the damping is a stiffness
                if damped:
                    _add_columns(s.Xd, 7 * k, 7 * l, G, scale, C)
                    _add_rotations(s.Xd, 7 * k, 7 * l, G, H, scale, C)
                    _add_rotations(s.Xd, 7 * k, 7 * l, G, P, scale, K)


@kernel
def _take_bodies(w, s, one):
    """Coordinates and velocities of an instance's bodies, and its table as if there were no others."""
    for k in range(2):
        at, dimension = (one.at_a, one.size_a) if k == 0 else (one.at_b, one.size_b)
        s.own[2 + k] = dimension
        for c in range(7):
            s.q[7 * k + c] = w.q[at + c] if c < dimension else 0.0
            s.qd[7 * k + c] = w.qd[at + c] if c < dimension else 0.0
    clear_matrix(s.X)


@kernel
def add_forces(system, w, s, t, renew, kept, Q):
    """K and C of the forces; with `renew` derivatives of the laws are evaluated and stored, else stored ones serve."""
    for i in range(Q.size):
        Q[i] = 0.0
    applied_forces(system, w.q, w.qd, t, Q)
    # Each instance has coordinates of its own, as if there were no other bodies
    for i in range(s.graph.forces.shape[0]):
        one = s.graph.forces[i]
        _take_bodies(w, s, one)
        clear_matrix(s.Xd)
        reals, own = system.reals[one.reals :], kept[one.kept :]
        call_jacobian(one.loop, one, s.own, reals, s.q, s.qd, t, s.X, s.Xd, renew, own)
        _spread(s, one, 1.0, True)
    # tau' = G Q_p / 2 of all applied forces turns with the body
    for b in range(system.bodies.shape[0]):
        if system.bodies[b, 1] == 7:
            _add_turned_torque(Q, w.q, system.bodies[b, 0], 1.0, s.K[BLOCK * b :])


@kernel
def add_constraints(system, w, s, t, lam):
    """K -= (H^T lam)_(r, pi'): the geometric stiffness of the reactions."""
    for i in range(s.graph.constraints.shape[0]):
        one, size = s.graph.constraints[i], 0.0
        copy(lam[one.row : one.row + one.rows], s.lam)
        for r in range(one.rows):
            size += abs(s.lam[r])
        # No reaction, no geometric stiffness
        if size == 0.0:
            continue
        _take_bodies(w, s, one)
        clear_matrix(s.rows)
        reals = system.reals[one.reals :]
        # Phi_q of the instance, then X = (Phi_q^T lam)_q
        call_kind(one.rows_loop, 1, one.stride, s.own, reals, s.q, s.qd, t, s.rows)
        call_stiffness(one.loop, 1, one.stride, s.own, reals, s.q, t, s.lam, s.X)
        # R = Phi_q^T lam, whose torque turns with the body
        for c in range(14):
            s.R[c] = 0.0
            for r in range(one.rows):
                s.R[c] += s.lam[r] * s.rows[r, c]
        _spread(s, one, -1.0, False)
        for k in range(2):
            block = _block(one, k, k)
            if block >= 0 and s.own[2 + k] == 7:
                _add_turned_torque(s.R, s.q, 7 * k, -1.0, s.K[BLOCK * block :])


# The saddle-point matrix of a stage in the tangent form, without a basis: linearisation, factors, solves.
#
# A Newton correction k of the accelerations of chart coordinates, with a = (rhodd, C etadd) of its tangent part,
# changes positions by g^2 a and velocities by g a + B g^2 a:
#
#     [ M - g C_b - g^2 K_b    H^T ] [ a    ]     [ M r ]
#     [ H                      0   ] [ dlam ]  =  [ 0   ]       r = f(k) - k, its tangent part
#
# K_b and C_b are those above, and what chart coordinates add to them (charts.py). The normal part of a
# correction is that of r: the position solve removes it. Changes of the normal parts of velocities and accelerations
# with the configuration, of the order of g omega, are neglected.

OK, SINGULAR = int(Status.SUCCESS), int(Status.SINGULAR)


@callback("pdp")
def linearise(context, t, yd):
    """Request new derivatives of the force laws from the next `reduce`, and solve for multipliers. Status."""
    c = load(context)
    system, w, f, graph = c.system, c.work, c.tangent, c.graph
    c.linear.numbers.fresh = 1
    w.counters.jacobians += 1
    # Multipliers of the present state, for the geometric stiffness and for friction
    w.counters.factorizations += 1
    if graph.frictions.shape[0] > 0:
        copy(c.saddle.multipliers, f.friction.lam)
        weigh_selected_rows(graph, f.rows)
        return call_friction(graph.friction_solver[0], context, t, yd)
    if f.b.size > 0 and factorise_selected_rows(graph, f, f.rows, DYNAMICS) >= 0:
        return SINGULAR
    solve_accelerations(graph, system, w, f, t)
    return OK


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
def write_rows(c):
    """Set the matrix to H and H^T at the present configuration; with friction to H^T - g N_lam in place of H^T."""
    f, s, graph = c.tangent, c.saddle, c.graph
    write_saddle_rows(graph, f, s)
    if graph.frictions.shape[0] > 0:
        find_loads(graph, c.system, f, c.work.q, s.multipliers, DERIVE)
        _write_frictions(graph, f, s)


@kernel
def _write_frictions(graph, f, s):
    """Add - g N_lam: what the reactions of a joint change of its friction."""
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
    write_rows(c)
    add_blocks(graph, s, s.upper, s.lower, g, True)
    c.work.counters.iteration_matrices += 1
    # Stages begin with these factors of N
    if f.b.size > 0 and not factorise_normal(graph, c.work, f, c.chart):
        return SINGULAR
    return OK if factorise_saddle(s) else SINGULAR


@kernel
def _take_tangent_part(graph, f, l, x, out):
    """out ((nb + 1) 8,) = x - Y0 n, n = N^-1 H (x as a motion of bodies); Z = out as one."""
    # x, the ground at rest
    for i in range(x.size):
        out[i] = x[i]
    for i in range(x.size, out.size):
        out[i] = 0.0
    if f.b.size > 0:
        # n = N^-1 H x,  x <- x - Y0 n
        to_bodies(graph, l, out, f.Z)
        multiply_rows(graph, f.rows, f.Z, f.b)
        solve_product(graph, l.lower, l.upper, f.b)
        apply_multipliers(graph, l.rows0, f.b, out)
    to_bodies(graph, l, out, f.Z)


@kernel
def _weigh(graph, f, s, Z):
    """s.x = M Z, h Z of inertia rows, and zero for the rows of Phi."""
    for i in range(s.x.size):
        s.x[i] = 0.0
    multiply_inertia_rows(graph, f.rows, s.graph.row_at, Z, s.x)
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


@callback("ppdp")
def soften(context, ex, g, ey):
    """(ex, ey) <- (I - g J)^-1 (ex, ey), as linearisation.soften.

    (M - g C - g^2 K) a + H^T dlam = M ey + g K ex,    ey <- a,    ex <- ex + g a
    """
    c = load(context)
    f, l, s, graph = c.tangent, c.chart, c.saddle, c.graph
    ex, ey = vector(ex, l.x.size - 8), vector(ey, l.x.size - 8)
    # M ey
    _take_tangent_part(graph, f, l, ey, s.r)  # N is that of the chart's check
    _weigh(graph, f, s, f.Z)
    # + g K ex
    _take_tangent_part(graph, f, l, ex, s.e)
    _add_stiffness(graph, s, g, f.Z)
    _correct(graph, l, s, ey, s.r)
    for i in range(ex.size):
        ex[i] += g * ey[i]
    return OK
