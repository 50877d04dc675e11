"""RK45: the embedded pair 5(4) of Dormand and Prince, adaptive.

J. R. Dormand, P. J. Prince, A family of embedded Runge-Kutta formulae, J. Comput. Appl. Math. 6, 19-26 (1980); applied
to (v, vd). First same as last: the seventh stage is the evaluation at the step's end.
"""

from ..plugins import ExplicitRungeKutta, RungeKuttaTableau


class RK45(ExplicitRungeKutta):
    """Explicit Runge-Kutta method of order 5 with an error estimate of order 4.

    Examples
    --------
    A pendulum of 1 m, released from the horizontal; |Phi| stays at rounding:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> ball = scene.add_point_mass(mass=1.0, position=(1, 0, 0))
    >>> rod = scene.add(ts.constraints.Distance(ball, scene.ground))
    >>> solution = ts.simulate(scene, (0, 1), integrator=ts.integrators.RK45(rtol=1e-8, atol=1e-8))
    >>> print(f"z = {solution.position(ball)[-1, 2]:.4f} m", solution.constraint_error.position.max() < 1e-12)
    z = -0.1650 m True
    """

    order = 5
    stability_limit = 3.25
    tableau = RungeKuttaTableau(
        a=(
            (),
            (1 / 5,),
            (3 / 40, 9 / 40),
            (44 / 45, -56 / 15, 32 / 9),
            (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
            (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
        ),
        b=(35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
        c=(0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1),
        order=5,
        error=(-71 / 57600, 0, 71 / 16695, -71 / 1920, 17253 / 339200, -22 / 525, 1 / 40),
        embedded_order=4,
    )
