"""Limits of linearisation and of equilibria, each with its unit and where it comes from."""

# --- factorisation ---
LEAST_DIVISOR = 1e-300
# Share of the largest pivot of the saddle-point matrix with unit masses and unit rows: a share of rounding.
SINGULAR = 1e-15
# Refinements of accelerations and multipliers where masses are unequal: the factors lose their ratio, each regains it.
UNEQUAL_SWEEPS = 3

# Share of the loads' own accelerations below which those that are left are rounding.
ROUNDED = 1e-13

# Coordinates up to which redundant rows are chosen by QR with pivoting, which costs their cube; of larger scenes by
# elimination, with this share of a pivot of S in its diagonal entry as in configuration.
DENSE, REDUNDANT_SHARE = 400, 1e-6

# --- choice of coordinates ---
# A coordinate is taken in its turn if what the ones before leave of it is this share of the largest that is left.
IN_TURN = 0.1
# Share of a coordinate's own variation that the ones before it must leave: squares, as pivots of a Gram matrix are,
# of which rounding leaves 1e-15.
INDEPENDENT = 1e-9
# Share of a coordinate's variation without constraints that is rounding: squares again, of sums of a few roundings.
HELD = 1e-13
# Share of the largest pivot of constraints and coordinates, unit rows, above which the coordinates are independent.
CLEAR = 1e-6

# Candidates that are looked at together: their dense products cost what a sparse factorisation does.
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
# Share of the expected change of the loads by which the two sides may differ; smooth laws leave PROBE over their scale.
ROUGH = 1e-2
# Share of the loads' own size that is rounding of their differences.
ROUNDING = 1e-12

# --- inputs ---
# Share of the largest generalised force of an input below which its projection onto the motions admitted is rounding.
NO_EFFECT = 1e-12

# --- equilibria ---
# Share of the loads' own accelerations that counts as balanced: rounding of sums of a few loads. Steps end there.
BALANCED = 1e-14
# The same of what the stiffness leaves out.
SETTLED = 1e-12
# The same at the end of all steps; also of constraints, relative to 1 + max |q|.
TURNED = 1e-9
# Share of the scene's size, rad: a step that is shorter changes nothing.
LEAST_STEP = 1e-15
LEAST_SHIFT = 1e-300
# Weight of a shift by the scene's size against a turn by a radian, among what takes up loads: forces are passed on by
# chains of up to the inverse root of it in links.
MASSLESS = 1e-8
# Refinements of what is solved with it, which lose half of the digits at first.
REFINEMENTS = 2
# Share of the stiffness of a body above which a sign is certain, and the softness of rows of unit length: factors
# without exchange of rows round by 1e-16 over the latter.
CLEARLY, SOFTENED = 1e-7, 1e-8
# rad, of a step: angles are counted by the nearest turn, and the trapezoidal rule holds.
MOST_TURN = 0.5
# Factors of mu after a step that is taken, and after one that isn't; where it begins, its least; D doesn't suffice
# above the last.
SOFTER, STIFFER, FIRST_MU, LEAST_MU, STIFF = 0.25, 5.0, 1e-2, 1e-9, 60.0
# Factor of a step that does too little work.
SHORTER = 0.3
# Share of the largest stiffness of a body, or of all, below which it has none of its own.
NOTHING = 1e-12
# Share of the loads that stands for a stiffness, where there is none: steps are as long as they may be.
SLIDING = 1e-6
# Share of the stiffness of a body that a direction without stiffness has.
SOFTEST = 1e-10
# Share of the work promised that a step must do; share of what is unbalanced that a short one may leave.
WORTH, GOOD = 0.1, 0.9
# Steps one after the other that leave more than half of what is nearly nothing: it is rounding.
IN_VAIN = 3
# rad, or shares of the scene's size: the work of shorter steps is rounding, and steps that fail though they are shorter
# than the second are the last.
SHORT, FINAL = 1e-4, 1e-9
# A step is this many times longer than may be before mu grows; tries of a step.
TOO_FAR, MOST_TRIES = 4.0, 20
# The share of a search that steps take, of what progress reports; stability takes the rest.
SEARCH = 0.7
# Steps at most, and the way in sizes of the scene: what is farther falls.
MOST_STEPS, FARTHEST = 400, 1e5
# rad, of all steps: what has turned farther is driven round.
MOST_TURNED = 60.0
# Constraints after a step, relative to 1 + max |q|: sums round several times. A sweep that leaves more than the second,
# a share, stalls.
CLOSED, SLOWEST, MOST_SWEEPS = 1e-15, 0.7, 40
# ... and above this the step is too long.
STALLED = 1e-6
# rad, or shares of the scene's size: ways off a saddle, tried in turn.
KICKS = 0.1, 0.03, 0.01
# Share of the terms of the stiffness up to which an asymmetry is rounding.
NEUTRAL_ASYMMETRY = 1e-10
# Share of the loads' own accelerations up to which a configuration without positive stiffness is close to a saddle;
# sweeps of inverse iteration to a direction down from there.
AT_SADDLE, SWEEPS = 1e-3, 8
# Increments up to which all eigenvectors are looked at; negative eigenvalues up to which these alone are; shares of the
# stiffness tried until it is positive.
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
