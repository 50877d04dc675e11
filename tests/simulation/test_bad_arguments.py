"""Impossible arguments of `simulate` and `evaluate`, and questions to which a solution has no answer."""

import json
import pickle
import re

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.refusals import INF, NAN, STEP, build, case, refuse, text
from tests.helpers.tolerances import ROUNDING

C = ts.constraints
POSITIVE = (0.0, -1.0, NAN, INF, None, "1e-3", "x", [1.0], 1j, 10**400)
COUNTS = (0, -1, 1.5, 10.0, NAN, "3", True, [1])
TIMES = {
    "empty": [],
    "after the end": [0.0, 2.0],
    "before the start": [-1.0, 0.0],
    "decreasing": [1.0, 0.0],
    "twice the same": [0.5, 0.5],
    "nan": [0.0, NAN],
    "one number": 0.5,
    "text": "x",
    "numbers as text": ["0", "0.5"],
    "two-dimensional": [[0.0, 0.5]],
    "a None in it": [0.0, None],
    "a generator": (t for t in (0.0, 0.5)),
    "complex": np.array([0.0, 0.5j]),
}


def run(t_span=(0.0, 1.0), **arguments):
    return lambda w: ts.simulate(w.scene, t_span, **{"integrator": STEP, **arguments})


def state(**changes):
    def call(w):
        start = w.scene.evaluate()
        q, qd = w.scene.start
        good = ts.State(0.0, q, qd, start.qdd, start.multipliers)
        return ts.simulate(w.scene, (0.0, 1.0), integrator=STEP, state=good._replace(**changes))

    return call


ARGUMENTS = [
    *(
        case(f"t_span {text(span)}", run(span), ts.InvalidArgument, "t_span", "two finite times")
        for span in (None, 5.0, (0.0,), (0.0, 1.0, 2.0), (0.0, NAN), (0.0, INF), ("0", "1"), "05", (None, 1.0))
    ),
    case("t_span too large", run((0, 10**400)), ts.InvalidArgument, "t_span"),
    case("t_span two-dimensional", run([[0.0, 1.0]]), ts.InvalidArgument, "t_span"),
    case("t_span reversed", run((1.0, 0.0)), ts.InvalidArgument, "t_span", "(1, 0)", "swap"),
    case("t_span empty", run((1.0, 1.0)), ts.InvalidArgument, "t_span", "later end"),
    case("step lost in the time", run((1e20, 2e20)), ts.InvalidArgument, "step", "too small"),
    *(
        case(f"step {text(v)}", lambda w, v=v: ts.integrators.Nystrom4(step=v), ts.InvalidArgument, "step", "positive")
        for v in POSITIVE
    ),
    *(
        case(f"{name} {text(v)}", run(**{name: v}), ts.InvalidArgument, name, "positive")
        for name in ("constraint_tol", "initial_tol")
        for v in POSITIVE
    ),
    *(
        case(f"{name} {text(v)}", run(**{name: v}), ts.InvalidArgument, name, "positive whole number")
        for name in ("max_steps", "chart_interval")
        for v in COUNTS
    ),
    case("chart_interval too large", run(chart_interval=10**400), ts.InvalidArgument, "chart_interval"),
    *(
        case(f"integrator {text(v)}", run(integrator=v), ts.InvalidArgument, "integrator", "nystrom4")
        for v in ("magic", "")
    ),
    *(
        case(f"integrator {text(v)}", run(integrator=v), ts.InvalidArgument, "integrator", "Nystrom4(step=1e-3)")
        for v in (3, [STEP], object, ts.integrators, type(STEP).__mro__[2])
    ),
    *(
        case(f"formulation {text(v)}", run(formulation=v), ts.InvalidArgument, "formulation", "'null-space'")
        for v in ("magic", None, 3, ["tangent"])
    ),
    *(
        case(f"redundancy {text(v)}", run(redundancy=v), ts.InvalidArgument, "redundancy", "'refuse'")
        for v in ("keep", None, True)
    ),
    *(case(f"t_eval: {what}", run(t_eval=v), ts.InvalidArgument, "t_eval") for what, v in TIMES.items()),
    *(
        case(f"progress {text(v)}", run(progress=v), ts.InvalidArgument, "progress", "function")
        for v in (1, "yes", 3.0, [])
    ),
    *(
        case(f"state {text(v)}", run(state=v), ts.InvalidArgument, "state", "solution.state")
        for v in (3, "x", (1.0, 2.0), [])
    ),
    case("state.q too short", state(q=np.zeros(3)), ts.InvalidArgument, "state.q", "10"),
    case("state.qd of text", state(qd="x"), ts.InvalidArgument, "state.qd", "10"),
    case("state.q nan", state(q=np.full(10, NAN)), ts.InvalidArgument, "state.q", "finite"),
    case("state.q inconsistent", state(q=np.r_[0.5, np.zeros(9)]), ts.InconsistentState, "pivot[0]"),
    *(
        case(f"scene {text(v)}", lambda w, v=v: ts.simulate(v, (0, 1)), ts.InvalidArgument, "ts.Scene")
        for v in (None, 3, ts.Scene)
    ),
    case("empty scene", lambda w: ts.simulate(ts.Scene(), (0, 1)), ts.InvalidBody, "no bodies", "add_body"),
    case("empty scene, evaluate", lambda w: ts.Scene().evaluate(), ts.InvalidBody, "no bodies", "add_body"),
    case("empty scene, assemble", lambda w: ts.Scene().assemble(), ts.InvalidBody, "no bodies", "add_body"),
    *(
        case(f"evaluate t {text(v)}", lambda w, v=v: w.scene.evaluate(t=v), ts.InvalidArgument, "t must be", "finite")
        for v in (NAN, INF, "x", None, [0.0])
    ),
    *(
        case(
            f"evaluate {n}: {what}", lambda w, n=n, v=v: w.scene.evaluate(**{n: v}), ts.InvalidArgument, n, "10 finite"
        )
        for n in ("q", "qd")
        for what, v in {"short": [1.0], "text": "x", "nan": [NAN] * 10, "numbers as text": ["1"] * 10}.items()
    ),
    *(
        case(f"assemble tol {text(v)}", lambda w, v=v: w.scene.assemble(tol=v), ts.InvalidArgument, "tol", "positive")
        for v in POSITIVE
    ),
    *(
        case(f"assemble t {text(v)}", lambda w, v=v: w.scene.assemble(t=v), ts.InvalidArgument, "t must be", "finite")
        for v in (NAN, INF, "x", None)
    ),
    *(
        case(f"assemble fixed: {what}", lambda w, f=f: w.scene.assemble(fixed=f(w)), ts.TsdynError, "fixed", "bod")
        for what, f in {
            "None": lambda w: None,
            "one body": lambda w: w.rod,
            "a name": lambda w: ["bod"],
            "text": lambda w: "rod",
            "a number": lambda w: [0],
            "the ground": lambda w: [w.ground],
            "a stranger": lambda w: [w.stranger],
        }.items()
    ),
]


THREE = np.zeros(3)
INSIDE = []
INSIDE.append(INSIDE)
UNFIT = [  # arguments of another kind than their annotations say
    case("scene None", lambda w: ts.compare(None, (0, 1), with_="mujoco", step=1e-3), ts.InvalidArgument, "scene"),
    case("order an array", lambda w: ts.integrators.Radau(order=THREE), ts.InvalidArgument, "order", "whole number"),
    *(
        case(f"{name} progress an array", call, ts.InvalidArgument, "progress", "True or False")
        for name, call in {
            "equilibrium": lambda w: w.scene.equilibrium(progress=THREE),
            "linearise": lambda w: w.scene.linearise(progress=THREE),
            "ensemble": lambda w: ts.ensemble(w.scene, {"rod.mass": [1.0, 2.0]}, (0, 0.01), progress=THREE),
        }.items()
    ),
    case(
        "assemble a matrix",
        lambda w: ts.ensemble(w.scene, {"rod.mass": [1.0, 2.0]}, (0, 0.01), assemble=np.eye(3)),
        ts.InvalidArgument,
        "assemble",
    ),
    *(
        case(f"path {text(path)} of {call.__name__}", lambda w, f=call, p=path: f(p), ts.InvalidArgument, word)
        for path in ("", "a" * 1000, "\0", 3.0)
        for call, word in ((ts.resume, "path"), (ts.load, ""))
    ),
    case("source with a null byte", lambda w: ts.shapes.Mesh("\0"), ts.InvalidArgument, "Mesh"),
    case("a list that holds itself", run(integrator=None, rtol=INSIDE), ts.InvalidArgument, "rtol"),
    case("times that are ragged", lambda w: run(dense_output=True)(w).at([[1, 2], [3]]), ts.InvalidArgument, "t must"),
    case("spin zero", lambda w: w.scene.equilibrium(spin=(0, 0, 0)), ts.InvalidArgument, "spin", "at rest"),
    case("no rotors", lambda w: w.scene.equilibrium(rotors={}), ts.InvalidArgument, "rotors", "at rest"),
    *(
        case(f"name {text(name)}", lambda w, name=name: setattr(w.rod, "name", name), ts.InvalidBody, "rod", "name")
        for name in (None, "", 3, "ground", "bead")
    ),
    *(
        case(f"name {text(name)} of a joint", lambda w, n=name: setattr(w.pivot, "name", n), ts.InvalidConstraint)
        for name in (None, "", b"x")
    ),
    case("a file's title", lambda w: ts.plots.save(), ts.InvalidCall, "path"),
]


@pytest.mark.parametrize(("call", "error", "words"), ARGUMENTS + UNFIT)
def test_arguments(call, error, words):
    refuse(lambda: call(build()), error, words)


QUERIES = (
    "position",
    "orientation",
    "rotation",
    "velocity",
    "angular_velocity",
    "acceleration",
    "angular_acceleration",
)


@pytest.mark.parametrize("query", QUERIES)
def test_results_of_what_is_no_body_of_the_scene(query):
    w = build()
    solution = run(max_steps=1)(w)
    late = w.scene.add_body(1.0, (1.0, 1.0, 1.0), name="late")
    for body in (None, 0, w.ground, w.stranger, late):
        refuse(lambda body=body: getattr(solution, query)(body), ts.InvalidBody, ("not a body of this scene",))
    refuse(lambda: getattr(solution, query)("late"), ts.InvalidBody, ("no body is named 'late'",))
    if query in ("position", "velocity", "acceleration"):
        assert getattr(solution, query)(w.bead).shape == (2, 3)
    else:
        refuse(lambda: getattr(solution, query)(w.bead), ts.InvalidBody, ("bead", "no orientation"))


def test_results_of_what_is_no_constraint_of_the_scene():
    w = build()
    solution = run(max_steps=1)(w)
    late = w.scene.add(C.Distance(w.rod, w.bead, name="late"))
    refuse(lambda: solution.reaction("late"), ts.InvalidConstraint, ("no constraint or force is named 'late'",))
    for constraint in (None, 0, w.rod, C.EulerNormalization(w.stranger), late):
        refuse(
            lambda c=constraint: solution.reaction(c),
            ts.InvalidConstraint,
            ("not a constraint or force of this solution",),
        )


def test_a_tolerance_may_be_an_array_of_no_dimension():
    w = build()
    given, expected = (ts.simulate(w.scene, (0.0, 0.1), rtol=tol, atol=tol) for tol in (np.array(1e-5), 1e-5))
    np.testing.assert_array_equal(given.q, expected.q)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: ts.State(0.0), "State(): missing a required argument: 'q'"),
        (lambda: ts.State(0.0, [1.0], v=[0.0]), "State() has no argument v"),
        (lambda: ts.State(0, 1, 2, 3, 4, 5), "State() takes t, q, qd, qdd, multipliers by position, got 6"),
        (lambda: ts.Solution(), "Solution: make one by ts.simulate(scene, t_span)"),
        (lambda: ts.Solution(1, 2, 3, {}), "Solution: make one by ts.simulate(scene, t_span)"),
        (lambda: ts.Ensemble("a"), "Ensemble: make one by ts.ensemble("),
        (lambda: ts.Body(object(), object()), "Body: make one by scene.add_body(...)"),
        (lambda: ts.PointMass(*"abcdef"), "PointMass: make one by scene.add_body(...) or scene.add_point_mass(...)"),
        (lambda: ts.Point(), "Point(): missing a required argument: 'body'"),
        (lambda: ts.Angle(axle="a"), "Angle() has no argument axle"),
        (lambda: ts.Displacement(1, 2, 3), "Displacement() takes"),
        (lambda: ts.CollocationTableau(), "CollocationTableau(): missing a required argument"),
    ],
)
def test_wrong_calls_of_public_classes(call, words):
    with pytest.raises(ts.InvalidCall, match=re.escape(words)):
        call()


def test_a_state_to_start_from_needs_no_accelerations():
    scene = ts.Scene(gravity=(0.0, 0.0, -10.0))
    scene.add_point_mass(1.0, name="stone")
    start = ts.State(1.0, np.array([0.0, 0.0, 5.0]), np.array([1.0, 0.0, 0.0]))
    found = ts.simulate(scene, (1.0, 2.0), state=start)
    np.testing.assert_allclose(found.q[-1], (1.0, 0.0, 0.0), atol=ROUNDING)
    assert pickle.loads(pickle.dumps(found.state)).position("stone").shape == (3,)


@pytest.mark.parametrize("part", [slice("a", "b"), slice(0.5, 2), slice(None, None, "a"), slice(None, None, -1), 0])
def test_parts_of_solutions_that_there_are_not(part):
    scene = ts.Scene()
    scene.add_point_mass(1.0)
    with pytest.raises(ts.InvalidArgument, match="outputs are taken by slices"):
        ts.simulate(scene, (0.0, 1.0))[part]


@pytest.mark.parametrize("name", ["a\x1b[2Jb", "a\x9b31m", "a\rb", "a\x00"])
def test_control_characters_of_names_and_files_do_not_reach_a_terminal(name, tmp_path):
    scene = ts.Scene()
    ball = scene.add_point_mass(mass=1.0, name="größe 球")
    with pytest.raises(ts.InvalidBody, match="without control characters"):
        scene.add_point_mass(mass=1.0, name=name)
    with pytest.raises(ts.InvalidBody, match="holds no control characters"):
        ball.name = name
    with pytest.raises(ts.InvalidConstraint, match="without control characters"):
        ts.constraints.Distance(ball, "ground", length=1.0, name=name)
    path = tmp_path / "scene.toml"
    path.write_text(f'version = 1\n[[body]]\nname = "a"\n{json.dumps(name)} = 1\n', encoding="utf-8")
    with pytest.raises(ts.InvalidFile) as raised:
        ts.load(path)
    assert all(character.isprintable() or character == "\n" for character in str(raised.value))
