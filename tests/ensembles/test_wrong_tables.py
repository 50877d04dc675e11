"""Tables with mistakes: what is wrong with all cases is told at once, what is wrong with one beside the others."""

import numpy as np
import pytest

import tsdyn as ts

SPAN = (0.0, 0.02)


def ball():
    """A ball on a rod and a spring, which is pushed."""
    scene = ts.Scene(gravity=(0, 0, -10))
    bob = scene.add_body(1.0, (0.1, 0.2, 0.25), position=(1, 0, 0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    scene.add(ts.forces.Spring(bob, scene.ground, point_a=(0, 0.1, 0), stiffness=30.0, name="spring"))
    scene.add(ts.forces.Bushing(bob, scene.ground, stiffness=0.1, name="bush"))
    scene.add(ts.forces.PointForce(bob, force=(1, 0, 0), name="push"))
    return scene


BAD = {  # value of a case -> what its message shows
    "bob.mass": (-1.0, "got -1.0."),
    "bob.inertia": ((1.0, np.nan, 1.0), "got [1.0, nan, 1.0]."),
    "bob.orientation": ((np.nan, 0.0, 0.0, 1.0), "[nan, 0.0, 0.0, 1.0]"),
    "bob.velocity": ((0.0, np.inf, 0.0), "got [0.0, inf, 0.0]."),
    "gravity": ((np.nan, 0.0, 0.0), "got [nan, 0.0, 0.0]."),
    "rod.point_b": ((np.nan, 0.0, 0.0), "got [nan, 0.0, 0.0]."),
    "rod.length": (np.nan, "nan"),
    "spring.stiffness": (-2.0, "got -2.0."),
    "bush.stiffness": ((1.0, -1.0, 0.0), "got [1.0, -1.0, 0.0]."),
    "push.force": ((np.inf, 0.0, 0.0), "got [inf, 0.0, 0.0]."),
}


@pytest.mark.parametrize("name", BAD)
def test_messages_show_plain_numbers(name):
    scene, (bad, said) = ball(), BAD[name]
    good = scene.parameters()[name]
    good = np.diagonal(good) if name == "bob.inertia" else good
    found = ts.ensemble(scene, {name: np.stack([good, np.asarray(bad)])}, SPAN, threads=1)
    assert found.success.tolist() == [True, False], found.message
    assert said in found.message[1]
    assert "array(" not in found.message[1]
    assert "np." not in found.message[1]


def test_messages_are_short_where_values_are_long():
    with pytest.raises(ts.InvalidBody, match="must be three finite numbers") as caught:
        ts.Scene().add_point_mass(mass=1.0, position=np.arange(1000.0))
    assert len(str(caught.value)) < 300


class Start:
    """A state of so many coordinates."""

    def __init__(self, n):
        self.q, self.qd = np.zeros(n), np.zeros(n)


class Shove(ts.Force):
    """A force without series."""

    markers = (ts.Point("a"),)

    @staticmethod
    def law(x, xd, par, t, out):
        """To the right."""
        out[0] = 1.0 + 0.0 * x[0]


def runs_alone(solution, more=None):
    return 1.0


MASSES = {"bob.mass": [1.0, 2.0]}
OF_ALL = {  # message: arguments
    "state must have q and qd": {"state": 3},
    r"state.q must be 7 finite numbers, .* got \[0.0, 0.0, 0.0\]": {"state": Start(3)},
    "bob.velocity and state: every case starts from the state": {
        "parameters": {"bob.velocity": np.zeros((2, 3))}, "state": Start(7),
    },
    "bob.mass must be numbers, got '2.5' in case 1. Convert": {"parameters": {"bob.mass": [1.0, "2.5"]}},
    "bob.mass must be numbers, got True in case 0": {"parameters": {"bob.mass": [True, False]}},
    "bob.mass must be numbers, got 1j in case 1": {"parameters": {"bob.mass": [1.0, 1j]}},
    "bob.mass must be numbers, got 'heavy'": {"parameters": {"bob.mass": "heavy", "gravity": np.zeros((2, 3))}},
    r"gravity must be numbers, got \['0', '0', '-9'\] in case 0": {"parameters": {"gravity": [["0", "0", "-9"]]}},
    "bob.mass: give the values of the cases as a list": {"parameters": {"bob.mass": {1.0, 2.0}}},
    r"gravity: the values of the cases have the shape \(2,\), and must have \(3,\)": {
        "parameters": {"gravity": np.zeros((4, 2))},
    },
    r"mass \(kg\) must be a positive finite number, got -1.0": {"parameters": {"bob.mass": -1.0}},
    "push: force must be three finite numbers": {"parameters": {"push.force": (1.0, 2.0), **MASSES}},
    "the table has no cases: there are no values of gravity": {"parameters": {"gravity": np.zeros((0, 3))}},
    "cases must be a positive whole number, got 0": {"parameters": {}, "cases": 0},
    "cases must be a positive whole number, got '3'": {"parameters": {}, "cases": "3"},
    "keep must be 'final', 't_eval' or a function": {"keep": "finale"},
    r"keep is called with \(solution\), and <lambda>\(\) can't be: too many": {"keep": lambda: 1.0},
    r"keep is called with \(solution\), and <lambda>\(a, b\) can't be: missing": {"keep": lambda a, b: 1.0},
    r"event 0 \(<lambda>\) is called with \(t, state\)": {"events": [lambda t: 1.0]},
    r"the function of cases is called with \(case\)": {"parameters": lambda: MASSES, "cases": 2},
    "unknown integrator 'rk46'.* did you mean rk45": {"integrator": "rk46"},
    "Taylor series are .* need no other form": {"integrator": "taylor", "formulation": "null-space"},
    "rtol must be a positive finite number, got 'fine'": {"rtol": "fine"},
    "has no argument keeep; did you mean keep": {"keeep": "final"},
    "the scene has no parameter 'bob'; there are bob.mass, bob.position": {"parameters": {"bob": [1.0, 2.0]}},
    "the scene has no parameter 'rod.axes'; there are .*rod.length": {"parameters": {"rod.axes": [1.0, 2.0]}},
    r"of mappings, one for each case, make a DataFrame": {"parameters": [{"bob.mass": 1.0}, {"bob.mass": 2.0}]},
    r"progress is called with \(fraction\)": {"progress": lambda done, total: None},
    "resume must be True or False, got 'yes'": {"resume": "yes"},
    "threads and executor": {"threads": 2, "executor": object()},
}  # fmt: skip


@pytest.mark.parametrize("message", OF_ALL)
def test_what_is_wrong_with_all_cases_is_told_before_the_first(message):
    seen = []
    given = {"parameters": MASSES, "t_span": SPAN, "progress": seen.append, **OF_ALL[message]}
    with pytest.raises(ts.TsdynError, match=message):
        ts.ensemble(ball(), **given)
    assert not seen


def test_a_scene_without_series_is_no_scene_for_taylor():
    scene = ball()
    scene.add(Shove(scene["bob"], name="shove"))
    with pytest.raises(ts.InvalidArgument, match="Taylor needs the series of every constraint and force"):
        ts.ensemble(scene, MASSES, SPAN, integrator="taylor")


def test_tables_of_pandas_with_mistakes():
    pandas = pytest.importorskip("pandas")
    with pytest.raises(ts.InvalidArgument, match=r"the DataFrame has no rows. Has a selection left none"):
        ts.ensemble(ball(), pandas.DataFrame(MASSES)[:0], SPAN)
    with pytest.raises(ts.InvalidArgument, match=r"bob.mass must be numbers, got '1.5' in case 0"):
        ts.ensemble(ball(), pandas.DataFrame({"bob.mass": ["1.5", "2"]}), SPAN)


def test_functions_with_more_arguments_that_have_defaults():
    assert ts.ensemble(ball(), MASSES, SPAN, keep=runs_alone).kept.tolist() == [1.0, 1.0]
    assert ts.ensemble(ball(), MASSES, SPAN, keep=lambda *given: len(given)).kept.tolist() == [1.0, 1.0]


def test_a_value_for_all_may_depend_on_one_that_varies():
    scene = ts.Scene()
    block = scene.add_point_mass(mass=1.0, name="block")
    table = scene.add(ts.constraints.PlaneContact(block, scene.ground, normal_b=(0, 0, 1)))
    scene.add(ts.forces.ContactFriction(table, kinetic=0.4, static=0.5, name="rub"))
    found = ts.ensemble(scene, {"rub.static": 0.3, "rub.kinetic": [0.1, 0.2, 0.35]}, SPAN, threads=1)
    assert found.success.tolist() == [True, True, False], found.message


def test_what_functions_raise_is_told_by_case():
    def odd(case):
        return {"bob.mass": 1.0 / case}

    found = ts.ensemble(ball(), odd, SPAN, cases=2)
    assert found.message[0] == "the function of cases raised ZeroDivisionError: float division by zero."
    assert found.success.tolist() == [False, True]
    found = ts.ensemble(ball(), MASSES, SPAN, keep=lambda solution: solution.state)
    assert "keep must return numbers" in found.message[0]
