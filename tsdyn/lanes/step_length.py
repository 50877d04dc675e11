"""Length and order of each lane's next step, as taylor/step_length.py has them for one case.

Logarithms to base 2 throughout: the radius of convergence is the least of -log2(size_k) / k over the last orders k.
"""

import math

from ..elements.loops.constraint_series import BODY_ROW, S_OMEGA, S_R
from ..formulations.chart_validity import ROUNDING
from ..jit.kernels import kernel, long_kernel
from ..jit.lane_masks import below, binary_log, binary_power, both, choose
from ..jit.simd import four, get, larger, let, splat
from ..taylor.step_length import largest_of_three, size_of_order
from ..taylor.tolerances import STEP_COST, STIFF_RATES
from .context import FLOOR, NEXT, SIZE, STEPS, TOP, H
from .tolerances import FAINT, LEAST_SIZE, NO_STEP


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
    finite = choose(both(below(-math.inf, likely), below(likely, FAINT)), 0.0, finite)
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
