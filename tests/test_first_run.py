"""Kernels compiled ahead of a first run by other processes; without them everything is as it was."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import tsdyn as ts
from examples import top
from tsdyn.ahead import all_kernels, first_run, workers
from tsdyn.cli import main
from tsdyn.configuration.start_kernels import evaluate_start
from tsdyn.jit import waiting
from tsdyn.jit.compiled import _types
from tsdyn.runs.stepper import advance
from tsdyn.taylor.stepper import advance_series

ROOT = Path(__file__).parents[1]
SMALL = """
import os
with open("ran", "a") as file:
    file.write("once ")
import tsdyn
from tsdyn.ahead import workers
from tsdyn.jit import cache
from tsdyn.constraints import EulerNormalization
workers.processors = lambda: 2
started = []
start = workers._start
workers._start = lambda: started.append(start()) or started[-1]
kernels = [EulerNormalization.kernels[name] for name in ("phi", "jacobian", "gamma")]
# CHANGED
failed = workers.compile_ahead(kernels)
for kernel in kernels:
    kernel.address
counts = cache.statistics
print(failed, len(started), counts["misses"], counts["hits"], any(worker.poll() is None for worker in started))
"""


def python(*arguments, folder, code=None, **environment):
    """Run Python in a folder with an empty cache beside it; returns what it has printed, as (out, err)."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("TSDYN_")}
    scratch = folder.with_name(f"{folder.name}-scratch")  # kernels are read from the temporary folder, too
    scratch.mkdir(exist_ok=True)
    kept |= {"NUMBA_CACHE_DIR": str(folder / "cache"), "TMPDIR": str(scratch), "PYTHONPATH": str(ROOT), **environment}
    command = [sys.executable, *arguments]
    result = subprocess.run(command, input=code, cwd=folder, env=kept, text=True, capture_output=True, timeout=300)
    assert result.returncode == 0, result.stderr
    return result.stdout.split("\n")[0], result.stderr


def files(folder):
    return sorted(file.name.partition("-")[0] for file in folder.rglob("*") if ".kernel" in file.name[:-5])


LOOPS = [f"euler_normalization.EulerNormalization.{name}_loop" for name in ("gamma", "jacobian", "phi")]
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


@pytest.mark.parametrize(
    ("change", "started"),
    [
        ("workers.processors = lambda: 1", 0),
        ("import sys; sys.executable = '/nowhere/python'", 0),
        ("import sys; sys.executable = sys._base_executable = os.path.realpath('/bin/false')", 2),
        ("workers._start = lambda: (started.append(start()), started[-1].kill())[0] or started[-1]", 2),
        ("os.environ['TSDYN_WORKER'] = '1'", 0),
    ],
    ids=["one processor", "no Python", "not Python", "killed", "a worker itself"],
)
@pytest.mark.skipif(sys.platform == "win32", reason="there is no /bin/false")
def test_without_workers_kernels_are_compiled_in_process(tmp_path, change, started):
    (tmp_path / "script.py").write_text(SMALL.replace("# CHANGED", change))
    assert python("script.py", folder=tmp_path, TSDYN_QUIET="1") == (f"{{}} {started} {IN_PROCESS}", "")


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
from tsdyn.ahead import workers
from tsdyn.taylor.step_parts import expand_series, reach
workers.processors = lambda: 2
start = workers._start
def noted():
    worker = start()
    print(worker.pid, flush=True)
    return worker
workers._start = noted
try:
    workers.compile_ahead([expand_series, reach])
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


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


class Height(ts.Primitive):
    """A plug-in."""

    rows = 1
    markers = (ts.Point("a"),)

    @staticmethod
    def phi(x, par, t, out):
        out[0] = x[2]

    @staticmethod
    def jacobian(x, par, t, out):
        out[0, 2] = 1.0

    @staticmethod
    def gamma(x, xd, par, t, out):
        out[0] = 0.0


def test_plug_ins_are_left_to_this_process():
    for kernel in Height.kernels.values():
        assert workers.name_of(kernel) == ""
    scene = ts.Scene()
    load_ = scene.add(ts.forces.UserForce(scene.add_point_mass(1.0), function=lambda t, a, b, par, out: None))
    assert {workers.name_of(kernel) for kernel in load_.kernels.values()} == {""}


def test_every_kernel_of_the_package_is_found_by_its_name():
    kernels = list(all_kernels._all())
    assert len(kernels) > 150
    timers = "tsdyn.profiling"  # made as they are needed
    nameless = [kernel.py_func for kernel in kernels if not workers.name_of(kernel)]
    assert [function.__qualname__ for function in nameless if not function.__module__.startswith(timers)] == []
    assert {*all_kernels._default()} <= {*kernels}


def test_longest_first():
    names = workers.weight(advance_series.py_func), workers.weight(evaluate_start.py_func)
    small = [workers.weight(kernel.py_func) for kernel in ts.constraints.EulerNormalization.kernels.values()]
    assert min(names) > max(small)


RUN = """
import importlib, sys
import tsdyn as ts
from tsdyn.ahead import first_run
asked = set()
first_run.compile_ahead = asked.update
name, method, form, times = sys.argv[1:]
scene = importlib.import_module(f"examples.{name}").build()
times = [0.0, 0.005, 0.01] if times else None
ts.simulate(scene, (0.0, 0.01), integrator=method or None, formulation=form, t_eval=times)
from tsdyn.ahead import all_kernels
from tsdyn.jit.compiled import is_loaded
label = lambda kernel: kernel.py_func.__module__ + ":" + kernel.py_func.__qualname__
used = {kernel for kernel in all_kernels._all() if is_loaded(kernel)}
print(sorted(map(label, used - asked)), sorted(map(label, {kernel for kernel in asked if not is_loaded(kernel)})))
"""


@pytest.mark.parametrize(
    ("name", "method", "form", "times"),
    [
        ("top", "", "tangent", ""),
        ("top", "", "tangent", "within"),
        ("top", "dop853", "tangent", "within"),
        ("slider_crank", "", "tangent", ""),
    ],
)
def test_what_a_run_needs_is_asked_for_and_no_more(tmp_path, name, method, form, times):
    command = [sys.executable, "-c", RUN, name, method, form, times]
    result = subprocess.run(command, cwd=ROOT, text=True, capture_output=True, timeout=600)
    assert result.stdout.strip() == "[] []", result.stderr


def test_signatures_are_those_of_the_calls():
    ts.simulate(top.build(), (0.0, 0.01))
    ts.simulate(top.build(), (0.0, 0.01), integrator="dop853")
    for kernel in (evaluate_start, advance_series, advance):
        assert list(kernel.overloads) == [_types(kernel)]


def test_a_prepared_scene_asks_for_nothing(monkeypatch):
    scene = top.build()
    ts.simulate(scene, (0.0, 0.01))
    monkeypatch.setattr(first_run, "compile_ahead", lambda kernels: pytest.fail("asked again"))
    ts.simulate(scene, (0.0, 0.01))


def test_wrong_arguments_are_refused_before_anything_is_compiled(monkeypatch):
    monkeypatch.setattr(first_run, "compile_ahead", lambda kernels: pytest.fail("compiled"))
    for wrong in ({"rtol": -1.0}, {"max_step": 0.0}, {"integrator": "euler"}, {"t_eval": []}, {"history": 2}):
        with pytest.raises(ts.TsdynError):
            ts.simulate(top.build(), (0.0, 1.0), **wrong)
    with pytest.raises(ts.InvalidBody):
        ts.simulate(ts.Scene(), (0.0, 1.0))


class Terminal:
    def __init__(self):
        self.text = ""

    def isatty(self):
        return True

    def write(self, text):
        self.text += text

    def flush(self):
        pass


def test_one_line_counts_on_a_terminal(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.delenv("TSDYN_QUIET", raising=False)
    with waiting.Waiting(2) as line:
        for name in (
            "tsdyn.configuration.start_kernels evaluate_start",
            "tsdyn.constraints.distance Distance.phi_loop",
        ):
            line.begin(name)
            line.end(name)
    lines = sys.stderr.text.split("\r")[1:]
    assert {len(line.rstrip("\n")) for line in lines} == {99}
    assert lines[0].split(":")[-1].strip() == "0 of 2, 0 s (start_kernels.evaluate_start)"
    assert lines[-1].strip() == "tsdyn: 2 of 2 kernels compiled in 0 s."
    assert sys.stderr.text.count("\n") == 1


def test_quiet(monkeypatch, capsys):
    monkeypatch.setenv("TSDYN_QUIET", "1")
    with waiting.Waiting(1) as line:
        line.begin("tsdyn.configuration.start_kernels evaluate_start")
        line.end("tsdyn.configuration.start_kernels evaluate_start")
    assert capsys.readouterr() == ("", "")


COMMAND = """
import sys
from tsdyn.ahead import all_kernels, workers
from tsdyn.cli import main
from tsdyn.constraints import EulerNormalization
workers.processors = lambda: 2
all_kernels._default = lambda: [EulerNormalization.kernels["phi"], EulerNormalization.kernels["gamma"]]
# CHANGED
print(main(["compile"]))
"""


def test_compile_command(tmp_path):
    out, err = python("-c", COMMAND, folder=tmp_path)
    assert out.startswith("2 kernels are in ")
    lines = err.splitlines()
    assert sorted(line.split()[-1] for line in lines[1:-1]) == [
        "EulerNormalization.gamma_loop",
        "EulerNormalization.phi_loop",
    ]
    again, err = python("-c", COMMAND, folder=tmp_path)
    assert (again, err) == (out, "")


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs the limits of POSIX")
def test_compile_command_that_can_not_store_says_so(tmp_path):
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))"
    out, err = python("-W", "ignore", "-c", COMMAND.replace("# CHANGED", limit), folder=tmp_path, TSDYN_QUIET="1")
    assert out == "1"
    assert err.count("was not compiled: the file could not be written") == 2


def test_compile_command_in_debug_mode(monkeypatch, capsys):
    monkeypatch.setattr(all_kernels, "DEBUG", True)
    assert main(["compile"]) == 1
    assert "TSDYN_DEBUG" in capsys.readouterr().err


def test_kernels_can_be_tried_from_python_and_pickled():
    import pickle

    from tsdyn.maths.dense_linalg import largest

    assert largest(np.array([1.0, -3.0])) == 3.0
    assert pickle.loads(pickle.dumps(largest)) is largest


@pytest.mark.slow
def test_first_run_leaves_nothing_to_its_own_process(tmp_path):
    code = """
import tsdyn
from tsdyn.ahead import workers
from tsdyn.jit import cache
from examples import top
workers.processors = lambda: 2
end = tsdyn.simulate(top.build(), (0.0, 0.1)).q[-1]
print(cache.statistics["misses"], end.tobytes().hex())
"""
    out, _ = python("-c", code, folder=tmp_path, TSDYN_QUIET="1")
    expected = ts.simulate(top.build(), (0.0, 0.1)).q[-1]
    assert out == f"0 {expected.tobytes().hex()}"


def test_users_kernels_may_be_recursive_and_serve_numba():
    import numba

    @ts.kernel
    def factorial(n):
        if n <= 1:
            return 1
        return n * factorial(n - 1)

    @numba.njit
    def used(x):
        return factorial(4) + x

    assert (factorial(3), used(2)) == (6, 26)
