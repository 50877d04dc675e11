"""DOP853: the explicit Runge-Kutta method of order 8 of Dormand and Prince, in Hairer's form, adaptive.

Twelve stages; Hairer's error estimate combines embedded formulas of orders five and three. Three further stages, made
only where dense output is needed, give an interpolant of order seven. E. Hairer, S. P. Norsett, G. Wanner, Solving
Ordinary Differential Equations I, 2nd ed., II.5, II.6 and II.10. The coefficients are SciPy's.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import DOP853_INTERPOLANT as INTERPOLANT
from ..plugins import ExplicitRungeKutta, RungeKuttaTableau, embedded_error, second_embedded_error

if TYPE_CHECKING:
    from ..hints import StepKernel


@cache
def _coefficients():
    """The tableau; its numbers, then the interpolant's: c and a of three stages, D (4, 16)."""
    from scipy.integrate import DOP853 as scipys  # at first use: it takes longer to import than all of tsdyn

    tableau = RungeKuttaTableau(
        a=tuple(tuple(scipys.A[i, :i].tolist()) for i in range(12)),
        b=tuple(scipys.B.tolist()),
        c=tuple(scipys.C.tolist()),
        order=8,
        error=tuple(scipys.E5.tolist()),
        second_error=tuple(scipys.E3.tolist()),
        embedded_order=7,
    )
    extra = np.column_stack((scipys.C_EXTRA, scipys.A_EXTRA))
    return tableau, np.concatenate((tableau.numbers, np.ravel(extra), np.ravel(scipys.D)))


class DOP853(ExplicitRungeKutta):
    """Explicit Runge-Kutta method of order 8, for tolerances down to rounding.

    Examples
    --------
    A free body that spins about its intermediate axis turns over; its energy stays constant:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, 0))
    >>> racket = scene.add_body(mass=1.0, inertia=(1, 2, 3), angular_velocity=(0.01, 2, 0))
    >>> solution = ts.simulate(scene, (0, 10), integrator=ts.integrators.DOP853(rtol=1e-10, atol=1e-10))
    >>> print(bool(abs(solution.energy - 4.00005).max() < 1e-8), solution.angular_velocity(racket)[-1, 1] < 0)
    True True
    """

    order = 8
    stability_limit = 6.1
    safety = 500.0  # measured: errors of the references at t <= 10 s stay below 30 tol, tol 1e-4 to 1e-12
    embedded_order = 7  # of the combined estimate, by which the step is chosen
    errors = (embedded_error, second_embedded_error)

    @property
    def tableau(self) -> RungeKuttaTableau:
        """The `RungeKuttaTableau`."""
        return _coefficients()[0]

    def kernel(self, first_order: bool) -> StepKernel:
        """The step kernel; the interpolant's numbers after the tableau's, and room for its four derivatives."""
        return super().kernel(first_order)[0], _coefficients()[1], lambda nx, ny: 17 * (nx + ny)

    def interpolant(self, first_order: bool) -> Any:
        """Its own, of order seven, for either form."""
        return INTERPOLANT
