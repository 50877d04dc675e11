"""The woodpecker toy: a sleeve with play on a pole, a bird on a spring; it pecks its way down.

    sleeve   its centre on the axis of the pole; jams by the friction of a corner of its bore
    bird     on a hinge of the sleeve, with a torsional spring; its beak rebounds from the pole

Parameters of Glocker (1995) and of Leine, van Campen and Glocker (2003), whose equations are those of small angles.
build(small) makes the angles that small a part of theirs, with arms as much longer, and so tends to their model.

In a period the sleeve slides, sticks, slides, falls; the beak lands, and then the corner twice. For small angles the
other corner lands, too, before the beak and after it. The published state of that limit cycle has -0.3411 m/s and
-7.4583 rad/s where the bird's angle is -0.2788 rad; this run has -0.3395 m/s and -7.462 rad/s. The published one is of
time stepping. Moreau's, with steps of 1e-5 s, varies from period to period between -0.338 and -0.342 m/s, around the
value of this run: from one period to the next, deviations are multiplied by -0.84.

Run it: python examples/woodpecker.py
"""

import numpy as np
from scipy.optimize import brentq

import tsdyn as ts

GRAVITY = 9.81  # m/s^2
SLEEVE, BIRD = 0.0003, 0.0045  # kg
SLEEVE_INERTIA, BIRD_INERTIA, STIFFNESS = 5e-9, 7e-7, 0.0056  # kg m^2, kg m^2, N m/rad
POLE, BORE, HALF_HEIGHT = 0.0025, 0.0031, 0.0058  # m: radii, and half the height of the sleeve
HINGE, CENTRE = 0.010, 0.015  # m: from the sleeve's centre to the hinge, and from there to the bird's
BEAK, BEAK_HEIGHT = 0.0201, 0.02  # m: from the bird's centre towards the pole, and up
FRICTION, REBOUND = 0.3, 0.5  # of all contacts; of the beak
JAMMED = -(BORE - POLE) / HALF_HEIGHT  # rad: the corner touches, for small angles
START = JAMMED, -0.2788, -0.3411, -7.4583  # rad, rad, m/s, rad/s: angles, sliding, rate of the bird (Glocker)
DOWN = np.array([0.0, -1.0, 0.0])  # axis of angles that count from x to z


def build(small=1.0, start=START):
    """The sleeve slides down, jammed; the bird swings down. x: from the pole, z: up."""
    tilt, angle, speed, rate = (x * factor for x, factor in zip(start, (small, small, 1.0, small), strict=True))
    bore, height, hinge, centre = (x / small for x in (BORE, HALF_HEIGHT, HINGE, CENTRE))
    wall = bore - (BORE - POLE)
    if small == 1.0:  # where the corner touches
        tilt = brentq(lambda x: bore * np.cos(x) + height * np.sin(x) - wall, -0.2, 0.0, xtol=1e-16)
    scene = ts.Scene(gravity=(0, 0, -GRAVITY))
    sleeve = scene.add_body(SLEEVE, (SLEEVE_INERTIA / small**2,) * 3, name="sleeve")
    bird = scene.add_body(BIRD, (BIRD_INERTIA / small**2,) * 3, (hinge + centre, 0, 0), name="bird")
    constraints = ts.constraints
    scene.add(constraints.PointOnLine(sleeve, scene.ground, axis_b=(0, 0, 1), name="pole"))
    scene.add(constraints.Parallel(sleeve, scene.ground, axis_a=DOWN, axis_b=DOWN, name="upright"))
    scene.add(constraints.Revolute.at(sleeve, bird, point=(hinge, 0, 0), axis=DOWN, name="hinge"))
    spring = {"axis_a": DOWN, "reference_a": (1, 0, 0), "reference_b": (1, 0, 0), "stiffness": STIFFNESS / small**2}
    scene.add(ts.forces.TorsionalSpring(sleeve, bird, **spring, name="spring"))
    beak = -BEAK / small, 0, BEAK_HEIGHT / small
    gap = HINGE + CENTRE - BEAK - POLE
    for name, body, point, surface, e in (
        ("beak", bird, beak, hinge + centre + beak[0] - gap, REBOUND),
        ("low corner", sleeve, (bore, 0, -height), wall, 0.0),
        ("high corner", sleeve, (bore, 0, height), wall, 0.0),
    ):
        places = {"point_a": point, "point_b": (surface, 0, 0), "normal_b": (1, 0, 0)}
        law = {"unilateral": True, "restitution": e, "kinetic": FRICTION}
        scene.add(constraints.PlaneContact(body, scene.ground, **places, **law, name=name))
    arm, along = (np.array([np.cos(x), 0, np.sin(x)]) for x in (tilt, angle))
    sleeve.orientation, bird.orientation = ((np.cos(x / 2), *(np.sin(x / 2) * DOWN)) for x in (tilt, angle))
    bird.position = hinge * arm + centre * along
    sleeve.velocity, bird.angular_velocity = (0, 0, speed), rate * DOWN
    bird.velocity = sleeve.velocity + centre * rate * np.array([-np.sin(angle), 0, np.cos(angle)])
    return scene


def pecks(solution):
    """Instants at which the sleeve comes to stick, a period apart (k,), s, and its heights there, m."""
    sticks = solution.sticking("low corner")
    begins = np.flatnonzero(sticks[1:] & ~sticks[:-1]) + 1
    return solution.t[begins], solution.position("sleeve")[begins, 2]


def check(solution):
    """A limit cycle: the last two periods are alike, the toy descends, and no energy is lost unaccounted."""
    solution.raise_if_failed()
    t, height = pecks(solution)
    periods, falls = np.diff(t), -np.diff(height)
    assert abs(periods[-1] - periods[-2]) < 1e-4 * periods[-1]
    assert abs(falls[-1] - falls[-2]) < 1e-3 * falls[-1]
    assert 0.12 < periods[-1] < 0.14
    assert np.ptp(solution.energy - solution.work) < 1e-9 * np.ptp(solution.energy)


def main():
    """Pecks until the motion repeats."""
    solution = ts.simulate(build(), (0.0, 0.9), rtol=1e-10, atol=1e-10, dense_output=True)
    check(solution)
    t, height = pecks(solution)
    print(solution)
    print(f"period {1e3 * (t[-1] - t[-2]):.1f} ms, {1e3 * (height[-2] - height[-1]):.2f} mm down in each")


if __name__ == "__main__":
    main()
