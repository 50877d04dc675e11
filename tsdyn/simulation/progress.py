"""Progress of a run, or of another calculation stage by stage: a bar in terminal or notebook, or a user's function."""

import sys
import threading
import time

from ..errors import InvalidArgument, MissingDependency
from .tolerances import BAR_AFTER

# Progress of a run: a bar in terminal or notebook, or a user's function.


def silent(fraction, *more):
    """Report nothing."""


def bar_class(progress):
    """Return the class of bars, progress being no function and not off; refuse what isn't True."""
    if progress is not True:
        raise InvalidArgument(
            f"progress must be True, False, None or a function of the fraction done, got {progress!r}."
        )
    try:
        from tqdm.auto import tqdm
    except ImportError as error:
        raise MissingDependency(
            "progress=True needs tqdm: pip install 'tsdyn[progress]'; or pass a function of the fraction done."
        ) from error
    return tqdm


def reporter(progress):
    """Return a function that receives the fraction done (None at the end), the time reached, s, and the steps."""
    if progress is None or progress is False:
        return silent
    if callable(progress):
        return lambda fraction, *more: None if fraction is None else progress(min(max(float(fraction), 0.0), 1.0))
    tqdm = bar_class(progress)
    form = "{desc}{percentage:3.0f}%|{bar}| {elapsed}<{remaining}{postfix}"
    bars, begun = [], []  # made at the first report: a refused run shows none

    def show(fraction, t=0.0, steps=0):
        if fraction is None:
            for bar in bars:
                bar.close()
            return
        if not bars:
            bars.append(tqdm(total=100, unit="%", file=sys.stderr, bar_format=form))
            begun.extend((time.perf_counter(), steps))
        rate = (steps - begun[1]) / max(time.perf_counter() - begun[0], 1e-9)
        bars[0].set_postfix_str(f"t = {t:.6g} s, {steps:.3g} steps, {rate:.2g} steps/s", refresh=False)
        bars[0].update(100.0 * min(fraction, 1.0) - bars[0].n)

    return show


# Progress of a calculation that is no run, stage by stage, and what a Ctrl-C says of it.

FORM = "{desc}{percentage:3.0f}%|{bar}| {elapsed}{postfix}"


class StageProgress:
    """A context in which report(fraction, said) tells how far a calculation is, and what it is at.

    Parameters
    ----------
    progress : bool or callable
        As of `simulate`. A bar is shown after BAR_AFTER seconds.
    what : str
        The calculation, in the message of a KeyboardInterrupt.
    """

    def __init__(self, progress, what):
        self.what, self.fraction, self.said = what, 0.0, "nothing is done yet"
        self._tell = progress if callable(progress) else None
        self._class = None if callable(progress) or progress in (None, False) else bar_class(progress)
        self._bar, self._lock, self._timer = None, threading.Lock(), None

    def __enter__(self):
        if self._class is not None:
            self._timer = threading.Timer(BAR_AFTER, self._open)
            self._timer.daemon = True
            self._timer.start()
        return self

    def __call__(self, fraction, said):
        """Be at a fraction, 0 to 1, which never falls."""
        self.fraction, self.said = min(max(self.fraction, float(fraction)), 1.0), said
        if self._tell is not None:
            self._tell(self.fraction)
        with self._lock:
            self._show()

    def __exit__(self, kind, error, trace):
        try:
            if kind is None:
                self(1.0, "done")
        finally:
            self._close()
        if kind is KeyboardInterrupt and not error.args:
            raise KeyboardInterrupt(f"{self.what} was interrupted at {self.fraction:.0%}: {self.said}.") from error

    def _open(self):
        with self._lock:
            if self._timer is not None:
                self._bar = self._class(total=100, unit="%", file=sys.stderr, bar_format=FORM)
                self._show()

    def _show(self):
        if self._bar is not None:
            self._bar.set_postfix_str(self.said, refresh=False)
            self._bar.update(100.0 * self.fraction - self._bar.n)
            self._bar.refresh()

    def _close(self):
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
            if self._bar is not None:
                self._bar.close()
