"""Run where a platform wheel is installed: every method and form, and a Numba that ends the process if it compiles."""

import contextlib
import json
import sys
import time

import numba  # noqa: F401  (beside SciPy, what the time of a first run is counted from)
import numpy as np
import scipy.spatial.transform  # noqa: F401
from numba.core.compiler_machinery import PassManager

began = time.perf_counter()

import tsdyn as ts  # noqa: E402
from tsdyn.jit import cache, compilers  # noqa: E402


def refuse(manager, state):
    raise SystemExit(f"Numba is asked to compile {state.func_id.func_qualname}")


PassManager.run = refuse


def chain(count):
    """A chain of rods on ball joints, and a spring at its end."""
    scene, last, end = ts.Scene(), None, (0.0, 0.0, 0.0)
    for i in range(count):
        rod = scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.01), position=(i + 0.5, 0.0, 0.0))
        scene.add(ts.constraints.Spherical(last or scene.ground, rod, point_a=end, point_b=(-0.5, 0.0, 0.0)))
        last, end = rod, (0.5, 0.0, 0.0)
    scene.add(
        ts.forces.Spring(last, scene.ground, point_b=(count, 0.0, 1.0), stiffness=10.0, damping=1.0, name="spring")
    )
    return scene


def loop():
    """A slider-crank of spatial joints, with redundant rows."""
    scene = ts.Scene(gravity=(0.0, -9.81, 0.0))
    crank = scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0.0, 0.1, 0.0))
    rod = scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0.2, 0.1, 0.0))
    slider = scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0.4, 0.0, 0.0))
    joints, axis = ts.constraints, (0.0, 0.0, 1.0)
    hinge = scene.add(joints.Revolute.at(scene.ground, crank, point=(0.0, 0.0, 0.0), axis=axis))
    scene.add(joints.Revolute.at(crank, rod, point=(0.0, 0.2, 0.0), axis=axis))
    scene.add(joints.Revolute.at(rod, slider, point=(0.4, 0.0, 0.0), axis=axis))
    scene.add(joints.Translational.at(scene.ground, slider, point=(0.4, 0.0, 0.0), axis=(1.0, 0.0, 0.0)))
    return scene, hinge


def first_run(method, form):
    """One run, as a user's first."""
    solution = ts.simulate(
        chain(3), (0.0, 0.02), integrator=method or None, formulation=form, t_eval=[0.0, 0.011, 0.02]
    )
    return solution.raise_if_failed().q[-1]


def everything():
    """All methods and forms, long chains, loops, statics, events, dense output, reactions."""
    ends = {}
    for kind in ts.integrators.registered():
        for form in ("tangent", "null-space", "maggi-kane"):
            with contextlib.suppress(ts.InvalidArgument):  # a method that doesn't serve the form
                ends[f"{kind.__name__} {form}"] = first_run(kind.__name__.lower(), form).tobytes().hex()
    for count in (40, 300):  # sparse rows; series that exceed the caches near by
        for method in (None, "dop853", "radau"):
            ts.simulate(chain(count), (0.0, 0.001), integrator=method).raise_if_failed()
    scene, hinge = loop()

    def turned(t, state):
        return state.angle(hinge) - 1e-4

    driven = chain(2)
    driven.add(ts.forces.PointForce(driven.bodies[-1], force=(ts.motions.Sine(1.0, 2.0), 0.0, 0.0)))
    for method in (None, "dop853", "radau"):
        ts.simulate(driven, (0.0, 0.01), integrator=method).raise_if_failed()
        solution = ts.simulate(scene, (0.0, 0.05), integrator=method, dense_output=True, events=turned)
        solution.raise_if_failed().at(0.013)
        assert solution.multipliers.size
        assert np.isfinite(solution.reaction(hinge)[0]).all()
        solution.reaction_unique(hinge), solution.power, solution.energy, solution.constraint_error
    scene.evaluate()
    scene.mobility()
    hanging = chain(3)
    hanging.linearise(hanging.equilibrium().state).eigenvalues()
    ts.ensemble(chain(2), {"spring.stiffness": [1.0, 2.0, 3.0]}, (0.0, 0.01))
    return ends


if __name__ == "__main__":
    one = first_run(*sys.argv[1:3]).tobytes().hex() if sys.argv[1:] else None
    seconds = time.perf_counter() - began
    found = {"seconds": seconds, "end": one} if one else {"ends": everything()}
    print(json.dumps({**found, **cache.statistics, "shipped": str(compilers.shipped()), "home": ts.__file__}))
