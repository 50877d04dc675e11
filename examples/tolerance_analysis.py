"""Tolerances of a four-bar: how link lengths and masses that scatter change the rocker's swing and the pin's load.

    bearing, far bearing    Revolute     5 rows each
    crank pin               Spherical    3 rows
    rocker pin              Cylindrical  4 rows: 17 for 18 degrees of freedom, all reactions are determinate

Each case draws lengths and masses, and is assembled with the crank where it is. The check compares the swing with the
triangles in which crank and coupler are aligned,

    cos(angle of the rocker) = (ground^2 + rocker^2 - (coupler -+ crank)^2) / (2 ground rocker)

Run it: python examples/tolerance_analysis.py
"""

import numpy as np

import tsdyn as ts

CRANK, COUPLER, ROCKER, GROUND = LENGTHS = np.array([0.3, 0.9, 0.7, 0.8])  # m; the crank goes round
MASSES, INERTIAS = np.array([1.0, 2.0, 1.5]), (0.01, 0.15, 0.07)  # kg; kg m^2 about the joints' axis
SCATTER, MASS_SCATTER = 2e-3, 0.02  # standard deviations: m, and part of a mass
ANGLE, RATE = 0.6, 9.0  # of the crank at the start, rad and rad/s
NAMES, PINS = ("crank", "coupler", "rocker"), ("crank pin", "rocker pin", "far bearing")
AXIS, SPAN, TIMES = (0, 0, 1), (0.0, 1.2), np.linspace(0.0, 1.2, 1201)


def build():
    """Return the scene, of nominal lengths; links along their x axes, gravity along -y."""
    scene = ts.Scene(gravity=(0, -9.81, 0))
    pin = CRANK * np.array([np.cos(ANGLE), np.sin(ANGLE)])
    far = np.array([GROUND, 0.0])
    d = np.linalg.norm(far - pin)
    along = (COUPLER**2 - ROCKER**2 + d**2) / (2 * d)
    direction = (far - pin) / d
    across = np.array([-direction[1], direction[0]])
    other = pin + along * direction + np.sqrt(COUPLER**2 - along**2) * across
    places = np.array([(0.0, 0.0), pin, other, far])
    for i, name in enumerate(NAMES):
        middle, link = (places[i] + places[i + 1]) / 2, places[i + 1] - places[i]
        half = np.arctan2(link[1], link[0]) / 2
        inertia = INERTIAS[i] * np.array([0.1, 1.0, 1.0])
        scene.add_body(MASSES[i], inertia, (*middle, 0), (np.cos(half), 0, 0, np.sin(half)), name=name)
    ends = np.append(places, np.zeros((4, 1)), axis=1)
    crank, coupler, rocker = scene.bodies
    c = ts.constraints
    scene.add(c.Revolute.at(scene.ground, crank, point=ends[0], axis=AXIS, name="bearing"))
    scene.add(c.Spherical.at(crank, coupler, point=ends[1], name="crank pin"))
    scene.add(c.Cylindrical.at(coupler, rocker, point=ends[2], axis=AXIS, name="rocker pin"))
    scene.add(c.Revolute.at(rocker, scene.ground, point=ends[3], axis=AXIS, name="far bearing"))
    scene.set("bearing", rate=RATE)
    return scene


def draw(count, seed=0):
    """Lengths (count, 3) and masses (count, 3) of links that scatter."""
    rng = np.random.default_rng(seed)
    return LENGTHS[:3] + SCATTER * rng.normal(size=(count, 3)), MASSES * (
        1 + MASS_SCATTER * rng.normal(size=(count, 3))
    )


def table(lengths, masses):
    """The parameters of all cases: joints at the ends of the links, and masses."""
    points = {f"{pin}.point_a": np.outer(lengths[:, i] - LENGTHS[i] / 2, (1, 0, 0)) for i, pin in enumerate(PINS)}
    return points | {f"{name}.mass": masses[:, i] for i, name in enumerate(NAMES)}


def reduce(solution):
    """The swing of the rocker, rad, and the largest load of the crank pin, N."""
    force, _ = solution.reaction("crank pin")
    return {"swing": np.ptp(solution.angle("far bearing")), "load": np.linalg.norm(force, axis=1).max()}


def run(count=60, **options):
    """The `Ensemble` of so many cases, and their lengths."""
    scene = build()
    lengths, masses = draw(count)
    cases = table(lengths, masses)
    moving = ("coupler", "rocker")  # to make each start consistent; the crank stays where it is
    return ts.ensemble(scene, cases, SPAN, keep=reduce, assemble=moving, t_eval=TIMES, **options), lengths


def swing(lengths):
    """Of the rocker, from the lengths (k, 3) of the links, rad."""
    crank, coupler, rocker = lengths.T
    angles = [
        np.arccos((GROUND**2 + rocker**2 - (coupler + side * crank) ** 2) / (2 * GROUND * rocker)) for side in (1, -1)
    ]
    return angles[0] - angles[1]


def check(ensemble, lengths):
    """Every case has run, and swings as far as its lengths say, to what the output times resolve."""
    assert ensemble.success.all(), ensemble.message
    assert np.abs(ensemble.kept["swing"] - swing(lengths)).max() < 1e-4


def main():
    """Print quantiles of swing and load."""
    ensemble, lengths = run(progress=True)
    check(ensemble, lengths)
    print(ensemble)
    for name, values, unit in (
        ("swing of the rocker", np.degrees(ensemble.kept["swing"]), "degrees"),
        ("largest pin load", ensemble.kept["load"], "N"),
    ):
        low, middle, high = np.quantile(values, (0.05, 0.5, 0.95))
        print(f"{name:20} {middle:8.3f} {unit}, 90 % within {low:.3f} to {high:.3f}")


if __name__ == "__main__":
    main()
