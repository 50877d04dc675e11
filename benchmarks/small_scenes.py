"""Small scenes: Taylor to equal errors against heyoka and kernels by hand, and the cost of an evaluation by DOP853.

heyoka compiles the sliding top alone, in minimal coordinates. Runs are interleaved; quote the ratios. Run it:
python -m benchmarks.small_scenes
"""

import math

import tsdyn as ts
from benchmarks.by_hand.contenders import CONTENDERS
from benchmarks.call_overhead import Clocked
from benchmarks.measure import measure
from benchmarks.ours import Ours
from benchmarks.peers.heyoka import Heyoka
from benchmarks.scenes import SCENES
from tsdyn.runs.step_engine import StepMemory
from tsdyn.taylor.series_engine import SeriesMemory

ERRORS, ROUNDS = (1e-6, 1e-8, 1e-10, 1e-12, 1e-14), 15
SPANS, CALLS = {"sliding top": 1.0, "two-body pendulum": 0.2, "chain of 4": 0.1, "chain of 16": 0.05}, 200  # s: 0.5 ms
KINDS = {"Taylor": (SeriesMemory, "order"), "DOP853": (StepMemory, "evaluation")}


def series():
    """Print milliseconds to an error, and ratios to heyoka's."""
    heyoka, found = Heyoka(), [Ours(), Ours("tsdyn, Taylor", ts.integrators.Taylor), CONTENDERS[1]]
    line = heyoka.missing()
    found += [] if line else [heyoka]
    measured = measure(SCENES["sliding top"], found, repeats=ROUNDS, report=lambda _: None)
    print(measured.table(ERRORS), line, sep="\n")
    for one in found[:-1] if not line else ():
        shares = [
            measured.seconds_to(one.name, e, "least") / measured.seconds_to(heyoka.name, e, "least") for e in ERRORS
        ]
        cells = "".join(f"{share:9.2f}" if math.isfinite(share) else "        -" for share in shares)
        print(f"{one.name + ' / heyoka':30}{cells}")


def evaluations():
    """Print nanoseconds in the compiled driver an evaluation, or an order of series, and body."""
    clocks = {name: Clocked(memory.advance_kernel) for name, (memory, _) in KINDS.items()}
    for name, (memory, _) in KINDS.items():
        memory.advance_kernel = clocks[name]
    runs = [(scene, name, SCENES[scene].build()) for scene in SPANS for name in KINDS]
    least = {}
    for _ in range(CALLS):
        for scene, name, built in runs:
            clock, end = clocks[name], SPANS[scene]
            clock.seconds = 0.0
            solution = ts.simulate(
                built, (0.0, end), t_eval=(0.0, end), integrator=getattr(ts.integrators, name)(rtol=1e-8, atol=1e-8)
            )
            per = clock.seconds / solution.stats.evaluations / len(built.bodies)
            least[scene, name] = min(per, least.get((scene, name), math.inf))
    for (scene, name), seconds in least.items():
        print(f"{scene:20} {name:8} {seconds * 1e9:7.1f} ns an {KINDS[name][1]} and body")


def main():
    """Both."""
    series()
    evaluations()


if __name__ == "__main__":
    main()
