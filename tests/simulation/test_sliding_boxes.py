"""Boxes that slide and turn on rough corners, against their equations in minimal coordinates."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import tsdyn as ts
from tests.helpers.resuming import Stop
from tests.helpers.rough_boxes import FLOOR, G, boxes
from tsdyn.runs import driver

C = ts.constraints
BOXES = [
    ((0.28, 0.11, 0.4, 0.26), (0.32, 0.53, 0.42), (-0.21, -1.36), 0.0),
    ((0.21, 0.46, 0.29, 0.17), (0.25, 0.6, 0.23), (0.19, -0.13), 1.76),
]


def corners(size):
    """Those that stand, body frame (4, 3)."""
    a, b, h = np.array(size) / 2
    return np.array([(a, b, -h), (-a, b, -h), (-a, -b, -h), (a, -b, -h)])


def slid(mu, size, legs, v, spin, t, max_step=np.inf):
    """Centroid and angle (3,) of a box that slides on corners, by its equations in x, y and the angle.

    Loads are the least of their resultant: N = K y, K = (1, x_i, y_i), of those that needn't pull.
    """
    m, (r, h) = 2.0, (corners(size)[legs], size[2] / 2)
    J, mu = m * (size[0] ** 2 + size[1] ** 2) / 12, np.array(mu)[legs]

    def rates(t, y):
        c, s = np.cos(y[2]), np.sin(y[2])
        arm = r[:, :2] @ [[c, s], [-s, c]]
        u = y[3:5] + y[5] * np.column_stack([-arm[:, 1], arm[:, 0]])
        f = -mu[:, None] * u / np.linalg.norm(u, axis=1)[:, None]  # for N = 1, at h below the centroid
        K, balance = np.column_stack([np.ones(len(arm)), arm]), np.array([1.0 + 0.0 * f[:, 0], *(arm + h * f).T])
        N = K @ np.linalg.solve(balance @ K, [m * G, 0, 0])
        while N.min() < 0.0:
            K[N.argmin()] = 0.0
            N = K @ np.linalg.solve(balance @ K, [m * G, 0, 0])
        return (*y[3:], *(N @ f / m), N @ (arm[:, 0] * f[:, 1] - arm[:, 1] * f[:, 0]) / J)

    start, options = (0, 0, 0, *v, spin), {"rtol": 1e-12, "atol": 1e-12, "max_step": max_step}
    return solve_ivp(rates, (0, t), start, "DOP853", **options).y[:3, -1]


@pytest.mark.parametrize(("mu", "size", "v", "spin"), BOXES)
def test_a_box_on_corners_of_different_friction_slides_and_turns(mu, size, v, spin):
    """Loads are the least, of the distributions that the rigid box leaves open, until all of it rests."""
    scene = ts.Scene(gravity=(0, 0, -G))
    given = {**ts.shapes.box(size, mass=2.0), "position": (0, 0, size[2] / 2), "velocity": (*v, 0)}
    body = scene.add_body(**given, angular_velocity=(0, 0, spin), name="box")
    for i, corner in enumerate(corners(size)):
        scene.add(C.PlaneContact(body, scene.ground, **FLOOR | {"point_a": corner}, kinetic=mu[i], name=str(i)))
    solution = ts.simulate(scene, (0, 1.5), rtol=1e-10, atol=1e-10, dense_output=True).raise_if_failed()
    assert np.abs(solution.qd[-1]).max() == 0.0
    loads = np.stack([solution.reaction(str(i))[0] for i in range(4)], axis=1)
    assert loads[:, :, 2].min() > -1e-9
    slides = ~np.stack([solution.sticking(str(i)) for i in range(4)], axis=1)
    np.testing.assert_allclose(
        np.hypot(*np.moveaxis(loads[:, :, :2], 2, 0))[slides], (loads[:, :, 2] * mu)[slides], atol=1e-9
    )
    legs = np.flatnonzero(loads[0, :, 2] > 1e-9)
    state = solution.at(0.1)
    R = state.rotation("box")
    found = *state.position("box")[:2], np.arctan2(R[1, 0], R[0, 0])
    np.testing.assert_allclose(found, slid(mu, size, legs, v, spin, 0.1), atol=1e-8)


def test_a_box_that_slides_and_turns_comes_to_rest_in_few_phases():
    """Slips that end where they turn end at once; the box slides on all corners, by its equations."""
    size, scene = (0.6, 0.4, 0.2), boxes(1, mu=0.3, velocity=(1, 0, 0), spin=3.0)
    solution = ts.simulate(scene, (0, 1), rtol=1e-11, atol=1e-11, dense_output=True).raise_if_failed()
    assert np.count_nonzero(np.diff(solution.t) == 0.0) <= 5
    assert np.abs(solution.qd[-1]).max() == 0.0
    state = solution.at(0.3)
    R = state.rotation("0")
    found = *state.position("0")[:2], np.arctan2(R[1, 0], R[0, 0])
    np.testing.assert_allclose(found, slid([0.3] * 4, size, range(4), (1, 0), 3.0, 0.3), atol=1e-10)


@pytest.mark.parametrize("size", [(0.4, 0.4, 0.2), (0.5, 0.3, 0.3)])
def test_a_box_that_slides_and_turns_is_carried_by_all_corners(size):
    """The floor takes work by the friction of all four."""
    scene = boxes(1, mu=0.3, size=size, velocity=(1, 0.3, 0), spin=5.0)
    solution = ts.simulate(scene, (0, 0.5), rtol=1e-11, atol=1e-11, dense_output=True)
    state = solution.at(0.3)
    R = state.rotation("0")
    found = *state.position("0")[:2], np.arctan2(R[1, 0], R[0, 0])
    np.testing.assert_allclose(found, slid([0.3] * 4, size, range(4), (1, 0.3), 5.0, 0.3), atol=1e-10)
    loads = np.array([state.reaction(contact)[0][2] for contact in scene.constraints[:4]])
    np.testing.assert_allclose([loads.sum(), loads @ (1, -1, -1, 1)], [G, 0.0], atol=1e-10)
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=1e-12)
    assert not solution.qd[-1].any()


def test_a_corner_that_lacks_load_carries_again_as_soon_as_it_can():
    """Each of three corners has none for a while; it would have to pull."""
    size, v, spin = (0.4, 0.4, 0.65), (2, 0.3), 8.0
    scene = boxes(1, mu=0.6, size=size, velocity=(*v, 0), spin=spin)
    solution = ts.simulate(scene, (0, 0.4), rtol=1e-11, atol=1e-11, dense_output=True)
    R = solution.rotation("0")[-1]
    found = *solution.position("0")[-1, :2], np.arctan2(R[1, 0], R[0, 0])
    np.testing.assert_allclose(found, slid([0.6] * 4, size, range(4), v, spin, 0.4, 2e-3), atol=1e-9)
    loads = np.array([solution.reaction(contact)[0][:, 2] for contact in scene.constraints[:4]])
    assert loads.min() > -1e-9
    assert ((loads < 1e-9).sum(axis=1) > 1).sum() == 3
    ends = np.flatnonzero(np.diff(solution.t) == 0.0)
    np.testing.assert_allclose(loads[:, ends], loads[:, ends + 1], atol=1e-5)  # the slip of one turns as it is slow


@pytest.mark.parametrize("force", [(6.0, 2.0), (10.0, 0.0)])
def test_corners_that_begin_to_slide_do_so_against_their_friction(force):
    """By their accelerations from rest, which follow from the loads, and these from the friction."""
    scene, r = boxes(1, mu=0.3, size=(0.4, 0.4, 0.2)), np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)]) * 0.2
    scene.add(ts.forces.PointForce(scene.bodies[0], point_a=(0.15, 0.2, -0.1), force=(*force, 0)))
    solution = ts.simulate(scene, (0, 0.01))
    loads = np.array([solution.reaction(contact)[0][0] for contact in scene.constraints[:4]])
    np.testing.assert_allclose([loads[:, 2].sum(), loads[:, 2] @ (1, -1, -1, 1)], [G, 0.0], atol=1e-8)
    turn = solution.angular_acceleration("0")[0, 2]
    a = solution.acceleration("0")[0, :2] + turn * np.column_stack([-r[:, 1], r[:, 0]])
    friction = -0.3 * loads[:, 2:] * a / np.linalg.norm(a, axis=1)[:, None]
    np.testing.assert_allclose(loads[:, :2], friction, atol=1e-8)


def test_a_square_box_that_spins_stays_where_it_is():
    """It slows down by mu m g r, r the half diagonal; each corner carries a quarter."""
    scene, J, r = boxes(1, mu=0.3, size=(0.4, 0.4, 0.2), spin=5.0), 0.4**2 / 6, 0.08**0.5
    solution = ts.simulate(scene, (0, 0.5))
    np.testing.assert_allclose(solution.phases[0][1], J * 5.0 / (0.3 * G * r), rtol=1e-12)
    assert np.abs(solution.position("0") - [0, 0, 0.1]).max() < 1e-15
    for contact in scene.constraints[:4]:
        slides = ~solution.sticking(contact)
        np.testing.assert_allclose(solution.reaction(contact)[0][slides, 2], G / 4, rtol=1e-12)


def test_a_box_that_slides_and_turns_goes_on_from_a_checkpoint_to_the_same_bits(tmp_path, monkeypatch):
    def box():
        return boxes(1, mu=0.4, size=(0.4, 0.4, 0.5), velocity=(2, 1, 0), spin=5.0)

    monkeypatch.setattr(driver, "FIRST_SLICE", 4)
    whole = ts.simulate(box(), (0, 1))
    for stop in (2, 4):
        path = tmp_path / f"run {stop}.h5"
        stopped = ts.simulate(box(), (0, 1), store=path, checkpoint=0.0, progress=Stop(stop))
        assert stopped.status is ts.Status.INTERRUPTED
        resumed = ts.resume(path)
        np.testing.assert_array_equal(resumed.q, whole.q)
        assert resumed.phases == whole.phases


def test_slips_that_turn_while_they_end_make_few_events():
    """Of a box that slides and turns: directions turn the faster the slower it is; then it rests, exactly."""
    scene = boxes(1, mu=0.5, size=(0.3, 0.3, 0.6), velocity=(0.3, 0.2, 0), spin=1.0)
    solution = ts.simulate(scene, (0, 0.2), dense_output=True)
    assert (np.diff(solution.t) == 0.0).sum() < 40
    assert np.diff(solution.energy).max() < 1e-12 * solution.energy[0]  # ends of slips add none
    assert len(solution.phases) == 2
    assert not solution.qd[-1].any()
    energy = (0.3**2 + 0.2**2) / 2 + (0.3**2 + 0.3**2) / 12 / 2
    np.testing.assert_allclose(solution.work[-1], -energy, rtol=1e-8)


@pytest.mark.parametrize(
    ("mu", "size", "v", "spin", "slides"),
    [(0.3, (0.6, 0.2, 0.2), (0.9, 0.4), -1.4, 0.2), (0.43, (0.6, 0.4, 0.6), (-0.2, 0.2), 1.4, 0.02)],
)
def test_corners_of_a_box_that_slides_and_turns_push(mu, size, v, spin, slides):
    """Loads are the least; where one would have to pull, three corners carry the box."""
    scene = boxes(1, mu=mu, size=size, velocity=(*v, 0), spin=spin)
    contacts = scene.constraints[:4]
    solution = ts.simulate(scene, (0, 0.5), rtol=1e-10, atol=1e-10, dense_output=True).raise_if_failed()
    loads = np.stack([solution.reaction(contact)[0] for contact in contacts], axis=1)
    assert loads[:, :, 2].min() >= -1e-9 * G
    np.testing.assert_allclose(loads.sum(axis=1), solution.qdd[:, :3] + [0, 0, G], atol=1e-9)
    assert np.diff(solution.kinetic_energy).max() <= 1e-12
    assert not solution.qd[-1].any()
    legs = np.flatnonzero(loads[0, :, 2] > 0)
    places = np.array([contact.point_a for contact in contacts])[legs]
    legs = [np.argmin(np.linalg.norm(corners(size) - place, axis=1)) for place in places]
    state = solution.at(slides)
    R = state.rotation("0")
    found = *state.position("0")[:2], np.arctan2(R[1, 0], R[0, 0])
    np.testing.assert_allclose(found, slid([mu] * 4, size, legs, v, spin, slides), atol=1e-9)


def test_friction_is_against_a_slip_that_turns_until_it_ends():
    """A stack that tips on one foot: in the last 1e-5 s the slip turns by 2e-4 rad, loads change by 1e-3 N."""
    scene = boxes(2, mu=0.55, size=(0.3, 0.5, 0.7), velocity=(-0.8, 0.7, 0), spin=-0.6)
    solution = ts.simulate(scene, (0, 0.1), dense_output=True).raise_if_failed()
    end, foot, contacts = solution.phases[0][1], scene.constraints[2], scene.constraints[:8]
    before, last = solution.at(end - 1e-5), solution.at(end - 1e-10)
    (vx, vy, _), (fx, fy, _) = before.velocity(foot.a, point=foot.point_a), last.reaction(foot)[0]
    np.testing.assert_allclose(np.arctan2(-fy, -fx), np.arctan2(vy, vx), atol=1e-3)
    loads = np.array([[state.reaction(contact)[0][2] for contact in contacts] for state in (before, last)])
    assert loads[0, 7] > 0.06
    np.testing.assert_allclose(*loads, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mu", "size", "v", "spin", "angle"),
    [
        (0.52, (0.2, 0.7, 0.5), (-0.7, 0.6), -0.7, 0.1),  # one of two loads that may carry falls from zero
        (0.23, (0.7, 0.5, 0.5), (-0.1, 0.4), -2.8, 0.0),  # three corners hold where four that share would slide
        (0.3, (0.3, 0.7, 0.2), (0.3, -0.1), 2.9, 0.0),
    ],
)
def test_corners_of_two_boxes_push_by_their_own_loads(mu, size, v, spin, angle):
    scene = boxes(2, mu=mu, size=size, velocity=(*v, 0), spin=spin, angle=angle)
    solution = ts.simulate(scene, (0, 0.15), dense_output=True).raise_if_failed()
    rows = [member.rows.start for member in solution.packed.members if hasattr(member.constraint, "sides")]
    pushes = -solution.multipliers[:, rows]
    assert pushes.min() > -1e-8 * pushes.max()
    assert np.diff(solution.energy).max() < 1e-9


def dominoes(planar=False, without=None):
    """Two, the first is pushed; without one of their feet."""
    scene, half, first = ts.Scene(gravity=(0, 0, -G)), np.array((0.05, 0.2, 0.4)), None
    for i in range(2):
        w, place = np.array((0, 1.5 * (i == 0), 0)), np.array((0.3 * i, 0, 0.4))
        box = scene.add_body(**ts.shapes.box(2 * half, mass=1.0), position=place, angular_velocity=w)
        box.velocity = np.cross(w, half * (-1, 0, 1))
        if planar:
            scene.add(C.Planar.at(scene.ground, box, point=place, axis=(0, 1, 0)))
        for x, y, z in ((x, y, z) for x, z in ((-1, -1), (1, -1), (1, 1)) for y in (-1, 1)):
            law = {"point_a": half * (x, y, z), "kinetic": 0.6, "name": f"foot {x} {y} {z} of {i}"}
            if law["name"] != without:
                scene.add(C.PlaneContact(box, scene.ground, **FLOOR, **law))
        for y in (-1, 1) if i else ():
            at = {"point_a": half * (1, y, 1), "point_b": half * (-1, 0, 0), "normal_b": (-1, 0, 0)}
            scene.add(C.PlaneContact(first, box, **at, unilateral=True, name=f"push {y}"))
        first = box
    return scene


def test_dominoes_that_wedge_have_several_motions():
    """With their feet at the bound of friction both sides may carry alike, or one foot rise: the run says so."""
    solution = ts.simulate(dominoes(), (0, 1.3))
    assert solution.status == ts.Status.CONTACT_FAILED
    assert "or several (Painleve's paradox)" in solution.message
    begin, state = solution.reached, solution.state
    pushing = [f"foot 1 {y} -1 of {i}" for i in range(2) for y in (-1, 1)] + ["push -1", "push 1"]
    alike = {name: np.linalg.norm(solution.reaction(name)[0][-1]) for name in pushing}
    assert min(alike.values()) > 0.1
    for y in (-1, 1):
        rises = f"foot 1 {y} -1 of 1"
        other = ts.simulate(dominoes(without=rises), (begin, begin + 1e-3), state=ts.State(begin, state.q, state.qd))
        place = other.position(other.scene.bodies[1], point=(0.05, 0.2 * y, -0.4))[:, 2]
        assert (place[1:] > place[0]).all()
        pushes = {name: np.linalg.norm(other.reaction(name)[0], axis=1).min() for name in pushing if name != rises}
        assert min(pushes.values()) > 0.1
    # Within a plane there is one motion
    assert ts.simulate(dominoes(planar=True), (0, 1.3)).success


@pytest.mark.parametrize("spin", [0.0, 3.0])
def test_a_box_on_a_table_that_is_shaken_slides_to_and_fro(spin):
    """The drive does work where the box comes to rest on the table; friction does none. The spin dies out.

    In the end the velocity of the box is a triangular wave, of slope mu g, that meets the table's at its peaks:
    A w cos(w t) = mu g T / 4.
    """
    A, w, mu, end = 0.2, 6.0, 0.3, 3.0
    scene = ts.Scene(gravity=(0, 0, -G))
    table = scene.add_body(1.0, (1, 1, 1), velocity=(A * w, 0, 0))
    slide = scene.add(C.Translational.at(scene.ground, table, point=(0, 0, 0), axis=(1, 0, 0)))
    scene.add(C.TranslationMotor.of(slide, displacement=ts.motions.Sine(A, w)))
    given = {"position": (0, 0, 0.1), "velocity": (A * w, 0, 0), "angular_velocity": (0, 0, spin)}
    box = scene.add_body(**ts.shapes.box((0.4, 0.3, 0.2), mass=2.0), **given)
    corners = [(x, y, -0.1) for x in (-0.2, 0.2) for y in (-0.15, 0.15)]
    feet = [scene.add(C.PlaneContact(box, table, point_a=point, **FLOOR, kinetic=mu)) for point in corners]
    solution = ts.simulate(scene, (0, end))
    for foot in feet:
        slip = solution.velocity(box, point=foot.point_a) - solution.velocity(table)
        power = (solution.reaction(foot, on=box)[0] * slip * (1, 1, 0)).sum(axis=1)
        assert power.max() < 1e-9
    peak = mu * G * np.pi / (2 * w)
    phase = (w * end - np.arccos(peak / (A * w))) % (2 * np.pi)  # since the velocity was largest
    expected = abs(phase - np.pi) * mu * G / w - peak
    assert abs(solution.velocity(box)[-1, 0] - expected) < 1e-3
    assert np.abs(solution.angular_velocity(box)[-1]).max() < 1e-8


@pytest.mark.parametrize("spin", [5e-4, 1e-3, 2e-3, 1e-2])
def test_a_rod_that_turns_a_little_until_it_rests_stays_there(spin):
    """It turns by 4e-8 to 2e-5 rad: the slip takes its direction anew before it ends, the same or another one."""
    scene, L = ts.Scene(gravity=(0, 0, -G)), 1.0
    given = {"position": (L / 2, 0, 0), "velocity": (0, spin * L / 2, 0), "angular_velocity": (0, 0, spin)}
    rod = scene.add_body(1.0, (1e-3, L**2 / 12, L**2 / 12), **given, name="rod")
    scene.add(C.Universal.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 0, 1), axis_b=(0, 1, 0)))
    scene.add(C.PlaneContact(rod, scene.ground, point_a=(L / 2, 0, 0), **FLOOR, kinetic=0.2, name="floor"))
    end = spin * (L**2 / 3) / (0.2 * G * L / 2)  # J w / (mu N L) with N = m g / 2
    solution = ts.simulate(scene, (0, 3 * end), integrator="dop853")
    assert abs(solution.phases[1][0] - end) < 1e-9 * end
    assert solution.kinetic_energy[-1] == 0.0
    assert np.diff(solution.kinetic_energy).max() <= 0.0


@pytest.mark.parametrize("order", [1, -1])
def test_a_box_leaves_a_shaken_table_with_all_corners_at_once(order):
    """Two corners carry it, as reactions aren't unique; it flies without a turn, and lands on all corners."""
    A, w, half = 0.06, 15.0, 0.1
    scene = ts.Scene(gravity=(0, 0, -G))
    table = scene.add_body(mass=5.0, inertia=(1, 1, 1), name="table")
    slide = scene.add(C.Translational.at(scene.ground, table, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(C.TranslationMotor.of(slide, displacement=lambda t: A * (1 - np.cos(w * t))))
    box = scene.add_body(**ts.shapes.box((0.6, 0.4, 2 * half), mass=2.0), position=(0, 0, half), name="box")
    for corner in corners((0.6, 0.4, 2 * half))[::order]:
        scene.add(C.PlaneContact(box, table, point_a=corner, **FLOOR, kinetic=0.3))
    off = np.arccos(-G / (A * w**2)) / w

    def gap(t):
        z, v = A * (1 - np.cos(w * off)), A * w * np.sin(w * off)
        return z + v * (t - off) - G * (t - off) ** 2 / 2 - A * (1 - np.cos(w * t))

    lands = brentq(gap, off + 0.01, off + 0.6, xtol=1e-15)
    solution = ts.simulate(scene, (0, lands + 1e-3), dense_output=True).raise_if_failed()
    assert [len(names) for *_, names in solution.phases[:2]] == [4, 0]
    np.testing.assert_allclose([end for _, end, _ in solution.phases[:2]], [off, lands], rtol=0, atol=1e-10)
    struck = 2.0 * (A * w * np.sin(w * lands) - A * w * np.sin(w * off) + G * (lands - off))
    assert len(solution.impulses) == 4
    np.testing.assert_allclose([p for *_, p in solution.impulses], struck / 4, rtol=1e-9)
    assert np.abs(solution.angular_velocity("box")).max() < 1e-12
