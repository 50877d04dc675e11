"""Thresholds of Taylor runs: length of a step, passage of singular configurations, stiffness.

Shares are values of the singularity indicator (rows/singularity.py), which falls as the square of the distance.
"""

# --- length and order ------------------------------------------------------------------------------------------------
# Cost of a step's end (projection, factors of S, poses), in orders of its series: benchmarks/measure.py, chain of 16.
STEP_COST = 3

# Range of the coefficients of a step's last order: products of smaller ones lose digits, those of larger ones overflow.
FAINT, VAST = 1e-280, 1e280

# Landing, over tolerance and rounding of Phi, beyond which the projection corrects no truncation error: the radius of
# convergence was wrong.
MISSED = 100.0

# rad of the fastest body in a step where joint angles are counted by forces: two steps a turn would do.
MOST_TURN = 1.0

# Parts of a step in which Euler parameters are followed, one for each radian, at most.
MOST_PARTS = 100.0

# d0^2 of the rotation of a step, above which p follows from its increment: 2 rad.
WIDE = 0.3

# Factor of a step whose end was not reached.
HALVED = 0.5

# Error of rates, 1/s, over that of places, up to which only the latter limits steps of sharp forces. Their steps can be
# very short, and an error of places divided by the step is one of rates.
RATES = 10.0
# The same wherever the motion is stiff, over 1 + the largest rate: a fast mode that steps make grow shows in rates
# first. A step's tolerance is a thousandth of the run's.
STIFF_RATES = 1000.0

# Places of a step, equally far apart, at which series of sharp forces are compared with their laws; steps of a run at
# least, since a pulse between two places is missed.
PLACES, LEAST_STEPS = 4, 8
# atol and rtol of that comparison where steps are fixed and have no tolerance: above the errors of series in too long a
# step, below those of series that have ended.
COARSE = 1e-3

# HOP: length of a step over a place where a law is not analytic, over the shortest step (runs/tolerances.py, SHORTEST):
# forces are bounded there, so its error is rounding. Within APART lengths of the one before, such a step is twice as
# long; after MOST_HOPS of them the run ends: the motion comes to rest there.
HOP, MOST_HOPS, APART = 16.0, 8, 1e3

# Angular velocity (rad/s) that counts as none.
NO_SPEED = 1e-300

# --- stiffness -------------------------------------------------------------------------------------------------------
# rad, and part of the scene's size: a step that turns and moves everything by less is limited by something that can't
# be seen. So many of them in a row, and the motion may be stiff (docs/design-decisions.md).
SMALL, SMALL_STEPS = 0.02, 40
# Share of what a law divides by that a step leaves: where it is less, the law limits the step, not stiffness.
STILL = 0.9
# A step by less than TINY counts for so many.
TINY, FASTER = 0.002, 4
# The same in scenes with sharp forces, which need some ten short steps wherever a velocity reverses; steps by less than
# MINUTE count for AT_REST there: a reversal at a slip velocity of 1e-9 m/s takes 13, rest no end of them.
SHARP_STEPS, MINUTE, AT_REST = 400, 1e-6, 8

# --- singular configurations -----------------------------------------------------------------------------------------
# Pivot of S, over its diagonal entry, below which accelerations by elimination have lost as many digits, so that those
# of the series are taken. Below GONE a row is left out of a projection: it would make more of what positions are off by
# than the series is.
NEXT_TO_SINGULAR, GONE = 1e-8, 1e-10
# Largest pivot of a run below which masses are so unequal that no pivot is large: NEXT_TO_SINGULAR is relative to it.
UNEQUAL = 1e-4

# Share of a step's end, over that of its start, from which the step has come closer; is too close to go on from; is
# too close even if it has passed. Measured on rows of parallelograms (tests/test_singular_passage.py).
CLOSER, CLOSE, PASSED = 0.3, 0.1, 0.02

# A step that ends there is shortened by this factor, so many times: to 0.17 of its length.
AVOID, AVOIDING = 0.7, 5

# Factor of the tolerance from one try to pass to the next; loosest tolerance of a step past from elsewhere, and from
# close by, where lam has few digits; least order of its series.
LOOSER, FAR_PASSING, PASSING, LEAST_ORDER = 2.0, 1e-13, 1e-10, 5

# Tolerance of a step that starts next to a singular configuration, over that of the run, and the least of it: rounding
# errors of lam grow there by the ratio of step length to distance.
TIGHTER, TIGHTEST = 0.01, 1e-16

# Share, over the largest one of the run, below which a run goes on with a part SPARE of its tolerance: what is lost
# there is made up elsewhere.
WARY, SPARE = 0.06, 0.1

# --- size ------------------------------------------------------------------------------------------------------------
# Bodies from which lam is refined once in every run: errors of a solution by elimination grow with their number.
MANY = 100

# Orders of lam, from zero on, that are refined where S is ill-conditioned; all are where it takes two refinements.
ILL_ORDERS = 3

# Orders of all bodies, about a hundred bytes each, from which series exceed the near caches (3 MB).
FAR = 1 << 15
