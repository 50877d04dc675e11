"""A Taylor step of every lane, as taylor/stepper.py makes one of one case.

Each lane has its own time, order and length of step. All are expanded to the highest order among them, tried and
projected together. A lane that can't go on as any other is LOST: its case is to be run alone, from its start.
"""

from ..elements.loops.body_poses import OMEGA, POSE, RD
from ..elements.loops.law_check import call_margin
from ..formulations.chart_validity import ROUNDING
from ..jit.kernels import kernel, long_kernel, specialised
from ..jit.lane_masks import below, both, choose, either, opposite
from ..jit.simd import get, let
from ..rows.interface import ILL_CONDITIONED
from ..runs.step_control import stretch
from ..runs.tolerances import FROM_ZERO, SHORTEST
from ..taylor import coefficients
from ..taylor.step_end import keep_start, project_rates
from ..taylor.tolerances import HALVED, MISSED, SMALL, SMALL_STEPS, STIFF_RATES, STILL, WARY
from .context import (
    BAD,
    FLOOR,
    INDICATOR,
    LEFT,
    LOST,
    NEXT,
    RESIDUAL,
    RUNS,
    SLOW,
    STEPS,
    T_NEXT,
    TOP,
    H,
    T,
)
from .landing import land
from .step_end import sum_series
from .step_length import propose
from .sums import spin, turn_ahead
from .tolerances import HALVINGS

_OWN = {"turn_ahead": turn_ahead, "spin": spin}
begin = long_kernel(specialised(coefficients.begin.py_func, "begin_lanes", coefficients.begin.py_func, **_OWN))
expand = long_kernel(specialised(coefficients.expand.py_func, "expand_lanes", coefficients.expand.py_func, **_OWN))


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
        # As MISSED of taylor/step_trials.py
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
