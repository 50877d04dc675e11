"""A process that is killed at any moment, again and again, loses nothing: the bits of a run never stopped."""

import subprocess
import sys
import time

import numpy as np
import pytest

import tsdyn as ts
from examples import top
from tsdyn.files import checkpoint

KILLS = 20
RUN = """
import sys
import numpy as np
import tsdyn as ts
from examples import top
path, steps = sys.argv[1], int(sys.argv[2])
end = steps * 1e-3
if sys.argv[3] == "begin":
    times = np.append(np.arange(0, steps, 1000) * 1e-3, end)
    method = ts.integrators.Nystrom4(1e-3)
    ts.simulate(top.build(), (0, end), integrator=method, t_eval=times, store=path, checkpoint=0.05)
else:
    ts.resume(path)
"""


def moment(attempt, rng, child, newest):
    """Wait until a process is to be killed: soon after its first checkpoint, or some time after its start."""
    if attempt % 2:
        time.sleep(rng.uniform(0.0, 1.5))  # the start of a process included
        return
    began = newest.stat().st_mtime_ns if newest.exists() else 0
    while child.poll() is None and (not newest.exists() or newest.stat().st_mtime_ns == began):
        time.sleep(0.01)
    time.sleep(rng.uniform(0.0, 0.2))


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "steps"), [("h5", 10**7), ("zarr", 10**7)])
def test_killed_at_any_moment(suffix, steps, tmp_path, rng):
    path, end, what = tmp_path / f"run.{suffix}", steps * 1e-3, "begin"
    newest, _ = checkpoint.place(path)
    for attempt in range(KILLS):
        child = subprocess.Popen([sys.executable, "-c", RUN, str(path), str(steps), what])
        moment(attempt, rng, child, newest)
        child.kill()
        if child.wait() == 0:  # on a fast machine
            assert attempt >= KILLS // 2, "the run had ended"
            break
        what = "resume"
    solution = ts.resume(path)
    times = np.append(np.arange(0, steps, 1000) * 1e-3, end)
    whole = ts.simulate(
        top.build(), (0, end), integrator=ts.integrators.Nystrom4(1e-3), t_eval=times, history=False
    )  # fmt: skip
    np.testing.assert_array_equal(solution.t, times)
    for name in ("q", "qd", "qdd"):
        np.testing.assert_array_equal(getattr(solution, name), getattr(whole, name))
