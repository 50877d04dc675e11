"""Test scenes of `check_integrator`, with their reference solutions."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..constraints import Distance
from ..integrators import DOP853, RK45
from ..measuring.haug_tables import sliding_top, two_body_pendulum
from ..measuring.tolerances import REFERENCE_TOLERANCES
from ..simulation.prepared_run import simulate
from ..simulation.scene import Scene
from .tolerances import BRIEF

GRID = 16  # equal parts of the span, at whose ends fixed steps are compared
INNER = np.sort(np.random.default_rng(1).uniform(0.01, 0.99, 40))  # fractions of the span, within the steps


class ReferenceScene(NamedTuple):
    """A scene and where it is at times t, by two methods that agree to `trusted`, relative to 1 + the size."""

    name: str
    scene: Scene
    end: float
    grid: np.ndarray  # (GRID + 1,), s
    inner: np.ndarray  # (k,), s
    q: np.ndarray  # (GRID + 1, n)
    qd: np.ndarray
    q_inner: np.ndarray  # (k, n)
    qd_inner: np.ndarray
    trusted: float


def turning_pendulum():
    """The two-body pendulum of the tables, its bodies turning in space."""
    scene = two_body_pendulum()
    for body, rate in zip(scene.bodies, ((0.3, 0.0, 0.0), (2.0, 5.0, 1.0)), strict=True):
        body.angular_velocity = rate
    return scene


def driven_pendulum():
    """A rigid body on a rod whose length is a function of time."""
    scene = Scene()
    body = scene.add_body(
        1.0, (0.02, 0.03, 0.04), position=(0.5, 0.0, 0.1), velocity=(0.4, 0.6, 0.0), angular_velocity=(1.0, 2.0, -1.0)
    )
    length = (lambda t: 0.5 + 0.1 * np.sin(4.0 * t), lambda t: 0.4 * np.cos(4.0 * t), lambda t: -1.6 * np.sin(4.0 * t))
    scene.add(Distance(body, scene.ground, point_a=(0.0, 0.0, -0.1), length=length))
    scene.assemble()
    return scene


SCENES: dict[str, tuple[Callable[[], Scene], float]] = {
    "sliding top": (lambda: sliding_top((0.5, 0.0, 12.0)), 10.0),
    "two-body pendulum": (turning_pendulum, 10.0),
    "driven pendulum": (driven_pendulum, 3.0),
}


def cases(kind, order=2):
    """Yield a `ReferenceScene` for each scene, for methods of an order; its reference isn't by the judged `kind`."""
    first, second = (RK45, DOP853) if isinstance(kind, type) and issubclass(kind, DOP853) else (DOP853, RK45)
    for name, (build, end) in SCENES.items():
        end *= BRIEF if order == 1 else 1.0
        scene, grid, inner = build(), np.linspace(0.0, end, GRID + 1), end * INNER
        times = np.union1d(grid, inner)
        tightest = REFERENCE_TOLERANCES[-1]
        best, other = (
            simulate(scene, (0.0, end), integrator=method(tightest, tightest), t_eval=times).raise_if_failed()
            for method in (first, second)
        )
        at, within = np.searchsorted(times, grid), np.searchsorted(times, inner)
        yield ReferenceScene(
            name, scene, end, grid, inner, best.q[at], best.qd[at], best.q[within], best.qd[within],
            max(distance(best.q, other.q), distance(best.qd, other.qd)),
        )  # fmt: skip


def distance(found, expected):
    """Largest difference, relative to 1 + the largest value."""
    return np.abs(found - expected).max() / (1.0 + np.abs(expected).max())
