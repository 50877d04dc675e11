"""Ensembles that stream to a store: the same numbers, and a study that goes on where it was stopped."""

import pickle
import time

import numpy as np
import pytest

import tsdyn as ts
from examples import top
from tsdyn.ensembles.tolerances import CHUNK_SECONDS

SPAN, MASSES = (0.0, 0.02), np.linspace(20.0, 40.0, 12)
SLOW = CHUNK_SECONDS / 3.0
TABLE = {"top.mass": MASSES, "top.velocity": np.linspace((0, 0, 0), (1, 1, 0), 12)}


def stop_at(count):
    """A progress that is interrupted after so many cases."""

    def progress(fraction):
        if fraction * len(MASSES) >= count:
            raise KeyboardInterrupt

    return progress


@pytest.mark.parametrize("suffix", ["h5", "zarr"])
@pytest.mark.parametrize("options", [{}, {"keep": "t_eval", "t_eval": [0.0, 0.01, 0.02]}], ids=["final", "t_eval"])
def test_a_store_has_the_same_numbers(suffix, options, tmp_path):
    scene, path = top.build(), tmp_path / f"study.{suffix}"
    whole = ts.ensemble(scene, TABLE, SPAN, **options)
    stored = ts.ensemble(scene, TABLE, SPAN, store=path, threads=2, **options)
    for name in ("t", "q", "qd", "status", "reached"):
        np.testing.assert_array_equal(getattr(stored, name), getattr(whole, name))
    assert stored.message == whole.message
    for ensemble in (stored, whole):
        twin = pickle.loads(pickle.dumps(ensemble))
        np.testing.assert_array_equal(twin.q, whole.q)
        np.testing.assert_array_equal(twin.case(3).q[-1], whole.case(3).q[-1])
    assert stored.to_xarray().q.equals(whole.to_xarray().q)


@pytest.mark.parametrize("suffix", ["h5", "zarr"])
@pytest.mark.parametrize("heavy", [slice(0, 4), slice(9, 12)], ids=["first", "last"])
def test_what_is_kept_is_known_where_cases_before_or_after_have_failed(heavy, suffix, tmp_path):
    scene, failing = top.build(), set(MASSES[heavy])

    def keep(solution):
        if solution.scene.bodies[0].mass in failing:
            raise ValueError("too heavy")
        return {"last": solution.state.q}

    options = {"keep": keep, "threads": 1, "store": tmp_path / f"study.{suffix}"}
    for count in (1, 9):  # ends within the first four, and with a few to go
        ts.ensemble(scene, TABLE, SPAN, progress=stop_at(count), resume=True, **options)
    resumed, whole = ts.ensemble(scene, TABLE, SPAN, resume=True, **options), ts.ensemble(scene, TABLE, SPAN, keep=keep)
    np.testing.assert_array_equal(resumed.kept["last"], whole.kept["last"])
    np.testing.assert_array_equal(resumed.status, whole.status)


@pytest.mark.parametrize("suffix", ["h5", "zarr"])
def test_a_study_goes_on_where_it_was_stopped(suffix, tmp_path):
    scene, path, seen = top.build(), tmp_path / f"study.{suffix}", []

    def keep(solution):
        if solution.scene.bodies[0].mass > 39.0:
            raise ValueError("too heavy")
        seen.append(0)
        time.sleep(SLOW)  # so that few cases are a chunk
        return {"height": solution.state.q[2], "last": solution.state.q}

    options = {"keep": keep, "threads": 1, "store": path}
    first = ts.ensemble(scene, TABLE, SPAN, progress=stop_at(5), **options)
    done = int(first.success.sum())
    assert first.interrupted
    assert 5 <= done < 12
    assert np.isnan(first.q[done:]).all()
    assert (first.status[done:] == ts.Status.NOT_RUN).all()
    del seen[:]
    second = ts.ensemble(scene, TABLE, SPAN, resume=True, **options)
    assert len(seen) == 11 - done
    whole = ts.ensemble(scene, TABLE, SPAN, keep=keep)
    for name in ("q", "status"):
        np.testing.assert_array_equal(getattr(second, name), getattr(whole, name))
    np.testing.assert_array_equal(second.kept["last"], whole.kept["last"])
    assert second.message == whole.message
    third = ts.ensemble(scene, TABLE, SPAN, resume=True, **options)  # nothing is left to do
    np.testing.assert_array_equal(third.kept["height"], whole.kept["height"])


def test_another_ensemble_is_refused(tmp_path):
    scene, path = top.build(), tmp_path / "study.h5"
    ts.ensemble(scene, {"top.mass": MASSES}, SPAN, store=path)
    with pytest.raises(ts.StorageError, match="exists"):
        ts.ensemble(scene, {"top.mass": MASSES}, SPAN, store=path)
    for table, options in (({"top.mass": MASSES + 1}, {}), ({"top.mass": MASSES}, {"rtol": 1e-5})):
        with pytest.raises(ts.StorageError, match="another ensemble"):
            ts.ensemble(scene, table, SPAN, store=path, resume=True, **options)
    with pytest.raises(ts.InvalidArgument, match="goes on with a store"):
        ts.ensemble(scene, {"top.mass": MASSES}, SPAN, resume=True)
    with pytest.raises(ts.StorageError, match="no folder"):
        ts.ensemble(scene, {"top.mass": MASSES}, SPAN, store=tmp_path / "none" / "study.h5")


@pytest.mark.parametrize("column", ["q", "status", "reached", "parameter top.mass"])
@pytest.mark.parametrize("damage", ["lost", "overwritten"])
def test_a_damaged_store_is_refused_though_nothing_is_left_to_do(column, damage, tmp_path):
    """A chunk that isn't there is nan to Zarr: all cases were said to have succeeded."""
    scene, path = top.build(), tmp_path / "study.zarr"
    ts.ensemble(scene, {"top.mass": MASSES}, SPAN, store=path)
    chunk = next(each for each in (path / column / "c").rglob("*") if each.is_file())
    chunk.unlink() if damage == "lost" else chunk.write_bytes(b"xx")
    with pytest.raises(ts.StorageError, match="damaged"):
        ts.ensemble(scene, {"top.mass": MASSES}, SPAN, store=path, resume=True)


def test_cases_that_have_all_failed_are_no_damage(tmp_path):
    scene, path = top.build(), tmp_path / "study.zarr"
    for resume in (False, True):
        found = ts.ensemble(scene, {"top.mass": -MASSES}, SPAN, store=path, resume=resume)
        assert not found.success.any()


@pytest.mark.parametrize("suffix", ["h5", "zarr"])
def test_a_store_is_no_ensemble_to_load(suffix, tmp_path):
    ts.ensemble(top.build(), {"top.mass": MASSES}, SPAN, store=tmp_path / f"study.{suffix}")
    with pytest.raises(ts.StorageError, match="resume=True"):
        ts.load(tmp_path / f"study.{suffix}")


def test_all_cases_may_fail(tmp_path):
    found = ts.ensemble(top.build(), {"top.mass": [-1.0, -2.0]}, SPAN, store=tmp_path / "study.h5", keep=lambda s: 1.0)
    assert not found.success.any()
    assert "positive" in found.message[1]


@pytest.mark.parametrize("store", [None, "study.h5"])
def test_arrays_of_another_shape_fail_their_cases(store, tmp_path):
    def keep(solution):
        return np.ones(2 if solution.scene.bodies[0].mass < 38 else 3)

    place = store and tmp_path / store
    found = ts.ensemble(top.build(), {"top.mass": MASSES}, SPAN, keep=keep, store=place, threads=1)
    assert found.success.tolist() == (MASSES < 38).tolist()
    assert "of the same shape" in found.message[-1]
    assert found.kept.shape == (12, 2)
