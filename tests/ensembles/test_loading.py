"""A plain run loads nothing of parameters and ensembles."""

import os
import subprocess
import sys
from pathlib import Path

CODE = """
import sys
import tsdyn as ts

scene = ts.Scene()
ball = scene.add_point_mass(mass=1.0)
ts.simulate(scene, (0, 0.1))
others = "tsdyn.simulation.parameters", "tsdyn.ensembles", "tsdyn.taylor.lane", "tsdyn.jit.lane"
print([name for name in sys.modules if name.startswith(others)])
ts.ensemble
ts.ensemble(scene, {"body1.mass": [1.0, 2.0]}, (0, 0.1))
assert not any(name.startswith(("tsdyn.taylor.lane", "tsdyn.jit.lane")) for name in sys.modules)
print("tsdyn.ensembles.ensemble" in sys.modules, "dask" in sys.modules, "pandas" in sys.modules)
"""


def test_a_plain_run_loads_nothing_of_ensembles():
    options = {"cwd": Path(__file__).parents[2], "capture_output": True, "text": True, "check": True}
    result = subprocess.run([sys.executable, "-c", CODE], env={**os.environ, "TSDYN_DEBUG": "1"}, **options)
    assert result.stdout.split("\n")[:2] == ["[]", "True False False"]
