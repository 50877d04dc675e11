"""Taylor series of a prescribed motion at a time: one kernel interprets the programs of all motions.

A program starts with (t, instructions, offset of the constants, offset of the rows, rows, row of the result), followed
by four numbers an instruction: operation, row of the result, two operands (rows, or the offset of a constant). A row is
a series; [i] is its coefficient of (time - t)^i. `motions.Smooth.program` writes the programs. A piecewise motion finds
its piece from the time, unless a run holds the piece (`HOLD`, for the count of pieces).
"""

import numpy as np

from ..jit.kernels import ANY, callback, caller, data_of, kernel, matrix, vector
from ..maths.recurrences import exponential, power, product, quotient, sine_cosine, square
from .tables import HEAD as PIECES_HEAD

POLYNOMIAL, ADD, SUBTRACT, MULTIPLY, DIVIDE, POWER, SINE, EXP, LOG, TANH, ARCTAN, PIECEWISE, GATE = range(13)
HEAD, STEP, WIDTH = 6, 4, 36  # numbers before the instructions, numbers of an instruction, coefficients of a row
HOLD = 0  # as a count: stay with the pieces at t
SIGNATURE = "pdip"  # program, t, how many coefficients, where they go
# header of piecewise constants, see Pieces.numbers
COUNT, SIZE, PERIOD, BEYOND, PIECE, SHIFT, HELD = range(PIECES_HEAD)
call_smooth = caller(SIGNATURE)


@kernel
def _polynomial(c, n, t, k):
    """Coefficient k about t of c_0 + ... + c_{n-1} t^(n-1): sum_j binomial(j, k) c_j t^(j-k)."""
    if k >= n:
        return 0.0
    binomial, total = 1.0, 0.0
    for i in range(1, k + 1):
        binomial = binomial * (n - 1 - k + i) / i
    for j in range(n - 1, k - 1, -1):
        total = total * t + binomial * c[j]
        if j > 0:
            binomial = binomial * (j - k) / j
    return total


@kernel
def _slope_over(a, w, y, k):
    """Coefficient k >= 1 of y with y' w = a'."""
    total = k * a[k]
    for j in range(1, k):
        total -= j * y[j] * w[k - j]
    return total / (k * w[0])


@kernel
def _hyperbolic(a, y, w, k):
    """Coefficient k of y = tanh(a), y' = (1 - y^2) a'; w is the row of 1 - y^2, known below k."""
    if k == 0:
        return np.tanh(a[0])
    total = 0.0
    for j in range(1, k + 1):
        total += j * a[j] * w[k - j]
    return total / k


@kernel
def _find_piece(c, t):
    """Store the piece at t and the shift of its knots."""
    knots, low, high = c[PIECES_HEAD:], 0, int(c[COUNT])
    c[SHIFT] = np.floor((t - knots[0]) / c[PERIOD]) * c[PERIOD] if c[PERIOD] > 0.0 else 0.0
    x = t - c[SHIFT]
    while high - low > 1:
        middle = (low + high) // 2
        if x < knots[middle]:
            high = middle
        else:
            low = middle
    c[PIECE] = low


@kernel
def _piecewise(c, t, k):
    """Coefficient k about t of a piecewise polynomial; NaN outside its times."""
    count, size, knots = int(c[COUNT]), int(c[SIZE]), c[PIECES_HEAD:]
    if c[HELD] == 0.0 and k == 0:
        _find_piece(c, t)
    i = int(c[PIECE])
    if c[HELD] == 0.0 and c[BEYOND] == 0.0 and not (t >= knots[0] and t <= knots[count]):
        return np.nan
    return _polynomial(knots[count + 1 + i * size :], size, (t - c[SHIFT]) - knots[i], k)


@kernel
def _hold(p, t):
    """Hold the pieces at t for all following evaluations."""
    constants = int(p[2])
    for i in range(int(p[1])):
        at = HEAD + STEP * i
        if int(p[at]) == PIECEWISE:
            c = p[constants + int(p[at + 2]) :]
            _find_piece(c, t)
            c[HELD] = 1.0


@kernel
def _opens(a, k):
    """Whether a is positive, or becomes so at once: whether the first of its coefficients that is not zero is."""
    for j in range(k + 1):
        if a[j] != 0.0:
            return a[j] > 0.0
    return False


@kernel
def operate(p, at, constants, s, t, k):
    """Coefficient k of the operation that p has from `at` on; s are the rows."""
    what, y, a, b = int(p[at]), int(p[at + 1]), int(p[at + 2]), int(p[at + 3])
    if what == POLYNOMIAL:
        s[y, k] = _polynomial(p[constants + a :], b, t, k)
    elif what == PIECEWISE:
        s[y, k] = _piecewise(p[constants + a :], t, k)
    elif what == ADD:
        s[y, k] = s[a, k] + s[b, k]
    elif what == SUBTRACT:
        s[y, k] = s[a, k] - s[b, k]
    elif what == MULTIPLY:
        s[y, k] = product(s[a], s[b], k)
    elif what == DIVIDE:
        s[y, k] = quotient(s[a], s[b], s[y], k)
    elif what == POWER:
        s[y, k] = power(s[a], s[y], p[constants + b], k)
    elif what == SINE:
        s[y, k], s[y + 1, k] = sine_cosine(s[a], s[y], s[y + 1], k)
    elif what == EXP:
        s[y, k] = exponential(s[a], s[y], k)
    elif what == LOG:
        s[y, k] = np.log(s[a, 0]) if k == 0 else _slope_over(s[a], s[a], s[y], k)
    elif what == TANH:
        s[y, k] = _hyperbolic(s[a], s[y], s[y + 1], k)
        s[y + 1, k] = (1.0 if k == 0 else 0.0) - square(s[y], k)
    elif what == GATE:
        s[y, k] = s[b, k] if _opens(s[a], k) else 0.0
    else:
        s[y + 1, k] = (1.0 if k == 0 else 0.0) + square(s[a], k)
        s[y, k] = np.arctan(s[a, 0]) if k == 0 else _slope_over(s[a], s[y + 1], s[y], k)


@callback(SIGNATURE)
def run_program(program, t, count, out):
    """out (count,): the motion's series about t; t is left in the program's first place. HOLD writes nothing."""
    p, out = vector(program, ANY), vector(out, count)
    if count == HOLD:
        _hold(p, t)
        return 0
    p[0] = t
    constants, result = int(p[2]), int(p[5])
    s = matrix(data_of(p[int(p[3]) :]), int(p[4]), WIDTH)
    for i in range(int(p[1])):
        for k in range(count):
            operate(p, HEAD + STEP * i, constants, s, t, k)
    for k in range(count):
        out[k] = s[result, k]
    return 0
