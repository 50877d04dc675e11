"""Limits of prescribed motions and data, as shares of what is named."""

# Of the time: knots, stops and instants that are nearer to each other are one (some 50 roundings); of the run's length,
# the time that this is at least a share of.
TOGETHER, LEAST_SPAN = 1e-14, 1e-3

# Derivatives given as functions are compared with quotients over these shares of the run's length (at most 1 s each),
# four points each; of both sizes, an error that is no slip.
QUOTIENT_STEPS = (1e-2, 1e-3, 1e-4, 1e-5)
QUOTIENT_ERROR = 1e-3

# Noise that a function may have, relative to 1 + size: a traced function has the same values but for it, and a change
# by less, of the largest value, is none. Times (s) at which a function of time is compared.
SAME_VALUE = 1e-9
TIMES = (0.37, 1.3, 11.0)

# Of the range of a table's values, how far a cubic spline may leave two neighbouring values without a warning: where
# the values are monotone (a step of evenly spaced values: 0.13; a sine of seven values a period at its ends: 0.05), and
# where they have an extremum (a sine of four values a period: 0.21; four values of a hump, unevenly spaced: 0.37).
OVERSHOOT, EXTREMUM = 0.1, 0.5

# Samples of a function over a run, of which there are two or more in a pulse of a thousandth of the run; and strides at
# which they are compared, up to a 32nd of the run: steps are that long. Of a step, as many are sampled for noise as
# the longest stride.
SAMPLES, STRIDES = 2048, (1, 4, 16, 64)
# Ratio of a sixth difference of samples to those before it, above which there is a change: beside a double zero
# differences grow by 20 within nine samples, at a pulse on a sine of 26 samples a period by 1e5.
CLEAR_CHANGE = 100.0
# Degree up to which a polynomial of the state is seen by the stages of a step; x^40 is a wall.
PLAIN_DEGREE = 8
