"""Loads that jump while friction sticks or a contact is closed: the phase ends at the jump, as in closed form."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.resuming import Stop
from tests.helpers.tolerances import TIGHT
from tsdyn.runs import driver

C, F = ts.constraints, ts.forces
G = 9.81


def table(times, values, way):
    """A load that is constant from each time on, along a direction."""
    times, values = [*np.repeat(times, 2)[1:], 99.0], np.repeat(values, 2)
    return ts.Table(times, np.outer(values, way), kind="linear")


def block(kind):
    """2 kg that slide along x, or are held by half of their weight; kinetic friction is 0.3 of it."""
    scene = ts.Scene()
    if kind == "guide":
        body = scene.add_body(2.0, (1, 1, 1), name="block")
        guide = scene.add(C.Translational.at(scene.ground, body, point=(0, 0, 0), axis=(1, 0, 0)))
        scene.add(F.TranslationalFriction(guide, kinetic=0.3, static=0.5, name="rub"))
        return scene
    body = scene.add_point_mass(2.0, name="block")
    law = {"unilateral": True, "kinetic": 0.3, "static": 0.5} if kind == "contact" else {}
    floor = scene.add(C.PlaneContact(body, scene.ground, normal_b=(0, 0, 1), **law, name="rub" if law else "floor"))
    if kind == "plane":
        scene.add(F.ContactFriction(floor, kinetic=0.3, static=0.5, name="rub"))
    elif kind == "given":
        scene.add(F.CoulombFriction(body, scene.ground, force=0.6 * G, static_force=1.0 * G, name="rub"))
    return scene


KINDS = ["guide", "plane", "contact", "given"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_load_that_jumps_over_the_bound_moves_a_block(kind):
    """0.4, 0.7, 0.2 and -0.6 of the weight for a second each; after the first one the block slides all the time."""
    scene = block(kind)
    scene.add(
        F.PointForce(scene["block"], force=table([0, 1, 2, 3], 2.0 * G * np.array([0.4, 0.7, 0.2, -0.6]), (1, 0, 0)))
    )
    solution = ts.simulate(scene, (0, 4), dense_output=True)
    turn = 3.0 + 0.3 / 0.9  # 0.3 g at 3 s, -0.9 g from there on
    x = np.array([0.0, 0.2, 0.2 + 0.4 - 0.05, 0.55 + 0.05, 0.6 - 0.15 * (4.0 - turn) ** 2]) * G
    np.testing.assert_allclose(solution.at([1.0, 2.0, 3.0, turn, 4.0]).position("block")[:, 0], x, atol=TIGHT)
    assert solution.sticking("rub")[solution.t < 1.0].all()
    assert not solution.sticking("rub")[solution.t > 1.0].any()


@pytest.mark.parametrize("kind", KINDS)
def test_short_pulses_move_a_block(kind):
    """A millisecond of 20 times the weight, to and fro, found whatever the steps: it rests in between."""
    scene, start = block(kind), np.arange(0.5, 2.5, 0.5)
    times, loads = np.column_stack([start, start + 1e-3]).ravel(), 40.0 * G * np.array([1, 0, -1, 0] * 2)
    scene.add(F.PointForce(scene["block"], force=table([0.0, *times], [0.0, *loads], (1, 0, 0))))
    solution = ts.simulate(scene, (0, 2.5), dense_output=True)
    speed = 19.7 * G * 1e-3
    way = 0.5 * speed * 1e-3 + speed**2 / (0.6 * G)
    found = solution.at([0.4, 0.9, 1.4, 1.9, 2.4]).position("block")[:, 0]
    np.testing.assert_allclose(found, [0.0, way, 0.0, way, 0.0], atol=TIGHT)
    assert len(solution.phases) == 9


@pytest.mark.parametrize("kind", KINDS)
def test_a_load_that_stays_at_the_bound_holds_a_block(kind):
    """Up to the bound, along it, and beyond: it slides from the last knot on."""
    scene = block(kind)
    loads = 2.0 * G * np.outer([0.0, 0.5, 0.5, 0.9], (1, 0, 0))
    scene.add(F.PointForce(scene["block"], force=ts.Table([0, 1, 2, 3], loads, kind="linear")))
    solution = ts.simulate(scene, (0, 3))
    assert solution.position("block")[-1, 0] == pytest.approx((0.1 + 0.4 / 6.0) * G, abs=TIGHT)
    assert [start for start, *_ in solution.phases] == [0.0, pytest.approx(2.0, abs=TIGHT)]


@pytest.mark.parametrize("friction", [{}, {"kinetic": 0.3}], ids=str)
def test_a_load_that_jumps_lifts_a_body(friction):
    """Twice the weight for half a second: up with g, then thrown."""
    scene = ts.Scene()
    body = scene.add_point_mass(2.0, name="body")
    scene.add(C.PlaneContact(body, scene.ground, normal_b=(0, 0, 1), unilateral=True, **friction, name="floor"))
    scene.add(F.PointForce(body, force=table([0.0, 1.0, 1.5], [0.0, 4.0 * G, 0.0], (0, 0, 1))))
    solution = ts.simulate(scene, (0, 4), dense_output=True)
    land = 1.5 + 0.5 * (1.0 + np.sqrt(2.0))
    assert [start for start, *_ in solution.phases] == [0.0, 1.0, pytest.approx(land, abs=TIGHT)]
    assert solution.at(1.25).position(body)[2] == pytest.approx(0.5 * G * 0.25**2, abs=TIGHT)


def pushed(load, way, **law):
    """A point mass of 1 kg on a floor, under a load that jumps at 0.1 s between two values along `way`."""
    (before, after), scene = load[1:], ts.Scene()
    body = scene.add_point_mass(1.0, name="body")
    scene.add(C.PlaneContact(body, scene.ground, normal_b=(0, 0, 1), unilateral=True, name="floor", **law))
    if load[0] == "table":
        scene.add(F.PointForce(body, force=table([0.0, 0.1], [before, after], way), name="load"))
    else:
        law = lambda t, state: before if t < 0.1 else after  # noqa: E731
        scene.add(F.Control(law, [F.PointForce(body, force=way)], period=0.05, name="load"))
    return scene


def sides(array, solution):
    """What outputs say on both sides of 0.1 s."""
    return array[np.isclose(solution.t, 0.1, rtol=0.0, atol=1e-12)]


@pytest.mark.parametrize("kind", ["sampled", "table"])
@pytest.mark.parametrize("method", ["taylor", "dop853", "radau"])
def test_outputs_on_both_sides_of_a_jump_that_opens_a_contact(kind, method):
    """5 N down, then 30 N up: the floor exerts m g + 5 N up to the jump, in outputs and in between."""
    scene = pushed((kind, -5.0, 30.0), (0, 0, 1))
    solution = ts.simulate(scene, (0, 0.2), integrator=method, dense_output=True)
    forces = sides(solution.reaction("floor")[0][:, 2], solution)
    np.testing.assert_allclose(forces, [5.0 + G, 0.0], atol=TIGHT)
    np.testing.assert_allclose(sides(solution.qdd[:, 2], solution), [0.0, 30.0 - G], atol=TIGHT)
    between = solution.at([np.nextafter(0.1, 0.0), 0.1]).reaction("floor")[0][:, 2]
    np.testing.assert_allclose(between, [5.0 + G, 0.0], atol=TIGHT)


@pytest.mark.parametrize("kind", ["sampled", "table"])
def test_outputs_on_both_sides_of_a_jump_that_ends_sticking(kind):
    """1 N along the floor, then 9 N, of 9.81 N: friction of 1 N, then 0.3 of the weight."""
    scene = pushed((kind, 1.0, 9.0), (1, 0, 0), kinetic=0.3)
    solution = ts.simulate(scene, (0, 0.2))
    np.testing.assert_allclose(sides(solution.reaction("floor")[0][:, 0], solution), [-1.0, -0.3 * G], atol=TIGHT)
    np.testing.assert_allclose(sides(solution.friction_demand("floor"), solution), [1.0 / G, 0.3], atol=TIGHT)
    np.testing.assert_allclose(sides(solution.qdd[:, 0], solution), [0.0, 9.0 - 0.3 * G], atol=TIGHT)
    assert sides(solution.sticking("floor"), solution).tolist() == [True, False]


@pytest.mark.parametrize("kind", ["sampled", "table"])
def test_both_sides_of_a_jump_in_a_store(kind, tmp_path, monkeypatch):
    """Of a run that was stopped at steps up to the jump, and goes on."""
    scene, runs = pushed((kind, -5.0, 30.0), (0, 0, 1), kinetic=0.3), []
    monkeypatch.setattr(driver, "FIRST_SLICE", 1)
    for stop in (2, 3, 4):
        path = tmp_path / f"{stop}.h5"
        given = {"integrator": "dop853", "store": path, "checkpoint": 0.0}
        assert ts.simulate(scene, (0, 0.2), progress=Stop(stop), **given).status is ts.Status.INTERRUPTED
        runs += [ts.resume(path, scene), ts.load(path, scene)]
    for solution in runs:
        assert solution.success
        forces = sides(solution.reaction("floor")[0][:, 2], solution)
        np.testing.assert_allclose(forces, [5.0 + G, 0.0], atol=TIGHT)
        load = solution.reaction("load", "body")[0][:, 2] if kind == "table" else solution.actuation("load")[:, 0]
        np.testing.assert_allclose(sides(load, solution), [-5.0, 30.0], atol=TIGHT)


@pytest.mark.parametrize("kind", ["sampled", "table"])
def test_both_sides_of_a_jump_with_an_action_there(kind):
    """The action takes friction away; the contact opens at once."""
    scene = pushed((kind, -5.0, 30.0), (0, 0, 1), kinetic=0.3)

    def reach(t, state):
        return t - 0.1

    reach.action = lambda change: change.set("floor.kinetic", 0.1)
    solution = ts.simulate(scene, (0, 0.2), events=reach)
    np.testing.assert_allclose(sides(solution.reaction("floor")[0][:, 2], solution), [5.0 + G, 0.0], atol=TIGHT)
    assert solution.position("body")[-1, 2] == pytest.approx(0.5 * (30.0 - G) * 0.1**2, abs=TIGHT)


@pytest.mark.parametrize("kind", ["sampled", "table"])
def test_a_load_that_lifts_a_body_from_the_start(kind):
    solution = ts.simulate(pushed((kind, 30.0, 30.0), (0, 0, 1)), (0, 0.2))
    assert solution.position("body")[-1, 2] == pytest.approx(0.5 * (30.0 - G) * 0.2**2, abs=TIGHT)
    assert solution.phases == [(0.0, 0.2, ())]
