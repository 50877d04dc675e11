"""Limits of assembly and of the checks of a start, each with its unit and where it comes from.

Shares are without unit; q has m and Euler parameters side by side, so residuals are compared with 1 + max |q|.
"""

# --- residuals ---
# A start whose residuals are below LAST_PLACE of 1 + max |q| is taken as it is: projection would only exchange one
# rounding for another. Gauss-Newton steps end at ROUNDING: their sums round several times.
#
# Residuals that are accepted by default, as where `initial_tol` of `simulate` is left out, since positions may be
# typed: of a start's positions and velocities, of loops in files, of positions and rates of a joint beside what a motor
# prescribes (rad, m), of configurations that are asked for their mobility, and of their neighbours.
INITIAL_TOL = 1e-9

# --- redundant rows of a start ---
# Shares of a pivot of S in its diagonal entry below which the row is dropped, tried in turn. Pivots are squares of
# distances between rows: inexact joint data bring them to 1e-3, rounding leaves 1e-15.
REDUNDANT_SHARES = 1e-3, 1e-6, 1e-9, 1e-12
# Rows of a straight chain from which the share of its weakest one, an inverse cube of its links, may be rounding.
MANY_ROWS = 50_000
# How far away the rank is compared, since singular positions are isolated, and no closer; how far a dropped row must
# hold on the way from the start, and at least: rad, or share of the scene's size. A row that is dependent at the start
# alone is violated by the square of the distance: 1e-4 at 1e-2, far above rounding.
NEIGHBOURHOOD, LEAST_NEIGHBOURHOOD = 1e-2, 1e-3
# A leg of that way whose end can't be projected is shortened to a quarter, down to this share of the whole.
SHORTENING, SHORTEST_LEG = 0.25, 1e-3
# Entries of Phi_q (8 bytes each): up to the first, dependent rows are listed with their partners; up to the second,
# rows are selected by dense QR where blocks fail.
LISTED_ENTRIES, DENSE_ENTRIES = 1 << 20, 1 << 23

# --- dependence of rows at unit length ---
# Weight from which on a row is named among those that another depends on; rounding of weights is RANK_TOL at most.
# Residual, as a share of the largest, above which a row is named whose derivative vanishes, or that is in conflict.
# Share of unit rows below which a direction isn't corrected by steps towards a sketch while the constraints aren't met
# yet, and a twist is free; joints that are open by more than its square are closed first.
DEPENDENCE = 1e-6
# The same below which Gauss-Newton steps don't correct a direction: below RANK_TOL, which is that of tangents.
SOLVED = 1e-10
# Distance of a unit row from the rows before it, or singular value as a share of the largest, down to which all are
# independent for sure: the smallest singular value is hardly smaller than the distance by more than the square root of
# their number, and normal equations lose its square.
FIRM = 1e-2
# Mass and inertia of light bodies, as a share of the largest: the metric of kinetic energy stays a metric, of numbers
# whose roots are four digits apart at most. An axis without inertia gets THIN of the body's mean moment, or of its mass
# at the arm of its joints (rows/tolerances.py).
LIGHTEST = 1e-8

# --- the way from a sketch ---
# Coordinates up to which matrices are dense: with 30 bodies both ways take the same time, and dense ones know the rank.
DENSE = 200
# (softness of the constraints' springs, steps at most) from stage to stage; the last is stiff enough for Gauss-Newton.
STAGES = ((1.0, 4), (0.3, 4), (0.1, 4), (0.03, 4), (0.01, 4), (1e-3, 5), (1e-4, 5), (1e-6, 5), (1e-8, 40))
# A sketch that is off by less (share of the scene's reach) takes the last stage only.
NEAR_SKETCH = 0.02
# rad; the largest rotation of a step, also of an analysis: angles are counted by the nearest turn, the trapezoidal rule
# holds, and predictions serve. The same of a step along the constraints.
MOST_ROTATION, MOST_SLIDE = 0.5, 0.2
# Steps at most: of Gauss-Newton, and of the descent along the constraints.
MOST_SKETCHED = 60
# Length of a step, as a share of the wish, at which a stage has converged: the last one, and those before it. Springs
# of softness 1e-8 round steps to 1e-8 of it and more; Gauss-Newton steps and the descent go on from there.
LAST_CONVERGED, STAGE_CONVERGED = 1e-6, 0.03
# What is left of the slope, as a share of the distance, when the descent ends; and the least decrease of a step.
SETTLED, DECREASE = 1e-11, 0.9
# Softness of the springs that keep a fold, from try to try.
STIFFER = (0.1, 0.01, 0.001)

# --- loops, conflicts, mobility, plug-ins ---
# rad; an angle of a fold that is drawn deliberately, and one that is reported when it comes out on the other side.
CLEAR_FOLD, SHOWN = 0.2, 0.1
# Rotations of the three directions of a fold, each by a quarter of SHOWN, reverse none of it: sin(0.1) > 3 * 0.025.
# Share of a slide's direction across the axis beside it below which the two make no fold.
FLAT_FOLD = 0.1
# Excess of a length (share of the largest, m) or an angle (rad) that proves a conflict: ten times the rounding of
# arccos near one, 1e-9 times the steps of a way; and points or directions up to which ways are compared, for memory.
PROVED, MOST_NODES = 1e-7, 600
# Constraints that a message lists.
SHOWN_CONSTRAINTS = 8
# Relative steps of difference quotients of phi.
PHI_STEPS = (1e-2, 1e-4, 1e-6)
# The least x that such a step is relative to, m.
LEAST_X = 1e-6
# A joint in a loop is driven by steps of this, rad, or share of the scene's size; the least share of a step.
DRIVE_TURN, DRIVE_SHARE, DRIVE_LEAST = 0.25, 0.05, 2.0**-8

# --- arithmetic ---
# a = |v|, rad, below which (1 - a/2 cot(a/2)) / a^2 is its limit 1/12: the next term is a^2 / 720; the formula loses
# eps / a^2 by cancellation.
SMALL_ANGLE = 1e-3

# --- joint coordinates ---
# Loops are closed where their residuals at unit length are below SUM_ROUNDING, and joint coordinates are those given
# to NEGLIGIBLE, rad or m: some tens of roundings. Gauss-Newton steps of all coordinates, which don't know what is held,
# go on from there.
#
# Damping of the first step, of rows at unit length; the least, above rounding of dependent rows; and that from which on
# steps are too short to help.
DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-10, 1e8
# Steps at most from a start; decreases in a row above which share end it: at a minimum that closes nothing.
MOST_STEPS, STALLED = 80, (6, 0.99)
# rad: the largest component of the rotation of a joint in a step.
MOST_TURN = 1.0
# Floats of the derivatives of loops by twists (32 MB): forty loops of 500 bodies. Steps take a second beyond.
MOST_ENTRIES = 1 << 22
# Displacements of joints at random, rad and shares of the scene's size, from start to start; starts beyond the first
# that closes in which one is sought that keeps within the limits.
HINT = 0.3  # weight of a limit that is passed, rad or m, beside rows at unit length
SPREADS, HINTED = (0.1, 0.3, 0.6, 1.0, 1.5, 2.0, 2.5, 3.0, 3.0, 3.0, 3.0, 3.0), 6
