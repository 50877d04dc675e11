"""Outputs of a run between its steps: the records of accepted states, dense output, readers of it."""

from dataclasses import dataclass, field

import numpy as np

from ..errors import Status
from ..formulations.tolerances import CONTRACTION_LOST
from ..jit.kernels import callback, caller, entry, kernel, long_kernel, matrix, resident, vector
from ..maths.dense_linalg import copy, is_finite
from ..methods.explicit import call_accelerate, call_normal, call_place
from ..methods.interpolants import call_fill, call_value, cubic
from ..model.joint_turns import angle_after
from ..model.laws import interrupts_answered
from ..observables.tolerances import KEPT_FLOATS
from ..rows.interface import take_noted_selection
from ..workspaces import B_CHART, B_DATA, B_END, B_H, B_START, MIXED, STORED, arrays_of, load, load_run
from .run_memory import STATUSES, call
from .tolerances import LONG_STEPS

# Outputs of a driver: the records of accepted states.


@long_kernel
def record(r, log, t, q, qd, qdd):
    """Record one output, at the last accepted state or inside the step."""
    n, i = q.size, r.numbers.rows
    # t, q, qd, qdd, angles of joints and memories of forces
    row = log.out[i]
    row[0] = t
    for j in range(n):
        row[1 + j], row[1 + n + j], row[1 + 2 * n + j] = q[j], qd[j], qdd[j]
    for j in range(r.remembered.size):
        row[1 + 3 * n + j] = r.remembered[j]
    # Within a step angles are extrapolated from its start
    if t != r.clock.t:
        for j in range(r.joints.shape[0]):
            row[1 + 3 * n + j] = angle_after(r, j, q, qd, t - r.clock.t)
    r.numbers.rows = i + 1


@long_kernel
def store_now(w, r):
    """q, qd, qdd as those of the last accepted point."""
    copy(w.q, r.now[0])
    copy(w.qd, r.now[1])
    copy(w.qdd, r.now[2])


@long_kernel
def restore_now(w, r):
    """Put them back."""
    copy(r.now[0], w.q)
    copy(r.now[1], w.qd)
    copy(r.now[2], w.qdd)


# Dense output of step methods: v and vd are interpolated in the chart, then positions and velocities are solved for.
#
# The driver uses it at the times of t_eval, in its own workspace. `Solution.at` and events use it through `read` and a
# workspace of their own (`Reader`), where the chart of a step is rebuilt: q0, the time and the selection of rows
# determine it.

CHART_LOST, NOT_FINITE = int(Status.CHART_LOST), int(Status.NOT_FINITE)

call_complete = caller("pp")
call_chart = caller("pdpppp")
call_check = caller("p")


@long_kernel
def evaluate(context, w, r, t, x, y, yd, xd):
    """q, qd, qdd, yd (and xd) at (t, x, y). Status."""
    # Positions, then velocities and accelerations, then qdd
    status = call_place(r.kernels.place, context, t, x)
    if status == 0:
        status = call_accelerate(r.kernels.accelerate, context, t, y, yd, xd)
    if status == 0:
        status = call_complete(r.kernels.complete, context, yd)
    return _checked(w, status)


@kernel
def _checked(w, status):
    """The status; NOT_FINITE where the state isn't."""
    if status == 0 and not (is_finite(w.q) and is_finite(w.qd) and is_finite(w.qdd)):
        return NOT_FINITE
    return status


@kernel
def between(context, c, r, t, block):
    """q, qd, qdd at a time within the step of this block. Status. xd, the next step's, is left alone.

    Positions are solved for twice: Newton's method starts further away than in a run, and ends closer to rounding when
    repeated from nearby. Accelerations of implicit methods are those of the interpolant: the right-hand side of a
    stiff scene would amplify its error.
    """
    w, chart, h, data = c.work, c.chart.state, block[B_H], block[B_DATA:]
    s = (t - block[B_START]) / h
    # Coordinates of the chart by the interpolant
    call_value(r.kernels.value, s, h, w.q.size, r.xs.size, r.ys.size, data, r.xs, r.ys)
    # Normal coordinates by a cubic: from further away Newton's method may end on another branch of the constraints
    if r.numbers.normal_at > 0:
        cubic(s, h, block[r.numbers.normal_at :], w.u)
        copy(r.xs, w.v)
    made, chart.bare = w.counters.factorizations, 1
    status = call_place(r.kernels.place, context, t, r.xs)
    chart.bare = 0
    if status == 0 and w.counters.factorizations > made + 1:
        status = _branch_status(context, w, r)
    if status != 0:
        return status
    if r.kernels.second == 0:
        return evaluate(context, w, r, t, r.xs, r.ys, r.yds, r.dx)
    factored = chart.factored
    status = call_place(r.kernels.place, context, t, r.xs)
    if status == 0:
        chart.factored, chart.bare = max(chart.factored, factored), 1  # N of the first solve serves velocities
        status = call_accelerate(r.kernels.accelerate, context, t, r.ys, r.yds, r.dx)
        chart.bare = 0
    if status == 0:
        call_value(r.kernels.second, s, h, w.q.size, r.xs.size, r.ys.size, data, r.xs, r.yds)
        status = call_complete(r.kernels.complete, context, r.yds)
    return _checked(w, status)


@long_kernel
def _branch_status(context, w, r):
    """CHART_LOST, a Status, where the contraction is that of another branch, else 0: as at the ends of steps.

    A solve that needs no new factors of N, but for those of its start in the tangent form, can't have left the branch.
    """
    contraction, condition = w.control.contraction, w.control.condition
    call_check(r.kernels.check, context)
    lost = not w.control.contraction < CONTRACTION_LOST
    w.control.contraction, w.control.condition = contraction, condition
    return CHART_LOST if lost else 0


@kernel
def keep(c, store):
    """Copy what the Newton solvers start from."""
    _warm(c, store, True)


@kernel
def bring_back(c, store):
    """Put it back."""
    _warm(c, store, False)


@kernel
def _move(part, store, i, out):
    """Copy a part to its place i in the store, or back; where the next part begins."""
    for j in range(part.size):
        if out:
            store[i + j] = part[j]
        else:
            part[j] = store[i + j]
    return i + part.size


@long_kernel
def _warm(c, store, out):
    w, l, f, friction, i = c.work, c.chart, c.tangent, c.tangent.friction, 0
    # Starts of Newton's methods: u, v, multipliers and normal loads
    for part in (w.u, w.v, friction.lam, friction.load):
        i = _move(part, store, i, out)
    if c.saddle.K.size > 0:  # stages begin with the factors of N, and of S or N~
        for part in (l.lower, l.upper, f.rows.S, friction.lower, friction.upper):
            i = _move(part, store, i, out)
        if out:
            store[i] = l.state.made
        else:
            l.state.made = int(store[i])
        i += 1
    # B and T of the null-space form
    for part in (w.B, w.T):
        for a in range(part.shape[0]):
            for b in range(part.shape[1]):
                if out:
                    store[i] = part[a, b]
                else:
                    part[a, b] = store[i]
                i += 1
    if out:
        store[i] = w.control.rate
    else:
        w.control.rate = store[i]


def warm_size(work, tangent, chart, saddle):
    """Floats that `keep` stores."""
    friction, normal = tangent.friction, (chart.lower, chart.upper)
    factors = (*normal, tangent.rows.S, friction.lower, friction.upper) if saddle.K.size else ()
    kept = work.u, work.v, friction.lam, friction.load, work.B, work.T, *factors
    return sum(part.size for part in kept) + 1 + (1 if factors else 0)


@kernel
def recall(system, block):
    """Let forces remember what a block ends with."""
    first = block.size - system.memory.size
    for j in range(system.memory.size):
        system.reals[system.memory[j]] = block[first + j]


@kernel
def put_state(w, out):
    """out (3, n) = q, qd, qdd."""
    copy(w.q, out[0])
    copy(w.qd, out[1])
    copy(w.qdd, out[2])


READ = "ppipdipdip"  # types of the arguments of readers
SAME_STEP, SAME_CHART, OTHER_CHART = 0, 1, 2  # where a time is, beside the one before
WHOLE = 4  # added: accelerations are asked for, which may be missing otherwise
call_read = caller(READ)


@callback(READ)
def read(context, run, size, block, begun, width, point, t, asked, out):  # ten: a step, and what is asked of it
    """out (3, n): q, qd, qdd at t within the step of a block of this size. Status.

    begun, point: the time of its chart, and what `RunLog.points` has of it, of this width. asked: where t is, beside
    the time before, and WHOLE.

    Every time starts from its chart's q0, so that it gives the same numbers whatever was asked for before it.
    """
    c, r = load(context), load_run(run)
    w, n, step = c.work, c.work.q.size, vector(block, size)
    recall(c.system, step)  # rows that hold frictions depend on it
    # Every time begins at the same state of its chart
    if asked % WHOLE != OTHER_CHART:
        bring_back(c, r.warm)
    else:
        # A new chart: rebuilt at q0 with its selection of rows
        noted = vector(point, width)
        copy(noted[:n], w.q)
        take_noted_selection(c.tangent, noted[n:])
        c.tangent.friction.lam[:] = 0.0
        c.tangent.friction.load[:] = 0.0
        status = call_chart(r.kernels.start_chart, context, begun, r.xs, r.ys, r.yds, r.dx)
        if status != 0:
            return status
        keep(c, r.warm)
    # The state at t
    status = between(context, c, r, t, step)
    if status == 0:
        put_state(w, matrix(out, 3, n))
    return status


@kernel
def read_one(reader, context, run, block, charts, points, t, asked, out):  # nine: as of `read`
    """As `read`, of a block of these charts and their points."""
    chart = int(block[B_CHART])
    begun, width, point = charts[chart, 0], points.shape[1], points[chart]
    return call_read(reader, context, run, block.size, block, begun, width, point, t, asked, out)


@entry("ippvwmmmi", np.zeros((0, 0, 0)))
def read_states(reader, context, run, t, rows, blocks, charts, points, whole, out):  # ten: as of `read`
    """out (k, 3, n): q, qd, qdd at t (k,), each within the step blocks[rows], by a reader's kernel. Status.

    whole: WHOLE or 0.
    """
    place = OTHER_CHART
    for i in range(t.size):
        block = blocks[rows[i]]
        if i > 0:
            before = blocks[rows[i - 1]]
            place = SAME_CHART if block[B_CHART] == before[B_CHART] else OTHER_CHART
            place = SAME_STEP if rows[i] == rows[i - 1] else place
        status = read_one(reader, context, run, block, charts, points, t[i], place + whole, out[i])
        if status != 0:
            return status
    return 0


# What a step gives besides its end: the interpolation block, and the states that t_eval asks for.


@kernel
def is_wanted_before(r, log, t1):
    """Whether t_eval asks for a time before t1."""
    i = r.numbers.next_eval
    return i < log.t_eval.size and log.t_eval[i] < t1


@kernel
def record_end(w, r, log, t):
    """Record the state at the end of a step where every step is asked for, or t by t_eval."""
    if log.t_eval.size == 0:
        record(r, log, t, w.q, w.qd, w.qdd)
    elif r.numbers.next_eval < log.t_eval.size and log.t_eval[r.numbers.next_eval] == t:
        record(r, log, t, w.q, w.qd, w.qdd)
        r.numbers.next_eval += 1


@kernel
def note_normal(context, r, t):
    """Keep u and ud of the present state, where the form has them."""
    if r.numbers.normal_at > 0:
        rates = r.xd if r.numbers.first_order == MIXED else r.y
        call_normal(r.kernels.normal, context, t, rates, r.normal)


@kernel
def head_block(r, t0, t1):
    """What every block of a step begins and ends with: the step, its chart, and what is remembered."""
    block = r.block
    block[B_START], block[B_H], block[B_END], block[B_CHART] = t0, t1 - t0, t1, r.numbers.chart_rows
    copy(r.remembered, block[block.size - r.remembered.size :])


@kernel
def store_block(r, log):
    """Keep the block of a step, where blocks are kept."""
    if r.numbers.dense == STORED:
        copy(r.block, log.blocks[r.numbers.blocks])
        r.numbers.blocks += 1


@kernel
def record_step(context, run, c, r, log, t0, t1):
    """Record what t_eval asks for in (t0, t1], or the step's end where it asks for nothing. Status."""
    w, first = c.work, r.numbers.normal_at
    # u and ud of both ends
    if first > 0:
        copy(r.normal, r.block[first:])
        note_normal(context, r, t1)
        copy(r.normal, r.block[first + r.normal.size :])
    # Most steps record their end only
    within = r.numbers.dense != 0 or is_wanted_before(r, log, t1)
    if not within:
        record_end(w, r, log, t1)
        return 0
    if log.t_eval.size == 0:
        record(r, log, t1, w.q, w.qd, w.qdd)
    # Dense output moves the workspace: keep what Newton's methods start from, and fill the block
    keep(c, r.warm)
    head_block(r, t0, t1)
    status = call_fill(r.kernels.fill, context, run)
    if status != 0:
        return status
    store_block(r, log)
    while r.numbers.next_eval < log.t_eval.size and log.t_eval[r.numbers.next_eval] <= t1:
        # Requested times up to t1
        t = log.t_eval[r.numbers.next_eval]
        r.numbers.next_eval += 1
        if t == t1:
            record(r, log, t, r.now[0], r.now[1], r.now[2])
            continue
        status = between(context, c, r, t, r.block)
        if status != 0:
            return status
        record(r, log, t, w.q, w.qd, w.qdd)
    # Back to the end of the step
    bring_back(c, r.warm)
    restore_now(w, r)
    return 0


# Readers of dense output: states between the steps of a run, in a workspace of the reader's own.


@dataclass(frozen=True, eq=False)
class TrajectoryReading:
    """How the steps of runs are read: what a `Reader` is made of, in the process of the run."""

    read: object  # the kernel, a callback as dense_output.read
    workspace: object  # a function without arguments: (context, run), the reader's own
    system: object  # the `System` as it was run
    shift: int  # from a step to the block that ends with the angles at its start
    degree: int  # power of two, of a polynomial that can be expected to follow a function of the states in a step
    calls_laws: bool = False  # whether the kernel calls laws of a scene in Python
    begin: object = None  # what a context of the workspace begins with, a function, where phases share their readers
    idle: list = field(default_factory=list)  # a `Reader` that is not in use

    def reader(self):
        """A `Reader`, as if it were new."""
        try:
            found = self.idle.pop()
        except IndexError:
            found = Reader(self)
        else:
            found.enter(self.system)
        if self.begin is not None:
            self.begin(found.context)
        return found

    def give(self, reader):
        """Take back one that is no longer in use, unless it is large."""
        if reader.is_small and not self.idle:
            self.idle.append(reader)


class Reader:
    """Reads states between steps; one thread at a time."""

    def __init__(self, reading):
        context, run = reading.workspace()
        self.read, self.degree, self.n = reading.read.address, reading.degree, run.now.shape[1]
        self._calls_laws = reading.calls_laws
        (self._context, *kept), (self._run, *more) = resident(context), resident(run)
        self.where = self.read, self._context, self._run
        self.context = context
        self._kept, self._kernels, self._reals = (kept, more), run.kernels, context.system.reals
        own = [part for name, part in context._asdict().items() if name not in ("system", "graph")]
        arrays = [array for array in arrays_of((*own, run)) if array.size]
        self.is_small = sum(array.size for array in arrays) < KEPT_FLOATS
        self._images = [(array, array.copy()) for array in arrays] if self.is_small else []

    def enter(self, system):
        """As if it were new, for the numbers of a system."""
        for array, image in self._images:
            array[...] = image
        self._reals[...] = system.reals

    def __call__(self, t, rows, blocks, charts, points, whole=True):
        """States (k, 3, n) at times t (k,), in the steps blocks[rows]; and the Status.

        whole: whether accelerations are asked for; else they may be missing.
        """
        out = np.zeros((t.size, 3, self.n))
        return out, STATUSES[
            self.call(read_states, *self.where, t, rows, blocks, charts, points, WHOLE if whole else 0, out)
        ]

    def call(self, kernel, *arguments):
        """Call a kernel that reads states."""
        kernel = interrupts_answered()(kernel) if self._calls_laws else kernel
        return call(kernel, arguments, (self._kernels,)) if self.n >= LONG_STEPS else kernel(*arguments)


# What a run with dense output leaves to its solution: the blocks of its steps, read at any time.


class StepPieces:
    """The trajectories of a run's parts, one after the other, as one `Trajectory`.

    At the end of a part that part counts, but where a step counts that begins there.
    """

    def __init__(self, parts):
        self.parts, self.start, self.end = parts, parts[0].start, parts[-1].end

    @property
    def edges(self):
        """The steps' ends (k,), s."""
        return np.unique(np.concatenate([part.edges for part in self.parts]))

    def begin_at(self, times):
        """As of a `Trajectory`."""
        for part in self.parts:
            part.begin_at(times)

    def _begins(self, t):
        """Whether a part that begins at times t (k,) counts there."""
        return np.isin(t, np.concatenate([part.asked for part in self.parts]))

    def __call__(self, t):
        """As of a `Trajectory`."""
        states, memory, status = self._gathered(t, lambda part, times: part(times))
        return states, memory, max(status)

    def anchors(self, t):
        """As of a `Trajectory`."""
        return self._gathered(t, lambda part, times: part.anchors(times))

    def _gathered(self, t, ask):
        """What the parts say of times t, in their order; where it is no array, a list."""
        ends = [part.end for part in self.parts[:-1]]
        piece = np.where(self._begins(t), np.searchsorted(ends, t, side="right"), np.searchsorted(ends, t))
        order, found = [], []
        for i in np.unique(piece).tolist() or [0]:
            at = np.flatnonzero(piece == i)
            order.append(at)
            found.append(ask(self.parts[i], t[at]))
        back = np.argsort(np.concatenate(order), kind="stable")
        columns = zip(*found, strict=True)
        return [np.concatenate(column)[back] if isinstance(column[0], np.ndarray) else column for column in columns]


class Trajectory:
    """What a run with dense_output leaves to its solution.

    Parameters
    ----------
    readings : tuple
        The `TrajectoryReading` of this process; a function and its arguments, which make it in another one.
    records : tuple of ndarray
        Blocks (steps, ...), charts (charts, 5), and q0 of each chart (charts, n).
    start : float, s
    first : ndarray (3, n)
        q, qd, qdd there, for a run that has made no step.
    angles : ndarray (count,)
        Of the joints, there.
    stops : ndarray (stops, 3)
        Of the `Task`: at one where a function is asked the step counts that begins there, as for outputs.
    """

    def __init__(self, readings, records, start, first, angles, stops):
        self._reading, self.again = readings
        self.blocks, self.charts, self.points = records
        self.start, self.first, self.angles = start, first, angles
        self.asked = stops[stops[:, 1] != 0.0, 0]

    def begin_at(self, times):
        """Let the steps count that begin at these times, as at stops where a function is asked."""
        self.asked = np.concatenate((self.asked, times))

    def __getstate__(self):
        return {**self.__dict__, "_reading": None}

    @property
    def reading(self):
        """The `TrajectoryReading`; made again in another process than the run's."""
        if self._reading is None:
            make, *arguments = self.again
            self._reading = make(*arguments)
        return self._reading

    @property
    def end(self):
        """The time reached."""
        return float(self.blocks[-1, B_END]) if len(self.blocks) else self.start

    @property
    def edges(self):
        """The steps' ends (k,), s."""
        return self.blocks[:, B_END] if len(self.blocks) else np.array([self.start])

    def __call__(self, t):
        """States (k, 3, n) at times t (k,) between start and end, what forces remember (k, slots), and the Status."""
        slots = self.reading.system.memory.size
        if not len(self.blocks):
            return np.repeat(self.first[None], t.size, axis=0), np.zeros((t.size, slots)), Status.SUCCESS
        rows = self._steps_of(t)
        order = np.argsort(rows, kind="stable")  # so that a chart is made once
        out = np.empty((t.size, *self.first.shape))
        reader = self.reading.reader()
        out[order], status = reader(t[order], rows[order], self.blocks, self.charts, self.points)
        self.reading.give(reader)
        return out, self.blocks[rows, self.blocks.shape[1] - slots :], status

    def _steps_of(self, t):
        """The steps (k,) that times t (k,) lie in."""
        rows = np.searchsorted(self.blocks[:, B_END], t)
        if self.asked.size:
            later = np.searchsorted(self.blocks[:, B_END], t, side="right")
            rows = np.minimum(np.where(np.isin(t, self.asked), later, rows), len(self.blocks) - 1)
        return rows

    def anchors(self, t):
        """The starts (k,) of the steps that times t (k,) lie in, and the angles (k, count) of joints there."""
        if not len(self.blocks):
            return np.full(t.size, self.start), np.repeat(self.angles[None], t.size, axis=0)
        rows = self._steps_of(t)
        end = self.blocks.shape[1] - self.reading.system.memory.size
        kept = self.blocks[:, end - self.angles.size : end]
        if self.reading.shift:
            kept = np.concatenate((self.angles[None], kept[:-1]))
        return self.blocks[rows, B_START], kept[rows]
