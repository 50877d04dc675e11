"""What a run with dense output leaves to its solution: the blocks of its steps, read at any time."""

import numpy as np

from ..errors import Status
from ..workspaces.run_state import B_END, B_START


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
    readings : tuple
        The `Reading` of this process; a function and its arguments, which make it in another one.
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

    def __getstate__(self):
        return {**self.__dict__, "_reading": None}

    @property
    def reading(self):
        """The `Reading`; made anew in another process than the run's."""
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
        rows = np.searchsorted(self.blocks[:, B_END], t)
        if self.asked.size:
            rows = np.minimum(rows + np.isin(t, self.asked), len(self.blocks) - 1)
        order = np.argsort(rows, kind="stable")  # so that a chart is made once
        out = np.empty((t.size, *self.first.shape))
        reader = self.reading.reader()
        out[order], status = reader(t[order], rows[order], self.blocks, self.charts, self.points)
        self.reading.give(reader)
        return out, self.blocks[rows, self.blocks.shape[1] - slots :], status

    def anchors(self, t):
        """The starts (k,) of the steps that times t (k,) lie in, and the angles (k, count) of joints there."""
        if not len(self.blocks):
            return np.full(t.size, self.start), np.repeat(self.angles[None], t.size, axis=0)
        rows = np.searchsorted(self.blocks[:, B_END], t)
        end = self.blocks.shape[1] - self.reading.system.memory.size
        kept = self.blocks[:, end - self.angles.size : end]
        if self.reading.shift:
            kept = np.concatenate((self.angles[None], kept[:-1]))
        return self.blocks[rows, B_START], kept[rows]
