"""A solution is the record of its run: later changes of the scene neither change it nor break it."""

import copy

import numpy as np
import pytest

import tsdyn as ts
from tsdyn.graphics.run_data import run_data

C = ts.constraints
FLOOR = {"normal_b": (0, 0, 1), "unilateral": True, "restitution": 0.3, "name": "floor"}


def flier(**law):
    """A particle that falls on a floor, bounces, and comes to rest."""
    scene = ts.Scene()
    stone = scene.add_point_mass(1.0, position=(0, 0, 0.1), velocity=(0.2, 0.1, 0), name="stone")
    scene.add(C.PlaneContact(stone, scene.ground, **FLOOR, **law))
    return scene


def roller():
    """A ball that slides, and then rolls."""
    scene = ts.Scene()
    ball = scene.add_body(**ts.shapes.sphere(0.1, mass=1.0), position=(0, 0, 0.1), velocity=(0.2, 0, 0), name="stone")
    scene.add(C.SphereContact(ball, scene.ground, radius_a=0.1, normal_b=(0, 0, 1), kinetic=0.3, name="floor"))
    return scene


SCENES = {"smooth": flier, "rough": lambda: flier(kinetic=0.3, static=0.4), "roller": roller}


def rub(scene):
    scene["floor"].static, scene["floor"].kinetic = 0.9, 0.5


def smooth(scene):
    scene["floor"].kinetic, scene["floor"].static = 0.0, None


def bounce(scene):
    scene["floor"].restitution = 0.9


def hold(scene):
    smooth(scene)
    scene["floor"].restitution = 0.0
    if isinstance(scene["floor"], C.PlaneContact):
        scene["floor"].unilateral = False


def rename(scene):
    scene["floor"].name, scene["stone"].name = "street", "pebble"


def move_on(scene):
    other = scene.add_point_mass(2.0, position=(5, 0, 1), name="other")
    scene.add(C.PlaneContact(other, scene.ground, normal_b=(0, 0, 1), unilateral=True, kinetic=0.1, name="more"))
    scene["stone"].mass, scene.gravity = 7.0, (0, 0, -3)
    ts.simulate(scene, (0, 0.05))


def without(scene):
    scene.deactivate("floor")
    scene.remove("floor")


FEW = rub, hold, without
CHANGES = {"smooth": FEW, "rough": (*FEW, smooth, bounce, rename, move_on), "roller": FEW}


def record(solution):
    """What a solution says, as bytes."""
    force, torque = solution.reaction("floor")
    late = solution.at(0.45)
    found = [solution.multipliers, *solution.constraint_error, solution.energy, solution.dissipation, force, torque]
    found += [late.q, late.multipliers, late.reaction("floor")[0], solution.state.multipliers]
    found += [solution.to_dataframe(["stone.position.z", "floor.force"]).to_numpy()]
    if len(solution.multipliers[0]) > 2:
        found += [solution.sticking("floor"), solution.contact_point("floor"), solution.friction_demand("floor")]
    return solution.phases, solution.impulses, solution.provenance["scene"], [np.asarray(x).tobytes() for x in found]


@pytest.mark.parametrize(("name", "change"), [(name, change) for name in SCENES for change in CHANGES[name]])
def test_changes_of_the_scene_leave_a_solution_as_it_is(name, change, tmp_path):
    scene = SCENES[name]()
    options = {"t_eval": np.linspace(0.0, 0.5, 6), "dense_output": True}
    expected = record(ts.simulate(SCENES[name](), (0, 0.5), **options))
    solution = ts.simulate(scene, (0, 0.5), **options)
    change(scene)
    assert record(solution) == expected
    assert record(copy.deepcopy(solution)) == expected
    solution.save(tmp_path / "run.h5")
    assert record(ts.load(tmp_path / "run.h5", scene=SCENES[name]())) == expected


@pytest.mark.parametrize("law", [{"slip_velocity": 1e-3}, {"force": 0.5}, {"static_force": 6.0}])
def test_another_law_of_a_friction_leaves_a_solution_as_it_is(law):
    """A block of 2 kg at 1 m/s that 4 N brake rests after 0.5 s."""
    scene = ts.Scene(gravity=(0, 0, 0))
    block = scene.add_point_mass(2.0, velocity=(1, 0, 0), name="block")
    brake = scene.add(ts.forces.CoulombFriction(block, scene.ground, force=4.0, name="brake"))
    solution = ts.simulate(scene, (0, 1), t_eval=[0.25, 0.75], dense_output=True)
    for name, value in law.items():
        setattr(brake, name, value)
    for found in (solution, copy.deepcopy(solution)):
        assert found.sticking("brake").tolist() == [False, True]
        np.testing.assert_allclose(found.dissipation, [2.0, 0.0], rtol=1e-14)
        np.testing.assert_allclose(found.reaction("brake", on="block")[0][:, 0], [-4.0, 0.0], rtol=1e-14)
        np.testing.assert_allclose(found.at(0.25).reaction("brake", on="block")[0], [-4.0, 0, 0], rtol=1e-14)


def test_a_copy_knows_its_handles_in_every_phase():
    """Of a run with another mass in its second half; a bob of 1 kg, then of 3 kg, hangs at rest."""
    scene = ts.Scene(gravity=(0, 0, -10))
    bob = scene.add_point_mass(1.0, position=(0, 0, -1), name="bob")
    rod = scene.add(C.Distance(bob, scene.ground, name="rod"))
    event = lambda t, state: t - 0.5  # noqa: E731
    event.action = lambda change: change.set("bob.mass", 3.0)
    solution = ts.simulate(scene, (0, 1), t_eval=[0.25, 0.75], events=event)
    twin, own, there = copy.deepcopy((solution, rod, bob))
    for found, item, body in ((solution, rod, bob), (twin, own, there)):
        np.testing.assert_allclose(found.reaction(item, on=body)[0][:, 2], [10.0, 30.0], rtol=1e-12)


def test_the_viewer_shows_the_contacts_of_the_run():
    scene = flier(kinetic=0.3)
    solution = ts.simulate(scene, (0, 0.5))
    shown = run_data(solution)
    smooth(scene)
    assert run_data(solution) | {"title": ""} == shown | {"title": ""}
    rename(scene)
    assert run_data(solution)["contacts"] == shown["contacts"]


def test_a_file_has_no_scene_with_other_names(tmp_path):
    """Phases go by the names of the run."""
    scene = flier()
    solution = ts.simulate(scene, (0, 0.5))
    scene["floor"].name = "street"
    solution.save(tmp_path / "run.h5")
    with pytest.raises(ts.StorageError, match="changed since the run"):
        ts.load(tmp_path / "run.h5")


def test_what_is_of_a_class_cant_be_set():
    scene = roller()
    with pytest.raises(ts.UnknownAttribute, match="floor: unilateral"):
        scene["floor"].unilateral = False
