"""Thresholds of Taylor runs: length of a step, passage of singular configurations, stiffness.

Shares are values of the singularity indicator (rows/row_selection.py), which falls as the square of the distance.
"""

# --- length and order ------------------------------------------------------------------------------------------------
# Cost of a step's end (projection, factors of S, poses), in orders of its series: benchmarks/measure.py, chain of 16.
STEP_COST = 3

# Range of the coefficients of a step's last order: products of smaller ones lose digits, those of larger ones overflow.
FAINT, VAST = 1e-280, 1e280

# Parts of a step in which Euler parameters are followed, one for each radian, at most.
MOST_PARTS = 100.0

# d0^2 of the rotation of a step, above which p follows from its increment: 2 rad.
WIDE = 0.3

# Velocity error over position error, 1/s, up to which only the latter limits the steps of sharp forces. Such steps can
# be very short, and the velocity error is the position error over the step.
RATES = 10.0
# The same for stiff motions, over 1 + the largest rate: a fast mode that the steps amplify appears in velocities first.
# The tolerance of a step is a thousandth of the run's.
STIFF_RATES = 1000.0

# Places of a step, equally far apart, at which series of sharp forces are compared with their laws; those of users at
# more (motions/tolerances.py, SAMPLES). Steps of a run at least, since a pulse between two places is missed.
PLACES, LEAST_STEPS = 4, 8
# Length of a step that is cut where a sharp law and its series part, over the one at which they differ by the limit.
WITHIN = 0.95
# atol and rtol of that comparison where steps are fixed and have no tolerance: above the errors of series in too long a
# step, below those of series that have ended. Also the loosest tolerance of Radau where there are sharp forces: at
# 0.005 a step flies over the place where a body breaks loose, whose error is a hundred times that at 0.001.
SHARP_TOL = 1e-3

# HOP: length of a step over a place where a law is not analytic, over the shortest step (runs/tolerances.py, SHORTEST):
# forces are bounded there, so its error is rounding. Within HOP_APART lengths of the one before, such a step is
# twice as long; after MOST_HOPS of them the run ends: the motion comes to rest there.
HOP, MOST_HOPS, HOP_APART = 16.0, 8, 1e3

# --- stiffness -------------------------------------------------------------------------------------------------------
# rad, and part of the scene's size: after SMALL_STEPS successive steps in which no body rotates or moves by more, the
# motion may be stiff (docs/design-decisions.md).
SMALL, SMALL_STEPS = 0.02, 40
# Margin of analyticity of the force laws (law_check.py): where it is less, a law limits the step, not stiffness.
STILL = 0.9
# A step by less than STILL_STEP counts as FASTER steps.
STILL_STEP, FASTER = 0.002, 4
# The same in scenes with sharp forces, which need some ten short steps wherever a velocity reverses; steps by less than
# MINUTE count for AT_REST there: a reversal at a slip velocity of 1e-9 m/s takes 13, and rest any number.
SHARP_STEPS, MINUTE, AT_REST = 400, 1e-6, 8

# --- singular configurations -----------------------------------------------------------------------------------------
# Pivot of S over its diagonal entry. Below NEXT_TO_SINGULAR accelerations by elimination have lost eight digits, and
# those of the series are used. Below GONE a row is omitted from a projection, which would amplify position errors
# beyond the error of the series.
NEXT_TO_SINGULAR, GONE = 1e-8, 1e-10
# Where masses are so unequal that no pivot of a run is above 1 / UNEQUAL_MASSES, NEXT_TO_SINGULAR is relative to it.

# Indicator at the end of a step over that at its start, below which the step approaches a singular configuration; ends
# too close to continue; ends too close even beyond it. Measured on rows of parallelograms
# (tests/simulation/test_singularity_crossing.py).
CLOSER, CLOSE, PASSED = 0.3, 0.1, 0.02

# A step that ends there is shortened by AVOID, up to AVOIDING times: to 0.17 of its length.
AVOID, AVOIDING = 0.7, 5

# Factor of the tolerance between tries to cross a singular configuration; loosest tolerance of a crossing that starts
# far away, and of one that starts close, where lam has few digits, or that another method hands over; least order.
LOOSER, FAR_PASSING, PASSING, LEAST_ORDER = 2.0, 1e-13, 1e-10, 5

# Tolerance of a step that starts next to a singular configuration, over that of the run, and the least of it: rounding
# errors of lam grow there by the ratio of step length to distance.
TIGHTER, TIGHTEST = 0.01, 1e-16

# Indicator over its largest value in the run, below which the tolerance is reduced by the factor SPARE for the rest of
# the run, to compensate for digits lost there.
WARY, SPARE = 0.06, 0.1

# --- size ------------------------------------------------------------------------------------------------------------
# Bodies from which lam is refined once in every run: errors of a solution by elimination grow with their number.
MANY_BODIES = 100

# Orders of lam, from zero on, that are refined where S is ill-conditioned; all are where it takes two refinements.
ILL_ORDERS = 3

# Orders of all bodies, about a hundred bytes each, from which series exceed the near caches (3 MB).
FAR = 1 << 15


# Thresholds of lanes.

# Times that a step which has missed the manifold is halved before its case is left to be run alone.
HALVINGS = 4
