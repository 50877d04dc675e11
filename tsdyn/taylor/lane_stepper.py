"""Lanes: Taylor steps of several cases at once, a case in each lane of SIMD registers, by the kernels of one case.

Its own are what differs: memory, length and order of each lane's step, its end, and whether its case is left.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from ..elements.element import address
from ..elements.loops import constraint_rows, constraint_series, force_series, ground_contacts, law_check, template
from ..elements.loops.constraint_rows import OMEGA, POSE, RD
from ..elements.loops.constraint_series import BODY_ROW
from ..elements.loops.law_check import call_margin
from ..elements.markers import PARAMETERS
from ..errors import InvalidConstraint, InvalidForce
from ..formulations.projection import correct_positions, displace, largest_residual
from ..formulations.tolerances import WALK
from ..jit.compiled import Callback
from ..jit.kernels import Record, kernel, loader, long_kernel, resident, specialised
from ..jit.lanes import binary_log, binary_power, is_laned, makers, values_of, zeros
from ..jit.predicates import any_of, below, both, choose, either, opposite
from ..jit.simd import get, let
from ..maths.tolerances import ROUNDING, ROUNDING_AT_MOST, TINY
from ..model.packed import members_of
from ..rows.constraint_graph import ConstraintGraph
from ..rows.interface import (
    DYNAMICS,
    ILL_CONDITIONED,
    Rows,
    TangentWorkspace,
    evaluate_without_redundant,
    factorise_selected_rows,
    singularity_indicator,
)
from ..runs.step_control import stretch
from ..runs.tolerances import FROM_ZERO, HALVED, SHORTEST
from ..workspaces import plain_context
from . import tolerances as limits
from .coefficients import begin, expand
from .layout import Expansion, SeriesContext, empty_series, touches_ground
from .step_length import size_of_order, weights
from .step_parts import Tops, keep_start, project_rates, sum_series

# Memory of a batch of lanes: the context of a run by series, its numbers arrays of lanes, and the state of each.

# Rows of `LaneContext.state`: times (s) and sizes of each lane, and what is true of it (1.0) or not (0.0)
(
    T,  # of the last accepted point
    H,  # of the step tried
    T_NEXT,  # its end
    TOP,  # order of omega' in this step
    NEXT,  # in the next one
    STEPS,  # accepted
    SIZE,  # of the numbers that enter Phi, m
    FLOOR,  # |Phi| that rounding leaves
    INDICATOR,  # of singular configurations: its largest value in the run
    SLOW,  # steps in a row in which little moves
    WAITS,  # next output of `t_eval`
    RUNS,  # whether a case is in the lane
    BAD,  # whether the last projection has failed
    LOST,  # whether its case is left to be run alone
    RESIDUAL,  # the largest |Phi| that the last projection met
    LEFT,  # margin of analyticity of the force laws along the step
    ROWS,
) = range(17)


class LaneNumbers(Record):
    """What lanes have in common."""

    atol: float
    rtol: float
    t_start: float
    t_end: float
    max_step: float
    first_step: float  # 0: of the driver's choice
    first_top: int  # order of the first step
    leave_when_stiff: int


class LaneSystem(NamedTuple):
    """Of a `System` what differs from case to case."""

    gravity: np.ndarray
    reals: np.ndarray


class LaneContext(NamedTuple):
    """All that the kernels of lanes use: of the types of `SeriesContext`, but with arrays of lanes."""

    system: LaneSystem
    graph: ConstraintGraph
    tangent: TangentWorkspace
    expansion: Expansion
    numbers: LaneNumbers
    state: np.ndarray  # (ROWS,) of lanes
    single: np.ndarray  # (ROWS, width): the same numbers


def laned(array, width, threes=False):
    """An array of lanes, each with the numbers of an array of one case."""
    out = zeros(array.size, width, threes)
    values_of(out)[...] = array.reshape(-1, 1)
    return out


def lane_arrays(part):
    """All arrays of lanes in a part of a `LaneContext`."""
    if isinstance(part, tuple):
        return [array for field in part for array in lane_arrays(field)]
    return [part] if isinstance(part, np.ndarray) and is_laned(part) else []


def lane_context(context, width):
    """A `LaneContext` for the scene of a `SeriesContext`, without its series; loops are still those of one case."""
    system, graph, f, x = context.system, context.graph, context.tangent, context.expansion

    def of(part, names, threes=False):
        return {name: laned(getattr(part, name), width, threes) for name in names.split()}

    def room(part, names, threes=False):
        return {name: zeros(getattr(part, name).size, width, threes) for name in names.split()}

    rows = Rows(**room(f.rows, "H Y", True), **room(f.rows, "S h"))
    tangent = f._replace(**of(f, "poses"), **room(f, "b gamma a p"), **room(f, "Z", True), rows=rows)
    expansion = x._replace(
        **room(x, "bodies low_r2 constraints loads", True), **room(x, "low low_end start"),
        places=x.places.copy(), forces=x.forces.copy(), order=type(x.order).from_buffer_copy(x.order),
    )  # fmt: skip
    A = values_of(expansion.bodies).reshape(-1, x.order.room * BODY_ROW, width)
    A[:, [0, 5, 10]] = 1.0  # of what never turns
    graph = graph._replace(kinds=graph.kinds.copy(), spins=graph.spins.copy(), **of(graph, "inverse mass", True))
    state = zeros(ROWS, width)
    system = LaneSystem(**of(system, "gravity reals"))
    return LaneContext(system, graph, tangent, expansion, LaneNumbers(), state, values_of(state))


@cache
def lane_loader(width):
    """What gives kernels sight of a `LaneContext` by its address."""
    plain = plain_context()
    one = SeriesContext(plain.system, plain.work, plain.graph, plain.tangent, empty_series(1, np.zeros(BODY_ROW)), None)
    return loader(lane_context(one, width))


# Loops over the instances of a kind, for lanes: copies of the templates with arrays of lanes in place of arrays.

CONSTRAINT_LOOPS = {
    "reduced": constraint_rows.reduced,
    "values": constraint_rows.values,
    "series": constraint_series.series,
}
CONTACT_LOOPS = {
    "contact_rows": ground_contacts.reduced,
    "values": constraint_rows.values,
    "contact_series": ground_contacts.series,
}
FORCE_LOOPS = ("series", force_series.series), ("margin", law_check.margin)
_NAMES = [name for name in vars(template) if name.isupper() or name.startswith("kernel_")]
_known = {}  # (callback, width): that of lanes


def _loop(one, loop, markers, width):
    """The `Callback` that runs a kind for so many lanes, made of that for one case."""
    if (one, width) not in _known:
        function, threes = one.py_func, all(marker.code != PARAMETERS for marker in markers)
        names = {name: function.__globals__[name] for name in _NAMES if name in function.__globals__}
        names |= makers(width, threes)
        copy = specialised(loop, f"{function.__qualname__}_{width}_lanes", function, **names)
        _known[one, width] = Callback(copy, one.signature)
    return _known[one, width]


def constraint_loops(graph, kinds, width):
    """Addresses of the loops of constraints for lanes, (kinds, 3): reduced, values, series.

    Raises InvalidConstraint where Numba can't compile one.
    """
    found = []
    for i, kind in enumerate(kinds):
        loops = CONTACT_LOOPS if touches_ground(graph, i, kind) else CONSTRAINT_LOOPS
        own = {name: _loop(kind.kernels[name], loop, kind.markers, width) for name, loop in loops.items()}
        found.append([address(own, name, kind.__name__, InvalidConstraint) for name in own])
    return np.array(found, np.int64).reshape(-1, len(CONSTRAINT_LOOPS))


def force_loops(packed, width):
    """Addresses of the loops of forces for lanes, (kinds, 2), in the order of System.forces: series, margin or 0.

    Raises InvalidForce where Numba can't compile one.
    """
    found = []
    for row in packed.system.forces:
        force = members_of(row, packed.loads)[0].force
        loops = FORCE_LOOPS if force.positive else FORCE_LOOPS[:1]
        own = {name: _loop(force.kernels[name], loop, force.markers, width) for name, loop in loops}
        found.append([address(own, name, force.name, InvalidForce) if name in own else 0 for name, _ in FORCE_LOOPS])
    return np.array(found, np.int64).reshape(-1, len(FORCE_LOOPS))


# Memory of lanes, laid out once for the memory of one case that it is filled from.


class LaneMemory:
    """Arrays of lanes for the runs by series of a scene.

    Parameters
    ----------
    series : Series
    packed : Packed
    memory : SeriesMemory
        Of one case, laid out for a run: what it starts with is copied into lanes.
    width : int
    spinning : bool
        Whether inertias differ, so that any body may have gyroscopic torques.

    Attributes
    ----------
    where : int
        Address of the `LaneContext`.
    pairs : ndarray of int64 (k, 3)
        Numbers of a case at its start: where they are in the memory of one case, where in lanes, how many.
    arrays : ndarray of int64 (k, 3)
        All arrays of lanes: where each is, where the numbers that each lane has at first, how many.
    poses : ndarray (n, width)
    """

    def __init__(self, series, packed, memory, width, spinning):
        one = memory.context
        self.context = many = lane_context(one, width)
        kinds, loops = many.graph.kinds, constraint_loops(one.graph, series.kinds, width)
        kinds["reduced"], kinds["values"], many.expansion.places["loop"] = loops.T
        kinds["bias"] = kinds["drift"] = 0
        many.expansion.forces["loop"], many.expansion.forces["margin"] = force_loops(packed, width).T
        if spinning:
            many.graph.spins[many.graph.bodies[:, 1] == 7] = 1
        clock, numbers = memory.run.clock, self.context.numbers
        numbers.atol, numbers.rtol = clock.atol, clock.rtol
        numbers.max_step, numbers.first_step = clock.max_step, clock.h
        numbers.t_start, numbers.t_end = clock.t_origin, clock.t_end
        numbers.first_top = self.context.expansion.order.next
        numbers.leave_when_stiff = memory.run.numbers.leave_when_stiff
        self.poses = values_of(many.tangent.poses)
        self.where, *self._keep = resident(many)
        pairs = [
            (one.system.gravity, many.system.gravity),
            (one.system.reals, many.system.reals),
            (one.graph.inverse, many.graph.inverse),
            (one.graph.mass, many.graph.mass),
            (one.tangent.poses, many.tangent.poses),
            *zip(one.tangent.rows, many.tangent.rows, strict=True),
            (one.expansion.low_end, many.expansion.low),
        ]
        self.pairs = np.array([(a.ctypes.data, b.ctypes.data, a.size) for a, b in pairs], np.int64)
        arrays = [(array, values_of(array)[:, 0].copy()) for array in lane_arrays(many)]
        self.arrays = np.array([(a.ctypes.data, image.ctypes.data, a.size) for a, image in arrays], np.int64)
        self._keep += arrays


# Projection of each lane onto the constraint manifold, as formulations/projection.py has it for one case.


@long_kernel
def _factorise(c):
    evaluate_without_redundant(c.graph, c.system.reals, c.tangent, c.tangent.rows, 0.0)
    factorise_selected_rows(c.graph, c.tangent, c.tangent.rows, DYNAMICS)


@long_kernel
def land(c):
    """Project positions onto the manifold; H, Y and the factors of S are those of the result. Sets BAD and RESIDUAL."""
    graph, f, floor = c.graph, c.tangent, get(c.state, FLOOR)
    _factorise(c)
    residual, _, _, failed = correct_positions(graph, c.system, f, 0.0, floor)
    let(c.state, RESIDUAL, residual)
    let(c.state, BAD, choose(failed, 1.0, 0.0 * floor))
    # H and S of the result serve velocities and the next step
    _factorise(c)
    walks = below(WALK * floor, largest_residual(graph, f, floor))
    if any_of(walks):
        displace(graph, f, walks)


# Length and order of each lane's next step, as taylor/step_length.py has them for one case.
#
# Logarithms to base 2 throughout: the radius of convergence is the least of -log2(size_k) / k over the last orders k.


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
        here = choose(below(TINY, size), binary_log(max(size, TINY)) * (-1.0 / k), math.inf)
        # Orders top + 1 to top - 2
        rho = choose(both(own, below(top - 2.5, k)), min(rho, here), rho)
        # Orders top - 1 to top - 4, for two orders less
        above = both(below(k - 0.5, top - 1.0), below(top - 4.5, k))
        lower = choose(above, min(lower, here), lower)
    likely = 0.0 * top - math.inf  # log2 of coefficient top + 1, from those of orders 4 and 5
    for k in range(4, 6):
        size = size_of_order(x.bodies, nb, x.order.room, k, far, fast)
        here = choose(below(0.0, size), binary_log(max(size, TINY)) * ((top + 1.0) / k), -math.inf)
        likely = max(likely, here)
    finite = choose(both(below(-math.inf, likely), below(likely, math.log2(limits.FAINT))), 0.0, finite)
    return choose(below(0.5, finite), rho, -math.inf), lower


@kernel
def _held(h, rate, k):
    """As of taylor/step_length.py; h as log2."""
    # Velocity error over its bound, as log2
    share = binary_log(limits.STIFF_RATES * rate / k) + h
    return binary_power(choose(below(share, 0.0), h + 2.0 * share / k, h))


@long_kernel
def propose(c, least, most):
    """Set H and NEXT of each lane; least and most are the least and the highest TOP."""
    n, s, top, order = c.numbers, c.state, get(c.state, TOP), c.expansion.order
    far, fast, rate, reach = weights(c.graph, c.expansion, n.atol, n.rtol)
    let(s, FLOOR, ROUNDING * (get(s, SIZE) + reach))
    rho, lower = _radii(c, least, most, far, fast)
    # log2 of tol
    accuracy = math.log(n.atol + n.rtol) / math.log(2.0)
    h = choose(below(-math.inf, rho), _held(rho + accuracy / (top + 2.0), rate, top + 2.0), 0.0)  # none ends the lane
    if order.highest > order.lowest:
        # Higher order if it advances further per unit of work
        other = _held(lower + accuracy / top, rate, top)
        rises = below(other * (top + limits.STEP_COST), h * (top + (limits.STEP_COST - 2.0)))
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
    tops = Tops(least, most, get(c.state, TOP))
    sum_series(c.graph, c.expansion, get(c.state, H), tops, c.tangent.poses, c.tangent.p)
    land(c)
    project_rates(c.graph, c.tangent, c.expansion.low_end, False)


@kernel
def _is_missed(c, again):
    """Whether lanes have missed the manifold: their steps are halved, or, if not to be tried `again`, they are lost."""
    s, tol, missed = c.single, c.numbers.atol + c.numbers.rtol, False
    for l in range(s.shape[1]):
        # As in taylor/stepper.py
        lands = s[BAD, l] == 0.0 and s[RESIDUAL, l] <= ROUNDING_AT_MOST * (tol + s[FLOOR, l])
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
            call_margin(kind.margin, most, kind, s[H:], x.loads[kind.values :], s[LEFT:])
            short = below(limits.STIFF_RATES * get(s, H), get(s, TOP))
            _find_lost(c, opposite(below(choose(short, limits.STILL, 0.0 * get(s, H)), get(s, LEFT))))


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
    for i in range(limits.HALVINGS + 1):
        # Halve the steps that miss the manifold, then give these lanes up
        reach(c, least, most)
        if not _is_missed(c, i < limits.HALVINGS):
            break
    return least, most


@long_kernel
def accept(c):
    """The end of each lane's step is where its next one begins; LOST where that is not like any other."""
    s, x, h = c.state, c.expansion, get(c.state, H)
    far, poses = limits.SMALL * get(s, FLOOR) / (ROUNDING * h), c.tangent.poses
    rest, still = 0.0 * h, below(-1.0, 0.0 * h)
    for b in range(c.graph.bodies.shape[0]):
        for i in range(3):
            # Steps in which nothing moves; numbers that aren't finite
            spin, speed = abs(get(poses, b * POSE + OMEGA + i)), abs(get(poses, b * POSE + RD + i))
            still = both(still, opposite(either(below(limits.SMALL, spin * h), below(far, speed))))
            rest += 0.0 * spin + 0.0 * speed
    let(s, SLOW, choose(still, get(s, SLOW) + 1.0, 0.0))
    if c.numbers.leave_when_stiff == 1:
        _find_lost(c, below(limits.SMALL_STEPS - 0.5, get(s, SLOW)))
    _find_lost(c, opposite(below(-1.0, rest)))
    # Near a singular configuration a case is run alone
    indicator = singularity_indicator(c.graph, c.tangent.rows)
    _find_lost(c, opposite(below(max(ILL_CONDITIONED, limits.WARY * get(s, INDICATOR)), indicator)))
    let(s, INDICATOR, max(get(s, INDICATOR), indicator))
    # The state moves on
    let(s, T, get(s, T_NEXT))
    let(s, STEPS, get(s, STEPS) + 1.0)
    for i in range(x.low.size):
        let(x.low, i, get(x.low_end, i))
