"""A double-wishbone suspension with tie rod, spring and damper: camber over travel, and the ride after a drop.

Two wishbones on revolute joints, an upright between their ball joints, a tie rod (Distance) that holds its steering.
The wishbones' axes are parallel, so the linkage is a planar four-bar in the front view; the check compares its camber
with that of circles and lines, and the decay of the ride with the eigenvalues about equilibrium.

Run it: python examples/suspension.py
"""

import numpy as np

import tsdyn as ts

LOWER_IN, LOWER_OUT = np.array([0.35, 0.20]), np.array([0.75, 0.18])  # m, (y, z) in the front view
UPPER_IN, UPPER_OUT = np.array([0.45, 0.45]), np.array([0.72, 0.48])
HUB = np.array([0.82, 0.32])
STIFFNESS, DAMPING, SPRUNG = 60e3, 2.0e3, 350.0  # N/m, N s/m, kg: of a quarter of the car


def place(point, x=0.0):
    """A point of the front view in the ground frame."""
    return np.array([x, *point])


def build():
    """Return the scene: the chassis moves vertically, the hub is held at the height of the road."""
    scene, c = ts.Scene(), ts.constraints
    chassis = scene.add_body(SPRUNG, (100.0, 100.0, 100.0), name="chassis")
    bodies = {"chassis": chassis}
    for name, inner, outer in (("lower", LOWER_IN, LOWER_OUT), ("upper", UPPER_IN, UPPER_OUT)):
        middle = place((inner + outer) / 2)
        bodies[name] = scene.add_body(4.0, (0.08, 0.05, 0.1), position=middle, name=name)
        scene.add(c.Revolute.at(chassis, bodies[name], point=place(inner), axis=(1, 0, 0), name=f"{name} pivot"))
    upright = scene.add_body(25.0, (0.8, 1.2, 0.8), position=place(HUB), name="upright")
    scene.add(c.Spherical.at(bodies["lower"], upright, point=place(LOWER_OUT), name="lower ball"))
    scene.add(c.Spherical.at(bodies["upper"], upright, point=place(UPPER_OUT), name="upper ball"))
    rod = {"point_a": place(LOWER_IN, -0.12), "point_b": place(LOWER_OUT, -0.12) - place(HUB)}
    scene.add(c.Distance(chassis, upright, **rod, name="tie rod"))
    scene.add(c.Translational.at(scene.ground, chassis, point=(0, 0, 0), axis=(0, 0, 1), name="ride"))
    scene.add(c.PlaneContact.at(upright, scene.ground, point=place(HUB), normal=(0, 0, 1), name="road"))
    strut = {"point_a": place((0.5, 0.75)), "point_b": (0, 0.1, 0), "free_length": 0.64}
    scene.add(ts.forces.Spring(chassis, bodies["lower"], **strut, stiffness=STIFFNESS, damping=DAMPING, name="strut"))
    return scene


def camber_of(angle):
    """The upright's rotation in the front view where the lower wishbone has turned by an angle, rad (k,)."""
    arm, link = LOWER_OUT - LOWER_IN, UPPER_OUT - LOWER_OUT
    ball = LOWER_IN[:, None] + np.array([arm[0] * np.cos(angle) - arm[1] * np.sin(angle),
                                         arm[0] * np.sin(angle) + arm[1] * np.cos(angle)])  # fmt: skip
    d = UPPER_IN[:, None] - ball
    square, one, other = (d**2).sum(axis=0), link @ link, (UPPER_OUT - UPPER_IN) @ (UPPER_OUT - UPPER_IN)
    along = (one - other + square) / (2.0 * square)
    top = along * d - np.sqrt(one / square - along**2) * np.array([-d[1], d[0]])
    return np.arctan2(top[1], top[0]) - np.arctan2(link[1], link[0])


def camber(solution):
    """Of the upright about x, rad."""
    R = solution.rotation("upright")
    return np.arctan2(R[:, 2, 1], R[:, 1, 1])


def check(solution):
    """Camber of the closed form; the last oscillations decay as the eigenvalues of the linearisation say."""
    solution.raise_if_failed()
    assert np.abs(camber(solution) - camber_of(solution.angle("lower pivot"))).max() < 1e-12
    found = solution.scene.equilibrium()
    value = max(solution.scene.linearise(found.state).eigenvalues(), key=lambda each: each.imag)
    ride = solution.displacement("ride") - found.state.displacement("ride")
    rate = solution.displacement_rate("ride")
    size = np.abs(rate - np.conj(value) * ride)  # proportional to exp(Re(value) t)
    late = (solution.t > 1.0) & (solution.t < 1.5)
    slope = np.polyfit(solution.t[late], np.log(size[late]), 1)[0]
    assert abs(slope - value.real) < 1e-2 * abs(value.real)


def main():
    """Drop the car from the drawing position, and print travel and camber."""
    solution = ts.simulate(build(), (0.0, 2.0), t_eval=np.linspace(0.0, 2.0, 401))
    check(solution)
    print(solution)
    ride = solution.displacement("ride")
    print(f"  travel {1e3 * np.ptp(ride):.1f} mm, camber {np.degrees(np.ptp(camber(solution))):.2f} degrees")


if __name__ == "__main__":
    main()
