"""Limits of kinematic analysis and inverse dynamics, each with its unit and where it comes from."""


# Limits of linearisation and of equilibria, each with its unit and where it comes from.

# --- factorisation ---
LEAST_DIVISOR = 1e-300
# Share of the largest pivot of the saddle-point matrix with unit masses and unit rows: a share of rounding.
SINGULAR = 1e-15
# Refinements of accelerations and multipliers where masses are unequal: the factors lose their ratio, each regains it.
UNEQUAL_SWEEPS = 3

# Residual accelerations over those of the loads alone: below it they are rounding.
ROUNDED = 1e-13

# Coordinates up to which redundant rows are chosen by QR with pivoting, which costs their cube; of larger scenes by
# elimination, with this share of a pivot of S in its diagonal entry as in configuration.
DENSE, REDUNDANT_SHARE = 400, 1e-6

# --- choice of coordinates ---
# Accept the next coordinate in order if its component independent of the accepted ones is at least this fraction of the
# best candidate's.
IN_TURN = 0.1
# A coordinate is independent if this fraction of its variation is independent of the accepted ones. Squares, being
# pivots of a Gram matrix with rounding of 1e-15.
INDEPENDENT = 1e-9
# Share of a coordinate's variation without constraints that is rounding: squares again, of sums of a few roundings.
HELD = 1e-13
# Share of the largest pivot of constraints and coordinates, unit rows, above which the coordinates are independent.
CLEAR = 1e-6

# Candidates per batch: their dense products cost as much as a sparse factorisation.
BATCH = 64

# --- steady motion ---
# Share of the largest accelerations, speeds and constraint values up to which a motion counts as steady or at rest:
# states of steady motion may be typed, or come from runs with tolerances.
STEADY = 1e-7
# Share of the mean principal inertia up to which two are equal.
EQUAL_INERTIA = 1e-9
# rad; the turns after which a motion is compared with itself.
TURNS = 0.7, 2.1

# --- eigenvalues ---
# Share of the terms of K below which singular values are roundings: sums of a few hundred roundings.
NO_STIFFNESS = 1e-13
# Share of asymmetry, and of damping, that is rounding: then eigenvalues are those of a symmetric pencil.
SYMMETRIC = 1e-12
# Share of the largest eigenvalue below which one counts as zero.
ZERO = 1e-12

# --- smoothness of forces ---
# Share of the scene's size, rad, and of the speeds by which loads are displaced on both sides of a state.
PROBE = 1e-7
# The differences on both sides may deviate by this fraction of the expected change; those of a smooth law deviate by
# PROBE over its scale.
ROUGH = 1e-2
# Share of the loads' own size that is rounding of their differences.
ROUNDING = 1e-12

# --- inputs ---
# Projection of an input onto the admissible motions over its largest generalised force: below it the projection is
# rounding.
NO_INPUT = 1e-12

# --- equilibria ---
# Residual accelerations over those of the loads alone. BALANCED: rounding of sums of a few loads, where steps end.
BALANCED = 1e-14
# SETTLED: the part that the stiffness doesn't model.
SETTLED = 1e-12
# TURNED: accepted at the end of all steps; also of constraints, relative to 1 + max |q|.
TURNED = 1e-9
# Share of the scene's size, rad: shorter steps are lost in rounding.
LEAST_STEP = 1e-15
LEAST_SHIFT = 1e-300
# Weight of a translation by the scene's size against a rotation by one radian in the stiffness of massless bodies:
# chains of up to its inverse square root in links transmit forces.
MASSLESS = 1e-8
# Refinements of what is solved with it, which lose half of the digits at first.
REFINEMENTS = 2
# Share of the stiffness of a body above which a sign is certain, and the softness of rows of unit length: factors
# without exchange of rows round by 1e-16 over the latter.
CLEARLY, SOFTENED = 1e-7, 1e-8
# rad, of a step: angles are counted by the nearest turn, and the trapezoidal rule holds.
MOST_TURN = 0.5
# Factors of mu after an accepted and after a rejected step; its first and its least value; above STIFF the diagonal D
# doesn't suffice.
SOFTER, STIFFER, FIRST_MU, LEAST_MU, STIFF = 0.25, 5.0, 1e-2, 1e-9, 60.0
# Factor of a step that reduces the energy too little.
SHORTER = 0.3
# Stiffness of a body over its largest entry, or over that of all bodies: below it the body counts as free.
NOTHING = 1e-12
# Where there is no stiffness, this fraction of the loads replaces it: steps then have their greatest length.
SLIDING = 1e-6
# Share of the stiffness of a body that a direction without stiffness has.
SOFTEST = 1e-10
# A step must do this fraction of the predicted work; a short one may leave this fraction of the residual loads.
WORTH, GOOD = 0.1, 0.9
# So many successive steps that don't halve a residual near rounding: it is rounding.
IN_VAIN = 3
# rad, or shares of the scene's size: the work of steps shorter than SHORT is rounding; if a step shorter than FINAL
# fails, the search ends.
SHORT, FINAL = 1e-4, 1e-9
# mu grows if a step exceeds its greatest length by this factor; tries of a step.
TOO_FAR, MOST_TRIES = 4.0, 20
# Fraction of the progress bar for the steps; the check of stability has the rest.
SEARCH = 0.7
# Steps at most; displacement over the size of the scene: a scene that moves farther is falling.
MOST_STEPS, FARTHEST = 400, 1e5
# rad, rotation in all steps: a body that has rotated farther is driven by its loads.
MOST_TURNED = 60.0
# Constraints after a step, relative to 1 + max |q|, several roundings of sums. A sweep that leaves more than the
# fraction SLOWEST has stalled.
CLOSED, SLOWEST, MOST_SWEEPS = 1e-15, 0.7, 40
# ... and above this the step is too long.
STALLED = 1e-6
# rad, or shares of the scene's size: displacements away from a saddle, tried in turn.
KICKS = 0.1, 0.03, 0.01
# Share of the terms of the stiffness up to which an asymmetry is rounding.
NEUTRAL_ASYMMETRY = 1e-10
# Residual accelerations over those of the loads alone, up to which a configuration without positive stiffness is near a
# saddle; sweeps of inverse iteration for a descent direction.
AT_SADDLE, SWEEPS = 1e-3, 8
# Degrees of freedom up to which all eigenvectors are computed; negative eigenvalues up to which only theirs are;
# shifts, as fractions of the stiffness, tried until it is positive definite.
SMALL, FEW_NEGATIVE, SHIFTS = 150, 6, (1e-4, 1e-2, 1.0, 10.0)
# Share of the stiffness below which a direction without load is neutral.
SOFT = 1e-5
# Saddles left at most.
MOST_SADDLES = 12
# Share of the largest eigenvalue up to which a real part of a circulatory system is rounding: the root of rounding.
GROWING = 1e-7

# --- relative equilibria ---
# Newton steps at most, and halvings of one.
MOST_NEWTON, HALVINGS = 60, 12
# Share of a rotor's angular velocity that may be off its axis of symmetry: axes may be typed.
ON_AXIS = 1e-9


# --- steps along a branch ---
# rad; a rotation in one step up to which angles are counted by the nearest turn, and the prediction serves.
LARGEST_TURN = 0.5
# Share of a step by which velocities, times the step, may differ from their prediction; another branch has others.
LARGEST_CHANGE = 0.2
# rad, or share of the scene's size: a change that is no sign of another branch, as where a motion starts from rest.
NO_CHANGE = 1e-3
# Share of what is allowed below which the next step is longer, and its factor.
CLOSE, GROWTH = 0.2, 2.0
# Steps over the times asked for, at least: a motion that comes back to rest in between is seen.
LEAST_STEPS = 50
# Share of the span below which a step is none; and share of the time: rounding of a shorter one is a thousandth of it.
SHORTEST, SEEN = 1e-11, 2e-13
# Shares of a time, or step, that are rounding.
TIME_ROUNDING = 1e-10
# |Phi| that rounding leaves, over the largest coordinate: sums of a few products.
LEAST_RESIDUAL = 1e-15
# Steps in one call of the compiled code: some hundredths of a second, so that Ctrl-C is answered.
SLICE = 20000

# --- velocities of a start, by sparse matrices ---
# Share of the velocities that may be left of a rate of a constraint; sweeps of refinement, at most.
MET, POLISHINGS = 1e-12, 20
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
# Share of the largest accelerations that may be left where the matrix is regular: rounding of sums, of long chains too.
SOLVED = 1e-9
# The same above which a motion is refused: runs give accelerations to their tolerances.
MISSING = 1e-6
# Residual of a given motion, relative to 1 + max |q|, |qd| or |qdd|, that is accepted: that of runs with tolerances.
CONSISTENT = 1e-6
# Coordinates up to which the matrices of an instant are dense: a dense factorisation takes less time there.
DENSE_INSTANT = 120
# Share of a unit load's own accelerations below which those under the constraints are rounding.
NO_LOAD = 1e-11
# Fraction of the largest load below which a load counts as idle, and is examined.
IDLE = 1e-9
