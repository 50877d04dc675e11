"""Continuation (homotopy) from a sketch to the nearest consistent configuration."""

from typing import NamedTuple

import numpy as np

from ..maths.matrix_rank import row_lengths
from ..maths.tolerances import NEGLIGIBLE, ROUNDING, TINY
from . import tolerances as limits
from .kinetic_metric import least_step, soft_step

# Continuation (homotopy) from a sketch to the nearest configuration that satisfies the constraints.
#
# A spring holds each body at its pose in the sketch, in the metric of kinetic energy; each constraint is a spring of
# stiffness 1 / s. The equilibrium is followed from s = 1, where the sketch is hardly strained, to s = 1e-8, where the
# constraint residuals are of that order. Bodies move together, so links keep the fold of the sketch. Dependent rows
# need no special treatment: parallel springs share their load. Minimum-norm Gauss-Newton steps then remove the
# remaining residual, and steps along the constraints minimise the distance to the sketch.


class ContinuationEnd(NamedTuple):
    """End of a continuation."""

    q: np.ndarray  # (n,)
    Phi: np.ndarray  # (rows,)
    iterations: int
    met: bool


class Kept(NamedTuple):
    """Pairs of bodies whose relative orientation in the sketch is held by springs of the given softness."""

    pairs: np.ndarray  # (k, 2) body numbers, the ground's is the last
    softness: float


def nearest(metric, sketch, tol):
    """Return the configuration nearest to a sketch (n,) that satisfies the rows, or the best found.

    Rows hold to tol (1 + max |q|). Gauss-Newton steps from the sketch are tried where continuation fails.
    """
    Phi = metric.linear(sketch)[0]
    if np.abs(Phi).max(initial=0.0) <= ROUNDING * (1.0 + np.abs(sketch).max()):
        return ContinuationEnd(sketch, Phi, 0, True)
    best, total = None, 0
    for attempt in range(2):
        q, count = relax(metric, sketch, sketch) if attempt == 0 else (sketch, 0)
        q, Phi, more = close(metric, q)
        total += count + more
        met = bool(np.abs(Phi).max(initial=0.0) <= tol * (1.0 + np.abs(q).max()))
        if best is None or met or np.linalg.norm(Phi) < np.linalg.norm(best.Phi):
            best = ContinuationEnd(q, Phi, total, met)
        if met:
            break
    return approached(metric, sketch, best._replace(iterations=total), tol)


def approached(metric, sketch, found, tol):
    """Return what was found, or the nearest configuration to the sketch along the constraints from there."""
    if not found.met:
        return found
    q, Phi, more = approach_sketch(metric, sketch, found.q)
    found = found._replace(iterations=found.iterations + more)
    return found._replace(q=q, Phi=Phi) if np.abs(Phi).max(initial=0.0) <= tol * (1.0 + np.abs(q).max()) else found


def approach_sketch(metric, sketch, q):
    """Minimise the distance to the sketch along the constraints. Return q, Phi and the number of steps."""
    steps, last = 0, np.inf
    Phi, A = metric.linear(q)
    while steps < limits.MOST_SETTLING and metric.columns.size:
        wish = metric.towards(q, sketch)[1]
        step = wish + least_step(A, A @ wish, limits.STEEP)
        size = np.linalg.norm(step)
        if size <= limits.SETTLED * np.linalg.norm(wish) or size >= limits.DECREASE * last:
            break
        turn = metric.largest_turn(step)
        trial, residual, more = close(metric, metric.moved(q, min(1.0, limits.MOST_SLIDE / max(turn, TINY)) * step))
        steps += 1 + more
        allowed = 10.0 * np.abs(Phi).max(initial=0.0) + ROUNDING * (1.0 + np.abs(q).max())
        if np.abs(residual).max(initial=0.0) > allowed:
            break
        last, q = size, trial
        Phi, A = metric.linear(q)
    return q, Phi, steps


def stuck(metric, q, Phi):
    """Return violated rows whose derivative vanishes."""
    size = np.abs(Phi)
    return np.flatnonzero(
        (row_lengths(metric.linear(q)[1]) == 0.0) & (size > limits.NAMED_SHARE * size.max(initial=0.0))
    )


def relax(metric, sketch, q, kept=None, stages=limits.STAGES):
    """Follow the equilibrium from q while the constraint springs stiffen. Return q and the number of steps."""
    Phi, A = metric.linear(q)
    if not (Phi.size and metric.columns.size):
        return q, 0
    steps, relative = 0, None if kept is None else _Relative(metric, sketch, kept)
    lengths = row_lengths(A)
    if (
        kept is None
        and q is sketch
        and _strain(Phi, lengths) < limits.NEAR_SKETCH * metric.reach(q) * metric.root.min()
    ):
        stages = stages[-1:]

    def strained(q):
        """Return residuals, unit rows, the step towards the sketch, softness and energy."""
        Phi, A = metric.linear(q)
        residual, A = Phi * weights, _weighed(A, weights)
        soft = np.full(residual.size, softness)
        if relative is not None:
            extra, B = relative.rows(q)
            residual, soft = (
                np.concatenate((residual, extra)),
                np.concatenate((soft, np.full(extra.size, kept.softness))),
            )
            A = _stacked(A, B)
        far, wish = metric.towards(q, sketch)
        return residual, A, wish, soft, far + 0.5 * residual @ (residual / soft)

    for softness, most in stages:
        lengths = row_lengths(metric.linear(q)[1])
        weights = np.where(lengths > 0.0, 1.0 / np.where(lengths > 0.0, lengths, 1.0), 0.0)
        now = strained(q)
        for _ in range(most):
            *arrays, energy = now
            step = soft_step(arrays[1], arrays[0], arrays[2], arrays[3])
            size = np.linalg.norm(step)
            if size <= limits.LAST_CONVERGED * np.linalg.norm(arrays[2]):
                break
            turn = metric.largest_turn(step)
            factor = min(1.0, limits.MOST_ROTATION / turn) if turn > 0.0 else 1.0
            steps += 1
            for _ in range(10):
                trial = metric.moved(q, factor * step)
                after = strained(trial)
                if after[-1] < energy:
                    break
                factor /= 2.0
            else:
                break
            q, now = trial, after
            if softness != stages[-1][0] and size <= limits.STAGE_CONVERGED * (np.linalg.norm(now[2]) + TINY):
                break
    return q, steps


def close(metric, q):
    """Take Gauss-Newton steps of least kinetic energy, down to rounding. Return q, Phi and the number of steps."""
    Phi, A = metric.linear(q)
    steps = 0
    while steps < limits.MOST_CLOSING and Phi.size and metric.columns.size:
        if np.abs(Phi).max() <= ROUNDING * (1.0 + np.abs(q).max()):
            break
        steps += 1
        step = least_step(A, Phi, limits.STEEP)
        turn = metric.largest_turn(step)
        factor = min(1.0, limits.MOST_ROTATION / turn) if turn > 0.0 else 1.0
        size = np.linalg.norm(Phi)
        for _ in range(12):
            trial = metric.moved(q, factor * step)
            arrays = metric.linear(trial)
            if np.linalg.norm(arrays[0]) < size:
                break
            factor /= 2.0
        else:
            break
        q, (Phi, A) = trial, arrays
    return q, Phi, steps


class _Relative:
    """Rows that keep relative orientations: the log of A_a^T A_b (A_a^T A_b of the sketch)^T, in the frame of a."""

    def __init__(self, metric, sketch, kept):
        self.metric, self.pairs = metric, kept.pairs
        a, b = kept.pairs.T
        R = metric.rotations(sketch)
        self.drawn = R[a].swapaxes(1, 2) @ R[b]
        self.places, self.rise = metric.turns()

    def rows(self, q):
        """Return residuals (3 k,) and unit rows (3 k, free columns)."""
        R, (a, b) = self.metric.rotations(q), self.pairs.T
        between = R[a].swapaxes(1, 2) @ R[b]
        residual = np.array([_logarithm(E) for E in between @ self.drawn.swapaxes(1, 2)])
        B = np.zeros((3 * len(a), self.metric.size))
        for k in range(len(a)):
            for body, block in ((a[k], -self.rise[a[k]]), (b[k], between[k] @ self.rise[b[k]])):
                if self.places[body][0] >= 0:
                    B[3 * k : 3 * k + 3, self.places[body]] = block
        B = B[:, self.metric.columns]
        lengths = np.maximum(row_lengths(B), TINY)
        some = row_lengths(B) > 0.0
        return np.where(some, residual.ravel() / lengths, 0.0), B / lengths[:, None]


def _logarithm(E):
    """Return the rotation vector (3,) of a rotation matrix, for angles below pi."""
    v = np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]]) / 2.0
    sine = np.linalg.norm(v)
    return v * (np.arctan2(sine, (np.trace(E) - 1.0) / 2.0) / sine) if sine > NEGLIGIBLE else v


def _strain(Phi, lengths):
    some = lengths > 0.0
    return np.abs(Phi[some] / lengths[some]).max(initial=0.0)


def _weighed(A, weights):
    if isinstance(A, np.ndarray):
        return A * weights[:, None]
    from scipy.sparse import diags_array

    return diags_array(weights) @ A


def _stacked(A, B):
    if isinstance(A, np.ndarray):
        return np.vstack((A, B))
    from scipy.sparse import csr_array, vstack

    return vstack((A, csr_array(B)), format="csr")
