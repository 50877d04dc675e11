"""Bracketing of zeros: times between which a function changes sign at most once, by Chebyshev interpolation."""

import math
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from ..jit.kernels import data_of, entry, kernel, matrix
from . import tolerances as limits
from .tolerances import CLEAR, EPS, MOST_BISECTIONS, TIGHT, UNDERFLOWING

# Chebyshev interpolation on [-1, 1]; tables are made once for each degree.

FINE = 4  # cells of the fine grid between two nodes
CHECK = -float(np.cos(0.3 * np.pi))  # far from the nodes of every degree that is a power of two


class ChebyshevTable(NamedTuple):
    """The interpolant of degree N, a power of two, through samples at N + 1 nodes; one more sample checks it."""

    nodes: np.ndarray  # (N + 1,)  Chebyshev points of the second kind, increasing; those of N / 2 are every other one
    points: np.ndarray  # (N + 2,)  nodes and CHECK
    at_nodes: np.ndarray  # (N + 1,)  which of them are nodes
    known: np.ndarray  # (N / 2 + 2,)  which of them are points of N / 2
    fresh: np.ndarray  # (N / 2,)  which are not
    middle: int  # which is 0
    fine: np.ndarray  # (FINE N + 1,)  grid of which the nodes are every FINE-th point
    coefficients: np.ndarray  # (N + 1, N + 1)  samples at nodes -> Chebyshev coefficients
    widened: np.ndarray  # (N + 1, N + 2)  the same of samples at points
    values: np.ndarray  # (FINE N + 1, N + 2)  samples at points -> values on the fine grid
    errors: np.ndarray  # (N / 2 + 1, N + 2)  samples at points -> error at CHECK, and the higher coefficients


@cache
def table(N):
    """The `ChebyshevTable` of degree N."""
    nodes, fine = (-np.cos(np.pi / k * np.arange(k + 1)) for k in (N, FINE * N))
    nodes[N // 2] = fine[FINE * N // 2] = 0.0
    coefficients = 2.0 / N * chebyshev.chebvander(nodes, N).T
    coefficients[:, [0, -1]] *= 0.5
    coefficients[[0, -1]] *= 0.5
    check = int(np.searchsorted(nodes, CHECK))
    points, widened = np.insert(nodes, check, CHECK), np.insert(coefficients, check, 0.0, axis=1)
    known = np.searchsorted(points, np.append(nodes[::2], CHECK))
    known.sort()
    missed = chebyshev.chebvander(CHECK, N).ravel() @ widened
    missed[check] = -1.0
    return ChebyshevTable(
        nodes,
        points,
        np.delete(np.arange(N + 2), check),
        known,
        np.setdiff1d(np.arange(N + 2), known),
        int(np.searchsorted(points, 0.0)),
        fine,
        coefficients,
        widened,
        chebyshev.chebvander(fine, N) @ widened,
        np.concatenate((missed[None], widened[N // 2 + 1 :])),
    )


def extremes(coefficients):
    """Real zeros (k,) of the derivative of a Chebyshev series, increasing."""
    slope = np.trim_zeros(chebyshev.chebder(coefficients), "b")
    if slope.size < 2:
        return np.empty(0)
    roots = chebyshev.chebroots(slope)
    return np.sort(roots.real[np.abs(roots.imag) < limits.REAL])


# Bracketing of zeros: times between which a function changes sign at most once.
#
# The function is sampled at Chebyshev points. Once an interpolant of degree 4, 8, 16 or 32 resolves the function, its
# extrema near zero are sampled too, so that pairs of close zeros are found; otherwise the interval is halved. A
# function that stays unresolved on ever shorter intervals has a kink or a jump, judged by the signs of the samples.

LARGEST = 32  # degree
CALM = 12  # consecutive halvings that leave one half resolved: the other has a kink or a jump
POLISH = 16  # degree of the interpolant for an extremum
MOST = 1 << 20  # samples of one search


class TooFast(Exception):
    """A function has too many extrema to be followed."""


class Fit(NamedTuple):
    """Samples of a function at the points of a `ChebyshevTable` on [a, b], and the interpolant through them."""

    a: float
    b: float
    degree: int
    times: np.ndarray  # (N + 2,)
    samples: np.ndarray  # (N + 2,)
    fine: np.ndarray  # (FINE N + 1,)  the interpolant on the fine grid
    off: float  # its error
    clear: float  # distance from zero; 0 if it changes sign
    scale: float  # the largest sample
    resolved: bool


def _points(degree, a, b):
    times = a + 0.5 * (b - a) * (table(degree).points + 1.0)
    times[-1] = b
    return times


def _refined(degree, a, b, samples, sample):
    """Times of a degree, and samples (degree + 2, ...) of which those of half the degree are known."""
    grid, times, finer = table(degree), _points(degree, a, b), np.empty((degree + 2, *samples.shape[1:]))
    finer[grid.known], finer[grid.fresh] = samples, sample(times[grid.fresh])
    return times, finer


LOWEST = 2  # degree, of kernels


class KernelTable(NamedTuple):
    """What kernels take of a `ChebyshevTable`."""

    values: np.ndarray
    errors: np.ndarray
    widened: np.ndarray
    fine: np.ndarray
    points: np.ndarray


@cache
def kernel_tables():
    """The numbers of the `KernelTable` of every degree that is a power of two, from LOWEST to LARGEST."""
    degrees = [LOWEST << i for i in range((LARGEST // LOWEST).bit_length())]
    parts = [getattr(table(N), name) for N in degrees for name in KernelTable._fields]
    return np.concatenate([part.ravel() for part in parts])


@kernel
def kernel_table(numbers, N):
    """The `KernelTable` of degree N."""
    at, n = 0, LOWEST
    while n < N:
        at += (n + 2) * (FINE * n + 1 + n // 2 + 1 + n + 1 + 1) + FINE * n + 1
        n *= 2
    fine, width = FINE * N + 1, N + 2
    values = matrix(data_of(numbers[at:]), fine, width)
    at += fine * width
    errors = matrix(data_of(numbers[at:]), N // 2 + 1, width)
    at += (N // 2 + 1) * width
    widened = matrix(data_of(numbers[at:]), N + 1, width)
    at += (N + 1) * width
    return KernelTable(values, errors, widened, numbers[at : at + fine], numbers[at + fine : at + fine + width])


# Several functions at once: most have no zero on an interval, and need no search.
#
# A function is clear of zero at a point of the fine grid if its value exceeds a quarter of the second difference there,
# more than it bends between points (an eighth), and the error of the interpolant. It falls between two points that
# differ by more than half of the second difference, by which its slope varies there.


@kernel
def _bend(fine, k):
    i = min(max(k, 1), fine.size - 2)
    return 0.25 * abs(fine[i + 1] - 2.0 * fine[i] + fine[i - 1])


@kernel
def _look_at(values, errors, samples, j, noise, fine):
    """The fine values of function j, and the margin by which others exceed zero; inf if unresolved, NaN of NaN."""
    n, last = samples.shape[0], errors.shape[0] - 2
    scale, least, most, off, high, total = 0.0, math.inf, -math.inf, 0.0, 0.0, 0.0
    for i in range(n):
        scale = max(scale, abs(samples[i, j]))
    for e in range(errors.shape[0]):
        x = 0.0
        for i in range(n):
            x += errors[e, i] * samples[i, j]
        total += abs(x)
        if e == 0:
            off = abs(x)
        if e >= last:
            high = max(high, abs(x))
    for k in range(fine.size):
        x = 0.0
        for i in range(n):
            x += values[k, i] * samples[i, j]
        fine[k] = x
        least, most = min(least, x), max(most, x)
    if total != total:
        return total
    off += high
    resolved = off <= max(TIGHT * scale, noise) or CLEAR * total <= max(least, -most)
    return max(CLEAR * off, noise) if resolved and scale >= UNDERFLOWING else math.inf


@kernel
def look(values, errors, series, grid, samples, noise, a, b, scratch, out):  # ten: a table, and what is looked at
    """out (m, 4): since, until, roots and slopes of a `Survey` on [a, b]; scratch (2, points of the grid).

    Return 1 if all are resolved, 0 if not, -1 where one is no number.
    """
    found, fine, c = 1, scratch[0], scratch[1, : series.shape[0]]
    for j in range(samples.shape[1]):
        margin = _look_at(values, errors, samples, j, noise[j], fine)
        out[j, 0], out[j, 1] = -1.0, math.nan
        if not margin < math.inf:
            found = min(found, 0 if margin == math.inf else -1)
            continue
        sign, k = math.copysign(1.0, samples[0, j]), 0
        while k < fine.size and sign * fine[k] > _bend(fine, k) + margin:
            k += 1
        if k == fine.size:
            out[j, 0] = math.inf
            continue
        out[j, 0] = grid[max(k - 1, 0)]
        # It falls from point to point
        while 0 < k < fine.size and sign * (fine[k - 1] - fine[k]) > 2.0 * max(_bend(fine, k - 1), _bend(fine, k)):
            if sign * fine[k] < -_bend(fine, k) - margin:
                out[j, 1] = grid[k]
                break
            k += 1
        if out[j, 1] > out[j, 0]:
            for n in range(c.size):
                c[n] = 0.0
                for i in range(samples.shape[0]):
                    c[n] += series[n, i] * samples[i, j]
            out[j, 2], out[j, 3] = _cross(c, out[j, 0], out[j, 1])
    # Times within [a, b], slopes by them
    half = 0.5 * (b - a)
    for j in range(samples.shape[1]):
        for i in range(3):
            out[j, i] = a + half * (out[j, i] + 1.0)
        out[j, 3] /= half
    return found


@entry("mmmvmvddmm")
def _look(values, errors, series, grid, samples, noise, a, b, scratch, out):  # ten: as of `look`
    """As `look`."""
    return look(values, errors, series, grid, samples, noise, a, b, scratch, out)


@kernel
def _cross(c, x0, x1):
    """Where a Chebyshev series, of other signs at x0 and x1, is zero; its slope there."""
    rises, x, slope = 0.0, 0.5 * (x0 + x1), 0.0
    for sweep in range(MOST_BISECTIONS):
        # The series by T, its derivative by U
        value, slope, T, before, U, under = c[0], 0.0, x, 1.0, 1.0, 0.0
        for n in range(1, c.size):
            value += c[n] * T
            slope += n * c[n] * U
            T, before = 2.0 * x * T - before, T
            U, under = 2.0 * x * U - under, U
        if sweep == 0:
            rises = math.copysign(1.0, slope)
        if rises * value < 0.0:
            x0 = x
        else:
            x1 = x
        # Newton's method; bisection where that leaves the bracket
        to = x - value / slope if slope != 0.0 else x0
        if abs(to - x) <= 2.0 * EPS:
            break
        x = to if x0 < to < x1 else 0.5 * (x0 + x1)
    return x, slope


SURVEYING = (_look,)


class Survey(NamedTuple):
    """Several functions on one interval."""

    a: float
    b: float
    degree: int  # of interpolants that resolve them
    samples: np.ndarray  # (N + 2, m)
    since: list  # times up to which functions are clear of zero; inf of those that are so all along
    until: list  # by when functions have crossed zero, once; NaN where that is unclear
    roots: list  # where their interpolants do
    slopes: list  # of the interpolants there

    def root(self, j):
        """Where the interpolant of function j crosses zero, between its `since` and `until`; its slope there."""
        return self.roots[j], self.slopes[j]


def survey(sample, a, first, b, degree, noise):
    """Look at several functions at once, on [a, b].

    Parameters
    ----------
    sample : function
        Values (k, m) at increasing times (k,).
    a, b : float
    first : ndarray (m,)
        Values at a.
    degree : int
        Of the first interpolants.
    noise : ndarray (m,)
        Known rounding errors.

    Returns
    -------
    Survey
    """
    samples = np.empty((degree + 2, first.size))  # in the order that the kernel is compiled for
    samples[0], samples[1:] = first, sample(_points(degree, a, b)[1:])
    while True:
        grid, out = table(degree), np.zeros((first.size, 4))
        scratch = np.empty((2, grid.fine.size))
        known = grid.values, grid.errors, grid.widened, grid.fine
        if _look(*known, samples, noise, a, b, scratch, out) != 0 or degree == LARGEST:
            break
        degree *= 2
        _, samples = _refined(degree, a, b, samples, sample)
    return Survey(a, b, degree, samples, *out.T.tolist())


class Search:
    """A search.

    Parameters
    ----------
    sample : function
        Values (k,) at increasing times (k,); NaN where there is none.
    shaken : function
        Error of the value at a time that rounding of the state causes.
    noise : float
        Rounding error of the values, as measured before: measured again where values are no larger and rounding of the
        state makes less, since it may have been that of larger values.
    most : int, optional
        Samples at most; MOST by default.
    least : float
        Rounding error that values have for sure.

    Attributes
    ----------
    points : list of (float, float)
        Times, increasing, and values; zero for a value that touches zero within rounding. The start alone where all
        values are noise.
    spent : int
        Samples taken.
    """

    def __init__(self, sample, shaken, noise=0.0, most=None, least=0.0):
        self.sample, self.shaken, self.noise, self.most, self.least = sample, shaken, noise, most or MOST, least
        self.points, self.spent, self._shortest, self._unit = [], 0, 0.0, 1.0

    def run(self, a, value, b, degree):
        """Search [a, b], the value at a being known, with interpolants of this degree at first.

        Return the degree needed and the value at b. Raises TooFast.
        """
        self._shortest = max(limits.DEEPEST * (b - a), limits.SHORTEST_INTERVAL * max(abs(a), abs(b)))
        self._measure_by(limits.SAFE)
        whole = self._fit(a, b, limits.SAFE * value, None, degree)
        if whole.scale < limits.UNDERFLOWING:
            exponent = (
                -math.frexp(whole.scale)[1] if whole.scale else limits.MOST_SCALED
            )  # denormal numbers times SAFE are 0
            self._measure_by(math.ldexp(limits.SAFE, min(exponent, limits.MOST_SCALED)))
            whole = self._fit(a, b, self._unit * value, None, degree)
        self.points.append((a, self._unit * value))
        least, middle = self._unit * self.least, 0.5 * (a + b)
        if max(least, whole.clear) < self.noise and self._unit * self.shaken(middle) < limits.STALE * self.noise:
            self.noise = least
            whole = self._fit(a, b, self._unit * value, None, whole.degree)
        if not (whole.resolved or whole.off != whole.off):
            self.noise = max(self._rounding(whole), self._unit * self.shaken(middle), least)
            whole = whole._replace(resolved=whole.off <= self.noise)
        self._follow(whole, 0)
        last = self.points[-1][1] if self.points[-1][0] == b else float(whole.samples[-1])
        last, self.points = last / self._unit, [(t, value / self._unit) for t, value in self.points]
        self._measure_by(1.0)
        return whole.degree, last

    def _measure_by(self, unit):
        """Take values times a power of two from now on: no sum of them leaves the range of numbers."""
        self.noise, self._unit = self.noise * unit / self._unit, unit

    def _values(self, times):
        self.spent += times.size
        if self.spent > self.most:
            raise TooFast
        return self._unit * self.sample(times)

    def _fit(self, a, b, first, last, degree):
        """Return the `Fit` of the degree that resolves the function on [a, b], or of the highest worth trying."""
        times, samples = _points(degree, a, b), np.empty(degree + 2)
        samples[0] = first
        if last is None:
            samples[1:] = self._values(times[1:])
        else:
            samples[1:-1], samples[-1] = self._values(times[1:-1]), last
        while True:
            fit = self._judged(a, b, degree, times, samples)
            hopeless = degree == LARGEST or (degree == LARGEST // 2 and fit.off > limits.UNRESOLVED * fit.scale)
            if fit.resolved or hopeless or fit.off != fit.off:
                return fit
            degree *= 2
            times, samples = _refined(degree, a, b, samples, self._values)

    def _judged(self, a, b, degree, times, samples):
        grid = table(degree)
        fine, errors = grid.values @ samples, np.abs(grid.errors @ samples)
        scale, off = float(np.abs(samples).max()), float(errors[0] + max(errors[-2], errors[-1]))
        clear = max(float(fine.min()), -float(fine.max()), 0.0)
        resolved = off <= max(limits.TIGHT * scale, self.noise) or limits.CLEAR * float(errors.sum()) <= clear
        return Fit(a, b, degree, times, samples, fine, off, clear, scale, resolved)

    def _rounding(self, fit):
        """Return the rounding error of the values: high coefficients where a smooth function has none."""
        t, least = fit.a + 0.382 * (fit.b - fit.a), limits.SHORTEST_INTERVAL * max(abs(fit.a), abs(fit.b))
        half, found = max(limits.ROUGH_SHARE * (fit.b - fit.a), least), np.inf
        while half < limits.WIDEST_NOISE * (fit.b - fit.a):
            rough = table(8).coefficients[5:] @ self._values(t + half * table(8).nodes)
            found = min(found, 10.0 * float(np.abs(rough).max()))
            if found <= limits.NEGLIGIBLE * fit.scale or half == least:
                break
            half = max(limits.NOISE_RATIO * half, least)
        return found if found < np.inf else 0.0

    def _follow(self, fit, calm):
        """Collect the points of a fit or of its halves; calm: consecutive halvings that left one half resolved."""
        # Rounding may be larger here than in the middle of the search
        if fit.resolved or fit.off <= self._unit * self.shaken(0.5 * (fit.a + fit.b)):
            self._take(fit)
        elif calm == CALM or fit.off != fit.off or fit.b - fit.a <= self._shortest:
            self._take_rough(fit)
        else:
            middle = table(fit.degree).middle
            t, value = fit.times[middle], fit.samples[middle]
            left = self._fit(fit.a, t, fit.samples[0], value, 8)
            right = self._fit(t, fit.b, value, fit.samples[-1], 8)
            calm = calm + 1 if left.resolved != right.resolved else 0
            self._follow(left, calm)
            self._follow(right, calm)

    def _take(self, fit):
        """Collect the samples, and extrema near or beyond zero between them."""
        if fit.scale <= self.noise:
            return
        found = dict(zip(fit.times.tolist(), fit.samples.tolist(), strict=True))
        if fit.clear <= limits.NEAR_ZERO * fit.scale:
            grid = fit.a + 0.5 * (fit.b - fit.a) * (table(fit.degree).fine + 1.0)
            grid[-1] = fit.b
            for i, j in self._spans(fit):
                found.update(self._polish(float(grid[i]), float(grid[j])))
        self._append(found)

    @staticmethod
    def _spans(fit):
        """Yield intervals of the fine grid in which extrema are located."""
        fine, last = fit.fine.copy(), fit.fine.size - 1
        fine[::FINE] = fit.samples[table(fit.degree).at_nodes]
        size, sign = np.abs(fine), np.sign(fine)
        least = (size[1:-1] <= np.minimum(size[:-2], size[2:])) & (sign[:-2] == sign[2:])
        yield from ((i, i + 2) for i in np.flatnonzero(least & (size[1:-1] <= limits.NEAR_ZERO * fit.scale)).tolist())
        runs = (np.flatnonzero(sign[1:] != sign[:-1]) + 1).tolist()
        yield from ((i - 1, j) for i, j in pairwise(runs) if -(-i // FINE) * FINE >= j)  # without a node
        yield from ((i, i + 1) for i, end in ((0, 0), (last - 1, last)) if size[end] <= limits.AT_ZERO * fit.scale)

    def _polish(self, a, b):
        """Return extrema between a and b, and an end that touches zero: values by time."""
        times = a + 0.5 * (b - a) * (table(POLISH).nodes + 1.0)
        times[-1] = b
        samples = self._values(times)
        series = table(POLISH).coefficients @ samples
        if not np.isfinite(series).all():
            return {}
        noise = max(8.0 * float(np.abs(series[-5:]).max()) + limits.EPS * float(np.abs(samples).max()), self.noise)
        inner, ulps = a + 0.5 * (b - a) * (extremes(series) + 1.0), 8.0 * limits.EPS * max(abs(a), abs(b))
        inner = np.unique(np.clip(inner[(inner >= a - ulps) & (inner <= b + ulps)], a, b))
        values = self._values(inner)
        touch = np.abs(values) <= noise
        found = dict(zip(inner.tolist(), np.where(touch, 0.0, values).tolist(), strict=True))
        if touch.any():
            found |= {t: 0.0 for t, value in ((a, samples[0]), (b, samples[-1])) if abs(value) <= noise}
        return found

    def _take_rough(self, fit):
        """Collect the samples, and minima between samples of the same sign."""
        good = ~np.isnan(fit.samples)
        times, samples = fit.times[good], fit.samples[good]
        found = dict(zip(times.tolist(), samples.tolist(), strict=True))
        size, sign = np.abs(samples), np.sign(samples)
        least = (size[1:-1] < np.minimum(size[:-2], size[2:])) & (sign[:-2] == sign[1:-1]) & (sign[1:-1] == sign[2:])
        for i in np.flatnonzero(least).tolist():
            found.update(self._least(times[i], times[i + 2], sign[i], min(size[i], size[i + 2])))
        self._append(found)

    def _least(self, a, b, sign, scale):
        """Return the minimum of sign times the function between a and b; AT_ZERO counts as zero."""
        from scipy.optimize import minimize_scalar  # slow to import

        value = lambda s: sign * self._values(np.array([a + s]))[0]  # noqa: E731
        found = minimize_scalar(
            value, bounds=(0.0, b - a), method="bounded", options={"xatol": limits.EXTREME * (b - a)}
        )
        if not abs(found.fun) < np.inf:
            return {}
        return {a + float(found.x): 0.0 if abs(found.fun) <= limits.AT_ZERO * scale else sign * float(found.fun)}

    def _append(self, found):
        """Add values by time; the first may be known already."""
        if self.points and self.points[-1][0] in found:
            t, value = self.points.pop()
            found[t] = value if value == 0.0 else found[t]
        self.points += sorted(found.items())
