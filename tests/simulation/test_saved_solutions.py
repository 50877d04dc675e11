"""Solutions go to a file and back: outputs, dense output and all that follows from them, to the bit."""

import pickle
import subprocess
import sys

import h5py
import numpy as np
import pytest
import zarr

import tsdyn as ts
from examples import four_bar, top
from tests.helpers.scene_marks import there_and_back
from tsdyn.cli import main
from tsdyn.files import saved_file

TIMES = np.linspace(0.0, 0.2, 7)
METHODS = ("taylor", "dop853", "nystrom4", "sdirk54")
SUFFIXES = ("h5", "nc", "zarr")


def lowest(t, state):
    return state.velocity("crank")[1]


def run(method="taylor", **options):
    method = ts.integrators.Nystrom4(step=5e-3) if method == "nystrom4" else method
    return ts.simulate(four_bar.build(), (0.0, 0.2), integrator=method, events=lowest, **options)


def facts(solution, *times):
    """Everything that a solution offers, as bits."""
    found = [getattr(solution, name) for name in ("t", "q", "qd", "qdd", "multipliers", "energy", "power")]
    found += [*solution.constraint_error, *solution.reaction("bearing"), solution.reaction_unique("bearing")]
    found += [solution.angle("bearing"), solution.angular_momentum, solution.position("rocker", point=(0.1, 0, 0))]
    found += [*solution.t_events, *solution.q_events, *solution.qd_events, solution.state.q, solution.state.multipliers]
    found += [*solution.steps, *(np.asarray(part) for part in solution.charts)]
    if times:
        state = solution.at(np.array(times))
        found += [state.q, state.qd, state.multipliers, state.angle("bearing"), solution.work, solution.at(0.1).q]
    return [np.asarray(each).tobytes() for each in found] + [str(solution), repr(solution), solution.message]


@pytest.mark.slow_but("taylor", "dop853")
@pytest.mark.parametrize("method", METHODS)
def test_everything_is_there_again(method, tmp_path):
    solution = run(method, dense_output=True)
    loaded = ts.load(solution.save(tmp_path / "run.h5"))
    times = 0.013, 0.11, 0.2
    assert facts(loaded, *times) == facts(solution, *times)
    assert vars(loaded.stats) == vars(solution.stats)
    assert loaded.provenance == solution.provenance
    again = ts.load(loaded.save(tmp_path / "again.h5"))
    assert facts(again, *times) == facts(solution, *times)
    assert facts(pickle.loads(pickle.dumps(loaded)), *times) == facts(solution, *times)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format(suffix, tmp_path):
    solution = run(t_eval=TIMES)
    path = tmp_path / f"run.{suffix}"
    for _ in range(2):  # a saved solution is replaced
        loaded = ts.load(solution.save(path))
    assert facts(loaded) == facts(solution)
    assert facts(loaded[2:5])[1] == solution.q[2:5].tobytes()
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    with pytest.raises(ts.InvalidArgument, match="dense_output=True"):
        loaded.at(0.1)


def test_it_is_shown_in_the_same_way(tmp_path):
    pages = tmp_path / "run.html", tmp_path / "loaded.html"
    solution = run(t_eval=TIMES)
    for each, page in zip((solution, ts.load(solution.save(tmp_path / "run.h5"))), pages, strict=True):
        each.view(page)
    assert pages[0].read_bytes() == pages[1].read_bytes()


def test_another_process_reads_it(tmp_path):
    solution = run(dense_output=True)
    path = solution.save(tmp_path / "run.h5")
    code = (f"import tsdyn as ts; s = ts.load({str(path)!r}); print(s.at(0.11).q.tobytes().hex(), s.success, "
            "s.scene['bearing'])")  # fmt: skip
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert found[0] == solution.at(0.11).q.tobytes().hex()


def test_the_scene_is_there_to_the_bit(tmp_path):
    loaded = ts.load(run(t_eval=TIMES).save(tmp_path / "run.h5"))
    twin = there_and_back(loaded.scene, tmp_path / "scene.toml")
    assert twin.save(tmp_path / "a.toml").read_text() == four_bar.build().save(tmp_path / "b.toml").read_text()
    state = loaded.state
    on = [ts.simulate(s, (state.t, 0.25), state=state).q.tobytes() for s in (loaded.scene, four_bar.build())]
    assert on[0] == on[1]


def test_files_hold_no_pickle(tmp_path):
    with h5py.File(run(dense_output=True).save(tmp_path / "run.h5")) as file:
        kinds = [array.dtype.kind for array in file["run"].values()]
    assert set(kinds) <= set("fiub")


def test_a_failed_run(tmp_path):
    solution = run(max_steps=3, dense_output=True)
    loaded = ts.load(solution.save(tmp_path / "run.h5"))
    assert not loaded.success
    assert facts(loaded) == facts(solution)
    with pytest.raises(ts.StepFailure):
        loaded.raise_if_failed()


def test_far_from_the_origin(tmp_path):
    scene = ts.Scene(gravity=(0, 0, -10))
    bob = scene.add_point_mass(1.0, position=(1e6 + 1.0, 0.0, 0.0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, point_b=(1e6, 0.0, 0.0)))
    solution = ts.simulate(scene, (0.0, 1.0), dense_output=True)
    loaded = ts.load(solution.save(tmp_path / "far.h5"))
    np.testing.assert_array_equal(loaded.at([0.1, 0.7]).q, solution.at([0.1, 0.7]).q)


def test_a_run_in_a_store(tmp_path):
    stored = ts.simulate(top.build(), (0.0, 1.0), integrator="dop853", store=tmp_path / "store.h5")
    loaded = ts.load(stored.save(tmp_path / "run.h5"))
    np.testing.assert_array_equal(loaded.q, stored.q)
    with pytest.raises(ts.StorageError, match=r"store of a run and has no checkpoint.*xarray.*checkpoint=60"):
        ts.load(tmp_path / "store.h5")
    with pytest.raises(ts.StorageError, match="no saved solution"):
        stored.save(tmp_path / "store.h5")
    np.testing.assert_array_equal(loaded.q, stored.q)


@pytest.mark.parametrize("name", ["run.h5", "run.zarr"])
def test_the_store_of_a_run_that_has_ended_is_loaded(tmp_path, name):
    path = tmp_path / name
    stored = ts.simulate(top.build(), (0.0, 1.0), integrator="dop853", store=path, checkpoint=60.0)
    loaded = ts.load(path)
    assert loaded.reached == 1.0
    np.testing.assert_array_equal(loaded.q, stored.q)


@pytest.mark.parametrize("name", ["run.h5", "run.zarr"])
def test_a_store_of_a_run_that_has_ended_is_read_without_its_functions(tmp_path, name, capsys):
    def build():
        scene = ts.Scene(gravity=(0, 0, -10))
        bob = scene.add_point_mass(2.0, position=(1, 0, 0), name="bob")
        rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
        scene.add(ts.forces.PointForce(bob, force=pushed, name="wind"))
        return scene, rod

    def pushed(t):
        return 0.1 * t, 0.0, 0.0

    def height(t, state):
        return state.q[2] + 0.5

    (scene, rod), path = build(), tmp_path / name
    run = ts.simulate(scene, (0.0, 1.0), events=height, store=path, checkpoint=60.0, history=True)
    bare = ts.load(path)
    for one, other in ((bare.t, run.t), (bare.q, run.q), (bare.qdd, run.qdd), (bare.t_events[0], run.t_events[0])):
        np.testing.assert_array_equal(one, other)
    assert (bare.method, bare.status, bare.reached) == (run.method, run.status, 1.0)
    assert bare.provenance | {"created": ""} == run.provenance | {"created": ""}
    np.testing.assert_array_equal(bare.steps.h, run.steps.h)
    np.testing.assert_array_equal(bare.kinetic_energy, run.kinetic_energy)
    assert bare.multipliers.shape == run.multipliers.shape
    assert np.isnan(bare.multipliers).all()
    assert np.isnan(bare.constraint_error.position).all()
    with pytest.raises(ts.StorageError, match=r"no wind"):
        bare.reaction("rod")
    np.testing.assert_array_equal(ts.load(path, scene=scene).reaction(rod)[0], run.reaction(rod)[0])
    for words in (["info", str(path)], ["convert", str(path), str(tmp_path / "run.csv")]):
        assert main(words) == 0
        assert "no wind" in capsys.readouterr().err
    again = ts.load(bare.save(tmp_path / f"again{path.suffix}"))
    np.testing.assert_array_equal(again.q, run.q)
    assert np.isnan(again.power).all()


def test_a_store_with_events_alone_is_loaded_without_them(tmp_path):
    def height(t, state):
        return state.q[2] - 0.95

    path = tmp_path / "run.h5"
    run = ts.simulate(top.build(), (0.0, 1.0), integrator="dop853", events=height, store=path, checkpoint=60.0)
    loaded = ts.load(path)
    np.testing.assert_array_equal(loaded.q_events[0], run.q_events[0])
    np.testing.assert_array_equal(loaded.multipliers, run.multipliers)


def test_the_store_of_a_run_that_has_not_ended_names_the_call(tmp_path):
    path = tmp_path / "run.h5"

    def stop(fraction):
        if (tmp_path / "run.h5.checkpoint").exists():
            raise KeyboardInterrupt

    ts.simulate(
        top.build(), (0.0, 100.0), integrator=ts.integrators.Nystrom4(1e-3), store=path, checkpoint=0.0, progress=stop
    )
    with pytest.raises(ts.StorageError, match=r"run that has not ended.*ts\.resume\("):
        ts.load(path)


def test_scenes_with_functions_are_passed_again(tmp_path):
    def build(length=1.0):
        scene = ts.Scene()
        bob = scene.add_point_mass(1.0, position=(length, 0, 0), name="bob")
        scene.add(ts.constraints.Distance(bob, scene.ground, length=lambda t: length + 0.1 * t * t, name="rope"))
        return scene

    path = ts.simulate(build(), (0.0, 0.1), dense_output=True).save(tmp_path / "run.h5")
    outline = ts.load(path)
    assert [body.name for body in outline.scene.bodies] == ["bob"]
    np.testing.assert_array_equal(outline.multipliers, ts.load(path, scene=build()).multipliers)
    for call in (lambda: outline.at(0.05), lambda: outline.state, lambda: ts.simulate(outline.scene, (0.0, 1.0))):
        with pytest.raises(ts.StorageError, match=r"rope: length is the function.*scene=scene.*no rope"):
            call()
    scene = build()
    loaded = ts.load(path, scene=scene)
    assert loaded.scene is scene
    assert loaded.at(0.05).t == 0.05
    with pytest.raises(ts.StorageError, match="another one"):
        ts.load(path, scene=build(2.0))
    with pytest.raises(ts.InvalidArgument, match="scene must be"):
        ts.load(path, scene="scene")


@pytest.mark.parametrize("count", [10, pytest.param(40, marks=pytest.mark.slow)])
def test_damaged_files(count, tmp_path):
    solution = run(t_eval=TIMES)
    path, refused = solution.save(tmp_path / "run.h5"), 0
    whole, right, rng = path.read_bytes(), facts(solution), np.random.default_rng(0)
    with h5py.File(path, "r+") as file:
        file["q"][3, 2] += 1e-15
    with pytest.raises(ts.StorageError, match="damaged: q has another checksum"):
        ts.load(path)
    for cut in np.linspace(0.0, 1.0, count // 4, endpoint=False):
        path.write_bytes(whole[: int(cut * len(whole))])
        with pytest.raises(ts.StorageError, match="run"):
            ts.load(path)
    for at in rng.integers(len(whole), size=count).tolist():
        path.write_bytes(whole[:at] + rng.bytes(8) + whole[at + 8 :])
        try:
            same = facts(ts.load(path)) == right
        except ts.StorageError:
            refused += 1
        else:
            assert same  # the bytes held nothing
    assert refused > count // 8


def test_damaged_folders(tmp_path):
    path = run(t_eval=TIMES).save(tmp_path / "run.zarr")
    zarr.open_group(path, mode="r+")["q"][3, 2] += 1e-3
    with pytest.raises(ts.StorageError, match="damaged: q"):
        ts.load(path)
    (path / "run" / "record" / "zarr.json").unlink()
    with pytest.raises(ts.StorageError, match="damaged"):
        ts.load(path)


def test_foreign_and_later_files(tmp_path):
    path = tmp_path / "other.h5"
    path.write_bytes(b"no HDF5")
    with pytest.raises(ts.StorageError, match="damaged, or can't be read as HDF5"):
        ts.load(path)
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["x"] = np.arange(3)
    with pytest.raises(ts.StorageError, match="no saved solution of tsdyn"):
        ts.load(tmp_path / "foreign.h5")
    with pytest.raises(ts.StorageError, match="there is no file"):
        ts.load(tmp_path / "missing.zarr")
    later = run(t_eval=TIMES).save(tmp_path / "later.h5")
    with h5py.File(later, "r+") as file:
        file.attrs["format_version"] = saved_file.VERSION + 1
    with pytest.raises(ts.StorageError, match="this tsdyn reads 1"):
        ts.load(later)


@pytest.mark.parametrize("path", ["run.csv", "run", 3, "missing/run.h5"])
def test_impossible_places(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    solution = ts.simulate(top.build(), (0.0, 0.01))
    with pytest.raises((ts.InvalidArgument, ts.StorageError), match=r"path|folder"):
        solution.save(path)
    with pytest.raises((ts.InvalidArgument, ts.StorageError)):
        ts.load(path)
    assert not list(tmp_path.iterdir())


def stretched(t, a, b, par, out):
    out[0] = -par[0] * a[0]


class Ring(ts.Primitive):
    """A class of a user's own: a point stays on a sphere of radius one about the origin."""

    rows, markers = 1, (ts.Point("a"),)

    @staticmethod
    def phi(x, par, t, out):
        out[0] = (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] - 1.0) / 2.0

    @staticmethod
    def jacobian(x, par, t, out):
        out[0, 0], out[0, 1], out[0, 2] = x[0], x[1], x[2]

    @staticmethod
    def gamma(x, xd, par, t, out):
        out[0] = -(xd[0] * xd[0] + xd[1] * xd[1] + xd[2] * xd[2])


def with_code():
    """A pendulum on a class of the user's own, with a joint and a force by a user's function."""
    scene = ts.Scene()
    bob = scene.add_point_mass(2.0, position=(1, 0, 0), name="bob")
    scene.add(Ring(bob, name="ring"))
    arm = scene.add_body(mass=1.0, inertia=(1.0, 1.0, 1.0), name="arm")
    scene.add(ts.constraints.Revolute.at(scene.ground, arm, point=(0, 0, 1), axis=(0, 1, 0), name="hinge"))
    scene.add(ts.forces.TorsionalSpring.at(scene.ground, arm, axis=(0, 1, 0), stiffness=3.0, name="coil"))
    scene.add(ts.forces.UserForce(bob, function=stretched, parameters=(4.0,), name="pull"))
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["h5", "zarr"])
def test_what_a_file_names_only_is_not_needed_to_look_at_it(suffix, tmp_path):
    scene = with_code()
    whole = ts.simulate(scene, (0.0, 0.3), integrator="dop853")
    loaded = ts.load(whole.save(tmp_path / f"run.{suffix}"))
    again = ts.load(loaded.save(tmp_path / f"again.{suffix}"))
    for found in (loaded, again, loaded[1:5], ts.load(tmp_path / f"run.{suffix}", scene=scene)):
        one = whole[1:5] if found.t.size == 4 else whole
        for name in ("t", "q", "qd", "qdd", "multipliers", "energy", "kinetic_energy", "power", "linear_momentum"):
            np.testing.assert_array_equal(getattr(found, name), getattr(one, name), err_msg=name)
        for level, right in zip(found.constraint_error, one.constraint_error, strict=True):
            np.testing.assert_array_equal(level, right)
        np.testing.assert_array_equal(found.angle("hinge"), one.angle("hinge"))
        np.testing.assert_array_equal(found.position("bob"), one.position("bob"))
        assert found.to_dataframe().columns.tolist() == one.to_dataframe().columns.tolist()
    assert "bob" in loaded.view(tmp_path / "page.html").read_text()
    for call in (lambda: loaded.reaction("hinge"), lambda: loaded.state, lambda: ts.simulate(loaded.scene, (0.0, 1.0))):
        with pytest.raises(ts.StorageError, match=r"function stretched.*no ring, pull"):
            call()
