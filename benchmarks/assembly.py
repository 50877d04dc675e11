"""Assembly from random sketches: the share that ends on the branch of the sketch, and the cost.

Each mechanism starts from a random configuration at least 0.1 rad from its dead centres. Each body is then disturbed by
up to 0.3 of its link length and 0.5 rad, both uniform, in a random direction. An assembly is right if every orientation
determinant of the mechanism has its sign from before the disturbance; `clear` counts sketches that are still 0.1 rad
from a dead centre on that side. The last columns are plain Gauss-Newton steps from the same sketches.

Run it: python -m benchmarks.assembly [--count 200] [--seed 1] [mechanism ...]
"""

import argparse
import time
from typing import NamedTuple

import numpy as np

import tsdyn as ts
from tests.helpers.sketched_mechanisms import MECHANISMS
from tests.helpers.sketches import CLEAR
from tsdyn.configuration.continuation import Metric, close


class Tally(NamedTuple):
    """Of one mechanism."""

    name: str
    count: int
    right: int
    wrong: int  # another branch, not refused
    refused: int
    clear: int
    clear_right: int
    iterations: int  # most
    seconds: float  # median
    plain_right: int
    plain_failed: int


def tally(name, count, seed=1):
    """Assemble `count` sketches of a mechanism."""
    rng, counts, iterations, seconds = np.random.default_rng(seed), np.zeros(7, int), [], []
    for _ in range(count):
        mechanism = MECHANISMS[name](rng)
        scene, side = mechanism.scene, np.sign(mechanism.branch())
        mechanism.disturb(rng)
        clear, sketch = bool((mechanism.branch() * side >= CLEAR).all()), scene.start
        q, Phi, _ = close(Metric(scene.packed), sketch[0])
        plain = np.abs(Phi).max() < 1e-9
        scene.place(q, 0.0 * q)
        plain_right = plain and bool((np.sign(mechanism.branch()) == side).all())
        scene.place(*sketch)
        started = time.perf_counter()
        try:
            iterations.append(scene.assemble().iterations)
            right, refused = bool((np.sign(mechanism.branch()) == side).all()), False
        except ts.TsdynError:
            right, refused = False, True
        seconds.append(time.perf_counter() - started)
        counts += [right, not (right or refused), refused, clear, clear and right, plain_right, not plain]
    return Tally(name, count, *counts[:5].tolist(), max(iterations), float(np.median(seconds)), *counts[5:].tolist())


def table(tallies):
    """The tallies as text."""
    lines = [
        f"{'mechanism':14} sketches  right  wrong  refused  clear  right  steps     ms  Gauss-Newton right  failed"
    ]
    for t in tallies:
        lines.append(
            f"{t.name:14}{t.count:9}{t.right:7}{t.wrong:7}{t.refused:9}{t.clear:7}{t.clear_right:7}{t.iterations:7}"
            f"{1e3 * t.seconds:7.1f}{t.plain_right:20}{t.plain_failed:8}"
        )
    return "\n".join(lines)


def main(arguments=None):
    """Run what is asked for and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.assembly", description=__doc__)
    parser.add_argument("mechanisms", nargs="*", metavar="mechanism", help=f"some of {', '.join(MECHANISMS)}")
    parser.add_argument("--count", type=int, default=200, help="sketches of each (200)")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    unknown = set(given.mechanisms) - set(MECHANISMS)
    if unknown:
        parser.error(f"no mechanism {', '.join(sorted(unknown))}; there are {', '.join(MECHANISMS)}")
    print(table([tally(name, given.count, given.seed) for name in given.mechanisms or MECHANISMS]))


if __name__ == "__main__":
    main()
