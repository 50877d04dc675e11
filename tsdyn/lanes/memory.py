"""Memory of lanes, laid out once for the memory of one case that it is filled from."""

import numpy as np

from ..jit.kernels import resident
from ..jit.lanes import values_of
from .context import lane_arrays, lane_context
from .kinds import constraint_loops, force_loops


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
