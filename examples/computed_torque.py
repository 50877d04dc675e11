"""A five-bar robot, a closed loop, draws a circle by computed torque.

At each sample the equations of motion are solved for the torques of both motors that give the tool the acceleration

    a = c'' - 2 w e' - w^2 e,    e = x - c(t)                                                       (1)

so that the error of a tool that starts beside its path decays by e = (e_0 + (e'_0 + w e_0) t) exp(-w t).
"""

import numpy as np

import tsdyn as ts

SPAN, LENGTH = 0.3, 0.4  # m: of the base, and of each link
CENTRE, RADIUS, SPEED = np.array([0.0, 0.0, 0.5]), 0.08, 4.0  # m, rad/s: of the circle
RATE, PERIOD = 15.0, 0.002  # w, 1/s; of the controller, s
START = np.array([0.0, 0.0, 0.55])  # m
ELBOWS = ("left", -1.0), ("right", 1.0)
AXIS = (0.0, 1.0, 0.0)


def elbow(side):
    """Where the two links of a side meet if the tool is at its start."""
    base = np.array([0.5 * side * SPAN, 0.0, 0.0])
    d = START - base
    across = side * np.array([d[2], 0.0, -d[0]]) / np.linalg.norm(d)
    return base, 0.5 * (base + START) + np.sqrt(LENGTH**2 - 0.25 * d @ d) * across


def link(scene, start, end, name):
    """A link between two points of the plane."""
    angle = np.arctan2(end[0] - start[0], end[2] - start[2])
    pose = (np.cos(0.5 * angle), 0.0, np.sin(0.5 * angle), 0.0)
    return scene.add_body(
        **ts.shapes.rod(LENGTH, axis="z", mass=0.5), position=0.5 * (start + end), orientation=pose, name=name
    )


def build():
    """The robot without its controller, at rest."""
    scene = ts.Scene()
    tool = scene.add_point_mass(mass=0.3, position=START, name="tool")
    for name, side in ELBOWS:
        base, knee = elbow(side)
        inner, outer = link(scene, base, knee, f"{name} inner"), link(scene, knee, START, f"{name} outer")
        scene.add(ts.constraints.Revolute.at(scene.ground, inner, point=base, axis=AXIS, name=f"{name} motor"))
        scene.add(ts.constraints.Revolute.at(inner, outer, point=knee, axis=AXIS, name=f"{name} elbow"))
        scene.add(ts.constraints.Spherical.at(outer, tool, point=START, name=f"{name} tip"))
    return scene


def path(t):
    """Position, velocity and acceleration of the path, (3,) each."""
    s, c = RADIUS * np.sin(SPEED * t), RADIUS * np.cos(SPEED * t)
    return (
        CENTRE + np.array([s, 0.0, c]),
        SPEED * np.array([c, 0.0, -s]),
        SPEED**2 * np.array([-s, 0.0, -c]),
    )


def controlled():
    """The robot with its controller."""
    model = build()  # of the controller, whose numbers may differ from those of the robot

    def control(t, state):
        x, v, a = path(t)
        wanted = a - 2.0 * RATE * (state.velocity("tool") - v) - RATE**2 * (state.position("tool") - x)
        here = model.evaluate(state.q, state.qd, t)
        M, H, n, m = np.asarray(here.M), np.asarray(here.Phi_q), len(state.q), len(here.gamma)
        # Unit torques of the motors on Euler parameters: 2 G(p)^T (0, 1, 0)
        B = np.zeros((n, 2))
        for j, (name, _) in enumerate(ELBOWS):
            e0, e1, e2, e3 = state.orientation(f"{name} inner")
            at = 3 + 14 * j
            B[at + 3 : at + 7, j] = 2.0 * np.array([-e2, -e3, e0, e1])
        # M qdd + H^T lam - B u = Q_A + S,  H qdd = -gamma,  accelerations of the tool in the plane as wanted
        tool = np.eye(n)[[0, 2]]
        A = np.block([[M, H.T, -B], [H, np.zeros((m, m + 2))], [tool, np.zeros((2, m + 2))]])
        right = np.concatenate((here.Q_A + here.S, -here.gamma, wanted[[0, 2]]))
        return np.linalg.lstsq(A, right, rcond=1e-10)[0][-2:]

    scene = build()
    scene.add(ts.forces.Control(control, [f"{name} motor" for name, _ in ELBOWS], period=PERIOD, name="controller"))
    return scene


def error(solution):
    """Distance of the tool from its path (k, 3), m, and what Eq. (1) says."""
    x, v, _ = path(0.0)
    e, rate = START - x, -v
    t = solution.t[:, None]
    expected = (e + (rate + RATE * e) * t) * np.exp(-RATE * t)
    return solution.position("tool") - np.array([path(t)[0] for t in solution.t]), expected


def check(solution):
    """The error decays as designed, but for what changes between samples."""
    found, expected = error(solution)
    assert np.abs(found - expected).max() < RATE * PERIOD * np.abs(expected).max()
    assert np.abs(found[-1]).max() < 1e-3 * RADIUS


def main():
    """Draw the circle and report."""
    solution = ts.simulate(controlled(), (0, 1.6), t_eval=np.linspace(0, 1.6, 161)).raise_if_failed()
    check(solution)
    found, _ = error(solution)
    torque = np.abs(solution.actuation("controller")).max()
    first, last = (1e3 * np.abs(found[i]).max() for i in (0, -1))
    print(f"{first:.1f} mm beside the path at first, {last:.3f} mm at last")
    print(f"torques of {torque:.1f} N m at most")


if __name__ == "__main__":
    main()
