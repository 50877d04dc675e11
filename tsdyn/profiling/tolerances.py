"""Limits of measurement and advice; s where no other unit is named."""

# --- measurement ---
# Calls of each sort: time altogether, and how many at least and at most; calls longer than the fourth are made as few
# times as can be.
SAMPLE, FEWEST, MOST, LONG = 1.0, 2, 40, 5.0
# A sample of a part that is repeated, and samples.
BRIEF, ROUNDS = 2e-3, 5
# The least time that a share is taken of: the resolution of the clock.
RESOLUTION = 1e-9

# --- advice: shares of the call from which on a part is worth a word ---
CHARTS, OUTPUTS, PYTHON, FORCE, REJECTED, CAPPED = 0.03, 0.1, 0.3, 0.25, 0.2, 0.5
# An alternative is advised if it is this many times as fast; what a first call alone costs, if it is that many calls.
QUICKER, ONCE = 1.2, 3.0
# Looser tolerances that are tried: times those given, at most.
LOOSER, LOOSEST = 100.0, 1e-3
# Beside calls that take longer nothing is tried.
LONGEST = 10.0
# Time of an alternative's calls; steps by which its whole time is estimated.
ALTERNATIVE, SHORT = 0.1, 20
# How far the ends of an advised alternative may be off: times the tolerances, and in all (m, or rotation matrix).
ERRORS, LARGEST_GAP = 100.0, 1e-2
