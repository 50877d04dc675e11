"""Nystrom4: explicit Nystrom method of order 4, four stages, for accelerations that depend on velocity.

    stage   c     v                              vd
    1       0     v                              vd
    2       1/2   v + h/2 vd + h^2/8 k1          vd + h/2 k1
    3       1/2   the same                       vd + h/2 k2
    4       1     v + h vd + h^2/2 k3            vd + h k3
    step          v + h vd + h^2/6 (k1+k2+k3)    vd + h/6 (k1 + 2 k2 + 2 k3 + k4)

Stages 2 and 3 share one position: a step has three position solves, its end included, and four accelerations.
Nystrom 1925; Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.14, Eq. (14.13).
"""

from __future__ import annotations

from ..plugins import ExplicitNystrom, NystromTableau, RungeKuttaTableau


class Nystrom4(ExplicitNystrom):
    """The fourth-order explicit Nystrom method of Haug's paper, with a fixed step.

    Parameters
    ----------
    step : float, s; default 1e-3
        The last step of a run is shortened to end on time.

    Notes
    -----
    With formulation="maggi-kane" it is its first-order equivalent, the classical Runge-Kutta method.

    Examples
    --------
    Half the step leaves a sixteenth of the error:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> ball = scene.add_point_mass(mass=1.0, position=(1, 0, 0))
    >>> rod = scene.add(ts.constraints.Distance(ball, scene.ground))
    >>> methods = [ts.integrators.Taylor(), *(ts.integrators.Nystrom4(step=h) for h in (0.008, 0.004))]
    >>> exact, coarse, fine = (ts.simulate(scene, (0, 2), integrator=m).q[-1] for m in methods)
    >>> bool(14 < abs(coarse - exact).max() / abs(fine - exact).max() < 18)
    True
    """

    order = 4
    tableau = NystromTableau(
        a=((), (1 / 2,), (0, 1 / 2), (0, 0, 1)),
        abar=((), (1 / 8,), (1 / 8, 0), (0, 0, 1 / 2)),
        b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
        bbar=(1 / 6, 1 / 6, 1 / 6, 0),
        c=(0, 1 / 2, 1 / 2, 1),
        order=4,
    )
    first_order = RungeKuttaTableau(
        a=((), (1 / 2,), (0, 1 / 2), (0, 0, 1)), b=(1 / 6, 1 / 3, 1 / 3, 1 / 6), c=(0, 1 / 2, 1 / 2, 1), order=4
    )

    def __init__(self, step: float = 1e-3) -> None:
        super().__init__(step)
