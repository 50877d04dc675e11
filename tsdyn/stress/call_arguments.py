"""Arguments of random calls: right, wrong, and absurd."""

import datetime
import decimal
import fractions
import inspect
import types
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from .. import constraints, forces, motions
from ..errors import Status
from ..motions.tables import Table
from ..simulation.scene import Scene
from ..simulation.simulate import simulate
from ..simulation.solution import Solution

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
    others = (
        None,
        True,
        False,
        "text",
        "",
        b"x",
        object(),
        int,
        ...,
        slice(3),
        Scene,
        Status.SUCCESS,
        print,
        len,
    )
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
