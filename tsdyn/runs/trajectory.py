"""Dense output on the manifold: v and vd are interpolated in the chart, then positions and velocities are solved for.

The driver uses it at the times of t_eval. `Solution.at` and events use it through a `Reader`, which rebuilds the chart
of a step (q0 and the time determine it) in a separate workspace.
"""

import numpy as np

from ..errors import Status
from ..jit.kernels import caller, entry, kernel, resident
from ..maths.dense_linalg import copy, is_finite
from ..methods.explicit import call_accelerate, call_place
from ..methods.interpolants import call_value
from ..rows.interface import redundancy
from ..workspaces.workspace import Context, allocate, allocate_linear, basis_free_parts, load

NOT_FINITE = int(Status.NOT_FINITE)
# addresses that the driver and the reader are given
A_PLACE, A_ACCELERATE, A_COMPLETE, A_CHECK, A_CHART, A_STEP, A_ERROR, A_ERROR_2, A_NORM, A_FILL, A_VALUE, A_SECOND = (
    range(12)
)
# what a step's block begins with, before the interpolant's data
B_START, B_H, B_END, B_CHART, B_DATA = range(5)

call_complete = caller("pp")
call_chart = caller("pdpppp")


@kernel
def evaluate(context, w, at, t, x, y, yd, xd):
    """q, qd, qdd, yd (and xd) at (t, x, y). Status."""
    status = call_place(at[A_PLACE], context, t, x)
    if status == 0:
        status = call_accelerate(at[A_ACCELERATE], context, t, y, yd, xd)
    if status == 0:
        status = call_complete(at[A_COMPLETE], context, yd)
    if status == 0 and not (is_finite(w.q) and is_finite(w.qd) and is_finite(w.qdd)):
        return NOT_FINITE
    return status


@kernel
def between(context, w, at, t, block, xs, ys, yds, xds):
    """q, qd, qdd at a time within the step of this block. Status.

    Placed twice: Newton's method comes from further away than in a run, and ends nearer to rounding from nearby.
    """
    h = block[B_H]
    call_value(at[A_VALUE], (t - block[B_START]) / h, h, w.q.size, xs.size, ys.size, block[B_DATA:], xs, ys)
    status = call_place(at[A_PLACE], context, t, xs)
    if status == 0:
        status = evaluate(context, w, at, t, xs, ys, yds, xds)
    if status == 0 and at[A_SECOND] != 0:  # what f would amplify in a stiff scene
        call_value(at[A_SECOND], (t - block[B_START]) / h, h, w.q.size, xs.size, ys.size, block[B_DATA:], xs, yds)
        call_complete(at[A_COMPLETE], context, yds)
    return status


@kernel
def keep(w, store):
    """Copy what the Newton solvers start from."""
    _warm(w, store, True)


@kernel
def bring_back(w, store):
    """Put it back."""
    _warm(w, store, False)


@kernel
def _warm(w, store, out):
    i = 0
    for part in (w.u, w.v):
        for j in range(part.size):
            if out:
                store[i] = part[j]
            else:
                part[j] = store[i]
            i += 1
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


def warm_size(work):
    """Floats that `keep` stores."""
    return work.u.size + work.v.size + work.B.size + work.T.size + 1


@entry
def read(context, at, t, rows, blocks, charts, points, xs, ys, yds, xds, store, out):
    """out (k, 3, n): q, qd, qdd at t (k,), each within the step blocks[rows]. Status.

    Every time starts from its chart's q0, so that it gives the same numbers whatever was asked for before it.
    """
    c = load(context)
    w = c.work
    chart = -1
    for i in range(t.size):
        block = blocks[rows[i]]
        if int(block[B_CHART]) == chart:
            bring_back(w, store)
        else:
            chart = int(block[B_CHART])
            copy(points[chart], w.q)
            status = call_chart(at[A_CHART], context, charts[chart, 0], xs, ys, yds, xds)
            if status != 0:
                return status
            keep(w, store)
        for j in range(c.system.memory.size):
            c.system.reals[c.system.memory[j]] = block[block.size - c.system.memory.size + j]
        status = between(context, w, at, t[i], block, xs, ys, yds, xds)
        if status != 0:
            return status
        copy(w.q, out[i, 0])
        copy(w.qd, out[i, 1])
        copy(w.qdd, out[i, 2])
    return 0


class Reader:
    """Reads states between steps; one thread at a time. A block ends with what is remembered at the step's end.

    Parameters
    ----------
    system : System
        As it was run.
    sizes : tuple
        Arguments of `workspace.allocate`; then the network, nx and ny.
    addresses : ndarray
        Those of the run.

    Attributes
    ----------
    degree : int
        Power of two, of a polynomial by which a function of the states in a step can be expected to be followed.
    """

    shift = 1  # from a step to the block with the angles at its start
    degree = 8

    def __init__(self, system, sizes, addresses):
        *sizes, network, nx, ny = sizes
        work = allocate(*sizes, redundant=redundancy(network))
        system = system._replace(reals=system.reals.copy())  # the motions' places are written to
        linear = allocate_linear(system, sizes[0], sizes[1], False)
        context = Context(system, work, linear, *basis_free_parts(network, sizes[0], sizes[5] is None))
        self.n, (self.context, *self._keep) = sizes[0], resident(context)
        self.addresses = addresses
        self.scratch = [np.zeros(size) for size in (nx, ny, ny, nx, warm_size(work))]

    def __call__(self, t, rows, blocks, charts, points):
        """States (k, 3, n) at times t (k,), in the steps blocks[rows]; and the Status."""
        out = np.zeros((t.size, 3, self.n))
        status = read(self.context, self.addresses, t, rows, blocks, charts, points, *self.scratch, out)
        return out, Status(status)


class Pieces:
    """The trajectories of a run's parts, one after the other, as one `Trajectory`."""

    def __init__(self, parts):
        self.parts, self.start, self.end = parts, parts[0].start, parts[-1].end

    @property
    def edges(self):
        """The steps' ends (k,), s."""
        return np.unique(np.concatenate([part.edges for part in self.parts]))

    def __call__(self, t):
        """As of a `Trajectory`."""
        states, memory, status = self._gathered(t, lambda part, times: part(times))
        return states, memory, max(status)

    def anchors(self, t):
        """As of a `Trajectory`."""
        return self._gathered(t, lambda part, times: part.anchors(times))

    def _gathered(self, t, ask):
        """What the parts say of times t, in their order; where it is no array, a list."""
        piece = np.searchsorted([part.end for part in self.parts[:-1]], t)
        order, found = [], []
        for i, part in enumerate(self.parts):
            at = np.flatnonzero(piece == i)
            if at.size or (not found and i == len(self.parts) - 1):
                order.append(at)
                found.append(ask(part, t[at]))
        back = np.argsort(np.concatenate(order), kind="stable")
        columns = zip(*found, strict=True)
        return [np.concatenate(column)[back] if isinstance(column[0], np.ndarray) else column for column in columns]


class Trajectory:
    """What a run with dense_output leaves to its solution.

    Parameters
    ----------
    reading : tuple
        A kind of reader and what to make one with, the System first; of this process.
    again : tuple
        A function and its arguments, which make `reading` in another process.
    blocks : ndarray (steps, ...)
    charts : ndarray (charts, 5)
    points : ndarray (charts, n)
        q0 of each chart.
    start : float, s
    first : ndarray (3, n)
        q, qd, qdd there, for a run that has made no step.
    angles : ndarray (count,)
        Of the joints, there.
    stops : ndarray (stops, 2)
        Of the `Task`: at one where a function is asked the step counts that begins there, as for outputs.
    """

    def __init__(self, reading, again, blocks, charts, points, start, first, angles, stops):
        self._reading, self.again = reading, again
        self.blocks, self.charts, self.points = blocks, charts, points
        self.start, self.first, self.angles = start, first, angles
        self.asked = stops[stops[:, 1] != 0.0, 0]

    def __getstate__(self):
        return {**self.__dict__, "_reading": None}

    @property
    def reading(self):
        """A kind of reader and what to make one with."""
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
        slots = self.reading[1].memory.size
        if not len(self.blocks):
            return np.repeat(self.first[None], t.size, axis=0), np.zeros((t.size, slots)), Status.SUCCESS
        rows = np.searchsorted(self.blocks[:, B_END], t)
        if self.asked.size:
            rows = np.minimum(rows + np.isin(t, self.asked), len(self.blocks) - 1)
        order = np.argsort(rows, kind="stable")  # so that a chart is made once
        out = np.empty((t.size, *self.first.shape))
        reader, *arguments = self.reading
        out[order], status = reader(*arguments)(t[order], rows[order], self.blocks, self.charts, self.points)
        return out, self.blocks[rows, self.blocks.shape[1] - slots :], status

    def anchors(self, t):
        """The starts (k,) of the steps that times t (k,) lie in, and the angles (k, count) of joints there."""
        if not len(self.blocks):
            return np.full(t.size, self.start), np.repeat(self.angles[None], t.size, axis=0)
        rows = np.searchsorted(self.blocks[:, B_END], t)
        end = self.blocks.shape[1] - self.reading[1].memory.size
        kept = self.blocks[:, end - self.angles.size : end]
        if self.reading[0].shift:
            kept = np.concatenate((self.angles[None], kept[:-1]))
        return self.blocks[rows, B_START], kept[rows]
