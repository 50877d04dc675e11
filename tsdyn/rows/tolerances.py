"""Thresholds of the constraint rows.

"Share" is the share of its diagonal entry that elimination leaves of a pivot of S = H W H^T, dimensionless: 1 for a
row that is orthogonal to the rows before it in the metric W, in general the square of the sine of the angle that it
makes with them.
"""

# Share: below it rows are dropped where a given number must be dropped; while too many fall below it, it is multiplied
# by FEWER. The first share, an angle of 0.03 rad, parts redundant rows from others unless the configuration is nearly
# singular.
FIRST_SHARE, FEWER = 1e-3, 1e-2

# Share of a row over its largest value since the selection: below it the selection is renewed, so that S loses no more
# than one digit to an old selection. The moment of inertia J that an axis without inertia is given, over the body's
# largest: a condition of ten.
ONE_DIGIT = 0.1

# Residual of a redundant row, its rate or its acceleration over the sum of its absolute terms: above it the row doesn't
# hold (docs/theory.md). Points and axes that are typed with ten digits hold. Laws of random scenes have 1e-9, but may
# count the terms of a rotation as less than half.
HELD = 2e-10
# Terms of a row, and arms of a body's joints, count as at least this share of the largest in the scene: smaller terms
# are themselves rounding, and rotations of bodies with short arms, or none, are as visible as the longest allow. Pivots
# are squares of it, far above rounding.
LEAST_SHARE = 1e-3
# The longest arm of a scene over the longest that its rows show: below it points are off the centroids by rounding.
# Rotations would weigh a million times as much as translations: rows would depend on each other to six digits.
NO_ARM = 1e-6
# Velocities of a scene at rest over those of a fall through its extent under its loads; rates over that extent (1/s, or
# 1/s^2 for accelerations): smaller ones are rounding.
RESTING, NO_RATE = 1e-9, 1e-20

# Rows: scenes with more are searched for redundant rows within the blocks of the elimination order, not all at once
# (docs/design-decisions.md, "Global pivoting up to 1500 rows"); the dense matrix takes 18 MB at this size.
MOST_ROWS = 1500

# Singularity indicator over its largest value in the run, dimensionless; it falls as the square of the distance.
# NEAR, at 0.14 of the distance: below it multipliers are refined at each order and Taylor steps tightened; above it the
# configuration is regular again, for other methods and for Taylor alike.
NEAR = 0.02
NEXT_TO = 1e-3  # below, at 0.03: a step method hands over to series
WITHIN_A_STEP = 0.2  # below, at 0.45: so does a fixed step that fails

# The indicator itself: below these S loses so many digits, to unequal masses or to rows that nearly depend on others,
# that multipliers are refined once, twice, and four times. It is 1e-3 in a chain of a thousand links.
ILL_CONDITIONED, WORST_CONDITIONED, HARDLY_CONDITIONED = 5e-4, 1e-8, 1e-11

# The pivots of a primitive with several rows may change in opposite directions: their product then changes by half as
# much as the pivot that changes most, in chains of balls.
COMPENSATED = 2.0


# Thresholds of the constraint graph and the sparse factorisation.

# --- splitting of bodies with many joints, docs/design-decisions.md, "Hubs are split from 42 rows on"
LARGEST = 42  # rows at a body that is not split
LEAF, FAN = 18, 4  # rows at a part without parts below it; parts below a part

# --- elimination order
WIDEST = 24  # rows of a dense block, so that zeros which merging takes in stay few

OWN = 100  # nodes in loops that are ordered in Python; more are left to SuperLU, which few scenes need to import

# Cost of a block in ns, fitted to timings on one core of an AMD EPYC: of three pivots, of a number of the panel, of a
# product, of updating other blocks, and of a link of a chain, which has kernels of its own. Only ratios matter.
PIVOTS_COST, NUMBER_COST, PRODUCT_COST, UPDATE_COST, LINK_COST = 49.0, 2.4, 0.24, 20.0, 66.0
LOOKUP = 1.1  # cost of one block over that of its parts up to which they are merged: what parts look up isn't in it

# --- the metric of lengths
# Ratio of masses, or of the largest inertias of bodies, above which factors of S lose as many digits: the start is
# checked once more, and multipliers of series are refined. Above its square, half of the digits, masses are named as
# the reason where a run can't begin, or ends singular.
UNEQUAL_MASSES = 1e4

# --- axes with next to no inertia, docs/design-decisions.md, "Inertia is added and taken back"
# Moment of inertia over the largest of the body, about its centroid or by its lever arms: less takes an axis row. The
# condition of S is about its inverse, so six digits of the multipliers are at stake.
THIN = 1e-6
# The same over the largest of the scene, of a body that carries heavier ones: below the first, pivots of S come close
# to rounding, and all moments below the second, its root, are raised. Radau takes shorter steps then.
MASSLESS, RAISED = 1e-12, 1e-8
