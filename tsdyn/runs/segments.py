"""Run segments: state and records passed between the parts of one run that different methods integrate."""

from .event_search import Watch


class SegmentLink:
    """Handed from part to part of a run: its events, and how near to a singular configuration it has come.

    Parameters
    ----------
    passes : bool
        Whether there is a way past singular configurations.
    """

    def __init__(self, passes=False):
        self.watch, self.passes = None, passes
        self.interrupted = False  # whether Ctrl-C came when a part had just ended
        self.h = 0.0  # s, of the first step of the next part; zero for its own choice
        self.share = self.largest = (
            0.0  # of the weakest row, where the last part ended, and at most; see singularity.py
        )

    def enter(self, memory):
        """Let a part begin where the last one ended."""
        memory.context.tangent.indicator.largest = self.largest
        if self.h > 0.0:
            memory.run.clock.h = self.h

    def leave(self, memory):
        """Take over how a part ended."""
        indicator = memory.context.tangent.indicator
        self.share, self.largest, self.h = indicator.start, indicator.largest, memory.run.clock.h

    def watching(self, task, reading):
        """The `Watch` of the run's events, with a reader for the steps of this part; None where there are none."""
        if task.events is None:
            return None
        reader = reading.reader()
        if self.watch is None:
            self.watch = Watch(task.events, task.prepared.packed, reader, task.span[0])
        else:
            self.watch.read_by(reader)
        return self.watch
