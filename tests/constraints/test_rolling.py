"""Rolling against closed forms and Newton's and Euler's equations about the contact point."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.rolling_bodies import GRAVITY, leaning, placed, reference

C = ts.constraints
UP = (0.0, 0.0, 1.0)
TIMES = np.linspace(0.0, 3.0, 31)
COIN = {"mass": 1.3, "inertia": (0.08, 0.15, 0.08), "semi_axes": (0.5, 0.0, 0.5)}
EGG = {"mass": 0.7, "inertia": np.diag((0.02, 0.05, 0.06)) + 0.003, "semi_axes": (0.4, 0.25, 0.3)}
BALL = {"mass": 2.0, "inertia": (0.03, 0.05, 0.04), "semi_axes": (0.3, 0.3, 0.3)}


def disc(a, b, **more):
    return C.RollingDisc(a, b, axis_a=(0, 1, 0), radius=0.5, normal_b=UP, **more)


SURFACES = {
    "disc": (disc, COIN, leaning(0.5)),
    "torus": (lambda a, b: disc(a, b, tyre_radius=0.1), COIN | {"tyre": 0.1}, leaning(-0.4, 1.0)),
    "ball": (
        lambda a, b: C.RollingBall(a, b, center_a=(0.02, -0.03, 0.05), radius=0.3, normal_b=UP),
        BALL | {"centre": (0.02, -0.03, 0.05)},
        leaning(0.3),
    ),
    "ellipsoid": (
        lambda a, b: C.RollingEllipsoid(a, b, semi_axes=(0.4, 0.25, 0.3), normal_b=UP),
        EGG,
        Rotation.from_euler("xyz", [0.4, -0.3, 0.2]),
    ),
}
by_name = pytest.mark.parametrize("name", SURFACES)


def rolling(name, omega=(0.4, 2.5, 0.7)):
    scene = ts.Scene()
    make, given, orientation = SURFACES[name]
    body = placed(scene, omega=np.array(omega), orientation=orientation, **given)
    return scene, body, scene.add(make(body, scene.ground))


@by_name
def test_general_motion(name):
    """omega, the direction of the normal and the path of the contact point."""
    _, given, orientation = SURFACES[name]
    scene, body, contact = rolling(name)
    solution = ts.simulate(scene, (0.0, 3.0), t_eval=TIMES, rtol=1e-12, atol=1e-12)
    omega, gamma, path = reference(omega=np.array((0.4, 2.5, 0.7)), orientation=orientation, times=TIMES, **given)
    np.testing.assert_allclose(solution.angular_velocity(body), omega, atol=1e-9)
    np.testing.assert_allclose(solution.rotation(body)[:, 2], gamma, atol=1e-10)
    np.testing.assert_allclose(solution.contact_point(contact)[:, :2], path, atol=1e-9)
    assert np.abs(solution.contact_point(contact)[:, 2]).max() < 1e-14
    assert np.ptp(solution.energy) < 1e-11
    assert solution.constraint_error.velocity.max() < 1e-13


@by_name
def test_reaction_is_a_force_at_the_contact_point(name):
    """Newton's law gives the force; its torque about the contact point is zero."""
    scene, body, contact = rolling(name)
    solution = ts.simulate(scene, (0.0, 2.0))
    force, torque = solution.reaction(contact)
    lacking = body.mass * (solution.acceleration(body) + GRAVITY * np.array(UP))
    np.testing.assert_allclose(force, lacking, atol=1e-11)
    np.testing.assert_allclose(torque, 0.0, atol=1e-12)
    demand = np.hypot(force[:, 0], force[:, 1]) / force[:, 2]
    np.testing.assert_allclose(solution.friction_demand(contact), np.where(force[:, 2] > 0, demand, np.inf), rtol=1e-12)
    state = solution.state
    np.testing.assert_array_equal(state.contact_point(contact), solution.contact_point(contact)[-1])
    assert state.friction_demand(contact) == pytest.approx(solution.friction_demand(contact)[-1], rel=1e-12)


def steady_turn(lean, turn, A=0.08, J=0.15, mass=1.3, radius=0.5):
    """Body-frame omega of a disc that leans by so much and turns about the vertical at a rate: a closed form.

    (J + m a^2) w3 W cos(lean) = A W^2 sin(lean) cos(lean) - m g a sin(lean), w3 about the axis
    """
    sine, cosine = np.sin(lean), np.cos(lean)
    w3 = (A * turn**2 * sine * cosine - mass * GRAVITY * radius * sine) / ((J + mass * radius**2) * turn * cosine)
    return np.array((0.0, w3, turn * cosine))


@pytest.mark.parametrize(("lean", "turn"), [(0.3, 1.5), (-0.6, 2.0), (0.9, -3.0)])
def test_steady_turns_of_a_disc(lean, turn):
    """The contact point runs on a circle, and the lean stays."""
    scene = ts.Scene()
    body = placed(scene, omega=steady_turn(lean, turn), orientation=leaning(lean), **COIN)
    contact = scene.add(disc(body, scene.ground))
    solution = ts.simulate(scene, (0.0, 2.0 * np.pi / abs(turn)), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(solution.position(body)[:, 2], 0.5 * np.cos(lean), atol=1e-10)
    np.testing.assert_allclose(solution.contact_point(contact)[-1], 0.0, atol=1e-9)


@pytest.mark.parametrize("share", [2 / 5, 2 / 3], ids=["solid", "shell"])
def test_ball_on_a_turntable(share):
    """It runs on a circle, at k / (1 + k) of the turntable's rate: 2/7 for a solid ball, k = 2/5."""
    rate, radius = 3.0, 0.1
    scene = ts.Scene()
    table = scene.add_body(5.0, (1.0, 1.0, 2.0), name="table")
    hinge = scene.add(C.Revolute.at(scene.ground, table, point=(0, 0, 0), axis=UP))
    scene.add(C.RotationMotor.of(hinge, angle=rate * ts.motions.time))
    table.angular_velocity = (0, 0, rate)
    start, velocity = np.array((0.3, -0.2, radius)), np.array((0.4, 0.5, 0.0))
    slip = np.cross((0, 0, rate), start) - velocity  # of the contact point, relative to the centre
    omega = np.cross(slip, UP) / radius
    ball = scene.add_body(
        2.0, (share * 2.0 * radius**2,) * 3, position=start, velocity=velocity, angular_velocity=omega
    )
    contact = scene.add(C.RollingBall(ball, table, radius=radius, normal_b=UP))
    solution = ts.simulate(scene, (0.0, 4.0), t_eval=np.linspace(0, 4, 9), rtol=1e-12, atol=1e-12)
    turn = share / (1.0 + share) * rate * solution.t
    expected = np.stack((0.4 * np.cos(turn) - 0.5 * np.sin(turn), 0.4 * np.sin(turn) + 0.5 * np.cos(turn)), axis=1)
    np.testing.assert_allclose(solution.velocity(ball)[:, :2], expected, atol=1e-10)
    np.testing.assert_allclose(solution.contact_point(contact)[:, :2], solution.position(ball)[:, :2], atol=1e-13)


def test_ball_on_a_ramp_that_slides():
    """A wedge of mass M, free on level ground, yields to the ball that rolls down it: accelerations in closed form."""
    m, M, radius, slope = 1.5, 2.5, 0.2, 0.6
    down, normal = np.array((np.cos(slope), 0, -np.sin(slope))), np.array((np.sin(slope), 0, np.cos(slope)))
    scene = ts.Scene()
    wedge = scene.add_body(M, (1, 1, 1))
    scene.add(C.Translational.at(scene.ground, wedge, point=(0, 0, 0), axis=(1, 0, 0)))
    ball = scene.add_body(m, (0.4 * m * radius**2,) * 3, position=radius * normal)
    contact = scene.add(
        C.RollingBall.at(ball, wedge, center=radius * normal, radius=radius, point=(0, 0, 0), normal=normal)
    )
    solution = ts.simulate(scene, (0.0, 1.0))
    # along the slope, relative to the wedge: 7/5 s'' = g sin - X'' cos;  (m + M) X'' + m s'' cos = 0
    s, X = np.linalg.solve([[1.4, np.cos(slope)], [m * np.cos(slope), m + M]], [GRAVITY * np.sin(slope), 0.0])
    np.testing.assert_allclose(solution.position(ball)[-1], radius * normal + 0.5 * (s * down + (X, 0, 0)), atol=1e-12)
    np.testing.assert_allclose(solution.position(wedge)[-1, 0], 0.5 * X, atol=1e-12)
    path = solution.contact_point(contact) - solution.position(wedge)
    np.testing.assert_allclose(path[-1], 0.5 * s * down, atol=1e-12)


PAIRS = {
    "disc": lambda a, b: C.RollingDisc(a, b, axis_a=(0, 1, 0), radius=0.5, tyre_radius=0.05, normal_b=UP),
    "ball": lambda a, b: C.RollingBall(a, b, center_a=(0.1, 0, 0), radius=0.5, normal_b=UP),
    "ellipsoid": lambda a, b: C.RollingEllipsoid(a, b, semi_axes=(0.6, 0.4, 0.5), normal_b=UP),
    "on a cylinder": lambda a, b: C.RollingBallOnCylinder(a, b, axis_b=(1, 0, 0), radius=0.2, cylinder_radius=0.5),
    "in a cylinder": lambda a, b: C.RollingBallOnCylinder(
        a, b, axis_b=(1, 0, 0), radius=0.2, cylinder_radius=0.5, inside=True
    ),
}


@pytest.mark.parametrize("slip", [False, True], ids=["rolling", "sliding"])
@pytest.mark.parametrize("make", PAIRS.values(), ids=PAIRS)
def test_two_bodies_in_space_keep_energy_and_momenta(make, slip, rng):
    """Contact forces are opposite, act at one point, and their power is zero: all of b's columns are right."""
    scene = ts.Scene(gravity=(0, 0, 0))
    a = scene.add_body(1.0, (0.1, 0.15, 0.1), position=(0, 0.1, 0.5), velocity=rng.normal(size=3))
    b = scene.add_body(1.5, (0.2, 0.3, 0.4), velocity=rng.normal(size=3), angular_velocity=rng.normal(size=3))
    a.angular_velocity = rng.normal(size=3)
    contact = make(a, b)
    contact.slip = slip
    scene.add(contact)
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 2.0), rtol=1e-11, atol=1e-11)
    assert np.ptp(solution.energy) < 1e-9
    assert np.ptp(solution.linear_momentum, axis=0).max() < 1e-10
    assert np.ptp(solution.angular_momentum, axis=0).max() < 1e-9
    assert solution.constraint_error.position.max() < 1e-14
    assert solution.constraint_error.velocity.max() < 1e-13
    (force, torque), (other, moment) = solution.reaction(contact), solution.reaction(contact, on=b)
    np.testing.assert_allclose(other, -force, atol=1e-11)
    np.testing.assert_allclose([torque, moment], 0.0, atol=1e-11)
    if slip:
        demand = solution.friction_demand(contact)
        assert (np.isinf(demand) | (demand < 1e-9)).all()


def test_ball_in_a_vertical_pipe():
    """It falls and rises with sqrt(k / (1 + k)) of its rate about the axis: sqrt(2 / 7) for a solid ball."""
    turn, gap = 7.0, 1.0
    scene = ts.Scene()
    ball = scene.add_body(1.0, (0.1, 0.1, 0.1), position=(gap, 0, 0), velocity=(0, turn * gap, 0))
    ball.angular_velocity = (0, 0, -turn * gap / 0.5)
    pipe = C.RollingBallOnCylinder(ball, scene.ground, axis_b=UP, radius=0.5, cylinder_radius=1.5, inside=True)
    contact = scene.add(pipe)
    solution = ts.simulate(scene, (0.0, 3.0), rtol=1e-12, atol=1e-12)
    rate = turn * np.sqrt(2 / 7)
    fall = GRAVITY / 1.4 / rate**2 * (1.0 - np.cos(rate * solution.t))
    np.testing.assert_allclose(solution.position(ball)[:, 2], -fall, atol=1e-10)
    np.testing.assert_allclose(solution.position(ball)[:, 0], gap * np.cos(turn * solution.t), atol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(solution.contact_point(contact)[:, :2], axis=1), 1.5, rtol=1e-13)
    push = turn**2 * gap
    force, _ = solution.reaction(contact)
    np.testing.assert_allclose(np.linalg.norm(force[:, :2], axis=1), push, rtol=1e-9)
    np.testing.assert_allclose(solution.friction_demand(contact), np.abs(force[:, 2]) / push, atol=1e-9)


@pytest.mark.parametrize("inside", [False, True], ids=["on", "in"])
def test_ball_across_a_level_cylinder(inside):
    """Energy gives the rate at each angle: 7/10 (S angle')^2 = +-g S (cos - cos 0), to and fro inside."""
    radius, cylinder = 0.25, 1.0
    S = cylinder - radius if inside else cylinder + radius
    start = 0.5 + (np.pi if inside else 0.0)
    scene = ts.Scene()
    ball = scene.add_body(2.0, (0.4 * 2.0 * radius**2,) * 3, position=(0, S * np.sin(start), S * np.cos(start)))
    places = {"axis_b": (1, 0, 0), "radius": radius, "cylinder_radius": cylinder, "inside": inside}
    contact = scene.add(C.RollingBallOnCylinder(ball, scene.ground, **places))
    solution = ts.simulate(scene, (0.0, 0.5), rtol=1e-12, atol=1e-12)
    speed = np.linalg.norm(solution.velocity(ball), axis=1)
    drop = solution.position(ball)[0, 2] - solution.position(ball)[:, 2]
    np.testing.assert_allclose(0.7 * speed**2, GRAVITY * drop, atol=1e-11)
    np.testing.assert_allclose(solution.contact_point(contact) * S, solution.position(ball) * cylinder, atol=1e-13)
    # it leaves the outside where cos = 10/17 cos 0
    cosine = solution.position(ball)[:, 2] / S
    held = cosine > 10 / 17 * np.cos(start) if not inside else np.ones(len(cosine), bool)
    assert (np.isfinite(solution.friction_demand(contact)) == held).all()


@pytest.mark.slow
def test_rattleback_reverses_its_spin():
    """Spun against its sense it wobbles, stops and turns back; with it, it goes on. Kane's and Levinson's stone."""
    inertia = np.array(((2e-4, -2e-5, 0), (-2e-5, 1.6e-3, 0), (0, 0, 1.7e-3)))
    given = {"mass": 1.0, "inertia": inertia, "semi_axes": (0.2, 0.03, 0.02), "centre": (0, 0, 0.01)}
    places = {"center_a": given["centre"], "semi_axes": given["semi_axes"], "normal_b": UP}
    times, orientation = np.linspace(0.0, 5.0, 101), Rotation.from_euler("x", np.radians(0.5))
    spins = {}
    for spin in (5.0, -5.0):
        scene = ts.Scene()
        body = placed(scene, omega=np.array((0, 0, spin)), orientation=orientation, **given)
        scene.add(C.RollingEllipsoid(body, scene.ground, **places))
        solution = ts.simulate(scene, (0.0, 5.0), t_eval=times, rtol=1e-13, atol=1e-13)
        expected, gamma, _ = reference(omega=np.array((0, 0, spin)), orientation=orientation, times=times, **given)
        np.testing.assert_allclose(solution.angular_velocity(body), expected, atol=1e-7)
        assert np.ptp(solution.energy) < 1e-13
        spins[spin] = np.einsum("ki,ki->k", gamma, solution.angular_velocity(body))
    assert spins[5.0][-1] > 4.98
    assert spins[-5.0][-1] > 1.0


RADII = {"zero": 0.0, "negative": -1.0, "missing": None, "text": "1", "nan": np.nan}


@pytest.mark.parametrize("radius", RADII.values(), ids=RADII)
def test_radii_are_checked(radius):
    scene = ts.Scene()
    body = scene.add_body(1.0, (1, 1, 1), name="wheel")
    makers = (
        lambda: C.RollingDisc(body, scene.ground, axis_a=(0, 1, 0), radius=radius, normal_b=UP),
        lambda: C.RollingBall(body, scene.ground, radius=radius, normal_b=UP),
        lambda: C.RollingBallOnCylinder(body, scene.ground, axis_b=UP, radius=radius, cylinder_radius=2.0),
        lambda: C.RollingBallOnCylinder(body, scene.ground, axis_b=UP, radius=0.5, cylinder_radius=radius),
    )
    for make in makers:
        with pytest.raises(ts.InvalidConstraint, match=r"wheel, ground\): (cylinder_)?radius \(m\) must be a positive"):
            make()
    with pytest.raises(ts.InvalidConstraint, match="three positive lengths"):
        C.RollingEllipsoid(body, scene.ground, semi_axes=(1.0, 1.0, radius), normal_b=UP)


def test_other_arguments_are_checked():
    scene = ts.Scene()
    body = scene.add_body(1.0, (1, 1, 1), name="wheel")
    on = body, scene.ground
    for wrong, makes in {
        "has length zero": lambda: C.RollingBall(*on, radius=1.0, normal_b=(0, 0, 0)),
        "axis_a has length zero": lambda: C.RollingDisc(*on, axis_a=(0, 0, 0), radius=1.0, normal_b=UP),
        "slip must be": lambda: C.RollingBall(*on, radius=1.0, normal_b=UP, slip="no"),
        "tyre_radius": lambda: C.RollingDisc(*on, axis_a=UP, radius=1.0, normal_b=UP, tyre_radius=-0.1),
        "right angles": lambda: C.RollingEllipsoid(*on, semi_axes=(1, 2, 3), axes_a=np.ones((3, 3)), normal_b=UP),
        "doesn't fit": lambda: C.RollingBallOnCylinder(*on, axis_b=UP, radius=1.0, cylinder_radius=0.5, inside=True),
        "inside must be": lambda: C.RollingBallOnCylinder(*on, axis_b=UP, radius=1.0, cylinder_radius=0.5, inside=1),
    }.items():
        with pytest.raises(ts.InvalidConstraint, match=wrong):
            makes()


def test_directions_of_semi_axes():
    """Rows of an array, a Rotation, and the ground frame of `at` say the same."""
    scene = ts.Scene()
    turn = Rotation.from_euler("xyz", (0.3, 0.5, -0.2))
    body = scene.add_body(1.0, (1, 1, 1), orientation=Rotation.from_euler("zx", (0.4, 0.7)))
    shape = {"semi_axes": (0.5, 0.3, 0.2), "normal_b": UP}
    axes = turn.apply(np.eye(3))
    by_rotation = C.RollingEllipsoid(body, scene.ground, axes_a=turn, **shape)
    np.testing.assert_allclose(by_rotation.axes_a, axes, atol=1e-15)
    in_ground = C.RollingEllipsoid.at(
        body, scene.ground, axes_a=Rotation.from_euler("zx", (0.4, 0.7)).apply(axes), **shape
    )
    np.testing.assert_allclose(in_ground.axes_a, axes, atol=1e-15)


def test_a_disc_that_starts_slipping_or_off_the_plane_is_named():
    scene = ts.Scene()
    body = scene.add_body(1.0, (0.08, 0.15, 0.08), position=(0, 0, 0.6), velocity=(1, 0, 0), name="coin")
    contact = scene.add(disc(body, scene.ground, name="rolls"))
    with pytest.raises(ts.InconsistentState, match=r"'rolls' contact: .* = 0\.1\n.*assemble"):
        ts.simulate(scene, (0, 1))
    body.position = (0, 0, 0.5)
    with pytest.raises(ts.InconsistentState, match=r"'rolls' slip\[\d\]: .* = -?1\n(.*\n)*.*assemble"):
        ts.simulate(scene, (0, 1))
    scene.assemble()
    assert ts.simulate(scene, (0, 1)).success
    assert abs(body.velocity[0] - 0.5 * body.angular_velocity[1]) < 1e-14
    contact.slip = True
    body.velocity = (1, 0, 0)
    assert ts.simulate(scene, (0, 1)).success


@pytest.mark.slow
@pytest.mark.parametrize("slip", [False, True], ids=["rolling", "sliding"])
def test_a_disc_that_lies_flat_is_named(slip):
    scene = ts.Scene()
    body = scene.add_body(1.0, (0.08, 0.15, 0.08), name="coin")
    scene.add(disc(body, scene.ground, slip=slip, name="rolls"))
    body.orientation = leaning(np.pi / 2 - 1e-12)
    with pytest.raises(ts.SingularConfiguration, match="'rolls' contact: the disc lies flat on its plane"):
        ts.simulate(scene, (0, 1))
    body.position, body.orientation = (0, 0, 0.5 * np.cos(0.3)), leaning(0.3)
    for method in (None, "dop853"):
        solution = ts.simulate(scene, (0, 2), integrator=method)
        assert not solution.success
        assert "'rolls' contact: the disc lies flat on its plane" in solution.message
        assert np.isfinite(solution.q).all()


def test_a_disc_that_lands_flat_is_named():
    """It is refused where it lies; in flight, where it stays flat, the run ends as it lands, at sqrt(2 h / g)."""
    scene = ts.Scene(gravity=(0, 0, -10))
    body = scene.add_body(1.0, (0.08, 0.08, 0.15), name="coin")
    law = {"normal_b": UP, "kinetic": 0.3, "name": "rolls"}
    scene.add(C.RollingDisc(body, scene.ground, axis_a=UP, radius=0.5, **law))
    with pytest.raises(ts.SingularConfiguration, match="'rolls' contact: the disc lies flat on its plane"):
        ts.simulate(scene, (0, 1))
    body.position = (0, 0, 0.2)
    solution = ts.simulate(scene, (0, 1))
    assert solution.status is ts.Status.CONTACT_FAILED
    assert "'rolls' contact: the disc lies flat on its plane" in solution.message
    assert abs(solution.reached - 0.2) < 1e-12


@pytest.mark.slow
def test_a_disc_whose_equilibrium_is_flat_is_named():
    """A ball with its centroid off its centre rolls to where that is lowest; a coin would fall flat."""
    scene, _, _ = rolling("disc")
    with pytest.raises(ts.SingularConfiguration, match="the disc lies flat on its plane"):
        scene.equilibrium()
    scene = ts.Scene()
    body = scene.add_body(1.0, (1, 1, 1), position=(0, 0, 1))
    scene.add(C.RollingBall(body, scene.ground, radius=1, center_a=(0, 0.3, 0), normal_b=UP))
    scene.assemble()
    found = scene.equilibrium()
    np.testing.assert_allclose(found.state.position(body)[2], 0.7, atol=1e-12)
    assert found.stable


@pytest.mark.slow
@pytest.mark.parametrize("name", ["disc", "ellipsoid"])
def test_lanes(name):
    """Cases in lanes are those one at a time, to rounding."""
    scene, body, _ = rolling(name)
    cases = {f"{body.name}.mass": np.linspace(1.0, 2.0, 8)}
    one, many = (ts.ensemble(scene, cases, (0.0, 1.0), lanes=lanes) for lanes in (None, 4))
    np.testing.assert_allclose(many.q, one.q, atol=1e-12)
    assert not many.status.any()


def test_a_point_mass_does_not_roll():
    scene = ts.Scene()
    with pytest.raises(ts.InvalidConstraint, match="point mass 'dot' has no orientation and can't roll"):
        C.RollingBall(scene.add_point_mass(1.0, name="dot"), scene.ground, radius=1.0, normal_b=UP)


def test_items_without_a_contact_point_are_refused():
    scene = ts.Scene()
    body = scene.add_body(1.0, (1, 1, 1))
    rod = scene.add(C.Distance(body, scene.ground, point_b=(0, 0, 2), name="rod"))
    push = scene.add(ts.forces.PointForce(body, force=(1, 0, 0), name="push"))
    solution = ts.simulate(scene, (0, 0.1))
    for ask in (solution.contact_point, solution.friction_demand, solution.state.contact_point):
        for item in (rod, push, "rod"):
            with pytest.raises(ts.InvalidConstraint, match="has no contact point; RollingDisc"):
                ask(item)


@pytest.mark.parametrize("names", [("left", "right"), ("right", "left")])
def test_wheels_on_one_axle_share_the_lateral_force(names):
    """12 kg at 1.5 m/s turn at 0.9 rad/s: 8.1 N on each wheel, whichever row is dropped."""
    scene, c, speed, turn, radius = ts.Scene(), ts.constraints, 1.5, 0.9, 0.2
    spin = {"velocity": (speed, 0, 0), "angular_velocity": (0, 0, turn)}
    deck = scene.add_body(10.0, (1.0, 1.0, 2.0), position=(0, 0, radius), name="deck", **spin)
    scene.add(c.Dot1(deck, scene.ground, axis_a=(1, 0, 0), axis_b=(0, 0, 1)))
    for name in names:
        y = {"left": 0.4, "right": -0.4}[name]
        v = speed - turn * y
        spin = {"velocity": (v, 0, 0), "angular_velocity": (0, v / radius, turn)}
        wheel = scene.add_body(1.0, (0.01, 0.02, 0.01), position=(0, y, radius), name=name, **spin)
        scene.add(c.Revolute.at(deck, wheel, point=(0, y, radius), axis=(0, 1, 0)))
        tyre = {"axis_a": (0, 1, 0), "normal_b": (0, 0, 1), "name": f"under {name}"}
        scene.add(c.RollingDisc(wheel, scene.ground, radius=radius, **tyre))
    solution = ts.simulate(scene, (0, 1))
    for name in names:
        push = solution.reaction(f"under {name}")[0][:, 2]
        np.testing.assert_allclose(solution.friction_demand(f"under {name}") * push, 8.1, rtol=1e-9)
        np.testing.assert_allclose(solution.state.friction_demand(f"under {name}") * push[-1], 8.1, rtol=1e-9)
        assert not solution.reaction_unique(f"under {name}").any()
