"""Outputs in a store are those of a run without one, to the bit, whole or in slices."""

import errno
import os
import re
import subprocess
import sys

import numpy as np
import pytest

import tsdyn as ts
from examples import top
from tests.helpers.refusals import refuse
from tsdyn.files import archive as archives
from tsdyn.files.formats import format_of

FORMATS = ("h5", "zarr")
GRIDS = {"every step": None, "times": np.linspace(0.0, 1.0, 41)}
OUTPUTS = ("t", "q", "qd", "qdd", "multipliers", "energy")


def run(**options):
    return ts.simulate(top.build(), (0.0, 1.0), integrator="dop853", **options)


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("times", GRIDS.values(), ids=GRIDS)
def test_outputs(suffix, times, tmp_path):
    whole, stored = run(t_eval=times), run(t_eval=times, store=tmp_path / f"run.{suffix}")
    for name in OUTPUTS:
        np.testing.assert_array_equal(getattr(stored, name), getattr(whole, name))
        np.testing.assert_array_equal(getattr(stored[3:20:4], name), getattr(whole, name)[3:20:4])
        np.testing.assert_array_equal(getattr(stored[5:][1:3], name), getattr(whole[5:][1:3], name))
    assert stored.message == whole.message
    assert str(stored).splitlines()[:3] == str(whole).splitlines()[:3]


def test_outputs_are_read_when_they_are_asked_for(tmp_path):
    stored = run(store=tmp_path / "run.h5")
    str(stored), repr(stored), stored.state, stored.stats
    assert not vars(stored).keys() & {"q", "qd", "qdd"}
    assert stored[2:4].q.shape == (2, 7)
    assert not vars(stored).keys() & {"q", "qd", "qdd"}


@pytest.mark.parametrize("suffix", FORMATS)
def test_histories_go_to_the_store_if_they_are_asked_for(suffix, tmp_path):
    whole, stored = run(), run(store=tmp_path / f"run.{suffix}", history=True)
    for kept, found in zip((*whole.steps, *whole.charts), (*stored.steps, *stored.charts), strict=True):
        np.testing.assert_array_equal(found, kept)
    with pytest.raises(ts.InvalidArgument, match="no histories"):
        _ = run(store=tmp_path / f"other.{suffix}").steps


def test_another_process_reads_dimensions_and_units(tmp_path):
    path = tmp_path / "run.h5"
    run(store=path)
    code = (
        f"import h5py; file = h5py.File({str(path)!r}); q = file['q']; "
        "print(q.dims[0].keys(), q.dims[1].keys(), q.attrs['units'], file['time'].attrs['units'])"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert found.split("\n")[0] == "['time'] ['coordinate'] m or 1 s"


@pytest.mark.parametrize("suffix", FORMATS)
def test_xarray_reads_stores(suffix, tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    path = tmp_path / f"run.{suffix}"
    solution = run(store=path)
    options = {"engine": "h5netcdf"} if suffix == "h5" else {"engine": "zarr", "consolidated": False}
    with xarray.open_dataset(path, **options) as data:
        assert data.q.dims == ("time", "coordinate")
        np.testing.assert_array_equal(data.q.sel(coordinate="top.z"), solution.q[:, 2])


def test_a_reader_sees_a_run_that_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(archives, "READERS", 0.0)
    path, seen = tmp_path / "run.h5", []

    def progress(fraction):
        if path.exists():
            seen.append(format_of(path).count(path, ["time", "q"]))

    ts.simulate(top.build(), (0.0, 20.0), integrator=ts.integrators.Nystrom4(1e-3), store=path, progress=progress)
    assert 0 < seen[-1] <= 20001
    assert seen == sorted(seen)


def test_positions_far_from_the_origin(tmp_path):
    def far():
        scene = ts.Scene(gravity=(0, 0, -10))
        bob = scene.add_point_mass(1.0, position=(1e6 + 1.0, 0.0, 0.0))
        scene.add(ts.constraints.Distance(bob, scene.ground, point_b=(1e6, 0.0, 0.0)))
        return scene

    whole, stored = (ts.simulate(far(), (0.0, 1.0), **given) for given in ({}, {"store": tmp_path / "far.zarr"}))
    np.testing.assert_array_equal(stored.q, whole.q)


WRONG = {
    "another suffix": ({"store": "run.csv"}, ts.InvalidArgument, (".zarr, .h5", "'run.csv'")),
    "no path": ({"store": 3}, ts.InvalidArgument, ("store must be a path", "3")),
    "no folder": ({"store": "nowhere/run.h5"}, ts.StorageError, ("no folder nowhere",)),
    "no store": ({"checkpoint": 1.0}, ts.InvalidArgument, ("checkpoint needs a store",)),
    "interpolants": ({"store": "run.h5", "dense_output": True}, ts.InvalidArgument, ("t_eval",)),
    "negative": ({"store": "run.h5", "checkpoint": -1.0}, ts.InvalidArgument, ("checkpoint", "-1.0")),
    "text": ({"store": "run.h5", "checkpoint": "often"}, ts.InvalidArgument, ("checkpoint", "'often'")),
}


@pytest.mark.parametrize(("given", "error", "words"), WRONG.values(), ids=WRONG)
def test_refusals(given, error, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refuse(lambda: run(**given), error, words)
    assert not list(tmp_path.iterdir())


def test_nothing_is_overwritten(tmp_path):
    path = tmp_path / "run.h5"
    run(store=path)
    refuse(lambda: run(store=path), ts.StorageError, ("exists", "ts.resume"))


def savers():
    """What writes a store or a file as a whole, by name."""
    (scene := ts.Scene()).add_point_mass(mass=1.0, name="stone")
    values = {"stone.velocity": [(1, 0, 5), (2, 0, 5)]}
    solution, study = ts.simulate(scene, (0, 1)), ts.ensemble(scene, values, (0, 1))
    return {
        "run": lambda path: ts.simulate(scene, (0, 1), store=path),
        "solution": solution.save,
        "ensemble": study.save,
        "cases": lambda path: ts.ensemble(scene, values, (0, 1), store=path),
    }


HDF5_REFUSES = (  # its words
    "[Errno 13] Unable to synchronously create file (unable to open file: name = 'run-partial-7.h5', errno = 13, "
    "error message = 'Permission denied', flags = 15, o_flags = c2)"
)


@pytest.mark.parametrize("error", [PermissionError(HDF5_REFUSES), OSError(errno.EROFS, "x", "run-partial-7.h5")])
def test_a_folder_that_cannot_be_written_to(error, tmp_path, monkeypatch):
    def fail(*arguments):
        raise error

    monkeypatch.setattr(format_of("run.h5").Store, "create", fail)
    for name, save in savers().items():
        with pytest.raises(
            ts.StorageError, match=f"the folder {re.escape(str(tmp_path))} can't be written to"
        ) as caught:
            save(tmp_path / "run.h5")
        message = str(caught.value)
        assert "Take another path, or change the permissions." in message, name
        assert not [word for word in ("flags", "errno", "partial", "Free space") if word in message], message


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_folder_without_permissions(suffix, tmp_path):
    (folder := tmp_path / "closed").mkdir()
    for mode in (0o500, 0o000):
        folder.chmod(mode)
        if os.access(folder, os.W_OK):
            pytest.skip("root may write anywhere")
        for name, save in savers().items():
            words = ("run.", "can't be written", "Permission denied", "change the permissions")
            refuse(lambda save=save: save(folder / f"run.{suffix}"), ts.StorageError, words, name)
    folder.chmod(0o700)


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    refuse(lambda: run(store=tmp_path / "run.h5"), ts.MissingDependency, ("h5py", "tsdyn[data]"))


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_full_disk_ends_the_run_with_what_has_been_written(suffix, tmp_path, monkeypatch):
    path = tmp_path / f"run.{suffix}"
    Store = format_of(path).Store
    write, calls = Store.write, []

    def fail(store, start, rows):
        calls.append(start)
        if len(calls) > 2:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(store, start, rows)

    monkeypatch.setattr(Store, "write", fail)
    monkeypatch.setattr(archives, "READERS", 0.0)
    span, method = (0.0, 20.0), ts.integrators.Nystrom4(1e-3)
    solution = ts.simulate(top.build(), span, integrator=method, store=path, checkpoint=0.0)
    assert solution.status == ts.Status.STORE_FAILED
    assert "No space left" in solution.message
    assert 0 < solution.t.size < 20001
    monkeypatch.undo()
    whole = ts.simulate(top.build(), span, integrator=method)
    np.testing.assert_array_equal(ts.resume(path).q, whole.q)
