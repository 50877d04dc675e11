"""Stiff scenes in other engines: time to an error, interleaved in one process.

Contenders: tsdyn's default method, and Radau and SDIRK54 by name; Exudyn with generalised-alpha and with the trapezoid
of index 2; for chains MuJoCo with implicitfast, SciPy's Radau on minimal coordinates, and scipy_dae's Radau and
SUNDIALS IDA on poses and multipliers in the plane; for the rough row SciPy's Radau and SUNDIALS CVODE. Errors are the
largest of positions at 50 times, m, against SDIRK54 at 1e-11: at the end many scenes are at rest, whatever the method.
Exudyn's bushings have angles of another kind, equal for small ones.

Run it: python -m benchmarks.stiff_peers [--scenes chain net] [--budget 20] [--figure stiff.png]
"""

import argparse
from functools import partial
from typing import NamedTuple

import numpy as np

import tsdyn as ts
from benchmarks import stiff
from benchmarks.contender import timed
from benchmarks.peers import dae_chain, stiff_odes
from benchmarks.stiff_chain import chain
from tsdyn.measuring.engines import Exudyn, MuJoCo
from tsdyn.stress.gallery import governor

OUTPUTS = 50
LEVELS = 10.0 ** -np.arange(3, 11)
DIVISIONS = tuple(2**k for k in range(17))  # steps an output
TOLERANCES = tuple(10.0 ** (-k / 2) for k in range(2, 22))
LOOSE = tuple(10.0 ** (-k / 2) for k in range(-2, 22))


class Stiff(NamedTuple):
    """A scene, its end, s, its number of links where it is a chain, and its kind, by which contenders are chosen."""

    build: object
    end: float
    links: int = 0
    kind: str = "any"

    @property
    def times(self):
        """Times of the outputs, s."""
        return np.linspace(0.0, self.end, OUTPUTS + 1)


SCENES = {
    **{
        f"chain of {n}": Stiff(partial(chain, n), end, n, "chain")
        for n, end in ((4, 1.0), (16, 1.0), (64, 1.0), (256, 0.2))
    },
    "stiff joint": Stiff(partial(stiff.jointed, joint=stiff.revolute), 2.0),
    "stiff springs": Stiff(stiff.hung, 2.0),
    "governor": Stiff(partial(governor, 3e5, 5e3), 2.0),
    **{f"bushings of {k:.0e}": Stiff(partial(stiff.mounted, k), 1.0) for k in (1e4, 1e6, 1e8)},
    "rough row": Stiff(stiff.pushed, 1.0, kind="row"),
    "net of 32 x 32": Stiff(stiff.net, 0.5),
}


def run_default(case, tol):
    """The default method."""
    return run_tsdyn(case, rtol=tol, atol=tol)


def run_collocation(case, tol):
    """Radau by name."""
    return run_tsdyn(case, integrator=ts.integrators.Radau(tol, tol))


def run_sdirk(case, tol):
    """SDIRK54 by name."""
    return run_tsdyn(case, integrator=ts.integrators.SDIRK54(tol, tol))


def run_tsdyn(case, **options):
    """A warm run: kernels are loaded, those of the method to which the default one turns, too."""
    scene = case.build()
    for share in (1e-3 if "integrator" in options else 1.0, 1.0):
        seconds, solution = timed(ts.simulate, scene, (0.0, share * case.end), t_eval=share * case.times, **options)
    return _places(solution.raise_if_failed()), seconds


def _places(solution):
    return np.stack([solution.position(body) for body in solution.scene.bodies], axis=1)


def run_engine(engine, method, case, divisions):
    """Another engine with steps of one size."""
    found = engine(case.build()).run(case.end, case.end / OUTPUTS / divisions, OUTPUTS, method)
    return found.r, found.seconds


def by(solver):
    """A contender that is `solver(links, times, tol)` of a chain, or `solver(times, tol)` of another scene."""

    def run(case, tol):
        try:
            return solver(*[case.links] * bool(case.links), case.times, tol)
        except RuntimeError as error:  # a tolerance that is too tight for it
            print(f"{solver.__module__}.{solver.__name__} at {tol:.0e}: {error}")
            return None, 0.0

    return run


OURS = {
    "tsdyn": (run_default, LOOSE),
    "tsdyn, Radau": (run_collocation, LOOSE),
    "tsdyn, SDIRK54": (run_sdirk, LOOSE),
}
EXUDYN = {
    "Exudyn, generalised-alpha": (partial(run_engine, Exudyn, "GeneralizedAlpha"), DIVISIONS),
    "Exudyn, trapezoid": (partial(run_engine, Exudyn, "TrapezoidalIndex2"), DIVISIONS),
}
PEERS = {  # of each kind of scene
    "any": EXUDYN,
    "chain": {
        **EXUDYN,
        "MuJoCo, implicitfast": (partial(run_engine, MuJoCo, "implicitfast"), DIVISIONS),
        "SciPy, Radau": (by(stiff_odes.chain), TOLERANCES),
        "scipy_dae, Radau": (by(dae_chain.run_radau), TOLERANCES),
        "SUNDIALS IDA": (by(dae_chain.run_ida), TOLERANCES),
    },
    "row": {
        "SciPy, Radau": (by(stiff_odes.row), TOLERANCES),
        "SUNDIALS CVODE": (by(stiff_odes.row_by_cvode), TOLERANCES),
    },
}


def measure(case, budget):
    """{name: (errors, seconds)} of all settings that take less than the budget, s."""
    options = {"integrator": ts.integrators.SDIRK54(1e-11, 1e-11), "t_eval": case.times}
    reference, points = _places(ts.simulate(case.build(), (0.0, case.end), **options).raise_if_failed()), {}
    for name, (run, settings) in {**OURS, **PEERS[case.kind]}.items():
        found = []
        for setting in settings:
            try:
                places, seconds = run(case, setting)
            except ImportError as error:
                print(f"{name}: {error}")
                break
            except ts.StepFailure:  # too loose
                continue
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
    """Error against time, a panel for each scene."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, len(found), figsize=(4.5 * len(found), 4), sharey=True, squeeze=False)
    for panel, (name, points) in zip(panels[0], found.items(), strict=True):
        for contender, (errors, seconds) in points.items():
            panel.loglog(seconds, errors, "o-", label=contender, markersize=3)
        panel.set(title=name, xlabel="time (s)")
    panels[0, 0].set_ylabel("largest error of positions (m)")
    panels[0, 0].legend(fontsize=7)
    figure.savefig(path, dpi=150, bbox_inches="tight")


def main():
    """Print a table for each scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=[""], help="parts of their names")
    parser.add_argument("--budget", type=float, default=20.0, help="s, of a run (20)")
    parser.add_argument("--figure", help="file of a work-precision diagram")
    given, found = parser.parse_args(), {}
    for name, case in SCENES.items():
        if not any(word in name for word in given.scenes):
            continue
        found[name] = measure(case, given.budget)
        print(f"\n{name}: seconds to an error of\n{'':28}" + "".join(f"{level:>9.0e}" for level in LEVELS))
        for contender, points in found[name].items():
            print(f"{contender:28}" + "".join(f"{s:9.3g}" for s in times(*points)).replace("inf", "  -"), flush=True)
    if given.figure:
        draw(found, given.figure)


if __name__ == "__main__":
    main()
