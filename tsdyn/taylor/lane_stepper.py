"""A Taylor step of every lane, as stepper.py makes one of one case: length, end, projection."""

import math

from ..elements.loops.constraint_rows import OMEGA, POSE, RD, P, R, orient
from ..elements.loops.constraint_series import BODY_ROW, S_OMEGA, S_R
from ..elements.loops.law_check import call_margin
from ..formulations.tolerances import LAND_SWEEPS, ROUNDING, ROUNDING_AT_MOST, STALLED, WALK
from ..jit.kernels import kernel, long_kernel
from ..jit.lanes import any_of, below, binary_log, binary_power, both, choose, either, every, floor, opposite
from ..jit.simd import add, first, fma, four, fourth, get, larger, let, put, second, splat, sub, third, times, total
from ..rows.interface import (
    DYNAMICS,
    ILL_CONDITIONED,
    evaluate_residuals,
    evaluate_without_redundant,
    factorise_selected_rows,
    find_correction,
)
from ..runs.step_control import stretch
from ..runs.tolerances import FROM_ZERO, SHORTEST
from .coefficients import begin, expand, put_sum
from .lane_memory import (
    BAD,
    BEFORE,
    DONE,
    FLOOR,
    INDICATOR,
    LEFT,
    LOST,
    MOVED,
    NEXT,
    RESIDUAL,
    RUNS,
    SIZE,
    SLOW,
    STEPS,
    T_NEXT,
    TOP,
    H,
    T,
)
from .layout import L_OMEGA, L_P, L_R, L_RD, LOW
from .step_end import keep_start, project_rates
from .step_length import largest_of_three, size_of_order
from .tolerances import (
    FAINT_LOGARITHM,
    HALVED,
    HALVINGS,
    LEAST_SIZE,
    MISSED,
    MOST_PARTS,
    NO_STEP,
    SMALL,
    SMALL_STEPS,
    STEP_COST,
    STIFF_RATES,
    STILL,
    WARY,
    WIDE,
)

# Projection of each lane onto the constraint manifold, as formulations/projection.py has it for one case.
#
# A lane that has landed is left as it is while others are still corrected, so none depends on its neighbours.


@kernel
def _is(c, i):
    """The lanes of which it is true."""
    return below(0.5, get(c.state, i))


@kernel
def _set(c, i, mask):
    let(c.state, i, choose(mask, 1.0, get(c.state, i)))


@kernel
def _largest_residual(c):
    """The largest |b|; infinity where an entry is not finite. In small scenes pure numbers count times the lever."""
    b, turns, floor = c.tangent.b, c.graph.turns, get(c.state, FLOOR)
    worst = rest = 0.0 * floor
    for e in range(b.size):
        # Not finite: 0 x is then no zero
        size = abs(get(b, e))
        if turns.size > 0 and turns[e] == 1.0:
            size *= min(floor / ROUNDING, 1.0)
        worst, rest = max(worst, size), rest + 0.0 * size
    return choose(below(-1.0, rest), worst, math.inf)


@long_kernel
def _displace(c, mask):
    """Displace the bodies by the smallest correction of the residuals b, in the lanes of the mask."""
    graph, f = c.graph, c.tangent
    find_correction(graph, f.rows, f.b, f.Z)
    moved = get(c.state, MOVED)
    for b in range(graph.bodies.shape[0]):
        at, o = b * POSE, 8 * b
        # Largest component of the displacement, lane by lane
        dr, turn = four(f.Z, o), four(f.Z, o + 4)
        for i in range(3):
            moved = max(moved, max(abs(get(f.Z, o + i)), abs(get(f.Z, o + 4 + i))))
        put(f.poses, at + R, choose(mask, add(four(f.poses, at + R), dr), four(f.poses, at + R)))
        if graph.bodies[b, 1] == 7:
            # Lanes outside of the mask keep their pose
            x, y, z = 0.5 * first(turn), 0.5 * second(turn), 0.5 * third(turn)
            p = four(f.poses, at + P)
            e0, e1, e2, e3 = first(p), second(p), third(p), fourth(p)
            p0 = e0 - e1 * x - e2 * y - e3 * z  # p <- p o (1, dpi' / 2)
            p1 = e1 + e0 * x - e3 * y + e2 * z
            p2 = e2 + e3 * x + e0 * y - e1 * z
            p3 = e3 - e2 * x + e1 * y + e0 * z
            scale = 1.0 / math.sqrt(p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)
            e0, e1 = choose(mask, p0 * scale, e0), choose(mask, p1 * scale, e1)
            e2, e3 = choose(mask, p2 * scale, e2), choose(mask, p3 * scale, e3)
            orient(f.poses, at, e0, e1, e2, e3)
    let(c.state, MOVED, choose(mask, moved, get(c.state, MOVED)))


@long_kernel
def _factorise(c):
    evaluate_without_redundant(c.graph, c.system.reals, c.tangent, c.tangent.rows, 0.0)
    factorise_selected_rows(c.graph, c.tangent, c.tangent.rows, DYNAMICS)


@long_kernel
def land(c):
    """Project positions onto the manifold; H, Y and the factors of S are those of the result. Sets BAD and RESIDUAL."""
    s, floor = c.state, get(c.state, FLOOR)
    # Numbers of lanes begin with 0.0 * floor, an array of the right width
    let(s, RESIDUAL, 0.0 * floor)
    let(s, MOVED, 0.0 * floor)
    let(s, DONE, 0.0 * floor)
    let(s, BEFORE, 0.0 * floor + math.inf)
    for sweep in range(LAND_SWEEPS):
        if sweep == 0:
            _factorise(c)
        else:
            evaluate_residuals(c.graph, c.system, c.tangent, 0.0)
        # Lanes that are still corrected
        worst, active = _largest_residual(c), opposite(_is(c, DONE))
        let(s, RESIDUAL, choose(active, max(get(s, RESIDUAL), worst), get(s, RESIDUAL)))
        # Converged, or falling no more; failed if that is above rounding
        ends = opposite(both(below(floor, worst), opposite(below(STALLED * get(s, BEFORE), worst))))
        fails = both(ends, below(ROUNDING_AT_MOST * floor, worst))
        _set(c, BAD, both(active, either(fails, opposite(below(worst, math.inf)))))
        _set(c, DONE, ends)
        _set(c, DONE, opposite(below(worst, math.inf)))
        if every(_is(c, DONE)):
            break
        # The others take one more correction
        goes_on = opposite(_is(c, DONE))
        let(s, BEFORE, choose(goes_on, worst, get(s, BEFORE)))
        _displace(c, goes_on)
    # Sweeps are used up
    _set(c, BAD, opposite(_is(c, DONE)))
    # H and S of the result serve velocities and the next step
    _factorise(c)
    walks = below(WALK * floor, _largest_residual(c))
    if any_of(walks):
        _displace(c, walks)


# State at the end of each lane's step: sums of the series, as taylor/step_end.py has them for one case.
#
# Each lane has its own order and length of step: coefficients above its order count as zero.


@kernel
def _coefficient(array, i, k, least, top):
    """Coefficient k of a series, at array[i]: zero in the lanes whose top is below k; least is the lowest top."""
    f = four(array, i)
    return f if k <= least else choose(below(k - 0.5, top), f, splat(0.0 * top))


@long_kernel
def sum_series(c, h, least, most):
    """The poses at h, of lanes, after orders up to TOP; least and most are those of all lanes."""
    graph, x, poses, s = c.graph, c.expansion, c.tangent.poses, splat(h)
    bodies, low, orders, top = x.bodies, x.low, x.order.room, get(c.state, TOP)
    for b in range(graph.bodies.shape[0]):
        # Horner's scheme for r and rd together; orders above a lane's own count as zero
        first, at, l = b * orders * BODY_ROW, b * POSE, LOW * b
        o, zero = first + S_R * orders, splat(0.0 * h)
        v, f, fd = four(bodies, o + 4), zero, zero
        for k in range(most + 1, 1, -1):  # r = r_0 + h (v + h f),  rd = v + h (2 f + h fd)
            fd = fma(fd, s, f)
            f = fma(f, s, _coefficient(bodies, o + 4 * k, k, least + 1, top + 1.0))
        # What the state lacks to rounding moves with it
        rest = fma(four(x.low_r2, 4 * b), s, four(low, l + L_RD))
        change = times(add(v, fma(f, s, rest)), s)
        put_sum(poses, at + R, four(bodies, o), add(change, four(low, l + L_R)), x.low_end, l + L_R)
        change = times(fma(fd, s, add(f, f)), s)
        put_sum(poses, at + RD, v, add(change, fma(four(x.low_r2, 4 * b), s, rest)), x.low_end, l + L_RD)
        if graph.bodies[b, 1] == 7:
            # omega'
            w, o = zero, first + S_OMEGA * orders
            for k in range(most, 0, -1):
                w = fma(w, s, _coefficient(bodies, o + 4 * k, k, least, top))
            change = fma(w, s, four(low, l + L_OMEGA))
            put_sum(poses, at + OMEGA, four(bodies, o), change, x.low_end, l + L_OMEGA)
            # Angle of the step, rad
            fast = 0.0 * h
            for i in range(3):
                fast = max(fast, max(abs(get(bodies, o + i)), abs(get(poses, at + OMEGA + i))))
            parts = floor(min(fast * abs(h), MOST_PARTS)) + 1.0  # in which p is followed: it and -p are the same A
            _turn(c, b, h, parts, least, most)


@kernel
def _sum_columns(c, first, until, h, least, most):
    """Columns of sum_{k >= until} A_k h^(k - until), of the body whose series begins at `first`."""
    x, top = c.expansion, get(c.state, TOP) + 1.0
    bodies, s = x.bodies, splat(h)
    u = v = w = splat(0.0 * h)
    for k in range(most + 1, until - 1, -1):
        i = first + 12 * k
        u = fma(u, s, _coefficient(bodies, i, k, least + 1, top))
        v = fma(v, s, _coefficient(bodies, i + 4, k, least + 1, top))
        w = fma(w, s, _coefficient(bodies, i + 8, k, least + 1, top))
    return u, v, w


@kernel
def _turn(c, b, h, parts, least, most):
    """A and p of body b at h: from the rotation of the step where it is narrow, else from A(h)."""
    x, poses, at = c.expansion, c.tangent.poses, b * POSE
    first, l = b * x.order.room * BODY_ROW, LOW * b + L_P
    # A_0^T A(h) = I + h A_0^T sum_{k>0} A_k h^(k-1)
    u, v, w = _sum_columns(c, first, 1, h, least, most)
    i, j, k = four(x.bodies, first), four(x.bodies, first + 4), four(x.bodies, first + 8)
    square = 1.0 + 0.25 * h * total(fma(i, u, fma(j, v, times(k, w))))  # d0^2
    narrow = both(below(WIDE, square), below(parts, 1.5))
    # d0^2 from the trace, d from the skew part
    if any_of(narrow):
        d0 = math.sqrt(max(square, WIDE))
        f = 0.25 * h / d0
        d1, d2 = f * total(sub(times(k, v), times(j, w))), f * total(sub(times(i, w), times(k, u)))
        d3 = f * total(sub(times(j, u), times(i, v)))
        d0 = -(d1 * d1 + d2 * d2 + d3 * d3) / (1.0 + d0)  # d0 - 1
        _compose(c, b, d0, d1, d2, d3)
    # Wide rotations: p from A(h), followed on the way
    if not every(narrow):
        e0, e1, e2, e3 = _follow(c, first, b, h, parts, least, most)
        let(poses, at + P, choose(narrow, get(poses, at + P), e0))
        let(poses, at + P + 1, choose(narrow, get(poses, at + P + 1), e1))
        let(poses, at + P + 2, choose(narrow, get(poses, at + P + 2), e2))
        let(poses, at + P + 3, choose(narrow, get(poses, at + P + 3), e3))
        for n in range(4):
            let(x.low_end, l + n, choose(narrow, get(x.low_end, l + n), 0.0))
    orient(poses, at, get(poses, at + P), get(poses, at + P + 1), get(poses, at + P + 2), get(poses, at + P + 3))


@long_kernel
def _compose(c, b, d0, d1, d2, d3):
    """p + low = p_0 o (1 + d0, d) of body b, of unit length."""
    x, poses, p, at, l = c.expansion, c.tangent.poses, c.tangent.p, b * POSE, LOW * b + L_P
    e0, e1, e2, e3 = get(x.start, 4 * b), get(x.start, 4 * b + 1), get(x.start, 4 * b + 2), get(x.start, 4 * b + 3)
    # p = p_0 + p_0 o (d0 - 1, d), added with compensation
    let(p, 0, e0 * d0 - e1 * d1 - e2 * d2 - e3 * d3)
    let(p, 1, e1 * d0 + e0 * d1 - e3 * d2 + e2 * d3)
    let(p, 2, e2 * d0 + e3 * d1 + e0 * d2 - e1 * d3)
    let(p, 3, e3 * d0 - e2 * d1 + e1 * d2 + e0 * d3)
    put_sum(poses, at + P, four(x.start, 4 * b), add(four(p, 0), four(x.low, l)), x.low_end, l)
    # Of unit length again: (1 - p.p) / 2 of p
    off = 1.0
    for n in range(4):
        off -= get(poses, at + P + n) * get(poses, at + P + n)
    change = fma(four(poses, at + P), splat(0.5 * off), four(x.low_end, l))
    put_sum(poses, at + P, four(poses, at + P), change, x.low_end, l)


@long_kernel
def _follow(c, first, b, h, parts, least, most):
    """p of body b at h, followed in so many parts of the step."""
    x, i = c.expansion, 1
    e0, e1, e2, e3 = get(x.start, 4 * b), get(x.start, 4 * b + 1), get(x.start, 4 * b + 2), get(x.start, 4 * b + 3)
    while True:
        # Lanes with fewer parts stay at their end
        on = below(i - 0.5, parts)
        if not any_of(on):
            return e0, e1, e2, e3
        u, v, w = _sum_columns(c, first, 0, h * i / parts, least, most)
        f0, f1, f2, f3 = _parameters(u, v, w, c.tangent.p, e0, e1, e2, e3)
        e0, e1, e2, e3 = choose(on, f0, e0), choose(on, f1, e1), choose(on, f2, e2), choose(on, f3, e3)
        i += 1


@kernel
def _parameters(u, v, w, p, e0, e1, e2, e3):
    """Euler parameters of the matrix with columns u, v, w, on the side of e0 to e3; from the largest of the four."""
    # Entries of the matrix
    put(p, 0, u)
    a, u1, u2 = get(p, 0), get(p, 1), get(p, 2)
    put(p, 0, v)
    v0, b, v2 = get(p, 0), get(p, 1), get(p, 2)
    put(p, 0, w)
    w0, w1, c = get(p, 0), get(p, 1), get(p, 2)
    # 4 e0 e, 4 e_i e_j and 4 e_i^2
    x, y, z = v2 - w1, w0 - u2, u1 - v0
    d, e, f = w1 + v2, u2 + w0, v0 + u1
    f0, f1, f2, f3 = 1.0 + a + b + c, 1.0 + a - b - c, 1.0 - a + b - c, 1.0 - a - b + c
    largest = max(max(f0, f1), max(f2, f3))
    # The first of the largest ones
    m0, m1, m2 = opposite(below(f0, largest)), opposite(below(f1, largest)), opposite(below(f2, largest))
    p0 = choose(m0, f0, choose(m1, x, choose(m2, y, z)))
    p1 = choose(m0, x, choose(m1, f1, choose(m2, f, e)))
    p2 = choose(m0, y, choose(m1, f, choose(m2, f2, d)))
    p3 = choose(m0, z, choose(m1, e, choose(m2, d, f3)))
    scale = 1.0 / math.sqrt(p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)
    # p and -p are the same orientation
    scale = choose(below(p0 * e0 + p1 * e1 + p2 * e2 + p3 * e3, 0.0), -scale, scale)
    return p0 * scale, p1 * scale, p2 * scale, p3 * scale


# Length and order of each lane's next step, as taylor/step_length.py has them for one case.
#
# Logarithms to base 2 throughout: the radius of convergence is the least of -log2(size_k) / k over the last orders k.


@kernel
def weights(c):
    """Set the floors of Phi; weights of the coefficients of r and of omega', and 1 + the largest rate, of each lane."""
    x, nb, orders, n = c.expansion, c.graph.bodies.shape[0], c.expansion.order.room, c.numbers
    far, fast, speed = splat(0.0), splat(0.0), splat(0.0)
    for b in range(nb):
        # Largest r, omega' and rd
        at = b * orders * BODY_ROW
        far, fast = larger(four(x.bodies, at + S_R * orders), far), larger(four(x.bodies, at + S_OMEGA * orders), fast)
        speed = larger(four(x.bodies, at + S_R * orders + 4), speed)
    far, fast, tol = largest_of_three(far), largest_of_three(fast), n.atol + n.rtol
    let(c.state, FLOOR, ROUNDING * (get(c.state, SIZE) + far))
    rate = 1.0 + max(fast, largest_of_three(speed))
    return tol / (n.atol + n.rtol * far), tol / (n.atol + n.rtol * fast), rate


@kernel
def _radii(c, least, most, far, fast):
    """log2 of the radius of convergence as the coefficients up to top + 1 have it, and up to top - 1.

    -inf where they are not finite, or vanish in a motion as slow as that: `order_in_range` is for a case alone.
    """
    x, nb, top = c.expansion, c.graph.bodies.shape[0], get(c.state, TOP)
    rho, lower, finite = 0.0 * top + math.inf, 0.0 * top + math.inf, 0.0 * top + 1.0
    for k in range(most + 1, max(least - 4, 2) - 1, -1):
        # Lanes whose order is lower ignore this coefficient
        size = size_of_order(x.bodies, nb, x.order.room, k, far, fast)
        own = below(k - 1.5, top)
        finite = choose(both(own, below(-1.0, 0.0 * size)), finite, choose(own, 0.0, finite))
        here = choose(below(LEAST_SIZE, size), binary_log(max(size, LEAST_SIZE)) * (-1.0 / k), math.inf)
        # Orders top + 1 to top - 2
        rho = choose(both(own, below(top - 2.5, k)), min(rho, here), rho)
        # Orders top - 1 to top - 4, for two orders less
        above = both(below(k - 0.5, top - 1.0), below(top - 4.5, k))
        lower = choose(above, min(lower, here), lower)
    likely = 0.0 * top - math.inf  # log2 of coefficient top + 1, from those of orders 4 and 5
    for k in range(4, 6):
        size = size_of_order(x.bodies, nb, x.order.room, k, far, fast)
        here = choose(below(0.0, size), binary_log(max(size, LEAST_SIZE)) * ((top + 1.0) / k), -math.inf)
        likely = max(likely, here)
    finite = choose(both(below(-math.inf, likely), below(likely, FAINT_LOGARITHM)), 0.0, finite)
    return choose(below(0.5, finite), rho, -math.inf), lower


@kernel
def _held(h, rate, k):
    """As of taylor/step_length.py; h as log2."""
    # Velocity error over its bound, as log2
    share = binary_log(STIFF_RATES * rate / k) + h
    return binary_power(choose(below(share, 0.0), h + 2.0 * share / k, h))


@long_kernel
def propose(c, least, most):
    """Set H and NEXT of each lane; least and most are the least and the highest TOP."""
    n, s, top, order = c.numbers, c.state, get(c.state, TOP), c.expansion.order
    far, fast, rate = weights(c)
    rho, lower = _radii(c, least, most, far, fast)
    # log2 of tol
    accuracy = math.log(n.atol + n.rtol) / math.log(2.0)
    h = choose(below(-math.inf, rho), _held(rho + accuracy / (top + 2.0), rate, top + 2.0), NO_STEP)
    if order.highest > order.lowest:
        # Higher order if it advances further per unit of work
        other = _held(lower + accuracy / top, rate, top)
        rises = below(other * (top + STEP_COST), h * (top + (STEP_COST - 2.0)))
        step = choose(rises, 1.0, -1.0 + 0.0 * top)
        let(s, NEXT, min(max(top + step, float(order.lowest)), float(order.highest)))
    h = min(h, n.max_step)
    if n.first_step > 0.0:
        h = choose(below(get(s, STEPS), 0.5), min(h, n.first_step), h)
    let(s, H, h)


# A Taylor step of every lane, as taylor/stepper.py makes one of one case.
#
# Each lane has its own time, order and length of step. All are expanded to the highest order among them, tried and
# projected together. A lane that can't go on as any other is LOST: its case is to be run alone, from its start.


@kernel
def orders(c):
    """The lowest and the highest TOP of the lanes that run."""
    s, least, most = c.single, 1 << 30, 0
    for l in range(s.shape[1]):
        if s[RUNS, l] != 0.0:
            least, most = min(least, int(s[TOP, l])), max(most, int(s[TOP, l]))
    return min(least, most), most


@long_kernel
def _expand(c, most):
    """The series of all lanes, from order zero on."""
    graph, system, x, f = c.graph, c.system, c.expansion, c.tangent
    keep_start(graph, f.poses, x.start)
    begin(graph, system, f.poses, x.order.room, x.bodies, f.Z)
    for k in range(most):
        expand(graph, system, k, k > 0 and k + 1 == most, False, x.order.refined, x, f)


@kernel
def _set_ends(c):
    """Where the step of each lane ends; lanes that run no case stay where they are."""
    s, n = c.single, c.numbers
    for l in range(s.shape[1]):
        t, h, end = s[T, l], s[H, l], s[T, l]
        if s[RUNS, l] != 0.0:
            # A step that is rounding of t loses the lane
            if t + h > t + SHORTEST * max(abs(t), FROM_ZERO * (n.t_end - n.t_start)):
                end = t + h
                if end + stretch(h, n.max_step) >= n.t_end:
                    end = n.t_end
            else:
                s[LOST, l] = 1.0
        s[T_NEXT, l], s[H, l] = end, end - t


@long_kernel
def reach(c, least, most):
    """The state of each lane at H, on the manifold. BAD where there is none."""
    sum_series(c, get(c.state, H), least, most)
    land(c)
    project_rates(c.graph, c.tangent, c.expansion.low_end, False)


@kernel
def _is_missed(c, again):
    """Whether lanes have missed the manifold: their steps are halved, or, if not to be tried `again`, they are lost."""
    s, tol, missed = c.single, c.numbers.atol + c.numbers.rtol, False
    for l in range(s.shape[1]):
        # As MISSED of taylor/stepper.py
        lands = s[BAD, l] == 0.0 and s[RESIDUAL, l] <= MISSED * (tol + s[FLOOR, l])
        if s[RUNS, l] != 0.0 and s[LOST, l] == 0.0 and not lands:
            if not again:
                s[LOST, l] = 1.0
                continue
            s[T_NEXT, l] = s[T, l] + HALVED * s[H, l]
            s[H, l] = s[T_NEXT, l] - s[T, l]
            missed = True
    return missed


@kernel
def _find_lost(c, mask):
    let(c.state, LOST, choose(mask, 1.0, get(c.state, LOST)))


@kernel
def _keep_away(c, most):
    """Lanes whose laws may not be analytic all along the step are LOST: alone, a case is checked against them."""
    x, s = c.expansion, c.state
    for i in range(x.forces.shape[0]):
        kind = x.forces[i]
        if kind.margin != 0:
            # Share of what laws divide by
            let(s, LEFT, 0.0 * get(s, H) + 1.0)
            call_margin(
                kind.margin, kind.count, kind.stride, kind.width, x.order.room, most, s[H:],
                x.loads[kind.values :], s[LEFT:],
            )  # fmt: skip
            short = below(STIFF_RATES * get(s, H), get(s, TOP))
            _find_lost(c, opposite(below(choose(short, STILL, 0.0 * get(s, H)), get(s, LEFT))))


@kernel
def try_step(c):
    """Expand the series of all lanes and reach the ends of their steps; returns the lowest and highest order."""
    # All lanes are expanded to the highest order
    let(c.state, TOP, get(c.state, NEXT))
    least, most = orders(c)
    _expand(c, most)
    # Lengths, ends, and lanes that need a check of their laws
    propose(c, least, most)
    _set_ends(c)
    _keep_away(c, most)
    for i in range(HALVINGS + 1):
        # Halve the steps that miss the manifold, then give these lanes up
        reach(c, least, most)
        if not _is_missed(c, i < HALVINGS):
            break
    return least, most


@kernel
def _weakest(c):
    """The singularity indicator of each lane: the smallest pivot relative to its diagonal entry."""
    values, graph = c.tangent.rows.S, c.graph
    least, kept = 1.0 + 0.0 * get(c.state, T), graph.pattern.shape[1]
    for e in range(graph.diagonal.size):
        share = get(values, graph.diagonal[e]) * get(values, kept + e)
        least = choose(below(share * least, 1.0), least, 1.0 / share)
    return least


@long_kernel
def accept(c):
    """The end of each lane's step is where its next one begins; LOST where that is not like any other."""
    s, x, h = c.state, c.expansion, get(c.state, H)
    far, poses = SMALL * get(s, FLOOR) / (ROUNDING * h), c.tangent.poses
    rest, still = 0.0 * h, below(-1.0, 0.0 * h)
    for b in range(c.graph.bodies.shape[0]):
        for i in range(3):
            # Steps in which nothing moves; numbers that aren't finite
            spin, speed = abs(get(poses, b * POSE + OMEGA + i)), abs(get(poses, b * POSE + RD + i))
            still = both(still, opposite(either(below(SMALL, spin * h), below(far, speed))))
            rest += 0.0 * spin + 0.0 * speed
    let(s, SLOW, choose(still, get(s, SLOW) + 1.0, 0.0))
    if c.numbers.leave_when_stiff == 1:
        _find_lost(c, below(SMALL_STEPS - 0.5, get(s, SLOW)))
    _find_lost(c, opposite(below(-1.0, rest)))
    # Near a singular configuration a case is run alone
    indicator = _weakest(c)
    _find_lost(c, opposite(below(max(ILL_CONDITIONED, WARY * get(s, INDICATOR)), indicator)))
    let(s, INDICATOR, max(get(s, INDICATOR), indicator))
    # The state moves on
    let(s, T, get(s, T_NEXT))
    let(s, STEPS, get(s, STEPS) + 1.0)
    for i in range(x.low.size):
        let(x.low, i, get(x.low_end, i))
    c.numbers.steps += 1
