"""Cases a second of `ts.ensemble`: efficiency of threads, and what a case costs beside the compiled loop.

Each case has another mass. Rounds of one thread, two threads and a loop over `simulate` are interleaved; medians. The
overhead is the processor's time of one more case in one thread, less that in the compiled loop over cases. "4 lanes" is
the ratio of cases a second of four lanes to one, of rounds that are interleaved, in the processor's time.

Run it: python -m benchmarks.ensemble
"""

import argparse
import time
from statistics import median

import numpy as np

import tsdyn as ts
from benchmarks.call_overhead import Clocked
from benchmarks.contender import timed
from benchmarks.scenes import SCENES
from examples import coin
from tsdyn.ensembles import case_loop

SPANS = {"sliding top": (1e-4, 1.0, 10.0), "two-body pendulum": (1e-4, 0.5, 5.0), "chain of 4": (1e-4, 0.2, 1.0)}
SPANS["rolling coin"] = 1e-4, 1.0, 10.0
NODDING = 0.3, (0.4, 8.0, 1.5)  # lean, rad, and angular velocity, rad/s, of the coin
CASES, ROUNDS, LOOPED = 1500, 5, 30  # cases of the longest span: a tenth


def table(scene, count):
    """Masses of the first body, within ten per cent."""
    body = scene.bodies[0]
    return {f"{body.name}.mass": body.mass * np.random.default_rng(0).uniform(0.9, 1.1, count)}


def seconds(call, count):
    """Seconds a case of a call that runs so many."""
    return timed(call)[0] / count


def overhead(scene, span, count):
    """Seconds that a case takes outside the compiled loop: of an ensemble of six times as many less those of one."""
    plain = case_loop.run_cases
    case_loop.run_cases = clock = Clocked(plain, time.process_time)
    outside = []
    for many in (count, 6 * count):
        values, clock.seconds = table(scene, many), 0.0
        began = time.process_time()
        ts.ensemble(scene, values, span, threads=1)
        outside.append(time.process_time() - began - clock.seconds)
    case_loop.run_cases = plain
    return (outside[1] - outside[0]) / (5 * count)


def gain(scene, span, values):
    """How many times the cases a second four lanes run, in one thread."""
    spent = []
    for lanes in (1, 4):
        began = time.process_time()
        ts.ensemble(scene, values, span, threads=1, lanes=lanes)
        spent.append(time.process_time() - began)
    return spent[0] / spent[1]


def looped(scene, values, span):
    """The same by a loop over `simulate`."""
    for i in range(LOOPED):
        ts.simulate(scene.with_parameters({name: array[i] for name, array in values.items()}), span)


def measure(name, end, count, rounds):
    """Medians of seconds a case: one thread, two threads, a loop over `simulate`, and the overhead."""
    scene, span = coin.rolling(*NODDING) if name == "rolling coin" else SCENES[name].build(), (0.0, end)
    values = table(scene, count)
    calls = {threads: lambda threads=threads: ts.ensemble(scene, values, span, threads=threads) for threads in (1, 2)}
    found = {1: [], 2: [], "loop": [], "overhead": [], "lanes": []}
    calls[1]()
    gain(scene, span, values)
    for _ in range(rounds):
        for threads, call in calls.items():
            found[threads].append(seconds(call, count))
        found["loop"].append(seconds(lambda: looped(scene, values, span), LOOPED))
        found["lanes"].append(gain(scene, span, values))
        found["overhead"].append(overhead(scene, (0.0, SPANS[name][0]), count))
    return {key: median(times) for key, times in found.items()}


def main():
    """Print a row for each scene and span."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    given = parser.parse_args()
    columns = ("cases/s", "us a case", "2 threads", "efficiency", "loop", "overhead", "4 lanes")
    print(f"{'scene, s':26}" + "".join(f"{column:>11}" for column in columns))
    for name, ends in SPANS.items():
        for end in ends:
            count = max(LOOPED, given.cases // (10 if end == ends[-1] else 1))
            found = measure(name, end, count, given.rounds)
            one, two = found[1], found[2]
            times = f"{1e6 * one:11.0f}{1e6 * two:11.0f}{one / two / 2:11.0%}{1e6 * found['loop']:11.0f}"
            print(f"{f'{name}, {end:g}':26}{1 / one:11.0f}{times}{1e6 * found['overhead']:11.1f}{found['lanes']:11.2f}")


if __name__ == "__main__":
    main()
