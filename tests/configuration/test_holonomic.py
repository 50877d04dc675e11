"""Rows that are not holonomic: the checker refuses them, and no form runs them wrongly."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts
from tests.helpers.tolerances import FAIR


class KnifeEdge(ts.Primitive):
    """n . xd_a = 0: the blade's point moves along the blade only. There is no phi."""

    rows = 1
    markers = (ts.Point("a"), ts.Vector("a"))

    def __init__(self, a, *, point_a=(0, 0, 0), axis_a=None, name=""):
        super().__init__(a, None, (point_a, axis_a), name)

    @staticmethod
    def phi(x, par, t, out):
        out[0] = 0.0

    @staticmethod
    def jacobian(x, par, t, out):
        for i in range(3):
            out[0, i] = x[3 + i]

    @staticmethod
    def gamma(x, xd, par, t, out):
        out[0] = xd[3] * xd[0] + xd[4] * xd[1] + xd[5] * xd[2]


def skate():
    scene = ts.Scene(gravity=(3.0, 0.0, -9.81))
    body = scene.add_body(2.0, (0.3, 0.3, 0.5), velocity=(1.0, 0, 0), angular_velocity=(0, 0, 1.3))
    scene.add(ts.constraints.PlaneContact(body, scene.ground, normal_b=(0, 0, 1)))
    scene.add(ts.constraints.Parallel(body, scene.ground, axis_a=(0, 0, 1), axis_b=(0, 0, 1)))
    scene.add(KnifeEdge(body, axis_a=(0, 1, 0), name="blade"))
    return scene


def test_the_checker_refuses_a_row_on_velocities():
    with pytest.raises(ts.testing.CheckFailed, match=r"KnifeEdge .*jacobian\[0, 0\].* is not holonomic"):
        ts.testing.check_primitive(KnifeEdge)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "form"),
    [("rk45", "null-space"), (None, "null-space"), ("rk45", "maggi-kane"), ("sdirk54", "tangent")],
)
def test_forms_with_a_basis_refuse_it(method, form):
    with pytest.raises(ts.InvalidConstraint, match="blade: row 0 of its jacobian is not the derivative of its phi"):
        ts.simulate(skate(), (0.0, 1.0), integrator=method, formulation=form)


@pytest.mark.slow
def test_the_tangent_form_runs_it_right():
    turn = 1.3

    def slide(t, y):
        return 3.0 * np.cos(turn * t), y[0] * np.cos(turn * t), y[0] * np.sin(turn * t)

    right = solve_ivp(slide, (0.0, 1.0), (1.0, 0.0, 0.0), rtol=1e-11, atol=1e-12).y[1:, -1]
    solution = ts.simulate(skate(), (0.0, 1.0))
    assert np.abs(solution.q[-1, :2] - right).max() < FAIR
