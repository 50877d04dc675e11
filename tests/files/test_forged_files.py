"""Files that others have written: nothing in them runs, nothing outside is read or written, sizes are judged first."""

import json
import os
import pickle
import shutil
import subprocess
import sys

import h5py
import numpy as np
import pytest
import zarr

import tsdyn as ts
from tests.helpers import forging
from tests.helpers.processes import ROOT
from tests.helpers.refusals import refuse
from tsdyn.files import checkpoint, saved_file
from tsdyn.runs import driver

SECRET = 1234.5
LIMITED = """
import resource, sys
from tests.helpers import forging
sys.exit(forging.main(lambda size: resource.setrlimit(resource.RLIMIT_AS, (size, size)), *sys.argv[1:]))
"""


@pytest.fixture
def saved(tmp_path):
    """A function that saves a short run in a format."""

    def save(suffix):
        scene = ts.Scene()
        scene.add_point_mass(1.0, name="stone")
        return ts.simulate(scene, (0.0, 1.0), t_eval=np.linspace(0.0, 1.0, 9)).save(tmp_path / f"run.{suffix}")

    return save


def fuzz(kind, count, seed, folder):
    """Read so many mutations of a kind, in another process; its report."""
    given = [sys.executable, "-W", "ignore", "-c", LIMITED, kind, str(count), str(seed), str(folder)]
    environment = {**os.environ, "TSDYN_QUIET": "1"}
    if kind == "kernel":
        environment["TSDYN_CACHE_DIR"] = str(folder / "kernels")
        small = "import tsdyn as ts; s = ts.Scene(); s.add_point_mass(1.0); ts.simulate(s, (0, 1), integrator='rk45')"
        subprocess.run([sys.executable, "-c", small], env=environment, cwd=ROOT, check=True)
    found = subprocess.run(given, env=environment, cwd=ROOT, capture_output=True, text=True, check=False)
    at = (folder / "now").read_text() if (folder / "now").exists() else ""
    assert found.returncode == 0, f"{kind}, at {at}: {found.stdout} {found.stderr[-3000:]}"
    return json.loads(found.stdout.splitlines()[0])


@pytest.mark.slow_for("scene", "ensemble.h5")
@pytest.mark.skipif(sys.platform == "win32", reason="limits of memory are POSIX's")
@pytest.mark.parametrize(
    ("kind", "count"),
    [
        *(pytest.param(kind, 12, id=kind) for kind in ("scene", "checkpoint", "ensemble.h5")),
        *(pytest.param(kind, 300, id=f"{kind}, many", marks=pytest.mark.slow) for kind in forging.KINDS),
    ],
)
def test_mutations_of_every_kind(kind, count, tmp_path):
    tally = fuzz(kind, count, 0, tmp_path / "fuzz")
    assert sum(tally.values()) == count
    assert sum(tally.get(name, 0) for name in ("StorageError", "InvalidFile", "refused")) > count // 10


@pytest.mark.parametrize("suffix", ["h5", "zarr"])
def test_rows_that_a_file_does_not_hold(suffix, saved):
    path = saved(suffix)
    if suffix == "h5":
        with h5py.File(path, "r+") as file:
            del file["q"]
            file.create_dataset("q", (10**12, 3), float, chunks=(1000, 3))
    else:
        node = path / "q" / "zarr.json"
        node.write_text(json.dumps(json.loads(node.read_text()) | {"shape": [10**12, 3]}))
    refuse(lambda: ts.load(path), ts.StorageError, ("2400000000", "bytes"))


def linked(file, folder):
    """Ways in which an array of HDF5 is somewhere else, by name: a function that makes it so."""
    with h5py.File(folder / "secret.h5", "w") as other:
        other["last"] = np.full((3, 3), SECRET)
    np.full((3, 3), SECRET).tofile(folder / "secret.bin")
    layout = h5py.VirtualLayout((3, 3), float)
    layout[...] = h5py.VirtualSource(folder / "secret.h5", "last", (3, 3))
    outside = [(str(folder / "secret.bin").encode(), 0, 72)]
    return {
        "external link": lambda group: group.__setitem__("last", h5py.ExternalLink(folder / "secret.h5", "last")),
        "soft link": lambda group: group.__setitem__("last", h5py.SoftLink("/q")),
        "virtual": lambda group: group.create_virtual_dataset("last", layout),
        "external": lambda group: group.create_dataset("last", (3, 3), float, external=outside),
        "compressed": lambda group: group.create_dataset("last", data=np.zeros((3, 3)), compression="gzip"),
        "words": lambda group: group.create_dataset("last", data=["a"] * 3, dtype=h5py.string_dtype()),
        "group": lambda group: group.create_group("last"),
    }


@pytest.mark.parametrize("way", list(linked(None, __import__("pathlib").Path(__import__("tempfile").mkdtemp()))))
def test_arrays_of_hdf5_that_are_elsewhere(way, saved, tmp_path):
    path = saved("h5")
    with h5py.File(path, "r+") as file:
        del file[saved_file.GROUP]["last"]
        linked(file, tmp_path)[way](file[saved_file.GROUP])
    refuse(lambda: ts.load(path), ts.StorageError, ("last",))


READ = """
import sys
import tsdyn as ts
try:
    ts.load(sys.argv[1])
except ts.StorageError as error:
    print(error)
"""


def test_attributes_of_a_type_that_there_is_not(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w", libver="earliest") as file:  # whose objects have no checksums
        file.attrs["source"] = "tsdyn"
    content, text = bytearray(path.read_bytes()), b"source\0\0\x19\x01"
    assert content.count(text) == 1
    content[content.find(text) + len(text) - 1] = 2  # neither a sequence nor a text: libhdf5 crashes where it is read
    path.write_bytes(content)
    found = subprocess.run([sys.executable, "-c", READ, path], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (found.returncode, found.stdout.partition(": ")[0]) == (0, f"{path} is no saved solution of tsdyn")


def test_folders_of_zarr_that_lead_elsewhere(saved, tmp_path):
    whole = saved("zarr").rename(tmp_path / "whole.zarr")
    node, chunk = ("q", "zarr.json"), ("q", "c", "0", "0")
    evil = pickle.dumps(Evil(str(tmp_path / "executed")))

    def edited(**changes):
        return lambda path: path.write_text(json.dumps(json.loads(path.read_text()) | changes))

    bytes_ = {"name": "bytes", "configuration": {"endian": "little"}}
    ways = {
        "link": (chunk, lambda path: (path.unlink(), path.symlink_to(tmp_path / "secret"))),
        "pipe": (chunk, lambda path: (path.unlink(), os.mkfifo(path))),
        "pickle": (node, edited(codecs=[{"name": "numcodecs.pickle", "configuration": {}}])),
        "packed": (node, edited(codecs=[bytes_, {"name": "gzip", "configuration": {"level": 5}}])),
        "version 2": (node, edited(zarr_format=2)),
        "chunk": (node, edited(chunk_grid={"name": "regular", "configuration": {"chunk_shape": [10**9, 3]}})),
        "type": (node, edited(data_type="object")),
        "deep": (node, lambda path: path.write_text("[" * 100_000)),
        "bomb": (
            chunk,
            lambda path: path.write_bytes(b"\2\1\x33\x08" + b"\xff\xff\xff\x7f" + b"\0" * 4 + b"\x10\0\0\0"),
        ),
        "pickled": (chunk, lambda path: path.write_bytes(evil)),
    }
    (tmp_path / "secret").write_bytes(whole.joinpath(*chunk).read_bytes())
    for name, (place, change) in ways.items():
        path = tmp_path / "run.zarr"
        shutil.rmtree(path, ignore_errors=True)
        shutil.copytree(whole, path)
        change(path.joinpath(*place))
        refuse(lambda path=path: ts.load(path), ts.StorageError, ("run.zarr",), name)
    assert not (tmp_path / "executed").exists()


class Evil:
    """What makes a folder where it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (self.path,)


@pytest.mark.skipif(sys.platform == "win32", reason="devices and pipes are POSIX's")
def test_devices_and_pipes(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for target in (tmp_path / "pipe", "/dev/zero", tmp_path):
        for name in ("run.h5", "run.zarr", "scene.toml"):
            path = tmp_path / name
            path.symlink_to(target)
            refuse(lambda path=path: ts.load(path), ts.StorageError, (name,), f"{name} {target}")
            path.unlink()
        path = tmp_path / "store.h5.checkpoint"
        path.symlink_to(target)
        refuse(lambda: ts.resume(tmp_path / "store.h5"), ts.StorageError, ("regular file",), str(target))
        path.unlink()


def test_a_table_of_sums_says_all(saved):
    path = saved("h5")
    forging.rewritten(path, lambda record: record["sums"].clear())
    with h5py.File(path, "r+") as file:
        file["q"][3] += 1.0
    refuse(lambda: ts.load(path), ts.StorageError, ("damaged", "checksum"))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("reached", 10**400),
        ("reached", None),
        ("counts", {"steps": None}),
        ("counts", {"placements": 10**400}),
        ("seconds", {"run": None}),
        ("span", [None, 1.0]),
    ],
)
def test_numbers_of_solutions_are_numbers(name, value, saved):
    path = saved("h5")
    forging.rewritten(
        path, lambda record: record.update({name: record[name] | value if isinstance(value, dict) else value})
    )
    refuse(lambda: ts.load(path), ts.StorageError, ("damaged",), name)


@pytest.fixture
def study(tmp_path):
    """A saved ensemble of two cases."""
    scene = ts.Scene()
    scene.add_point_mass(1.0, name="stone")
    return ts.ensemble(scene, {"stone.mass": [1.0, 2.0]}, (0, 0.1)).save(tmp_path / "study.h5")


def test_a_saved_ensemble_names_no_store(study):
    outside = study.with_name("written.h5")
    there = {"store": str(outside), "checkpoint": 0.0, "progress": True}
    forging.rewritten(study, lambda record: record["options"].update(there))
    assert ts.load(study).case(1).reached == 0.1
    assert sorted(file.name for file in study.parent.iterdir()) == ["study.h5"]


@pytest.mark.parametrize(
    "changes",
    [
        {"t_span": [0.0, "a"]}, {"t_span": 1.0}, {"formulation": "tangents"}, {"rtol": "a"}, {"nonsense": 1},
        {"state": 3}, {"events": "a"}, {"history": []},
    ],
    ids=str,
)  # fmt: skip
def test_options_of_ensembles_that_no_run_has(changes, study):
    forging.rewritten(study, lambda record: record["options"].update(changes))
    refuse(lambda: ts.load(study), ts.StorageError, ("study.h5 is damaged",))


@pytest.mark.parametrize("absent", ["t_span", "lacks", "free", "messages"])
def test_parts_of_ensembles_that_are_absent(absent, study):
    if absent == "lacks":
        with h5py.File(study, "r+") as file:
            del file[saved_file.GROUP]["scene"]
    forging.rewritten(
        study,
        lambda record: (
            record["sums"].pop("scene", None) if absent == "lacks" else
            record["options"].pop(absent) if absent == "t_span" else record.pop(absent)
        ),
    )  # fmt: skip
    refuse(lambda: ts.load(study), ts.StorageError, ("study.h5 is damaged",))


def test_outputs_that_are_not_finite_are_not_drawn(stopped):
    ts.resume(stopped)
    with h5py.File(stopped, "r+") as file:
        file["q"][3] = np.nan
    found = ts.load(stopped)
    refuse(lambda: found.view(stopped.with_name("page.html")), ts.InvalidArgument, ("aren't finite", "[a:b]"))
    assert found[:3].view(stopped.with_name("page.html")).exists()


@pytest.fixture
def stopped(tmp_path, monkeypatch):
    """The store of a run by series that was stopped, with redundant rows and a sharp force."""
    monkeypatch.setattr(driver, "FIRST_SLICE", 4)
    path = tmp_path / "run.h5"
    scene, options = forging.scene(), {"integrator": "taylor", "store": path, "checkpoint": 0.0}
    ts.simulate(scene, (0.0, 60.0), progress=forging.stopped_soon(), **options)
    return path


def test_checkpoints_say_no_address_and_no_place_beyond_an_array(stopped):
    numbers, arrays = checkpoint.read(stopped)
    assert not [name for name in arrays if any(part in name for part in ("trial", "kernels", "graph", "table"))]
    right = ts.resume(stopped, progress=forging.stopped_soon()).q
    checkpoint.write(stopped, numbers, arrays)
    forged = {
        "context.tangent.dropped": np.full_like(arrays["context.tangent.dropped"], 10**6),
        "context.tangent.order": np.full_like(arrays["context.tangent.order"], -1),
        "run.numbers": np.full_like(arrays["run.numbers"], 0x7F),
        "recorder.charts": np.zeros((0, 5)),
        "run.now": arrays["run.now"].astype(np.int64),
        "context.expansion.bodies": np.zeros(0),
    }
    for name, array in forged.items():
        checkpoint.write(stopped, numbers, arrays | {name: array})
        refuse(lambda: ts.resume(stopped), ts.StorageError, ("checkpoint is damaged",), name)
    checkpoint.write(stopped, numbers, arrays)
    np.testing.assert_array_equal(ts.resume(stopped, progress=forging.stopped_soon()).q, right)


@pytest.mark.parametrize("shape", [[10**12], [10**6, 10**6], [-1], [2.5], ["a"], [1, -1]])
def test_arrays_of_checkpoints_that_a_file_does_not_hold(shape, stopped):
    file, _ = checkpoint.place(stopped)
    content = file.read_bytes()[len(checkpoint.FORMAT) + checkpoint.SEAL :]
    words, _, rest = content.partition(b"\n")
    found = json.loads(words)
    found["arrays"][0][2] = shape
    payload = json.dumps(found).encode() + b"\n" + rest
    seal = checkpoint.hashlib.sha256(payload).hexdigest().encode()
    for place in checkpoint.place(stopped):
        place.write_bytes(checkpoint.FORMAT + seal + b"\n" + payload)
    refuse(lambda: ts.resume(stopped), ts.StorageError, ("damaged",))


@pytest.mark.parametrize(
    "changes",
    [
        {"t_span": "a"}, {"t_span": [0.0, 10**400]}, {"redundancy": [0]}, {"formulation": None}, {"initial_tol": 0.0},
        {"max_step": float("inf")}, {"rtol": 1e-6}, {"t_eval": []}, {"t_eval": [7.0, 6.0]}, {"dense_output": 2},
    ],
    ids=str,
)  # fmt: skip
def test_arguments_of_checkpoints_that_no_run_has(changes, stopped):
    numbers, arrays = checkpoint.read(stopped)
    numbers["arguments"]["method"] = [numbers["arguments"]["method"], {}] if "rtol" in changes else "taylor"
    numbers["arguments"]["options"] |= changes
    checkpoint.write(stopped, numbers, arrays)
    refuse(lambda: ts.resume(stopped), ts.StorageError, ("checkpoint is damaged",))


def test_times_and_sizes_of_checkpoints_that_no_float_holds(stopped):
    numbers, arrays = checkpoint.read(stopped)
    for name in ("t", "interval", "size"):
        for _ in range(2):  # the one before it, too
            checkpoint.write(stopped, numbers | {name: 10**400}, arrays)
        refuse(lambda: ts.resume(stopped), ts.StorageError, ("damaged", name), name)


def test_long_texts_of_files_are_quoted_in_part(stopped):
    numbers, arrays = checkpoint.read(stopped)
    for changes in ({"version": "1" * 10**5}, {"machine": ["a" * 10**5]}, {"functions": {"f" * 10**5: ""}}):
        checkpoint.write(stopped, numbers | changes, arrays)
        with pytest.raises(ts.StorageError) as caught:
            ts.resume(stopped)
        assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("column", ["time", "q", "step_h"])
def test_columns_without_rows(column, tmp_path):
    path, scene = tmp_path / "run.h5", ts.Scene()
    scene.add_point_mass(1.0)
    ts.simulate(scene, (0.0, 1.0), store=path, checkpoint=0.0, history=True)
    with h5py.File(path, "r+") as file:
        del file[column]
        file[column] = 1.0
    refuse(lambda: ts.load(path), ts.StorageError, (f"{column} is of the shape ()",))


def test_checkpoints_of_format_1(stopped):
    file, _ = checkpoint.place(stopped)
    file.write_bytes(file.read_bytes().replace(b"checkpoint 2", b"checkpoint 1", 1))
    refuse(lambda: ts.resume(stopped), ts.StorageError, ("no checkpoint of this format",))


def test_links_beside_a_store_are_not_written_through(tmp_path, monkeypatch):
    outside = tmp_path / "outside"
    outside.write_text("mine")
    for name in ("run.h5.checkpoint-partial", "run.h5.checkpoint-before"):
        (tmp_path / name).symlink_to(outside)
    scene = ts.Scene()
    scene.add_point_mass(1.0)
    ts.simulate(scene, (0.0, 1.0), store=tmp_path / "run.h5", checkpoint=0.0)
    assert outside.read_text() == "mine"


@pytest.mark.parametrize("text", [".".join("a" * 100_000) + " = 1", "[" + ".".join(["'a b'"] * 9000) + "]"])
def test_keys_of_many_parts(text, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(f"version = 1\n{text}\n")
    refuse(lambda: ts.load(path), ts.InvalidFile, ("64 parts",))


assert zarr.__version__.startswith("3")
