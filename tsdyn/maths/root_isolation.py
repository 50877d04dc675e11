"""Bracketing of zeros: times between which a function changes sign at most once, by Chebyshev interpolation."""

import math
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from .tolerances import (
    AT_ZERO,
    CLEAR,
    DEEPEST,
    EPS,
    EXTREME,
    MOST_SCALED,
    NEAR_ZERO,
    NEGLIGIBLE,
    NOISE_RATIO,
    REAL,
    ROUGH_SHARE,
    SAFE,
    SHORTEST_INTERVAL,
    TIGHT,
    UNDERFLOWING,
    UNRESOLVED,
    WIDEST_NOISE,
)

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
        chebyshev.chebvander(fine, N) @ widened,
        np.concatenate((missed[None], widened[N // 2 + 1 :])),
    )


def extremes(coefficients):
    """Real zeros (k,) of the derivative of a Chebyshev series, increasing."""
    slope = np.trim_zeros(chebyshev.chebder(coefficients), "b")
    if slope.size < 2:
        return np.empty(0)
    roots = chebyshev.chebroots(slope)
    return np.sort(roots.real[np.abs(roots.imag) < REAL])


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


def _judged(degree, samples, noise):
    """What a `Fit` says of samples (degree + 2, ...): fine, off, clear, scale, resolved."""
    grid = table(degree)
    fine, errors = grid.values @ samples, np.abs(grid.errors @ samples)
    scale, off = np.abs(samples).max(axis=0), errors[0] + np.maximum(errors[-2], errors[-1])
    clear = np.maximum(np.maximum(fine.min(axis=0), -fine.max(axis=0)), 0.0)
    resolved = (off <= np.maximum(TIGHT * scale, noise)) | (CLEAR * errors.sum(axis=0) <= clear)
    return fine, off, clear, scale, resolved


class Survey(NamedTuple):
    """Several functions on one interval, by interpolants: which have no zero, and where others cross zero first."""

    calm: np.ndarray  # (m,)  bool: clear of zero
    since: np.ndarray  # (m,)  times up to which functions are clear; inf for calm ones
    until: np.ndarray  # (m,)  by when those have the other sign that cross zero once from `since` on; else NaN
    last: np.ndarray  # (m,)  values at the end
    degree: int  # that resolves the functions


def survey(sample, a, first, b, degree, noise):
    """Look at several functions at once: most have no zero between a and b, and need no search.

    A function is clear of zero at a point of the fine grid if its value exceeds the second difference there, by which
    the function may bend between the points, and the errors.

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
    samples = np.concatenate((first[None], sample(_points(degree, a, b)[1:])))
    while True:
        fine, off, _, scale, resolved = _judged(degree, samples, noise)
        if degree == LARGEST or resolved.all() or np.isnan(off).any():
            break
        degree *= 2
        _, samples = _refined(degree, a, b, samples, sample)
    grid, sign = a + 0.5 * (b - a) * (table(degree).fine + 1.0), np.sign(first)
    height, bend = sign * fine, np.empty_like(fine)
    np.abs(fine[2:] - 2.0 * fine[1:-1] + fine[:-2], out=bend[1:-1])
    bend[0], bend[-1] = bend[1], bend[-2]
    bend += np.maximum(CLEAR * off, noise)
    usable = resolved & (scale >= UNDERFLOWING)
    clear, beyond = (height > bend) & usable, (height < -bend) & usable
    calm, columns = clear.all(axis=0), np.arange(first.size)
    doubt = clear.argmin(axis=0)
    before = np.maximum(doubt - 1, 0)
    later = np.arange(len(fine))[:, None] >= doubt
    across = (beyond & later).argmax(axis=0)
    within = later[1:] & (np.arange(1, len(fine))[:, None] <= across)
    falls = ((np.diff(height, axis=0) < 0.0) | ~within).all(axis=0)
    once = (doubt > 0) & beyond[across, columns] & falls
    since = np.where(calm, np.inf, grid[before])
    return Survey(calm, since, np.where(once & ~calm, grid[across], np.nan), samples[-1], degree)


class Search:
    """A search.

    Parameters
    ----------
    sample : function
        Values (k,) at increasing times (k,); NaN where there is none.
    shaken : function
        Error of the value at a time that rounding of the state causes.
    noise : float
        Known rounding error of the values.

    Attributes
    ----------
    points : list of (float, float)
        Times, increasing, and values; zero for a value that touches zero within rounding. The start alone where all
        values are noise.
    spent : int
        Samples taken.
    """

    def __init__(self, sample, shaken, noise=0.0):
        self.sample, self.shaken, self.noise = sample, shaken, noise
        self.points, self.spent, self._shortest, self._unit = [], 0, 0.0, 1.0

    def run(self, a, value, b, degree):
        """Search [a, b], the value at a being known, with interpolants of this degree at first.

        Return the degree needed and the value at b. Raises TooFast.
        """
        self._shortest = max(DEEPEST * (b - a), SHORTEST_INTERVAL * max(abs(a), abs(b)))
        self._measure_by(SAFE)
        whole = self._fit(a, b, SAFE * value, None, degree)
        if whole.scale < UNDERFLOWING:
            exponent = -math.frexp(whole.scale)[1] if whole.scale else MOST_SCALED  # denormal numbers times SAFE are 0
            self._measure_by(math.ldexp(SAFE, min(exponent, MOST_SCALED)))
            whole = self._fit(a, b, self._unit * value, None, degree)
        self.points.append((a, self._unit * value))
        if not (whole.resolved or whole.off != whole.off):
            self.noise = max(self._rounding(whole), self._unit * self.shaken(0.5 * (a + b)))
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
        if self.spent > MOST:
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
            fine, *judged = _judged(degree, samples, self.noise)
            fit = Fit(a, b, degree, times, samples, fine, *(x.item() for x in judged))
            hopeless = degree == LARGEST or (degree == LARGEST // 2 and fit.off > UNRESOLVED * fit.scale)
            if fit.resolved or hopeless or fit.off != fit.off:
                return fit
            degree *= 2
            times, samples = _refined(degree, a, b, samples, self._values)

    def _rounding(self, fit):
        """Return the rounding error of the values: high coefficients where a smooth function has none."""
        t, least = fit.a + 0.382 * (fit.b - fit.a), SHORTEST_INTERVAL * max(abs(fit.a), abs(fit.b))
        half, found = max(ROUGH_SHARE * (fit.b - fit.a), least), np.inf
        while half < WIDEST_NOISE * (fit.b - fit.a):
            rough = table(8).coefficients[5:] @ self._values(t + half * table(8).nodes)
            found = min(found, 10.0 * float(np.abs(rough).max()))
            if found <= NEGLIGIBLE * fit.scale or half == least:
                break
            half = max(NOISE_RATIO * half, least)
        return found if found < np.inf else 0.0

    def _follow(self, fit, calm):
        """Collect the points of a fit or of its halves; calm: consecutive halvings that left one half resolved."""
        if fit.resolved:
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
        if fit.clear <= NEAR_ZERO * fit.scale:
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
        yield from ((i, i + 2) for i in np.flatnonzero(least & (size[1:-1] <= NEAR_ZERO * fit.scale)).tolist())
        runs = (np.flatnonzero(sign[1:] != sign[:-1]) + 1).tolist()
        yield from ((i - 1, j) for i, j in pairwise(runs) if -(-i // FINE) * FINE >= j)  # without a node
        yield from ((i, i + 1) for i, end in ((0, 0), (last - 1, last)) if size[end] <= AT_ZERO * fit.scale)

    def _polish(self, a, b):
        """Return extrema between a and b, and an end that touches zero: values by time."""
        times = a + 0.5 * (b - a) * (table(POLISH).nodes + 1.0)
        times[-1] = b
        samples = self._values(times)
        series = table(POLISH).coefficients @ samples
        if not np.isfinite(series).all():
            return {}
        noise = max(8.0 * float(np.abs(series[-5:]).max()) + EPS * float(np.abs(samples).max()), self.noise)
        inner, ulps = a + 0.5 * (b - a) * (extremes(series) + 1.0), 8.0 * EPS * max(abs(a), abs(b))
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
        found = minimize_scalar(value, bounds=(0.0, b - a), method="bounded", options={"xatol": EXTREME * (b - a)})
        if not abs(found.fun) < np.inf:
            return {}
        return {a + float(found.x): 0.0 if abs(found.fun) <= AT_ZERO * scale else sign * float(found.fun)}

    def _append(self, found):
        """Add values by time; the first may be known already."""
        if self.points and self.points[-1][0] in found:
            t, value = self.points.pop()
            found[t] = value if value == 0.0 else found[t]
        self.points += sorted(found.items())
