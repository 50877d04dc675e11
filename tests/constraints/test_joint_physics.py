"""Joints against the same mechanisms in minimal coordinates: what moves, how it moves, and what the joints carry."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers import minimal_coordinates as minimal
from tests.helpers.minimal_coordinates import JOINTS, balance, build, motion, moves, place, random_link
from tests.helpers.tolerances import CLOSE, EPS, FAIR, HELD, NEAR

C = ts.constraints
GRAVITY = np.array([1.0, -2.0, -9.81])
COMPOSED = [kind for kind in JOINTS if kind != "Spherical"]
TIMES = np.linspace(0.0, 0.5, 26)
# which joints mean the same with their bodies the other way
SYMMETRIC = ("Revolute", "Cylindrical", "Screw", "Translational", "Fixed", "Planar", "Parallel")


def links_of(rng, *kinds):
    return [random_link(rng, kind) for kind in kinds]


def start(rng, links):
    n = len(moves(links))
    return 0.5 * rng.normal(size=n), rng.normal(size=n)


@pytest.mark.parametrize("swapped", [(), (0, 1)], ids=["as they are", "bodies swapped"])
@pytest.mark.parametrize("kind", COMPOSED)
def test_a_joint_allows_its_motions_and_no_other(kind, swapped, rng):
    """Relative coordinates at random leave Phi and its rate zero; the rank of Phi_q says that nothing else is free."""
    if swapped and kind not in SYMMETRIC:
        pytest.skip("what is on a and on b is not the same")
    links = links_of(rng, kind, kind)
    scene, joints = build(links, GRAVITY, swapped)
    free = len(JOINTS[kind][0])
    for _ in range(5):
        x, xd = 3.0 * rng.normal(size=(2, 2 * free))
        place(scene, links, x, xd)
        q, qd = scene.start
        found = scene.evaluate()
        assert np.abs(found.Phi).max() < 20 * EPS * (1.0 + np.abs(q).max())
        assert np.abs(found.Phi_q @ qd).max() < 50 * EPS * (1.0 + np.abs(qd).max()) * (1.0 + np.abs(q).max())
        assert [joint.rows for joint in joints] == [6 - free] * 2
        values = np.linalg.svd(found.Phi_q, compute_uv=False)
        assert len(values) == 14 - 2 * free
        assert values[-1] > 1e-3 * values[0]


@pytest.mark.slow_but("*'Universal', 'Cylindrical'*", "*'Screw', 'Revolute'*")
@pytest.mark.parametrize("kinds", [(k, "Revolute") for k in COMPOSED] + [("Universal", k) for k in COMPOSED], ids=str)
def test_motion_and_reactions_are_those_of_minimal_coordinates(kinds, rng):
    links = links_of(rng, *kinds)
    scene, joints = build(links, GRAVITY)
    x, xd = start(rng, links)
    place(scene, links, x, xd)
    solution = ts.simulate(scene, (0.0, TIMES[-1]), t_eval=TIMES).raise_if_failed()
    demand_same(solution, links, joints, motion(links, x, xd, TIMES, GRAVITY))


def demand_same(solution, links, joints, coordinates):
    scene = solution.scene
    assert solution.method.startswith("Taylor")
    for k, state in enumerate(zip(*coordinates, strict=True)):
        found = minimal.poses(links, *state)
        loads = minimal.reactions(links, *state, GRAVITY)
        for link, pose, body, joint, (force, torque) in zip(links, found, scene.bodies, joints, loads, strict=True):
            A = solution.rotation(body)[k]
            np.testing.assert_allclose(solution.position(body)[k], pose.r, atol=CLOSE)
            np.testing.assert_allclose(A, pose.A @ link.turn, atol=CLOSE)
            np.testing.assert_allclose(solution.velocity(body)[k], pose.v, atol=NEAR)
            np.testing.assert_allclose(A @ solution.angular_velocity(body)[k], pose.w, atol=NEAR)
            given_force, given_torque = (part[k] for part in solution.reaction(joint, on=body))
            own = getattr(joint, "point_b", np.zeros(3))  # the torque is about the joint's point of this body
            about = solution.position(body)[k] + A @ own
            np.testing.assert_allclose(given_force, force, atol=FAIR)
            np.testing.assert_allclose(given_torque, torque - np.cross(about - pose.point, force), atol=FAIR)


def everything(rng):
    """A chain with every joint that there is."""
    links = links_of(rng, *COMPOSED, "Spherical")
    scene, _ = build(links, GRAVITY)
    place(scene, links, *start(rng, links))
    return scene


RUNS = {
    "taylor": {"rtol": 1e-10, "atol": 1e-10},
    "dop853": {"integrator": "dop853", "rtol": 1e-10, "atol": 1e-10},
    "null-space": {"integrator": "dop853", "rtol": 1e-10, "atol": 1e-10, "formulation": "null-space"},
    "sdirk54": {"integrator": "sdirk54", "rtol": 1e-9, "atol": 1e-9},
}


@pytest.mark.slow_for("sdirk54")
@pytest.mark.parametrize("options", RUNS.values(), ids=RUNS)
def test_reactions_balance_newton_and_euler(options, rng):
    """To rounding; to its tolerance for an implicit method, which interpolates its stages' accelerations."""
    solution = ts.simulate(everything(rng), (0.0, 0.3), t_eval=np.linspace(0.0, 0.3, 7), **options).raise_if_failed()
    assert balance(solution) < (options["rtol"] if options.get("integrator") == "sdirk54" else 2e3 * EPS)
    error = solution.constraint_error
    assert error.position.max() < 200 * EPS * (1.0 + np.abs(solution.q).max())
    assert error.velocity.max() < 2e3 * EPS * (1.0 + np.abs(solution.qd).max())
    assert error.acceleration.max() < 2e4 * EPS * (1.0 + np.abs(solution.qdd).max())


@pytest.mark.slow
def test_all_methods_agree(rng):
    scene = everything(rng)
    ends = [ts.simulate(scene, (0.0, 0.3), **options).raise_if_failed().q[-1] for options in RUNS.values()]
    for end in ends[1:]:
        np.testing.assert_allclose(end, ends[0], atol=FAIR)


@pytest.mark.parametrize("kind", COMPOSED)
def test_both_forms_agree_to_rounding(kind, rng):
    """The same steps, with a basis and without."""
    links = links_of(rng, kind, "Spherical")
    scene, _ = build(links, GRAVITY)
    place(scene, links, *start(rng, links))
    one, other = (
        ts.simulate(scene, (0.0, 0.1), integrator=ts.integrators.DOP853(step=2e-3), formulation=form).raise_if_failed()
        for form in ("tangent", "null-space")
    )
    np.testing.assert_allclose(one.q, other.q, atol=1e3 * EPS * (1.0 + np.abs(one.q).max()))


@pytest.mark.parametrize("kind", COMPOSED)
def test_what_acts_on_b_is_the_opposite_of_what_acts_on_a(kind, rng):
    links = links_of(rng, "Spherical", kind)
    scene, (_, joint) = build(links, GRAVITY)
    place(scene, links, *start(rng, links))
    solution = ts.simulate(scene, (0.0, 0.2), rtol=1e-8, atol=1e-8).raise_if_failed()
    total_force, total_torque = np.zeros(3), np.zeros(3)
    for body, letter in ((joint.a, "a"), (joint.b, "b")):
        force, torque = solution.reaction(joint, on=body)
        point = solution.position(body) + solution.rotation(body) @ getattr(joint, f"point_{letter}", np.zeros(3))
        total_force = total_force + force
        total_torque = total_torque + torque + np.cross(point, force)
    tolerance = 1e3 * EPS * (1.0 + np.abs(force).max() + np.abs(torque).max())
    np.testing.assert_allclose(total_force, 0.0, atol=tolerance)
    np.testing.assert_allclose(total_torque, 0.0, atol=tolerance * (1.0 + np.abs(solution.q).max()))
    default = solution.reaction(joint)
    np.testing.assert_array_equal(default, solution.reaction(joint, on=joint.on))


def test_the_parts_reactions_add_up_to_the_joints(rng):
    links = links_of(rng, "Spherical", "Translational")
    scene, (_, joint) = build(links, GRAVITY)
    place(scene, links, *start(rng, links))
    solution = ts.simulate(scene, (0.0, 0.1)).raise_if_failed()
    force, _ = solution.reaction(joint, on=joint.b)
    pieces = [solution.reaction(part, on=joint.b) for part in joint.parts]
    np.testing.assert_allclose(sum(f for f, _ in pieces), force, atol=1e3 * EPS * (1.0 + np.abs(force).max()))
    assert solution.multipliers[:, solution.rows(joint)].shape == (len(solution.t), 5)
    rows = [solution.rows(part) for part in joint.parts]
    assert rows[0].start == solution.rows(joint).start == 3
    assert rows[-1].stop == solution.rows(joint).stop == 8


@pytest.mark.parametrize("bend", [0.2, 0.6, 1.0])
def test_hookes_ratio_of_speeds(bend):
    """w2 / w1 = cos(bend) / (1 - sin(bend)^2 sin(theta)^2), theta from where the driving arm is across both shafts."""
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    line = np.array([np.cos(bend), np.sin(bend), 0.0])
    driving = scene.add_body(1.0, (0.01, 0.02, 0.02), position=(-0.3, 0, 0), angular_velocity=(5, 0, 0))
    turn = (np.cos(bend / 2), 0.0, 0.0, np.sin(bend / 2))
    driven = scene.add_body(1.0, (0.01, 0.02, 0.02), position=0.3 * line, orientation=turn)
    scene.add(C.Revolute.at(driving, scene.ground, point=(-0.3, 0, 0), axis=(1, 0, 0)))
    cross = scene.add(C.Universal.at(driving, driven, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(C.PointOnLine.at(driven, scene.ground, point=0.5 * line, axis=line))
    np.testing.assert_allclose(np.abs(cross.axis_b), (0, 1, 0), atol=EPS)  # across the driven shaft
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 3.0)).raise_if_failed()
    w1, w2 = (solution.angular_velocity(body)[:, 0] for body in (driving, driven))
    cosine = solution.rotation(driving)[:, 2, 2]
    ratio = np.cos(bend) / (1.0 - np.sin(bend) ** 2 * (1.0 - cosine**2))
    np.testing.assert_allclose(w2 / w1, ratio, atol=HELD)
    assert np.abs(cosine).min() < 0.3  # it has turned
