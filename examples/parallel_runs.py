"""Parallel runs: threads share one process and its kernels; processes have their own.

Run it: python examples/parallel_runs.py
"""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np

import tsdyn as ts

SPINS = np.linspace(9.0, 13.0, 8)  # rad/s


def build(spin):
    """Return a top of 30 kg on a smooth plane, upright, with this spin and a push."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.6))
    top = scene.add_body(
        mass=30.0,
        inertia=(90.0, 90.0, 30.0),
        position=(0.0, 0.0, 1.0),
        angular_velocity=(0.5, 0.0, spin),
        name="top",
    )
    scene.add(ts.constraints.PlaneContact(top, scene.ground, point_a=(0.0, 0.0, -1.0), normal_b=(0.0, 0.0, 1.0)))
    return scene


def largest_tilt(spin):
    """Run one case; return its largest tilt, rad."""
    solution = ts.simulate(build(spin), (0.0, 5.0), t_eval=np.linspace(0.0, 5.0, 201))
    solution.raise_if_failed()
    return float(np.arccos(solution.rotation("top")[:, 2, 2]).max())


def by_threads(spins=SPINS, threads=4):
    """Tilts of all cases by threads: the GIL is released while a run is in its kernels."""
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(largest_tilt, spins))


def by_processes(spins=SPINS, processes=2):
    """Tilts of all cases by processes, which load the kernels from the cache."""
    with ProcessPoolExecutor(processes) as pool:
        return list(pool.map(largest_tilt, spins))


def check(spins=SPINS):
    """The order of runs and who makes them change no bit."""
    assert by_threads(spins) == by_processes(spins) == [largest_tilt(spin) for spin in spins]


if __name__ == "__main__":
    for spin, tilt in zip(SPINS, by_threads(), strict=True):
        print(f"{spin:6.2f} rad/s: {np.degrees(tilt):5.1f} degrees")
    check()
