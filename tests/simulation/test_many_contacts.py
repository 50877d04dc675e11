"""Many contacts and many events: stacks, chains, long rows of impacts; outputs across impacts of one run."""

from itertools import pairwise

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import EPS
from tsdyn.rows import constraint_graph
from tsdyn.simulation import phase_scenes, transitions

C = ts.constraints
G = 9.81
FLOOR = {"normal_b": (0, 0, 1), "unilateral": True}
BOX = np.array([0.5, 0.5, 0.25])


def stack(count, rough=False):
    """Tilted boxes above each other; 4 contacts each, of another friction on each box."""
    scene, rng = ts.Scene(gravity=(0, 0, -G)), np.random.default_rng(1)
    below, top = scene.ground, 0.0
    for i in range(count):
        half = 0.01 * rng.normal()
        box = scene.add_body(
            **ts.shapes.box(2 * BOX, mass=1.0),
            position=(0, 0, BOX[2] + 0.03 + 0.53 * i),
            orientation=(np.cos(half), np.sin(half), 0, 0),
            name=f"box {i}",
        )
        for corner in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            at = {"point_a": BOX * [*corner, -1], "point_b": (0, 0, top), "name": f"corner {corner} of {i}"}
            friction = {"kinetic": 0.3 + 0.3 * (7 * i % 10) / 10} if rough else {}
            scene.add(C.PlaneContact(box, below, **at, **FLOOR, restitution=0.2, **friction))
        below, top = box, BOX[2]
    return scene


@pytest.mark.parametrize(
    ("count", "rough"),
    [(3, False), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((10, False), (5, True), (10, True)))],
)
def test_a_stack_of_boxes_falls_and_comes_to_rest(count, rough):
    """Contacts are redundant; the forces between boxes are the weights above, where the boxes rest.

    With friction impacts accumulate hundreds of times, each time a box lands.
    """
    scene = stack(count, rough)
    solution = ts.simulate(scene, (0, 2.0), rtol=1e-10, atol=1e-10)
    assert solution.success
    assert np.diff(solution.energy).max() < 1e-12 * count**2 * G
    assert solution.constraint_error.position.max() < 1e-14 * count
    assert solution.constraint_error.velocity.max() < 1e-14 * count
    state = solution.state
    for i in range(count):
        # Rest, each box on the one below
        assert abs(state.position(f"box {i}")[2] - BOX[2] * (2 * i + 1)) < 1e-12
        assert np.abs(state.velocity(f"box {i}")[2]) < 1e-12
        corners = [contact.name for contact in scene.constraints if contact.name.endswith(f"of {i}")]
        force = sum(solution.reaction(name)[0][-1] for name in corners)
        np.testing.assert_allclose(force, [0, 0, (count - i) * G], atol=1e-9 * count)


def balls_over_a_box(count, seed, half, width, **law):
    """Balls of radius 0.1 over each other, with centres within +-width; a floor and four walls half away."""
    radius, scene, rng = 0.1, ts.Scene(gravity=(0, 0, -G)), np.random.default_rng(seed)
    balls = []
    for i in range(count):
        place = (rng.uniform(-width, width), rng.uniform(-width, width), 0.15 + 0.25 * i)
        balls.append(scene.add_body(**ts.shapes.sphere(radius, mass=1.0), position=place))
    for i, ball in enumerate(balls):
        sides = [((0, 0, 0), (0, 0, 1))]
        sides += [(tuple(-half * np.array(n)), n) for n in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))]
        for at, n in sides:
            scene.add(C.SphereContact(ball, scene.ground, radius_a=radius, center_b=at, normal_b=n, **law))
        for other in balls[:i]:
            scene.add(C.SphereContact(ball, other, radius_a=radius, radius_b=radius, **law))
    return scene


@pytest.mark.parametrize(
    ("count", "e", "seed", "half"),
    [
        (5, 0.0, 8, 0.3),
        (4, 0.0, 9, 0.3),
        *(pytest.param(10, *case, 0.33, marks=pytest.mark.slow) for case in ((0.0, 3), (0.5, 2))),
    ],
)
def test_balls_fall_into_a_box(count, e, seed, half):
    """Without friction; contacts beside those that are hit have rates that are rounding, of either sign.

    At the end floor and walls carry the weight and what accelerates the balls.
    """
    radius, scene = 0.1, balls_over_a_box(count, seed, half, 0.15, restitution=e)
    balls = scene.bodies
    solution = ts.simulate(scene, (0, 2.0))
    assert solution.success, solution.message
    x = np.array([solution.position(ball) for ball in balls])
    apart = [np.linalg.norm(x[i] - x[j], axis=1).min() for i in range(count) for j in range(i)]
    assert min(apart) > 2 * radius - 1e-12  # that of constraints
    assert min(x[:, :, 2].min(), half - np.abs(x[:, :, :2]).max()) > radius - 1e-12
    assert np.diff(solution.energy).max() < 1e-8 * count * G  # the tolerance of the run
    resting = [c for c in scene.constraints if isinstance(c, C.SphereContact) and c.name in solution.phases[-1][2]]
    force = sum(solution.reaction(c)[0][-1] for c in resting if c.b is scene.ground)
    rises = sum(solution.acceleration(ball)[-1] for ball in balls)
    np.testing.assert_allclose(force, rises + np.array([0, 0, count * G]), atol=1e-9 * count * G)


@pytest.mark.slow
@pytest.mark.parametrize(("count", "seed", "end"), [(4, 1, 2.0), *((6, seed, 2.0) for seed in range(3)), (12, 2, 1.0)])
def test_rough_balls_fall_into_a_box(count, seed, end):
    """They brace each other between floor and walls: reactions that aren't unique lie within the cones.

    Energy never rises; at the end reactions balance weights and accelerations.
    """
    mu, half = 0.3, 0.23 if count == 4 else 0.33
    scene = balls_over_a_box(count, seed, half, half - 0.15, kinetic=mu)
    solution = ts.simulate(scene, (0, end)).raise_if_failed()
    assert np.diff(solution.energy).max() < 1e-12 * count * G
    net = {ball: np.tile([0.0, 0.0, -G], (solution.t.size, 1)) for ball in scene.bodies}
    for contact in scene.constraints:
        if not isinstance(contact, C.SphereContact):
            continue
        load = solution.reaction(contact)[0]
        net[contact.a] += load
        if contact.b is scene.ground:
            normal = np.tile(contact.normal_b, (solution.t.size, 1))
        else:
            net[contact.b] -= load
            normal = (solution.position(contact.a) - solution.position(contact.b)) / 0.2
        N = (load * normal).sum(axis=1)
        assert N.min() > -1e-8 * count * G
        assert (np.linalg.norm(load - N[:, None] * normal, axis=1) - mu * N).max() < 1e-8 * count * G
    for ball, force in net.items():
        np.testing.assert_allclose(solution.acceleration(ball)[-1], force[-1], atol=1e-8 * G)


@pytest.mark.slow
def test_boxes_of_a_rough_tower_touch_in_flight():
    """Ten boxes land one after the other: those above fly on each other's corners, where all reactions are rounding."""
    scene, end, count = stack(10, rough=True), 0.22, 10
    solution = ts.simulate(scene, (0, end), rtol=1e-10, atol=1e-10).raise_if_failed()
    assert solution.reached == end
    assert np.diff(solution.energy).max() < 1e-12 * count**2 * G
    # The floor only pushes: momentum falls by the weights at most. At events slips below 1e-6 m/s end at once, where
    # they turn, by friction that is vertical as far as boxes lean: by 0.01
    pushes = np.diff(solution.linear_momentum[:, 2]) + count * G * np.diff(solution.t)
    events, ended = np.diff(solution.t) == 0.0, count * 1e-6 * 0.01
    assert pushes[~events].min() > -1e-12 * count
    assert pushes[events].min() > -ended
    for i, box in enumerate(scene.bodies):
        below = scene.bodies[i - 1] if i else None
        R, x = solution.state.rotation(box), solution.state.position(box)
        for corner in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            point = x + R @ (BOX * [*corner, -1])
            if below is not None:
                point = solution.state.rotation(below).T @ (point - solution.state.position(below)) - [0, 0, BOX[2]]
            assert point[2] > -1e-12


@pytest.mark.parametrize("count", [1, 2, 3])
def test_all_corners_of_boxes_leave_a_platform_at_one_instant(count):
    """A platform moves by A sin(w t), boxes slide on it; all loads vanish where A w^2 sin(w t) = g."""
    A, w, scene = 0.5, 5.0, ts.Scene(gravity=(0, 0, -G))
    table = scene.add_body(**ts.shapes.box((2, 2, 0.2), mass=5.0), velocity=(0, 0, A * w))
    slide = scene.add(C.Translational.at(scene.ground, table, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(C.TranslationMotor.of(slide, displacement=ts.motions.Sine(A, w)))
    below, top = table, 0.1
    for i in range(count):
        start = {"position": (0.05, -0.035, 0.1 + BOX[2] * (2 * i + 1)), "velocity": (0.3, 0.1, A * w)}
        box = scene.add_body(**ts.shapes.box(2 * BOX, mass=1.0 + i), **start)
        for corner in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            scene.add(C.PlaneContact(box, below, point_a=BOX * [*corner, -1], point_b=(0, 0, top), **FLOOR))
        below, top = box, BOX[2]
    leave, end = np.arcsin(G / (A * w**2)) / w, 0.3
    solution = ts.simulate(scene, (0, end)).raise_if_failed()
    starts = np.array([start for start, _, _ in solution.phases])
    assert abs(starts[1] - leave) < 1e-14
    assert np.abs(starts[1:] - leave).max() < 1e-10
    assert not [name for name in solution.phases[-1][2] if "body1)" in name]  # boxes fly on each other, without loads
    for i, box in enumerate(scene.bodies[1:]):
        height = 0.1 + BOX[2] * (2 * i + 1) + A * np.sin(w * leave)
        flight = end - leave
        height += A * w * np.cos(w * leave) * flight - 0.5 * G * flight**2
        assert abs(solution.state.position(box)[2] - height) < 1e-10


@pytest.mark.parametrize("e", [0.01, 0.03, 0.06])
def test_impacts_of_three_balls_that_collapse_end_in_one_velocity(e):
    """With restitution below 7 - 4 sqrt(3) impacts accumulate until all go on together, with the momentum of one."""
    scene = ts.Scene(gravity=(0, 0, 0))
    balls = [scene.add_point_mass(1.0, position=(x, 0, 0), velocity=(float(x == 0), 0, 0)) for x in (0.0, 0.3, 0.5)]
    for a, b in pairwise(balls):
        scene.add(C.SphereContact(a, b, radius_a=0.05, radius_b=0.05, restitution=e))
    solution = ts.simulate(scene, (0, 2.0)).raise_if_failed()
    np.testing.assert_allclose(solution.qd[-1][::3], 1 / 3, atol=4 * EPS)
    assert 4 < len({t for t, *_ in solution.impulses}) < 24
    # As long as flights are long, by the law: the second impact is that of the second pair
    speeds = [impulse for *_, impulse in solution.impulses[:2]]
    np.testing.assert_allclose(speeds, [(1 + e) / 2, ((1 + e) / 2) ** 2], rtol=1e-14)


@pytest.mark.slow
def test_impacts_of_shifted_boxes_that_accumulate_are_few(monkeypatch):
    """Each end as without an end of accumulations, after fewer impacts; what falls is lost, and momentum is kept."""
    counts, gap, count = [], 0.003, 3
    for most in (0.0, transitions.ACCUMULATED):
        monkeypatch.setattr(transitions, "ACCUMULATED", most)
        scene, rng, below, top = ts.Scene(gravity=(0, 0, -G)), np.random.default_rng(3), None, 0.0
        for i in range(count):
            place = *(0.005 * rng.normal(size=2)), (gap + 0.2) * (i + 1) - 0.1
            box = scene.add_body(**ts.shapes.box((0.4, 0.4, 0.2), mass=1.0), position=place, name=f"box {i}")
            for corner in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
                at = {
                    "point_a": (0.2 * corner[0], 0.2 * corner[1], -0.1),
                    "point_b": (0, 0, top),
                    "name": f"{corner}, {i}",
                }
                scene.add(C.PlaneContact(box, below or scene.ground, **at, **FLOOR, restitution=0.2, kinetic=0.4))
            below, top = box, 0.1
        solution = ts.simulate(scene, (0, 0.2), rtol=1e-10, atol=1e-10).raise_if_failed()
        assert not solution.qd[-1].any()
        np.testing.assert_allclose([solution.position(b)[-1, 2] for b in scene.bodies], [0.1, 0.3, 0.5], atol=1e-12)
        np.testing.assert_allclose(solution.energy[0] - solution.energy[-1], gap * G * (1 + 2 + 3), rtol=1e-12)
        assert np.diff(solution.energy).max() < 1e-9
        impulses, momentum = {}, solution.linear_momentum[:, 2]
        for t, name, impulse in solution.impulses:
            impulses[t] = impulses.get(t, 0.0) + impulse * name.endswith(", 0")
        for t, impulse in impulses.items():
            (at,) = np.nonzero(solution.t == t)
            assert abs(momentum[at[-1]] - momentum[at[0]] - impulse) < 1e-8
        counts.append(len(impulses))
    assert counts[1] < 0.7 * counts[0]


def test_sets_of_contacts_between_the_same_bodies_share_a_graph(monkeypatch):
    """As many corners of a box at a time are one graph with other points; the run has the bits of separate ones."""
    built, graph = [], constraint_graph._GraphBuilder.graph
    monkeypatch.setattr(constraint_graph._GraphBuilder, "graph", lambda self: built.append(self) or graph(self))
    shared = ts.simulate(stack(3), (0, 0.4))
    sets, graphs = len(shared._phases.packed), len(built)
    monkeypatch.setattr(phase_scenes, "_takes_over", lambda packed, first: False)
    alone = ts.simulate(stack(3), (0, 0.4))
    assert len(built) - graphs >= sets > graphs > 1
    for name in ("t", "q", "qd", "qdd", "multipliers"):
        np.testing.assert_array_equal(getattr(shared, name), getattr(alone, name))


def chain(links):
    """A chain along an inclined line, its lower end near the floor; a contact at each lower end of a link."""
    scene, length, angle = ts.Scene(gravity=(0, 0, -G)), 0.1, 0.5
    along, before = np.array([np.cos(angle), 0, np.sin(angle)]), None
    for i in range(links):
        middle = [0, 0, 0.05] + (i + 0.5) * length * along
        orientation = (np.cos(angle / 2), 0, -np.sin(angle / 2), 0)
        inertia = (1e-5, 0.1 * length**2 / 12, 0.1 * length**2 / 12)
        link = scene.add_body(mass=0.1, inertia=inertia, position=middle, orientation=orientation)
        if before is not None:
            scene.add(C.Revolute.at(before, link, point=middle - 0.5 * length * along, axis=(0, 1, 0)))
        scene.add(C.PlaneContact(link, scene.ground, point_a=(-length / 2, 0, 0), **FLOOR, name=f"link {i}"))
        before = link
    return scene


@pytest.mark.parametrize(("links", "end"), [(6, 0.6), pytest.param(100, 0.4, marks=pytest.mark.slow)])
def test_a_chain_falls_on_a_floor(links, end):
    """Momentum changes at impacts by their impulses alone, and the floor never pulls."""
    scene = chain(links)
    solution = ts.simulate(scene, (0, end), rtol=1e-10, atol=1e-10)
    assert solution.success
    momentum, impulses = solution.linear_momentum, {}
    unseen = 0.1 * links * np.sqrt(2 * G * 16 * EPS)  # kg m/s: of flights lower than rounding of a gap
    for t, _, impulse in solution.impulses:
        impulses[t] = impulses.get(t, 0.0) + impulse
    assert len(impulses) > 2
    for t, impulse in impulses.items():
        (at,) = np.nonzero(solution.t == t)
        change = momentum[at[-1]] - momentum[at[0]]
        np.testing.assert_allclose(change, [0, 0, impulse], atol=unseen)
    assert np.diff(solution.energy).max() < 1e-8
    for i in range(links):
        assert solution.reaction(f"link {i}")[0][:, 2].min() > -1e-9 * links * G
    points = [solution.position(body, point=(-0.05, 0, 0))[:, 2].min() for body in scene.bodies]
    assert min(points) > -1e-12
    assert max(solution.constraint_error.position.max(), solution.constraint_error.velocity.max()) < 1e-12


@pytest.mark.parametrize("count", [10_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_many_impacts_leave_the_constraints_as_they_are(count):
    """A bob on a rod flies to and fro between two walls; its speed and the time between impacts stay."""
    scene, speed = ts.Scene(gravity=(0, 0, 0)), 500.0
    bob = scene.add_point_mass(mass=1.0, position=(0, 0, 1), velocity=(speed, 0, 0), name="bob")
    scene.add(C.Distance(bob, scene.ground))
    for side in (1, -1):
        wall = {"point_b": (0.1 * side, 0, 0), "normal_b": (-side, 0, 0), "unilateral": True, "restitution": 1.0}
        scene.add(C.PlaneContact(bob, scene.ground, **wall))
    between = 2 * np.arcsin(0.1) / speed
    solution = ts.simulate(scene, (0, count * between))
    times = np.array([t for t, *_ in solution.impulses])
    assert times.size == count
    assert np.abs(times - between * (0.5 + np.arange(times.size))).max() < 1e-18 * count**2
    assert max(solution.constraint_error.position.max(), solution.constraint_error.velocity.max() / speed) < 1e-14
    np.testing.assert_allclose(solution.kinetic_energy, 0.5 * speed**2, rtol=1e-19 * count**2)


# outputs across impacts, which a run goes on from in its memory


def test_phases_take_over_the_parameters_that_the_scene_has_checked(monkeypatch):
    """Three balls come to rest one after the other; nothing is asked of a rod again for their phases."""
    scene, asked, given = ts.Scene(gravity=(0, 0, -G)), [], C.Distance.parameters
    monkeypatch.setattr(C.Distance, "parameters", lambda rod: asked.append(rod) or given(rod))
    heights = [0.5, 1.0, 1.5]
    for i, h in enumerate(heights):
        ball = scene.add_body(mass=1.0, inertia=(1, 1, 1), position=(i, 0, h + 0.1))
        scene.add(C.SphereContact(ball, scene.ground, radius_a=0.1, normal_b=(0, 0, 1), restitution=0.0))
    bob = scene.add_point_mass(mass=1.0, position=(5, 0, 0))
    scene.add(C.Distance(bob, scene.ground, point_b=(4, 0, 0)))
    ts.simulate(scene, (0, 0.1))
    assert asked
    asked.clear()
    solution = ts.simulate(scene, (0, 1.0))
    falls = [begin for begin, _, _ in solution.phases][1:]
    np.testing.assert_allclose(falls, np.sqrt(2 * np.array(heights) / G), rtol=1e-12)
    assert not asked


def test_memory_of_many_phases_is_let_go_of(monkeypatch):
    """Three boxes come to rest by way of more sets of contacts than are kept; the run has the same bits."""
    solutions, kept = [], []
    for coordinates in (phase_scenes.KEPT_COORDINATES, 0):
        monkeypatch.setattr(phase_scenes, "KEPT_COORDINATES", coordinates)
        scene = stack(3)
        solutions.append(ts.simulate(scene, (0, 1.0), rtol=1e-10, atol=1e-10))
        kept.append(len(scene._phases))
    assert kept[1] <= phase_scenes.LEAST_PHASES < kept[0]
    one, other = solutions
    assert one.success
    assert other.success
    np.testing.assert_array_equal(one.q, other.q)
    np.testing.assert_array_equal(one.energy, other.energy)


def bouncing(e=1.0, balls=1):
    scene = ts.Scene(gravity=(0, 0, -G))
    for i in range(balls):
        ball = scene.add_point_mass(mass=1.0, position=(i, 0, 1 + 0.1 * i), velocity=(1, 0, 0), name=f"ball {i}")
        scene.add(C.PlaneContact(ball, scene.ground, **FLOOR, restitution=e, name=f"floor {i}"))
    return scene


def height(t, start):
    """Of a ball that bounces without loss from `start`, and its velocity."""
    fall = np.sqrt(2 * start / G)
    s = (t + fall) % (2 * fall) - fall
    return start - G / 2 * s**2, -G * s


METHODS = [None, ts.integrators.DOP853(1e-10, 1e-10), ts.integrators.RK45(1e-10, 1e-10)]
OTHERS = [ts.integrators.Nystrom4(step=2e-3), ts.integrators.Radau(1e-9, 1e-9)]


@pytest.mark.parametrize("method", [*METHODS, *(pytest.param(each, marks=pytest.mark.slow) for each in OTHERS)])
def test_outputs_between_and_at_many_impacts(method):
    """Times asked for, dense output on both sides of each impact, phases, and the rows of each step."""
    scene, end = bouncing(balls=2), 8.0
    fall = np.sqrt(2 / G)
    times = np.unique(np.concatenate((np.linspace(0, end, 101), fall * np.arange(1, 16, 2))))
    asked = ts.simulate(scene, (0, end), t_eval=times, integrator=method)
    np.testing.assert_array_equal(asked.t, times)
    solution = ts.simulate(scene, (0, end), dense_output=True, integrator=method)
    for i in range(2):
        z, zd = height(times, 1 + 0.1 * i)
        away = np.abs(np.abs(zd) - np.sqrt(2 * G * (1 + 0.1 * i))) > 1e-6  # velocities jump at impacts
        for found in (asked, solution.at(times)):
            np.testing.assert_allclose(found.position(f"ball {i}")[:, 2], z, atol=1e-9)
            np.testing.assert_allclose(found.velocity(f"ball {i}")[away, 2], zd[away], atol=1e-8)
        mine = np.array([t for t, name, _ in solution.impulses if name == f"floor {i}"])
        exact = np.sqrt(2 * (1 + 0.1 * i) / G) * np.arange(1, 2 * mine.size, 2)
        np.testing.assert_allclose(mine, exact, atol=1e-9)
        later, before = (solution.at(t).velocity(f"ball {i}")[:, 2] for t in (mine, np.nextafter(mine, 0.0)))
        np.testing.assert_allclose(later, -before, atol=1e-8)
    starts = np.array([start for start, *_ in solution.phases])
    np.testing.assert_array_equal(starts[1:], sorted(t for t, *_ in solution.impulses))
    # Every impact has a row before it and one after it
    for t in starts[1:]:
        assert (solution.t == t).sum() == 2
    assert np.ptp(solution.energy) < 1e-8


def test_events_of_a_user_across_many_impacts():
    """The top of each flight, beside impacts that the run goes on from; a count of them ends the run."""

    def top(t, state):
        return state.velocity("ball 0")[2]

    top.direction = -1
    fall = np.sqrt(2 / G)
    solution = ts.simulate(bouncing(), (0, 9.0), events=top)
    np.testing.assert_allclose(solution.t_events[0], 2 * fall * np.arange(solution.t_events[0].size), atol=1e-12)
    assert solution.t_events[0].size == 10
    top.terminal = 6
    ended = ts.simulate(bouncing(), (0, 9.0), events=top)
    assert ended.status is ts.Status.EVENT
    assert abs(ended.reached - 10 * fall) < 1e-12
    assert len(ended.impulses) == 5


def test_limits_of_steps_and_progress_across_impacts():
    seen = []
    solution = ts.simulate(bouncing(), (0, 9.0), max_steps=5, progress=lambda fraction, *_: seen.append(fraction))
    assert solution.status is ts.Status.MAX_STEPS
    assert solution.stats.steps == 5
    assert 0.0 < solution.reached < 9.0


def test_the_same_numbers_in_a_second_run_and_after_others():
    """A run that goes on in its memory leaves nothing behind for the next one."""
    scene = bouncing(0.7, balls=3)
    first = ts.simulate(scene, (0, 3.0), dense_output=True)
    ts.simulate(scene, (0, 1.0), t_eval=[0.5])
    again = ts.simulate(scene, (0, 3.0), dense_output=True)
    np.testing.assert_array_equal(first.t, again.t)
    np.testing.assert_array_equal(first.q, again.q)
    assert first.impulses == again.impulses
    assert first.phases == again.phases


def test_a_step_over_many_contacts_finds_the_first():
    """Gaps that close within one step, in any order; ties are one event."""
    scene = ts.Scene(gravity=(0, 0, -G))
    heights = np.array([1.0, 0.3, 0.7, 0.3, 0.9, 0.5, 0.300001, 2.0])
    for i, z in enumerate(heights):
        ball = scene.add_point_mass(mass=1.0, position=(i, 0, z), name=f"ball {i}")
        scene.add(C.PlaneContact(ball, scene.ground, **FLOOR, name=f"floor {i}"))
    solution = ts.simulate(scene, (0, 2.0))
    times = {name: t for t, name, _ in solution.impulses}
    np.testing.assert_allclose([times[f"floor {i}"] for i in range(8)], np.sqrt(2 * heights / G), rtol=4 * EPS)
    assert times["floor 1"] == times["floor 3"]
    assert len(solution.phases) == 8


def test_a_stop_of_a_linkage_with_redundant_joints():
    """A planar loop in space: one degree of freedom, so that an impact leaves e^2 of the kinetic energy."""
    scene = ts.Scene(gravity=(4.0, 0, -G))
    points = [np.array(p, float) for p in ((0, 0, 0), (0, 0, 1), (2, 0, 1.5), (2, 0, 0))]
    links = [
        scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(points[i] + points[i + 1]) / 2) for i in range(3)
    ]
    ends = [scene.ground, *links, scene.ground]
    hinges = [scene.add(C.Revolute.at(ends[i], ends[i + 1], point=points[i], axis=(0, 1, 0))) for i in range(4)]
    scene.add(C.Stop(hinges[0], lower=-0.4, upper=0.6, restitution=0.5, name="stop"))
    solution = ts.simulate(scene, (0, 1.0))
    t, name, impulse = solution.impulses[0]
    (at,) = np.nonzero(solution.t == t)
    before, after = solution.kinetic_energy[at]
    rates = solution.angle_rate(hinges[0])[at]
    assert name == "stop"
    assert abs(after / before - 0.25) < 1e-12
    assert abs(rates[1] + 0.5 * rates[0]) < 1e-12
    # Impulse times the mean of the rates is the energy lost
    assert abs(impulse * rates.mean() - (before - after)) < 1e-11
    again, _ = ts.impact(scene, ts.State(0.0, *scene.start), ["stop"])
    np.testing.assert_array_equal(again.qd, 0.0)


def test_a_contact_that_the_start_takes_below_zero_closes():
    """A lever on a contact near its hinge carries a rod at its end: 3e-10 m there are 2e-9 m at the rod's contact."""
    scene = ts.Scene(gravity=(0, 0, -G))
    for name, mass in (("lever", 10.0), ("rod", 1.0)):
        inertia = (0.01, mass / 12, mass / 12)
        scene.add_body(mass=mass, inertia=inertia, position=(0.5, 0, 0), name=name)
    scene.add(C.Revolute.at(scene.ground, scene["lever"], point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(C.Revolute.at(scene["lever"], scene["rod"], point=(1, 0, 0), axis=(0, 1, 0)))
    for body, x, gap in (("lever", 0.1, 3e-10), ("rod", 0.8, 1.2e-9)):
        at = {"point_a": (x - 0.5, 0, 0), "point_b": (0, 0, -gap), "name": f"below {body}"}
        scene.add(C.PlaneContact(scene[body], scene.ground, **at, **FLOOR))
    solution = ts.simulate(scene, (0, 0.1)).raise_if_failed()
    assert np.abs(solution.qd).max() < 1e-12
    # Moments about the hinges
    np.testing.assert_allclose(solution.reaction("below rod")[0][-1], [0, 0, G * 0.5 / 0.2], rtol=1e-7)
    up = (10.0 * G * 0.5 - (0.5 / 0.2 - 1.0) * G) / 0.1
    np.testing.assert_allclose(solution.reaction("below lever")[0][-1], [0, 0, up], rtol=1e-7)
