"""The gallery of hard cases in Exudyn, beside tsdyn: largest gap of a joint, energy error, time.

Exudyn: bodies with Euler parameters, joints by multipliers, generalised-alpha of index 3, its usual choice, with steps
of one size; where rows depend on others, its dense solver, which allows that. Kapitza's pendulum, whose pivot is
driven, and scenes of hundreds of bodies with dependent rows are left out. tsdyn: the default method.

Energy errors are relative to the largest kinetic energy; those of cases with dampers and motors aren't given.

Run it: python -m benchmarks.hard_cases [case ...] [--step 1e-3] [--seconds 10]
"""

import argparse

import numpy as np

import tsdyn as ts
from benchmarks.contender import timed
from tsdyn.measuring.engines import OUTPUTS, Exudyn
from tsdyn.stress.gallery import CASES

DENSE = 600  # rows that a dense solver takes in a reasonable time


def figures(scene, r, A, v, omega):
    """Largest gap of points that a joint holds together, m, and energy error relative to the kinetic energy."""
    index, gap = {body: i for i, body in enumerate(scene.bodies)}, 0.0

    def place(item, k):
        body = (item.a, item.b)[k]
        if body is scene.ground:
            return np.broadcast_to(item.coordinates[k], r[:, 0].shape)
        return r[:, index[body]] + A[:, index[body]] @ item.coordinates[k]

    for item in (*scene.constraints, *scene.forces):
        kind = type(item).__name__
        if kind in ("Revolute", "Spherical"):
            gap = max(gap, np.linalg.norm(place(item, 0) - place(item, 1), axis=1).max())
        elif kind == "Distance":
            gap = max(gap, np.abs(np.linalg.norm(place(item, 0) - place(item, 1), axis=1) - item.length).max())
        elif kind == "PlaneContact":
            gap = max(gap, np.abs((place(item, 0) - place(item, 1)) @ item.coordinates[2]).max())
    mass = np.array([body.mass for body in scene.bodies])
    J = np.array([body.inertia for body in scene.bodies])
    kinetic = 0.5 * ((mass * (v**2).sum(-1)).sum(-1) + np.einsum("kbi,bij,kbj->k", omega, J, omega))
    energy = kinetic - np.einsum("b,kbi,i->k", mass, r, scene.gravity)
    off = np.nan if scene.forces else np.abs(energy - energy[0]).max() / kinetic.max()
    return gap, off


def ours(scene, end):
    """The figures of the default method, and seconds."""
    ts.simulate(scene, (0.0, end / 100))
    seconds, solution = timed(ts.simulate, scene, (0.0, end), t_eval=np.linspace(0.0, end, OUTPUTS + 1))
    solution.raise_if_failed()
    each = (solution.position, solution.rotation, solution.velocity, solution.angular_velocity)
    return *figures(scene, *(np.stack([get(body) for body in scene.bodies], axis=1) for get in each)), seconds


def main():
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="case", help="cases, by a part of their names")
    parser.add_argument("--step", type=float, default=1e-3, help="s, of Exudyn (1e-3)")
    parser.add_argument("--seconds", type=float, default=10.0, help="of the motion, at most (10)")
    given = parser.parse_args()
    print("| case | engine | gap (m) | energy error | time (s) |\n|---|---|---:|---:|---:|")
    for case in CASES:
        if "Kapitza" in case.name or (given.cases and not any(word in case.name for word in given.cases)):
            continue
        end, scene = min(case.end, given.seconds), case.build()
        rows = [("tsdyn", *ours(scene, end))]
        if not (scene.mobility().redundant and len(scene.row_names()) > DENSE):
            try:
                found = Exudyn(scene).run(end, min(given.step, end / 300))
                rows.append(("Exudyn", *figures(scene, found.r, found.A, found.v, found.omega), found.seconds))
            except ts.StepFailure:
                rows.append(("Exudyn", np.nan, np.nan, np.nan))
        for name, gap, off, seconds in rows:
            cells = (
                "gives up | | " if np.isnan(seconds) else f"{gap:.1e} | {off:.1e} | {seconds:.2f}".replace("nan", "-")
            )
            print(f"| {case.name} | {name} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
