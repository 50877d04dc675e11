"""Singularity indicator: the smallest pivot of S relative to its diagonal entry.

The indicator falls as the square of the distance to a singular configuration. It is compared with its largest value
in the run.
"""

from ..jit.kernels import kernel
from .independent_rows import weakest
from .tolerances import HARDLY_CONDITIONED, ILL_CONDITIONED, NEAR, NEXT_TO, WITHIN_A_STEP, WORST_CONDITIONED


@kernel
def singularity_indicator(graph, rows):
    """Return the singularity indicator of rows that are factorised."""
    return weakest(graph, rows.S)


@kernel
def note_indicator(graph, f, rows):
    """Record the singularity indicator at a chart or the end of a step."""
    note = f.indicator
    note.start = singularity_indicator(graph, rows)
    note.largest = max(note.start, note.largest)


@kernel
def is_near_singular(f, share):
    """Return True if a configuration with this indicator is near a singular one."""
    return share < NEAR * f.indicator.largest


@kernel
def refinements(indicator):
    """How often multipliers are refined for the condition of S."""
    # S loses digits in proportion to the reciprocal of the indicator
    if indicator > WORST_CONDITIONED:
        return 0 if indicator > ILL_CONDITIONED else 1
    return 2 if indicator > HARDLY_CONDITIONED else 4


@kernel
def is_next_to_singular(f):
    """Return True if the recorded indicator says that a step method can't go on."""
    return f.indicator.start < NEXT_TO * f.indicator.largest


@kernel
def is_singular_within_a_step(f):
    """Return True if a singular configuration may be within a fixed step."""
    return f.indicator.start < WITHIN_A_STEP * f.indicator.largest
