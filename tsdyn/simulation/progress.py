"""Progress of a run: a bar in terminal or notebook, or a user's function."""

import sys
import time

from ..errors import InvalidArgument, MissingDependency


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
