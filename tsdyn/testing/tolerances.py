"""Limits of the checks of plug-ins, as shares of the size of what is compared unless a unit is named."""

# Compiled values against the Python function, and derivatives by complex steps or truncated series: both round.
ROUNDED = 1e-11
# A real difference quotient with this step, of x of size 1, shows a phi that isn't analytic: its truncation is 1e-10.
REAL_STEP, NOT_ANALYTIC = 1e-5, 1e-4
# Central differences of sixth order: the seventh root of the rounding error is their best step, and what they leave.
SPACING, QUOTIENT = 4e-3, 1e-8
# Series: order up to which coefficients are compared, and the share of the motion's coefficients from order to order.
ORDER, SHRINK = 8, 0.5
# Reactions that the series of a normal load is tried with: next to a part's zero rounding grows.
DRAWN = 8

# Constraint errors of an integrator, in roundings: position, velocity, acceleration.
LEVELS = (50.0, 500.0, 5000.0)
# What the observed order may fall short: of steps, of dense output; from the third on, the fourth.
ORDER_TOLERANCE, DENSE_TOLERANCE, HIGH_ORDER, HIGH_TOLERANCE = 0.2, 0.5, 6, 0.75
# Steps: in each part of the grid at least, in a run at most, and their ratio from run to run. Where the order falls
# short there are more, up to FINEST, until fits to more and to fewer runs agree to SETTLED: leading terms of the errors
# of low orders show late.
FEWEST, MOST, RATIO, FINEST, SETTLED = 2, 6000, 2.0 ** (1.0 / 3.0), 100_000, 0.03
# Part of the span of a scene for methods of order one: a whole one takes them a million steps.
BRIEF = 0.125
# Sizes of step that an order is fitted to, at least and at most; errors that count: above rounding, below the coarsest.
POINTS, COARSEST, ROUNDING = (4, 7), 0.05, 2e-11
# Tolerances that are tried, from order four on and below; the error may be so many times as large.
BY_ORDER, FACTOR = {True: (1e-4, 1e-6, 1e-8), False: (1e-3, 1e-4, 1e-5)}, 100.0
# Tolerances of the runs that are repeated, that reject a step, and that are bounded.
REPEATED, REJECTED, BOUNDED = 1e-4, 1e-6, 1e-3
# Trace that a rejected step may leave in the next one: none but rounding; of implicit methods, this share of the
# tolerance of an iteration.
NO_TRACE, ITERATION_TRACE = 1e-12, 0.1
