"""Radau: Radau IIA, fully implicit, L-stable, of order 5, 9 or 13, for stiff scenes at tight tolerances.

E. Hairer, G. Wanner, Stiff differential equations solved by Radau methods, J. Comput. Appl. Math. 111, 93-111 (1999);
Solving Ordinary Differential Equations II, 2nd ed., IV.5 and IV.8. Three, five or seven stages; stage order the same.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.polynomial import legendre

from ..plugins import Collocation, CollocationTableau, InvalidArgument

ORDERS = 5, 9, 13
TIGHT = 1e-8  # tolerance below which order 13 takes less work than order 9


@cache
def _tableau(order):
    """Nodes are the zeros of P_s - P_(s-1), moved to (0, 1]; a step of Newton's method takes them to rounding."""
    stages = (order + 1) // 2
    series = np.array([0.0] * (stages - 1) + [-1.0, 1.0])
    x = np.sort(legendre.legroots(series))
    x -= legendre.legval(x, series) / legendre.legval(x, legendre.legder(series))
    return CollocationTableau((*(0.5 + 0.5 * x[:-1]), 1.0), order)


class Radau(Collocation):
    """Radau IIA, L-stable, fully implicit, of order 5, 9 or 13, for stiff scenes at tight tolerances.

    Parameters
    ----------
    order : 5, 9 or 13, optional
        By default 9, and 13 where both tolerances are below 1e-8; 5 with a fixed step.

    Examples
    --------
    A mass hangs on a stiff, overdamped spring. At a tolerance of 1e-10 fifty steps do:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> mass = scene.add_point_mass(mass=1.0, position=(0, 0, 1))
    >>> spring = scene.add(ts.forces.Spring(mass, scene.ground, stiffness=1e8, damping=1e5))
    >>> solution = ts.simulate(scene, (0, 1), integrator=ts.integrators.Radau(rtol=1e-10, atol=1e-10))
    >>> print(solution.stats.steps < 100, f"{solution.position(mass)[-1, 2] - 1:.3e} m")
    True -1.000e-07 m
    """

    order, embedded_order, coupled = 9, 5, 5
    safety = 10.0  # of stiff springs' errors: 1 tol

    def __init__(
        self,
        rtol: float = 1e-6,
        atol: float = 1e-8,
        step: float | None = None,
        max_step: float | None = None,
        first_step: float | None = None,
        order: int | None = None,
    ) -> None:
        super().__init__(rtol, atol, step, max_step, first_step)
        if order is not None and order not in ORDERS:
            raise InvalidArgument(f"Radau: order must be 5, 9 or 13, got {order!r}.")
        self.order = int(order or 0) or (5 if step is not None else 13 if max(self.rtol, self.atol) < TIGHT else 9)
        self.embedded_order = self.coupled = (self.order + 1) // 2

    def __repr__(self) -> str:
        return f"{super().__repr__()[:-1]}, order={self.order})"

    @property
    def tableau(self) -> CollocationTableau:
        """The method's nodes."""
        return _tableau(self.order)
