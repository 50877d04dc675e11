"""Series of friction coefficients, and of normal loads in bearings and guides.

    mu(v) / v = (mu + (mu_s - mu) exp(-v^2 / v_s^2)) / sqrt(v^2 + v_0^2)                (1)
    N = N_0 + |F - n n.F| + w |n.G| + l |T - n n.T|     G: the force F, or the torque T  (2)

A part of N that is negligible at order zero has no series: its coefficients are rounding. Where it is not negligible
later, the series are not those of the law, and the step ends before (loops/law_check.py).
"""

from __future__ import annotations

from ..jit.kernels import kernel
from ..maths.recurrences import dot, exponential, inverse_root, product, root
from .tolerances import NEGLIGIBLE_LOAD

COEFFICIENT_ROWS, BEARING_ROWS = 5, 20
F, T, ALONG, TURN, F_ACROSS, T_ACROSS, SQUARES, ROOTS, PART, LOAD = 0, 3, 6, 7, 8, 11, 14, 16, 18, 19


@kernel
def coefficient_series(s, square, first, par, k):
    """Coefficient k of `coefficient`, Eq. (1); v^2 is in row `square` of s, COEFFICIENT_ROWS rows are its own."""
    s[first, k] = s[square, k] + (par[3] * par[3] if k == 0 else 0.0)
    s[first + 1, k] = inverse_root(s[first], s[first + 1], k)
    s[first + 2, k] = -s[square, k] / (par[2] * par[2])
    s[first + 3, k] = exponential(s[first + 2], s[first + 3], k)
    s[first + 4, k] = (par[1] - par[0]) * s[first + 3, k] + (par[0] if k == 0 else 0.0)
    return product(s[first + 4], s[first + 1], k)


@kernel
def magnitude(s, a, k, counts):
    """Coefficient k of |a|, a in a row of s; zero beyond order zero unless it counts."""
    if k == 0:
        return abs(s[a, 0])
    return 0.0 if not counts else (s[a, k] if s[a, 0] > 0.0 else -s[a, k])


@kernel
def _length(s, v, square, r, k, counts):
    """Write coefficient k of |v| into row r of s, v in rows v to v + 2."""
    s[square, k] = dot(s, v, v, k)
    s[r, k] = root(s[square], s[r], k) if k == 0 or counts else 0.0


@kernel
def _counts(s, r, weight, load, k):
    """Whether a part of N counts: the part of order zero is in row r, N in row `load`."""
    return k > 0 and weight * abs(s[r, 0]) > NEGLIGIBLE_LOAD * s[load, 0]


@kernel
def bearing_series(f, k, s, n, first, preload, turns, weight, tilt):  # nine: the rows, and the numbers of Eq. (2)
    """Coefficient k of N, Eq. (2), from that of the reaction f; n is in rows n to n + 2 of s.

    G is the torque where `turns`; BEARING_ROWS rows from `first` on are its own.
    """
    along, turn, load = first + ALONG, first + TURN, first + LOAD
    for i in range(3):
        s[first + F + i, k], s[first + T + i, k] = f[i], f[3 + i]
    s[along, k], s[turn, k] = dot(s, n, first + F, k), dot(s, n, first + T, k)
    for i in range(3):
        s[first + F_ACROSS + i, k] = f[i] - product(s[n + i], s[along], k)
        s[first + T_ACROSS + i, k] = f[3 + i] - product(s[n + i], s[turn], k)
    across, tilted, part, axial = first + ROOTS, first + ROOTS + 1, first + PART, turn if turns else along
    _length(s, first + F_ACROSS, first + SQUARES, across, k, _counts(s, across, 1.0, load, k))
    _length(s, first + T_ACROSS, first + SQUARES + 1, tilted, k, _counts(s, tilted, tilt, load, k))
    s[part, k] = magnitude(s, axial, k, _counts(s, axial, weight, load, k))
    s[load, k] = s[across, k] + weight * s[part, k] + tilt * s[tilted, k] + (preload if k == 0 else 0.0)
    return s[load, k]
