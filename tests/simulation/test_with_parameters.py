"""Scenes with other parameters: the bits of scenes that are given the same values one by one."""

import pickle

import numpy as np
import pytest

import tsdyn as ts
from examples import drive_train, driven_pivot, four_bar, screw_press, stick_slip, top
from tests.helpers.every_force import everything
from tests.helpers.plug_ins import Rod

RNG = np.random.default_rng(4)
SCENES = {
    "every force": lambda: everything(np.random.default_rng(1))[0],
    "four-bar": four_bar.build,
    "gears": drive_train.build,
    "screw": screw_press.build,
    "friction": stick_slip.build,
    "top": top.build,
}


def other(name, value):
    """An admissible value near another."""
    if name.endswith("orientation"):
        value = value + 1e-3 * RNG.normal(size=4)
        return value / np.linalg.norm(value)
    scale = 1.0 + 0.05 * RNG.uniform()
    if np.ndim(value) == 2 or name.endswith(("mass", "stiffness", "damping", "velocity")):
        return value * scale
    return value * scale if np.all(value) else value + 0.01 * RNG.uniform(size=np.shape(value))


def outcome(make, *arguments):
    """Bits of a short run of a scene that is made, or why there is none."""
    try:
        solution = ts.simulate(make(*arguments), (0.0, 0.02), rtol=1e-6, atol=1e-6)
    except ts.TsdynError as error:
        return str(error)
    return [getattr(solution, name).tobytes() for name in ("t", "q", "qd", "qdd", "multipliers", "energy")]


def set_one_by_one(scene, values):
    """A copy of a scene whose attributes are set."""
    twin = scene.copy()
    for name, value in values.items():
        owner, _, attribute = name.rpartition(".")
        setattr(twin[owner] if owner else twin, attribute, value)
    return twin


@pytest.mark.slow_for("every force")
@pytest.mark.parametrize("which", SCENES)
def test_runs_have_the_bits_of_a_scene_with_these_attributes(which):
    scene = SCENES[which]()
    before, listed = outcome(scene.copy), dict(scene.parameters())
    assert len(listed) > 5
    for name, value in listed.items():
        values = {name: other(name, value)}
        assert outcome(scene.with_parameters, values) == outcome(set_one_by_one, scene, values), name
    assert outcome(lambda: scene) == before
    assert all(np.array_equal(value, listed[name]) for name, value in scene.parameters().items())


@pytest.mark.parametrize("which", ["top", "four-bar"])
@pytest.mark.parametrize("method", ["dop853", "rk45", "nystrom4", "sdirk54"])
def test_every_method_sees_the_values(which, method):
    scene = SCENES[which]()
    masses = {f"{body.name}.mass": 1.1 * body.mass for body in scene.bodies}
    inertias = {f"{body.name}.inertia": 1.2 * body.inertia for body in scene.bodies}
    values = {**masses, **inertias, "gravity": (0.1, 0.2, -9.0)}
    runs = [ts.simulate(each, (0, 0.01), integrator=method)
            for each in (scene.with_parameters(values), set_one_by_one(scene, values), scene)]  # fmt: skip
    one, same, base = [run.qdd.tobytes() for run in runs]
    assert one == same != base


def test_values_that_are_admissible_together_come_in_any_order():
    """A block of 1 m/s comes to rest after v^2 / (2 mu g)."""
    scene = ts.Scene()
    block = scene.add_point_mass(mass=1.0, velocity=(1, 0, 0), name="block")
    floor = {"normal_b": (0, 0, 1), "unilateral": True, "kinetic": 0.2, "static": 0.3, "name": "floor"}
    scene.add(ts.constraints.PlaneContact(block, scene.ground, **floor))
    values = {"floor.kinetic": 0.4, "floor.static": 0.5}
    for given in (values, dict(reversed(values.items()))):
        solution = ts.simulate(scene.with_parameters(given), (0, 1))
        assert solution.q[-1, 0] == pytest.approx(0.5 / (0.4 * 9.81), rel=1e-12)
        study = ts.ensemble(scene, {name: [value] for name, value in given.items()}, (0, 1))
        assert study.q[0, 0] == solution.q[-1, 0]
    for wrong in ({"floor.kinetic": 0.4}, {"floor.kinetic": 0.4, "floor.static": 0.35}):
        with pytest.raises(ts.InvalidConstraint, match=r"static must be at least kinetic = 0\.4"):
            scene.with_parameters(wrong)


def test_values_add_up_and_handles_are_its_own():
    scene = top.build()
    body = scene.bodies[0]
    first = scene.with_parameters({f"{body.name}.mass": 20.0})
    both = first.with_parameters({f"{body.name}.velocity": (0.1, 0, 0)})
    assert both[body] is both.bodies[0] is not body
    assert (both[body].mass, first[body].mass, body.mass) == (20.0, 20.0, 30.0)
    assert both[body].velocity[0] == 0.1
    solution = ts.simulate(first, (0, 0.01))
    assert np.array_equal(solution.position(body), solution.position(first[body]))
    first[body].mass = 25.0
    assert (both[body].mass, first[body].mass, first.with_parameters({})[body].mass) == (20.0, 25.0, 25.0)


def test_the_original_may_change_afterwards():
    scene = top.build()
    values = {f"{scene.bodies[0].name}.inertia": (80.0, 80.0, 30.0)}
    later, expected = scene.with_parameters(values), outcome(set_one_by_one, scene, values)
    scene.bodies[0].mass = 1.0
    scene.gravity = (0, 0, 0)
    assert outcome(lambda: later) == expected
    assert later.bodies[0].mass == 30.0


def test_it_may_be_changed_itself():
    scene = four_bar.build()
    other = scene.with_parameters({"gravity": (0, 0, -1.0)})
    other.gravity = (0, -2.0, 0)
    built = scene.copy()
    built.gravity = (0, -2.0, 0)
    assert outcome(lambda: other) == outcome(lambda: built)


def test_handles_of_the_original_serve_for_joints_made_anew():
    scene = four_bar.build()
    joint = next(item for item in scene.constraints if isinstance(item, ts.constraints.Revolute))
    moved = {f"{joint.name}.{side}": getattr(joint, side) + np.array((0, 0, 0.1)) for side in ("point_a", "point_b")}
    changed = scene.with_parameters(moved)
    solution = ts.simulate(changed, (0, 0.01))
    angle = solution.angle(joint)
    assert np.array_equal(angle, solution.angle(changed[joint]))
    assert np.array_equal(solution.reaction(joint)[0], solution.reaction(changed[joint])[0])


def test_plug_ins_are_listed_by_their_arguments():
    scene = ts.Scene()
    bob = scene.add_point_mass(1.0, position=(1, 0, 0), name="bob")
    scene.add(Rod(bob, scene.ground, name="rod"))
    assert "rod.point_b" in scene.parameters()


def test_a_value_that_is_no_number_is_packed_anew():
    scene = driven_pivot.build_driven()
    slower = ts.motions.Sine(driven_pivot.HEIGHT, driven_pivot.FREQUENCY / 2, phase=np.pi / 2)
    values = {"pivot.path": (0.0, 0.0, slower)}
    assert outcome(scene.with_parameters, values) == outcome(set_one_by_one, scene, values)


def lift(t, *, height=0.1, rate=2.0):
    return 1.0 + height * np.cos(rate * t)


def pull(t, *, size=3.0):
    return 0.0, 0.0, size * np.cos(t)


class Hold:
    """Not a plain function: no keywords of its own are listed."""

    def __call__(self, t, angle, rate, *, gain=1.0):
        return -gain * rate


def driven_by_functions():
    scene = ts.Scene(gravity=(0, 0, -10))
    bob = scene.add_point_mass(1.0, position=(1.1, 0, 0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, length=lift, name="rod"))
    scene.add(ts.forces.PointForce(bob, force=pull, name="wind"))
    wheel = scene.add_body(1.0, (1, 1, 2), name="wheel")
    hinge = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))

    def controller(t, angle, rate, *, goal=1.0, gain=50.0):
        return gain * (goal - angle) - 20.0 * rate

    scene.add(ts.forces.JointTorque(hinge, function=controller, period=0.01, name="drive"))
    scene.add(ts.forces.JointTorque(hinge, function=Hold(), period=0.01, name="hold"))
    return scene


@pytest.mark.parametrize("method", [None, "dop853"])
def test_keyword_arguments_of_users_functions_are_parameters(method):
    scene = driven_by_functions()
    numbers = {name: value for name, value in scene.parameters().items() if name.count(".") == 2}
    assert numbers == {
        "rod.length.height": 0.1, "rod.length.rate": 2.0, "wind.force.size": 3.0,
        "drive.function.goal": 1.0, "drive.function.gain": 50.0,
    }  # fmt: skip
    other = scene.with_parameters({"rod.length.rate": 1.0, "wind.force.size": 5.0, "drive.function.goal": -1.0})
    built = scene.copy()
    built["rod"].length = lambda t: 1.0 + 0.1 * np.cos(1.0 * t)
    built["wind"].force = lambda t: (0.0, 0.0, 5.0 * np.cos(t))
    built["drive"].function = lambda t, angle, rate: 50.0 * (-1.0 - angle) - 20.0 * rate
    one, same = (ts.simulate(each, (0.0, 0.5), integrator=method).state.q for each in (other, built))
    np.testing.assert_allclose(one, same, rtol=0.0, atol=1e-10)
    assert other.parameters()["rod.length.rate"] == 1.0
    back = other.with_parameters({"rod.length.rate": 2.0, "wind.force.size": 3.0, "drive.function.goal": 1.0})
    assert outcome(lambda: back) == outcome(lambda: scene)


def test_an_ensemble_over_a_number_of_a_function():
    scene = driven_by_functions()
    found = ts.ensemble(scene, {"wind.force.size": [0.0, 3.0, 6.0], "rod.length.rate": [1.0, 2.0, 3.0]}, (0.0, 0.1))
    assert found.success.all(), found.message
    assert found.q[1].tobytes() == ts.simulate(scene, (0.0, 0.1)).state.q.tobytes()
    assert len({row.tobytes() for row in found.q}) == 3


def drag(t, state, *, first=0.5, second=0.1):
    speed = np.sqrt(state[7] ** 2 + state[8] ** 2 + state[9] ** 2)
    factor = first + second * speed
    return -factor * state[7], -factor * state[8], -factor * state[9]


def oil(t, state, *, c=0.3):
    return -c * state[10], 0.0, 0.0


def law(t, x, rate, *, goal=0.2, gain=50.0, loss=4.0):
    return gain * (goal - x) - loss * rate


def ruled_by_functions():
    scene = ts.Scene(gravity=(0, 0, -10))
    bob = scene.add_body(1.0, (1, 1, 1), velocity=(1, 0, 3), angular_velocity=(1, 2, 3), name="bob")
    scene.add(ts.forces.PointForce(bob, force=drag, name="air"))
    scene.add(ts.forces.Torque(bob, torque=oil, frame="body", name="oil"))
    wheel, slider = (scene.add_body(1.0, (1, 1, 2), name=name) for name in ("wheel", "slider"))
    C = ts.constraints
    scene.add(C.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    scene.add(C.Translational.at(scene.ground, slider, point=(0, 0, 0), axis=(1, 0, 0), name="slide"))
    scene.add(ts.forces.JointTorque(scene["hinge"], function=law, name="turn"))
    scene.add(ts.forces.JointForce(scene["slide"], function=law, name="push"))
    return scene


OTHER = {
    "air.force.second": 0.7, "oil.torque.c": 2.0, "turn.function.goal": -0.3, "turn.function.gain": 9.0,
    "push.function.loss": 1.0,
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("method", [None, "taylor", "dop853", "sdirk54"])
def test_numbers_of_functions_of_the_state(method):
    scene = ruled_by_functions()
    before = scene.parameters()
    assert [name for name in before if name.count(".") == 2] == [
        "air.force.first", "air.force.second", "oil.torque.c", "turn.function.goal", "turn.function.gain",
        "turn.function.loss", "push.function.goal", "push.function.gain", "push.function.loss",
    ]  # fmt: skip
    other = scene.with_parameters(OTHER)
    assert other.packed.system.table is scene.packed.system.table, "packed anew"

    def air(t, state):
        factor = 0.5 + 0.7 * np.sqrt(state[7] ** 2 + state[8] ** 2 + state[9] ** 2)
        return -factor * state[7], -factor * state[8], -factor * state[9]

    built = scene.copy()
    built["air"].force, built["oil"].torque = air, lambda t, state: (-2.0 * state[10], 0.0, 0.0)
    built["turn"].function = lambda t, x, rate: 9.0 * (-0.3 - x) - 4.0 * rate
    built["push"].function = lambda t, x, rate: 50.0 * (0.2 - x) - rate
    one, same = (ts.simulate(each, (0.0, 0.5), integrator=method).state.q for each in (other, built))
    np.testing.assert_allclose(one, same, rtol=0.0, atol=1e-8)
    back = other.with_parameters({name: before[name] for name in OTHER})
    assert outcome(lambda: back) == outcome(lambda: scene)
    assert other.copy().parameters()["push.function.loss"] == 1.0


@pytest.mark.parametrize("method", ["dop853", pytest.param(None, marks=pytest.mark.slow)])
def test_an_ensemble_over_numbers_of_functions_of_the_state(method):
    scene = ruled_by_functions()
    table = {"turn.function.gain": [50.0, 20.0], "oil.torque.c": [0.3, 1.0]}
    found = ts.ensemble(scene, table, (0.0, 0.1), integrator=method)
    assert found.success.all(), found.message
    assert found.q[0].tobytes() == ts.simulate(scene, (0.0, 0.1), integrator=method).state.q.tobytes()
    values = {"turn.function.gain": 20.0, "oil.torque.c": 1.0}
    other = scene.with_parameters(values)
    assert found.q[1].tobytes() == ts.simulate(other, (0.0, 0.1), integrator=method).state.q.tobytes()


def test_a_user_force_has_its_numbers_as_par():
    def pull(t, a, b, par, out, *, size=1.0):
        out[0] = size

    scene = ts.Scene()
    bob = scene.add_point_mass(1.0, name="bob")
    with pytest.raises(ts.InvalidForce, match="parameters=, which it gets as par"):
        ts.forces.UserForce(bob, function=pull)


def jumps(t, *, size=1.0):
    return size if t > 0.5 else 0.0


@pytest.mark.parametrize("wrong", ["value", "name", "branch"])
def test_wrong_numbers_of_functions(wrong):
    scene = driven_by_functions()
    if wrong == "branch":
        with pytest.raises(ts.TsdynError, match=r"without branches .*it compares"):
            ts.forces.Spring(scene["bob"], scene.ground, stiffness=1.0, actuator=jumps)
        return
    given = {"wind.force.size": np.nan} if wrong == "value" else {"wind.force.sise": 1.0}
    with pytest.raises(
        ts.InvalidArgument, match="finite number" if wrong == "value" else "did you mean wind.force.size"
    ):
        scene.with_parameters(given)


def test_it_can_be_pickled_copied_and_assembled():
    scene = top.build()
    changed = scene.with_parameters({f"{scene.bodies[0].name}.mass": 20.0})
    expected = outcome(lambda: changed)
    for twin in (pickle.loads(pickle.dumps(changed)), changed.copy()):
        assert outcome(lambda twin=twin: twin) == expected
    assert changed.assemble().moved < 1e-12
    assert "20" in str(changed.parameters())


WRONG = {
    "bob.mss": ("did you mean bob.mass", 1.0),
    "bob.mass": ("must be a positive", -1.0),
    "spring.stiffness": ("not negative", np.nan),
    "rod.length": ("must be positive", 0.0),
    "gravity": ("three finite numbers", 9.81),
    "bob.velocity": ("three finite numbers", (1, 2)),
}


@pytest.mark.slow_for("every force")
@pytest.mark.parametrize("which", SCENES)
def test_a_scene_that_ran_has_the_bits_of_a_new_one_after_its_start_has_changed(which):
    scene = SCENES[which]()
    before = outcome(lambda: scene)
    for body in scene.bodies:
        body.velocity = 0.9 * body.velocity
        if hasattr(body, "inertia"):
            body.angular_velocity = 0.9 * body.angular_velocity
    after = outcome(lambda: scene)
    assert after == outcome(scene.copy)
    assert after != before or not np.any(scene.start[1])


@pytest.mark.parametrize("name", WRONG)
def test_wrong_values_are_refused_as_when_they_are_set(name):
    scene = ts.Scene()
    bob = scene.add_point_mass(1.0, position=(1, 0, 0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    scene.add(ts.forces.Spring(bob, scene.ground, stiffness=3.0, name="spring"))
    message, value = WRONG[name]
    with pytest.raises(ts.TsdynError, match=message):
        scene.with_parameters({name: value})


@pytest.mark.slow
def test_units_and_tables():
    scene = everything(np.random.default_rng(1))[0]
    listed = scene.parameters()
    assert listed.units["a.inertia"] == "kg m^2"
    assert listed.units["Bushing(ground, b).torsional_damping"] == "N m s/rad"
    assert listed.units["Spring(ground, dot).actuator"] == "N"
    assert listed.units["a.orientation"] == "1"
    assert "<td>a.mass</td><td>1.2</td><td>kg</td>" in listed._repr_html_()
    assert repr(listed).startswith(f"<{len(listed)} parameters>")
