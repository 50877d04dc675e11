"""Tolerances by name. A bound that scales with a size or a condition is a multiple of EPS where it stands."""

import numpy as np

EPS = np.finfo(float).eps

# rounding, relative to numbers of order one
EXACT = 1e-15  # one or two operations: 4 EPS
ROUNDING = 1e-14  # tens of operations: a formula against another one
ALGEBRA = 1e-13  # hundreds: products and solves of small, well-conditioned matrices
HELD = 1e-12  # what a run holds at every output, whatever its tolerances: constraints, ratios, reactions that balance

# errors of runs, from ten times their tolerances on
TIGHT = 1e-11  # rtol = atol = 1e-12
FINE = 1e-10  # 1e-11
CLOSE = 1e-9  # 1e-10
NEAR = 1e-8  # 1e-9
FAIR = 1e-7  # 1e-8
ROUGH = 1e-6  # 1e-7; or steps of a millisecond by a method of order four
COARSE = 1e-5  # 1e-6
LOOSE = 1e-4  # 1e-5
