"""Limits of root isolation, rank and dense factors, without unit where none is given."""

import numpy as np

EPS = float(np.finfo(float).eps)

# --- rank of rows of unit length ---
# Singular value, as a share of the largest, up to which it is zero. Formulations factor products of two matrices of
# rows, so a share of 1e-7 is 1e-14 there, next to rounding.
RANK_TOL = 1e-7
# Length of a row, as a share of the longest, up to which the row is zero: rounding of its entries is 1e-16.
NO_LENGTH = 1e-12
# Jacobi rotations: cosine of the angle of two rows below which they are orthogonal, and below which all are converged
# (the next sweep squares it).
ORTHOGONAL, CONVERGED = 1e-15, 1e-10

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
# Noise is measured on intervals of the share ROUGH_SHARE, then this many times as long, up to the second share; less
# than the third share of the scale is none.
NOISE_RATIO, WIDEST_NOISE, NO_NOISE = 1e-3, 1e-3, 1e-12
# Values are multiplied by a power of two: by SAFE, so that no sum of them is infinite; by one that makes the largest
# about SAFE where it is below UNDERFLOWING then, since parts of it would vanish; its exponent is limited.
SAFE, UNDERFLOWING, MOST_SCALED = 2.0**-16, 2.0**-500, 1000
# Position of a minimum, as a share of the interval: the root of rounding, twice.
EXTREME = 1e-9
# Imaginary part, on the interval -1 to 1, up to which a root of a polynomial is real: double roots split by the root of
# rounding.
REAL = 1e-6

# --- volumes ---
# Volume of a mesh, as a share of the cube of its size, up to which the mesh is flat.
FLAT = 1e-12
