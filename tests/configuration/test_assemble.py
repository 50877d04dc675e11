"""`scene.assemble()`: the nearest consistent positions, then velocities, in kinetic energy."""

import math

import numpy as np
import pytest

import tsdyn as ts
from examples import tolerance_analysis
from tests.helpers.mechanisms import (
    LENGTH,
    SEEDS,
    assert_same,
    body,
    map_of_speeds,
    masses,
    mechanism,
    nearest_speeds,
    residuals,
    rotation,
    snapshot,
    speeds,
)
from tests.helpers.tolerances import ALGEBRA, COARSE, EXACT, FINE, HELD, ROUNDING

C = ts.constraints


@pytest.mark.parametrize("seed", SEEDS)
def test_positions_and_velocities_fit_afterwards(seed):
    scene = mechanism(np.random.default_rng(seed))
    before = scene.start[0]
    assert min(residuals(scene)) > 0.1
    report = scene.assemble()
    position, velocity = residuals(scene)
    assert position <= ROUNDING
    assert velocity <= ALGEBRA
    assert report.residual <= ROUNDING
    assert report.velocity_residual <= ALGEBRA
    assert report.moved == pytest.approx(np.abs(scene.start[0] - before).max(), rel=HELD)
    assert report.iterations > 1
    ts.simulate(scene, (0.0, 0.01), integrator=ts.integrators.Nystrom4(1e-3)).raise_if_failed()


@pytest.mark.parametrize("seed", SEEDS)
def test_what_fits_stays(seed):
    """To rounding; and time and again."""
    scene = mechanism(np.random.default_rng(seed))
    scene.assemble()
    for _ in range(3):
        before, fast = scene.start[0], speeds(scene)
        report = scene.assemble()
        np.testing.assert_allclose(scene.start[0], before, atol=4e-16)
        np.testing.assert_allclose(speeds(scene), fast, rtol=0.0, atol=ROUNDING)
        assert report.moved <= 4e-16
        assert report.velocity_changed <= ROUNDING


def test_what_is_exact_stays_bit_by_bit():
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1, 1, 1), (1.0, 0.0, 0.0), velocity=(0, 0.5, 0), angular_velocity=(0.25, 0, 0.5))
    scene.add(C.Spherical(rod, scene.ground, point_a=(-1, 0, 0)))
    scene.add_point_mass(1.0, (0.1, 0.2, 0.3), (0.4, 0.5, 0.6))
    free = body(scene, np.random.default_rng(1))
    before = snapshot(scene)
    report = scene.assemble()
    assert_same(before[:2], snapshot(scene)[:2])
    assert (report.moved, report.residual) == (0.0, 0.0)
    np.testing.assert_allclose(free.orientation, before[2][2], atol=2e-16)
    np.testing.assert_allclose(free.angular_velocity, before[2][3], atol=EXACT)


@pytest.mark.parametrize("seed", SEEDS)
def test_velocity_correction_is_the_smallest_in_kinetic_energy(seed, rng):
    scene = mechanism(np.random.default_rng(seed))
    scene.assemble()
    for b in scene.bodies:
        b.velocity = rng.normal(size=3)
        if hasattr(b, "inertia"):
            b.angular_velocity = 3.0 * rng.normal(size=3)
    expected = nearest_speeds(scene, speeds(scene))
    scene.assemble()
    np.testing.assert_allclose(speeds(scene), expected, rtol=0.0, atol=FINE)


@pytest.mark.parametrize("seed", SEEDS)
def test_velocity_correction_starts_from_the_speeds_given_where_bodies_turn(seed):
    """Nearest to the velocities and (body-frame) angular velocities that the user set, at the pose found."""
    scene = mechanism(np.random.default_rng(seed))
    wanted = speeds(scene)
    scene.assemble()
    np.testing.assert_allclose(speeds(scene), nearest_speeds(scene, wanted), rtol=0.0, atol=FINE)


def test_spin_that_fits_is_kept_where_the_body_has_to_turn():
    scene = ts.Scene()
    top = scene.add_body(1.0, (1, 1, 0.5), angular_velocity=(0.0, 0.0, 3.0), name="top")
    scene.add(C.Dot1(top, scene.ground, axis_a=(0, 0, 1), axis_b=(0, 0, 1), value=0.5, name="lean"))
    tilt = 0.3
    top.orientation = (math.cos(tilt / 2), math.sin(tilt / 2), 0.0, 0.0)
    report = scene.assemble()
    assert rotation(top.orientation)[2, 2] == pytest.approx(0.5, abs=ROUNDING)
    np.testing.assert_allclose(top.angular_velocity, (0.0, 0.0, 3.0), atol=HELD)
    assert report.velocity_residual <= ROUNDING


@pytest.mark.parametrize("seed", SEEDS)
def test_small_position_correction_is_the_smallest_in_kinetic_energy(seed, rng):
    """Shifts and turns of 1e-6 from a consistent pose are taken back by the shortest way."""
    scene, size = mechanism(np.random.default_rng(seed)), 1e-6
    scene.assemble()
    for b in scene.bodies:
        b.position = b.position + size * rng.normal(size=3)
        if hasattr(b, "inertia"):
            p = b.orientation + size * rng.normal(size=4)
            b.orientation = p / np.linalg.norm(p)
    found, T, M, before = scene.evaluate(), map_of_speeds(scene), masses(scene), scene.start[0]
    A = found.Phi_q @ T
    keep = np.abs(A).max(axis=1) > 1e-12
    A, b = A[keep], -found.Phi[keep]
    W = np.linalg.solve(M, A.T)
    expected = T @ W @ np.linalg.solve(A @ W, b)
    scene.assemble()
    np.testing.assert_allclose(scene.start[0] - before, expected, rtol=0.0, atol=2 * COARSE * np.abs(expected).max())


@pytest.mark.slow_but("*-0", "*-1")
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("chosen", [(0,), (1,), (2,), (3,), (0, 3), (1, 2)], ids=str)
def test_fixed_bodies_stay_where_they_are(seed, chosen):
    scene = mechanism(np.random.default_rng(seed))
    scene.assemble()
    moved = next(i for i in range(4) if i not in chosen)
    scene.bodies[moved].position = scene.bodies[moved].position + np.array([0.01, -0.02, 0.01])
    fixed = [scene.bodies[i] for i in chosen]
    before = [snapshot(scene)[i] for i in chosen]
    report = scene.assemble(fixed=fixed)
    assert max(residuals(scene)) <= HELD
    assert report.moved > 1e-3
    for i, parts in zip(chosen, before, strict=True):
        for x, y in zip(parts[::2], snapshot(scene)[i][::2], strict=True):  # position, orientation
            np.testing.assert_array_equal(x, y)


def test_fixed_bodies_may_get_another_velocity():
    scene = ts.Scene()
    base = scene.add_point_mass(1.0, velocity=(1.0, 0.0, 0.0))
    load = scene.add_point_mass(3.0, position=(1.0, 0.2, 0.0))
    scene.add(C.Distance(base, load, length=1.0))
    scene.assemble(fixed=(base,))
    np.testing.assert_array_equal(base.position, (0.0, 0.0, 0.0))
    assert np.linalg.norm(load.position) == pytest.approx(1.0, abs=EXACT)
    along = load.position @ (base.velocity - load.velocity)
    assert along == pytest.approx(0.0, abs=EXACT)
    np.testing.assert_allclose(base.velocity + 3.0 * load.velocity, (1.0, 0.0, 0.0), atol=EXACT)  # momentum


def test_all_fixed():
    scene = mechanism(np.random.default_rng(0))
    before = snapshot(scene)
    with pytest.raises(ts.InconsistentState, match="pivot"):
        scene.assemble(fixed=scene.bodies)
    assert_same(before, snapshot(scene))
    scene.assemble()
    poses = [parts[::2] for parts in snapshot(scene)]
    scene.assemble(fixed=scene.bodies)
    assert_same(poses, [parts[::2] for parts in snapshot(scene)])


@pytest.mark.parametrize("fixed", ["base", 3, np.array(2.0)], ids=repr)
def test_what_is_fixed_is_a_sequence(fixed):
    with pytest.raises(ts.InvalidBody, match="must be a sequence of bodies"):
        motorised(0.0).assemble(fixed=fixed)


def motorised(angle):
    """An arm on a hinge, turned by 1 rad/s from zero at t = 0; drawn at an angle."""
    scene, half = ts.Scene(), 0.5 * angle
    arm = scene.add_body(1.0, (0.1, 0.1, 0.1), orientation=(np.cos(half), 0.0, 0.0, np.sin(half)))
    axes = {"axis_a": (0, 0, 1), "axis_b": (0, 0, 1)}
    scene.add(C.Revolute(scene.ground, arm, point_a=(0, 0, 0), point_b=(0, 0, 0), **axes))
    sides = {"reference_a": (1, 0, 0), "reference_b": (1, 0, 0)}
    scene.add(C.RotationMotor(scene.ground, arm, **axes, **sides, angle=ts.motions.Ramp(0.0, 1.0), name="motor"))
    return scene


def test_a_motor_is_judged_by_where_it_has_turned_to():
    """More than a quarter of a turn from where it began; and its mirrored branch, there."""
    assert motorised(2.9).assemble(t=3.0).residual <= ROUNDING
    with pytest.raises(ts.InconsistentState, match=r"motor.*opposite ways"):
        ts.simulate(motorised(3.0 - np.pi), (3.0, 3.1), initial_tol=2.0)
    scene = motorised(-0.1)
    scene.assemble(t=3.0)
    assert abs(ts.simulate(scene, (3.0, 3.1)).angle("motor")[0] - 3.0) < ROUNDING


@pytest.mark.parametrize("t", [0.0, 0.7, 2.0, -1.5])
def test_constraints_that_depend_on_time_are_met_at_t(t):
    scene = mechanism(np.random.default_rng(3))
    report = scene.assemble(t=t)
    assert max(residuals(scene, t)) <= ALGEBRA
    assert report.residual <= ROUNDING
    two, three = scene.bodies[1:3]
    ends = [b.position + rotation(b.orientation) @ s for b, s in ((two, (0.1, 0.3, 0)), (three, (0, 0, 0.1)))]
    rates = [
        b.velocity + rotation(b.orientation) @ np.cross(b.angular_velocity, s)
        for b, s in ((two, (0.1, 0.3, 0)), (three, (0, 0, 0.1)))
    ]
    d, dd = ends[0] - ends[1], rates[0] - rates[1]
    assert np.linalg.norm(d) == pytest.approx(LENGTH[0](t), abs=ALGEBRA)
    assert d @ dd / np.linalg.norm(d) == pytest.approx(LENGTH[1](t), abs=ALGEBRA)
    ts.simulate(scene, (t, t + 0.01), integrator=ts.integrators.Nystrom4(1e-3)).raise_if_failed()


@pytest.mark.parametrize("free", [("two",), ("one", "four"), ("one", "two", "three", "four")], ids=str)
def test_free_names_the_bodies_that_may_move(free):
    scene = mechanism(np.random.default_rng(1))
    scene.assemble()
    for body_, name in zip(scene.bodies, ("one", "two", "three", "four"), strict=True):
        body_.name = name
    scene.body("two").position = scene.body("two").position + np.array([0.01, -0.02, 0.01])
    twin = scene.copy()
    if "two" not in free:
        with pytest.raises(ts.InconsistentState, match="two"):
            scene.assemble(free=free)
        return
    scene.assemble(free=free)
    twin.assemble(fixed=[b for b in twin.bodies if b.name not in free])
    assert_same(snapshot(scene), snapshot(twin))


@pytest.mark.parametrize(("arguments", "message"), [
    ({"free": ["bse"]}, "did you mean 'base'"),
    ({"free": "base"}, "free must be a sequence of bodies"),
    ({"free": ["base"], "fixed": ["base"]}, "give the bodies that stay, or those that may move"),
], ids=str)  # fmt: skip
def test_what_is_free_is_checked(arguments, message):
    scene = ts.Scene()
    scene.add_point_mass(1.0, name="base")
    with pytest.raises(ts.TsdynError, match=message):
        scene.assemble(**arguments)


def nearby(scene, size=1e-3):
    """The scene with a joint of its mechanism moved a little."""
    return scene.with_parameters({"rocker pin.point_a": scene["rocker pin"].point_a + np.array([size, 0, 0])})


def test_a_start_near_by_takes_a_few_steps():
    scene = tolerance_analysis.build()
    assert nearby(scene).assemble().iterations <= 8


def test_other_geometry_is_assembled_without_handles_and_to_the_same_bits():
    scene = tolerance_analysis.build()
    case, built = nearby(scene), scene.copy()
    built["rocker pin"].point_a = case.parameters()["rocker pin.point_a"]
    case = nearby(scene)
    reports = [one.assemble(free=("coupler", "rocker")) for one in (case, built)]
    assert reports[0] == reports[1]
    assert "_later" in vars(case), "handles have been made"
    for one, other in zip(case.start, built.start, strict=True):
        assert one.tobytes() == other.tobytes()
    assert ts.simulate(case, (0.0, 0.02)).q.tobytes() == ts.simulate(built, (0.0, 0.02)).q.tobytes()
    assert_same(snapshot(case), snapshot(built))


def test_a_scene_that_is_moved_is_not_packed_anew():
    """Starts of its bodies are no part of what is analysed; runs have the bits of a scene that never ran."""
    scene = tolerance_analysis.build()
    before = ts.simulate(scene, (0.0, 0.02))
    packed = scene.packed
    scene.set("bearing", angle=1.0)
    assert scene.packed is not packed  # drivers come and go
    ts.simulate(scene, (0.0, 0.02))
    packed = scene.packed
    for _ in range(2):
        scene.body("coupler").position = scene.body("coupler").position + np.array([1e-3, 0, 0])
        scene.assemble(fixed=["crank"])
        assert scene.packed is packed
        solution, fresh = ts.simulate(scene, (0.0, 0.02)), ts.simulate(scene.copy(), (0.0, 0.02))
        assert solution.q.tobytes() == fresh.q.tobytes() != before.q.tobytes()
        assert solution.multipliers.tobytes() == fresh.multipliers.tobytes()
