"""The compass walker against minimal coordinates and impulse-momentum, and against its published gait."""

import numpy as np
from scipy.integrate import solve_ivp

import tsdyn as ts
from examples import compass_walker as walker
from tests.helpers.tolerances import CLOSE, FAIR

MASSES = np.repeat((1.0, walker.FOOT), 2)  # of the hip, and of the swing foot; x and z each
GAIT = -0.190 + 0.558j  # published, of feet without mass


def places(angle, between):
    """Jacobian (4, 2) of hip and swing foot by the angles of the stance leg and between the legs; its derivative."""

    def arm(a):
        return np.array((-np.cos(a), -np.sin(a))), np.array((np.sin(a), -np.cos(a)))

    (hip, hip_2), (leg, leg_2) = arm(angle), arm(angle - between)  # x = (-sin, cos), less that of the swing leg
    J, J_2 = np.zeros((4, 2)), np.zeros((3, 4))
    J[:2, 0] = hip
    J[2:, 0], J[2:, 1] = hip - leg, leg
    J_2[0, :2] = J_2[0, 2:] = hip_2
    J_2[1, 2:] = -leg_2
    return J, J_2


def step(angle, rate):
    """Angle and rate of the stance leg after the next heel strike, and the time."""
    load = MASSES * np.tile((np.sin(walker.SLOPE), -np.cos(walker.SLOPE)), 2)

    def motion(t, y):
        J, (hip, leg, _) = places(*y[:2])
        bias = hip * y[2] ** 2 + leg * (y[2] - y[3]) ** 2
        return [*y[2:], *np.linalg.solve(J.T @ (MASSES[:, None] * J), J.T @ (load - MASSES * bias))]

    def strike(t, y):
        return y[1] - 2.0 * y[0] + (y[0] > 0.0)

    strike.direction, strike.terminal = 0, True
    start = [angle, 2.0 * angle, rate, (1.0 - np.cos(2.0 * angle)) * rate]
    options = {"rtol": 1e-13, "atol": 1e-14, "method": "DOP853"}
    middle = solve_ivp(motion, (0, 3.0), start, **options).y[:, -1]
    run = solve_ivp(motion, (3.0, 6.0), middle, events=strike, **options)
    y = run.y_events[0][0]
    # The swing foot stands still: momenta of the other foot, now the swing foot, and of the hip in the new coordinates
    J, _ = places(*y[:2])
    v = np.concatenate(((J @ y[2:])[:2], (0.0, 0.0)))
    after, _ = places(-y[0], -y[1])
    rates = np.linalg.solve(after.T @ (MASSES[:, None] * after), after.T @ (MASSES * v))
    return -y[0], rates[0], run.t_events[0][0]


def test_steps_are_those_of_minimal_coordinates():
    solution = ts.simulate(
        walker.build(), (0.0, 12.0), events=walker.HeelStrike(), dense_output=True, rtol=1e-12, atol=1e-12
    )
    angle, rate, end = walker.ANGLE, walker.RATE, 0.0
    for found, (t, _, _) in zip(walker.gait(solution), solution.impulses, strict=True):
        angle, rate, time = step(angle, rate)
        end += time
        assert abs(t - end) < CLOSE
        assert np.abs(found - (angle, rate)).max() < CLOSE


def test_the_gait_and_its_multipliers():
    """The map of a step at its fixed point has the published eigenvalues, to the mass of the feet."""
    solution = walker.walk(100.0)
    walker.check(solution)
    gait = walker.gait(solution)[-1]
    assert np.abs(gait - step(*gait)[:2]).max() < FAIR

    def after(angle, rate):
        run = ts.simulate(walker.build(angle, rate), (0.0, 5.0), events=walker.HeelStrike(), dense_output=True)
        return walker.gait(run)[0]

    h = 1e-4
    columns = [(after(*(gait + d)) - after(*(gait - d))) / (2 * h) for d in h * np.eye(2)]
    found = np.linalg.eigvals(np.stack(columns, axis=1))
    assert np.abs(found[found.imag > 0] - GAIT).max() < 2e-3
