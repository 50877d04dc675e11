"""`scene.assemble()`: the nearest consistent positions, then velocities; refused by name where there are none."""

import math

import numpy as np
import pytest

import tsdyn as ts

C = ts.constraints


def unit(rng, n):
    x = rng.normal(size=n)
    return x / np.linalg.norm(x)


def skew(e):
    """The matrix of e x."""
    return np.cross(np.eye(3), e)


def rotation(p):
    """A(p), body to ground, by the formula of Rodrigues: not the package's own."""
    e0, e = p[0], p[1:]
    return (e0 * e0 - e @ e) * np.eye(3) + 2.0 * np.outer(e, e) + 2.0 * e0 * skew(e)


def body(scene, rng, near=(0.0, 0.0, 0.0)):
    cloud = rng.normal(size=(8, 3)) * (0.3, 0.2, 0.1)
    second = cloud.T @ cloud / 8.0
    return scene.add_body(
        rng.uniform(0.5, 3.0),
        np.trace(second) * np.eye(3) - second,
        np.add(near, 0.2 * rng.normal(size=3)),
        unit(rng, 4),
        rng.normal(size=3),
        3.0 * rng.normal(size=3),
    )


def length(t):
    return 0.9 + 0.1 * np.sin(2.0 * t)


def length_d(t):
    return 0.2 * np.cos(2.0 * t)


def length_dd(t):
    return -0.4 * np.sin(2.0 * t)


LENGTH = (length, length_d, length_dd)


def mechanism(rng):
    """Three bodies and a bead, every primitive, one of them driven; nothing fits yet."""
    scene = ts.Scene()
    one, two, three = (body(scene, rng, near) for near in ((0.3, 0, 0), (1, 0, 0), (1.6, 0.4, 0)))
    bead = scene.add_point_mass(0.7, rng.normal(size=3), rng.normal(size=3), name="bead")
    scene.add(C.Spherical(one, scene.ground, point_a=(-0.3, 0.0, 0.1), name="pivot"))
    scene.add(C.Spherical(one, two, point_a=(0.3, 0, 0), point_b=(-0.2, 0.1, 0), name="knee"))
    scene.add(C.Distance(two, three, point_a=(0.1, 0.3, 0), point_b=(0, 0, 0.1), length=LENGTH, name="piston"))
    scene.add(C.Dot1(three, scene.ground, axis_a=(1, 0, 0), axis_b=(0, 0, 1), value=0.3, name="tilt"))
    scene.add(C.Dot2(two, bead, axis_a=(0, 1, 1), point_a=(0.1, 0, 0), value=0.2, name="offset"))
    scene.add(C.PlaneContact(bead, three, point_b=(0, 0.2, 0), normal_b=(1, 2, 3), name="table"))
    return scene


def residuals(scene, t=0.0):
    """Largest |Phi| and |Phi_q qd + Phi_t| at the bodies' values."""
    found = scene.evaluate(t=t)
    return np.abs(found.Phi).max(), np.abs(found.Phi_q @ scene.start[1] + found.Phi_t).max()


def speeds(scene):
    """Velocities and angular velocities, body by body."""
    parts = [(b.velocity, b.angular_velocity) if hasattr(b, "inertia") else (b.velocity,) for b in scene.bodies]
    return np.concatenate([x for part in parts for x in part])


def map_of_speeds(scene):
    """T with qd = T speeds: pd = (-e.w', e0 w' + e x w') / 2."""
    T, row, column = np.zeros((scene.start[0].size, speeds(scene).size)), 0, 0
    for b in scene.bodies:
        T[row : row + 3, column : column + 3] = np.eye(3)
        row, column = row + 3, column + 3
        if hasattr(b, "inertia"):
            e0, e = b.orientation[0], b.orientation[1:]
            T[row, column : column + 3] = -e / 2.0
            T[row + 1 : row + 4, column : column + 3] = (e0 * np.eye(3) + skew(e)) / 2.0
            row, column = row + 4, column + 3
    return T


def masses(scene):
    """The mass matrix of the speeds."""
    blocks = [x for b in scene.bodies for x in ([b.mass * np.eye(3)] + ([b.inertia] if hasattr(b, "inertia") else []))]
    M = np.zeros((speeds(scene).size,) * 2)
    for i, block in enumerate(blocks):
        M[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = block
    return M


def nearest_speeds(scene, wanted, t=0.0):
    """The consistent speeds nearest to those wanted in the kinetic-energy metric: least squares by its KKT system."""
    found = scene.evaluate(t=t)
    A, M = found.Phi_q @ map_of_speeds(scene), masses(scene)
    keep = np.abs(A).max(axis=1) > 1e-12  # the normalisations are met by any speeds
    A, b = A[keep], -found.Phi_t[keep]
    m = A.shape[0]
    kkt = np.block([[M, A.T], [A, np.zeros((m, m))]])
    return np.linalg.solve(kkt, np.concatenate((M @ wanted, b)))[: wanted.size]


def snapshot(scene):
    return [
        (b.position, b.velocity, *((b.orientation, b.angular_velocity) if hasattr(b, "inertia") else ()))
        for b in scene.bodies
    ]


def assert_same(before, after):
    for parts, now in zip(before, after, strict=True):
        for x, y in zip(parts, now, strict=True):
            np.testing.assert_array_equal(x, y)


SEEDS = range(6)


@pytest.mark.parametrize("seed", SEEDS)
def test_positions_and_velocities_fit_afterwards(seed):
    scene = mechanism(np.random.default_rng(seed))
    before = scene.start[0]
    assert min(residuals(scene)) > 0.1
    report = scene.assemble()
    position, velocity = residuals(scene)
    assert position <= 1e-14
    assert velocity <= 1e-13
    assert report.residual <= 1e-14
    assert report.velocity_residual <= 1e-13
    assert report.moved == pytest.approx(np.abs(scene.start[0] - before).max(), rel=1e-12)
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
        np.testing.assert_allclose(speeds(scene), fast, rtol=0.0, atol=1e-14)
        assert report.moved <= 4e-16
        assert report.velocity_changed <= 1e-14


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
    np.testing.assert_allclose(free.angular_velocity, before[2][3], atol=1e-15)


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
    np.testing.assert_allclose(speeds(scene), expected, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("seed", SEEDS)
def test_velocity_correction_starts_from_the_speeds_given_where_bodies_turn(seed):
    """Nearest to the velocities and (body-frame) angular velocities that the user set, at the pose found."""
    scene = mechanism(np.random.default_rng(seed))
    wanted = speeds(scene)
    scene.assemble()
    np.testing.assert_allclose(speeds(scene), nearest_speeds(scene, wanted), rtol=0.0, atol=1e-10)


def test_spin_that_fits_is_kept_where_the_body_has_to_turn():
    scene = ts.Scene()
    top = scene.add_body(1.0, (1, 1, 0.5), angular_velocity=(0.0, 0.0, 3.0), name="top")
    scene.add(C.Dot1(top, scene.ground, axis_a=(0, 0, 1), axis_b=(0, 0, 1), value=0.5, name="lean"))
    tilt = 0.3
    top.orientation = (math.cos(tilt / 2), math.sin(tilt / 2), 0.0, 0.0)
    report = scene.assemble()
    assert rotation(top.orientation)[2, 2] == pytest.approx(0.5, abs=1e-14)
    np.testing.assert_allclose(top.angular_velocity, (0.0, 0.0, 3.0), atol=1e-12)
    assert report.velocity_residual <= 1e-14


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
    np.testing.assert_allclose(scene.start[0] - before, expected, rtol=0.0, atol=2e-5 * np.abs(expected).max())


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
    assert max(residuals(scene)) <= 1e-12
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
    assert np.linalg.norm(load.position) == pytest.approx(1.0, abs=1e-15)
    along = load.position @ (base.velocity - load.velocity)
    assert along == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(base.velocity + 3.0 * load.velocity, (1.0, 0.0, 0.0), atol=1e-15)  # momentum


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
    assert motorised(2.9).assemble(t=3.0).residual <= 1e-14
    with pytest.raises(ts.InconsistentState, match=r"motor.*opposite ways"):
        motorised(-0.1).assemble(t=3.0)


@pytest.mark.parametrize("t", [0.0, 0.7, 2.0, -1.5])
def test_constraints_that_depend_on_time_are_met_at_t(t):
    scene = mechanism(np.random.default_rng(3))
    report = scene.assemble(t=t)
    assert max(residuals(scene, t)) <= 1e-13
    assert report.residual <= 1e-14
    two, three = scene.bodies[1:3]
    ends = [b.position + rotation(b.orientation) @ s for b, s in ((two, (0.1, 0.3, 0)), (three, (0, 0, 0.1)))]
    rates = [
        b.velocity + rotation(b.orientation) @ np.cross(b.angular_velocity, s)
        for b, s in ((two, (0.1, 0.3, 0)), (three, (0, 0, 0.1)))
    ]
    d, dd = ends[0] - ends[1], rates[0] - rates[1]
    assert np.linalg.norm(d) == pytest.approx(length(t), abs=1e-13)
    assert d @ dd / np.linalg.norm(d) == pytest.approx(length_d(t), abs=1e-13)
    ts.simulate(scene, (t, t + 0.01), integrator=ts.integrators.Nystrom4(1e-3)).raise_if_failed()


@pytest.mark.parametrize("angle", [0.5, 1.5, 2.5, 3.1])
def test_from_far_away(angle):
    """A rod hinged at both ends' height, turned away by up to half a turn."""
    scene = ts.Scene()
    rod = scene.add_body(
        1.0, (0.1, 1.0, 1.0), orientation=(math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0), name="rod"
    )
    scene.add(C.Spherical(rod, scene.ground, point_a=(-1, 0, 0), name="pivot"))
    scene.add(C.Distance(rod, scene.ground, point_a=(1, 0, 0), point_b=(2, 0, 0.5), length=0.5, name="string"))
    report = scene.assemble()
    assert max(residuals(scene)) <= 1e-14
    assert report.moved <= 3.0
    assert np.linalg.norm(rod.orientation) == pytest.approx(1.0, abs=1e-15)


def too_far():
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, (1.0, 0.0, 0.3), (1.0, 2.0, 3.0), name="bead")
    scene.add(C.Distance(bead, scene.ground, length=1.0, name="near"))
    scene.add(C.Distance(bead, scene.ground, point_b=(5, 0, 0), length=1.0, name="far"))
    return scene, ("near", "far")


def folded():
    """Nothing says which way to go."""
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, name="bead")
    scene.add(C.Distance(bead, scene.ground, length=1.0, name="string"))
    return scene, ("string",)


def steep():
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1, 1, 1), unit(np.random.default_rng(2), 3), angular_velocity=(1, 2, 3), name="rod")
    scene.add(C.Dot1(rod, scene.ground, axis_a=(0, 0, 1), axis_b=(0, 0, 1), value=0.9, name="lean"))
    scene.add(C.Dot1(rod, scene.ground, axis_a=(0, 0, 1), axis_b=(1, 0, 0), value=0.9, name="lean too"))
    return scene, ("lean",)


REFUSED = {
    "too far": (too_far, ts.InconsistentState),
    "no direction": (folded, ts.InconsistentState),
    "two cosines": (steep, ts.InconsistentState),
}


@pytest.mark.parametrize(("build", "error"), REFUSED.values(), ids=REFUSED.keys())
def test_what_cannot_be_met_is_named_and_nothing_changes(build, error):
    scene, names = build()
    before = snapshot(scene)
    with pytest.raises(error) as caught:
        scene.assemble()
    assert all(name in str(caught.value) for name in names), str(caught.value)
    assert_same(before, snapshot(scene))


def test_rows_that_say_the_same_are_no_hindrance():
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, (1.0, 0.0, 0.3), (1.0, 2.0, 3.0), name="bead")
    for name in ("one", "two"):
        scene.add(C.Distance(bead, scene.ground, length=1.0, name=name))
    report = scene.assemble()
    assert max(report.residual, report.velocity_residual) <= 1e-15
    outward = np.array([1.0, 0.0, 0.3]) / math.hypot(1.0, 0.3)
    np.testing.assert_allclose(bead.position, outward, atol=1e-8)
    assert bead.velocity @ bead.position == pytest.approx(0.0, abs=1e-15)
    assert bead.velocity[1] == 2.0


def test_a_row_that_vanishes_where_it_is_met_is_refused():
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, name="bead")
    motion = (lambda t: 1.0 - t, lambda t: -1.0 + 0.0 * t, lambda t: 0.0 * t)
    scene.add(C.Distance(bead, scene.ground, length=motion, name="winch"))
    with pytest.raises(ts.SingularConfiguration, match=r"winch.*singular here"):
        scene.assemble(t=1.0)


@pytest.mark.parametrize("part", [0, 1], ids=["f", "fd"])
@pytest.mark.parametrize("value", [math.nan, math.inf], ids=str)
def test_motion_that_is_no_number_at_t_is_named_and_nothing_changes(part, value):
    motion = [lambda t: 1.0, lambda t: 0.0, lambda t: 0.0]
    good = motion[part](0.0)
    motion[part] = lambda t: good if t < 1.0 else value
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, (1.0, 0.0, 0.5), (1.0, 2.0, 3.0), name="bead")
    scene.add(C.Distance(bead, scene.ground, length=tuple(motion), name="string"))
    before = snapshot(scene)
    with pytest.raises(ts.TsdynError, match=r"(?s)string.*finite"):
        scene.assemble(t=2.0)
    assert_same(before, snapshot(scene))


def test_nothing_to_do():
    scene = ts.Scene()
    scene.add_point_mass(1.0, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    before = snapshot(scene)
    report = scene.assemble()
    assert (report.moved, report.residual, report.velocity_changed, report.velocity_residual) == (0.0,) * 4
    assert_same(before, snapshot(scene))


def test_simulate_does_not_assemble():
    """What is inconsistent is refused, and the message leads here."""
    scene = mechanism(np.random.default_rng(0))
    before = snapshot(scene)
    with pytest.raises(ts.InconsistentState, match="assemble"):
        ts.simulate(scene, (0.0, 1.0))
    assert_same(before, snapshot(scene))
