"""A spatial slider-crank without redundant rows: the crank makes full turns and drives a piston.

    bearing      Revolute, ground and crank          5 rows
    crank pin    Spherical, crank and rod            3 rows
    wrist pin    Universal, piston and rod           4 rows: the rod rotates about the pin but can't spin about its axis
    guide        Translational, ground and piston    5 rows: 17 for 18 degrees of freedom

The check compares with the single equation of the crank angle theta, from the x axis towards z:

    r sin(theta) = L sin(phi),  x = r cos(theta) + L cos(phi)                     rod angle and piston
    M(theta) thetadd + M'(theta) thetad^2 / 2 = -V'(theta),  2 T = M thetad^2     Lagrange

Run it: python examples/slider_crank.py
"""

import numpy as np
from scipy.integrate import solve_ivp

import tsdyn as ts

R, L, GRAVITY = 0.15, 0.4, 9.81  # m, m, m/s^2
CRANK, ROD, PISTON = 2.0, 1.2, 0.8  # kg; crank and rod have their centroids in their middles
CRANK_INERTIA, ROD_INERTIA = 0.02, 0.016  # kg m^2, about y at the centroid
START, RATE = 0.4, 12.0  # rad, rad/s
TILT = 1e-20  # of complex steps


def along(angle):
    """The direction at an angle from x towards z, and the Euler parameters that turn x there."""
    return np.array([np.cos(angle), 0.0, np.sin(angle)]), (np.cos(angle / 2), 0.0, -np.sin(angle / 2), 0.0)


def build():
    """Return the scene, the crank turning at 12 rad/s."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    arm, crank_turn = along(START)
    line, rod_turn = along(-np.arcsin(R / L * np.sin(START)))
    pin = R * arm
    wrist = pin + L * line
    shape = (0.3, 1.0, 1.0)
    crank = scene.add_body(CRANK, CRANK_INERTIA * np.array(shape), pin / 2, crank_turn, name="crank")
    rod = scene.add_body(ROD, ROD_INERTIA * np.array(shape), (pin + wrist) / 2, rod_turn, name="rod")
    piston = scene.add_body(PISTON, (1e-3, 1e-3, 1e-3), wrist, name="piston")
    scene.add(ts.constraints.Revolute.at(scene.ground, crank, point=(0, 0, 0), axis=(0, -1, 0), name="bearing"))
    scene.add(ts.constraints.Spherical.at(crank, rod, point=pin, name="crank pin"))
    scene.add(ts.constraints.Universal.at(piston, rod, point=wrist, axis=(0, 1, 0), name="wrist pin"))
    scene.add(ts.constraints.Translational.at(scene.ground, piston, point=wrist, axis=(1, 0, 0), name="guide"))
    speeds, rates = velocities(START, RATE)
    for body, speed, rate in zip(scene.bodies, speeds, rates, strict=True):
        body.velocity, body.angular_velocity = (speed[0], 0.0, speed[1]), (0.0, -rate, 0.0)
    return scene


def slopes(theta):
    """d(x, z) / d theta of the three centroids, and d(angle) / d theta of the bodies; theta may be complex."""
    sin, cos = np.sin(theta), np.cos(theta)
    sin_phi = R / L * sin
    cos_phi = np.sqrt(1.0 - sin_phi * sin_phi)
    turn = -R / L * cos / cos_phi  # of the rod: its angle is -phi
    crank = -R / 2 * sin, R / 2 * cos
    rod = -R * sin + L / 2 * sin_phi * turn, R * cos + L / 2 * cos_phi * turn
    piston = -R * sin + L * sin_phi * turn, 0.0 * theta
    return (crank, rod, piston), (1.0, turn, 0.0)


def velocities(theta, rate):
    """Velocities (x, z) of the centroids and rates of the angles."""
    points, turns = slopes(theta)
    return [(x * rate, z * rate) for x, z in points], [turn * rate for turn in turns]


def acceleration(theta, rate):
    """The crank's angular acceleration, and (x, z) accelerations of the centroids."""
    points, turns = slopes(theta)
    curved = [(x.imag / TILT, z.imag / TILT) for x, z in slopes(theta + 1j * TILT)[0]]
    bend = slopes(theta + 1j * TILT)[1][1].imag / TILT
    inertia = CRANK_INERTIA + ROD_INERTIA * turns[1] ** 2
    half_slope = ROD_INERTIA * turns[1] * bend
    load = 0.0
    for mass, (x, z), (xx, zz) in zip((CRANK, ROD, PISTON), points, curved, strict=True):
        inertia = inertia + mass * (x * x + z * z)
        half_slope = half_slope + mass * (x * xx + z * zz)
        load = load - mass * GRAVITY * z
    gain = (load - half_slope * rate**2) / inertia
    return gain, [
        (x * gain + xx * rate**2, z * gain + zz * rate**2) for (x, z), (xx, zz) in zip(points, curved, strict=True)
    ]


def reference(times):
    """The crank's angle and its rate, (k,) each, by SciPy at 1e-12."""

    def rates(t, y):
        return [y[1], acceleration(y[0], y[1])[0]]

    return solve_ivp(rates, (0.0, times[-1]), [START, RATE], "DOP853", times, rtol=1e-12, atol=1e-12).y


def angle(solution):
    """The crank's angle, rad, counted over turns."""
    return START + solution.angle("bearing")


def dead_centre(t, state):
    """The piston's speed, m/s: it falls through zero where the piston is furthest out."""
    return state.displacement_rate("guide")


dead_centre.direction = -1


def check(solution, tol=1e-9):
    """The crank's angle and the piston's place to tol, the bearing's force to a thousand times that of itself."""
    solution.raise_if_failed()
    assert solution.constraint_error.position.max() < 1e-14
    theta, rate = reference(solution.t)
    assert np.abs(angle(solution) - theta).max() < tol
    place = R * np.cos(theta) + np.sqrt(L**2 - (R * np.sin(theta)) ** 2)
    assert np.abs(solution.position("piston") - np.outer(place, (1, 0, 0))).max() < tol
    accelerations = acceleration(theta, rate)[1]
    push = sum(mass * x for mass, (x, _) in zip((CRANK, ROD, PISTON), accelerations, strict=True))
    force, _ = solution.reaction("bearing")  # the guide carries nothing along x
    assert np.abs(force[:, 0] - push).max() < 1e3 * tol * np.abs(push).max()


def main():
    """Run it for 2 s and print how good it is."""
    solution = ts.simulate(build(), (0.0, 2.0), integrator="dop853", rtol=1e-11, atol=1e-11, events=dead_centre)
    check(solution)
    print(solution)
    theta, _ = reference(solution.t)
    print(f"  {np.ptp(angle(solution)) / (2 * np.pi):.2f} turns of the crank")
    print(f"  the piston is furthest out at {np.round(solution.t_events[0], 6)} s")
    print(f"  distance from SciPy {np.abs(angle(solution) - theta).max():.1e} rad")


if __name__ == "__main__":
    main()
