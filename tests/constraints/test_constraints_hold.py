"""Position, velocity and acceleration constraints at rounding, at every output, for scenes of every kind."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tsdyn as ts
from tests.helpers import built_in
from tests.helpers.constraint_levels import BOUNDS, LEVELS, between_steps, chains, check, run, scales
from tests.helpers.fixed_steps import assembled
from tests.helpers.minimal_coordinates import balance
from tests.helpers.reference import NAMES, load
from tests.helpers.scenes import (
    BETWEEN,
    MOTION,
    PRIMITIVES,
    build,
    levels,
    random_body,
    random_chain,
    random_pair,
    random_primitive,
)
from tests.helpers.tolerances import EPS

C = ts.constraints
# the default tolerance, and the tightest that means anything
TOLERANCES = pytest.mark.parametrize("options", [{}, {"constraint_tol": EPS}], ids=["default", "tightest"])

# every built-in class, found by its registration; the gear needs wheels on joints: test_gears.py
KINDS = [kind for kind in built_in.PRIMITIVES + built_in.JOINTS if kind not in (C.EulerNormalization, C.Gear)]


def example(kind, rng, tries=20):
    """A scene of two bodies and the class's own example between them, assembled from random poses."""
    for _ in range(tries):
        scene = ts.Scene(gravity=(0.3, -0.2, -9.6))
        pair = [scene.add_body(**random_body(rng, place)) for place in ((0.0, 0.0, 0.0), (1.2, 0.4, -0.3))]
        scene.add(kind.example(rng, *pair))
        try:
            scene.assemble()
        except ts.InconsistentState:  # on the mirrored branch of a joint
            continue
        return scene
    raise AssertionError(f"{kind.__name__}.example can't be assembled from {tries} random poses")


@TOLERANCES
@pytest.mark.parametrize("name", PRIMITIVES)
@pytest.mark.parametrize("between", BETWEEN)
def test_every_primitive(name, between, options, rng):
    scene = assembled(random_pair(rng, name, between))
    check(run(scene, 1.0, t_eval=between_steps(rng, 1.0), **options))


@pytest.mark.parametrize("kind", KINDS, **built_in.by_name)
def test_every_kind_by_its_example(kind, rng):
    """Of two bodies that fly: the three levels hold, and the reactions are what Newton's and Euler's equations lack."""
    solution = run(example(kind, rng), 0.5, t_eval=between_steps(rng, 0.5), constraint_tol=EPS)
    check(solution)
    assert balance(solution) < 1e3 * EPS


@TOLERANCES
@pytest.mark.parametrize("links", [1, 3, 6])
def test_random_chain(links, options, rng):
    scene = build(random_chain(rng, links))
    check(run(scene, 2.0, t_eval=between_steps(rng, 2.0), **options))


@TOLERANCES
@pytest.mark.parametrize("name", NAMES)
def test_references(name, options):
    scene, _ = load(name)
    end = {"chain_4": 1.0, "chain_16": 0.1}.get(name, 5.0)  # s; chain_16 costs milliseconds a step
    check(run(scene, end, t_eval=np.linspace(0.0, end, 173), **options))


@TOLERANCES
def test_every_step_of_coarse_ones(options):
    """Steps of 4 ms at 12 rad/s: the charts' Newton iterations have far to go."""
    scene, _ = load("sliding_top")
    check(run(scene, 5.0, 4e-3, **options))


@pytest.mark.parametrize(("distance", "tolerance"), [(0.0, EPS), (10.0, EPS), (1e2, 1e-14), (1e4, 1e-12), (1e5, 1e-12)])
@pytest.mark.parametrize("links", [1, 2, 4])
def test_far_from_the_origin(links, distance, tolerance):
    """Rounding of the coordinates grows with the distance, and is no reason to refuse a step, let alone to give up."""
    scene = ts.Scene()
    last, end = scene.ground, (distance, 0.0, 0.0)
    for i in range(links):
        level = (np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0)
        body = scene.add_body(1.0, (0.1, 0.1, 0.02), position=(distance + 0.5 + i, 0.0, 0.0), orientation=level)
        scene.add(C.Spherical(last, body, point_a=end, point_b=(0.0, 0.0, 0.5)))
        last, end = body, (0.0, 0.0, -0.5)
    solution = run(scene, 5.0, 1e-3, constraint_tol=tolerance)
    check(solution, ("position",))
    assert solution.stats.rejected == 0


def everything(rng):
    """A tree in which every primitive, constant and driven, holds a body to another or to the ground."""
    bodies, constraints = [], []
    for i, name in enumerate(PRIMITIVES):
        parent = int(rng.integers(0, i + 1))
        bodies.append(random_body(rng, position=(1.3 * (i + 1), 0.0, 0.0)))
        pair = (parent, i + 1) if rng.integers(2) else (i + 1, parent)
        constraints.append(random_primitive(rng, name, *pair))
    return {"gravity": (0.0, 0.0, -9.81), "bodies": bodies, "constraints": constraints}


@TOLERANCES
def test_all_primitives_in_one_scene(options, rng):
    scene = assembled(everything(rng))
    check(run(scene, 0.5, t_eval=between_steps(rng, 0.5), **options))


def test_rigid_bodies_and_point_masses(rng):
    """A point mass on a rod from a body that hangs from another point mass on a rail."""
    scene = ts.Scene()
    slider = scene.add_point_mass(1.0, position=(0.3, 0.0, 0.0), velocity=(1.0, 0.0, 0.0))
    body = scene.add_body(**random_body(rng, position=(0.0, 0.0, -1.0)))
    bob = scene.add_point_mass(0.5, position=(0.5, 0.5, -2.0))
    scene.add(C.PlaneContact(slider, scene.ground, normal_b=(0.0, 1.0, 0.0)))
    scene.add(C.Dot2(scene.ground, slider, axis_a=(0.0, 0.0, 1.0), value=MOTION["value"]))
    scene.add(C.Spherical(slider, body, point_b=(0.1, 0.2, 0.4)))
    scene.add(C.Distance(body, bob, point_a=(0.0, -0.1, -0.3)))
    scene.assemble()
    check(run(scene, 2.0, t_eval=between_steps(rng, 2.0), constraint_tol=EPS))


@pytest.mark.slow_but("Dot2")
@pytest.mark.parametrize("name", PRIMITIVES)
def test_the_errors_reported_are_the_errors(name, rng):
    """constraint_error against formulas of the tests' own, off the constraints as well as on them."""
    definition = random_pair(rng, name, "body to body")
    scene = assembled(definition)
    for options in ({"constraint_tol": EPS}, {"formulation": "maggi-kane", "constraint_tol": 1e-4}):
        solution = run(scene, 0.5, 0.02, t_eval=between_steps(rng, 0.5), **options)
        own = [
            levels(definition, *state) for state in zip(solution.t, solution.q, solution.qd, solution.qdd, strict=True)
        ]
        for i, level in enumerate(LEVELS):
            expected = [np.abs(state[i]).max() for state in own]
            tolerance = BOUNDS[level] * scales(solution)[i].max()
            np.testing.assert_allclose(getattr(solution.constraint_error, level), expected, atol=tolerance)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("name", ["sliding_top", "two_body_pendulum"])
def test_errors_obey_the_tolerance(name, tolerance):
    """u_tol bounds |Phi|; B_tol bounds |Phi_q U B - I|, and with it the other two relative to the motion."""
    scene, _ = load(name)
    solution = run(scene, 5.0, constraint_tol=tolerance)
    floors = [BOUNDS[level] * scale for level, scale in zip(LEVELS, scales(solution), strict=True)]
    error = solution.constraint_error
    _, speed, acceleration = scales(solution)
    assert (error.position <= tolerance + floors[0]).all()
    assert (error.velocity <= tolerance * speed + floors[1]).all()
    assert (error.acceleration <= 10 * tolerance * acceleration + floors[2]).all()


@pytest.mark.parametrize("name", ["sliding_top", "two_body_pendulum", "two_body_pendulum_spatial"])
def test_maggi_kane_drifts_in_position_only(name):
    scene, _ = load(name)
    step = 4e-3 if name == "sliding_top" else 2e-3  # its drift is a hundredth of the others'
    solution = run(scene, 5.0, step, formulation="maggi-kane", constraint_tol=EPS)
    check(solution, ("velocity", "acceleration"))
    drift = solution.constraint_error.position
    assert drift[-1] > 1e4 * BOUNDS["position"]
    finer = run(scene, 5.0, step / 2, formulation="maggi-kane", constraint_tol=EPS).constraint_error.position
    assert drift.max() / finer.max() > 2**3.85


@pytest.mark.slow
@settings(max_examples=100)
@given(definition=chains(), seed=st.integers(0, 100))
def test_random_chains_of_mixed_joints(definition, seed):
    scene = assembled(definition)
    rng = np.random.default_rng(seed)
    check(run(scene, 0.2, t_eval=between_steps(rng, 0.2, 10), constraint_tol=EPS))
