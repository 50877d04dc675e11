"""ImplicitTrapezoid: the trapezoidal rule, order 2, A-stable, no numerical damping, with a Jacobian kept over steps."""

from __future__ import annotations

from ..plugins import DiagonallyImplicit, ImplicitTableau, linear_second, trapezoid_error


class ImplicitTrapezoid(DiagonallyImplicit):
    """The trapezoidal rule with Jacobian reuse, adaptive or of a fixed step, for stiff scenes at modest accuracy.

    Parameters
    ----------
    rtol, atol : float; default 1e-6, 1e-8
        Each step's error, from differences over two steps, is kept to a fraction of atol + rtol |value|.
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
    >>> solution = ts.simulate(scene, (0, 1), integrator=ts.integrators.ImplicitTrapezoid(rtol=1e-5, atol=1e-5))
    >>> print(f"z = {solution.position(ball)[-1, 2]:.4f} m", solution.constraint_error.position.max() < 1e-12)
    z = -0.1650 m True
    """

    order = 2
    tableau = ImplicitTableau(a=((0,), (1 / 2, 1 / 2)), c=(0, 1), order=2, embedded_order=2)
    errors, second = (trapezoid_error,), linear_second

    def step_tolerances(self) -> tuple[float, float]:
        """A step's error has order 3 and a run's order 2: the power makes the latter follow the tolerance."""
        return tuple(min(tol / 100.0, (tol / 100.0) * (tol / 1e-3) ** 0.5) for tol in (self.rtol, self.atol))
