"""Errors of the three levels of constraints as multiples of rounding, and random chains to find them in."""

import numpy as np
from hypothesis import strategies as st

import tsdyn as ts
from tests.helpers.scenes import random_body, random_primitive
from tests.helpers.tolerances import EPS

# times 1 + the largest |r|, |qd|, |qdd| of the output
BOUNDS = {"position": 50 * EPS, "velocity": 500 * EPS, "acceleration": 5000 * EPS}
LEVELS = tuple(BOUNDS)
STEP = 2e-3  # s


def run(scene, end, step=STEP, **options):
    integrator = ts.integrators.Nystrom4(step=step)
    return ts.simulate(scene, (0.0, end), integrator=integrator, **options).raise_if_failed()


def scales(solution):
    """1 + the largest |r|, |qd|, |qdd| of each output, (3, k)."""
    r = np.concatenate([solution.position(body) for body in solution.scene.bodies], axis=1)
    return [1.0 + np.abs(x).max(axis=1) for x in (r, solution.qd, solution.qdd)]


def ratios(solution):
    """The errors of the three levels as multiples of eps times the scale: the worst output of each."""
    return {
        level: float((getattr(solution.constraint_error, level) / scale).max() / EPS)
        for level, scale in zip(LEVELS, scales(solution), strict=True)
    }


def check(solution, which=LEVELS):
    worst = ratios(solution)
    assert all(worst[level] * EPS <= BOUNDS[level] for level in which), f"multiples of eps x scale: {worst}"


def between_steps(rng, end, count=40):
    """Output times: both ends, some ends of steps, and random ones."""
    on = STEP * rng.integers(1, int(end / STEP), size=5)
    return np.unique(np.concatenate(([0.0, end], on, rng.uniform(0.0, end, size=count))))


JOINTS = {
    "ball": ("Spherical",),
    "hinge": ("Spherical", "Dot1", "Dot1"),
    "universal": ("Spherical", "Dot1, at an angle"),
    "rod": ("Distance, length as it starts",),
    "driven rod": ("Distance, driven",),
    "plane": ("PlaneContact",),
    "plane and direction": ("PlaneContact", "Dot1"),
    "driven direction": ("Dot1, driven",),
    "slider": ("Dot2", "Dot2, at an offset"),
    "driven offset": ("Dot2, driven", "Dot1"),
}


def hinge_rows(rng, a, b):
    """A hinge: the axes of the two Dot1 rows are across one axis of a."""
    axis = rng.normal(size=3)
    across = np.linalg.svd(axis[None])[2][1:]
    rows = [random_primitive(rng, "Spherical", a, b)]
    other = rng.normal(size=3)
    return rows + [("Dot1", a, b, {"axis_a": x, "axis_b": other}) for x in across]


@st.composite
def chains(draw):
    """A definition: up to five bodies, each on a joint to the one before; points and poses at random."""
    joints = draw(st.lists(st.sampled_from(sorted(JOINTS)), min_size=1, max_size=5))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    bodies, constraints = [], []
    for i, joint in enumerate(joints):
        bodies.append(random_body(rng, position=((i + 1) * 1.2, 0.3 * i, -0.5 * i)))
        a, b = (i, i + 1) if draw(st.booleans()) else (i + 1, i)
        if joint == "hinge":
            constraints += hinge_rows(rng, a, b)
        else:
            constraints += [random_primitive(rng, name, a, b) for name in JOINTS[joint]]
    gravity = draw(st.sampled_from([(0.0, 0.0, -9.81), (0.0, 0.0, 0.0), (3.0, -2.0, 5.0)]))
    return {"gravity": gravity, "bodies": bodies, "constraints": constraints}
