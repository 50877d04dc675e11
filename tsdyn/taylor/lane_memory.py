"""Memory of a batch of lanes, a case in each lane of SIMD registers; loops over instances."""

from functools import cache
from typing import NamedTuple

import numpy as np

from ..elements.element import address
from ..elements.loops import constraint_rows, constraint_series, force_series, law_check, template
from ..elements.loops.constraint_series import BODY_ROW
from ..elements.markers import PARAMETERS
from ..errors import InvalidConstraint, InvalidForce
from ..jit.compiled import Callback
from ..jit.kernels import Record, loader, resident, specialised
from ..jit.lanes import is_laned, makers, values_of, zeros
from ..model.packed import members_of
from ..rows.constraint_graph import ConstraintGraph
from ..rows.interface import Rows, TangentWorkspace
from ..workspaces import plain_context
from .layout import Expansion, SeriesContext, empty_series

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
    one = SeriesContext(plain.system, plain.work, plain.graph, plain.tangent, empty_series(1, np.zeros(BODY_ROW)), None)
    return loader(lane_context(one, width))


# Loops over the instances of a kind, for lanes: copies of the templates with arrays of lanes in place of arrays.

CONSTRAINT_LOOPS = {
    "reduced": constraint_rows.reduced,
    "values": constraint_rows.values,
    "series": constraint_series.series,
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


def constraint_loops(kinds, width):
    """Addresses of the loops of constraints for lanes, (kinds, 3): reduced, values, series.

    Raises InvalidConstraint where Numba can't compile one.
    """
    found = []
    for kind in kinds:
        own = {name: _loop(kind.kernels[name], loop, kind.markers, width) for name, loop in CONSTRAINT_LOOPS.items()}
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
        kinds, loops = many.graph.kinds, constraint_loops(series.kinds, width)
        kinds["reduced"], kinds["values"], many.expansion.places["loop"] = loops.T
        kinds["bias"] = kinds["drift"] = 0
        many.expansion.forces["loop"], many.expansion.forces["margin"] = force_loops(packed, width).T
        if spinning:
            many.graph.spins[many.graph.bodies[:, 1] == 7] = 1
        self._set_numbers(memory.run)
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

    def _set_numbers(self, run):
        clock, numbers = run.clock, self.context.numbers
        numbers.atol, numbers.rtol = clock.atol, clock.rtol
        numbers.max_step, numbers.first_step = clock.max_step, clock.h
        numbers.t_start, numbers.t_end = clock.t_origin, clock.t_end
        numbers.first_top = self.context.expansion.order.next
        numbers.leave_when_stiff = run.numbers.leave_when_stiff
