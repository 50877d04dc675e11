"""Chebyshev's lambda linkage: a crank that turns steadily guides a point along an almost straight line, and back fast.

Crank 1, coupler 2.5 + 2.5, rocker 2.5, distance of the feet 2. A motor drives the crank, so nothing is left to
integrate: `scene.kinematics` gives the motion, the reactions and the motor's torque.

Run it: python examples/chebyshev_linkage.py
"""

import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts

UNIT, RATE, START = 0.1, 2.0, np.pi / 2  # m, rad/s, rad
CRANK, ARM, BASE = UNIT, 2.5 * UNIT, 2.0 * UNIT


def guided(angle):
    """The knee (2, k), and the guided point (2, k), at angles of the crank (k,)."""
    pin = CRANK * np.array([np.cos(angle), np.sin(angle)])
    d = np.array([BASE + 0 * angle, 0 * angle]) - pin
    square = (d**2).sum(axis=0)
    side = np.sqrt(ARM**2 / square - 0.25) * np.array([-d[1], d[0]])
    knee = pin + d / 2 + side
    return knee, 2.0 * knee - pin


def link(scene, first, last, name):
    """Add a bar between two points (x, y), and return it."""
    first, last = np.append(first, 0.0), np.append(last, 0.0)
    along = last - first
    shape = ts.shapes.box((np.linalg.norm(along), 0.1 * UNIT, 0.05 * UNIT), density=2700)
    turn = Rotation.from_rotvec((0.0, 0.0, np.arctan2(along[1], along[0])))
    return scene.add_body(**shape, position=(first + last) / 2, orientation=turn, name=name)


def build():
    """Return the scene; the motor turns at RATE."""
    scene, axis = ts.Scene(gravity=(0.0, -9.81, 0.0)), (0, 0, 1)
    pin, (knee, point) = CRANK * np.array([np.cos(START), np.sin(START)]), guided(START)
    crank, coupler = link(scene, (0.0, 0.0), pin, "crank"), link(scene, pin, point, "coupler")
    rocker = link(scene, (BASE, 0.0), knee, "rocker")
    places = {"foot": (scene.ground, crank, (0, 0)), "pin": (crank, coupler, pin), "knee": (coupler, rocker, knee)}
    places["far foot"] = rocker, scene.ground, (BASE, 0)
    for name, (a, b, place) in places.items():
        scene.add(ts.constraints.Revolute.at(a, b, point=(*place, 0), axis=axis, name=name))
    scene.add(ts.constraints.RotationMotor.of(scene["foot"], angle=RATE * ts.motions.time, name="motor"))
    return scene


def path(solution):
    """The guided point, (k, 2), m."""
    return solution.position("coupler", point=(ARM, 0.0, 0.0))[:, :2]


def check(solution):
    """The path of the closed form to rounding; half a turn is straight to 1 % of its length."""
    solution.raise_if_failed()
    angle = START + RATE * solution.t
    assert np.abs(path(solution) - guided(angle)[1].T).max() < 1e-14
    straight = path(solution)[np.cos(angle) < 0]
    assert np.ptp(straight[:, 1]) < 0.01 * np.ptp(straight[:, 0])
    assert np.ptp(straight[:, 0]) > 3.5 * UNIT


def main():
    """Analyse a turn and print the motor's torque."""
    solution = build().kinematics(np.linspace(0.0, 2.0 * np.pi / RATE, 361))
    check(solution)
    print(solution)
    torque = solution.reaction("motor", on="crank")[1][:, 2]
    print(f"  the motor's torque is between {torque.min():.3f} and {torque.max():.3f} N m")


if __name__ == "__main__":
    main()
