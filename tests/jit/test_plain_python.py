"""TSDYN_DEBUG=1: kernels as plain Python."""

import os
import subprocess
import sys
from pathlib import Path

CODE = """
import tsdyn as ts

scene = ts.Scene()
rod = scene.add_body(mass=1.0, inertia=(0.0, 0.1, 0.1), position=(0.5, 0.0, 0.0))
scene.add(ts.constraints.Revolute.at(rod, scene.ground, point=(0, 0, 0), axis=(0, 1, 0)))
solution = ts.simulate(scene, (0.0, 1e-3), integrator="sdirk54")
print(solution.status.name, float(solution.qdd[0, 2]))
"""


def test_implicit_methods_run_where_an_axis_has_no_inertia():
    options = {"cwd": Path(__file__).parents[2], "capture_output": True, "text": True, "check": True}
    result = subprocess.run([sys.executable, "-c", CODE], env={**os.environ, "TSDYN_DEBUG": "1"}, **options)
    status, zdd = result.stdout.split()
    expected = -0.5 * (9.81 * 0.5) / (0.1 + 0.5**2)  # m g l / (J + m l^2), at the arm l
    assert status == "SUCCESS"
    assert abs(float(zdd) - expected) < 1e-12
