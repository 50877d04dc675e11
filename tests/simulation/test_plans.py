"""Plans of calls: a call like an earlier one has the bits of a first one, and no plan outlives what it was made of."""

import numpy as np
import pytest

import tsdyn as ts
from examples import door, driven_pivot, top
from tests.helpers.calls import by_plan, same_run

I = ts.integrators
SPAN = (0.0, 0.3)
WAYS = {
    "default": {},
    "tight": {"rtol": 1e-11, "atol": 1e-11},
    "outputs": {"t_eval": (0.0, 0.3)},
    "more outputs": {"t_eval": np.linspace(0.0, 0.3, 17)},
    "dop853": {"integrator": I.DOP853(1e-8, 1e-8)},
    "rk45 by name": {"integrator": "rk45", "rtol": 1e-7},
    "fixed": {"integrator": I.Nystrom4(1e-3)},
    "null-space": {"integrator": I.DOP853(1e-8, 1e-8), "formulation": "null-space"},
    "maggi-kane": {"integrator": "rk45", "formulation": "maggi-kane"},
    "sdirk54": {"integrator": I.SDIRK54(1e-6, 1e-6)},
    "short steps": {"max_step": 0.01},
    "without history": {"history": False},
    "charts": {"chart_interval": 1},
    "dense output": {"dense_output": True},
    "dense output of stages": {"integrator": I.DOP853(1e-8, 1e-8), "dense_output": True, "t_eval": (0.0, 0.1)},
    "no progress": {"progress": False},
}
SCENES = {"top": top.build, "driven": driven_pivot.build, "redundant": door.build}


@pytest.mark.slow_for("*sdirk54", "*null-space", "*maggi-kane")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("make", SCENES.values(), ids=SCENES)
def test_a_later_call_has_the_bits_of_a_first_one(make, way):
    scene, options = make(), WAYS[way]
    first = ts.simulate(make(), SPAN, **options)
    same_run(ts.simulate(scene, SPAN, **options), first)
    for _ in range(3):
        same_run(by_plan(scene, SPAN, **options), first)


@pytest.mark.parametrize("make", SCENES.values(), ids=SCENES)
def test_a_later_call_of_another_interval_tells_of_itself(make):
    """Not what the solution that its plan was made from has told, of redundant rows for instance."""
    scene = make()
    told = ts.simulate(scene, (0.0, 0.01))
    assert told.stats.steps < 5
    assert told.state.t == told.reached == 0.01
    assert told.constraint_error.position.size == told.t.size
    later, first = by_plan(scene, SPAN), ts.simulate(make(), SPAN)
    same_run(later, first)
    assert vars(later.stats).keys() == vars(first.stats).keys()
    for name in vars(first.stats).keys() - {"seconds"}:
        assert getattr(later.stats, name) == getattr(first.stats, name), name
    assert later.message == first.message
    assert later.state.t == later.reached == SPAN[1]
    np.testing.assert_array_equal(later.state.q, first.state.q)
    np.testing.assert_array_equal(later.constraint_error.position, first.constraint_error.position)


def test_calls_of_several_plans_take_turns(rng):
    scene, ways = top.build(), ("default", "tight", "outputs", "more outputs", "fixed", "short steps")
    first = {way: ts.simulate(top.build(), SPAN, **WAYS[way]) for way in ways}
    for way in ways:
        ts.simulate(scene, SPAN, **WAYS[way])
    for way in rng.permutation(ways * 4):
        same_run(by_plan(scene, SPAN, **WAYS[way]), first[way])


def set_mass(scene):
    scene.body("top").mass = 31.0


def set_gravity(scene):
    scene.gravity = (0.0, 0.5, -9.6)


def set_inertia(scene):
    scene.body("top").inertia = (91.0, 90.0, 30.0)


def set_position(scene):
    scene.body("top").position = (0.5, 0.0, 1.0)


def set_spin(scene):
    scene.body("top").angular_velocity = (0.5, 0.0, 11.0)


def set_normal(scene):
    scene.remove("tip")
    scene.add(ts.constraints.PlaneContact(scene.body("top"), scene.ground, point_a=(0, 0, -1), normal_b=(0.1, 0, 1)))


def set_name(scene):
    scene.body("top").name = "spinner"


def add_body(scene):
    scene.add_point_mass(1.0, name="stone")


def remove_constraint(scene):
    scene.remove("tip")


def add_force(scene):
    scene.add(ts.forces.PointForce(scene.body("top"), force=(0.0, 1.0, 0.0)))


EDITS = [value for name, value in list(globals().items()) if name.startswith(("set_", "add_", "remove_"))]


@pytest.mark.parametrize("options", [{}, {"t_eval": (0.0, 0.3)}, WAYS["fixed"]], ids=["default", "outputs", "fixed"])
@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: edit.__name__)
def test_an_edit_of_the_scene_is_seen(edit, options):
    scene, other = top.build(), top.build()
    before = [ts.simulate(scene, SPAN, **options) for _ in range(2)][-1]
    edit(scene)
    edit(other)
    found, expected = ts.simulate(scene, SPAN, **options), ts.simulate(other, SPAN, **options)
    same_run(found, expected)
    same_run(ts.simulate(scene, SPAN, **options), expected)
    if edit is set_name:
        assert found.position("spinner").shape == (found.t.size, 3)
    else:  # a plan that were stale would show
        assert found.q.shape != before.q.shape or (found.q[-1] != before.q[-1]).any()


def test_scenes_with_other_parameters_have_plans_of_their_own():
    scene, values = top.build(), {"top.mass": 31.0}
    first = [ts.simulate(scene, SPAN) for _ in range(2)][-1]
    other, built = scene.with_parameters(values), top.build()
    built.body("top").mass = 31.0
    for _ in range(2):
        same_run(ts.simulate(other, SPAN), ts.simulate(built, SPAN))
        same_run(by_plan(scene, SPAN), first)
        twin = scene.copy()
        same_run(ts.simulate(twin, SPAN), first)
        assert ts.simulate(twin, SPAN).scene is twin
        assert ts.simulate(other, SPAN).scene is other


PUSH = 1.0


def test_a_function_whose_globals_have_changed_is_compiled_anew(monkeypatch):
    def push(t):
        return (PUSH, 0.0, 0.0)

    def build():
        scene = top.build()
        scene.add(ts.forces.PointForce(scene.body("top"), force=push))
        return scene

    scene = build()
    before = [ts.simulate(scene, SPAN) for _ in range(2)][-1]
    monkeypatch.setitem(globals(), "PUSH", 20.0)
    found = ts.simulate(scene, SPAN)
    same_run(found, ts.simulate(build(), SPAN))
    assert abs(found.q[-1, 0] - before.q[-1, 0]) > 1e-3


def test_a_start_that_is_refused_is_refused_again():
    scene = top.build()
    for _ in range(2):
        ts.simulate(scene, SPAN)
    scene.body("top").position = (0.0, 0.0, 2.0)
    for _ in range(2):
        with pytest.raises(ts.InconsistentState):
            ts.simulate(scene, SPAN)
    scene.body("top").position = (0.0, 0.0, 1.0)
    same_run(ts.simulate(scene, SPAN), ts.simulate(top.build(), SPAN))


def test_other_redundant_rows_make_another_plan():
    """A start at which other rows are redundant, between two calls of one plan."""
    scene = door.build()
    first = [ts.simulate(scene, SPAN) for _ in range(2)][-1]
    plan = next(iter(scene._prepared.plans.values()))
    assert plan.serves
    scene.packed.derived.forget_graphs()
    assert not plan.serves
    same_run(ts.simulate(scene, SPAN), first)
    assert next(iter(scene._prepared.plans.values())) is not plan
