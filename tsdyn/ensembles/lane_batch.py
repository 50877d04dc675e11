"""The cases of a chunk that run in lanes, and those that lanes leave."""

import numpy as np

from ..jit.kernels import resident
from ..lanes.memory import LaneMemory
from .batch import Batch
from .case_loop import SUCCESS
from .lane_loop import NOT_RUN, LaneLoop, LaneLoopNumbers, lane_runner


class LaneBatch(Batch):
    """Runs the cases of a chunk in lanes, then those that are left in the loop for one case.

    Every case that fits is run in lanes, that too which was run alone before there was a batch: so no result depends on
    how cases are shared out to threads.
    """

    def __init__(self, arena, task, first_slice, width):
        super().__init__(arena, task, first_slice)
        self.width, self._lanes, self._of, self._passed = width, None, None, False
        nothing = [np.zeros((0, 3), np.int64) for _ in range(2)]
        self._loop = LaneLoop(LaneLoopNumbers(), np.full(width, -1), *nothing, np.zeros((0, width)))
        self._run_lanes = lane_runner(width)

    def enter(self, chunk):
        """As of `Batch`."""
        super().enter(chunk)
        self._passed, self._status, self._messages = False, chunk.status, chunk.messages

    def run(self, k, end):
        """Run cases of the chunk; the first of all that was not."""
        if not self._passed:
            self._pass(end)
        while not self._arena.study.stopped and (left := np.flatnonzero(self._status[:end] == NOT_RUN)).size:
            k = int(left[0])
            if super().run(k, k + 1) == k:
                return k
        left = np.flatnonzero(self._status[:end] == NOT_RUN)
        return int(left[0]) if left.size else end

    def _pass(self, end):
        """Run in lanes what can be run in them."""
        memory = self._take()
        self._passed, known = True, self._status[:end] != NOT_RUN
        if self._of is not memory:
            self._lay_out_lanes(memory)
        loop, run_lanes = self._loop, self._run_lanes
        loop.numbers.next, loop.numbers.end, loop.cases[:] = 0, end, -1
        while not run_lanes(*memory.where, self._plan, self._at, self._lanes.where, self._where, self._numbers.most):
            pass
        for k in np.flatnonzero(known & (self._status[:end] == SUCCESS)):
            self._messages.pop(int(k), None)
        self._give(memory)

    def _lay_out_lanes(self, memory):
        pen, kept = self._arena.pen, self._arena.kept
        self._lanes = LaneMemory(kept.series, kept.packed, memory, self.width, "inertia" in pen.written)
        self._loop = self._loop._replace(pairs=self._lanes.pairs, arrays=self._lanes.arrays, poses=self._lanes.poses)
        self._where, *self._keep_loop = resident(self._loop)
        self._of = memory
