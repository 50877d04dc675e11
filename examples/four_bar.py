"""A planar four-bar of four spatial Revolute joints: three redundant rows, without special treatment by the user.

    bearing, crank pin, rocker pin, far bearing    Revolute, 5 rows each: 20 for 18 degrees of freedom, 17 independent

Every joint keeps the links in their plane, so three rows are redundant and are dropped. The bending moments in the
joints are statically indeterminate, and the solution reports them as such.

The check compares with the single equation of the crank angle theta,

    M(theta) thetadd + M'(theta) thetad^2 / 2 = -V'(theta),  2 T = M thetad^2     Lagrange

Run it: python examples/four_bar.py
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import tsdyn as ts

CRANK, COUPLER, ROCKER, GROUND = 0.3, 0.9, 0.7, 0.8  # m; the crank goes round
MASSES, INERTIAS = (1.0, 2.0, 1.5), (0.01, 0.15, 0.07)  # kg; kg m^2 about the joints' axis at the middle of each link
GRAVITY, START, RATE = 9.81, 0.6, 9.0  # m/s^2, rad, rad/s
AXIS, ACROSS = np.eye(3)[[2, 0]]  # the plane of the links is that of x and y, gravity along -y
TILT = 1e-20  # of complex steps


def corners(theta):
    """The crank pin and the rocker pin (x, y), theta may be complex; the rocker pin is on the left of the diagonal."""
    x, y = CRANK * np.cos(theta), CRANK * np.sin(theta)
    dx, dy = GROUND - x, -y
    square = dx * dx + dy * dy
    along = (COUPLER**2 - ROCKER**2 + square) / (2.0 * square)
    beside = np.sqrt(COUPLER**2 / square - along * along)
    return (x, y), (x + along * dx - beside * dy, y + along * dy + beside * dx)


def slopes(theta):
    """d / d theta of the middles (x, y) of the links and of their angles."""
    (x, y), (u, v) = corners(theta)
    px, py, rx, ry = u - x, v - y, u - GROUND, v
    det = py * rx - px * ry  # the rocker pin's velocity, as the coupler and as the rocker have it
    coupler = (x * ry - y * rx) / det
    rocker = (x * py - y * px) / det
    pin = -y, x
    middle = pin[0] - coupler * py / 2, pin[1] + coupler * px / 2
    return ((pin[0] / 2, pin[1] / 2), middle, (-rocker * ry / 2, rocker * rx / 2)), (1.0, coupler, rocker)


def gain(theta, rate):
    """The crank's angular acceleration."""
    points, turns = slopes(theta)
    bent_points, bent_turns = slopes(theta + 1j * TILT)
    inertia = half_slope = load = 0.0
    for m, J, (x, y), turn, (bx, by), bend in zip(
        MASSES, INERTIAS, points, turns, bent_points, bent_turns, strict=True
    ):
        inertia = inertia + m * (x * x + y * y) + J * turn * turn
        half_slope = half_slope + (m * (x * bx.imag + y * by.imag) + J * turn * np.imag(bend)) / TILT
        load = load - m * GRAVITY * y
    return (load - half_slope * rate**2) / inertia


def build(axis=AXIS, across=ACROSS):
    """Return the scene; the links are in the plane across an axis, across is the direction of the ground's link."""
    up = np.cross(axis, across)
    frame = np.stack([across, up, axis], axis=1)
    scene = ts.Scene(gravity=-GRAVITY * up)
    (x, y), (u, v) = corners(START)
    places = np.array([(0, 0), (x, y), (u, v), (GROUND, 0)]) @ np.stack([across, up])
    speeds, rates = slopes(START)
    for i, name in enumerate(("crank", "coupler", "rocker")):
        first, last = places[i : i + 2]
        along = (last - first) / np.linalg.norm(last - first)
        turn = np.stack([along, np.cross(axis, along), axis], axis=1)
        scene.add_body(
            MASSES[i],
            INERTIAS[i] * np.array([0.1, 1.0, 1.0]),
            (first + last) / 2,
            Rotation.from_matrix(turn),
            RATE * (frame[:, :2] @ np.array(speeds[i])),
            (0.0, 0.0, RATE * rates[i]),
            name,
        )
    links = (scene.ground, *scene.bodies, scene.ground)
    for i, name in enumerate(("bearing", "crank pin", "rocker pin", "far bearing")):
        scene.add(ts.constraints.Revolute.at(links[i], links[i + 1], point=places[i], axis=axis, name=name))
    return scene


def reference(times):
    """The crank's angle and its rate, (k,) each, by SciPy at 1e-12."""

    def rates(t, y):
        return [y[1], gain(y[0], y[1])]

    return solve_ivp(rates, (0.0, times[-1]), [START, RATE], "DOP853", times, rtol=1e-12, atol=1e-12).y


def angle(solution):
    """The crank's angle, rad, counted over turns."""
    return START + solution.angle("bearing")


def check(solution, tol=1e-9):
    """The crank's angle to tol; every row at rounding, those that were left out too; what is not unique is named."""
    solution.raise_if_failed()
    assert np.abs(angle(solution) - reference(solution.t)[0]).max() < tol
    error = solution.constraint_error
    assert error.position.max() < 1e-14
    assert error.velocity.max() < 1e-13
    assert error.acceleration.max() < 1e-11
    assert (np.isnan(solution.multipliers).sum(axis=1) == 3).all()
    joints = solution.scene.constraints[:4]
    assert not any(solution.reaction_unique(joint).any() for joint in joints)


def main():
    """Run it for 2 s and print how good it is."""
    solution = ts.simulate(build(), (0.0, 2.0), integrator=ts.integrators.DOP853(rtol=1e-11, atol=1e-11))
    check(solution)
    print(solution)
    theta, _ = reference(solution.t)
    print(f"  {(theta[-1] - theta[0]) / (2 * np.pi):.2f} turns of the crank")
    print(f"  distance from SciPy {np.abs(angle(solution) - theta).max():.1e} rad")


if __name__ == "__main__":
    main()
