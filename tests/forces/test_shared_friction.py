"""Exact frictions that hold one body at rest: how they share its load, and where it begins to slide."""

import pickle

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts

C, F, G = ts.constraints, ts.forces, 9.81
ENDS = np.array(((0.5, 0.0, 0.0), (-0.5, 0.0, 0.0)))


def growing(direction):
    """A force or torque (3,) that grows by `direction` a second."""
    return [float(x) * ts.motions.time for x in direction]


def plate(points, direction, place=(0, 0, 0), kinetic=0.5, static=None, unilateral=False, rough=None):
    """A body of 1 kg on points of a floor, the first ones rough, pulled at a place by a force that grows, N/s."""
    scene, count = ts.Scene(gravity=(0, 0, -G)), len(points) if rough is None else rough
    body = scene.add_body(1.0, (0.1, 0.1, 0.1), name="body")
    for k, point in enumerate(points):
        law = {"kinetic": np.broadcast_to(kinetic, count)[k]} if k < count else {}
        if law and static is not None:
            law["static"] = np.broadcast_to(static, count)[k]
        mark = {"point_a": point, "normal_b": (0, 0, 1), "name": f"contact{k}"}
        if unilateral:
            scene.add(C.PlaneContact(body, scene.ground, **mark, unilateral=True, **law))
        else:
            contact = scene.add(C.PlaneContact(body, scene.ground, **mark))
            if law:
                scene.add(F.ContactFriction(contact, **law, name=f"friction{k}"))
    scene.add(F.PointForce(body, point_a=place, force=growing(direction)))
    return scene


def rod(direction, place=(0, 0, 0), flip=False, **given):
    """On two rough ends, whose friction alone moves it, and a smooth point beside it."""
    return plate([*(ENDS[::-1] if flip else ENDS), (0, 0.5, 0)], direction, place, rough=2, **given)


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0.6, 0.8, 0), (-0.8, 0.6, 0)])
def test_a_rod_pushed_at_its_centre_slides_where_all_friction_is_used(direction, flip):
    solution = ts.simulate(rod(direction, flip=flip), (0, 6), t_eval=np.linspace(0, 6, 31))
    (_, begin, _), (_, end, names) = solution.phases
    assert abs(begin - 0.5 * G) < 1e-11
    assert (end, names) == (6.0, ())
    # v = (t^2 - begin^2) / 2 - begin (t - begin) = (t - begin)^2 / 2
    np.testing.assert_allclose(solution.velocity("body")[-1], 0.5 * (6 - begin) ** 2 * np.array(direction), atol=1e-8)
    rest = solution.t < begin
    for k in range(2):
        load = -0.5 * solution.t[rest, None] * direction
        np.testing.assert_allclose(solution.reaction(f"friction{k}")[0][rest], load, atol=1e-12)


@pytest.mark.parametrize("flip", [False, True])
def test_a_rod_pulled_at_its_end_slips_there_and_goes_on_as_on_unilateral_contacts(flip):
    """The pulled end alone holds what acts across the rod: 0.8 F = mu m g / 2; the other one takes what is along it."""
    pulled = (0.6, 0.8, 0), (0.5, 0, 0)
    solution = ts.simulate(rod(*pulled, flip=flip), (0, 4), rtol=1e-10, atol=1e-12)
    assert abs(solution.phases[0][1] - 0.25 * G / 0.8) < 1e-11
    rest = solution.t < solution.phases[0][1]
    for k in range(2):
        assert np.linalg.norm(solution.reaction(f"friction{k}")[0][rest], axis=1).max() <= 0.25 * G * (1 + 1e-9)
    other = ts.simulate(rod(*pulled, unilateral=True), (0, 4), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(
        [begin for begin, *_ in solution.phases], [begin for begin, *_ in other.phases], atol=1e-9
    )
    np.testing.assert_allclose(solution.q[-1], other.q[-1], atol=1e-8)


@pytest.mark.parametrize("static", [None, 0.8])
def test_a_plate_on_three_rough_points_slides_where_all_friction_is_used(static):
    points, mu = ((0.5, 0, 0), (-0.5, 0.3, 0), (-0.2, -0.6, 0)), static or 0.5
    solution = ts.simulate(plate(points, (0.6, 0.8, 0), static=static), (0, 9))
    begin = mu * G
    assert abs(solution.phases[0][1] - begin) < 1e-11
    speed = (9**2 - begin**2) / 2 - 0.5 * G * (9 - begin)
    np.testing.assert_allclose(solution.velocity("body")[-1], [0.6 * speed, 0.8 * speed, 0], atol=1e-7)


@pytest.mark.parametrize(
    ("points", "direction", "place", "kinetic", "static"),
    [
        # One sliding end turns the direction in which the other begins to slide from that of its load
        (((0.3, 0.6), (-0.7, 0.1), (0.4, -0.6)), (0.5, -0.9), (0.6, 0.3), (0.4, 0.3), (0.5, 0.5)),
        # Three slips begin together, with directions that turn
        (((0.5, 0.1), (-0.4, 0.6), (-0.3, -0.5)), (0.8, 0.6), (0.4, -0.7), (0.3, 0.6, 0.45), (0.3, 0.6, 0.45)),
        (((0.5, 0.1), (-0.4, 0.6), (-0.3, -0.5)), (-0.2, 1.0), (-0.7, 0.2), (0.3, 0.6, 0.45), (0.4, 0.6, 0.6)),
        # One slip ends slowly, turning, after it has been fast
        (((0.5, -0.47), (0.06, 0.49), (-0.78, -0.37)), (-0.93, 0.38), (0.09, -0.37), (0.76, 0.49), (0.87, 0.53)),
    ],
)
def test_slips_that_begin_in_several_directions_are_those_of_unilateral_contacts(
    points, direction, place, kinetic, static
):
    runs = []
    for unilateral in (False, True):
        law = {"kinetic": kinetic, "static": static, "rough": len(kinetic), "unilateral": unilateral}
        scene = plate([(*point, 0) for point in points], (*direction, 0), (*place, 0), **law)
        runs.append(ts.simulate(scene, (0, 5), rtol=1e-10, atol=1e-12))
    first, other = runs
    assert first.phases[0][1] < 4.5
    assert abs(first.phases[0][1] - other.phases[0][1]) < 1e-10
    assert np.abs(other.q[-1]).max() > 1e-2
    np.testing.assert_allclose(first.q[-1], other.q[-1], atol=1e-7)


@pytest.mark.parametrize("torques", [(1.0, 1.0), (2.0, 1.0), (0.5, 1.0, 1.5)])
def test_frictions_of_one_hinge_add_up(torques):
    scene, axis = ts.Scene(gravity=(0, 0, 0)), np.array((1, 2, 2)) / 3
    door = scene.add_body(1.0, (0.1, 0.1, 0.1), name="door")
    scene.add(C.Revolute.at(scene.ground, door, point=(0, 0, 0), axis=axis))
    frictions = [scene.add(F.CoulombFriction(scene.ground, door, torque=torque)) for torque in torques]
    scene.add(F.Torque(door, torque=growing(axis)))
    solution = ts.simulate(scene, (0, 4), t_eval=np.linspace(0, 4, 9))
    assert abs(solution.phases[0][1] - sum(torques)) < 1e-12
    for friction, torque in zip(frictions, torques, strict=True):
        assert solution.sticking(friction)[1]
        # A share in proportion to what it can hold
        expected = -solution.t[1] * torque / sum(torques) * axis
        np.testing.assert_allclose(solution.reaction(friction, on=door)[1][1], expected, atol=1e-12)


def linkage(torques):
    """A parallelogram of bars of 1 and 2 m: its crank, coupler, rocker and four frictions; torque t on the crank."""
    scene, up = ts.Scene(gravity=(0, 0, 0)), np.array((np.cos(0.7), np.sin(0.7), 0))
    turned = Rotation.from_euler("z", 0.7)
    law = 1.0, (0.1, 0.1, 0.1)
    crank = scene.add_body(*law, position=up / 2, orientation=turned, name="crank")
    coupler = scene.add_body(*law, position=up + np.eye(3)[0], name="coupler")
    rocker = scene.add_body(*law, position=up / 2 + (2, 0, 0), orientation=turned, name="rocker")
    scene.add(C.Revolute.at(scene.ground, crank, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(C.Revolute.at(crank, coupler, point=up, axis=(0, 0, 1)))
    scene.add(C.Spherical.at(coupler, rocker, point=up + 2 * np.eye(3)[0]))
    scene.add(C.Cylindrical.at(scene.ground, rocker, point=(2, 0, 0), axis=(0, 0, 1)))
    pairs = (scene.ground, crank), (crank, coupler), (coupler, rocker), (scene.ground, rocker)
    for k, (pair, torque) in enumerate(zip(pairs, torques, strict=True)):
        scene.add(F.CoulombFriction(*pair, torque=torque, name=f"friction{k}"))
    scene.add(F.Torque(crank, torque=growing((0, 0, 1))))
    return scene


TORQUES = 1.0, 2.0, 0.5, 1.0


def test_a_linkage_moves_where_the_power_of_its_frictions_is_reached():
    """All joints of a parallelogram turn at the rate of the crank."""
    solution = ts.simulate(linkage(TORQUES), (0, 5))
    assert abs(solution.phases[0][1] - sum(TORQUES)) < 1e-11
    assert not any(solution.sticking(f"friction{k}")[-1] for k in range(4))


def test_reactions_at_rest_are_shared_in_every_record(tmp_path):
    """Frictions in proportion to their bounds; those of the joints balance them on each body."""
    scene, signs = linkage(TORQUES), (-1, -1, 1, -1)
    solution = ts.simulate(scene, (0, 4), t_eval=np.linspace(0, 4, 9), dense_output=True)
    solution.save(tmp_path / "run.h5")
    records = [solution, ts.load(tmp_path / "run.h5"), pickle.loads(pickle.dumps(solution))]
    for record in records:
        for k, (torque, sign) in enumerate(zip(TORQUES, signs, strict=True)):
            expected = sign * solution.t * torque / sum(TORQUES)
            np.testing.assert_allclose(record.reaction(f"friction{k}")[1][:, 2], expected, atol=1e-12)
    for body in scene.bodies:
        if body.dimension:
            items = [item for item in (*scene.constraints, *scene.forces) if body in (item.a, item.b)]
            loads = [solution.reaction(item, on=body)[0] for item in items]
            np.testing.assert_allclose(np.sum(loads, axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(solution.at(2.0).reaction("friction1")[1][2], -2.0 * 2.0 / sum(TORQUES), atol=1e-12)


def test_a_run_goes_on_from_a_state_with_a_shared_load():
    state = ts.simulate(linkage(TORQUES), (0, 2)).state
    solution = ts.simulate(linkage(TORQUES), (2, 5), state=state)
    assert abs(solution.phases[0][1] - sum(TORQUES)) < 1e-11
