"""Thresholds of the constraint graph and the sparse factorisation."""

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
# Arm of a body's joints over the longest in the scene, at least: rotations of bodies with short arms, or none, are as
# visible as the longest allow. Pivots are squares of it, far above rounding.
LEAST_ARM = 1e-3
# Ratio of masses, or of the largest inertias of bodies, above which factors of S lose as many digits: the start is
# looked at once more, and multipliers of series are refined.
UNEQUAL = 1e4
# The same ratio, above which masses are named as the reason where a run can't begin, or ends singular: half of the
# digits are lost.
TOO_UNEQUAL = 1e8

# --- axes with next to no inertia, docs/design-decisions.md, "Inertia is added and taken back"
# Moment of inertia over the largest of the body, about its centroid or by its lever arms: less takes an axis row. The
# condition of S is about its inverse, so six digits of the multipliers are at stake.
THIN = 1e-6
# The same over the largest of the scene, of a body that carries heavier ones: below the first, pivots of S come close
# to rounding, and all moments below the second, its root, are raised. Radau takes shorter steps then.
FAINT, RAISED = 1e-12, 1e-8
GIVEN = 0.1  # the raised moment of inertia J over the same: a condition of ten
NONE = 1e-14  # moment of inertia over the largest about the centroid: less is rounding of the eigenvalues, and zero
