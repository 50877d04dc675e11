"""Implicit methods where stiffness goes within a step: a brake lets go, friction breaks loose.

With the derivatives of before corrections are small, whatever is left: a stage counts as solved when they contract.
"""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts

pytestmark = pytest.mark.slow  # kernels of implicit methods
I = ts.integrators
METHODS = {
    "default": lambda tol: {"rtol": tol, "atol": tol},
    **{
        f"Radau {order}": lambda tol, order=order: {"integrator": I.Radau(tol, tol, order=order)}
        for order in (5, 9, 13)
    },
    "SDIRK54": lambda tol: {"integrator": I.SDIRK54(tol, tol)},
    "trapezoid": lambda tol: {"integrator": I.ImplicitTrapezoid(tol, tol)},
}
PULL = 5.0  # N, on 1 kg


def brake(t, a, b, par, out):
    out[0] = PULL - par[0] * a[7] * 0.5 * (1.0 - np.tanh((t - 0.5) / 0.01))


def pushed(t):
    return (8.0 * np.sin(2.0 * t), 0.0, 0.0)


def braked(damping):
    """A brake of so many N s/m is let go at 0.5 s."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    mass = scene.add_point_mass(1.0)
    scene.add(ts.forces.UserForce(mass, function=brake, parameters=(damping,)))
    return scene


def rubbing(slip):
    """A mass sticks until the push exceeds 5 N, and slides."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    mass = scene.add_point_mass(1.0)
    scene.add(ts.forces.CoulombFriction(mass, scene.ground, force=PULL, slip_velocity=slip))
    scene.add(ts.forces.PointForce(mass, force=pushed))
    return scene


@cache
def reference(make, parameter, end):
    """Place and velocity by SciPy."""

    def let_go(t):
        return 0.5 * (1.0 - np.tanh((t - 0.5) / 0.01))

    def rates(t, y):
        if make is braked:
            return y[1], PULL - parameter * y[1] * let_go(t)
        return y[1], 8.0 * np.sin(2.0 * t) - PULL * y[1] / np.hypot(y[1], parameter)

    def slopes(t, y):
        by_rate = -parameter * let_go(t) if make is braked else -PULL * parameter**2 / np.hypot(y[1], parameter) ** 3
        return [[0.0, 1.0], [0.0, by_rate]]

    options = {"rtol": 1e-10, "atol": 1e-13, "max_step": 0.01}
    return solve_ivp(rates, (0.0, end), (0.0, 0.0), "Radau", jac=slopes, **options).y[:, -1]


@pytest.mark.parametrize("tol", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("make", "parameter", "end"), [(braked, 5e4, 1.0), (braked, 5e8, 1.0), (rubbing, 1e-4, 1.3), (rubbing, 1e-6, 1.3)]
)
def test_the_motion_goes_on(make, parameter, end, method, tol):
    solution = ts.simulate(make(parameter), (0.0, end), max_steps=4000, **METHODS[method](tol)).raise_if_failed()
    body, expected = solution.scene.bodies[0], reference(make, parameter, end)
    found = solution.position(body)[-1, 0], solution.velocity(body)[-1, 0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=2.0 * tol)
    force = PULL if make is braked else 8.0 * np.sin(2.0 * end) - PULL * found[1] / np.hypot(found[1], parameter)
    assert solution.acceleration(body)[-1, 0] == pytest.approx(force, abs=50.0 * tol)
