"""Random calls: right, wrong and absurd arguments for every public constructor, function and method."""

import contextlib
import datetime
import decimal
import fractions
import inspect
import signal
import traceback
import types
import warnings
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from .. import constraints, forces, integrators, motions, shapes
from ..elements.bodies import PointMass
from ..elements.force import Force
from ..elements.joint import Joint
from ..elements.primitive import Primitive
from ..ensembles.ensemble import ensemble
from ..errors import Status, TsdynError
from ..measuring.compare import compare
from ..measuring.profile import profile
from ..methods.integrator import Integrator
from ..motions.prescribed import Motion
from ..motions.tables import Table
from ..simulation.load import load, resume
from ..simulation.prepared_run import prepare, simulate
from ..simulation.run_options import RunOptions
from ..simulation.scene import Scene
from ..simulation.solution import Solution
from .judgement import FAULT, Judgement

# Arguments of random calls: right, wrong, and absurd.

TIME_DEPENDENT = {"f", "fd", "fdd", "length", "value", "angle", "displacement", "actuator"}


def swinging(t):
    """A motion or load."""
    return 0.3 * np.sin(2.0 * t)


def swinging_rate(t):
    """Its rate."""
    return 0.6 * np.cos(2.0 * t)


def swinging_acceleration(t):
    """Its acceleration."""
    return -1.2 * np.sin(2.0 * t)


def pushing(t):
    """A force."""
    return (0.0, 0.1, 0.2 * t)


def raising(*arguments):
    """What raises."""
    raise ValueError("of the user's")


class World(NamedTuple):
    """What calls are made with."""

    scene: Scene
    bodies: tuple
    joint: object
    spring: object
    stranger: object  # a body of another scene
    solution: Solution


def world():
    """A fresh scene, and a run of it."""
    scene = Scene()
    a = scene.add_body(1.0, (0.2, 0.3, 0.4), position=(1.0, 0.0, 0.0), name="arm")
    b = scene.add_body(2.0, (0.2, 0.3, 0.4), position=(2.0, 0.0, 0.0), name="hand")
    p = scene.add_point_mass(0.5, position=(0.0, 3.0, 0.0), name="bead")
    joint = scene.add(constraints.Revolute.at(a, scene.ground, point=(0, 0, 0), axis=(0, 1, 0), name="pivot"))
    spring = scene.add(forces.Spring(b, p, stiffness=1.0, name="band"))
    solution = simulate(scene, (0.0, 0.05))
    return World(scene, (a, b, p), joint, spring, Scene().add_point_mass(1.0), solution)


def junk(rng, w):
    """Anything."""
    numbers = (0, -1, 3, 10**400, -2.5, 1e-320, 1e308, -1e308, np.nan, np.inf, -np.inf, 1j, np.float32(2), np.int8(3))
    others = (None, True, False, "text", "", b"x", object(), int, ..., slice(3), Scene, Status.SUCCESS, print, len)
    groups = ((), [], {}, set(), {"a": 1}, (1, 2), (1, 2, 3), (0, 0, 0), (np.nan, 0, 1), (1e308, 1e308, 1e308))
    ragged = ([1, [2, 3]], ["a", "b", "c"], (None, 1, 2), range(3), iter([1, 2, 3]), types.SimpleNamespace())
    arrays = (np.zeros(3), np.ones(7), np.zeros((3, 3)), np.eye(3), np.full((3, 3), np.nan), np.ones((2, 3, 4)))
    kinds = (
        np.array([]),
        np.array(2.0),
        np.array(["a", "b", "c"]),
        np.array([1, 2, 3], object),
        np.array([True, False]),
    )
    dates = (np.datetime64("2020-01-01"), datetime.timedelta(1), decimal.Decimal("1.5"), fractions.Fraction(1, 3))
    functions = (lambda: 1.0, lambda t: t, lambda t, x: 1.0, raising, swinging)
    rotations = (Rotation.identity(), Rotation.random(3, random_state=1))
    handles = (w.scene, w.scene.ground, *w.bodies, w.stranger, w.joint, w.spring, w.solution, w.solution.state)
    moving = (motions.time, Table((0.0, 1.0), (1.0, 2.0)))
    pool = (*numbers, *others, *groups, *ragged, *arrays, *kinds, *dates, *functions, *rotations, *handles, *moving)
    return pool[rng.integers(len(pool))]


def right(name, rng, w):
    """What an argument of this name may be."""
    bodies = (*w.bodies, w.scene.ground)
    choices = {
        ("a", "on", "body"): lambda: w.bodies[rng.integers(3)],
        ("b",): lambda: bodies[rng.integers(4)],
        ("joint", "item", "constraint"): lambda: (w.joint, w.spring)[rng.integers(2)],
        ("channels", "keep"): lambda: ("pivot", ["pivot.angle", "band"], ["arm.position.x", "bead"])[rng.integers(3)],
        ("name",): lambda: f"name {rng.integers(10**6)}",
        ("frame",): lambda: ("ground", "body")[rng.integers(2)],
        ("t_span",): lambda: (0.0, float(rng.uniform(0.01, 0.05))),
        ("t_eval",): lambda: [0.0, 0.005, 0.01],
        ("integrator",): lambda: (None, "rk45", "taylor", "nystrom4")[rng.integers(4)],
        ("formulation",): lambda: "tangent",
        ("scene",): lambda: w.scene,
        ("state",): lambda: w.solution.state,
        ("redundancy",): lambda: "drop",
        ("folds",): lambda: "keep",
        ("fixed",): lambda: w.bodies[:1],
        ("dense_output", "advice"): lambda: bool(rng.integers(2)),
        ("events", "progress"): lambda: None,
        ("max_steps", "chart_interval", "order", "repeats"): lambda: int(rng.integers(4, 20)),
        ("inertia",): lambda: rng.uniform(1.0, 1.9, 3),
        ("orientation",): lambda: Rotation.random(random_state=int(rng.integers(99))),
        ("t",): lambda: 0.01 * rng.random(),
        ("q",): lambda: w.scene.start[0],
        ("qd",): lambda: w.scene.start[1],
        ("times",): lambda: np.arange(4.0),
        ("values",): lambda: rng.normal(size=4),
        ("force", "torque"): lambda: (rng.normal(size=3), pushing)[rng.integers(2)],
        ("path",): lambda: (0.1, swinging, motions.Sine(0.1, 2.0)),
        ("f",): lambda: swinging,
        ("fd",): lambda: swinging_rate,
        ("fdd",): lambda: swinging_acceleration,
        ("coefficients",): lambda: rng.normal(size=3),
        ("function",): lambda: swinging,
    }
    for names, make in choices.items():
        if name in names:
            return make()
    if name in TIME_DEPENDENT and rng.random() < 0.3:
        return (motions.Ramp(0.3, 0.1), swinging)[rng.integers(2)]
    if name.startswith(
        ("point", "axis", "reference", "normal", "position", "velocity", "angular", "across", "gravity")
    ):
        return rng.normal(size=3)
    return float(rng.uniform(0.1, 2.0))


def arguments_for(function, rng, w):
    """Positional and keyword arguments, most of them right."""
    wrong = rng.choice((0.0, 0.15, 0.5))
    positional, keywords = [], {}
    for p in inspect.signature(function).parameters.values():
        value = junk(rng, w) if rng.random() < wrong else right(p.name, rng, w)
        if p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD):
            continue
        needed = p.default is p.empty or p.name.startswith(("axis", "normal", "reference"))
        if rng.random() < (0.97 if needed else 0.3):
            if p.kind == p.KEYWORD_ONLY or len(keywords) or p.default is not p.empty:
                keywords[p.name] = value
            else:
                positional.append(value)
    if rng.random() < 0.05:
        keywords[("nam", "pointt", "rtoll", "x")[rng.integers(4)]] = junk(rng, w)
    if rng.random() < 0.03:
        positional += [junk(rng, w)] * int(rng.integers(1, 4))
    return positional, keywords


# Random calls: right and wrong arguments for every public constructor, function and method.
#
# Nothing but a TsdynError may come out, nothing may hang, and what is accepted must hold finite numbers.

PATIENCE = 120.0  # s a call may take, compiling included
RUNS = 0.1  # of the calls are of `simulate`
KINDS = (Primitive, Joint, Force, Integrator, motions.Smooth)
INNER = ("place", "touch", "refresh", "motions", "row_names")
WRITE = ("save", "view", "plot", "to_csv")  # files, and windows of a browser
SPACES = (constraints, forces, integrators, motions)


class CallOutcome(NamedTuple):
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
    found += [(name, getattr(shapes, name)) for name in shapes.__all__]
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
    if isinstance(result, (Primitive, Joint, Force)) and "coordinates" in vars(result):  # all but unplaced Controls
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
    """The `CallOutcome` of one call."""
    given = [*map(_shown, positional), *(f"{name}={_shown(value)}" for name, value in keywords.items())]
    call = f"{label}({', '.join(given)})"
    result, story = None, ""
    try:
        with deadline(PATIENCE), warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", "made for this scene|.*the cubic spline overshoots")
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
    return CallOutcome(call, outcome, story), result


def _shown(value):
    try:
        text = " ".join(repr(value).split())
    except Exception as error:
        text = f"<{type(value).__name__}: {error!r}>"
    return text if len(text) < 60 else text[:57] + "..."


def fuzz(count, seed, runs=RUNS):
    """Yield a `CallOutcome` for each of so many calls; the same ones for the same seed."""
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
        Judgement(seed, found.call, f"{FAULT} {found.outcome}" if found.story else found.outcome, found.story)
        for found in fuzz(count, seed)
    ]
