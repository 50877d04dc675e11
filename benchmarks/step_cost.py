"""Cost of a step: the general machinery against the same mathematics written by hand for the sliding top.

Runs of both are interleaved in one process; quote the ratio. Steps of series follow, of a rolling coin beside the top,
then the phases of a step by `ts.profile`, for the top and for a chain. Run it: python -m benchmarks.step_cost
"""

import numpy as np

import tsdyn as ts
from benchmarks.by_hand import nystrom_top
from benchmarks.contender import timed
from examples import coin, pendulum_chain, top

END, ROUNDS = 10.0, 9
SPAN = 0.0, END
ORDERS, LENGTH = (8, 16), 0.02  # of steps of series, s
PHASES = {
    "sliding top": (top.build, END, ts.integrators.Nystrom4(step=1e-3)),
    "chain of 16": (lambda: pendulum_chain.build(16), 1.0, ts.integrators.DOP853(1e-8, 1e-8)),
}


def contenders(steps, interval):
    """The calls to be timed, by name."""
    scene = top.build()
    method = ts.integrators.Nystrom4(step=END / steps)
    return {
        "by hand": lambda: nystrom_top.simulate(*nystrom_top.start(), END, steps, 1e-12, interval),
        "tsdyn, two outputs": lambda: ts.simulate(scene, (0.0, END), integrator=method, t_eval=[0.0, END]),
        "tsdyn, every step": lambda: ts.simulate(scene, (0.0, END), integrator=method),
    }


def series():
    """Print microseconds a step of series of one length and order, medians, and ratios to the sliding top."""
    builds = {"sliding top": top.build, "rolling coin": coin.build}
    for order in ORDERS:
        method = ts.integrators.Taylor(step=LENGTH, order=order)
        runs = {name: ts.prepare(build(), integrator=method, history=False) for name, build in builds.items()}
        seconds = {name: [] for name in runs}
        for _ in range(10 * ROUNDS):
            for name, run in runs.items():
                seconds[name].append(timed(lambda run=run: run(SPAN, t_eval=SPAN))[0])
        first = np.array(seconds["sliding top"])
        print(f"series of order {order}")
        for name, values in seconds.items():
            ratio = np.median(np.array(values) / first)
            print(f"  {name:20} {np.median(values) / END * LENGTH * 1e6:7.3f} us a step   x {ratio:.2f}")


def phases(name):
    """Print microseconds a step of each phase, and the share of the call."""
    build, end, method = PHASES[name]
    found = ts.profile(build(), (0.0, end), integrator=method, t_eval=(0.0, end), advice=False)
    steps = found.solution.stats.steps
    print(f"{name}, {method}: {found.seconds / steps * 1e6:.3f} us a step, {100 * found.accounted:.0f} % accounted for")
    for phase in found.phases:
        share = phase.seconds / found.seconds
        print(f"  {f'{phase.group}: {phase.part}':50} {phase.seconds / steps * 1e6:7.3f} us  {100 * share:5.1f} %")


def main():
    """Print microseconds a step, medians of interleaved rounds, and ratios to the first contender; then phases."""
    for steps, interval in ((2000, 15), (10000, 50), (64000, 200)):
        runs = contenders(steps, interval)
        for run in runs.values():
            run()
        seconds = {name: [] for name in runs}
        for _ in range(ROUNDS):
            for name, run in runs.items():
                seconds[name].append(timed(run)[0])
        first = np.array(next(iter(seconds.values())))
        print(f"sliding top, {END:g} s, {steps} steps")
        for name, values in seconds.items():
            ratio = np.median(np.array(values) / first)
            print(f"  {name:20} {np.median(values) / steps * 1e6:7.3f} us a step   x {ratio:.2f}")
    series()
    for name in PHASES:
        phases(name)


if __name__ == "__main__":
    main()
