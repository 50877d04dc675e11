"""Ensembles: every case has the bits of a run of its own, and no case ends another."""

import copy
import threading

import numpy as np
import pytest

import tsdyn as ts
from examples import drive_train, four_bar, pendulum_chain, stability_map, stick_slip, tolerance_analysis, top
from tests.helpers.every_force import everything

RNG = np.random.default_rng(7)
SPAN = (0.0, 0.05)


def ball(**options):
    """A ball on a spring, and on a rod."""
    scene = ts.Scene(gravity=(0, 0, -10))
    bob = scene.add_body(1.0, (0.1, 0.2, 0.25), position=(1, 0, 0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, point_b=(0, 0, 0.5), name="rod"))
    scene.add(ts.forces.Spring(bob, scene.ground, point_a=(0, 0.1, 0), stiffness=30.0, damping=0.2, name="spring"))
    return scene


def alone(scene, table, i, **options):
    values = {name: array[i] for name, array in table.items()}
    return ts.simulate(scene.with_parameters(values), SPAN, **options)


TABLES = {
    "masses": lambda n: {"bob.mass": RNG.uniform(0.5, 2.0, n)},
    "inertias": lambda n: {"bob.inertia": RNG.uniform(0.2, 0.25, (n, 3)), "bob.mass": RNG.uniform(0.5, 2.0, n)},
    "forces": lambda n: {"spring.stiffness": RNG.uniform(10, 50, n), "spring.point_b": RNG.uniform(1, 2, (n, 3))},
    "gravity": lambda n: {"gravity": RNG.normal(size=(n, 3))},
    "velocities": lambda n: {"bob.angular_velocity": RNG.normal(size=(n, 3))},
    "starts": lambda n: {"bob.orientation": np.tile((0.6, 0.8, 0, 0), (n, 1)), "bob.velocity": np.eye(3)[[1] * n]},
    "lengths": lambda n: {"rod.length": np.full(n, np.sqrt(1.25)), "rod.point_b": np.tile((0, 0, 0.5), (n, 1))},
    "thin": lambda n: {"bob.inertia": np.tile((1e-9, 0.2, 0.2), (n, 1))},  # an axis row
}


@pytest.mark.parametrize("threads", [1, 2, None])
@pytest.mark.parametrize("which", TABLES)
def test_every_case_has_the_bits_of_a_run_alone(which, threads):
    scene, table = ball(), TABLES[which](5)
    found = ts.ensemble(scene, table, SPAN, threads=threads)
    assert found.success.all(), found.message
    assert found.lanes == 1
    for i in range(5):
        solution = alone(scene, table, i)
        assert found.q[i].tobytes() == solution.q[-1].tobytes(), i
        assert found.qd[i].tobytes() == solution.qd[-1].tobytes(), i
        assert found.case(i).q.tobytes() == solution.q.tobytes()


@pytest.mark.parametrize("options", [
    {"integrator": "dop853"}, {"integrator": "nystrom4"}, {"integrator": "sdirk54"}, {"integrator": "rk45"},
    {"formulation": "null-space"}, {"rtol": 1e-5, "t_eval": [0.01, 0.03]}, {"max_steps": 1}, {"dense_output": True},
], ids=str)  # fmt: skip
def test_options_are_those_of_simulate(options):
    scene, table = top.build(), {"top.mass": RNG.uniform(20, 40, 3), "top.inertia": RNG.uniform(80, 90, (3, 3))}
    found = ts.ensemble(scene, table, SPAN, **options)
    for i in range(3):
        solution = alone(scene, table, i, **options)
        assert found.q[i].tobytes() == solution.state.q.tobytes()
        assert (found.status[i], found.message[i], found.t[i]) == (solution.status, solution.message, solution.reached)


@pytest.mark.parametrize("change", [
    lambda scene: setattr(scene["rod"], "length", 0.7), lambda scene: setattr(scene["bob"], "mass", 5.0),
    lambda scene: setattr(scene["bob"], "name", "weight"), lambda scene: setattr(scene["bob"], "velocity", (0, 3, 0)),
    lambda scene: scene.remove("rod"), lambda scene: scene.add_point_mass(1.0, name="other"),
], ids=["length", "mass", "name", "start", "less", "more"])  # fmt: skip
def test_cases_are_of_the_scene_as_it_was(change, tmp_path):
    """Run again, copied and saved after a change of the scene; handles of the scene serve for them."""
    scene = ball()
    rod = scene["rod"]
    found = ts.ensemble(scene, {"bob.velocity": [(0, 1, 0), (0, 2, 0)]}, SPAN)
    expected = found.case(1)
    change(scene)
    for again in (found, copy.deepcopy(found), ts.load(found.save(tmp_path / "cases.h5"))):
        assert again.case(1).q.tobytes() == expected.q.tobytes()
    np.testing.assert_array_equal(found.case(1).reaction(rod)[0], expected.reaction("rod")[0])


def test_geometry_of_joints():
    scene = tolerance_analysis.build()
    table = tolerance_analysis.table(*tolerance_analysis.draw(3))

    def keep(solution):
        return {"angle": solution.angle("far bearing"), "load": solution.reaction("rocker pin")[1]}

    free = ("coupler", "rocker")
    found = ts.ensemble(scene, table, SPAN, keep=keep, assemble=free, t_eval=[0.0, 0.05], threads=1)
    assert found.success.all(), found.message
    for i in range(3):
        case = scene.with_parameters({name: values[i] for name, values in table.items()})
        case.assemble(free=free)
        solution, built = ts.simulate(case, SPAN, t_eval=[0.0, 0.05]), tolerance_analysis.build()
        for name, values in table.items():
            owner, _, attribute = name.rpartition(".")
            setattr(built[owner], attribute, values[i])
        built.assemble(free=free)
        assert ts.simulate(built, SPAN, t_eval=[0.0, 0.05]).q.tobytes() == solution.q.tobytes()
        assert found.case(i).q.tobytes() == solution.q.tobytes()
        assert found.q[i].tobytes() == solution.q[-1].tobytes()
        for name, values in keep(solution).items():
            assert found.kept[name][i].tobytes() == values.tobytes()


def test_a_start_that_can_not_be_assembled_fails_its_case_alone():
    scene = ball()
    table = {"rod.length": [1.0, 1.2, 1.3]}
    found = ts.ensemble(scene, table, SPAN, assemble=True)
    assert found.success.all(), found.message
    distances = np.linalg.norm(found.q[:, :3] - (0, 0, 0.5), axis=1)
    np.testing.assert_allclose(distances, table["rod.length"], rtol=1e-12)
    held = ts.ensemble(scene, {"rod.length": [1.0, np.sqrt(1.25)]}, SPAN, assemble=())
    assert held.success.tolist() == [False, True]
    assert "with bob held fixed" in held.message[0]


def test_rods_without_inertia_about_their_axes():
    scene = stability_map.build()
    _, _, starts = stability_map.starts(2)
    for table in (starts, {"gravity": RNG.normal(size=(4, 3))}, {"upper.mass": RNG.uniform(0.5, 2, 4)}):
        found = ts.ensemble(scene, table, SPAN)
        assert found.success.all(), found.message
        assert all(found.q[i].tobytes() == alone(scene, table, i).q[-1].tobytes() for i in range(4))


def test_masses_that_ask_for_refined_multipliers():
    """A light rod between heavier ones: series refine lam_0 where the ratio of masses is large."""
    scene = pendulum_chain.build(4)
    scene["rod 2"].mass, scene["rod 2"].inertia = 1e-3, (1e-5, 2e-5, 2e-5)
    table = {"rod 4.mass": np.array([1.0, 30.0, 100.0, 1.0])}
    found = ts.ensemble(scene, table, SPAN, rtol=1e-3, atol=1e-3, threads=1)
    assert found.success.all(), found.message
    for i in range(4):
        assert found.q[i].tobytes() == alone(scene, table, i, rtol=1e-3, atol=1e-3).q[-1].tobytes(), i


@pytest.mark.parametrize("rows", ["the same", "others"])
def test_redundant_rows_are_selected_in_each_case(rows):
    """A crank that is turned: the rows that depend on others differ from place to place, or don't."""
    scene, table = four_bar.build(), {"crank.mass": RNG.uniform(1, 2, 6), "gravity": RNG.normal(size=(6, 3))}
    if rows == "others":
        places = [scene.copy() for _ in range(6)]
        for i, place in enumerate(places):
            place.set("bearing", angle=0.9 * i, rate=2.0)
        for body in scene.bodies:
            for part in ("position", "orientation", "velocity", "angular_velocity"):
                table[f"{body.name}.{part}"] = np.array([getattr(place[body], part) for place in places])
    for keep in ("final", lambda solution: solution.reaction("bearing")[0][-1]):
        found = ts.ensemble(scene, table, SPAN, threads=1, keep=keep)
        for i in range(6):
            solution = alone(scene, table, i)
            assert found.q[i].tobytes() == solution.state.q.tobytes(), i
            assert found.message[i] == solution.message
            assert not callable(keep) or found.kept[i].tobytes() == solution.reaction("bearing")[0][-1].tobytes()


def test_a_mechanism_that_can_not_move():
    scene = ts.Scene()
    shelf = scene.add_body(2.0, (1, 1, 1), position=(1, 0, 0), name="shelf")
    for i in range(2):
        scene.add(ts.constraints.Fixed.at(shelf, scene.ground, point=(0, i, 0), name=f"bracket {i}"))
    table = {"shelf.mass": np.array([1.0, 2.0, 3.0])}
    found = ts.ensemble(scene, table, SPAN, keep=lambda s: s.reaction("bracket 0")[0][-1])
    for i in range(3):
        solution = alone(scene, table, i)
        assert found.message[i] == solution.message
        assert "immobile" in solution.message
        assert found.kept[i].tobytes() == solution.reaction("bracket 0")[0][-1].tobytes()
    assert ts.ensemble(scene, table, SPAN).message == found.message


@pytest.mark.slow
def test_redundant_rows_friction_and_functions():
    for scene in (four_bar.build(), stick_slip.build(), drive_train.build(), everything(np.random.default_rng(1))[0]):
        name = f"{scene.bodies[0].name}.mass"
        table = {name: scene.parameters()[name] * np.array([0.9, 1.1])}
        found = ts.ensemble(scene, table, SPAN, rtol=1e-5, atol=1e-5)
        for i in range(2):
            assert found.q[i].tobytes() == alone(scene, table, i, rtol=1e-5, atol=1e-5).state.q.tobytes()


def test_states_at_times_and_functions_of_the_solution():
    scene, table, times = ball(), TABLES["masses"](4), np.linspace(*SPAN, 6)
    found = ts.ensemble(scene, table, SPAN, keep="t_eval", t_eval=times)
    assert found.q.shape == (4, 6, 7)
    assert np.array_equal(found.t, times)
    runs = [alone(scene, table, i, t_eval=times) for i in range(4)]
    assert all(np.array_equal(found.qd[i], runs[i].qd) for i in range(4))
    energies = ts.ensemble(scene, table, SPAN, keep=lambda s: s.energy, t_eval=times)
    assert np.array_equal(energies.kept, [run.energy for run in runs])
    named = ts.ensemble(
        scene, table, SPAN, keep=lambda s: {"work": s.energy[-1], "tension": s.reaction("rod")[0][-1]}, t_eval=times
    )
    assert named.kept["tension"].shape == (4, 3)
    assert np.array_equal(named.kept["tension"][2], runs[2].reaction("rod")[0][-1])


def test_a_failed_case_ends_no_other():
    scene = ball()
    masses = np.array([1.0, -1.0, 2.0, np.nan, 3.0])
    points = np.tile((0, 0, 0.5), (5, 1))
    points[2] = (0, 0, 3)
    found = ts.ensemble(scene, {"bob.mass": masses, "rod.point_b": points}, SPAN)
    assert found.success.tolist() == [True, False, False, False, True]
    assert (found.status[[1, 2, 3]] == ts.Status.CASE_FAILED).all()
    assert "mass (kg) must be a positive" in found.message[1]
    assert "breaks 1 constraint row" in found.message[2]
    assert np.isnan(found.q[1:4]).all()
    assert "2 success, 3 case_failed" in repr(found)
    good = ts.ensemble(scene, {"bob.mass": masses[[0, 4]]}, SPAN)
    assert np.array_equal(good.q, found.q[[0, 4]])


def test_a_function_that_raises_is_told():
    def odd(solution):
        if solution.scene.body("bob").mass > 1.5:
            raise ValueError("too heavy")
        return 1.0

    found = ts.ensemble(ball(), {"bob.mass": [1.0, 2.0]}, SPAN, keep=odd)
    assert found.message == ["The run reached the end of the interval.", "keep raised ValueError: too heavy."]
    assert found.kept[0] == 1.0
    assert np.isnan(found.kept[1])


def test_events_end_cases():
    def falls(t, state):
        return state.position("bob")[2] + 0.002

    falls.terminal = True
    found = ts.ensemble(ball(), {"bob.mass": [1.0, 1.0], "gravity": [(0, 0, -10), (0, 0, 10)]}, SPAN, events=falls)
    assert (found.status == [ts.Status.EVENT, ts.Status.SUCCESS]).all()
    assert found.t[0] < SPAN[1] == found.t[1]


def test_cases_of_a_function_and_of_a_dataframe():
    pandas = pytest.importorskip("pandas")
    scene, masses = ball(), np.array([1.0, 2.0, 3.0])
    tables = (
        {"bob.mass": masses, "gravity": (0, 0, -9)},
        pandas.DataFrame({"bob.mass": masses, "gravity": 3 * [(0, 0, -9)]}),
    )
    called = ts.ensemble(scene, lambda i: {"bob.mass": masses[i], "gravity": (0, 0, -9)}, SPAN, cases=3)
    for table in tables:
        assert np.array_equal(ts.ensemble(scene, table, SPAN).q, called.q)
    assert np.array_equal(called.parameters["bob.mass"], masses)


def test_controllers_have_a_state_of_their_own_in_each_case():
    class Integral:
        def __init__(self):
            self.sum = 0.0

        def __call__(self, t, angle, rate):
            self.sum += 1.0 - angle
            return 5.0 * self.sum

    scene = ts.Scene()
    wheel = scene.add_body(1.0, (1, 1, 2), name="wheel")
    hinge = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(ts.forces.JointTorque(hinge, function=Integral(), period=0.01))
    found = ts.ensemble(scene, {"wheel.mass": [1.0, 1.0, 1.0]}, (0, 0.1), threads=2)
    assert (found.q == found.q[0]).all()
    assert (found.q[0] == found.case(0).q[-1]).all()


def test_ctrl_c_keeps_finished_cases():
    def interrupt(fraction):
        if fraction >= 0.02:
            raise KeyboardInterrupt

    scene, masses = ball(), np.linspace(1, 2, 600)
    for threads in (1, 2):
        found = ts.ensemble(scene, {"bob.mass": masses}, SPAN, progress=interrupt, threads=threads)
        assert found.interrupted
        assert 12 <= found.success.sum() < 600 or threads == 2
    masses = masses[:6]

    calls = []

    def keep(solution):
        calls.append(0)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return 0.0

    found = ts.ensemble(scene, {"bob.mass": masses}, SPAN, keep=keep, threads=1)
    assert found.interrupted
    assert found.success.tolist() == [True] * 3 + [False] * 3
    assert (found.status[3:] == ts.Status.NOT_RUN).all()
    assert "resume=True" in ts.Status.NOT_RUN.remedy


def test_progress_and_threads():
    fractions = []
    scene = ball()
    found = ts.ensemble(scene, {"bob.mass": np.linspace(1, 2, 9)}, SPAN, progress=fractions.append, threads=2)
    assert fractions[-1] == 1.0
    assert fractions == sorted(fractions)
    assert found.threads == 2
    assert threading.active_count() < 10


def test_tables_and_reprs():
    xarray, pandas = pytest.importorskip("xarray"), pytest.importorskip("pandas")
    scene, times = ball(), np.linspace(*SPAN, 3)
    table = {"bob.mass": np.array([1.0, 2.0]), "gravity": (0, 0, -9)}
    found = ts.ensemble(scene, table, SPAN, keep="t_eval", t_eval=times)
    data, frame = found.to_xarray(), found.to_dataframe()
    assert isinstance(data, xarray.Dataset)
    assert isinstance(frame, pandas.DataFrame)
    assert data.q.sel(case=1, coordinate="bob.z").shape == (3,)
    assert data["bob.mass"].attrs["units"] == "kg"
    assert frame.loc[(1, times[2]), "q bob.z"] == found.q[1, 2, 2]
    final = ts.ensemble(scene, table, SPAN).to_dataframe()
    assert final["gravity[2]"].tolist() == [-9, -9]
    assert final["status"].tolist() == ["success", "success"]
    assert "Ensemble" in found._repr_html_()
    assert len(found) == 2


WRONG = {
    "did you mean bob.mass": {"parameters": {"bob.mas": [1.0]}},
    "as many values as there are cases": {"parameters": {"bob.mass": [1.0, 2.0], "gravity": np.zeros((3, 3))}},
    "the table has no cases": {"parameters": {"bob.mass": []}},
    "a mapping of names to arrays": {"parameters": 3},
    "needs the number of cases": {"parameters": lambda i: {}},
    "neither one for all cases": {"parameters": {"bob.mass": np.ones((2, 2))}},
    "three cases of principal values": {"parameters": {"bob.inertia": np.eye(3)}},
    "keep must be": {"keep": "last"},
    "give them": {"keep": "t_eval"},
    "threads must be": {"threads": 0},
    "lanes must be one of": {"lanes": 2},
    "ensemble\\(\\) has no argument rtool": {"rtool": 1.0},
    "rtol must be": {"rtol": -1.0},
    "has no argument checkpoint": {"checkpoint": 1.0},
    "progress must be": {"progress": 3},
    "did you mean 'bob'": {"assemble": ["bobb"]},
    "assemble must be True": {"assemble": "bob"},
    "leave one of them out": {"assemble": True, "state": 3},
}


@pytest.mark.parametrize("message", WRONG)
def test_wrong_arguments_are_refused_before_the_first_run(message):
    given = {"parameters": {"bob.mass": [1.0, 2.0]}, "t_span": SPAN, **WRONG[message]}
    with pytest.raises(ts.TsdynError, match=message):
        ts.ensemble(ball(), **given)


def rod():
    scene = ts.Scene()
    bob = scene.add_point_mass(1.0, position=(1, 0, 0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, length=1.0, name="rod"))
    return scene


def test_the_first_reason_of_failed_cases_is_shown():
    for lengths, first in (([2.0, 3.0], 0), ([1.0, 3.0], 1)):
        found = ts.ensemble(rod(), {"rod.length": lengths}, (0.0, 0.1))
        for text in (repr(found), found._repr_html_()):
            assert f"case {first}: the initial position breaks 1 constraint row" in text
            assert "rod: Phi = " in text
    assert "case" not in repr(ts.ensemble(rod(), {"bob.mass": [1.0, 2.0]}, (0.0, 0.1))).partition("cases")[2]
