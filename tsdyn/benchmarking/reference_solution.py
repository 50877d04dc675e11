"""Reference solution of a scene: two unrelated methods, refined until they agree as far as they can."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..errors import InvalidArgument, Status
from ..integrators import DOP853, RK45, SDIRK54
from ..simulation.simulate import simulate
from .tolerances import ENOUGH, REFERENCE_TOLERANCES, ROOM

PAIRS = ((DOP853, RK45), (DOP853, SDIRK54), (SDIRK54, RK45))  # the next one where a method doesn't get through


class Reference(NamedTuple):
    """Where the bodies are at given times; k times, b bodies."""

    t: np.ndarray  # (k,), s
    r: np.ndarray  # (k, b, 3), m
    A: np.ndarray  # (k, b, 3, 3); the identity for a point mass
    trusted: float  # what r (m) and A are taken to be right to
    source: str

    @property
    def digits(self) -> float:
        """Decimals of r (m) and A that are trusted."""
        return -math.log10(self.trusted) if self.trusted > 0.0 else 16.0


def poses(solution):
    """Positions (k, b, 3) and rotation matrices (k, b, 3, 3) of a solution's bodies."""
    bodies, k = solution.scene.bodies, solution.t.size
    r = np.stack([solution.position(body) for body in bodies], axis=1)
    A = [np.broadcast_to(np.eye(3), (k, 3, 3)) if body.dimension == 3 else solution.rotation(body) for body in bodies]
    return r, np.stack(A, axis=1)


def errors(solution, reference):
    """Largest differences in r (m) and in A from a reference, over all bodies and outputs."""
    return tuple(
        float(np.abs(found - given).max(initial=0.0))
        for found, given in zip(poses(solution), (reference.r, reference.A), strict=True)
    )


def agreed(scene, t_span, times, max_steps):
    """Make a `Reference`.

    Raises
    ------
    InvalidArgument
        If no two methods reach the end within max_steps.
    KeyboardInterrupt
        If one of the runs is interrupted.
    """
    best, said = None, []
    for pair in PAIRS:
        for tol in REFERENCE_TOLERANCES:
            runs = [_run(scene, t_span, times, kind, tol, max_steps) for kind in pair]
            failed = [run for run in runs if not run.success]
            if failed:
                said += [f"{run.method}: {run.message}" for run in failed]
                break
            r, A = poses(runs[0])
            gap = max(errors(runs[1], Reference(times, r, A, 0.0, "")))
            if best is None or gap < best[0]:
                best = gap, Reference(times, r, A, 0.0, f"{runs[0].method}, from which {runs[1].method} differs by")
            if gap < ENOUGH:
                break
        if best is not None:
            break
    if best is None:
        raise InvalidArgument(
            f"no reference could be made for this scene within {max_steps} steps; shorten t_span, raise max_steps, or "
            f"give a reference. {said[-1]}"
        )
    gap, reference = best
    size = 1.0 + np.abs(reference.r).max(initial=0.0)
    trusted = max(ROOM * gap, 10.0 * np.finfo(float).eps * size)
    return reference._replace(trusted=trusted, source=f"{reference.source} {gap:.1e} at most")


def _run(scene, t_span, times, kind, tol, max_steps):
    run = simulate(scene, t_span, integrator=kind(tol, tol), t_eval=times, max_steps=max_steps)
    if run.status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    return run
