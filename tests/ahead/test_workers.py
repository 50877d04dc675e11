"""Processes that compile kernels ahead of a first run; without them everything is as it was."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.helpers.processes import python

ROOT = Path(__file__).parents[2]
SMALL = """
import os
with open("ran", "a") as file:
    file.write("once ")
import tsdyn
from tsdyn import ahead
from tsdyn.jit import cache
from tsdyn.constraints import EulerNormalization
ahead.processors = lambda: 2
started = []
start = ahead._start
ahead._start = lambda: started.append(start()) or started[-1]
kernels = [EulerNormalization.kernels[name] for name in ("phi", "jacobian", "gamma")]
# CHANGED
failed = ahead.compile_ahead(kernels)
for kernel in kernels:
    kernel.address
counts = cache.statistics
print(failed, len(started), counts["misses"], counts["hits"], any(worker.poll() is None for worker in started))
"""


def files(folder):
    return sorted(file.name.partition("-")[0] for file in folder.rglob("*") if ".kernel" in file.name[:-5])


LOOPS = [
    f"tsdyn.constraints.euler_normalization.EulerNormalization.{name}_loop" for name in ("gamma", "jacobian", "phi")
]
BY_WORKERS, IN_PROCESS = "{} 2 0 3 False", "3 0 False"


def as_script(folder):
    (folder / "script.py").write_text(SMALL)
    return python("script.py", folder=folder)


def from_standard_input(folder):
    return python("-", folder=folder, code=SMALL)


def in_a_namespace(folder):
    """As notebooks do: cell by cell, in a namespace that no file has."""
    (folder / "cell").write_text(SMALL)
    return python(
        "-c", "exec(compile(open('cell').read(), '<cell 1>', 'exec'), {'__name__': '__main__'})", folder=folder
    )


@pytest.mark.slow
@pytest.mark.parametrize("way", [as_script, from_standard_input, in_a_namespace], ids=lambda way: way.__name__)
def test_workers_fill_the_cache_without_running_the_program_again(tmp_path, way):
    out, err = way(tmp_path)
    assert out == BY_WORKERS
    assert (tmp_path / "ran").read_text() == "once "
    assert sorted({file.name.partition("-")[0] for file in tmp_path.rglob("*.kernel")}) == LOOPS
    assert err.splitlines()[0] == "tsdyn: compiling kernels, once for this version and machine: 3 ..."
    assert err.splitlines()[-1].startswith("tsdyn: 3 of 3 kernels compiled in ")
    again, err = way(tmp_path)
    assert (again, err) == ("{} 0 0 3 False", "")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "started"),
    [
        ("ahead.processors = lambda: 1", 0),
        ("import sys; sys.executable = '/nowhere/python'", 0),
        ("import sys; sys.executable = sys._base_executable = os.path.realpath('/bin/false')", 2),
        ("ahead._start = lambda: (started.append(start()), started[-1].kill())[0] or started[-1]", 2),
        ("os.environ['TSDYN_WORKER'] = '1'", 0),
    ],
    ids=["one processor", "no Python", "not Python", "killed", "a worker itself"],
)
@pytest.mark.skipif(sys.platform == "win32", reason="there is no /bin/false")
def test_without_workers_kernels_are_compiled_in_process(tmp_path, change, started):
    (tmp_path / "script.py").write_text(SMALL.replace("# CHANGED", change))
    assert python("script.py", folder=tmp_path, TSDYN_QUIET="1") == (f"{{}} {started} {IN_PROCESS}", "")


@pytest.mark.slow
def test_a_full_disk_costs_time_and_a_warning(tmp_path):
    pytest.importorskip("resource")
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))"
    (tmp_path / "script.py").write_text(SMALL.replace("# CHANGED", limit))
    out, err = python("script.py", folder=tmp_path, TSDYN_QUIET="1")
    assert out == f"{{}} 2 {IN_PROCESS}"
    assert err.count("so every process compiles them again") == 1
    assert not list(tmp_path.rglob("*.kernel*[!k]"))


def test_debug_mode_starts_and_compiles_nothing(tmp_path):
    (tmp_path / "script.py").write_text(SMALL)
    out, err = python("script.py", folder=tmp_path, TSDYN_DEBUG="1")
    assert (out, err) == ("{} 0 0 0 False", "")


INTERRUPTED = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
from tsdyn import ahead
from tsdyn.taylor.step_parts import expand_series, reach
ahead.processors = lambda: 2
start = ahead._start
def noted():
    worker = start()
    print(worker.pid, flush=True)
    return worker
ahead._start = noted
try:
    ahead.compile_ahead([expand_series, reach])
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no signal can be sent to one process")
def test_interrupt_ends_the_workers_and_leaves_no_halves(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "TMPDIR": str(tmp_path)}
    environment |= {"PYTHONPATH": str(ROOT), "TSDYN_QUIET": ""}
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED], env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    left = [int(process.stdout.readline()) for _ in range(2)]
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (out, process.returncode) == ("interrupted\n", 0)
    assert "tsdyn: 0 of 2 kernels compiled." in err
    assert not [file for file in tmp_path.rglob("*") if file.is_file() and file.suffix != ".lock"]
    deadline = time.monotonic() + 10.0
    while left and time.monotonic() < deadline:
        left = [pid for pid in left if Path(f"/proc/{pid}").exists()]
    assert left == []
