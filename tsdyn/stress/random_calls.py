"""Random calls: right and wrong arguments for every public constructor, function and method.

Nothing but a TsdynError may come out, nothing may hang, and what is accepted must hold finite numbers.
"""

import contextlib
import inspect
import signal
import traceback
import warnings
from typing import NamedTuple

import numpy as np

from .. import constraints, forces, integrators, motions, shapes
from ..comparison.compare import compare
from ..elements.bodies import PointMass
from ..elements.force import Force
from ..elements.joint import Joint
from ..elements.primitive import Primitive
from ..ensembles.ensemble import ensemble
from ..errors import TsdynError
from ..methods.integrator import Integrator
from ..motions.prescribed import Motion
from ..motions.tables import Table
from ..profiling.profile import profile
from ..simulation.load import load
from ..simulation.prepared_run import prepare
from ..simulation.resume import resume
from ..simulation.run_options import RunOptions
from ..simulation.scene import Scene
from ..simulation.simulate import simulate
from ..simulation.solution import Solution
from .call_arguments import arguments_for, world
from .judgement import FAULT, Outcome

PATIENCE = 120.0  # s a call may take, compiling included
RUNS = 0.1  # of the calls are of `simulate`
KINDS = (Primitive, Joint, Force, Integrator, motions.Smooth)
INNER = ("place", "touch", "refresh", "motions", "row_names")
WRITE = ("save", "view", "plot")  # files, and windows of a browser
SPACES = (constraints, forces, integrators, motions)


class Found(NamedTuple):
    """One call: what it was, and its outcome; `story` is empty where that is allowed."""

    call: str
    outcome: str
    story: str


def targets(w):
    """(what it is called, the callable) of all that is called."""
    found = []
    for space in SPACES:
        for name in sorted(vars(space)):
            thing = getattr(space, name)
            if isinstance(thing, type) and not name.startswith("_") and issubclass(thing, KINDS):
                found.append((name, thing))
                if hasattr(thing, "at"):
                    found.append((f"{name}.at", thing.at))
                if "of" in vars(thing):
                    found.append((f"{name}.of", thing.of))
    found += [("Scene", Scene), ("Table", Table), ("Motion", Motion), ("Integrator", Integrator)]
    found += [(name, thing) for name, thing in sorted(vars(shapes).items()) if callable(thing) and name[0] != "_"]
    found += [(call.__name__, call) for call in (load, resume, ensemble, compare, profile, prepare, RunOptions)]
    found += [("run", prepare(w.scene)), ("run.with_parameters", prepare(w.scene).with_parameters)]
    for owner, label in ((w.scene, "scene"), (w.solution, "solution")):
        for name, _ in inspect.getmembers(type(owner), inspect.isfunction):
            if not name.startswith("_") and name not in (*INNER, *WRITE):
                found.append((f"{label}.{name}", getattr(owner, name)))
    return found


@contextlib.contextmanager
def deadline(seconds):
    """Raise TimeoutError in what takes longer, where a timer can be had."""
    if not hasattr(signal, "setitimer"):
        yield
        return

    def ring(number, frame):
        raise TimeoutError(f"longer than {seconds:g} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def leaks(result):
    """Which number of what a call gave is not finite; empty where none is."""
    numbers = {}
    if isinstance(result, (Primitive, Joint, Force)):
        numbers = {"coordinates": np.ravel(result.coordinates)}
        numbers["parameters"] = [p for p in result.parameters() if isinstance(p, (int, float))]
    elif isinstance(result, PointMass):
        numbers = {name: np.ravel(value) for name, value in result.values.items()}
    elif isinstance(result, Solution) and result.success:
        numbers = {name: getattr(result, name).ravel() for name in ("t", "q", "qd", "qdd", "energy")}
        str(result), repr(result), result._repr_html_()
    elif isinstance(result, Integrator):
        numbers = {name: [value] for name, value in vars(result).items() if isinstance(value, float)}
        repr(result)
    return ", ".join(name for name, values in numbers.items() if not np.isfinite(np.asarray(values, float)).all())


def attempt(label, function, positional, keywords):
    """The `Found` of one call."""
    given = [*map(_shown, positional), *(f"{name}={_shown(value)}" for name, value in keywords.items())]
    call = f"{label}({', '.join(given)})"
    result, story = None, ""
    try:
        with deadline(PATIENCE), warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", "made for this scene")
            result = function(*positional, **keywords)
            outcome = "failed" if isinstance(result, Solution) and not result.success else "accepted"
            unsound = leaks(result)
        if unsound:
            outcome, story = "NOT FINITE", unsound
    except TsdynError as error:
        outcome = type(error).__name__
        if not str(error).strip():
            outcome, story = "NO MESSAGE", type(error).__name__
    except TimeoutError as error:
        outcome, story = "HANGS", str(error)
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        outcome = f"RAW {type(error).__name__}"
        story = f"{error} ({last.filename.rpartition('/')[2]}:{last.lineno})"
    return Found(call, outcome, story), result


def _shown(value):
    try:
        text = " ".join(repr(value).split())
    except Exception as error:
        text = f"<{type(value).__name__}: {error!r}>"
    return text if len(text) < 60 else text[:57] + "..."


def fuzz(count, seed, runs=RUNS):
    """Yield a `Found` for each of so many calls; the same ones for the same seed."""
    rng = np.random.default_rng(seed)
    w = None
    for i in range(count):
        if w is None or i % 40 == 0:
            w = world()
            known = targets(w)
        if rng.random() < runs:
            label, function = "simulate", simulate
        else:
            label, function = known[rng.integers(len(known))]
        found, result = attempt(label, function, *arguments_for(function, rng, w))
        yield found
        if isinstance(result, (Primitive, Joint, Force)) and not result.added and rng.random() < 2.0 * runs:
            yield attempt("scene.add", w.scene.add, [result], {})[0]
            yield attempt(f"simulate with {found.call}", simulate, [w.scene, (0.0, 0.01)], {"max_steps": 20})[0]
            w = None


def judge_calls(seed, count):
    """Return the `Outcome`s of so many calls of a seed."""
    return [
        Outcome(seed, found.call, f"{FAULT} {found.outcome}" if found.story else found.outcome, found.story)
        for found in fuzz(count, seed)
    ]
