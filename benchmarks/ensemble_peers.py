"""Ensembles beside other engines: milliseconds a case and core to an error, in one interleaved run.

Times are the processor's, of one thread each. tsdyn: `ts.ensemble`, case by case and in lanes, all of its cost
counted. heyoka: its batch mode, compiled for the top alone. MuJoCo, Exudyn and Drake: the loop of one case, which
`rollout` and process pools run a core.

Run it: python -m benchmarks.ensemble_peers
"""

import argparse
import time

import numpy as np

import tsdyn as ts
from benchmarks import contender
from benchmarks.contender import Contender, Outcome, rotation, timed
from benchmarks.measure import measure
from benchmarks.peers.drake import DrakeTree
from benchmarks.peers.exudyn import ExudynTree
from benchmarks.peers.heyoka import Heyoka, batch, start_of
from benchmarks.peers.mujoco import MuJoCoTree
from benchmarks.scenes import SCENES

CASES, ROUNDS = 400, 7
BUDGET = 0.3  # s
ERRORS = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
NAMES = ("sliding top", "two-body pendulum", "chain of 4")


class OurEnsemble(Contender):
    """Cases of one scene in one thread: each its own mass, here the same."""

    calls = 3

    def __init__(self, cases, lanes):
        self.cases, self.lanes = cases, lanes
        self.name = "tsdyn, ensemble" if lanes == 1 else f"tsdyn, {lanes} lanes"

    def serves(self, scene):
        """All."""
        return True

    def prepare(self, scene):
        """Build, and compile by a first run."""
        built, span = scene.build(), (0.0, scene.end)
        body = built.bodies[0]
        table = {f"{body.name}.mass": np.full(self.cases, body.mass)}

        def run(tol):
            options = {"threads": 1, "lanes": self.lanes, "rtol": tol, "atol": tol}
            seconds, found = timed(lambda: ts.ensemble(built, table, span, **options))
            if not found.success.all():
                raise RuntimeError(found.message[0])
            q = found.q[-1].reshape(-1, 7)
            return Outcome(seconds / self.cases, q[:, :3], rotation(q[:, 3:]))

        run(self.values[0])
        return run


class HeyokaBatch(Heyoka):
    """As many tops at once as a SIMD register has lanes."""

    name = "heyoka, batch mode"

    def prepare(self, scene):
        """Compile for each tolerance once."""
        definition, compiled = scene.definition(), {}

        def run(tol):
            if tol not in compiled:
                compiled[tol] = batch(definition, tol=tol)
            taylor, lanes = compiled[tol]
            taylor.set_time(0.0)
            taylor.state[:] = start_of(definition)[:, None]
            seconds, _ = timed(taylor.propagate_until, scene.end)
            A = rotation(taylor.state[:4, :1].T)
            return Outcome(seconds / lanes, np.array([[0.0, 0.0, A[0, 2, 2]]]), A)

        return run


def contenders(cases=CASES):
    """Those that are installed, and lines that say what is missing."""
    every = [OurEnsemble(cases, lanes) for lanes in (1, 4)]
    every += [HeyokaBatch(), MuJoCoTree(), ExudynTree(), DrakeTree()]
    missing = [line for one in every if (line := one.missing())]
    return [one for one in every if not one.missing()], missing


def measured(every, rounds=ROUNDS, budget=BUDGET, names=NAMES):
    """The `Measured` of each scene."""
    before, contender.clock = contender.clock, time.process_time  # a call of ours is long, and more often interrupted
    try:
        for name in names:
            yield measure(SCENES[name], every, repeats=rounds, budget=budget, report=lambda _: None)
    finally:
        contender.clock = before


def main():
    """Print a table a scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--budget", type=float, default=BUDGET, help="seconds of a case up to which settings are tried")
    given = parser.parse_args()
    every, missing = contenders(given.cases)
    for found in measured(every, given.rounds, given.budget):
        print(f"\n{found.scene}, ms a case and core", found.table(ERRORS), sep="\n", flush=True)
    print(*missing, sep="\n")


if __name__ == "__main__":
    main()
