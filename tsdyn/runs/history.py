"""Compact histories of steps and charts: eight bytes a step, nothing for charts that change at every step.

Short histories are stored uncompressed, since a run of 0.1 ms leaves no time for more.
"""

import numpy as np

FEW_ROWS, FEW_CHUNKS = 256, 4


class StepLog:
    """Steps tried, in order: of those accepted the start, as each ends where the next one begins."""

    def __init__(self, parts=()):
        self.chunks = []
        for part in parts:
            self.chunks += part.chunks

    def add(self, rows):
        """Add rows (k, 3): start and length, s, and whether the step was accepted."""
        if _few(rows, self.chunks):
            self.chunks.append(rows.copy())
            return
        # An accepted step ends where the next one begins: its start is enough
        accepted = rows[:, 2] == 1.0
        t, other = rows[accepted, 0].copy(), np.flatnonzero(~accepted)
        ends = np.append(t[1:], np.nan)
        odd = np.flatnonzero(~(ends - t == rows[accepted, 1]))  # the last one, and whatever doesn't follow on
        self.chunks.append((t, odd, rows[accepted, 1][odd], other, rows[other, :2].copy()))

    @property
    def latest(self):
        """Starts (k,) of the steps accepted among the rows added last."""
        if not self.chunks:
            return np.empty(0)
        last = self.chunks[-1]
        return last[last[:, 2] == 1.0, 0] if isinstance(last, np.ndarray) else last[0]

    def arrays(self):
        """Start and length of each step (k,), s, and whether it was accepted."""
        parts = [np.empty((0, 3))]
        for chunk in self.chunks:
            if isinstance(chunk, np.ndarray):
                parts.append(chunk)
                continue
            t, odd, lengths, other, tried = chunk
            rows, accepted = np.empty((t.size + other.size, 3)), np.ones(t.size + other.size, bool)
            accepted[other] = False
            h = np.diff(t, append=np.nan)
            h[odd] = lengths
            rows[accepted, 0], rows[accepted, 1] = t, h
            rows[other, :2], rows[:, 2] = tried, accepted
            parts.append(rows)
        rows = np.concatenate(parts)
        return rows[:, 0].copy(), rows[:, 1].copy(), rows[:, 2] == 1.0


class ChartLog:
    """Charts, in order: column by column, a constant one as a number."""

    def __init__(self, parts=()):
        self.chunks = []
        for part in parts:
            self.chunks += part.chunks

    def add(self, rows, steps):
        """Take rows (k, 5) as of `RunLog.charts`; instants that are the starts of the latest `steps` aren't copied."""
        if _few(rows, self.chunks):
            self.chunks.append(rows)
            return
        if not len(rows):
            return
        starts = steps.latest
        same = np.array_equal(rows[:, 0], starts)
        columns = [_compact(column) for column in (rows[:, 1].astype(np.uint8), rows[:, 2], rows[:, 3])]
        self.chunks.append((starts if same else rows[:, 0].copy(), *columns, _compact(rows[:, 4].astype(np.uint32))))

    def arrays(self):
        """Instant, s, number of the reason, condition, contraction and steps of each chart, (k,) each."""
        columns = zip(*map(_columns, self.chunks), strict=True)
        return [np.concatenate(column) for column in columns]


def _few(rows, chunks):
    return len(rows) < FEW_ROWS and len(chunks) < FEW_CHUNKS


def _columns(chunk):
    return chunk.T if isinstance(chunk, np.ndarray) else [np.broadcast_to(x, chunk[0].shape) for x in chunk]


def _compact(column):
    return column[0] if (column == column[0]).all() else column.copy()
