"""Judgement of a random scene: it runs within the laws, is refused, or ends with a message; all else is a fault."""

import time
from typing import NamedTuple

import numpy as np

from ..errors import TsdynError
from ..simulation.simulate import simulate
from . import comparisons, random_scenes
from .laws import findings
from .random_scenes import generate

MOST_STEPS = 3_000  # of a run
COMPARED = 0.7  # of the cases are run in another way, too
PASSAGES = 4
FAULT = "FAULT"


class Judgement(NamedTuple):
    """How a scene or a block of calls came out; a fault's word begins with FAULT."""

    seed: int
    name: str
    word: str
    said: str = ""
    seconds: float = 0.0

    @property
    def fault(self):
        """True if it was none of those that are allowed."""
        return self.word.startswith(FAULT)


def judge_scene(seed, least=None, most=None):
    """Return the `Judgement` of the scene of a seed; one in PASSAGES passes places where a law is not analytic."""
    if least is None and seed % PASSAGES == PASSAGES - 1:
        return judge_case(random_scenes.draw(seed), (comparisons.another_method,), seed)
    return judge_case(generate(seed, least, most), comparison(np.random.default_rng((seed, 1))), seed)


def comparison(rng):
    """Return the comparison by which a case is judged besides the laws of its run, in a tuple, or none."""
    return (comparisons.ALL[rng.integers(len(comparisons.ALL))],) if rng.random() < COMPARED else ()


def judge_case(case, others, seed=None):
    """Return the `Judgement` of a case, judged by the laws of its run and by comparisons with others."""
    began = time.perf_counter()
    try:
        word, said = judge(case, others)
    except TsdynError as error:
        word, said = type(error).__name__, str(error)
        if not said.strip():
            word, said = f"{FAULT} no message", word
    except Exception as error:
        word, said = f"{FAULT} {type(error).__name__}", str(error)
    return Judgement(seed, case.name, word, said, time.perf_counter() - began)


def judge(case, others):
    """Return the word for a case, and what was said; raises what the run raises."""
    if case.assembled:
        case.scene.assemble()
    solution = run_case(case)
    if not solution.success and not solution.message.strip():
        return f"{FAULT} no message", str(solution.status)
    found = findings(solution)
    if solution.success:
        found += comparisons.energy(case, solution, run_case) + comparisons.momenta(case, solution, run_case)
        found += [one for other in others for one in other(case, solution, run_case)]
    broken = [one for one in found if one.broken]
    if broken:
        return f"{FAULT} {broken[0].law}", "; ".join(map(str, broken[:3]))
    return str(solution.status), solution.message


def run_case(case, by=simulate, **more):
    """Run a case by a function like `simulate`, with other options in place of its own where they are given."""
    options = {"dense_output": True, "max_steps": MOST_STEPS} | case.options | more
    return by(case.scene, case.span, **options)
