"""A five-bar robot draws a circle: its two motors by inverse dynamics, and a run with these torques.

Two cranks on the ground and two rods that meet in the hand: a closed loop with two degrees of freedom.

Run it: python examples/inverse_dynamics.py
"""

import numpy as np
from scipy.interpolate import CubicSpline

import tsdyn as ts

LEFT, RIGHT, HAND = np.array([-0.15, 0.0, 0.0]), np.array([0.15, 0.0, 0.0]), np.array([0.0, 0.0, 0.45])
ELBOWS = np.array([-0.25, 0.0, 0.22]), np.array([0.25, 0.0, 0.22])
TIP = (float(np.linalg.norm(HAND - ELBOWS[0])) / 2, 0.0, 0.0)  # the hand on the left rod
MIDDLE, RADIUS, RATE = HAND - (0.0, 0.0, 0.05), 0.05, 2.0 * np.pi  # m, rad/s
AXIS = (0.0, 1.0, 0.0)


def link(scene, first, last, mass, name):
    """Add a rod between two points."""
    along = last - first
    angle = np.arctan2(-along[2], along[0])
    rod = ts.shapes.rod(np.linalg.norm(along), axis="x", mass=mass)
    return scene.add_body(
        **rod, position=(first + last) / 2, orientation=(np.cos(angle / 2), 0, np.sin(angle / 2), 0), name=name
    )


def build():
    """Return the scene, the hand at the top of its circle."""
    scene = ts.Scene()
    sides = []
    for name, foot, elbow in (("left", LEFT, ELBOWS[0]), ("right", RIGHT, ELBOWS[1])):
        crank = link(scene, foot, elbow, 0.8, f"{name} crank")
        rod = link(scene, elbow, HAND, 0.5, f"{name} rod")
        scene.add(ts.constraints.Revolute.at(scene.ground, crank, point=foot, axis=AXIS, name=f"{name} motor"))
        scene.add(ts.constraints.Revolute.at(crank, rod, point=elbow, axis=AXIS, name=f"{name} elbow"))
        sides.append(rod)
    scene.add(ts.constraints.Revolute.at(*sides, point=HAND, axis=AXIS, name="hand"))
    return scene


def path():
    """Return the motion of the hand: x and z of a circle, whose y the linkage holds."""
    wave = ts.motions.Sine
    return wave(RADIUS, RATE, 0.0, MIDDLE[0]), 0.0, wave(RADIUS, RATE, np.pi / 2, MIDDLE[2])


def solve(times):
    """Return the result of inverse dynamics: torques of both motors along the circle."""
    scene = build()
    rod = scene["left rod"]
    return scene.inverse_dynamics({(rod, TIP): path()}, ["left motor", "right motor"], times)


def drive(found):
    """Return a run of the same scene under the torques of a result, as splines over time."""
    scene = build()
    scene.place(found.q[0], found.qd[0])
    for name in ("left", "right"):
        torque = found.load(f"{name} motor")[:, None] * np.array(AXIS)
        scene.add(ts.forces.Torque(scene[f"{name} crank"], torque=CubicSpline(found.t, torque)))
    return ts.simulate(scene, (found.t[0], found.t[-1]), t_eval=found.t[[0, -1]], rtol=1e-11, atol=1e-11)


def check(found, run):
    """The hand is on its circle, power is that of the motors, and the run ends where the motion does."""
    hand = found.position("left rod", point=TIP)
    assert np.abs(np.linalg.norm(hand - MIDDLE, axis=1) - RADIUS).max() < 1e-13
    assert found.residual.max() < 1e-11
    assert np.abs(run.q[-1] - found.q[-1]).max() < 1e-8
    assert np.abs(run.qd[-1] - found.qd[-1]).max() < 1e-7


def main():
    """Draw the circle in a second."""
    found = solve(np.linspace(0.0, 1.0, 1001))
    run = drive(found)
    check(found, run)
    print(found)
    print(f"  a run under these torques ends {np.abs(run.q[-1] - found.q[-1]).max():.1e} from the motion")


if __name__ == "__main__":
    main()
