"""The recurrences against polynomial arithmetic and closed forms, and truncated series against the same."""

from math import comb, factorial

import numpy as np
import pytest

from tests.helpers.scenes import rotation as matrix_of
from tests.helpers.tolerances import EPS
from tsdyn.jit.kernels import twin
from tsdyn.maths import recurrences as R
from tsdyn.maths.power_series import Truncated

K = 12


def rows(rng, n, positive=()):
    """Series that converge for |t| < 2."""
    s = np.zeros((n, K))
    s[:] = rng.normal(size=(n, K)) * 0.5 ** np.arange(K)
    for i in positive:
        s[i, 0] = rng.uniform(0.7, 1.5)
    return s


def convolve(a, b):
    return np.convolve(a, b)[:K]


def close(got, expected):
    """To rounding of the sums, which are no larger than the largest coefficient times a few hundred."""
    np.testing.assert_allclose(got, expected, rtol=0, atol=400 * EPS * max(1.0, np.abs(expected).max()))


def column(f, *arguments):
    """All coefficients of a recurrence that needs none of its own."""
    return np.array([f(*arguments, k) for k in range(K)])


def run(f, *rows):
    """All coefficients of a recurrence that goes on from its own row."""
    own = np.full(K, np.nan)
    for k in range(K):
        own[k] = f(*rows, own, k)
    return own


PLAIN = {name: twin(getattr(R, name)) for name in vars(R) if hasattr(getattr(R, name), "py_func")}


def test_products(rng):
    s = rows(rng, 7)
    close(column(PLAIN["product"], s[0], s[1]), convolve(s[0], s[1]))
    close(column(PLAIN["square"], s[0]), convolve(s[0], s[0]))
    close(column(PLAIN["dot"], s, 0, 3), sum(convolve(s[i], s[3 + i]) for i in range(3)))
    close(column(PLAIN["scaled"], s, 1, 5), np.transpose([convolve(s[i], s[5]) for i in (1, 2, 3)]))
    x = [[1, 2], [2, 0], [0, 1]]
    expected = [convolve(s[i], s[3 + j]) - convolve(s[j], s[3 + i]) for i, j in x]
    close(column(PLAIN["cross"], s, 0, 3), np.transpose(expected))


def test_rotation(rng):
    """A(p) of a polynomial p is a polynomial of twice the degree: found through its values."""
    s = np.zeros((16, K))
    s[:4, :5], s[13:, :3] = rng.normal(size=(4, 5)), rng.normal(size=(3, 3))
    for k in range(K):
        PLAIN["rotation"](s, 0, 4, k)
    for t in (-0.9, 0.3, 1.1):
        powers = t ** np.arange(K)
        A = matrix_of(s[:4] @ powers)
        close(s[4:13] @ powers, A.T.ravel())
        for name, M in (("rotated", A), ("rotated_back", A.T)):
            close(column(PLAIN[name], s, 4, 13).T @ powers, M @ (s[13:] @ powers))


def test_quotient_and_powers_undo_products(rng):
    s = rows(rng, 3, positive=(0, 1))
    close(convolve(run(PLAIN["quotient"], s[2], s[0]), s[0]), s[2])
    root = run(PLAIN["root"], s[0])
    close(convolve(root, root), s[0])
    inverse = run(PLAIN["inverse_root"], s[0])
    close(convolve(convolve(inverse, inverse), s[0]), np.eye(K)[0])
    cube, one = convolve(convolve(s[0], s[0]), s[0]), np.eye(K)[0]
    powers = {n: np.full(K, np.nan) for n in (3.0, -2.0, 1 / 3, -1.5)}
    for n, row in powers.items():
        for k in range(K):
            row[k] = PLAIN["power"](s[0], row, n, k)
    close(powers[3.0], cube)
    close(convolve(convolve(powers[-2.0], s[0]), s[0]), one)
    third = powers[1 / 3]
    close(convolve(convolve(third, third), third), s[0])
    close(convolve(convolve(powers[-1.5], powers[-1.5]), cube), one)


def test_closed_forms():
    """Of 1 + t, of t and of 0.3 + 2 t."""
    line = np.zeros(K)
    line[:2] = 1.0
    binomial = [np.prod([0.5 - i for i in range(n)]) / factorial(n) for n in range(K)]
    close(run(PLAIN["root"], line), binomial)
    close(run(PLAIN["inverse_root"], line), [(-0.25) ** n * comb(2 * n, n) for n in range(K)])
    ramp = np.zeros(K)
    ramp[:2] = 0.3, 2.0
    growth = np.array([2.0**n / factorial(n) for n in range(K)])
    close(run(PLAIN["exponential"], ramp), np.exp(0.3) * growth)
    s, c = np.zeros((2, K))
    for k in range(K):
        s[k], c[k] = PLAIN["sine_cosine"](ramp, s, c, k)
    close(s, [np.sin(0.3 + n * np.pi / 2) * growth[n] for n in range(K)])
    close(c, [np.cos(0.3 + n * np.pi / 2) * growth[n] for n in range(K)])


@pytest.mark.parametrize("start", [0.4, 2.5, -3.0])
def test_angle_undoes_sine_and_cosine(rng, start):
    a, length = rows(rng, 2, positive=(1,))
    a[0] = start
    s, c = np.zeros((2, K))
    for k in range(K):
        s[k], c[k] = PLAIN["sine_cosine"](a, s, c, k)
    y, x = convolve(length, s), convolve(length, c)
    theta, square = np.full(K, np.nan), convolve(x, x) + convolve(y, y)
    for k in range(K):
        theta[k] = PLAIN["angle"](y, x, square, theta, k)
    close(theta, a)


@pytest.mark.parametrize(
    "name", ["sin", "cos", "tan", "sqrt", "exp", "log", "sinh", "cosh", "tanh", "arctan", "square"]
)
def test_truncated_series_are_those_of_the_functions(name, rng):
    """Against Cauchy's integral over a circle on which the argument is nearly constant."""
    a = rows(rng, 1, positive=(0,))[0] * 0.5 ** np.arange(K)
    f, radius, n = getattr(np, name), 0.25, 128
    t = radius * np.exp(2j * np.pi * np.arange(n) / n)
    values = f(sum(a[k] * t**k for k in range(K)))
    expected = np.fft.fft(values)[:K].real / n
    got = f(Truncated(a)).c * radius ** np.arange(K)
    np.testing.assert_allclose(got, expected, rtol=0, atol=200 * EPS * np.abs(values).max())


def test_truncated_arithmetic(rng):
    a, b = (Truncated(row) for row in rows(rng, 2, positive=(0, 1)))
    close((a / b * b).c, a.c)
    close((2.0 / a * a - 2.0).c, np.zeros(K))
    close((a**3 - a * a * a).c, np.zeros(K))
    close((a**-1.5 * a**1.5).c, np.eye(K)[0])
    close((np.float64(2.0) - a + np.float64(3.0) * a).c, (2.0 * a + 2.0).c)
    close(np.arctan2(a * np.sin(b), a * np.cos(b)).c, b.c)
    close(a.rate.integral(a.c[0]).c, a.c)
    with pytest.raises(TypeError, match="no Taylor series"):
        np.arccos(a)
    with pytest.raises(TypeError):
        bool(a > b)
