"""A door on three hinges with a common axis off the vertical: it swings under its own weight.

    hinges    three Revolute, ground and door: 15 rows on one body, 5 of them independent

The weight carried by each hinge is statically indeterminate, and the solution reports it as such; the total is unique.
The angle theta from the lowest position obeys J theta'' = -m g d sin(lean) sin(theta), J about the axis.

Run it: python examples/door.py
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import tsdyn as ts

MASS, WIDTH, HEIGHT = 30.0, 0.9, 2.0  # kg, m, m
LEAN, START, GRAVITY = 0.1, 2.5, 9.81  # rad, rad, m/s^2
INERTIA = MASS / 12 * np.array([HEIGHT**2, HEIGHT**2 + WIDTH**2, WIDTH**2])  # a plate: x across, z along the hinges
ABOUT_HINGES = INERTIA[2] + MASS * WIDTH**2 / 4
AXIS = np.array([np.sin(LEAN), 0.0, np.cos(LEAN)])


def build():
    """Return the scene; the door is let go of half open."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    turn = Rotation.from_rotvec(START * AXIS) * Rotation.from_rotvec((0.0, LEAN, 0.0))
    door = scene.add_body(MASS, INERTIA, turn.apply((WIDTH / 2, 0.0, 0.0)), turn, name="door")
    for height in (-0.8, 0.1, 0.8):
        place = height * AXIS
        scene.add(ts.constraints.Revolute.at(scene.ground, door, point=place, axis=AXIS, name=f"hinge at {height} m"))
    return scene


def reference(times):
    """The turn and its rate, (k,) each, by SciPy at 1e-12."""
    gain = MASS * GRAVITY * WIDTH / 2 * np.sin(LEAN) / ABOUT_HINGES

    def rates(t, y):
        return [y[1], -gain * np.sin(y[0])]

    return solve_ivp(rates, (0.0, times[-1]), [START, 0.0], "DOP853", times, rtol=1e-12, atol=1e-12).y


def turn(solution):
    """The door's turn, rad."""
    return START + solution.angle("hinge at 0.1 m")


def lowest(t, state):
    """The turn: zero where the door hangs lowest."""
    return START + state.angle("hinge at 0.1 m")


def check(solution, tol=1e-9):
    """The turn to tol; all hinges together carry what the door's motion asks for; none alone is said to be unique."""
    solution.raise_if_failed()
    assert solution.constraint_error.position.max() < 1e-14
    theta, _ = reference(solution.t)
    assert np.abs(turn(solution) - theta).max() < tol
    hinges = solution.scene.constraints[:3]
    carried = sum(solution.reaction(hinge)[0] for hinge in hinges)
    needed = MASS * (solution.acceleration("door") + np.array([0.0, 0.0, GRAVITY]))
    assert np.abs(carried - needed).max() < 1e-12 * np.abs(needed).max()
    assert not any(solution.reaction_unique(hinge).any() for hinge in hinges)
    assert (np.isnan(solution.multipliers).sum(axis=1) == 10).all()


def main():
    """Let it swing for 10 s and print how good it is."""
    solution = ts.simulate(build(), (0.0, 10.0), integrator="dop853", rtol=1e-11, atol=1e-11, events=lowest)
    check(solution)
    print(solution, f"  hangs lowest at {np.round(solution.t_events[0], 6)} s", sep="\n")
    print(f"  distance from SciPy {np.abs(turn(solution) - reference(solution.t)[0]).max():.1e} rad")


if __name__ == "__main__":
    main()
