"""Stiff chains in other engines: time to an error, interleaved in one process.

The chains are those of `benchmarks.stiff_chain`. Contenders: tsdyn's default method; Exudyn with generalised-alpha and
with the trapezoid of index 2; MuJoCo with implicitfast; SciPy's Radau on minimal coordinates. Errors are the largest
of positions at 50 times, m, against SDIRK54 at 1e-11: at the end the chain is at rest, whatever the method.

Run it: python -m benchmarks.stiff_peers [--links 4 16 64] [--budget 20] [--figure stiff.png]
"""

import argparse
import time

import numpy as np

import tsdyn as ts
from benchmarks.stiff_chain import LENGTH, MASS, chain

END, OUTPUTS = 1.0, 50  # s
TIMES = np.linspace(0.0, END, OUTPUTS + 1)
LEVELS = 10.0 ** -np.arange(3, 11)
STEPS = tuple(END / OUTPUTS / 2**k for k in range(17))
TOLERANCES = tuple(10.0 ** (-k / 2) for k in range(4, 22))


def run_tsdyn(links, tol):
    """The default method."""
    scene = chain(links)
    ts.simulate(scene, (0.0, 1e-3), rtol=tol, atol=tol)
    begun = time.perf_counter()
    solution = ts.simulate(scene, (0.0, END), rtol=tol, atol=tol, t_eval=TIMES).raise_if_failed()
    return _places(solution), time.perf_counter() - begun


def _places(solution):
    return np.stack([solution.position(body) for body in solution.scene.bodies], axis=1)


def run_exudyn(links, step, solver="GeneralizedAlpha"):
    """The chain with multipliers."""
    from benchmarks.peers.exudyn_scene import ExudynScene

    found = ExudynScene(chain(links)).run(END, step, OUTPUTS, solver=solver)
    return (None, np.inf) if found is None else (found[0][0], found[1])


def run_trapezoid(links, step):
    """The same with the trapezoid of index 2."""
    return run_exudyn(links, step, "TrapezoidalIndex2")


def run_mujoco(links, step):
    """Hinges with stiffness and damping in a tree."""
    import mujoco

    body = ""
    for i in reversed(range(links)):
        inertia = MASS * LENGTH**2 / 12.0
        body = (
            f"<body pos='{LENGTH if i else 0.0} 0 0'>"
            f"<joint type='hinge' axis='0 1 0' stiffness='{1e3 * links**2}' damping='{2.0 * links}'/>"
            f"<inertial pos='{LENGTH / 2} 0 0' mass='{MASS}' diaginertia='1e-4 {inertia} {inertia}'/>{body}</body>"
        )
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><option gravity='0 0 -9.81' integrator='implicitfast' timestep='{END / round(END / step)}'/>"
        f"<worldbody>{body}</worldbody></mujoco>"
    )
    data, count, seconds, places = mujoco.MjData(model), round(END / OUTPUTS / step), 0.0, []
    for i in range(OUTPUTS + 1):
        begun = time.perf_counter()
        mujoco.mj_step(model, data, count if i else 0)
        seconds += time.perf_counter() - begun
        mujoco.mj_kinematics(model, data)
        places.append(data.xipos[1:].copy())
    return np.array(places), seconds


def run_radau(links, tol):
    """Angles from the horizontal as coordinates, with the Jacobian by differences that SciPy makes."""
    from scipy.integrate import solve_ivp

    reach = np.tril(np.ones((links, links)), -1) + 0.5 * np.eye(links)  # of centroids, in links
    a, first = MASS * LENGTH**2 * reach.T @ reach, MASS * LENGTH * 9.81 * reach.sum(axis=0)
    own = MASS * LENGTH**2 / 12.0 * np.eye(links)
    stiffness, damping = 1e3 * links**2, 2.0 * links

    def rates(_, y):
        angle, rate = y[:links], y[links:]
        between = angle[:, None] - angle
        bend, turn = np.diff(angle, prepend=0.0), np.diff(rate, prepend=0.0)
        torque = -stiffness * bend - damping * turn
        load = first * np.cos(angle) + torque - np.append(torque[1:], 0.0) - (a * np.sin(between)) @ rate**2
        return np.concatenate((rate, np.linalg.solve(a * np.cos(between) + own, load)))

    begun = time.perf_counter()
    found = solve_ivp(rates, (0.0, END), np.zeros(2 * links), "Radau", t_eval=TIMES, rtol=tol, atol=tol)
    seconds, angle = time.perf_counter() - begun, found.y[:links].T
    x, z = (LENGTH * f @ reach.T for f in (np.cos(angle), -np.sin(angle)))
    return np.stack((x, np.zeros_like(x), z), axis=2), seconds


CONTENDERS = {
    "tsdyn": (run_tsdyn, TOLERANCES),
    "Exudyn, generalised-alpha": (run_exudyn, STEPS),
    "Exudyn, trapezoid": (run_trapezoid, STEPS),
    "MuJoCo, implicitfast": (run_mujoco, STEPS),
    "SciPy, Radau": (run_radau, TOLERANCES),
}


def measure(links, budget):
    """{name: (errors, seconds)} of all settings that take less than the budget, s."""
    options = {"integrator": ts.integrators.SDIRK54(1e-11, 1e-11), "t_eval": TIMES}
    reference, points = _places(ts.simulate(chain(links), (0.0, END), **options).raise_if_failed()), {}
    for name, (run, settings) in CONTENDERS.items():
        found = []
        for setting in settings:
            try:
                places, seconds = run(links, setting)
            except ImportError as error:
                print(f"{name}: {error}")
                break
            if places is not None and np.isfinite(places).all():
                found.append((np.abs(places - reference).max(), seconds))
            if seconds > budget:
                break
        if found:
            points[name] = np.array(found).T
    return points


def times(errors, seconds):
    """The least time to each of LEVELS, s; nan where none of the runs is as exact."""
    return np.array([seconds[errors <= level].min(initial=np.inf) for level in LEVELS])


def draw(found, path):
    """Error against time, a panel for each number of links."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, len(found), figsize=(4.5 * len(found), 4), sharey=True, squeeze=False)
    for panel, (links, points) in zip(panels[0], found.items(), strict=True):
        for name, (errors, seconds) in points.items():
            panel.loglog(seconds, errors, "o-", label=name, markersize=3)
        panel.set(title=f"{links} links", xlabel="time (s)")
    panels[0, 0].set_ylabel("largest error of positions (m)")
    panels[0, 0].legend(fontsize=7)
    figure.savefig(path, dpi=150, bbox_inches="tight")


def main():
    """Print a table for each number of links."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, nargs="+", default=(4, 16, 64))
    parser.add_argument("--budget", type=float, default=20.0, help="s, of a run (20)")
    parser.add_argument("--figure", help="file of a work-precision diagram")
    given, found = parser.parse_args(), {}
    for links in given.links:
        found[links] = measure(links, given.budget)
        print(f"\n{links} links: seconds to an error of\n{'':28}" + "".join(f"{level:>9.0e}" for level in LEVELS))
        for name, (errors, seconds) in found[links].items():
            print(f"{name:28}" + "".join(f"{s:9.3g}" for s in times(errors, seconds)).replace("inf", "  -"), flush=True)
    if given.figure:
        draw(found, given.figure)


if __name__ == "__main__":
    main()
