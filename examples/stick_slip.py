"""Stick-slip: a spring, its far end at constant speed, pulls a slide along a rough guide.

    guide       Translational, slide and ground      5 rows: friction in proportion to its reaction
    lead        PointDriver, ground and hook         3 rows: the hook moves along x at the speed V
    spring      from the slide, above its axis, to the hook, higher still

The stretched spring lifts and tilts the slide, so the normal load varies. The slide creeps until the spring force
suffices, then slips, periodically. The check compares with the single equation of the slide's position x,

    m xdd = S_x - mu(xd) N,   N = |m g - S_z| + (2 / L) |arm_z S_x - arm_x S_z|

where S is the spring force on the slide.

Run it: python examples/stick_slip.py
"""

import numpy as np
from scipy.integrate import solve_ivp

import tsdyn as ts

MASS, GRAVITY, LENGTH = 2.0, 9.81, 0.3  # kg, m/s^2, m: of the part that is guided
ARM, HOOK = np.array([0.1, 0.0, 0.05]), np.array([0.4, 0.0, 0.2])  # m: on the slide; where the hook starts
STIFFNESS, FREE, SPEED = 300.0, 0.25, 0.15  # N/m, m, m/s
KINETIC, STATIC, STRIBECK, SLIP = 0.2, 0.4, 0.02, 1e-3  # coefficients; m/s


def build():
    """Return the scene, the slide at rest."""
    scene = ts.Scene(gravity=(0.0, 0.0, -GRAVITY))
    slide = scene.add_body(MASS, (0.01, 0.02, 0.02), name="slide")
    hook = scene.add_point_mass(0.1, position=HOOK, velocity=(SPEED, 0.0, 0.0), name="hook")
    guide = scene.add(
        ts.constraints.Translational(slide, scene.ground, axis_a=(1, 0, 0), axis_b=(1, 0, 0), name="guide")
    )
    path = (ts.motions.Polynomial([HOOK[0], SPEED]), HOOK[1], HOOK[2])
    scene.add(ts.constraints.PointDriver(scene.ground, hook, path=path, name="lead"))
    scene.add(ts.forces.Spring(slide, hook, point_a=ARM, stiffness=STIFFNESS, free_length=FREE, name="spring"))
    scene.add(
        ts.forces.TranslationalFriction(
            guide,
            kinetic=KINETIC,
            static=STATIC,
            stribeck_velocity=STRIBECK,
            slip_velocity=SLIP,
            length=LENGTH,
            name="friction",
        )
    )
    return scene


def loads(t, x):
    """The spring's pull along x, and the normal load of the guide."""
    dx, dz = HOOK[0] + SPEED * t - x - ARM[0], HOOK[2] - ARM[2]
    length = np.hypot(dx, dz)
    tension = STIFFNESS * (length - FREE)
    sx, sz = tension * dx / length, tension * dz / length
    return sx, np.abs(MASS * GRAVITY - sz) + 2.0 / LENGTH * np.abs(ARM[2] * sx - ARM[0] * sz)


def friction(t, x, xd):
    """The friction on the slide, along x."""
    mu = KINETIC + (STATIC - KINETIC) * np.exp(-((xd / STRIBECK) ** 2))
    return -mu * xd / np.hypot(xd, SLIP) * loads(t, x)[1]


def reference(times):
    """Place and speed of the slide, (k,) each, by SciPy at 1e-12."""

    def rates(t, y):
        return [y[1], (loads(t, y[0])[0] + friction(t, *y)) / MASS]

    return solve_ivp(rates, (0.0, times[-1]), [0.0, 0.0], "DOP853", times, rtol=1e-12, atol=1e-12).y


def overtakes(t, state):
    """How much faster than the hook the slide is, m/s: it rises through zero where the slide jumps."""
    return state.velocity("slide")[0] - SPEED


overtakes.direction = 1


def check(solution, tol=1e-9):
    """The slide's place to tol, the friction to 1e4 tol; energy less work is constant, if there is dense output."""
    solution.raise_if_failed()
    assert solution.constraint_error.position.max() < 1e-14
    x, xd = reference(solution.t)
    assert np.abs(solution.position("slide")[:, 0] - x).max() < tol
    force, _ = solution.reaction("friction")
    assert np.abs(force[:, 0] - friction(solution.t, x, xd)).max() < 1e4 * tol


def main():
    """Run it for 2 s and print how often it jumps."""
    solution = ts.simulate(build(), (0.0, 2.0), integrator="dop853", rtol=1e-11, atol=1e-11, events=overtakes)
    x = solution.position("slide")[:, 0]
    check(solution)
    print(solution, f"  it jumps at {np.round(solution.t_events[0], 6)} s", sep="\n")
    print(f"  distance from SciPy {np.abs(x - reference(solution.t)[0]).max():.1e} m")


if __name__ == "__main__":
    main()
