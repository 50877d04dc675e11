"""A run on a full disk ends with what has been written, and goes on to the same bits when there is room again."""

import shutil
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import tsdyn as ts
from examples import top
from tests.helpers.refusals import refuse
from tsdyn.runs import driver

FORMATS = ("h5", "zarr")
NAMESPACE = ["unshare", "--user", "--map-root-user", "--mount"]  # in which mount is allowed
END, METHOD = 30.0, ts.integrators.Nystrom4(1e-3)
MOUNTED = """
import subprocess, sys
import numpy as np
import tsdyn as ts
from examples import top
from tests.files.test_full_disk import END, METHOD

folder, suffix, size, calls = *sys.argv[1:4], [0] * int(sys.argv[4])
path, filler = f"{folder}/run.{suffix}", f"{folder}/filler"
subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], check=True)

def fill(fraction):
    calls.pop()
    if calls:
        return
    calls.append(0)
    with open(filler, "ab", buffering=0) as file:
        for block in (1 << 16, 1):
            try:
                while True:
                    file.write(bytes(block))
            except OSError:
                pass

def check(part, whole):
    for name in ("t", "q", "qd", "qdd"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[: part.t.size])

whole = ts.simulate(top.build(), (0.0, END), integrator=METHOD)
part = ts.simulate(top.build(), (0.0, END), integrator=METHOD, store=path, checkpoint=0.0, progress=fill)
assert part.status == ts.Status.STORE_FAILED, part
assert 0 < part.t.size < whole.t.size
check(part, whole)
for _ in range(2):
    try:
        again = ts.resume(path)
        assert again.status == ts.Status.STORE_FAILED, again
    except ts.StorageError as error:
        assert "space" in str(error)
subprocess.run(["mount", "-o", "remount,size=100m", folder], check=True)
resumed = ts.resume(path)
assert resumed.success and resumed.t.size == whole.t.size
check(resumed, whole)
"""
LIMITED = """
import resource, signal, sys
import tsdyn as ts
from examples import top
from tests.files.test_full_disk import END, METHOD
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), int(sys.argv[2])))
solution = ts.simulate(top.build(), (0, END), integrator=METHOD, store=sys.argv[1], checkpoint=0.0)
print(solution.status, solution.t.size)
"""


def run(code, *arguments, within=()):
    """The output of a process, which ends as it should."""
    found = subprocess.run([*within, sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True)
    assert found.returncode == 0, found.stderr
    return found.stdout


@pytest.mark.slow
@pytest.mark.parametrize(("size", "call"), [("2m", 10**6), ("50m", 4)], ids=["small", "filled by another"])
@pytest.mark.parametrize("suffix", FORMATS)
def test_a_full_disk(suffix, size, call, tmp_path):
    if not shutil.which("unshare") or subprocess.run([*NAMESPACE, "true"], capture_output=True).returncode:
        pytest.skip("no file system can be mounted here: unshare is missing or refused")
    run(MOUNTED, tmp_path, suffix, size, call, within=NAMESPACE)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
@pytest.mark.parametrize(("suffix", "limit"), [("h5", 3_000_000), ("zarr", 100_000)])
def test_a_file_that_may_grow_no_more(suffix, limit, tmp_path):
    """There is room on the disk, and a write fails: the end of the process is as orderly as in `run`."""
    path = tmp_path / f"run.{suffix}"
    status, count = run(LIMITED, path, limit).split()
    whole = ts.simulate(top.build(), (0, END), integrator=METHOD)
    assert status == "store_failed"
    assert 0 < int(count) < whole.t.size
    np.testing.assert_array_equal(ts.resume(path).q, whole.q)


def test_a_disk_without_room(tmp_path, monkeypatch):
    path, free = tmp_path / "run.h5", iter([1 << 30] * 3)
    monkeypatch.setattr(driver, "FIRST_SLICE", 4)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=next(free, 1 << 20)))
    solution = ts.simulate(top.build(), (0.0, 3.0), integrator="dop853", store=path, checkpoint=0.0)
    assert solution.status == ts.Status.STORE_FAILED
    assert 0 < solution.t.size < 83
    refuse(lambda: ts.resume(path), ts.StorageError, ("can't be written", "Free space"))
    monkeypatch.undo()
    np.testing.assert_array_equal(ts.resume(path).q, ts.simulate(top.build(), (0.0, 3.0), integrator="dop853").q)


def test_no_room_to_begin(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=1000))
    refuse(
        lambda: ts.simulate(top.build(), (0.0, 3.0), store=tmp_path / "run.h5"), ts.StorageError, ("can't be written",)
    )
    assert not list(tmp_path.iterdir())
