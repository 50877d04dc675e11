"""Statics of chains of links: steps of `scene.equilibrium`, and the time of it and of `scene.linearise`.

Chains of revolutes start horizontal, chains of spherical joints in a horizontal pose, each link turned at random.
`linearise` is about the start. Times are those of the processor, in one process and with one thread of BLAS
(OPENBLAS_NUM_THREADS=1 and the like, set before Python starts); the scene has been packed before. The last two columns
are the exponents of growth from the line before.

Run it: python -m benchmarks.statics [links ...]
"""

import argparse
import time

import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.hanging_chains import DOWN, pendulums


def revolutes(count):
    """A horizontal chain on pins."""
    return pendulums(np.full(count, np.pi / 2))


def balls(count, length=0.3):
    """A chain on spherical joints."""
    rng, scene, top = np.random.default_rng(3), ts.Scene(gravity=DOWN), np.zeros(3)
    before = scene.ground
    for i in range(count):
        rotation = Rotation.from_rotvec(0.3 * rng.normal(size=3))
        along = rotation.apply([length, 0.0, 0.0])
        body = scene.add_body(0.5, (1e-3, 4e-3, 4e-3), top + along / 2, rotation, name=f"link {i}")
        scene.add(ts.constraints.Spherical.at(before, body, point=top, name=f"ball {i}"))
        before, top = body, top + along
    return scene


def spent(call):
    """What a call returns, and its processor time, s."""
    started = time.process_time()
    found = call()
    return found, time.process_time() - started


def main():
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("links", nargs="*", type=int, default=[50, 100, 200, 500])
    counts = parser.parse_args().links
    print("joints        links  steps  equilibrium (s)  linearise (s)  growth of these")
    for make in (revolutes, balls):
        make(5).linearise(make(5).equilibrium().state)  # compiles
        before = None
        for count in counts:
            scene = make(count)
            scene.evaluate()
            found, fall = spent(scene.equilibrium)
            _, linear = spent(scene.linearise)
            line = f"{make.__name__:12s} {count:6d} {found.steps:6d} {fall:16.2f} {linear:14.2f}"
            if before is not None:
                ratios = np.log([fall / before[1], linear / before[2]]) / np.log(count / before[0])
                line += "  {:8.1f} {:6.1f}".format(*ratios)
            print(line, flush=True)
            before = count, fall, linear


if __name__ == "__main__":
    main()
