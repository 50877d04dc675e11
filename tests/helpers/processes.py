"""Python in other processes: with the user's kernel cache, a copy of it, or an empty one; and what they report."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
OF_CHECKOUT = pytest.mark.skipif(not (ROOT / "tsdyn").is_dir(), reason="the installed tsdyn has no examples beside it")
REPORT = """
import json, tsdyn
from tsdyn.jit import cache as _cache
def report(**numbers):
    print(json.dumps({**numbers, **_cache.statistics, "folder": str(_cache.folder())}))
"""
SMALL = (
    REPORT
    + """
import tsdyn as ts
scene = ts.Scene()
mass = scene.add_point_mass(1.0, position=(1.0, 2.0, 2.0))
scene.add(ts.constraints.Distance(mass, scene.ground, length=3.0))
report(Phi=float(scene.evaluate().Phi[0]))
"""
)
TINY = (
    REPORT
    + """
from tsdyn.jit.kernels import entry
@entry
def twice(x):
    return 2.0 * x
report(value=twice(1.0))
"""
)
KERNELS = 4  # of SMALL: three loops of Distance and the one that Python calls


def command(code, environment, cwd, before=()):
    """Start Python on the code, with the user's cache unless the environment names another one."""
    full = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "TSDYN_CACHE_DIR", "TSDYN_QUIET")}
    full.update(environment)
    if "NUMBA_CACHE_DIR" in environment and "TMPDIR" not in environment:
        full["TMPDIR"] = _scratch_beside(environment["NUMBA_CACHE_DIR"])
    return subprocess.Popen(
        [*before, sys.executable, "-c", code],
        env=full,
        cwd=cwd,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def finish(process):
    """What the process has reported by its last line, and stderr."""
    out, err = process.communicate(timeout=900)
    assert process.returncode == 0, err
    return {"misses": 0, "hits": 0, **json.loads(out.splitlines()[-1])}, err


def run(code, environment, cwd=ROOT):
    """Run the code to its end: its report, and stderr."""
    return finish(command(code, environment, cwd))


def python(*arguments, folder, code=None, **environment):
    """Run Python in a folder with an empty cache beside it; returns what it has printed, as (out, err)."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("TSDYN_")}
    kept |= {"NUMBA_CACHE_DIR": str(folder / "cache"), "TMPDIR": _scratch_beside(folder), "PYTHONPATH": str(ROOT)}
    result = subprocess.run(
        [sys.executable, *arguments],
        input=code,
        cwd=folder,
        env={**kept, **environment},
        text=True,
        capture_output=True,
        timeout=300,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout.split("\n")[0], result.stderr


def edit(file, old, new):
    """Replace a text in a file, with a later time: Python tells files of one size by the second that they are of."""
    text, before = file.read_text(), file.stat()
    assert text.count(old) == 1
    file.write_text(text.replace(old, new))
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns + 10**9))


def _scratch_beside(folder):
    """A temporary folder of a process's own: kernels are read from the temporary folder, too."""
    scratch = Path(folder).with_name(f"{Path(folder).name}-scratch")
    scratch.mkdir(exist_ok=True)
    return str(scratch)
