"""Figures of a case of the gallery, one function each: CHECKS lists them, and report.py their columns.

A check takes a `CheckedRun` and returns figures by name. A figure that a case doesn't have is NaN.
"""

import time
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..errors import TsdynError
from ..integrators import DOP853, Nystrom4, Taylor
from ..maths.tolerances import EPS
from ..simulation.simulate import simulate
from ..simulation.solution import Solution
from .gallery.cases import Case
from .laws import energy_left, findings, resumed_is_same, same_bits

TOLERANCE = 1e-15, 1e-12  # of Taylor, and of the other method
OUTPUTS = 129  # output times of a run
PARTS = 5  # doublings of time, over which the growth of the energy error is fitted
SEEN = 2.0 * EPS  # energy errors below this are rounding: their growth is not fitted


class CheckedRun(NamedTuple):
    """A run of a case by the Taylor integrator, at the limit of rounding."""

    case: Case
    solution: Solution


def run(case):
    """Return the `CheckedRun` of a case."""
    t = np.linspace(0.0, case.end, OUTPUTS)
    options = {"integrator": Taylor(TOLERANCE[0]), "t_eval": t, "dense_output": True}
    return CheckedRun(case, simulate(case.build(), (0.0, case.end), **options))


def size(run):
    """Bodies, constraint rows, steps, and the time of the run, s."""
    scene, stats = run.solution.scene, run.solution.stats
    rows = len(run.solution.system.segments)
    return {"bodies": len(scene.bodies), "rows": rows, "steps": stats.steps, "seconds": stats.seconds["run"]}


def ending(run):
    """Whether the run reached its end, and what it said."""
    return {"success": run.solution.success, "message": run.solution.message}


def constraint_errors(run):
    """Largest constraint errors of position, velocity and acceleration."""
    return {name: float(error.max()) for name, error in run.solution.constraint_error._asdict().items()}


def energy(run):
    """Largest error of energy less work, relative to the energies, and the exponent of its growth with time."""
    left, whole = energy_left(run.solution)
    error = np.abs(run.solution.energy - run.solution.work - run.solution.energy[0]) / (whole or 1.0)
    ends = [(OUTPUTS - 1) >> part for part in range(PARTS)]
    sizes = np.array([np.sqrt(np.mean(error[end // 2 : end + 1] ** 2)) for end in ends])
    seen = sizes > SEEN
    exponent = np.polyfit(np.log(ends)[seen], np.log(sizes[seen]), 1)[0] if seen.sum() > 2 else np.nan
    worst = np.maximum.accumulate(np.abs(error))
    growth = [(i / (OUTPUTS - 1), float(worst[i])) for i in range(1, OUTPUTS)]
    return {"energy": left / (whole or 1.0), "exponent": float(exponent), "growth": growth}


def order(run):
    """Return the observed order of Nystrom4, of three runs with steps halved; declared: 4."""
    end, count = run.case.steps
    scene, ends = run.case.build(), []
    for halving in range(3):
        method = Nystrom4(step=end / (count << halving))
        solution = simulate(scene, (0.0, end), integrator=method, t_eval=(0.0, end))
        if not solution.success:
            return {"order": np.nan}
        ends.append(solution.q[-1])
    coarse, fine = (np.abs(a - b).max() for a, b in pairwise(ends))
    return {"order": float(np.log2(coarse / fine)) if fine > 0.0 else np.nan}


def agreement(run):
    """Largest distance in q from a run by DOP853, relative to the largest coordinate."""
    until = run.case.agree or run.case.end
    t = run.solution.t[run.solution.t <= until]
    other = simulate(run.case.build(), (0.0, t[-1]), integrator=DOP853(*2 * TOLERANCE[1:]), t_eval=t)
    if not other.success:
        return {"agreement": np.nan}
    q = run.solution.q[: t.size]
    return {"agreement": float(np.abs(other.q - q).max() / np.abs(q).max())}


def laws(run):
    """The laws that the run breaks."""
    return {"broken": [str(found) for found in findings(run.solution) if found.broken]}


def repeated(first):
    """Whether a second run gives the same bits."""
    return {"same": same_bits(first.solution, run(first.case).solution)}


def resumed(run):
    """Whether a run that was stopped, and goes on from its checkpoint, gives the same bits; None without h5py."""
    case, options = run.case, {"integrator": Taylor(TOLERANCE[0]), "t_eval": run.solution.t}
    return {"resumed": resumed_is_same(case.build(), (0.0, case.end), run.solution, **options)}


CHECKS = (size, ending, constraint_errors, energy, order, agreement, laws, repeated, resumed)


def figures(case):
    """All figures of a case, by name."""
    began, found = time.perf_counter(), {"case": case.name, "hard": case.hard}
    try:
        made = run(case)
        for check in CHECKS:
            found |= check(made)
    except TsdynError as error:
        found |= without_figures(case, f"{type(error).__name__}: {error}")
    return found | {"wall": time.perf_counter() - began}


def without_figures(case, message):
    """Figures of a case that could not be run."""
    unknown = {"broken": [], "same": True, "resumed": None}
    return {"case": case.name, "hard": case.hard, "success": False, "message": message, **unknown}
