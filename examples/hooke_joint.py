"""Two shafts at an angle, connected by a universal joint: a motor drives one, the other a viscous load.

    bearing       Revolute, ground and driving shaft          5 rows
    cross         Universal, driving and driven shaft         4 rows
    far bearing   PointOnLine, driven shaft and ground        2 rows: 11 for 12 degrees of freedom

The speed ratio is s = w2 / w1 = cos(bend) / (1 - sin(bend)^2 sin(theta)^2), with theta the angle of the driving shaft
from where its arm is perpendicular to both shafts. The equation of motion is

    (J1 + J2 s^2) thetadd + J2 s s' thetad^2 = torque - damping s^2 thetad

Run it: python examples/hooke_joint.py
"""

import numpy as np
from scipy.integrate import solve_ivp

import tsdyn as ts

BEND = 0.7  # rad
J1, J2 = 0.02, 0.03  # kg m^2, of driving and driven shaft about their lines
TORQUE, DAMPING, RATE = 0.9, 0.08, 4.0  # N m, N m s, rad/s
LINE = np.array([np.cos(BEND), np.sin(BEND), 0.0])  # of the driven shaft


def build():
    """Return the scene; the driving shaft lies along x and turns at 4 rad/s."""
    scene = ts.Scene()
    driving = scene.add_body(
        2.0, (J1, 0.05, 0.05), position=(-0.4, 0, 0), angular_velocity=(RATE, 0, 0), name="driving shaft"
    )
    driven = scene.add_body(
        3.0,
        (J2, 0.06, 0.06),
        position=0.4 * LINE,
        orientation=(np.cos(BEND / 2), 0.0, 0.0, np.sin(BEND / 2)),
        angular_velocity=(RATE * np.cos(BEND), 0, 0),
        name="driven shaft",
    )
    scene.add(ts.constraints.Revolute.at(scene.ground, driving, point=(-0.4, 0, 0), axis=(1, 0, 0), name="bearing"))
    # the arm in the driving shaft is along z; the one in the driven shaft is across that and its line
    scene.add(ts.constraints.Universal.at(driving, driven, point=(0, 0, 0), axis=(0, 0, 1), name="cross"))
    scene.add(ts.constraints.PointOnLine.at(driven, scene.ground, point=0.8 * LINE, axis=LINE, name="far bearing"))
    scene.add(ts.forces.Torque(driving, torque=(TORQUE, 0.0, 0.0), name="motor"))
    scene.add(ts.forces.ViscousFriction(driven, scene.ground, torsional_damping=DAMPING, name="load"))
    return scene


def ratio(theta):
    """w2 / w1 and its derivative by theta."""
    below = 1.0 - (np.sin(BEND) * np.sin(theta)) ** 2
    return np.cos(BEND) / below, np.cos(BEND) * np.sin(BEND) ** 2 * np.sin(2.0 * theta) / below**2


def gain(theta, rate):
    """Angular acceleration of the driving shaft."""
    s, slope = ratio(theta)
    return (TORQUE - DAMPING * s**2 * rate - J2 * s * slope * rate**2) / (J1 + J2 * s**2)


def reference(times):
    """The driving shaft's turn and its rate, (k,) each, by SciPy at 1e-12."""

    def rates(t, y):
        return [y[1], gain(y[0], y[1])]

    return solve_ivp(rates, (0.0, times[-1]), [0.0, RATE], "DOP853", times, rtol=1e-12, atol=1e-12).y


def turn(solution):
    """The turn of the driving shaft, rad, counted over turns."""
    return solution.angle("bearing")


def speeds(solution):
    """w1 and w2, (k,) each."""
    return (solution.angular_velocity(body)[:, 0] for body in solution.scene.bodies)


def check(solution, tol=1e-9):
    """The turn to tol; Hooke's ratio to rounding; the torque through the cross to a thousand times tol of itself."""
    solution.raise_if_failed()
    theta, rate = reference(solution.t)
    assert np.abs(turn(solution) - theta).max() < tol
    w1, w2 = speeds(solution)
    assert np.abs(w2 / w1 - ratio(turn(solution))[0]).max() < 1e-12
    s, slope = ratio(theta)
    through = J2 * (s * gain(theta, rate) + slope * rate**2) + DAMPING * s * rate
    _, torque = solution.reaction("cross", on="driven shaft")
    assert np.abs(torque @ LINE - through).max() < 1e3 * tol * np.abs(through).max()
    assert solution.constraint_error.position.max() < 1e-14


def main():
    """Run it for 3 s and print how uneven the driven shaft's turning is."""
    solution = ts.simulate(build(), (0.0, 3.0), integrator=ts.integrators.DOP853(rtol=1e-11, atol=1e-11))
    check(solution)
    print(solution)
    w1, w2 = speeds(solution)
    print(f"  ratio of speeds from {(w2 / w1).min():.4f} to {(w2 / w1).max():.4f}")
    theta, _ = reference(solution.t)
    print(f"  {turn(solution)[-1] / (2 * np.pi):.2f} turns of the driving shaft")
    print(f"  distance from SciPy {np.abs(turn(solution) - theta).max():.1e} rad")


if __name__ == "__main__":
    main()
