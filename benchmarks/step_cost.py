"""What a step costs: the general machinery beside the same mathematics written by hand for the sliding top.

The two run in turn in one process; quote the ratio. Run it: python -m benchmarks.step_cost
"""

import time

import numpy as np

import tsdyn as ts
from benchmarks.by_hand import nystrom_top
from examples import top

END, ROUNDS = 10.0, 9


def timed(run):
    """Seconds that a call takes."""
    started = time.perf_counter()
    run()
    return time.perf_counter() - started


def contenders(steps, interval):
    """The calls to be timed, by name."""
    scene = top.build()
    method = ts.integrators.Nystrom4(step=END / steps)
    return {
        "by hand": lambda: nystrom_top.simulate(*nystrom_top.start(), END, steps, 1e-12, interval),
        "tsdyn, two outputs": lambda: ts.simulate(scene, (0.0, END), integrator=method, t_eval=[0.0, END]),
        "tsdyn, every step": lambda: ts.simulate(scene, (0.0, END), integrator=method),
    }


def main():
    """Print microseconds a step, medians of interleaved rounds, and ratios to the first contender."""
    for steps, interval in ((2000, 15), (10000, 50), (64000, 200)):
        runs = contenders(steps, interval)
        for run in runs.values():
            run()
        seconds = {name: [] for name in runs}
        for _ in range(ROUNDS):
            for name, run in runs.items():
                seconds[name].append(timed(run))
        first = np.array(next(iter(seconds.values())))
        print(f"sliding top, {END:g} s, {steps} steps")
        for name, values in seconds.items():
            ratio = np.median(np.array(values) / first)
            print(f"  {name:20} {np.median(values) / steps * 1e6:7.3f} us a step   x {ratio:.2f}")


if __name__ == "__main__":
    main()
