"""The interval and the output times of a call, checked; looked at again where they may have changed."""

from math import copysign
from typing import NamedTuple

import numpy as np

from ..runs.arguments import demand_steps_seen, interval, output_times, step_count
from ..runs.task import between
from ..validation import floats

FIXED = {float, int}  # what a tuple of them says can't change
MUTABLE = object()  # is no argument


class Stretch(NamedTuple):
    """What a run knows of its t_span and t_eval."""

    t_span: object  # the arguments, if they can't change
    t_eval: object
    span: tuple  # start and end, s
    times: np.ndarray
    bits: bytes  # of the times
    stops: np.ndarray  # as of a `Task`
    steps: int  # of a fixed length; 0 for an adaptive method
    within: bool  # whether there are times between the ends
    unresolved: str  # by fixed steps, as of `Prepared.unresolved`

    @classmethod
    def of(cls, known, t_span, t_eval, prepared, method):
        """The one of these arguments, `known` if they say the same; raises InvalidArgument."""
        if known is not None and t_span is known.t_span:
            span, is_known = known.span, True
        else:
            span = interval(t_span)
            is_known = known is not None and _are_same(span, known.span)
        if is_known and _say(t_eval, known):
            return known
        times, step = output_times(t_eval, *span), method.step
        demand_steps_seen(method, *span)
        return cls(
            t_span if _is_fixed(t_span) else MUTABLE, t_eval if t_eval is None or _is_fixed(t_eval) else MUTABLE, span,
            times, times.tobytes(), prepared.stops(*span, step is None), 0 if step is None else step_count(*span, step),
            between(times, span), "" if step is None else prepared.unresolved(*span, step),
        )  # fmt: skip


def _are_same(span, known):
    """Whether times are the same, signs of zero included."""
    return span == known and all(copysign(1.0, a) == copysign(1.0, b) for a, b in zip(span, known, strict=True))


def _say(t_eval, known):
    """Whether output times are those that are known."""
    if t_eval is None or not known.bits:
        return t_eval is None and not known.bits
    times = floats(t_eval)
    return times.ndim == 1 and times.tobytes() == known.bits


def _is_fixed(times):
    return type(times) is tuple and FIXED.issuperset(map(type, times))
