"""Cost of joint friction: chains with rough pins against the same chains with smooth pins, and series against stages.

All chains have hinges with parallel axes, and what is compared runs in turn; quote the ratios. First an evaluation of
DOP853, rough over smooth; then a second of a rough chain by Taylor and by DOP853 to the same tolerance, with errors
against DOP853 at 1e-13. Run it: python -m benchmarks.friction
"""

import numpy as np

import tsdyn as ts
from benchmarks.contender import timed

SIZES, ROUNDS, STEPS = (1, 4, 16, 64, 256), 7, 40
CHAINS = (1, 0.05), (4, 0.05), (4, 1e-2), (4, 1e-3), (16, 0.05), (16, 1e-3), (64, 0.05)  # links, slip velocity in m/s
TOLERANCES = 1e-6, 1e-8, 1e-10


def build(count, rough, slip=0.05):
    """A chain of links on pins, released from the horizontal; rough or smooth."""
    scene = ts.Scene()
    last = scene.ground
    for i in range(count):
        link = scene.add_body(1.0, (0.002, 0.02, 0.02), position=(0.25 + 0.5 * i, 0, 0), name=f"link {i}")
        pin = scene.add(ts.constraints.Revolute.at(link, last, point=(0.5 * i, 0, 0), axis=(0, 1, 0), name=f"pin {i}"))
        if rough:
            scene.add(ts.forces.RevoluteFriction(pin, radius=0.02, kinetic=0.2, static=0.3, slip_velocity=slip))
        last = link
    return scene


def cost(scene):
    """Microseconds an evaluation, of a run of so many steps."""
    options = {"integrator": ts.integrators.DOP853(1e-8, 1e-8), "max_steps": STEPS, "t_eval": [0.0]}
    taken, solution = timed(ts.simulate, scene, (0.0, 1.0), **options)
    return 1e6 * taken / solution.stats.evaluations


def seconds(scene, kind, tol):
    """Seconds of a run of one second, and its end."""
    taken, solution = timed(ts.simulate, scene, (0.0, 1.0), integrator=kind(rtol=tol, atol=tol), t_eval=[1.0])
    return taken, solution.q[-1]


def compare(count, slip):
    """For each tolerance milliseconds and errors by Taylor and DOP853, and the ratio of times."""
    kinds, scene = (ts.integrators.Taylor, ts.integrators.DOP853), build(count, True, slip)
    _, exact = seconds(scene, ts.integrators.DOP853, 1e-13)
    for tol in TOLERANCES:
        runs = [[seconds(scene, kind, tol) for kind in kinds] for _ in range(ROUNDS)][1:]
        times = np.array([[took for took, _ in each] for each in runs])
        errors = [np.abs(end - exact).max() for _, end in runs[-1]]
        yield tol, *1e3 * np.median(times, axis=0), *errors, np.median(times[:, 0] / times[:, 1])


def main():
    """Print microseconds an evaluation and milliseconds a run, medians of interleaved rounds, and their ratios."""
    print("links    smooth      rough    rough / smooth")
    for count in SIZES:
        scenes = build(count, False), build(count, True)
        found = [[cost(scene) for scene in scenes] for _ in range(ROUNDS)][1:]
        smooth, rough = np.median(found, axis=0)
        ratio = np.median([b / a for a, b in found])
        print(f"{count:5}  {smooth:6.2f} us  {rough:6.2f} us    {ratio:.2f}")
    print("\nlinks   slip   tolerance     Taylor     DOP853    errors                Taylor / DOP853")
    for count, slip in CHAINS:
        for tol, ours, others, off, its, ratio in compare(count, slip):
            errors = f"{off:.1e}  {its:.1e}"
            print(f"{count:5}  {slip:5g}  {tol:9.0e}  {ours:8.2f} ms  {others:8.2f} ms  {errors}    {ratio:.2f}")


if __name__ == "__main__":
    main()
