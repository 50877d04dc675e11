"""Stability map of the double pendulum: the time until its lower rod first turns over, for every pair of angles.

Two equal rods, l long, start at rest at angles a and b from hanging. The lower one can't turn over where the energy
doesn't suffice for it upright below the upper one hanging,

    3 cos(a) + cos(b) > 2

The check counts no flip there. Run it: python examples/stability_map.py [points a side] [seconds]; it saves
stability_map.png.
"""

import sys

import numpy as np

import tsdyn as ts

LENGTH, MASS, POINTS, END = 1.0, 1.0, 40, 6.0  # m, kg, starts a side, s
GRID = 0.01  # s, between the times at which the lower rod is looked at
FIGURE = "stability_map.png"


def build():
    """Return the scene: two rods that hang; x is forward, z up."""
    scene = ts.Scene()
    rod = ts.shapes.rod(LENGTH, axis="z", mass=MASS)
    upper = scene.add_body(**rod, position=(0, 0, -LENGTH / 2), name="upper")
    lower = scene.add_body(**rod, position=(0, 0, -1.5 * LENGTH), name="lower")
    axis = (0, 1, 0)
    scene.add(ts.constraints.Revolute.at(scene.ground, upper, point=(0, 0, 0), axis=axis, name="shoulder"))
    scene.add(ts.constraints.Revolute.at(upper, lower, point=(0, 0, -LENGTH), axis=axis, name="elbow"))
    return scene


def starts(points):
    """Angles a and b (points^2,), and the parameters of starts at rest there."""
    angles = np.pi * (2 * np.arange(points) + 1 - points) / points
    a, b = (grid.ravel() for grid in np.meshgrid(angles, angles, indexing="ij"))
    down = [np.stack([-np.sin(x), 0 * x, -np.cos(x)], axis=1) for x in (a, b)]  # right hand about y: forward is -
    turns = [np.stack([np.cos(x / 2), 0 * x, np.sin(x / 2), 0 * x], axis=1) for x in (a, b)]
    places = LENGTH / 2 * down[0], LENGTH * down[0] + LENGTH / 2 * down[1]
    names = ("upper", "lower")
    table = {f"{name}.position": place for name, place in zip(names, places, strict=True)}
    return a, b, table | {f"{name}.orientation": turn for name, turn in zip(names, turns, strict=True)}


def first_flip(solution):
    """The time at which the lower rod first points straight up, s; infinite if it never does."""
    p = solution.orientation("lower")
    turned = np.unwrap(2 * np.arctan2(p[:, 2], p[:, 0]))  # about y
    over = np.flatnonzero(np.diff(np.floor((turned + np.pi) / (2 * np.pi))))
    return solution.t[over[0] + 1] if over.size else 1e9


def run(points=POINTS, end=END, **options):
    """Angles a and b, and the `Ensemble`."""
    a, b, table = starts(points)
    times = np.linspace(0.0, end, round(end / GRID) + 1)
    tolerances = {"rtol": 1e-9, "atol": 1e-9}
    return a, b, ts.ensemble(build(), table, (0.0, end), keep=first_flip, t_eval=times, **tolerances, **options)


def check(a, b, ensemble):
    """Every case has run; some flip, and none of those that can't."""
    assert ensemble.success.all(), ensemble.message
    flips = ensemble.kept < 1e9
    assert flips.any()
    assert not flips[3 * np.cos(a) + np.cos(b) > 2 + 1e-9].any()


def draw(a, b, times, end, path=FIGURE):
    """Save the map."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    points, figure = round(np.sqrt(len(a))), Figure(figsize=(6, 5), layout="constrained")
    axes = figure.subplots()
    shown = np.where(times > end, np.nan, times).reshape(points, points).T
    grid = np.degrees(a.reshape(points, points)[:, 0])
    mesh = axes.pcolormesh(grid, grid, shown, norm=LogNorm(0.3, end), cmap="viridis", rasterized=True)
    figure.colorbar(mesh, label="time to the first flip (s)")
    axes.contour(grid, grid, (3 * np.cos(a) + np.cos(b)).reshape(points, points).T, levels=[2.0], colors="k")
    axes.set_xlabel("angle of the upper rod (degrees)")
    axes.set_ylabel("angle of the lower rod (degrees)")
    axes.set_aspect("equal")
    figure.savefig(path, dpi=160)


def main():
    """Run it and save the picture."""
    points = int(sys.argv[1]) if len(sys.argv) > 1 else POINTS
    end = float(sys.argv[2]) if len(sys.argv) > 2 else END
    a, b, ensemble = run(points, end, progress=True)
    check(a, b, ensemble)
    draw(a, b, ensemble.kept, end)
    print(f"{ensemble}: {np.mean(ensemble.kept < 1e9):.1%} of the starts flip within {end:g} s; see {FIGURE}")


if __name__ == "__main__":
    main()
