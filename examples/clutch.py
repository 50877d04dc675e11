"""A clutch: a driver of 2 kg m^2 at 10 rad/s takes along a load of 3 kg m^2 from 0.5 s to 1.5 s, without slip.

    hinges   Revolute, ground and rotor            5 rows each
    clutch   Coupler, load hinge = driver hinge    1 row, while it is engaged
    brake    CoulombFriction of 6 N m on the load, from 2 s on

Angular momentum is kept where the clutch engages: both go on with 4 rad/s, and the energy of their difference is lost,
J1 J2 (w1 - w2)^2 / 2 (J1 + J2) = 60 J. Run it: python examples/clutch.py
"""

import numpy as np

import tsdyn as ts

DRIVER, LOAD, RATE, BRAKE = 2.0, 3.0, 10.0, 6.0  # kg m^2, kg m^2, rad/s, N m
COMMON = DRIVER * RATE / (DRIVER + LOAD)
ENGAGED, OPENED, BRAKED = 0.5, 1.5, 2.0  # s


def build():
    """Return the scene, with the clutch open."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    hinges, disc = [], {"axis": "x"}
    for name, inertia, x, rate in (("driver", DRIVER, -0.3, RATE), ("load", LOAD, 0.3, 0.0)):
        shape = ts.shapes.cylinder(1.0, 0.1, mass=2.0 * inertia, **disc)  # m R^2 / 2
        body = scene.add_body(**shape, position=(x, 0, 0), angular_velocity=(rate, 0, 0), name=name)
        hinge = ts.constraints.Revolute.at(scene.ground, body, point=(x, 0, 0), axis=(1, 0, 0), name=f"{name} hinge")
        hinges.append(scene.add(hinge))
    scene.add(ts.constraints.Coupler(hinges[1], hinges[0], ratio=1.0, name="clutch"))
    brake = ts.forces.CoulombFriction(scene["load"], scene.ground, torque=BRAKE, name="brake")
    scene.add(brake)
    scene.deactivate("clutch")
    scene.deactivate("brake")
    return scene


def engage(change):
    """Couple the shafts at the angles that they have."""
    angles = [change.state.angle(name) for name in ("load hinge", "driver hinge")]
    change.set("clutch.offset", angles[0] - angles[1])
    change.activate("clutch")


def events():
    """Return what happens when."""
    actions = {
        ENGAGED: engage,
        OPENED: lambda change: change.deactivate("clutch"),
        BRAKED: lambda change: change.activate("brake"),
    }
    return [_at(time, action) for time, action in actions.items()]


def _at(time, action):
    def event(t, state):
        return t - time

    event.action = action
    return event


def check(solution, tol=1e-9):
    """Rates before, while and after the clutch is engaged, impulse, lost energy, and rest of the load."""
    solution.raise_if_failed()
    for t, rates in ((0.4, (RATE, 0.0)), (1.0, (COMMON, COMMON)), (1.9, (COMMON, COMMON)), (4.5, (COMMON, 0.0))):
        found = [solution.at(t).angle_rate(name) for name in ("driver hinge", "load hinge")]
        assert np.abs(np.subtract(found, rates)).max() < tol
    (_, name, impulse), *more = solution.impulses
    assert (name, more) == ("clutch", [])
    assert abs(abs(impulse) - LOAD * COMMON) < tol
    jump = np.flatnonzero(np.diff(solution.t) == 0.0)[0]
    lost = DRIVER * LOAD * RATE**2 / 2.0 / (DRIVER + LOAD)
    assert abs(solution.energy[jump] - solution.energy[jump + 1] - lost) < tol * lost
    rest = solution.t[solution.sticking("brake")][0]
    assert abs(rest - (BRAKED + LOAD * COMMON / BRAKE)) < tol
    assert solution.sticking("brake")[-1]


def main():
    """Run it for 5 s and print its phases."""
    solution = ts.simulate(build(), (0.0, 5.0), events=events(), dense_output=True)
    print(solution)
    for begin, end, names in solution.phases:
        print(f"  {begin:.6f} to {end:.6f} s: {', '.join(names) or 'nothing is engaged'}")
    check(solution)


if __name__ == "__main__":
    main()
