"""Thresholds of the formulations: quantity, unit, and where each number comes from."""

from ..maths.tolerances import EPS

# --- rounding: |Phi| below ROUNDING of the numbers that enter it, |Phi_q qd + Phi_t| below LAST_PLACE of |rd| + size
# |omega'|, corrections of multipliers below LAST_PLACE of the largest (maths/tolerances.py).

# m: size of a scene at least, where no constraint has one, for what counts as hardly moved.
NO_SIZE = 0.01

# Fraction of the rounding of Phi above which a residual is corrected, since residuals of successive steps add up.
# Correcting smaller ones would displace bodies by the rounding of Phi in every step, and change the energy.
WALK = 0.5

# Residual of the rows over the largest acceleration, up to which one correction of accelerations leaves rounding; and
# corrections at most. Masses that are unequal by 1e10 need two.
EXACT, REFINEMENTS = 1e-11, 3

# Of the scene's size, of one, and of the largest speed and spin: rounding in the error estimate of a step, which is all
# there is of it in coordinates that constraints keep at zero. With four times as much fast tops lose a digit at 1e-15.
ROUNDED = 0.25 * EPS

# --- convergence of Newton's method, ratios of successive residuals or corrections
SLOW = 0.25  # positions: above it the matrix of an older configuration is replaced; two sweeps gain a digit at it
STALLED = 0.5  # projection, Eq. 28, velocities: above it nothing is gained but rounding; twice that diverges
# velocities with the factors of S, reactions with friction: above it N or the matrix of the normal loads is factorised
SLOW_FACTORS = 0.1  # below it a sweep gains a digit

# Residual of Eq. 28, ||Phi_q U B - I||: above it B is factorised afresh. The iteration squares it and diverges from 1.
B_OUTDATED = 0.5

# Sweeps until a solve is taken for failed. At the rate SLOW 24 sweeps take fourteen digits, as many as there are.
SWEEPS, B_SWEEPS, LAND_SWEEPS = 24, 30, 11
RENEWALS = 4  # of N within one solve from the tangent plane, before the step counts as too long

# Normal loads: full steps in the first ones, half ones then, for a load whose sign alternates.
LOAD_SWEEPS, DAMPED, DAMPED_SHARE = 40, 12, 0.5

# Correction of the multipliers over the largest: if the matrix is new, a correction below the square root of rounding
# leaves rounding; two digits less are asked for, since the matrix is that of the multipliers before.
NEWTON_DONE = 1e-10

# Relative error of the multipliers that an explicit stage with joint friction may leave, over rtol of the step: a step
# changes velocities by about their size, so a hundredth of its tolerance is left.
LOADS_LEFT = 0.01

# Error norm that the solves for u and z may leave at each iterate of a stage: less than the iteration itself (KAPPA).
LEFT = 1e-4

# Contraction of corrections by factors of N of an older configuration, or ratio of residuals in the null-space form:
# assumed in a new chart; least value trusted.
LAG, LEAST_LAG = 0.1, 0.01

# Distance in time of a stage from the last one, over that of the last two, up to which multipliers are extrapolated.
FARTHEST_AHEAD = 2.0

# Corrections of the multipliers in an iteration of a stage, and the fraction of the unbalanced loads along the rows
# that may remain: the iteration matrix, formed with an older H, acts on the remainder. With one iteration a stage, 1e-5
# shows in the error of chains of 64 links at 1e-8: fourteen times as large.
# Where all stages are solved at once every one has two iterations, and 1e-5 hardly shows in errors; 1e-3 does.
REACTION_SWEEPS, REACTIONS_LEFT, REACTIONS_LEFT_COUPLED = 8, 1e-7, 1e-5
# Sweeps for the normal part of accelerations where there are rows on velocities: each gains a digit.
NORMAL_SWEEPS = 4

# 1 / m: residual after a Newton step over the square of the residual before, until it is measured. One over a metre:
# links of usual size.
CURVATURE = 1.0

# --- charts, dimensionless; docs/design-decisions.md, "Charts are small"
CONTRACTION_LIMIT = 0.15  # relative loss of a pivot of N since q0
TURN_LIMIT = 0.25  # |d|: the sine of half the rotation of a body since q0; 29 degrees
# The same where stages aren't placed: smaller charts gain less than 10 % of the truncation error, and rounding of their
# bases adds up.
TURN_FREE = 0.05
CONTRACTION_LOST = 0.5  # beyond it another branch may have been found; a rotation of 60 degrees
# Contraction of a new chart that a step is meant to cause at most: with 0.45 three times as many steps of a Peaucellier
# linkage are rejected; with 0.25 a spinning top takes two thirds more steps than without at 1e-3, with 0.3 a third.
CONTRACTION_KEPT = 0.3
FARTHEST = 0.9  # |d|^2: d0 = 0.32, and C grows as 1 / d0
TURN_SHARE = 0.55  # of |d|, as a contraction: a rotation that no constraint depends on reaches 0.9 in a step, 0.5 here
# Relative error of the factors of N at the end of a solve, up to which their pivots give the contraction (limit 0.15)
SAME = 1e-6

# --- units
# m: numbers up to it, and down to its reciprocal, are of usual size. Beyond it an orthonormal V mixes positions with
# Euler parameters that are smaller by as much, and D^T M D loses twice as many digits.
USUAL = 64.0
