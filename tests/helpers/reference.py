"""The reference solutions of tests/references, as scenes and arrays; references/trim.py says where they come from."""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

import tsdyn as ts
from tests.helpers.scenes import build
from tests.helpers.tolerances import EPS
from tsdyn.observables.diagnostics import constraint_error

FOLDER = Path(__file__).parents[1] / "references"
NAMES = tuple(sorted(path.stem for path in FOLDER.glob("*.json")))


class Reference(NamedTuple):
    """k outputs of b bodies."""

    t: np.ndarray  # (k,)
    r: np.ndarray  # (k, b, 3)
    A: np.ndarray  # (k, b, 3, 3)
    v: np.ndarray  # (k, b, 3)
    w_body: np.ndarray  # (k, b, 3)
    energy: np.ndarray  # (k,)

    def until(self, t):
        """The outputs up to a time."""
        return Reference(*(array[self.t <= t] for array in self))


def read(name):
    """The file of a reference."""
    return json.loads((FOLDER / f"{name}.json").read_text())


def load(name):
    """The scene of a reference and its numbers."""
    data = read(name)
    arrays = {name: np.array(data[name]) for name in Reference._fields}
    arrays["A"] = arrays["A"].reshape(*arrays["A"].shape[:2], 3, 3)
    return build(data["definition"]), Reference(**arrays)


def errors(solution, reference):
    """Errors in r and A at every output, (k, b, 3) and (k, b, 3, 3); the outputs are at times of the reference."""
    rows = np.searchsorted(reference.t, solution.t)
    assert (reference.t[rows] == solution.t).all(), "ask for the reference's own times: t_eval=reference.t"
    bodies = solution.scene.bodies
    r = np.stack([solution.position(body) for body in bodies], axis=1)
    A = np.stack([solution.rotation(body) for body in bodies], axis=1)
    return r - reference.r[rows], A - reference.A[rows]


def error(solution, reference, rows=slice(None)):
    """Largest error in r and A over all outputs, or over those rows of them."""
    solution.raise_if_failed()
    return max(np.abs(part[rows]).max() for part in errors(solution, reference))


def run(name, method, end=10.0, **options):
    """A run of a reference's scene to an end that it knows, and its error."""
    scene, reference = load(name)
    reference = reference.until(end)
    solution = ts.simulate(scene, (0.0, end), integrator=method, t_eval=reference.t, **options).raise_if_failed()
    return solution, error(solution, reference)


def demand_on_the_manifold(solution, state):
    """All three levels of the constraints to rounding, at the outputs (of the solution itself, or of its `at`)."""
    found = constraint_error(solution.packed, state.t, state.q, state.qd, state.qdd)
    for level, values, factor in zip(found, (state.q, state.qd, state.qdd), (50, 500, 5000), strict=True):
        assert (level <= factor * EPS * (1.0 + np.abs(values).max(axis=1))).all()


def demand_every_level(solution):
    """The three levels of constraints hold to multiples of rounding, row by row."""
    levels = solution.constraint_error
    for level, values, factor in zip(levels, (solution.q, solution.qd, solution.qdd), (50, 500, 5000), strict=True):
        assert (level <= factor * EPS * (1.0 + np.abs(values).max(axis=1))).all()
