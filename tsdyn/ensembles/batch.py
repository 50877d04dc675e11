"""The cases of a chunk that the compiled loop runs: what it needs of an arena, laid out once."""

import numpy as np

from ..configuration.mirrored_branches import are_aligned
from ..errors import Status
from ..formulations.locked_orientations import still
from ..jit.kernels import DEBUG, resident
from ..runs.tolerances import LONG_STEPS
from ..simulation.local_origin import are_near
from ..taylor.series_engine import SeriesEngine
from ..workspaces.carving import words
from .case_loop import CaseArrays, LoopNumbers, Plan, run_cases
from .keeping import TIMES
from .pen import Place
from .starts import OF_ROWS
from .tolerances import FEW_LONG, TRIED

NOT_FINITE, SLICE_DONE = int(Status.NOT_FINITE), int(Status.SLICE_DONE)


class Batch:
    """Runs stretches of cases in the memory of an arena.

    Parameters
    ----------
    arena : Arena
    task : Task
        Of a case that has ended within the driver's first slice, its start regular.
    first_slice : FirstSlice
    """

    def __init__(self, arena, task, first_slice):
        self._arena, self._task, self._slice = arena, task, first_slice
        self._numbers = LoopNumbers(most=first_slice.rows, moves=arena.pen.moves, grid=arena.study.keep == TIMES)
        self._long, self._cases, self._memory, self._places, self._chunk = 0, 0, None, None, None
        self._start = None
        if arena.pen.moves or arena.pen.written & OF_ROWS or arena.pen.geometry is not None:
            numbers, (arguments, self._start) = self._numbers, arena.starts.kernel()
            (
                numbers.take_start, numbers.start_context, numbers.start_rates, numbers.start_at, numbers.start_count,
                numbers.start_t, numbers.start_tol,
            ) = arguments  # fmt: skip
            numbers.may_land = not still(arena.packed).bodies.size

    @staticmethod
    def serves(arena):
        """Whether Python has nothing to do between the cases of an arena."""
        packed, pen, state = arena.packed, arena.pen, arena.study.call.state
        if DEBUG or pen is None or arena.kept.n >= LONG_STEPS:
            return False
        selects = pen.moves or pen.written & OF_ROWS or pen.geometry is not None  # redundant rows, in each case
        if packed.derived.redundant is not None and selects:
            return False
        moved = still(packed).bodies.size or packed.system.memory.size or not arena.kept.handles.begin_at_zero
        return not (pen.moves and (moved or state is not None))

    def enter(self, chunk):
        """Take the chunk that the arena's pen has laid out, and arrays for its results."""
        arrays, status = chunk.arrays, chunk.status
        pen, study = self._arena.pen, self._arena.study
        fits, packed = pen.fits, self._arena.packed
        if pen.moves:
            q = pen.starts[:, 0]
            fits = fits & are_near(packed, q) if pen.geometry is None else fits.copy()
            fits[fits] = are_aligned(packed, q[fits], study.span[0])
        count = len(status)
        self._at, *self._chunk = resident(CaseArrays(
            pen.numbers, pen.starts, fits.astype(np.int64), arrays["t"], arrays["q"].reshape(count, -1),
            arrays["qd"].reshape(count, -1), status, study.halt,
        ))  # fmt: skip

    def run(self, k, end):
        """Run cases of the chunk from k on; the first that was not."""
        if self._long * FEW_LONG > self._cases > TRIED:  # longer ones hardly notice Python
            return k
        memory = self._take()
        reached = run_cases(*memory.where, self._plan, self._at, k, end)
        numbers = self._numbers
        self._cases += reached - k + numbers.ran
        self._long += numbers.ran and numbers.status == SLICE_DONE
        if not (numbers.ran and numbers.status == NOT_FINITE):  # NaN may be left
            self._give(memory)
        return reached

    def _take(self):
        """The memory of runs, laid out for this batch."""
        kept, task = self._arena.kept, self._task
        engine, places = kept.engine(SeriesEngine, task.method, task.form, task.within), self._arena.pen.places()
        memory = kept.take(engine)
        if memory is not self._memory or places is not self._places:
            self._lay_out(memory, engine, places)
        self._kind = engine.kind
        return memory

    def _give(self, memory):
        """Let others use the memory."""
        self._arena.kept.give(self._kind, memory)

    def _lay_out(self, memory, engine, places):
        memory.enter(engine, self._task, False)
        self._memory, self._places = memory, places
        arrays = [*memory.entered(), *([] if self._start is None else self._start.entered())]
        arrays = [array for array in arrays if array.size]
        self._images = [(array, array.copy() if array.any() else None) for array in arrays]
        images = [[a.ctypes.data, 0 if b is None else b.ctypes.data, a.nbytes // 8] for a, b in self._images]
        targets = [[place.to.ctypes.data, place.column, place.to.size] for place in (*places, *self._own(memory))]
        start = np.zeros((2, self._arena.study.n))
        self._plan, *self._kept = resident(Plan(self._numbers, _words(images), _words(targets), start, self._slice.log))

    def _own(self, memory):
        """Places of numbers that follow from points of constraints, in the memory of runs and of starts."""
        pen = self._arena.pen
        if pen.geometry is None:
            return []
        at, found, control = pen.geometry.column, pen.places_in(self._start.reals), memory.work.control
        found += [Place(_number(each, "size"), at) for each in (control, self._start.work.control)]
        return [*found, Place(_number(control, "u_tol"), at + 1)]


def _number(record, name):
    """A number of a record as an array."""
    at = getattr(type(record), name).offset // 8
    return words(record).view(float)[at : at + 1]


def _words(rows):
    return np.array(rows, np.int64).reshape(-1, 3)
