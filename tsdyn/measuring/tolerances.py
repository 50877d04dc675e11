"""Limits of references, measurement and advice; s where no other unit is named."""

# --- references, and the tables of Haug (2018) ---
# Tolerances of the two methods of a reference, tried in turn; agreement that need not be bettered.
REFERENCE_TOLERANCES, ENOUGH = (1e-10, 1e-12, 1e-13), 1e-12
# The error of a reference is taken to be below this many times the difference of the two.
ROOM = 2.0
# Tol = u_tol = B_tol of the paper; at the tightest, the errors to which tsdyn holds any scene (position, velocity,
# acceleration: m, m/s, m/s^2).
PAPER_TOLERANCES, ROUNDING = (1e-6, 1e-9, 1e-12), (1e-14, 1e-13, 1e-12)

# --- measurement ---
# Calls of each sort: time altogether, and how many at least and at most; calls longer than the fourth are made as few
# times as can be.
SAMPLE, FEWEST, MOST, LONG = 1.0, 2, 40, 5.0
# Time of a sample of a repeated part; number of samples.
BRIEF, ROUNDS = 2e-3, 5
# The least time that is divided by: resolution of the clock.
RESOLUTION = 1e-9

# --- advice: shares of the call above which a part is mentioned ---
CHARTS, OUTPUTS, PYTHON, FORCE, REJECTED, CAPPED, EVENTS = 0.03, 0.1, 0.3, 0.25, 0.2, 0.5, 0.25
# Share of the interval that half of the impulses lie within, below which they are a series that ends.
CROWDED = 0.1
# An alternative is advised if it is faster by the first factor; costs of a first call, if they exceed so many calls.
QUICKER, ONCE = 1.2, 3.0
# Looser tolerances: factor, and upper bound.
LOOSER, LOOSEST = 100.0, 1e-3
# For longer calls no alternatives are tried.
LONGEST = 10.0
# Time of an alternative's calls; steps by which its whole time is estimated.
ALTERNATIVE, SHORT = 0.1, 20
# Difference of the final states of an advised alternative: in tolerances, and absolute (m, or rotation matrix).
ERRORS, LARGEST_GAP = 100.0, 1e-2
