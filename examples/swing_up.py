"""A double pendulum on a cart swings up from rest and is kept upright, by one control law of the whole scene.

Upright, the gains are those of the linear-quadratic regulator: `linearise` gives A and B, SciPy solves the Riccati
equation. The way up is the way down, backwards: a spring and a damper on the cart bring the falling pendulum to rest,
and without friction the motion may be run in reverse. The regulator of the linearisations along it keeps it there.
"""

import numpy as np
from scipy.linalg import expm, solve_discrete_are

import tsdyn as ts

PERIOD = 0.01  # s, of the controller
FALL, REST = 11.0, 2.0  # s: the fall ends then; its last part, next to rest, is left out
SPACING = 5  # periods between two linearisations
COST, EFFORT = np.diag([20.0, 50.0, 50.0, 1.0, 1.0, 1.0]), np.array([[0.1]])
JOINTS = "hip", "knee"


def build():
    """The cart on its rail, and two rods of 0.5 m that stand upright."""
    scene = ts.Scene()
    cart = scene.add_body(**ts.shapes.box((0.3, 0.2, 0.1), mass=1.0), name="cart")
    lower = scene.add_body(**ts.shapes.rod(0.5, axis="z", mass=0.2), position=(0, 0, 0.25), name="lower")
    upper = scene.add_body(**ts.shapes.rod(0.5, axis="z", mass=0.2), position=(0, 0, 0.75), name="upper")
    scene.add(ts.constraints.Translational.at(scene.ground, cart, point=(0, 0, 0), axis=(1, 0, 0), name="rail"))
    scene.add(ts.constraints.Revolute.at(cart, lower, point=(0, 0, 0), axis=(0, 1, 0), name="hip"))
    scene.add(ts.constraints.Revolute.at(lower, upper, point=(0, 0, 0.5), axis=(0, 1, 0), name="knee"))
    return scene


def seen(state):
    """The coordinates and their rates, (6,), as `linearise` has them."""
    angles, rates = [state.angle(joint) for joint in JOINTS], [state.angle_rate(joint) for joint in JOINTS]
    return np.array([state.displacement("rail"), *angles, state.displacement_rate("rail"), *rates])


def sampled(A, B):
    """The same system from sample to sample, its input held in between."""
    n, m = B.shape
    whole = expm(PERIOD * np.block([[A, B], [np.zeros((m, n + m))]]))
    return whole[:n, :n], whole[:n, n:]


def regulator():
    """Gains (1, 6) that keep the pendulum upright, and the cost matrix (6, 6) of the time to come."""
    A, B = sampled(*build().linearise(inputs=["rail"]).state_space()[:2])
    P = solve_discrete_are(A, B, PERIOD * COST, PERIOD * EFFORT)
    return np.linalg.solve(PERIOD * EFFORT + B.T @ P @ B, B.T @ P @ A), P


def absorb(t, state):
    """A spring and a damper on the cart."""
    return -10.0 * state.displacement("rail") - 8.0 * state.displacement_rate("rail")


def way_up():
    """Forces (k,), states (k, 6) and linearisations of the way up, from sample to sample."""
    scene = build()
    scene.add(ts.forces.Control(absorb, ["rail"], name="absorber"))
    scene.set("hip", angle=0.02)
    scene.set("knee", angle=-0.01)
    times = np.arange(0.0, FALL + 0.5 * PERIOD, PERIOD)
    fall = ts.simulate(scene, (0, FALL), t_eval=times, rtol=1e-10, atol=1e-10).raise_if_failed()
    # Backwards: positions and forces are the same, velocities the opposite
    states = np.column_stack([fall.displacement("rail"), *map(fall.angle, JOINTS)])
    rates = np.column_stack([fall.displacement_rate("rail"), *map(fall.angle_rate, JOINTS)])
    first = round(REST / PERIOD)
    forces, path = fall.actuation("absorber")[::-1, 0][first:], np.hstack([states, -rates])[::-1][first:]
    q, qd = fall.q[::-1][first:], -fall.qd[::-1][first:]

    def force(t, state, *, u=0.0):
        return u

    model = build()
    model.add(ts.forces.Control(force, ["rail"], name="force"))
    places = [*range(0, len(q) - 1, SPACING), len(q) - 1]
    found = []
    for i in places:
        scene = model.with_parameters({"force.function.u": forces[i]})
        found.append(scene.linearise(ts.State(0.0, q[i], qd[i]), inputs=["rail"]).state_space()[:2])
    return forces, path, places, found


def gains_along(places, found):
    """Gains (k, 1, 6) from sample to sample by the Riccati recursion, the last one those upright."""
    last, P = regulator()
    every = np.arange(places[-1] + 1)
    A, B = (np.array([one[i] for one in found]) for i in (0, 1))
    gains = [last]
    for i in every[-2::-1]:
        j = min(np.searchsorted(places, i, side="right") - 1, len(places) - 2)
        share = (i - places[j]) / (places[j + 1] - places[j])
        a, b = sampled(A[j] + share * (A[j + 1] - A[j]), B[j] + share * (B[j + 1] - B[j]))
        K = np.linalg.solve(PERIOD * EFFORT + b.T @ P @ b, b.T @ P @ a)
        P = PERIOD * COST + a.T @ P @ (a - b @ K)
        gains.append(K)
    return np.array(gains[::-1])


def controlled():
    """The scene that hangs at rest, with its controller."""
    forces, path, places, found = way_up()
    gains = gains_along(places, found)

    def control(t, state):
        i = round(t / PERIOD)
        if i >= len(path) - 1:
            return -gains[-1] @ seen(state)
        return 0.5 * (forces[i] + forces[i + 1]) - gains[i] @ (seen(state) - path[i])

    scene = build()
    scene.set("hip", angle=np.pi)
    scene.set("knee", angle=2 * np.pi)
    scene.add(ts.forces.Control(control, ["rail"], period=PERIOD, name="controller"))
    return scene


def check(solution):
    """It hangs, swings up within the length of its rail and stands."""
    assert solution.position("upper")[0, 2] < -0.74
    assert np.abs(solution.displacement("rail")).max() < 0.5
    late = solution.t > 13.0
    assert max(np.abs(solution.angle(joint)[late]).max() for joint in JOINTS) < 1e-3


def main():
    """Swing up and report."""
    solution = ts.simulate(controlled(), (0, 14), t_eval=np.linspace(0, 14, 701)).raise_if_failed()
    check(solution)
    u = solution.actuation("controller")
    height = solution.position("upper")[:, 2]
    print(f"upright after {solution.t[np.argmax(height > 0.74)]:.1f} s, by forces of {np.abs(u).max():.1f} N at most")


if __name__ == "__main__":
    main()
