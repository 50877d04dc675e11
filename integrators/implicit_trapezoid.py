"""ImplicitTrapezoid: the trapezoidal rule, order 2, A-stable, no numerical damping, with a Jacobian kept over steps."""

from __future__ import annotations

from ..plugins import DiagonallyImplicit, ImplicitTableau, linear_second, trapezoid_error

LOOSE = 1e-3  # tolerance below which a step is held to less than its part


class ImplicitTrapezoid(DiagonallyImplicit):
    """The trapezoidal rule with Jacobian reuse, adaptive or of a fixed step, for stiff scenes at modest accuracy.

    Examples
    --------
    A mass on a spring oscillates at 100 rad/s. Three steps a radian keep its energy: the rule adds no damping.

    >>> import tsdyn as ts
    >>> mass = (scene := ts.Scene(gravity=(0, 0, 0))).add_point_mass(1.0, position=(1, 0, 0), velocity=(1, 0, 0))
    >>> spring = scene.add(ts.forces.Spring(mass, scene.ground, stiffness=1e4))
    >>> solution = ts.simulate(scene, (0, 10), integrator=ts.integrators.ImplicitTrapezoid(step=3e-3))
    >>> bool(abs(solution.energy - 0.5).max() < 1e-6)
    True
    """

    order = 2
    safety = 100.0
    tableau = ImplicitTableau(a=((0,), (1 / 2, 1 / 2)), c=(0, 1), order=2, embedded_order=2)
    errors, second = (trapezoid_error,), linear_second

    def step_tolerances(self) -> tuple[float, float]:
        """A step's error has order 3 and a run's order 2: the power makes the latter follow the tolerance."""
        return tuple(tol / self.safety * min(1.0, (tol / LOOSE) ** 0.5) for tol in (self.rtol, self.atol))
