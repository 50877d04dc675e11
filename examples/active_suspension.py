"""A quarter of a car on a wavy road: a passive strut, and one whose actuator acts like a damper to the sky.

    m z'' = -F,  n y'' = F - k_t (y - r),  F = k (z - y) + c (z' - y') + u,   u = skyhook z'        (1)

z and y are displacements of body and wheel, r = a sin(w t) that of the road. The actuator of the strut is part of a
Spring, so u is its tension with the opposite sign. The check is the response of Eq. (1).
"""

import numpy as np

import tsdyn as ts

BODY, WHEEL = 300.0, 40.0  # kg
STRUT, DAMPING, TYRE = 16e3, 900.0, 180e3  # N/m, N s/m, N/m
SKYHOOK = 2500.0  # N s/m
WAVE, RATE = 0.01, 8.0  # m, rad/s: near the resonance of the body


def build(skyhook=SKYHOOK):
    """The quarter car at rest; without gravity, so that displacements count from equilibrium."""
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(**ts.shapes.box((0.8, 0.5, 0.2), mass=BODY), position=(0, 0, 0.8), name="body")
    wheel = scene.add_body(**ts.shapes.cylinder(0.3, 0.2, axis="y", mass=WHEEL), position=(0, 0, 0.3), name="wheel")
    for part in (body, wheel):
        at = dict(point=part.position, axis=(0, 0, 1))
        scene.add(ts.constraints.Translational.at(scene.ground, part, **at, name=f"{part.name} guide"))
    scene.add(ts.forces.Spring(body, wheel, stiffness=STRUT, damping=DAMPING, name="strut"))

    def tyre(t, state):
        return 0.0, 0.0, TYRE * (WAVE * np.sin(RATE * t) - state.displacement("wheel guide"))

    def control(t, state, *, gain=skyhook):
        return gain * state.velocity("body")[2]

    scene.add(ts.forces.PointForce(wheel, force=tyre, name="tyre"))
    scene.add(ts.forces.Control(control, ["strut"], name="control"))
    return scene


def response(skyhook=SKYHOOK):
    """Complex amplitudes (2,) of z and y over that of the road."""
    s = 1j * RATE
    strut = STRUT + DAMPING * s
    A = np.array([[BODY * s**2 + strut + skyhook * s, -strut], [-strut - skyhook * s, WHEEL * s**2 + strut + TYRE]])
    return np.linalg.solve(A, [0.0, TYRE])


def amplitude(solution):
    """Complex amplitudes (2,) over the last waves, by least squares."""
    late = solution.t > 0.5 * solution.t[-1]
    t = RATE * solution.t[late]
    waves = np.column_stack((np.sin(t), np.cos(t)))
    moves = np.column_stack([solution.displacement(f"{name} guide")[late] for name in ("body", "wheel")])
    a, b = np.linalg.lstsq(waves, moves, rcond=None)[0] / WAVE
    return a + 1j * b


def check(solution):
    """The steady response is that of Eq. (1)."""
    assert np.abs(amplitude(solution) - response()).max() < 1e-6


def run(skyhook=SKYHOOK):
    """Twenty waves and more."""
    times = np.linspace(0.0, 20.0, 2001)
    return ts.simulate(build(skyhook), (0, 20), t_eval=times, rtol=1e-9, atol=1e-11).raise_if_failed()


def main():
    """Compare the two."""
    solution = run()
    check(solution)
    active, passive = (np.abs(response(gain)[0]) for gain in (SKYHOOK, 0.0))
    print(
        f"the body moves {passive:.2f} times as much as the road with the passive strut, {active:.2f} with the active"
    )


if __name__ == "__main__":
    main()
