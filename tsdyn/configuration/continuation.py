"""Continuation (homotopy) from a sketch to the nearest consistent configuration; conflicting constraints."""

import time
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ..errors import InconsistentState
from ..maths.matrix_rank import row_lengths
from ..maths.tolerances import NEGLIGIBLE, ROUNDING, TINY
from .kinetic_metric import least_step, soft_step
from .tolerances import (
    DECREASE,
    LAST_CONVERGED,
    MANY_COORDINATES,
    MOST_CLOSING,
    MOST_ROTATION,
    MOST_SETTLING,
    MOST_SLIDE,
    NAMED_SHARE,
    NEAR_SKETCH,
    SETTLED,
    SHAKES,
    STAGE_CONVERGED,
    STAGES,
    STEEP,
)

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


def nearest(metric, sketch, tol, rows=None, shakes=SHAKES, also=()):
    """Return the configuration nearest to a sketch (n,) that satisfies rows to tol (1 + max |q|), or the best found.

    If continuation from the sketch fails, other starts are tried: `also`, and random perturbations of the sketch.
    """
    rng, best, total = np.random.default_rng(0), None, 0
    shakes = shakes[:2] if metric.n > MANY_COORDINATES else shakes
    Phi = metric.linear(sketch, rows)[0]
    if np.abs(Phi).max(initial=0.0) <= ROUNDING * (1.0 + np.abs(sketch).max()):
        return ContinuationEnd(sketch, Phi, 0, True)
    for attempt in range(2 + len(also) + len(shakes)):
        if attempt == 0:
            q, count = relax(metric, sketch, sketch, rows)
        elif attempt == 1:
            q, count = sketch, 0
        else:
            shaken = attempt - 2 - len(also)
            start = also[attempt - 2] if shaken < 0 else metric.shaken(sketch, rng, shakes[shaken])
            q, count = relax(metric, sketch, start, rows)
        q, Phi, more = close(metric, q, rows)
        total += count + more
        met = bool(np.abs(Phi).max(initial=0.0) <= tol * (1.0 + np.abs(q).max()))
        if best is None or met or np.linalg.norm(Phi) < np.linalg.norm(best.Phi):
            best = ContinuationEnd(q, Phi, total, met)
        if met or (attempt == 1 and stuck(metric, q, Phi, rows).size):
            break
    if best.met:
        q, Phi, more = approach_sketch(metric, sketch, best.q, rows)
        if np.abs(Phi).max(initial=0.0) <= tol * (1.0 + np.abs(q).max()):
            best = best._replace(q=q, Phi=Phi)
        total += more
    return best._replace(iterations=total)


def approach_sketch(metric, sketch, q, rows=None):
    """Minimise the distance to the sketch along the constraints. Return q, Phi and the number of steps."""
    steps, last = 0, np.inf
    Phi, A = metric.linear(q, rows)
    while steps < MOST_SETTLING and metric.columns.size:
        wish = metric.towards(q, sketch)[1]
        step = wish + least_step(A, A @ wish, STEEP)
        size = np.linalg.norm(step)
        if size <= SETTLED * np.linalg.norm(wish) or size >= DECREASE * last:
            break
        turn = metric.largest_turn(step)
        trial, residual, more = close(metric, metric.moved(q, min(1.0, MOST_SLIDE / max(turn, TINY)) * step), rows)
        steps += 1 + more
        allowed = 10.0 * np.abs(Phi).max(initial=0.0) + ROUNDING * (1.0 + np.abs(q).max())
        if np.abs(residual).max(initial=0.0) > allowed:
            break
        last, q = size, trial
        Phi, A = metric.linear(q, rows)
    return q, Phi, steps


def stuck(metric, q, Phi, rows=None):
    """Return violated rows whose derivative vanishes."""
    size = np.abs(Phi)
    return np.flatnonzero(
        (row_lengths(metric.linear(q, rows)[1]) == 0.0) & (size > NAMED_SHARE * size.max(initial=0.0))
    )


def relax(metric, sketch, q, rows=None, kept=None, stages=STAGES):
    """Follow the equilibrium from q while the constraint springs stiffen. Return q and the number of steps."""
    Phi, A = metric.linear(q, rows)
    if not (Phi.size and metric.columns.size):
        return q, 0
    steps, relative = 0, None if kept is None else _Relative(metric, sketch, kept)
    lengths = row_lengths(A)
    if kept is None and q is sketch and _strain(Phi, lengths) < NEAR_SKETCH * metric.reach(q) * metric.root.min():
        stages = stages[-1:]

    def strained(q):
        """Return residuals, unit rows, the step towards the sketch, softness and energy."""
        Phi, A = metric.linear(q, rows)
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
        lengths = row_lengths(metric.linear(q, rows)[1])
        weights = np.where(lengths > 0.0, 1.0 / np.where(lengths > 0.0, lengths, 1.0), 0.0)
        now = strained(q)
        for _ in range(most):
            *arrays, energy = now
            step = soft_step(arrays[1], arrays[0], arrays[2], arrays[3])
            size = np.linalg.norm(step)
            if size <= LAST_CONVERGED * np.linalg.norm(arrays[2]):
                break
            turn = metric.largest_turn(step)
            factor = min(1.0, MOST_ROTATION / turn) if turn > 0.0 else 1.0
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
            if softness != stages[-1][0] and size <= STAGE_CONVERGED * (np.linalg.norm(now[2]) + TINY):
                break
    return q, steps


def close(metric, q, rows=None):
    """Take Gauss-Newton steps of least kinetic energy, down to rounding. Return q, Phi and the number of steps."""
    Phi, A = metric.linear(q, rows)
    steps = 0
    while steps < MOST_CLOSING and Phi.size and metric.columns.size:
        if np.abs(Phi).max() <= ROUNDING * (1.0 + np.abs(q).max()):
            break
        steps += 1
        step = least_step(A, Phi, STEEP)
        turn = metric.largest_turn(step)
        factor = min(1.0, MOST_ROTATION / turn) if turn > 0.0 else 1.0
        size = np.linalg.norm(Phi)
        for _ in range(12):
            trial = metric.moved(q, factor * step)
            arrays = metric.linear(trial, rows)
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


# Conflicting constraints: the minimal infeasible subset, joints taken as a whole.
#
# At a minimum of |Phi|^2, Phi_q^T Phi = 0: the residuals balance like the forces of a prestressed structure, and only
# constraints with a non-zero residual can conflict. Subsets of these are assembled from the sketch in order of size;
# with many candidates, constraints are removed one at a time as long as the rest still fails.

FEW = 6  # constraints of which all sets are tried
MOST = 60  # constraints among which a conflict is searched
LONGEST = 10.0  # s of search
TRIAL_SHAKES = (0.1, 0.3, 0.6, 1.0)


def refuse(scene, metric, sketch, found, tol, held=()):
    """Raise InconsistentState that names the constraints in conflict, also as `.constraints`."""
    packed = scene.packed
    members = [member for member in packed.members if not getattr(member.constraint, "normalises", False)]
    left = np.zeros(len(packed.system.segments))
    left[metric.own] = np.abs(found.Phi)
    sizes = np.array([left[member.rows].max() for member in members])
    suspects = [member for member, size in zip(members, sizes, strict=True) if size > NAMED_SHARE * sizes.max()]
    trial = _Trial(metric, sketch, found.q, tol)
    conflict = False
    while len(suspects) <= MOST and not (conflict or trial.over):
        conflict = not trial.met(suspects)
        wider = suspects if conflict else _wider(suspects, members)
        if not conflict and len(wider) == len(suspects):
            break
        suspects = wider
    conflicting, minimal = smallest(suspects, trial) if conflict else (suspects, False)
    names, lines = scene.row_names(), []
    for member in sorted(conflicting, key=lambda member: -left[member.rows].max())[:8]:
        row = member.rows.start + int(np.argmax(left[member.rows]))
        lines.append(f"  {member.constraint.title}: |Phi| = {left[row]:.3g} in {names[row]}")
    if len(conflicting) > 8:
        lines.append(f"  ... and {len(conflicting) - 8} more")
    if len(conflicting) == 1:
        story = "This constraint is infeasible on its own"
    elif minimal:
        story = f"These {len(conflicting)} conflict; without any one of them, the others can be satisfied"
    elif conflict:
        story = f"These {len(conflicting)} conflict; whether fewer do was not found in {LONGEST:g} s"
    else:
        story = "These have non-zero residuals"
    where = f" with {', '.join(body.name for body in held)} held fixed" if len(held) else ""
    error = InconsistentState(
        f"no configuration that satisfies all constraints{where} was found in {found.iterations} iterations from the "
        f"sketch and from perturbed ones. {story}:\n"
        + "\n".join(lines)
        + "\nChange a length, point or axis of one of them, or remove one"
        + ("; or hold fewer bodies." if len(held) else ". If they are compatible, improve the sketch of the bodies.")
    )
    error.constraints = tuple(member.constraint for member in conflicting)
    raise error


def _wider(suspects, members):
    """Return the constraints that share a body with these: vanishing derivatives hide rows of a conflict."""
    bodies = {id(body) for member in suspects for body in (member.constraint.a, member.constraint.b)}
    bodies -= {id(None), id(suspects[0].constraint.scene.ground)}
    return [member for member in members if bodies & {id(member.constraint.a), id(member.constraint.b)}]


def smallest(suspects, trial):
    """Return a minimal infeasible subset, and True if each of its members is known to be necessary."""
    if len(suspects) <= FEW:
        for size in range(1, len(suspects)):
            for chosen in combinations(suspects, size):
                if trial.over:
                    return list(suspects), False
                if not trial.met(chosen):
                    return list(chosen), True
        return list(suspects), True
    needed, chunk = list(suspects), (len(suspects) + 1) // 2
    while True:
        at = 0
        while at < len(needed):
            if trial.over:
                return needed, False
            rest = needed[:at] + needed[at + chunk :]
            if rest and not trial.met(rest):
                needed = rest
            else:
                at += chunk
        if chunk == 1:
            break
        chunk = (chunk + 1) // 2
    return smallest(needed, trial) if len(needed) <= FEW < len(suspects) else (needed, True)


class _Trial:
    """Assemblies of some of the constraints."""

    def __init__(self, metric, sketch, q, tol):
        self.metric, self.sketch, self.also, self.tol = metric, sketch, (q,), tol
        self.until = time.monotonic() + LONGEST

    @property
    def over(self):
        """Whether the search has taken long enough: with what has been found, a user gets on."""
        return time.monotonic() > self.until

    def met(self, members):
        """Return True if the constraints can be satisfied together."""
        rows = np.concatenate([np.arange(member.rows.start, member.rows.stop) for member in members])
        return nearest(self.metric, self.sketch, self.tol, rows, TRIAL_SHAKES, self.also).met
