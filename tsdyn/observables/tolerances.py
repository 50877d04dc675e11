"""Limits of evaluation and of reactions, as shares of what is named."""

# Of a row's diagonal entry, tried in turn: rows with smaller pivots are left out, as redundant.
REDUNDANT_SHARES = 3e-2, 1e-3, 1e-6, 1e-9
# Of the largest motion that the rows left out allow: a row that moves more is independent of the others left out.
INDEPENDENT = 1e-3
# Coordinates from which on matrices are sparse (a dense solution takes 0.1 s there).
LARGE = 1000
# Floats of a workspace of rows, of a start, or of a reader of dense output, up to which it is kept for the next call (8
# MB): a thousand bodies.
KEPT_FLOATS = 1 << 20
# Of the range of an acceleration: how far that at an output may be from the one of the quartic with the position,
# velocity and acceleration before, and the position and velocity there; (w h)^3 / 60 of a sinusoid of angular frequency
# w over an interval h. Beyond, and beyond so many times the bend, how far the acceleration before is from the cubic's,
# the acceleration jumps.
JUMP = 0.1
OTHERWISE = 2.0
# Of the largest range: coordinates with a smaller one are judged by this, as theirs may be rounding.
SMALL_RANGE = 1e-3
