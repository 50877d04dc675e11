"""Thresholds of the drivers: step control, stops, charts, events, slices. Those of root isolation are in maths."""

from ..maths.tolerances import EPS

# --- times -----------------------------------------------------------------------------------------------------------
# Shortest step, relative to |t|: two units in the last place. Near t = 0 relative to FROM_ZERO of the interval.
SHORTEST, FROM_ZERO = 4e-16, 1e-3

# Part of a step by which the last one of a run may be longer than chosen, so that no tiny one is left: a thousandth
# changes its error by less than a hundredth at order 8. A step that is at max_step already (AT_LONGEST of it) may pass
# it by rounding only.
STRETCH, AT_LONGEST = 1e-3, 0.999

# Part of a fixed step: a stop nearer than this to a time of the grid replaces it, so that no step is left of the size
# of rounding.
SLIVER = 1e-6

# A step that a stop shortens to less than this part of its proposed length isn't used to predict the next one.
CUT_SHORT = 0.5

# Sampling instants of a run at most: 16 bytes each, 0.5 GB.
MOST_INSTANTS = 1 << 25

# --- step control ----------------------------------------------------------------------------------------------------
# Safety factor, and bounds on the ratio of a step to the one before: Hairer, Norsett, Wanner, Solving ODEs I, II.4.
SAFETY, SHRINK, GROW = 0.9, 0.2, 5.0

# Exponents of the PI control, times 1 / (order of the estimate + 1): Gustafsson's, as in Solving ODEs II, IV.2.
PI_ERROR, PI_BEFORE = 0.7, 0.4

# Loads along a step (step_control.py). DISTINCT: a difference over the time between samples, as a velocity over the
# tolerance: a bump at one sample makes 70 times its impulse. LEAST_PLACES: intervals of a step; differences of a
# cosine in a step of one radian are 1e-9 then, and with IMPLICIT_PLACES in one of three radians, as at order 13, 1e-8.
DISTINCT, LEAST_PLACES, IMPLICIT_PLACES = 100.0, 8, 16

# The power of a0 / a1 by which a step changes (step_control.py): at first SCALE, as if steps with the sum LEARNED of
# log(a0 / a1)^2 had shown it; at most STEEPEST. Sums fade by FADING a step. With LEARNED from 0.1 to 0.4 and FADING
# from 0.9 to 0.98, steps at equal error differ by 1 %. A ratio beyond JUMP is of forces that jump.
SCALE, STEEPEST, LEARNED, FADING, JUMP = 0.5, 1.0, 0.1, 0.95, 25.0

# Ratio of steps within which an implicit method goes on with the same step, and so with the same matrix: chains make
# 0.04 to 0.5 matrices a step, not 0.5 to 0.8, and as many steps. A longer one only, as in Solving ODEs II, IV.8, takes
# a tenth more steps.
SAME_FROM, SAME_TO = 0.9, 1.1

# Errors, over the tolerance, below which the next step is not made longer still; and that the control remembers.
LEAST_ERROR, LEAST_BEFORE = 1e-10, 1e-4

# Weight of the second estimate in Hairer's combination of two orders (DOP853: Solving ODEs I, II.10).
SECOND_ESTIMATE = 0.1

# First step (Solving ODEs I, II.4). If norms are below TOO_SMALL, the trial step is the part TRIAL of the run, at most
# FIRST_PART of it. The first step has the error FIRST_ERROR, where x' and x'' times the run's length exceed NO_SLOPE,
# and at most FIRST_GROWTH times the length of the trial.
TOO_SMALL, TRIAL, FIRST_ERROR, NO_SLOPE, FIRST_GROWTH, FIRST_PART = 1e-5, 1e-6, 0.01, 1e-15, 100.0, 0.1
# The first step is at least FIRST_LEAST of the run, and FIRST_SEEN times SHORTEST of the time: from rest, x'' over atol
# asks for less where rates are 1e15 / s. A step that is too long is rejected.
FIRST_LEAST, FIRST_SEEN = 1e-12, 4.0

# Factors of the step after a stage that was not solved, or a step whose end was not reached, and after a step that left
# a chart at once.
HALVED, QUARTERED = 0.5, 0.25

# Where friction brings a joint to rest: part of the time until then that a step takes (at 0.99 velocities predicted for
# stages have passed zero too often); part of a step in which the deceleration is measured; ratio of the powers at twice
# the velocity and at it, below which a joint slides: 2.05 at four slip velocities, 4 at rest.
LANDING, LITTLE, SLIDES = 0.9, 1e-3, 2.05

# A motion is stiff after STIFF_STEPS steps at the stability limit; MILD_STEPS steps below it reset the count
# (Solving ODEs II, IV.2: 15 and 6).
STIFF_STEPS, MILD_STEPS = 15, 6
# rad, and part of the scene's size: if no body rotates or moves by more for STILL_STEPS steps in a row, something that
# doesn't show in the motion limits the step, and the default method tries an implicit one. Rounding and chattering
# friction don't show as h |lambda|.
HARDLY, STILL_STEPS = 0.002, 40

# --- charts ----------------------------------------------------------------------------------------------------------
# |d| of all bodies, the sine of half the rotation since q0. A step that rotates bodies by less (11 degrees) is short;
# if it leaves the chart all the same, the chart is small.
HARDLY_TURNED = 0.1

# --- rotation limit of driven scenes ---------------------------------------------------------------------------------
# rad in a step, from speeds and accelerations at its start: a sine is sampled six times a turn.
MOST_TURN = 1.0
# rad, from the speeds at both ends, from which a step is rejected: short of half a turn, which reads as one backwards.
TURNED_TOO_FAR = 2.5
# Growth of the part of MOST_TURN that is tried, from step to step, after a chart has failed at all of it.
TURN_GAIN = 1.05

# --- events ----------------------------------------------------------------------------------------------------------
# rad, rotation of a body in a step: below the first, half the samples suffice; above the second, the most are taken.
SLOW_TURN, FAST_TURN = 0.1, 2.0
# rad: the same as SLOW_TURN and FAST_TURN for gaps, reactions and slips. They are analytic: an interpolant of degree 8
# of the cosine of a turn by 1 rad is in error by 1e-11, and one of degree 16 shows that more than 8 rad need another.
SLOW_SMOOTH_TURN, FAST_SMOOTH_TURN = 1.0, 8.0

# rad, times the degree: turns of more are shown to need another by an interpolant of that degree, as above.
SHOWN_TURN = 0.5

# A value or time below this fraction of the others counts as zero at the start of a run: rounding of some dozen
# operations of an event function. So does a gap of a contact, of the scene's length, at an event of another.
START_ZERO = 64.0 * EPS

# Relative perturbation of a state, with random signs, that measures the rounding error of an event function; safety
# factor on the largest of three changes.
SHAKEN, NOISE = 4.0 * EPS, 4.0

# Share of the time since the last zero of a function, before another one, at which its sign is that before the zero.
SHORTLY = 0.01
# Of the time: members of a group that vanish within that of an event do so with it. Roundings of an event's time.
SAME_INSTANT = 100.0 * EPS

# Values of a gap or reaction in the search of one step at most, each a factorisation: seconds. Only near singular
# states have interpolants of degree 32 on a thousandth of a step not sufficed.
MOST_OF_MEMBER = 1 << 15

# Of the time: how near to a zero Brent's method comes, as near as it can. s: the least distance there, a normal number.
# Of the largest value of a group: one at the start that is rounding of zero, as reactions are that the complementarity
# problem finds; and one at the end of the first step that no rounding makes.
FROM_REST, FALLEN = 1e-11, 1e-6
# Of h qdd: by how much the trapezoidal rule may miss the change of a velocity in a step that polynomials of degree five
# follow: (w h)^2 / 12 of an oscillation. Of the fastest coordinate: velocities that are rounding. Of the largest value
# of a function: values far from zero, where those polynomials are off by some hundredths of a motion at most.
SMOOTH, STEADY, DISTANT = 0.5, 1e-9, 0.05
# Part of a step that is searched by itself for a zero early on, and the most surveys of parts: where values touch zero
# they would shrink without end.
EARLY, MOST_SURVEYS = 0.25, 24
# Steps of Newton's method from the root of an interpolant; share of the step up to which a move that doesn't get
# shorter is rounding.
ROOT_STEPS, ROUGH_ROOT = 6, 1e-8
ROOT, LEAST_TIME = 4.0 * EPS, 2.0**-1022

# --- slices ----------------------------------------------------------------------------------------------------------
# s between returns to Python: progress bars and Ctrl-C answer at once, at a cost of 0.1 ms a slice.
SLICE_SECONDS = 0.1

# Coordinates, more where a step is not O(N), from which a step may take longer than that, so that Ctrl-C is answered
# within it: they take 5 ms (Nystrom4) to 60 ms (SDIRK54) a step, the thread of a slice 0.1 ms.
LONG_STEPS = 1 << 13

# Numbers that are set to zero at once, so that Ctrl-C is answered: new memory takes up to 1 ns a byte.
PIECE = 1 << 22

# Steps after which the progress of a run is judged first, as many as in a first slice; each judgement takes twice the
# steps of the one before, up to PACED_WORK over the weight of a step times as many as the first, a quarter of a second.
# A run that needs HOPELESS_STEPS more would take days.
PACED, PACED_WORK, HOPELESS_STEPS = 1024, 256, 1e10

# Functions are checked for noise, where progress is judged, if a run needs more steps than this at the present length.
NOISY = 1e6

# The run counts as progressing if simulated time per step has more than doubled since the last check.
GETTING_ON = 2.0

# Rejected Taylor steps for which the history of a slice has room, beyond one row for each of its steps.
TRIES = 32
