"""Limits of evaluation and of reactions, as shares of what is named."""

# Of the largest pivot of a sparse factorisation: a pivot below it is rounding.
LOST = 1e-13
# The reciprocal of the condition number below which a dense system, scaled to unit rows, is singular.
LOST_DENSE = 1e-14
# Of a row's diagonal entry, tried in turn: rows with smaller pivots are left out, as redundant.
REDUNDANT_SHARES = 3e-2, 1e-3, 1e-6, 1e-9
# Of the largest motion that the rows left out allow: a row that moves more is independent of the others left out.
INDEPENDENT = 1e-3
# Coordinates from which on matrices are sparse (a dense solution takes 0.1 s there).
LARGE = 1000
# Of the rows' own size: a self-stress that is smaller does no work on a row, so its multiplier is unique.
NO_STRESS = 1e-7
# Of the normal loads: the balance of friction and multipliers has converged.
BALANCED = 1e-15
# Complex steps cancel nothing; the square of the step stays above the least number there is.
COMPLEX_STEP = 1e-40
# The least divisor: nothing that matters is so small.
LEAST_DIVISOR = 1e-300
# Floats of a workspace of rows up to which it is kept for the next call (1 MB): a hundred bodies or more.
KEPT_FLOATS = 1 << 17
# Of the range of an acceleration: how far that at an output may be from the one of the quartic with the position,
# velocity and acceleration before, and the position and velocity there; (w h)^3 / 60 of a sinusoid of angular frequency
# w over an interval h. Beyond, and beyond so many times the bend, how far the acceleration before is from the cubic's,
# the acceleration jumps.
JUMP = 0.1
OTHERWISE = 2.0
# Of the largest range: coordinates with a smaller one are judged by this, as theirs may be rounding.
SMALL_RANGE = 1e-3
