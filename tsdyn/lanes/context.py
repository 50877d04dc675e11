"""Memory of a batch of lanes: the context of a run by series, its numbers arrays of lanes, and the state of each."""

from functools import cache
from typing import NamedTuple

import numpy as np

from ..elements.loops.constraint_series import BODY_ROW
from ..jit.kernels import Record, loader
from ..jit.lanes import is_laned, values_of, zeros
from ..rows.interface import Rows, TangentWorkspace
from ..sparse.constraint_graph import ConstraintGraph
from ..taylor.workspace import Expansion, SeriesContext, no_series
from ..workspaces.workspace import plain_context

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
    MOVED,  # the largest displacement in it, m or rad
    BEFORE,  # |Phi| before the last correction
    DONE,  # whether the projection has ended
    LEFT,  # margin of analyticity of the force laws along the step
    ROWS,
) = range(20)


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
    steps: int  # of the batch


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

    rows = Rows(**room(f.rows, "H Y", True), **room(f.rows, "S"))
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
    one = SeriesContext(plain.system, plain.work, plain.graph, plain.tangent, no_series(1, np.zeros(BODY_ROW)), None)
    return loader(lane_context(one, width))
