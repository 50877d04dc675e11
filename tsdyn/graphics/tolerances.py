"""Limits of figures, as shares of what is named."""

# Of the range of a coordinate: how far the cubic and the quintic between two outputs may differ at half the interval.
# Of a sinusoid of angular frequency w they differ by (w h)^4 / 384 of its amplitude, and the quintic is off by
# (w h)^6 / 46080: 0.5 % where the difference is 5 %.
RESOLVED = 0.05
# Of the largest coordinate: a smaller range is rest, and what it has is noise of the run.
AT_REST = 1e-6
# Of the largest force times the size of the scene: torques that are smaller throughout are drawn flat.
NO_TORQUE = 1e-4
