"""Overhead of a call of `ts.simulate`, from runs over one or two steps.

The overhead is the time of the call less the time in the compiled driver; Python functions that it calls are counted.
Run it: python -m benchmarks.call_overhead
"""

import itertools
import sys
import time

import numpy as np

import tsdyn as ts
from benchmarks.scenes import SCENES
from examples import driven_pivot
from tsdyn.runs.step_engine import StepMemory
from tsdyn.taylor.series_engine import SeriesMemory

SPAN, CALLS, ROUNDS = (0.0, 1e-4), 30, 15
TOLERANCES = {"rtol": 1e-8, "atol": 1e-8}


class Clocked:
    """A compiled kernel, with the time spent in it by a clock."""

    def __init__(self, kernel, clock=time.perf_counter):
        self.kernel, self.clock, self.seconds, self.overloads = kernel, clock, 0.0, True

    def __call__(self, *arguments):
        """Call it."""
        started = self.clock()
        status = self.kernel(*arguments)
        self.seconds += self.clock() - started
        return status


def from_states(scene):
    """A call that starts from another state each time."""
    solution = ts.simulate(scene, (0.0, 1.0), dense_output=True, **TOLERANCES)
    states = itertools.cycle([solution.at(t) for t in np.linspace(0.1, 0.9, 7)])
    return lambda: ts.simulate(scene, SPAN, t_eval=SPAN, state=next(states), initial_tol=1e-6, **TOLERANCES)


def from_one_state(scene):
    """A call that starts from the same state each time."""
    state = ts.simulate(scene, (0.0, 0.1), **TOLERANCES).state
    return lambda: ts.simulate(scene, SPAN, t_eval=SPAN, state=state, **TOLERANCES)


def over_other_spans(scene):
    """A call over another interval each time."""
    ends = itertools.cycle(np.linspace(0.9, 1.1, 7) * SPAN[1])
    return lambda: ts.simulate(scene, (0.0, next(ends)), **TOLERANCES)


def with_a_state(scene):
    """A call of whose solution the last state is asked."""
    return lambda: ts.simulate(scene, SPAN, t_eval=SPAN, **TOLERANCES).state


def edited(scene):
    """A call with another mass each time."""
    body, masses = scene.bodies[0], itertools.cycle(scene.bodies[0].mass * np.linspace(0.9, 1.1, 7))

    def call():
        body.mass = next(masses)
        return ts.simulate(scene, SPAN, t_eval=SPAN, **TOLERANCES)

    return call


def prepared(scene, **options):
    """A call of a prepared run, with outputs at both ends."""
    run = ts.prepare(scene, **(options or TOLERANCES))
    return lambda: run(SPAN, t_eval=SPAN)


def contenders():
    """The calls to be timed, by name."""
    top, pendulum, chain = (SCENES[name].build() for name in ("sliding top", "two-body pendulum", "chain of 4"))
    driven, step = driven_pivot.build(), ts.integrators.Nystrom4(step=SPAN[1])
    adaptive, implicit = ts.integrators.DOP853(**TOLERANCES), ts.integrators.SDIRK54(**TOLERANCES)
    times = np.linspace(*SPAN, 11)
    return {
        "prepared run of the sliding top": prepared(top),
        "  Nystrom4, one step ": prepared(top, integrator=step),
        "sliding top, outputs at both ends": lambda: ts.simulate(top, SPAN, t_eval=SPAN, **TOLERANCES),
        "  every step": lambda: ts.simulate(top, SPAN, **TOLERANCES),
        "  at 11 times": lambda: ts.simulate(top, SPAN, t_eval=times, **TOLERANCES),
        "  dense output": lambda: ts.simulate(top, SPAN, dense_output=True, **TOLERANCES),
        "  Nystrom4, one step": lambda: ts.simulate(top, SPAN, t_eval=SPAN, integrator=step),
        "  DOP853": lambda: ts.simulate(top, SPAN, t_eval=SPAN, integrator=adaptive),
        "  DOP853 by its name": lambda: ts.simulate(top, SPAN, t_eval=SPAN, integrator="dop853", **TOLERANCES),
        "  SDIRK54": lambda: ts.simulate(top, SPAN, t_eval=SPAN, integrator=implicit),
        "  over other intervals": over_other_spans(top),
        "  from one state": from_one_state(top),
        "  from other states": from_states(top),
        "  and its last state": with_a_state(top),
        "  of other masses": edited(SCENES["sliding top"].build()),
        "pendulum, outputs at both ends": lambda: ts.simulate(pendulum, SPAN, t_eval=SPAN, **TOLERANCES),
        "chain of 4, outputs at both ends": lambda: ts.simulate(chain, SPAN, t_eval=SPAN, **TOLERANCES),
        "  from other states ": from_states(chain),
        "driven pivot, outputs at both ends": lambda: ts.simulate(driven, SPAN, t_eval=SPAN, **TOLERANCES),
    }


def functions_of(run):
    """How many Python functions a call like the one before calls, itself included."""
    count = 0

    def note(frame, event, argument):
        nonlocal count
        count += event == "call"

    run()
    sys.setprofile(note)
    run()
    sys.setprofile(None)
    return count


def main():
    """Print microseconds a call, the least of interleaved rounds."""
    runs = contenders()
    clocks = [Clocked(memory.advance_kernel) for memory in (StepMemory, SeriesMemory)]
    StepMemory.advance_kernel, SeriesMemory.advance_kernel = clocks
    least = dict.fromkeys(runs, (np.inf, np.inf))
    for run in runs.values():
        run()
        run()
    for _ in range(ROUNDS):
        for name, run in runs.items():
            for clock in clocks:
                clock.seconds = 0.0
            started = time.perf_counter()
            for _ in range(CALLS):
                run()
            whole = time.perf_counter() - started
            outside = whole - sum(clock.seconds for clock in clocks)
            least[name] = tuple(map(min, least[name], (whole / CALLS, outside / CALLS)))
    print(f"{'microseconds a call':36} whole  Python's part  functions")
    for name, (whole, outside) in least.items():
        print(f"{name:36} {whole * 1e6:5.0f}  {outside * 1e6:13.0f}  {functions_of(runs[name]):9}")


if __name__ == "__main__":
    main()
