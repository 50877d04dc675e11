"""Thresholds of the constraint rows.

"Share" is the share of its diagonal entry that elimination leaves of a pivot of S = H W H^T, dimensionless: 1 for a
row that is orthogonal to the rows before it in the metric W, in general the square of the sine of the angle that it
makes with them.
"""

# Share: below it the pivot counts as zero. The angle is 3e-7 rad.
ZERO_PIVOT = 1e-13

# Pivot of the saddle-point matrix over the diagonal entry, of bodies: below it the matrix is singular. A hundred
# roundings.
SADDLE_PIVOT = 1e-14

# Share: below it rows are dropped where a given number must be dropped; while too many fall below it, it is multiplied
# by FEWER. The first share, an angle of 0.03 rad, parts redundant rows from others unless the configuration is nearly
# singular.
FIRST_SHARE, FEWER = 1e-3, 1e-2

# Share of the weakest row over its largest value since the selection: below it the selection is renewed, so that S
# loses no more than one digit to an old selection. The same over the largest indicator of the run, once: before a
# configuration passes for one near a singular one (NEAR, and WARY of taylor/tolerances.py).
WORSE = 0.1

# Residual of a redundant row, its rate or its acceleration over the sum of its absolute terms: above it the row doesn't
# hold (docs/theory.md). Points and axes that are typed with ten digits hold. Laws of random scenes have 1e-9, but may
# count the terms of a rotation as less than half.
HELD = 2e-10
# Terms of a row count as at least this fraction of the largest in the scene: smaller ones are themselves rounding.
FAINT = 1e-3
# Velocities of a scene at rest over those of a fall through its extent under its loads; rates over that extent (1/s, or
# 1/s^2 for accelerations): smaller ones are rounding.
RESTING, NO_RATE = 1e-9, 1e-20

# Rows: scenes with more are searched for redundant rows within the blocks of the elimination order, not all at once
# (docs/design-decisions.md, "Global pivoting up to 1500 rows"); the dense matrix takes 18 MB at this size.
MOST_ROWS = 1500

# Singularity indicator over its largest value in the run, dimensionless; it falls as the square of the distance.
NEAR = 0.02  # below, at 0.14 of the distance: multipliers are refined at each order, Taylor steps tightened
NEXT_TO = 1e-3  # below, at 0.03: a step method hands over to series
WITHIN_A_STEP = 0.2  # below, at 0.45: so does a fixed step that fails

# The indicator itself: below these S loses so many digits, to unequal masses or to rows that nearly depend on others,
# that multipliers are refined once, twice, and four times. It is 1e-3 in a chain of a thousand links.
ILL_CONDITIONED, WORST_CONDITIONED, HARDLY_CONDITIONED = 5e-4, 1e-8, 1e-11

# The pivots of a primitive with several rows may change in opposite directions: their product then changes by half as
# much as the pivot that changes most, in chains of balls.
COMPENSATED = 2.0
