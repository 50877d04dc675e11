"""What a solution says of the time of its run."""

import time

import numpy as np

import tsdyn as ts
from tsdyn.jit.cache import statistics
from tsdyn.jit.compiled import DEBUG


def test_seconds_are_without_the_compilation_of_kernels():
    """The function is new in every process, so that its kernels are compiled: as it is added, others in the run."""
    number = float(np.random.default_rng().uniform())
    name = {}
    exec(f"def pull(t, a, b, par, out):\n    out[0] = {number!r} - a[0]\n", name)
    scene = ts.Scene()
    ball = scene.add_point_mass(1.0)
    before, began = statistics["waited"], time.perf_counter()
    scene.add(ts.forces.UserForce(ball, function=name["pull"]))
    seconds = ts.simulate(scene, (0.0, 1.0), integrator="dop853").stats.seconds
    whole, waited = time.perf_counter() - began, statistics["waited"] - before
    assert (waited > 0.0) is not DEBUG
    assert seconds["run"] + seconds["prepare"] <= whole - waited
