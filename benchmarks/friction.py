"""Cost of joint friction: an evaluation of a chain with rough pins against the same chain with smooth pins.

Both chains have hinges with parallel axes and run in turn; quote the ratio. Run it: python -m benchmarks.friction
"""

import time

import numpy as np

import tsdyn as ts

SIZES, ROUNDS, STEPS = (1, 4, 16, 64, 256), 7, 40


def build(count, rough):
    """A chain of hinged links, released from the horizontal; rough or smooth."""
    scene = ts.Scene()
    last = scene.ground
    for i in range(count):
        link = scene.add_body(1.0, (0.002, 0.02, 0.02), position=(0.25 + 0.5 * i, 0, 0), name=f"link {i}")
        hinge = scene.add(ts.constraints.Revolute.at(link, last, point=(0.5 * i, 0, 0), axis=(0, 1, 0)))
        if rough:
            scene.add(ts.forces.RevoluteFriction(hinge, radius=0.02, kinetic=0.2, static=0.3, slip_velocity=0.05))
        last = link
    return scene


def cost(scene):
    """Microseconds an evaluation, of a run of so many steps."""
    began = time.perf_counter()
    solution = ts.simulate(
        scene, (0.0, 1.0), integrator=ts.integrators.DOP853(1e-8, 1e-8), max_steps=STEPS, t_eval=[0.0]
    )
    return 1e6 * (time.perf_counter() - began) / solution.stats.evaluations


def main():
    """Print microseconds an evaluation, medians of interleaved rounds, and their ratio."""
    print("links    smooth      rough    rough / smooth")
    for count in SIZES:
        scenes = build(count, False), build(count, True)
        found = [[cost(scene) for scene in scenes] for _ in range(ROUNDS)][1:]
        smooth, rough = np.median(found, axis=0)
        ratio = np.median([b / a for a, b in found])
        print(f"{count:5}  {smooth:6.2f} us  {rough:6.2f} us    {ratio:.2f}")


if __name__ == "__main__":
    main()
