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

    Parameters
    ----------
    rtol, atol : float; default 1e-6, 1e-8
        Each step's error is kept below atol + rtol |value| by a margin (`DOP853.margin`), in the root mean square over
        coordinates and velocities, so that what adds up over a run is near to what was asked for.
    step : float, s, optional
        A fixed step instead.
    max_step, first_step : float, s, optional
        Bound on the step; the first step to try.

    Raises
    ------
    InvalidArgument
        If a tolerance or a step is not positive and finite.

    Examples
    --------
    A pendulum of 1 m, released from the horizontal; |Phi| stays at rounding:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> ball = scene.add_point_mass(mass=1.0, position=(1, 0, 0))
    >>> rod = scene.add(ts.constraints.Distance(ball, scene.ground))
    >>> solution = ts.simulate(scene, (0, 1), integrator=ts.integrators.DOP853(rtol=1e-10, atol=1e-10))
    >>> print(f"z = {solution.position(ball)[-1, 2]:.4f} m", solution.constraint_error.position.max() < 1e-12)
    z = -0.1650 m True
    """

    order = 8
    stability_limit = 6.1
    margin = 500.0  # measured: errors of the references at t <= 10 s stay below 30 tol, tol 1e-4 to 1e-12
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
