"""Series of forces against their laws, at a place of a Taylor step.

A law may change within less than a series shows: the series of v / sqrt(v^2 + v_0^2) at v >> v_0 doesn't contain the
reversal at v = 0, that of |v| at v > 0 is v, and a pulse is zero to any order long before. The law itself, or the
program of a traced function, is therefore evaluated at x(tau) and xd(tau), and must be f(tau). What f lacks may be as
large as

    MOST (atol + rtol |xd|) / (w h)     w: what the force accelerates by, so that w f h is a velocity
    a small part of the terms of f      rounding

Where a law is analytic while some rows a of its scratch are positive (`Force.positive`), and

    a_0 > sum_{k>0} |a_k| h^k                                                                                  (1)

none of them vanishes within the step, and nothing else is evaluated. Past a zero of d the series of |d| goes on as
-|d|, which no coefficient shows.
"""

from ...jit.kernels import ANY, caller, data_of, integers, kernel, matrix, part, stack, vector
from ...jit.simd import first, fma, four, get, let, put, second, splat, third, times
from ...maths.tolerances import PIVOT_ROUNDING, TINY
from ...motions.tracing import LENGTH as PROGRAM_LENGTH
from ...motions.tracing import T
from ..markers import PARAMETERS, POINT, TURN
from ..tolerances import LAW_TOLERANCE
from .constraint_series import BODY_ROW, S_OMEGA
from .force_series import BODY, INTS, MASK, marker_coefficient, run_traced, scratch_rows
from .friction import load_at
from .template import (
    CODES,
    FRICTIONAL,
    MARKERS,
    OWNERS,
    POSITIVE,
    ROOM,
    SHARP,
    SIZE,
    STARTS,
    TRACED,
    extent,
    kernel_law,
    kernel_series,
)

# what runs a program, orders that are known, extent, limits, table, reals, bodies, values, inverse
SIGNATURE = "iippppppp"
# numbers of `limits`: place and length of the step, tolerances, velocity that f may be off by over them; out: that
# velocity over what it may be
TAU, TIME, LENGTH, ATOL, RTOL, MOST, EXCESS, LIMITS = range(8)
MARGIN = "ipppp"  # orders that are known, extent, h, values, least
call_check, call_margin = caller(SIGNATURE), caller(MARGIN)


@part
def _is_off(j, own, s, f, xd, limits, known, values, forces, inverse):
    """Whether the series of a marker's force, at values[forces], is not the law's f."""
    c, w, tau = STARTS[j], 16 * own[BODY + OWNERS[j]], limits[TAU]
    # Acceleration per unit of force: 1 / m and s^2 J'^-1, bounded by the trace
    turning = inverse[w + 4] + inverse[w + 9] + inverse[w + 14]
    if CODES[j] == TURN:
        weight = turning
    elif CODES[j] == PARAMETERS:
        weight = 0.5 * turning
    else:
        weight = (s[0] * s[0] + s[1] * s[1] + s[2] * s[2]) * turning + (inverse[w] if CODES[j] == POINT else 0.0)
    size = 4 if CODES[j] == PARAMETERS else 3
    off, terms, speed = 0.0, 0.0, 0.0
    total = splat(0.0)
    # The series at tau, and the largest difference from the law
    for k in range(known - 1, -1, -1):
        total = fma(total, splat(tau), four(values, forces + 4 * k))
    series = stack(4)
    put(series, 0, total)
    for i in range(size):
        gap = abs(series[i] - f[c + i])
        if not gap <= off:  # or not a number
            off = gap
        speed = max(speed, abs(xd[c + i]))
    # Within tolerance as a velocity over the step
    tol = limits[ATOL] + limits[RTOL] * speed
    limits[EXCESS] = weight * off * limits[LENGTH] / max(limits[MOST] * tol, LAW_TOLERANCE * speed, TINY)
    if limits[EXCESS] <= 1.0:
        return False
    # or within rounding of the terms of the series
    for i in range(size):
        power = 1.0
        for k in range(known):
            terms = max(terms, abs(power * values[forces + 4 * k + i]))
            power *= tau
    return not off <= max(PIVOT_ROUNDING, limits[ATOL] + limits[RTOL]) * terms


@kernel
def _sums(code, bodies, at, orders, known, tau, s, values, p):
    """The x of a marker at tau, and xd; its body's series begins at bodies[at], p at values[p]."""
    x, xd, h = splat(0.0), splat(0.0), splat(tau)
    if code == TURN:
        # xd = A omega' of a Turn
        a0, a1, a2, w, o = x, x, x, x, at + S_OMEGA * orders
        # x and xd together by Horner's scheme
        for k in range(known, -1, -1):
            c = at + 12 * k
            a0, a1, a2 = fma(a0, h, four(bodies, c)), fma(a1, h, four(bodies, c + 4)), fma(a2, h, four(bodies, c + 8))
            w = fma(w, h, four(bodies, o + 4 * k))
        return x, fma(a0, splat(first(w)), fma(a1, splat(second(w)), times(a2, splat(third(w)))))
    for k in range(known, -1, -1):
        xd = fma(xd, h, x)
        x = fma(
            x, h, four(values, p + 4 * k) if code == PARAMETERS else marker_coefficient(code, bodies, at, orders, k, s)
        )
    return x, xd


@part
def _sum_markers(own, real, bodies, orders, known, tau, values, x, xd):
    """Set x and xd at tau from the series of the bodies; those of p begin at values."""
    for j in range(MARKERS):
        at, c = own[BODY + OWNERS[j]] * BODY_ROW * orders, STARTS[j]
        f, fd = _sums(CODES[j], bodies, at, orders, known, tau, real[3 * j : 3 * j + 3], values, 4 * orders * j)
        put(x, c, f)
        put(xd, c, fd)


def check(run, known, kind, limits, table, reals, bodies, values, inverse):
    """1 if the series of an instance is not what its law is at a place of the step, else 0; time has been set."""
    table, reals, values = integers(table, ANY), vector(reals, ANY), vector(values, ANY)
    limits, bodies, inverse = vector(limits, LIMITS), vector(bodies, ANY), vector(inverse, ANY)
    kind = extent(kind)
    count, stride, size, orders = kind.count, kind.stride, kind.width, kind.orders
    x, xd, f, wide = stack(ROOM), stack(ROOM), stack(ROOM), 4 * orders
    rows, program = scratch_rows(stride, values), int(values[PROGRAM_LENGTH]) if TRACED else 0
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride : (i + 1) * stride]
        own_values = program + i * size
        kept = own_values + 2 * MARKERS * wide + rows * orders + MARKERS
        for c in range(SIZE):
            x[c], xd[c], f[c] = 0.0, 0.0, 0.0
        if SHARP:
            # x and xd at tau, of stored series or from those of the bodies
            for k in range(known - 1, -1, -1):
                at = kept + 2 * SIZE * k
                for c in range(SIZE):
                    x[c] = x[c] * limits[TAU] + values[at + c]
                    xd[c] = xd[c] * limits[TAU] + values[at + SIZE + c]
        else:
            _sum_markers(own, real, bodies, orders, known, limits[TAU], values[own_values:], x, xd)
        # The law there: a program at order zero, or a function
        par = real[3 * MARKERS : stride]
        if TRACED:
            own_scratch = values[kept + 2 * SIZE * orders :]
            values[T] = limits[TIME]
            run_traced(run, values, x, xd, par, 0, rows, 1, own_scratch)
            kernel_series(x, xd, par, 0, matrix(data_of(own_scratch), rows, 1), f)
        else:
            if FRICTIONAL:
                scratch = matrix(data_of(values[own_values + 2 * MARKERS * wide :]), rows, orders)
                par[stride - 3 * MARKERS - 1] = load_at(limits[TAU], known, x, par, scratch)
            kernel_law(x, xd, par, limits[TIME], f)
        for j in range(MARKERS):
            # Its force against the series, marker by marker
            forces = own_values + (MARKERS + j) * wide
            if own[MASK] >> OWNERS[j] & 1:
                continue
            if _is_off(j, own, real[3 * j : 3 * j + 3], f, xd, limits, known, values, forces, inverse):
                return 1
    return 0


def margin(known, kind, h, values, least):
    """least = the minimum of itself and of the share 1 - sum_{k>0} |a_k| h^k / a_0 of each a; Eq. (1) is share > 0.

    NaN if a share is NaN.
    """
    kind, h, values, least = extent(kind), vector(h, 1), vector(values, ANY), vector(least, 1)
    count, stride, size, orders = kind.count, kind.stride, kind.width, kind.orders
    rows, left, step = scratch_rows(stride, values), get(least, 0), get(h, 0)
    square = step * step
    rest = 0.0 * step  # not a number where a share isn't: a minimum can lose that
    for i in range(count):
        # Share 1 - sum_{k>0} |a_k| h^k / a_0, odd and even orders apart
        s = matrix(data_of(values[i * size + 8 * MARKERS * orders :]), rows, orders)
        for a in POSITIVE:
            odd, even, top = 0.0 * step, 0.0 * step, (known - 1) // 2
            if known % 2 == 0:
                odd = abs(s[a, known - 1])
            for k in range(top, 0, -1):  # two sums: each addition waits for the one before
                odd = odd * square + abs(s[a, 2 * k - 1])
                even = even * square + abs(s[a, 2 * k])
            change = 1.0 - (odd + even * step) * step / s[a, 0]
            left, rest = min(left, change), rest + 0.0 * change
    let(least, 0, left + rest)
    return 0
