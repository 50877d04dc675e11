"""A robot on two wheels stands upright: torques at its hubs by a linear-quadratic regulator.

`linearise` finds the equations about standing, with the wheels rolling: three independent rates, and coordinates that
follow from them. SciPy solves the Riccati equation. The regulator acts in the full non-linear model.

Run it: python examples/two_wheeled_robot.py
"""

import numpy as np
from scipy.linalg import solve_continuous_are

import tsdyn as ts

RADIUS, HALF, HEIGHT = 0.15, 0.2, 0.35  # m: of a wheel, of the track, of the centroid above the axle
HUBS = "left hub", "right hub"
COST, EFFORT = np.diag([1.0, 1.0, 10.0, 1.0, 1.0, 1.0]), 0.5 * np.eye(2)


def build():
    """The robot upright."""
    scene, c = ts.Scene(), ts.constraints
    body = scene.add_body(8.0, (0.30, 0.25, 0.10), position=(0, 0, RADIUS + HEIGHT), name="body")
    for hub, y in zip(HUBS, (HALF, -HALF), strict=True):
        place = (0, y, RADIUS)
        wheel = scene.add_body(0.8, (0.005, 0.009, 0.005), position=place, name=hub.replace("hub", "wheel"))
        scene.add(c.Revolute.at(body, wheel, point=place, axis=(0, 1, 0), name=hub))
        tyre = {"axis_a": (0, 1, 0), "normal_b": (0, 0, 1), "name": hub.replace("hub", "tyre")}
        scene.add(c.RollingDisc(wheel, scene.ground, radius=RADIUS, **tyre))
    return scene


def seen(state):
    """Angles of the wheels against the body, its pitch, the wheels' rates and the speed forward: (6,)."""
    ahead = state.rotation("body")[:, 0]
    pitch, level = np.arcsin(-ahead[2]), ahead[:2] / np.hypot(*ahead[:2])
    angles, rates = [state.angle(hub) for hub in HUBS], [state.angle_rate(hub) for hub in HUBS]
    return np.array([*angles, pitch, *rates, state.velocity("body")[:2] @ level])


def regulator():
    """Gains (2, 6). Of the six coordinates three suffice: where it stands and its heading follow from the wheels."""
    A, B, *_, states, _, _ = build().linearise(inputs=HUBS).state_space()
    rates = "left hub.angle rate", "right hub.angle rate", "body.x rate"
    kept = [states.index(name) for name in ("left hub.angle", "right hub.angle", "body.rotation y", *rates)]
    A, B = A[np.ix_(kept, kept)], B[kept]
    P = solve_continuous_are(A, B, COST, EFFORT)
    return np.linalg.solve(EFFORT, B.T @ P)


def controlled(lean=0.25):
    """The robot with its regulator, at rest at a lean, rad."""
    gains, scene = regulator(), build()
    body = scene["body"]
    body.position = (HEIGHT * np.sin(lean), 0, RADIUS + HEIGHT * np.cos(lean))
    body.orientation = (np.cos(lean / 2), 0, np.sin(lean / 2), 0)
    scene.add(ts.forces.Control(lambda t, state: -gains @ seen(state), HUBS, period=0.005, name="controller"))
    return scene


def check(solution):
    """It stands upright where it began, and would not have slipped on a road."""
    solution.raise_if_failed()
    assert abs(solution.rotation("body")[-1, 2, 0]) < 1e-3
    assert abs(solution.position("body")[-1, 0]) < 1e-2
    assert solution.friction_demand("left tyre").max() < 0.8


def main():
    """Ten seconds."""
    solution = ts.simulate(controlled(), (0.0, 10.0), t_eval=np.linspace(0, 10, 501))
    check(solution)
    print(solution)
    torque = solution.actuation("controller")
    print(f"upright by torques of {np.abs(torque).max():.2f} N m at most")
    print(f"friction that the tyres need: {solution.friction_demand('left tyre').max():.3f}")


if __name__ == "__main__":
    main()
