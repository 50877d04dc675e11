"""Limits of evaluation, of reactions and of figures, as shares of what is named."""

# Of a row's diagonal entry, tried in turn: rows with smaller pivots are left out, as redundant.
REDUNDANT_SHARES = 3e-2, 1e-3, 1e-6, 1e-9
# Of the largest motion that the rows left out allow: a row that moves more is independent of the others left out.
INDEPENDENT = 1e-3
# Coordinates up to which matrices are dense (a solution takes 0.1 s there).
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

# --- figures ---
# Of the range of a coordinate: how far the cubic and the quintic between two outputs may differ at half the interval.
# Of a sinusoid of angular frequency w they differ by (w h)^4 / 384 of its amplitude, and the quintic is off by
# (w h)^6 / 46080: 0.5 % where the difference is 5 %.
RESOLVED = 0.05
# Of the largest coordinate: a smaller range is rest, and what it has is noise of the run.
AT_REST = 1e-6
# Of the largest force times the size of the scene: torques that are smaller throughout are drawn flat.
NO_TORQUE = 1e-4
