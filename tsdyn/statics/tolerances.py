"""Limits of linearisation and of equilibria, each with its unit and where it comes from."""

# --- factorisation ---
LEAST_DIVISOR = 1e-300
# Share of the largest pivot of the equilibrated saddle-point matrix: as in observables, a share of rounding.
SINGULAR = 1e-15

# --- choice of coordinates ---
# A coordinate is taken in its turn if what the ones before leave of it is this share of the largest that is left.
IN_TURN = 0.1
# Share of a coordinate's own variation that the ones before it must leave: squares, as pivots of a Gram matrix are,
# of which rounding leaves 1e-15.
INDEPENDENT = 1e-9

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
