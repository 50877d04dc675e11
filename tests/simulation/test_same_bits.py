"""A scene gives the same bits in every process, whatever ran before."""

import subprocess
import sys

import pytest

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
