"""Stiff chains of 4 to 1024 links: steps, Newton iterations, matrices and time of a step against the number of links.

A chain of N links of 0.1 m and 1 kg on revolute joints, released horizontal, with a torsional spring and damper at each
joint: stiffness 1000 N^2 N m/rad, damping 2 N N m s/rad. One second, for the longest chains less.

Columns: tolerance; steps and rejected steps; iterations a stage; iteration matrices a step; milliseconds a step; time
of a warm run; the largest error of the last positions against tolerances of 1e-9, where that takes less than a minute;
d log step / d log N; peak memory of the process.

Run it: python -m benchmarks.stiff_chain [--method Radau] [--links N ...] [--tolerances TOL ...]
"""

import argparse
import resource

import numpy as np

import tsdyn as ts
from benchmarks.contender import timed

Y, X = (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
LENGTH, MASS, GRAVITY = 0.1, 1.0, 9.81  # m, kg, m/s^2
INERTIA = MASS * LENGTH**2 / 12.0  # kg m^2
LINKS, TOLERANCES = (4, 16, 64, 256, 1024), (1e-2, 1e-4)
HEAD = " links     tol  steps  rej.   it. matr.  ms/step       s    error growth     MB"
ROW = "{:6d} {:7.0e} {:6d} {:5d} {:5.2f} {:5.2f} {:8.3f} {:7.3f} {:8.1e} {:6.2f} {:6.0f}"
COMPARED = 64  # links up to which a reference is computed
WORK = 64  # links times seconds of motion at most


def spring(links):
    """Stiffness, N m/rad, and damping, N m s/rad, of a joint."""
    return 1e3 * links**2, 2.0 * links


def reach(links):
    """Derivatives of the drops of the centroids by the angles of the links, (links, links), in links; horizontal."""
    return np.tril(np.ones((links, links)), -1) + 0.5 * np.eye(links)


def chain(links):
    """The chain."""
    scene, (stiffness, damping) = ts.Scene(gravity=(0.0, 0.0, -GRAVITY)), spring(links)
    before = scene.ground
    for i in range(links):
        link = scene.add_body(MASS, (1e-4, INERTIA, INERTIA), (LENGTH * (i + 0.5), 0.0, 0.0), name=f"link{i + 1}")
        scene.add(ts.constraints.Revolute.at(before, link, point=(LENGTH * i, 0.0, 0.0), axis=Y))
        scene.add(
            ts.forces.TorsionalSpring(
                before, link, axis_a=Y, reference_a=X, reference_b=X, stiffness=stiffness, damping=damping
            )
        )
        before = link
    return scene


def _run(scene, end, method):
    return ts.simulate(scene, (0.0, end), integrator=method, t_eval=(0.0, end)).raise_if_failed()


def _positions(solution):
    return np.stack([solution.position(body)[-1] for body in solution.scene.bodies])


def measure(links, tolerances, kind):
    """Yield a row of each tolerance: (tolerance, stages, stats, seconds of a warm run, error or nan)."""
    scene, end = chain(links), min(1.0, WORK / links)
    reference = _positions(_run(scene, end, kind(1e-9, 1e-9))) if links <= COMPARED else np.nan
    for tol in tolerances:
        method = kind(tol, tol)
        _run(scene, 0.01 * end, method)
        seconds, solution = timed(_run, scene, end, method)
        yield tol, len(method.tableau.c) - 1, solution.stats, seconds, np.abs(_positions(solution) - reference).max()


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--links", type=int, nargs="+", default=LINKS)
    parser.add_argument("--tolerances", type=float, nargs="+", default=TOLERANCES)
    parser.add_argument("--method", default="SDIRK54", choices=("SDIRK54", "Radau"))
    options = parser.parse_args()
    print(HEAD)
    before = {}
    for links in options.links:
        kind = getattr(ts.integrators, options.method)
        for tol, stages, stats, seconds, error in measure(links, options.tolerances, kind):
            tried = stats.steps + stats.rejected
            step, growth = 1e3 * seconds / tried, np.nan
            if tol in before:
                growth = np.log(step / before[tol][1]) / np.log(links / before[tol][0])
            before[tol] = links, step
            iterations, matrices = stats.stage_iterations / stages / tried, stats.iteration_matrices / tried
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
            row = links, tol, stats.steps, stats.rejected, iterations, matrices, step, seconds, error, growth, memory
            print(ROW.format(*row), flush=True)


if __name__ == "__main__":
    main()
