"""Thresholds of the constraint rows."""

# Share of its diagonal entry that elimination leaves of a pivot of S = H W H^T; below it the pivot counts as zero.
# S is quadratic in H: rows that are this close to dependent make an angle of 3e-7 rad in the metric W.
ZERO_PIVOT = 1e-13
