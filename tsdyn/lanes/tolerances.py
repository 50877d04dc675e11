"""Thresholds of lanes."""

# Size of a coefficient, over its weight, that counts as zero: it doesn't determine the radius of convergence.
LEAST_SIZE = 1e-300
# log2 of the size of the last coefficient below which it loses digits, as FAINT of taylor/tolerances.py.
FAINT = -930.0
# s: the length of a step without a radius of convergence, which ends the lane.
NO_STEP = 0.0
# Times that a step which has missed the manifold is halved before its case is left to be run alone.
HALVINGS = 4
