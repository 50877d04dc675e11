"""The compiled loop over cases: no Python between them, and the bits of runs alone."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.rods_on_a_spring import two_rods_on_a_spring as chain
from tsdyn.ensembles import case_loop, runner
from tsdyn.ensembles.tolerances import TRIED
from tsdyn.runs.run_log import CHART_ROOM
from tsdyn.taylor.series_engine import SeriesEngine, SeriesMemory

RNG = np.random.default_rng(11)
SPAN = (0.0, 0.05)
CASES = 24


def swung(off=0.0):
    """The chain swung about the y-axis, positions off by so much."""
    angle, table = RNG.uniform(0, 2, CASES), {}
    zero = 0 * angle
    for i in range(2):
        position = np.stack([np.cos(angle), zero, -np.sin(angle)], 1) * (i + 0.5)
        table[f"rod {i}.position"] = position + off * RNG.normal(size=position.shape)
        table[f"rod {i}.orientation"] = np.stack([np.cos(angle / 2), zero, np.sin(angle / 2), zero], 1)
    return table


def uniform(*shape):
    return RNG.uniform(0.9, 1.0, (CASES, *shape))


TABLES = {
    "gravity": lambda: {"gravity": RNG.normal(size=(CASES, 3))},
    "masses": lambda: {"rod 0.mass": uniform(), "rod 1.inertia": 0.1 * uniform(3)},
    "starts": swung,
    "starts that are projected": lambda: swung(1e-11) | {"rod 1.mass": uniform()},
    "matrices and spins": lambda: {"rod 1.inertia": uniform(1, 1) * np.diag((1, 2, 2)), "rod 0.mass": uniform()},
    "forces": lambda: {"spring.stiffness": uniform(), "spring.point_b": uniform(3), "spring.damping": uniform()},
}


@pytest.fixture
def by_python(monkeypatch):
    """The cases that were run one by one."""
    run, cases = runner.Runner.run, []
    monkeypatch.setattr(runner.Runner, "run", lambda self, room, k: cases.append(room.first + k) or run(self, room, k))
    return cases


def compare(scene, table, found, **options):
    for i in range(CASES):
        case = scene.with_parameters({name: array[i] for name, array in table.items()})
        solution = ts.simulate(case, SPAN, **options)
        assert found.q[i].tobytes() == solution.state.q.tobytes(), i
        assert found.qd[i].tobytes() == solution.state.qd.tobytes(), i
        assert (found.message[i], found.reached[i]) == (solution.message, solution.reached)


@pytest.mark.parametrize("which", TABLES)
def test_cases_after_the_first_need_no_python(which, by_python):
    scene, table = chain(), TABLES[which]()
    found = ts.ensemble(scene, table, SPAN, threads=1)
    assert by_python == [0]
    compare(scene, table, found)


def sized(length):
    """Both rods of another length, and as many times as far apart."""
    table, zero = {}, 0 * length
    for i in range(2):
        table[f"rod {i}.position"] = np.stack([length * (i + 0.5), zero, zero], 1)
        table[f"joint {i}.point_b"] = np.stack([-0.5 * length, zero, zero], 1)
    return table | {"joint 1.point_a": np.stack([0.5 * length, zero, zero], 1)}


def test_points_of_joints(by_python):
    scene, table = chain(), sized(RNG.uniform(0.3, 3.0, CASES))
    found = ts.ensemble(scene, table, SPAN, threads=1)
    assert by_python == [0]
    compare(scene, table, found)
    table["rod 0.mass"] = uniform()
    table["joint 0.point_b"][3] += 1e-3  # breaks the joint
    table["joint 0.point_b"][4, 0] *= 1.0 + 1e-12
    table["joint 1.point_b"][5] = np.inf
    found = ts.ensemble(scene, table, SPAN, threads=1)
    assert np.flatnonzero(~found.success).tolist() == [3, 5]
    for i in (0, 4, 6, 23):
        solution = ts.simulate(scene.with_parameters({name: array[i] for name, array in table.items()}), SPAN)
        assert found.q[i].tobytes() == solution.state.q.tobytes()
    small = {name: 1e-4 * array if array.ndim == 2 else array for name, array in sized(uniform()).items()}
    compare(scene, small, ts.ensemble(scene, small, SPAN, threads=1))


def test_lengths(by_python):
    scene = ts.Scene(gravity=(0, 0, -10))
    bob = scene.add_point_mass(1.0, position=(1, 0, 0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    length = np.geomspace(1e-4, 1e8, CASES)
    table = {"rod.length": length, "bob.position": length[:, None] * np.eye(3)[0]}
    found = ts.ensemble(scene, table, SPAN, threads=1)
    assert by_python == [0]
    compare(scene, table, found)


def test_numbers_of_a_constraint_without_points(by_python):
    """A body whose axis keeps an angle of its own to the ground's."""

    def tilted(angle):
        return np.stack([np.cos(angle / 2), np.sin(angle / 2), 0 * angle, 0 * angle], -1)

    scene, angle = ts.Scene(), RNG.uniform(0.2, 0.4, CASES)
    body = scene.add_body(
        1.0, (0.2, 0.3, 0.4), orientation=tilted(np.array(0.3)), angular_velocity=(0, 0, 2), name="body"
    )
    scene.add(
        ts.constraints.Dot1(body, scene.ground, axis_a=(0, 0, 1), axis_b=(0, 1, 0), value=-np.sin(0.3), name="dot")
    )
    table = {"dot.value": -np.sin(angle), "body.orientation": tilted(angle)}
    found = ts.ensemble(scene, table, SPAN, threads=1)
    assert by_python == [0]
    assert found.success.all()
    compare(scene, table, found)


@pytest.mark.parametrize("joint", ["Revolute", "Universal"])
def test_axes_and_points_of_a_pin(joint):
    scene = ts.Scene(gravity=(0, 0, -10))
    body = scene.add_body(1.0, (0.1, 0.1, 0.1), position=(0.5, 0, 0), name="body")
    axes = {"axis": (0, 1, 0)} if joint == "Revolute" else {"axis_a": (0, 1, 0), "axis_b": (0, 0, 1)}
    scene.add(getattr(ts.constraints, joint).at(scene.ground, body, point=(0, 0, 0), **axes, name="pin"))
    length = uniform()
    points = {"pin.point_b": -length[:, None] * np.eye(3)[0], "body.position": length[:, None] * np.eye(3)[0]}
    compare(scene, points, ts.ensemble(scene, points, SPAN, threads=1))
    if joint == "Revolute":
        turned = np.stack([0 * length, length, 0 * length], 1)
        axes = points | {"pin.axis_a": turned, "pin.axis_b": turned}
        compare(scene, axes, ts.ensemble(scene, axes, SPAN, threads=1))


def test_outputs_at_times(by_python):
    scene, table, times = chain(), TABLES["masses"](), [0.0, 0.01, 0.03, 0.05]
    found = ts.ensemble(scene, table, SPAN, t_eval=times, keep="t_eval", threads=1)
    assert by_python == [0]
    for i in range(0, CASES, 5):
        values = {name: array[i] for name, array in table.items()}
        solution = ts.simulate(scene.with_parameters(values), SPAN, t_eval=times)
        assert found.q[i].tobytes() == solution.q.tobytes()
        assert found.qd[i].tobytes() == solution.qd.tobytes()


def test_inadmissible_cases_are_told_and_end_no_other(by_python):
    scene, table = chain(), swung() | {name: array for t in ("masses", "forces") for name, array in TABLES[t]().items()}
    table["rod 0.mass"][5] = -1.0
    table["rod 0.mass"][6] = np.nan
    table["rod 1.inertia"][7] = (1.0, 1.0, 3.0)
    table["rod 1.inertia"][8] = np.inf
    table["rod 1.inertia"][9] = 0.0
    table["rod 0.position"][10] += 1e-3
    table["rod 0.orientation"][11] *= 1.01
    table["spring.stiffness"][12] = np.nan
    found = ts.ensemble(scene, table, SPAN, threads=1)
    assert np.flatnonzero(~found.success).tolist() == list(range(5, 13))
    assert by_python == [0, *range(5, 13)]
    for i in range(CASES):
        other = scene.with_parameters
        values = {name: array[i] for name, array in table.items()}
        if found.success[i]:
            assert found.q[i].tobytes() == ts.simulate(other(values), SPAN).state.q.tobytes()
        else:
            with pytest.raises(ts.TsdynError) as refused:
                ts.simulate(other(values), SPAN)
            assert found.message[i] == str(refused.value)


def test_thin_bodies_and_unequal_masses_are_run_as_scenes_of_their_own(by_python):
    scene, table = chain(), {"rod 0.mass": uniform(), "rod 1.inertia": 0.1 * uniform(3)}
    table["rod 1.inertia"][4] = (1e-12, 0.1, 0.1)
    table["rod 0.mass"][6] = 1e6
    found = ts.ensemble(scene, table, SPAN, threads=1)
    assert by_python == [0, 4, 6]
    compare(scene, table, found)


def test_a_thin_body_that_gains_inertia():
    scene = chain()
    scene["rod 1"].inertia = (0.1, 0.1, 1e-12)
    table = {"rod 1.inertia": 0.1 * uniform(3)}
    compare(scene, table, ts.ensemble(scene, table, SPAN, threads=1))


def test_long_cases_are_run_once(by_python, monkeypatch):
    """A case that doesn't end within the steps of the loop is run by Python; where most are, all of them."""
    monkeypatch.setattr(case_loop, "FIRST_SLICE", 40)
    monkeypatch.setattr(case_loop, "TRIED", 2)
    scene, table = chain(), {"rod 0.angular_velocity": np.zeros((CASES, 3)), "rod 0.mass": uniform()}
    found = ts.ensemble(scene, table, SPAN, threads=1, max_step=np.diff(SPAN)[0] / 50)
    assert len(by_python) == CASES
    compare(scene, table, found, max_step=np.diff(SPAN)[0] / 50)


def test_motions_that_turn_stiff_or_singular_are_left_to_python():
    scene = ts.Scene(gravity=(0, 0, -10))
    bob = scene.add_point_mass(1.0, position=(1, 0, 0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    wall = scene.add(ts.forces.Spring(bob, scene.ground, point_b=(1, 0, 1), stiffness=1.0, damping=0.0, name="spring"))
    table = {f"{wall.name}.damping": np.geomspace(1e-3, 1e7, CASES)}
    found = ts.ensemble(scene, table, SPAN, threads=1)
    compare(scene, table, found)


def test_runs_with_a_chart_in_each_step_need_no_python(by_python):
    """A slice had room for a hundred charts, and each case was begun twice."""
    scene, span = chain(), (0.0, 30.0)
    table = {"rod 0.mass": uniform(), "gravity": RNG.normal(size=(CASES, 3))}
    found = ts.ensemble(scene, table, span, threads=1)
    assert by_python == [0]
    for i in (1, CASES - 1):
        solution = ts.simulate(scene.with_parameters({name: array[i] for name, array in table.items()}), span)
        assert solution.stats.charts > 2 * CHART_ROOM
        assert found.q[i].tobytes() == solution.state.q.tobytes()


def test_longer_runs_share_a_memory_and_are_not_begun_twice(monkeypatch):
    """Each case made a memory of its own, and ran its first steps twice."""
    made, begun, enter = [], [], SeriesMemory.enter
    memory = SeriesEngine.memory
    monkeypatch.setattr(SeriesEngine, "memory", lambda *given: made.append(0) or memory(*given))
    monkeypatch.setattr(SeriesMemory, "enter", lambda *given: begun.append(0) or enter(*given))
    scene, table, options = chain(), {"rod 0.mass": uniform()}, {"max_step": 2e-3}
    found = ts.ensemble(scene, table, (0.0, 3.0), threads=1, **options)
    assert found.success.all(), found.message
    assert len(made) <= 2
    assert len(begun) <= CASES + TRIED + 2
    for i in (0, TRIED, CASES - 1):
        solution = ts.simulate(scene.with_parameters({"rod 0.mass": table["rod 0.mass"][i]}), (0.0, 3.0), **options)
        assert solution.stats.steps > case_loop.FIRST_SLICE
        assert found.q[i].tobytes() == solution.state.q.tobytes()
