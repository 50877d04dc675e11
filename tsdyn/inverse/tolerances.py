"""Limits of kinematic analysis and inverse dynamics, each with its unit and where it comes from."""

# --- steps along a branch ---
# rad; a rotation in one step up to which angles are counted by the nearest turn, and the prediction serves.
LARGEST_TURN = 0.5
# Share of a step by which velocities, times the step, may differ from their prediction; another branch has others.
LARGEST_CHANGE = 0.2
# rad, or share of the scene's size: a change that is no sign of another branch, as where a motion starts from rest.
NO_CHANGE = 1e-3
# Share of what is allowed below which the next step is longer, and its factor.
SMALL, GROWTH = 0.2, 2.0
# Steps over the times asked for, at least: a motion that comes back to rest in between is seen.
LEAST_STEPS = 50
# Share of the span below which a step is none; and share of the time: rounding of a shorter one is a thousandth of it.
SHORTEST, SEEN = 1e-11, 2e-13
# Shares of a time, or step, that are rounding.
TIME_ROUNDING = 1e-10
# |Phi| that rounding leaves, over the largest coordinate: sums of a few products.
ROUNDING = 1e-15
# Steps in one call of the compiled code: some hundredths of a second, so that Ctrl-C is answered.
SLICE = 20000

# --- velocities of a start, by sparse matrices ---
# Share of the velocities that may be left of a rate of a constraint; sweeps of refinement, at most.
MET, SWEEPS = 1e-12, 20
# The same above which no velocities follow the motions.
DEAD = 1e-7

# --- messages ---
# Names in a list, at most.
LISTED = 6

# --- inverse dynamics ---
# Share of the scene's size, rad: a pose that is nearer to the start of a motion is there.
THERE = 1e-12
# Weight of accelerations that actuators can't give, over the largest square of a unit load with unit masses: small
# against the loads that they can give, and large enough for a pivot.
DELTA = 1e-10
# Sweeps of refinement, which take the effect of that weight from the loads.
REFINEMENTS = 2
# Share of the largest accelerations that may be left where the matrix is regular: rounding of sums, of long chains too.
SOLVED = 1e-9
# The same above which a motion is refused: runs give accelerations to their tolerances.
MISSING = 1e-6
LEAST_DIVISOR = 1e-300
# Residual of a given motion, relative to 1 + max |q|, |qd| or |qdd|, that is accepted: that of runs with tolerances.
CONSISTENT = 1e-6
# Coordinates up to which the matrices of an instant are dense: a dense factorisation takes less time there.
DENSE = 120
# Share of a unit load's own accelerations below which those under the constraints are rounding.
NO_EFFECT = 1e-11
# Fraction of the largest load below which a load counts as idle, and is examined.
IDLE = 1e-9
