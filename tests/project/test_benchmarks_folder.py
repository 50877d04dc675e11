"""The folder benchmarks/: scenes, kernels written by hand, the other engines that are installed; nothing is timed."""

import json
import subprocess
import sys

import numpy as np
import pytest

import tsdyn as ts
from benchmarks import contacts, ours, peers, rolling
from benchmarks.by_hand import contenders as by_hand
from benchmarks.contender import Contender, Outcome, rotation
from benchmarks.measure import Measured, Row, measure
from benchmarks.scenes import SCENES, of_file
from examples import top
from tests.helpers.scenes import constraints
from tests.helpers.tolerances import EXACT, FINE, HELD, LOOSE, ROUNDING, TIGHT
from tsdyn.stress import rods

PEERS = peers.contenders()
SMALL = ("sliding top", "two-body pendulum", "two-body pendulum in space", "chain of 4", "tree of 7", "loop of 4")


def error(contender, name, value):
    """The error of a run at the end."""
    scene = SCENES[name]
    reference = scene.reference()
    return contender.prepare(scene)(value).error(reference.r[-1], reference.A[-1])


def test_rolling_ends_where_the_closed_forms_say():
    """By each program that is installed, to what its middle setting allows."""
    for motion, program, _, values, run, exact in rolling.contenders():
        ours, theirs = (1e-8, 0.05) if motion == "nodding" else (1e-9, 0.01)  # the motion that is not steady
        assert np.linalg.norm(run(values[1])[1] - exact) < (ours if program == "tsdyn" else theirs)


def test_contacts_end_where_the_references_say():
    limits = {"ball": 1e-14, "chain": 1e-9, "rocking": 1e-11, "slope": 0.0}
    for motion, (reference, runs) in contacts.RUNS.items():
        assert abs(runs["tsdyn"](1e-8)[1] - reference()) <= limits[motion]


@pytest.mark.parametrize("links", [4, 16])
def test_chains_are_those_of_the_reference_files(links):
    mine, theirs = rods.chain(links), of_file(f"chain_{links}")
    assert mine["constraints"] == theirs["constraints"]
    assert mine["forces"] == theirs["forces"]
    np.testing.assert_equal(mine["gravity"], theirs["gravity"])
    for one, other in zip(mine["bodies"], theirs["bodies"], strict=True):
        for key, value in one.items():
            np.testing.assert_allclose(value, other[key], rtol=0, atol=1e-16)


@pytest.mark.slow_for("hub*", "net*")
@pytest.mark.parametrize(
    ("definition", "bodies", "rows"),
    [
        (rods.chain(3), 3, 9),
        (rods.tree(4), 15, 45),
        (rods.hub(20), 21, 63),
        (rods.loop(5), 5, 18),
        (rods.net(2, 3), 17, 3 * (2 * 17 - 12 + 2)),
    ],
    ids=["chain", "tree", "hub", "loop", "net"],
)
def test_mechanisms_are_consistent_and_of_full_rank(definition, bodies, rows):
    scene = rods.build(definition)
    assert len(scene.bodies) == bodies
    found = scene.evaluate()
    assert found.Phi.size == rows + bodies
    q = np.concatenate([[*body["position"], *body["orientation"]] for body in definition["bodies"]])
    assert np.abs(constraints(definition, q, 0.0)).max() < ROUNDING
    Phi_q = found.Phi_q.toarray() if hasattr(found.Phi_q, "toarray") else found.Phi_q
    assert np.linalg.svd(Phi_q)[1].min() > 0.01


def test_every_scene_has_a_reference():
    for name, scene in SCENES.items():
        if scene.size > 64:
            continue
        reference = scene.reference()
        assert reference.t == scene.end
        assert reference.r.shape == (1, scene.size, 3)
        assert reference.A.shape == (1, scene.size, 3, 3)
        assert reference.trusted < TIGHT, name


@pytest.mark.slow
@pytest.mark.parametrize("contender", by_hand.CONTENDERS, ids=lambda one: one.name)
@pytest.mark.parametrize(
    "name",
    ["sliding top", "two-body pendulum", "two-body pendulum in space", "chain of 1", "chain of 4", "chain of 16"],
)
def test_kernels_by_hand_agree_with_references(contender, name):
    scene = SCENES[name]
    if not contender.serves(scene):
        pytest.skip("written for other scenes")
    reference, run = scene.reference(), contender.prepare(scene)
    coarse, fine = (run(tol).error(reference.r[-1], reference.A[-1]) for tol in (1e-6, 1e-13))
    assert 1e-11 < coarse < LOOSE
    assert fine < 5 * HELD


@pytest.mark.slow
def test_kernels_by_hand_agree_on_a_long_chain():
    one, two = (contender.prepare(SCENES["chain of 64"])(1e-13) for contender in by_hand.CONTENDERS)
    assert one.error(two.r, two.A) < FINE


@pytest.mark.parametrize("peer", PEERS, ids=lambda one: one.name)
def test_peers_say_what_they_are(peer):
    assert isinstance(peer, Contender)
    assert peer.name
    assert peer.setting in ("tolerance", "step")
    assert list(peer.values) == sorted(peer.values, reverse=True)
    line = peer.missing()
    if line:
        assert peer.name in line
        assert peer.get in line
    else:
        assert peer.version()
    assert not peer.serves(SCENES["stiff joint"])


# settings at which each comes within 1e-4, on scenes that all but the most special serve
GOOD = {"tolerance": 1e-8, "step": 3e-4}


@pytest.mark.slow
@pytest.mark.parametrize("peer", PEERS, ids=lambda one: one.name)
@pytest.mark.parametrize("name", SMALL)
def test_peers_that_are_installed_agree_with_references(peer, name):
    if peer.missing():
        pytest.skip(peer.missing())
    if not peer.serves(SCENES[name]):
        pytest.skip("written for other scenes")
    bound = 2e-2 if peer.name in ("MuJoCo, constraints", "Exudyn, constraints") else 2e-4
    assert error(peer, name, GOOD[peer.setting]) < bound


def test_a_peer_that_is_missing_is_passed_over():
    class Absent(Contender):
        name, get = "absent", "pip install absent"

        def version(self):
            raise ImportError("No module named 'absent'")

    assert Absent().missing() == "absent is left out: pip install absent (No module named 'absent')"


def test_the_default_and_every_method_take_part():
    names = [one.name for one in ours.contenders()]
    assert names[0] == "tsdyn"
    assert {"tsdyn, DOP853", "tsdyn, RK45", "tsdyn, Nystrom4"} <= set(names)
    for one in ours.contenders():
        assert one.setting == ("step" if one.name == "tsdyn, Nystrom4" else "tolerance")


def test_measure_goes_from_loose_to_tight_and_times_what_ran():
    class Halving(Contender):
        name, values = "halving", (1e-1, 1e-3, 1e-5, 1e-7)

        def serves(self, scene):
            return True

        def prepare(self, scene):
            reference = scene.reference()

            def run(value):
                if value < 1e-6:
                    raise RuntimeError("no such luck")
                return Outcome(1e-3 / value**0.5, reference.r[-1] + value, reference.A[-1])

            return run

    found = measure(SCENES["sliding top"], [Halving()], repeats=2, report=lambda line: None)
    assert [row.value for row in found.rows] == [1e-1, 1e-3, 1e-5, 1e-7]
    np.testing.assert_allclose([row.error for row in found.rows], [1e-1, 1e-3, 1e-5, np.inf])
    assert [row.rounds for row in found.rows] == [2, 2, 2, 0]
    assert found.rows[-1].message == "RuntimeError: no such luck"
    assert found.seconds_to("halving", 1e-3) == pytest.approx(1e-3 / 1e-3**0.5)
    assert found.seconds_to("halving", 1e-4) == pytest.approx(1e-3 / 1e-4**0.5)  # between two settings
    assert found.seconds_to("halving", 1e-8) == np.inf
    assert "halving" in found.table()


def test_results_are_written_and_read(tmp_path):
    from benchmarks import work_precision

    rows = (Row("a", "tolerance", 1e-3, 1e-4, 0.1, 0.1, 3), Row("b", "step", np.nan, np.inf, np.inf, np.inf, 0, "no"))
    given = [Measured("scene", 1e-15, "made up", rows)]
    work_precision.write(given, [], tmp_path / "found.json")
    assert {"machine", "packages", "commit", "date"} <= set(json.loads((tmp_path / "found.json").read_text()))
    found = work_precision.read(tmp_path / "found.json")
    assert found[0].rows[0] == rows[0]
    assert found[0].rows[1].message == "no"
    assert found[0].rows[1].error == np.inf


@pytest.mark.slow
def test_scaling_measures_a_size():
    from benchmarks import scaling

    small = scaling.one("chain", 4)
    assert (small.family, small.bodies) == ("chain", 4)
    assert small.evaluations > small.steps > 0
    assert np.isfinite(small.evaluation)  # a difference of two timings
    assert "chain" in scaling.table([small])


@pytest.mark.slow
def test_figures_are_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    from benchmarks import figures
    from benchmarks.scaling import Size

    rows = tuple(
        Row(name, "tolerance", e, e, 1.0 / e, 1.0, 1) for name in ("tsdyn", "tsdyn, RK45", "x") for e in (0.1, 0.01)
    )
    figures.work_precision([Measured("one", 1e-15, "", rows), Measured("two", 1e-15, "", rows)], tmp_path / "a.png")
    sizes = [Size("chain", n, 0.1, 0.1, 0.1 * n, 10, 100, 2.0 * n, 3.0 * n, 50.0) for n in (1, 2, 4)]
    figures.scaling(sizes, tmp_path / "b.png")
    for name in "ab":
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_one_command():
    result = subprocess.run([sys.executable, "-m", "benchmarks", "--help"], capture_output=True, text=True, check=True)
    assert "work-precision" in result.stdout
    result = subprocess.run([sys.executable, "-m", "benchmarks", "speed"], capture_output=True, text=True)
    assert result.returncode != 0
    assert "no part speed" in result.stderr


def test_rotation_matrices_are_those_of_the_solver():
    p = np.array([[0.5, -0.1, 0.7, 0.4]])
    scene = top.build()
    body = scene.bodies[0]
    solution = ts.simulate(scene, (0.0, 0.01), integrator="rk45")
    np.testing.assert_allclose(rotation(solution.orientation(body)), solution.rotation(body), atol=EXACT)
    A = rotation(p)[0]
    np.testing.assert_allclose(A @ A.T, np.eye(3), atol=EXACT)
