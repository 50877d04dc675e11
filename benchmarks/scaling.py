"""Cost against the number of bodies: open chains, trees, hubs, closed loops, nets of loops, one process each.

Columns: time to build; time of the first steps, with loading of kernels and analysis; a warm run of 0.2 s of motion to
1e-6; microseconds an evaluation of the right-hand side and body, steps included and the overhead of a call excluded, by
the difference of the shortest runs to 1e-11 and to 1e-6; d log evaluation / d log N; the last two for DOP853; peak
memory of the process. For Taylor, the default method, an evaluation is one order of a step.

Run it: python -m benchmarks scaling
"""

import itertools
import json
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks import provenance
from tsdyn.stress import rods

SPAN, TOL, TIGHT = (0.0, 0.2), 1e-6, 1e-11
METHODS = None, "dop853"
MAKE = {
    "chain": rods.chain,
    "tree": rods.tree,
    "hub": rods.hub,
    "loop": rods.loop,
    "net": lambda n: rods.net(n, n),
}
SIZES = {
    "chain": (1, 4, 16, 64, 256, 1024, 4096, 10000),
    "tree": (1, 3, 5, 7, 9, 11),
    "hub": (4, 16, 64, 256, 1024, 4096),
    "loop": (4, 16, 64, 256, 1024, 4096),
    "net": (1, 2, 4, 8, 16, 32),
}


class Size(NamedTuple):
    """One scene."""

    family: str
    bodies: int
    built: float  # s
    first: float  # s, of the first steps: analysis, and loading of kernels
    run: float  # s, median
    steps: int
    evaluations: int
    evaluation: float  # us
    dop853: float  # us, an evaluation
    memory: float  # MB, largest of the process


def one(family, size, enough=1.0):
    """Measure in this process: at least three runs of each kind, and more until they have taken `enough` s."""
    import resource
    import time

    import tsdyn as ts

    marks = [time.perf_counter()]
    scene = rods.build(MAKE[family](size))
    marks.append(time.perf_counter())
    ts.simulate(scene, SPAN, rtol=TOL, atol=TOL, t_eval=SPAN, max_steps=2)
    marks.append(time.perf_counter())
    seconds, found = {run: [] for run in itertools.product(METHODS, (TOL, TIGHT))}, {}
    while len(seconds["dop853", TIGHT]) < 3 or sum(seconds["dop853", TIGHT]) < enough:
        for method, tol in seconds:
            started = time.perf_counter()
            solution = ts.simulate(scene, SPAN, integrator=method, rtol=tol, atol=tol, t_eval=SPAN).raise_if_failed()
            seconds[method, tol].append(time.perf_counter() - started)
            found[method, tol] = solution.stats
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0

    def evaluation(method):
        runs = min(seconds[method, TIGHT]) - min(seconds[method, TOL])
        return 1e6 * runs / (found[method, TIGHT].evaluations - found[method, TOL].evaluations)

    stats, run = found[None, TOL], float(np.median(seconds[None, TOL]))
    costs = [evaluation(method) for method in METHODS]
    marks = np.diff(marks).tolist()
    return Size(family, len(scene.bodies), *marks, run, stats.steps, stats.evaluations, *costs, memory)


def families(names=tuple(MAKE), budget=10.0, largest=4096, report=print):
    """Yield the sizes of each family, stopping where the next would take longer than the budget (s) for all it does."""
    for family in names:
        done = []
        for size in SIZES[family]:
            bodies = {"tree": 2**size - 1, "net": 2 * size * (size + 1)}.get(family, size)
            if bodies > largest or (done and _next(done, bodies) > budget):
                break
            report(f"{family} of {bodies}")
            command = [sys.executable, "-m", "benchmarks.scaling", family, str(size)]
            result = subprocess.run(command, cwd=provenance.ROOT, capture_output=True, text=True)
            if result.returncode:
                report(f"  {result.stderr.strip().splitlines()[-1]}")
                break
            done.append(Size(**json.loads(result.stdout)))
            yield done[-1]


def _next(done, bodies):
    """Seconds that the next size may take, by the cost of an evaluation growing as it last did, or more than N does."""
    last = done[-1]
    slope = max(_slope(done[-2], last), 1.1) if len(done) > 1 else 1.1
    return 40.0 * last.run * (bodies / last.bodies) ** min(slope, 3.2)


def _slope(a, b, cost="evaluation"):
    return float(np.log(getattr(b, cost) / getattr(a, cost)) / np.log(b.bodies / a.bodies))


def table(sizes):
    """The sizes as text."""
    lines = ["family  bodies  build s  first s  run ms  steps  us / body  slope  DOP853's  slope  memory MB"]
    before = None
    for size in sizes:
        line = f"{size.family:6}{size.bodies:8}{size.built:9.2f}{size.first:9.2f}{1e3 * size.run:8.4g}{size.steps:7}"
        for cost in ("evaluation", "dop853"):
            slope = f"{_slope(before, size, cost):.2f}" if before and before.family == size.family else ""
            line += f"{getattr(size, cost) / size.bodies:{11 if cost == 'evaluation' else 10}.3f}{slope:>7}"
        lines.append(f"{line}{size.memory:11.0f}")
        before = size
    return "\n".join(lines)


def run(folder, quick=False, budget=10.0, largest=4096, report=print):
    """Measure, print the table, write scaling.json into a folder; the sizes."""
    sizes = list(families(budget=2.0 if quick else budget, largest=64 if quick else largest, report=report))
    print(f"{table(sizes)}\n")
    folder.mkdir(parents=True, exist_ok=True)
    data = provenance.stamp() | {"span": SPAN, "tolerance": TOL, "sizes": [size._asdict() for size in sizes]}
    (Path(folder) / "scaling.json").write_text(json.dumps(data, indent=1) + "\n")
    return sizes


if __name__ == "__main__":
    print(json.dumps(one(sys.argv[1], int(sys.argv[2]))._asdict()))
