"""A scene gives the same bits in every process, whatever ran before."""

import os
import subprocess
import sys

import pytest

from tsdyn.stress.campaign import BLAS_THREADS

CODE = """
import hashlib, sys
import tsdyn as ts
from examples import four_bar, geared_pair, top

SCENES = {"top": top.build, "four_bar": four_bar.build, "geared_pair": geared_pair.build}
METHODS = {
    "default": None, "dop853": "dop853", "rk45": "rk45", "nystrom4": ts.integrators.Nystrom4(1e-2),
    "sdirk54": "sdirk54", "trapezoid": ts.integrators.ImplicitTrapezoid(1e-4, 1e-4),
}
names = sys.argv[1].split(",")
found = {}
for scene in sorted(SCENES, reverse=sys.argv[2] == "backwards"):
    for name in sorted(names, reverse=sys.argv[2] == "backwards"):
        solution = ts.simulate(SCENES[scene](), (0.0, 0.5), integrator=METHODS[name])
        parts = (solution.t, solution.q, solution.qd, solution.qdd, solution.multipliers)
        found[scene, name] = hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest()
print(sorted(found.items()))
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "methods",
    [
        pytest.param("default,dop853,rk45,nystrom4", id="explicit"),
        pytest.param("sdirk54,trapezoid", id="implicit"),
    ],
)
def test_every_process_and_order(methods):
    found = [
        subprocess.run([sys.executable, "-c", CODE, methods, order], capture_output=True, text=True, check=True).stdout
        for order in ("forwards", "backwards")
    ]
    assert found[0] == found[1]
    assert found[0].count("(") == 3 * len(methods.split(",")) * 2


TOWER = """
import hashlib
import tsdyn as ts
from tests.simulation.test_many_contacts import stack

solution = ts.simulate(stack(10, rough=True), (0.0, 0.22), rtol=1e-10, atol=1e-10)
print(len(solution.t), hashlib.sha256(solution.q.tobytes() + solution.multipliers.tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_many_contacts_whatever_the_threads_of_linear_algebra():
    found = {
        subprocess.run(
            [sys.executable, "-c", TOWER], env={**os.environ, **dict.fromkeys(BLAS_THREADS, threads)},
            capture_output=True, text=True, check=True,
        ).stdout
        for threads in ("1", "2")
    }  # fmt: skip
    assert len(found) == 1
    assert int(found.pop().split()[0]) > 1000
