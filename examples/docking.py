"""Docking: a probe of 800 kg catches a station of 3000 kg off its centre; the pair goes on, turning.

    dock   Fixed, station and probe   6 rows, from the contact on

Linear and angular momentum are kept, energy is lost. Run it: python examples/docking.py
"""

import numpy as np

import tsdyn as ts

PORT, TIP = np.array((-1.0, 0.4, 0.0)), np.array((0.8, 0.0, 0.0))  # m, on the station and on the probe
STATION, PROBE, SPEED, AWAY = 3000.0, 800.0, 0.25, 1.0  # kg, kg, m/s, m


def build():
    """Return the scene: the probe comes from behind, its tip on the line of the port."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    hull, craft = ts.shapes.box((2.0, 1.6, 1.6), mass=STATION), ts.shapes.cylinder(0.5, 1.6, mass=PROBE, axis="x")
    station = scene.add_body(**hull, name="station")
    start = PORT - TIP - (AWAY, 0, 0)
    probe = scene.add_body(**craft, position=start, velocity=(SPEED, 0, 0), name="probe")
    axes = {"axis_a": (1, 0, 0), "axis_b": (1, 0, 0), "reference_a": (0, 1, 0), "reference_b": (0, 1, 0)}
    scene.add(ts.constraints.Fixed(station, probe, point_a=PORT, point_b=TIP, **axes, name="dock"))
    scene.deactivate("dock")
    return scene


def contact(t, state):
    """How far the tip is from the port along its axis, m."""
    return state.position("station", point=PORT)[0] - state.position("probe", point=TIP)[0]


contact.action = lambda change: change.activate("dock")


def fly(end=100.0):
    """Return the run up to an end, s."""
    return ts.simulate(build(), (0.0, end), events=contact, rtol=1e-11, atol=1e-11)


def check(solution, tol=1e-9):
    """Momenta, the time of the contact, the spin of the pair, and the lost energy."""
    solution.raise_if_failed()
    for momentum in (solution.linear_momentum, solution.angular_momentum):
        assert np.ptp(momentum, axis=0).max() < tol * np.abs(momentum).max()
    # Of the pair about its centroid: both bodies, and the reduced mass at the arm between their centroids
    m, arm = STATION * PROBE / (STATION + PROBE), PORT - TIP
    inertia = sum(solution.scene[name].inertia[2, 2] for name in ("station", "probe")) + m * arm @ arm
    spin = -m * arm[1] * SPEED / inertia
    (_, joined, _), (_, _, names) = solution.phases
    assert names == ("dock",)
    assert abs(joined - AWAY / SPEED) < tol
    assert np.abs(solution.angular_velocity("station")[-1] - (0, 0, spin)).max() < tol
    energy = 0.5 * (PROBE * SPEED) ** 2 / (STATION + PROBE) + 0.5 * inertia * spin**2
    assert abs(solution.energy[-1] - energy) < tol * energy


def main():
    """Dock and print the phases."""
    solution = fly()
    print(solution)
    for begin, end, names in solution.phases:
        print(f"  {begin:.6f} to {end:.6f} s: {', '.join(names) or 'apart'}")
    check(solution)


if __name__ == "__main__":
    main()
