"""Taylor series of the motion, of variable order and step (Jorba and Zou, Experiment. Math. 14, 99, 2005).

The coefficients of r, A, omega' and lam follow order by order from the equations of motion, see
coefficients.py. At the end of a step, positions and velocities are projected onto the constraint manifold.
"""

from __future__ import annotations

import math
from functools import lru_cache

from ..plugins import Integrator, InvalidArgument, positive, whole

LOWEST, HIGHEST = 4, 30
TIGHT = 1e-12  # mean of rtol and atol: below it rounding counts
LOOSEST = 0.1  # rtol and atol that are looser are taken for it: fast modes would grow until they are seen
FINE = 1e-16  # of a step, above TIGHT: less than rounding of a step makes no difference
FINEST = 1e-20  # of a step: truncation of one sign that stays below the rounding of ten million steps
SMALLEST = 1e-200  # unit of length, where atol is small against rtol: its floors must not underflow
REFINED = 3  # orders of the multipliers that are refined where rounding counts


class Taylor(Integrator):
    """The method for smooth scenes: the higher the accuracy asked for, the longer its steps against any other's.

    Serves every scene whose constraints and forces give their series, as all built-in ones do. Functions of time, and
    of time and state, have one if they are arithmetic and NumPy functions without branches; others are refused by name.

    Parameters
    ----------
    tol : float
        Tolerance relative to 1 + size. A step's error is held to tol / 1000, below 1e-12 to less, since errors of one
        sign add up. At 1e-15 the error of a run is rounding, which grows as the square root of the number of steps.
        More than 0.1 is taken for 0.1.
    order : int, optional
        From 4 to 30; None lets every step have the order that gets furthest for its work.
    rtol, atol : float, optional
        Relative and absolute tolerance where they differ from tol.

    Raises
    ------
    InvalidArgument
        If a tolerance or a step is not positive, or the order is out of range.

    Examples
    --------
    A swinging body, released from the horizontal, keeps its energy to rounding:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> arm = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(1, 0, 0))
    >>> pivot = scene.add(ts.constraints.Spherical(arm, scene.ground, point_a=(-1, 0, 0)))
    >>> solution = ts.simulate(scene, (0, 20), integrator=ts.integrators.Taylor(tol=1e-15))
    >>> bool(abs(solution.energy).max() < 1e-12), bool(solution.constraint_error.position.max() < 1e-14)
    (True, True)
    """

    order = embedded_order = 15
    driver = "series"
    safety = 1000.0

    def __init__(
        self,
        tol: float = 1e-15,
        order: int | None = None,
        *,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        max_step: float | None = None,
        first_step: float | None = None,
    ) -> None:
        self.tol = positive(tol, "Taylor: tol")
        self.rtol = self.tol if rtol is None else positive(rtol, "Taylor: rtol")
        self.atol = self.tol if atol is None else positive(atol, "Taylor: atol")
        self.step = None if step is None else positive(step, "Taylor: step (s)")
        self.max_step = None if max_step is None else positive(max_step, "Taylor: max_step (s)")
        self.first_step = None if first_step is None else positive(first_step, "Taylor: first_step (s)")
        self.fixed = whole(order, "Taylor: order")
        if self.fixed is not None and not LOWEST <= self.fixed <= HIGHEST:
            raise InvalidArgument(f"Taylor: order must be from {LOWEST} to {HIGHEST}, got {order!r}.")
        if self.fixed is not None:
            self.order = self.embedded_order = self.fixed

    def step_tolerances(self) -> tuple[float, float]:
        """Return (rtol, atol) that each step's error is held to.

        Truncation errors keep their sign for many steps and add up, rounding errors don't. So below TIGHT the safety
        factor grows, until truncation is a small part of rounding.
        """
        return _step_tolerances(self.rtol, self.atol, self.safety)

    @property
    def refined(self) -> int:
        """How many orders of the multipliers are refined, from zero on."""
        return REFINED if _is_tight(self.rtol, self.atol) else 0

    def orders(self) -> tuple[int, int, int]:
        """Return the first step's order, and the lowest and highest of all."""
        if self.fixed is not None:
            return self.fixed, self.fixed, self.fixed
        return _orders(sum(self.step_tolerances()))

    @property
    def stages(self) -> int:
        """Orders of a step, each of which costs about an evaluation."""
        return self.orders()[0]

    def __repr__(self) -> str:
        tolerance = (
            f"tol={self.tol:g}" if self.rtol == self.atol == self.tol else (f"rtol={self.rtol:g}, atol={self.atol:g}")
        )
        if self.step is not None:
            tolerance = f"step={self.step:g}"
        return f"Taylor({tolerance}" + (")" if self.fixed is None else f", order={self.fixed})")


def _is_tight(rtol, atol):
    return 0.5 * (rtol + atol) < TIGHT


@lru_cache
def _step_tolerances(rtol, atol, safety):
    units = min(max(atol / rtol, SMALLEST), 1.0)  # rounding is relative: its floor is lower in small units
    if not _is_tight(rtol, atol):
        return max(min(rtol, LOOSEST) / safety, FINE), max(min(atol, LOOSEST) / safety, FINE * units)
    share = 0.5 * (rtol + atol) / TIGHT / safety
    return max(rtol * share, FINEST), max(atol * share, FINEST * units)


@lru_cache
def _orders(tolerance):
    """The first step's order by the tolerance of a step, and the lowest and highest of all."""
    first = min(max(round(3.0 - 1.25 * math.log10(tolerance)), LOWEST), HIGHEST)
    return first, LOWEST, min(first + 8, HIGHEST)
