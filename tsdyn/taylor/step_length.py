"""Length of a Taylor step from the radius of convergence, and the singularity indicator at its end."""

import math

from ..elements.loops.constraint_series import BODY_ROW, S_OMEGA, S_R
from ..jit.kernels import kernel, long_kernel
from ..jit.simd import first, fma, four, larger, second, splat, third
from ..maths.tolerances import ROUNDING
from ..rows.interface import is_near_singular
from .tolerances import FAINT, FAR_PASSING, LEAST_ORDER, PASSING, RATES, STEP_COST, STIFF_RATES, VAST


@kernel
def largest_of_three(f):
    """The largest of the first three."""
    return max(first(f), max(second(f), third(f)))


@kernel
def size_of_order(bodies, nb, orders, k, far, fast):
    """The largest coefficient k of A and of r over far, and k - 1 of omega' over fast."""
    turn, shift, spin = splat(0.0), splat(0.0), splat(0.0)
    for b in range(nb):
        at = b * orders * BODY_ROW
        for i in range(at + 12 * k, at + 12 * k + 12, 4):
            turn = larger(four(bodies, i), turn)
        shift = larger(four(bodies, at + S_R * orders + 4 * k), shift)
        spin = larger(four(bodies, at + S_OMEGA * orders + 4 * (k - 1)), spin)
    return max(largest_of_three(turn), max(largest_of_three(shift) * far, largest_of_three(spin) * fast))


@long_kernel
def radius(bodies, nb, orders, top, far, fast):
    """Radius of convergence from the last four coefficients up to top + 1; 0 if they are not finite.

    Jorba and Zou (2005) take two; in a motion that starts from rest every fourth coefficient can vanish.
    """
    rho = math.inf
    for k in range(top + 1, max(top - 3, 1), -1):
        # |c_k|^(-1/k), the least of the last orders
        size = size_of_order(bodies, nb, orders, k, far, fast)
        if not size < math.inf:
            return 0.0
        if size > 0.0:
            rho = min(rho, size ** (-1.0 / k))
    return rho


@long_kernel
def order_in_range(bodies, nb, orders, top, far, fast):
    """The highest order up to top whose coefficients neither overflow nor vanish.

    They are in proportion to rate^k: 1e450 at order 30 where rates are 1e15 / s, and 1e-450 where they are 1e-15 / s.
    A maximum doesn't show coefficients that are NaN: see `finite_top`.
    """
    # Nearly always the last coefficients are in range
    k = top + 1
    size = size_of_order(bodies, nb, orders, k, far, fast)
    if FAINT < size < VAST:
        return top
    # Down to where they don't overflow
    while k > LEAST_ORDER and not size < VAST:
        k -= 1
        size = size_of_order(bodies, nb, orders, k, far, fast)
    held = k - 1
    # Zero: either exactly, or by underflow of all orders from some on
    while k > 2 and size == 0.0:
        k -= 1
        size = size_of_order(bodies, nb, orders, k, far, fast)
    if size == 0.0 or size > FAINT:  # the zeros are exact
        return held
    # Down to where they don't underflow
    while k > LEAST_ORDER and not size > FAINT:
        k -= 1
        size = size_of_order(bodies, nb, orders, k, far, fast)
    return k - 1


@long_kernel
def weights(graph, x, atol, rtol):
    """Weights of the coefficients of r and of omega' beside those of A; 1 + the largest rate; the largest |r|, m."""
    orders = x.order.room
    far, fast, speed = splat(0.0), splat(0.0), splat(0.0)
    for b in range(graph.bodies.shape[0]):
        # Largest r, omega' and rd
        at = b * orders * BODY_ROW
        far, fast = larger(four(x.bodies, at + S_R * orders), far), larger(four(x.bodies, at + S_OMEGA * orders), fast)
        speed = larger(four(x.bodies, at + S_R * orders + 4), speed)
    far, fast = largest_of_three(far), largest_of_three(fast)
    # Errors are bounded by atol + rtol |value|, those of A by atol + rtol
    tol = atol + rtol
    return tol / (atol + rtol * far), tol / (atol + rtol * fast), 1.0 + max(fast, largest_of_three(speed)), far


@kernel
def _weigh(c, r):
    """The weights, and 1 + the largest rate; sets the floor of Phi."""
    far, fast, rate, reach = weights(c.graph, c.expansion, r.clock.atol, r.clock.rtol)
    c.work.control.floor = ROUNDING * (c.work.control.size + reach)
    return far, fast, rate


@kernel
def _held(c, h, k):
    """Shorten h, whose error is term k, so that the velocity error also meets the tolerance.

    The velocity error is the position error times k / h. The bound of stiff motions is squared, since short steps are
    numerous.
    """
    # Velocity error over its bound: position error times k / h
    share = STIFF_RATES * c.trial.rate * h / k
    h *= share ** (2.0 / k) if share < 1.0 else 1.0
    return held_sharp(c, h, k)


@kernel
def held_sharp(c, h, k):
    """The same for the bound of sharp laws, where there are any."""
    return h * min(1.0, RATES * h / k) ** (1.0 / k) if c.trial.sharp == 1 else h


@kernel
def step_length(c, r):
    """Longest step rho tol^(1 / (top + 2)); sets the order of the next step, by the longer step per unit of work."""
    x, nb, orders = c.expansion, c.graph.bodies.shape[0], c.expansion.order.room
    tol = r.clock.atol + r.clock.rtol
    far, fast, rate = _weigh(c, r)
    # Longest step by all orders, then by two orders less
    x.order.top = top = order_in_range(x.bodies, nb, orders, x.order.top, far, fast)
    c.trial.rate = rate
    h = _held(c, radius(x.bodies, nb, orders, top, far, fast) * tol ** (1.0 / (top + 2)), top + 2)
    if x.order.highest > x.order.lowest:
        lower = _held(c, radius(x.bodies, nb, orders, top - 2, far, fast) * tol ** (1.0 / top), top)
        # Higher order if it advances further per unit of work
        change = 1 if h * (top + STEP_COST - 2) > lower * (top + STEP_COST) else -1
        x.order.next = min(max(top + change, x.order.lowest), x.order.highest)
    return h


@kernel
def longest(c, r, tol, most):
    """The longest step to a tolerance by any order up to `most`, which becomes the step's.

    Near a singular configuration rounding errors of lam grow from order to order by the ratio of step length to
    distance: high orders reach no further than the singularity.
    """
    x, nb = c.expansion, c.graph.bodies.shape[0]
    far, fast, _ = _weigh(c, r)
    h = 0.0
    for k in range(most, min(LEAST_ORDER, most - 1), -1):
        # rho tol^(1 / (k + 2)) for every order
        longer = radius(x.bodies, nb, x.order.room, k, far, fast) * tol ** (1.0 / (k + 2))
        if longer > h:
            h, x.order.top = longer, k
    return h


@long_kernel
def finite_top(c):
    """The highest top up to which the coefficients of all bodies are finite, for steps that have failed.

    Near a singularity of a force law coefficients overflow, even of low orders, and become NaN. `order_in_range`
    compares maxima only, above LEAST_ORDER.
    """
    x, orders = c.expansion, c.expansion.order.room
    for k in range(2, x.order.top + 2):
        # 0 c is not zero where c is infinite or not a number
        rest = splat(0.0)
        for b in range(c.graph.bodies.shape[0]):
            at = b * orders * BODY_ROW
            for i in range(at + 12 * k, at + 12 * k + 12, 4):
                rest = fma(four(x.bodies, i), splat(0.0), rest)
            rest = fma(four(x.bodies, at + S_R * orders + 4 * k), splat(0.0), rest)
            rest = fma(four(x.bodies, at + S_OMEGA * orders + 4 * (k - 1)), splat(0.0), rest)
        if first(rest) + second(rest) + third(rest) != 0.0:
            return k - 2
    return x.order.top


@kernel
def loosest(c, tol):
    """The loosest tolerance of a step past a singular configuration: next to it lam has few digits."""
    return max(tol, PASSING if is_near_singular(c.tangent, c.tangent.indicator.start) else FAR_PASSING)


@kernel
def is_near(c, part):
    """Return True if a step ends near a singular configuration: the indicator is below `part` of its start value."""
    indicator = c.tangent.indicator
    return is_near_singular(c.tangent, indicator.end) and indicator.end < part * indicator.start
