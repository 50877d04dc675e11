"""Levels of rounding that all packages share; limits of root isolation and rank. Without unit where none is given."""

import numpy as np

EPS = float(np.finfo(float).eps)

# --- levels of rounding: shares of the terms of a sum, or of the largest number of its kind, up to which it is zero ---
# One unit in the last place: of sums of few terms that are large.
LAST_PLACE = 2e-16
# Sums of a dozen products, each rounded by 1.1e-16: 4e-16 as a random walk, 1.3e-15 at worst. Such are |Phi|, four
# squares of a quaternion, and displacements (m, rad) that have changed H by no more.
ROUNDING = 1e-15
# A hundred roundings: pivots of a matrix of unit rows or unit diagonal, its singular values, moments of inertia as
# eigenvalues, sums of the loads of a body.
SUM_ROUNDING = 1e-14
# A thousand: pivots of products such as S = H W H^T, squares of the sine of an angle of 3e-7 rad; sums of hundreds of
# terms and what is solved for with such pivots, as reactions.
PIVOT_ROUNDING = 1e-13
# Results of several such steps.
NEGLIGIBLE = 1e-12
# Numbers typed by hand, from tables or from files of other programs have nine digits: directions (sines and cosines of
# angles), points (m), moments of inertia over the largest, data over the largest value.
TYPED = 1e-9
# Half of the digits: what is left of quotients of differences, of double eigenvalues, of states from runs.
HALF_DIGITS = 1e-7
# Residuals over their rounding: one that has stopped falling is rounding up to this, an error above it. Two digits,
# since rounding grows along closed loops and with the distance from the origin.
ROUNDING_AT_MOST = 100.0
# No number that matters is so small: the least divisor, mass (kg) and moment of inertia, the largest that counts as
# none.
TINY = 1e-300
# Complex steps: f(x + i h) / h cancels nothing and truncates h^2 f'''. So h is as small as it may be without products
# of h, such as h^2 of a law's squares of small numbers, that reach the least number there is (5e-324) where they count.
COMPLEX_STEP = 1e-40

# --- rank of rows of unit length ---
# Singular value, as a share of the largest, up to which it is zero. Formulations factor products of two matrices of
# rows, so a share of 1e-7 is 1e-14 there, next to rounding.
RANK_TOL = 1e-7
# Jacobi rotations: cosine of the angle of two rows below which they are orthogonal, and below which all are converged
# (the next sweep squares it).
ORTHOGONAL, CONVERGED = 1e-15, 1e-10

# Complementarity, of a matrix with unit diagonal and q of size one: a pivot up to which it is zero, the depth of pivots
# beside rounding; -w of a row without a pivot that is no rounding of nearly dependent rows.
LEAST_PIVOT, WITHOUT_SOLUTION = 1e-11, 1e-8
# Rows that enter, for each row: about one does; more are rounding.
MOST_ENTRIES = 20
# Newton's method on Coulomb's cone, to a residual of SUM_ROUNDING of its terms: steps at most; steps without half the
# residual after which it has stalled. What is left where dependent rows disagree by rounding; of slips that no bounded
# force would end, where rows depend on each other to half of the digits. Sweeps over the contacts before each start;
# factors of u. Shift of a diagonal of one for rows that depend on each other: where these disagree by rounding, a step
# is the disagreement over the shift; share of the residual that such a step may leave.
CONE_STEPS, CONE_STALLED, CONE_LEFT, CONE_SLIP = 60, 8, 1e-11, 1e-8
CONE_SHIFT, CONE_SHIFTED = 1e-6, 1e-3
CONE_SWEEPS, CONE_FACTORS = (0, 3, 30, 300, 3000), (1.0, 3.0, 10.0, 0.3)

# Rows of a sparse matrix from which a factorisation may take more than 0.1 s.
LONG_LU = 1 << 15
# Numbers of right-hand sides from which a solution may.
LONG_SOLVE = 1 << 21

# --- isolation of roots by interpolants at Chebyshev nodes, see root_isolation.py ---
# Error of an interpolant, as a share of the scale: resolved; and not worth one of twice the degree.
TIGHT, UNRESOLVED = 1e-10, 0.05
# An extreme whose value is nearer to zero (share of the scale) is sampled; one beside an end that is nearer than the
# second is looked for.
NEAR_ZERO, AT_ZERO = 0.01, 1e-6
# Values that exceed the higher half of the coefficients by this factor exclude a zero.
CLEAR = 10.0
# Share of the interval on which roughness is rounding; the least interval, in roundings of the time; the least share of
# the whole.
ROUGH_SHARE, SHORTEST_INTERVAL, DEEPEST = 1e-7, 1e4 * EPS, 2.0**-24
# Steps of Newton's method or of bisection to a zero of an interpolant.
MOST_BISECTIONS = 64
# Noise is measured on intervals of the share ROUGH_SHARE, then this many times as long, up to the second share.
NOISE_RATIO, WIDEST_NOISE = 1e-3, 1e-3
# Share of a noise below which rounding of the state doesn't explain it: rounding in random directions varies by less.
STALE = 0.1
# Values are multiplied by a power of two: by SAFE, so that no sum of them is infinite; by one that makes the largest
# about SAFE where it is below UNDERFLOWING then, since parts of it would vanish; its exponent is limited.
SAFE, UNDERFLOWING, MOST_SCALED = 2.0**-16, 2.0**-500, 1000
# Position of a minimum, as a share of the interval: the root of rounding, twice.
EXTREME = 1e-9
# Imaginary part, on the interval -1 to 1, up to which a root of a polynomial is real: double roots split by the root of
# rounding.
REAL = 1e-6
