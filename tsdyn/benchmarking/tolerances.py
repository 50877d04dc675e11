"""Limits of references and of the tables of Haug (2018)."""

# Tolerances of the two methods of a reference, tried in turn; agreement that need not be bettered.
REFERENCE_TOLERANCES, ENOUGH = (1e-10, 1e-12, 1e-13), 1e-12
# The error of a reference is taken to be below this many times the difference of the two.
ROOM = 2.0
# Tol = u_tol = B_tol of the paper; at the tightest, the errors to which tsdyn holds any scene (position, velocity,
# acceleration: m, m/s, m/s^2).
PAPER_TOLERANCES, ROUNDING = (1e-6, 1e-9, 1e-12), (1e-14, 1e-13, 1e-12)
