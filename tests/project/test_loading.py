"""A plain run loads nothing of what it doesn't use: of tsdyn and of optional packages."""

import os
import subprocess
import sys

from tests.helpers.processes import ROOT

CODE = """
import sys
import tsdyn as ts

def loaded(*names):
    return [name for name in sys.modules if name.startswith(names)]

scene = ts.Scene()
scene.add_point_mass(mass=1.0)
ts.simulate(scene, (0, 0.1)).q
lanes, optional = ("tsdyn.taylor.lane", "tsdyn.jit.lane"), ("dask", "h5py", "matplotlib", "pandas", "xarray", "zarr")
others = [f"tsdyn.{name}" for name in
          "cli ensembles files graphics importing measuring stress testing simulation.parameters".split()]
print(loaded(*others, *lanes, *optional, "tomllib", "webbrowser"), {*loaded("tsdyn.analyses.")})
ts.ensemble
ts.ensemble(scene, {"body1.mass": [1.0, 2.0]}, (0, 0.1))
print(loaded("tsdyn.ensembles.ensemble"), loaded(*lanes, *optional))
"""


def test_a_plain_run_loads_nothing_that_it_does_not_use():
    options = {"cwd": ROOT, "capture_output": True, "text": True, "check": True}
    result = subprocess.run([sys.executable, "-c", CODE], env={**os.environ, "TSDYN_DEBUG": "1"}, **options)
    assert result.stdout.splitlines() == ["[] {'tsdyn.analyses.tolerances'}", "['tsdyn.ensembles.ensemble'] []"]
