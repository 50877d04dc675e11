"""A screw press: a torque drives a screw in its nut, which pushes a platen against a spring and a damper.

    nut       Screw, ground and screw           5 rows
    guide     Translational, ground and platen  5 rows
    collar    Dot2, screw and platen            1 row: 11 for 12 degrees of freedom

With the downward displacement s = lead theta it is a damped oscillator:

    (J + m lead^2) thetadd + c lead^2 thetad + k lead^2 theta = torque + m g lead,   m both masses

Run it: python examples/screw_press.py
"""

import numpy as np

import tsdyn as ts

PITCH = 0.012  # m a turn
LEAD = PITCH / (2.0 * np.pi)  # m/rad
SCREW, PLATEN, GRAVITY = 6.0, 25.0, 9.81  # kg, kg, m/s^2
J = 0.02  # kg m^2, of the screw about its axis
STIFFNESS, DAMPING = 2.0e5, 4.0e3  # N/m, N s/m
TORQUE = 4.0  # N m
HEIGHT, FREE = 0.5, 0.4  # m: of the platen at the start; of the spring beneath it without a load
DOWN = (0.0, 0.0, -1.0)


def build():
    """Return the scene, at rest, the spring just touched."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    screw = scene.add_body(SCREW, (0.2, 0.2, J), position=(0.0, 0.0, HEIGHT + 0.3), name="screw")
    platen = scene.add_body(PLATEN, (0.5, 0.5, 0.9), position=(0.0, 0.0, HEIGHT), name="platen")
    scene.add(ts.constraints.Screw.at(scene.ground, screw, point=screw.position, axis=DOWN, lead=LEAD, name="nut"))
    scene.add(ts.constraints.Translational.at(scene.ground, platen, point=platen.position, axis=DOWN, name="guide"))
    scene.add(ts.constraints.Dot2.at(screw, platen, point=(0, 0, HEIGHT + 0.1), axis=DOWN, name="collar"))
    scene.add(ts.forces.Torque(screw, torque=(0.0, 0.0, -TORQUE), name="handwheel"))
    scene.add(
        ts.forces.Spring(
            platen, scene.ground, point_b=(0.0, 0.0, HEIGHT - FREE), stiffness=STIFFNESS, damping=DAMPING, name="work"
        )
    )
    return scene


def at_rest(t, state):
    """The screw's speed, rad/s: it falls through zero where the press has gone furthest."""
    return state.angle_rate("nut")


at_rest.direction = -1


def reference(times):
    """The turn of the screw and its rate, (k,) each: the damped oscillator from rest."""
    inertia = J + (SCREW + PLATEN) * LEAD**2
    drive = TORQUE + (SCREW + PLATEN) * GRAVITY * LEAD
    rest = drive / (STIFFNESS * LEAD**2)
    fade = 0.5 * DAMPING * LEAD**2 / inertia
    w = np.sqrt(STIFFNESS * LEAD**2 / inertia - fade**2)
    decay, c, s = np.exp(-fade * times), np.cos(w * times), np.sin(w * times)
    return rest * (1.0 - decay * (c + fade / w * s)), rest * decay * (w + fade**2 / w) * s


def check(solution, tol=1e-9):
    """Turn to tol, the platen's place to tol of a turn, the force through the collar to 1e3 tol of itself."""
    solution.raise_if_failed()
    assert solution.constraint_error.position.max() < 1e-14
    theta, rate = reference(solution.t)
    assert np.abs(solution.angle("nut") - theta).max() < tol
    platen = solution.position("platen")
    assert np.abs(platen[:, 2] - (HEIGHT - LEAD * theta)).max() < LEAD * tol + 1e-14
    inertia = J + (SCREW + PLATEN) * LEAD**2
    drive = TORQUE + (SCREW + PLATEN) * GRAVITY * LEAD
    gain = (drive - DAMPING * LEAD**2 * rate - STIFFNESS * LEAD**2 * theta) / inertia
    through = PLATEN * (GRAVITY - LEAD * gain) - STIFFNESS * LEAD * theta - DAMPING * LEAD * rate
    force, _ = solution.reaction("collar", on="platen")
    assert np.abs(force[:, 2] - through).max() < 1e3 * tol * np.abs(through).max()


def main():
    """Run it for 1.5 s and print how far it presses."""
    solution = ts.simulate(build(), (0.0, 1.5), integrator="dop853", rtol=1e-11, atol=1e-11, events=at_rest)
    check(solution)
    print(solution)
    theta, way = solution.angle("nut"), solution.displacement("nut")
    print(f"  {theta.max() / (2.0 * np.pi):.2f} turns, {1e3 * way.max():.2f} mm, at {solution.t_events[0][0]:.6f} s")
    print(f"  distance from the closed form {np.abs(theta - reference(solution.t)[0]).max():.1e} rad")


if __name__ == "__main__":
    main()
