"""Progress of an ensemble: a bar with rate and remaining time, or a user's function."""

import sys

from ..simulation.progress import bar_class


class CaseProgress:
    """What is told of cases that are finished.

    Parameters
    ----------
    progress : bool or callable
        As of `simulate`.
    count : int
        Cases in all.
    done : int
        Cases that were finished before.
    """

    def __init__(self, progress, count, done=0):
        self.count, self.done, self._bar, self._tell = count, done, None, None
        if callable(progress):
            self._tell = progress
        elif progress not in (None, False):
            self._bar = bar_class(progress)(total=count, initial=done, unit=" cases", file=sys.stderr)

    def __call__(self, cases):
        """So many more cases are finished."""
        self.done += cases
        if self._bar is not None:
            self._bar.update(cases)
        if self._tell is not None and cases:
            self._tell(self.done / self.count)

    def close(self):
        """It has ended."""
        if self._bar is not None:
            self._bar.close()
