"""Every result through everything that a user may ask, for every method, scene by scene."""

import itertools
from pathlib import Path

import numpy as np
import pytest

import tsdyn as ts
from examples import coin, door, slider_crank, stick_slip, top
from tests.helpers.built_in import INTEGRATORS
from tests.helpers.journeys import displayed, visit
from tests.helpers.tolerances import HELD

ROOT = Path(__file__).parents[2]
KINDS = {kind.__name__.lower(): kind for kind in INTEGRATORS}
METHODS = [None, *sorted(KINDS)]
FORMS = ("tangent", "null-space", "maggi-kane")


def bobs():
    """Point masses alone, on a rope, with a spring."""
    scene = ts.Scene()
    a = scene.add_point_mass(1.0, position=(1.0, 0.0, 0.0), name="a")
    b = scene.add_point_mass(0.5, position=(1.0, 1.0, 0.0), name="b")
    scene.add(ts.constraints.Distance(a, scene.ground, name="rope"))
    scene.add(ts.forces.Spring(a, b, stiffness=30.0, name="spring"))
    return scene


def motor():
    """A driven hinge, and a pendulum on it with a spring that counts turns."""
    scene = ts.Scene()
    hub = scene.add_body(1.0, (0.1, 0.1, 0.1), name="hub")
    hinge = scene.add(ts.constraints.Revolute.at(scene.ground, hub, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    angle = ts.motions.Ramp(0.0, 2.0) + ts.motions.Sine(0.1, 3.0) - 0.3 * ts.motions.Ramp(0.0, 1.0)
    scene.add(ts.constraints.RotationMotor.of(hinge, angle=angle, name="motor"))
    hub.angular_velocity = (0.0, 0.0, 2.0)
    arm = scene.add_body(1.0, (0.1, 0.1, 0.1), position=(1.0, 0.0, 0.0), velocity=(0.0, 2.0, 0.0), name="arm")
    arm.angular_velocity = (0.0, 0.0, 2.0)
    pin = scene.add(ts.constraints.Revolute.at(hub, arm, point=(0.5, 0, 0), axis=(0, 1, 0), name="pin"))
    scene.add(
        ts.forces.TorsionalSpring(
            hub, arm, axis_a=pin.axis_a, reference_a=(1, 0, 0), reference_b=(1, 0, 0), stiffness=2.0, damping=0.1,
            name="coil",
        )
    )  # fmt: skip
    return scene


def pulse(t):
    """A push of a millisecond."""
    return 0.0, 0.0, np.exp(-(((t - 0.0125) / 2e-4) ** 2))


def loads():
    """A hinged bar turned by a matrix, under tables of all kinds, a short pulse, and a spring through its anchor."""
    scene = ts.Scene()
    turned = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    bar = scene.add_body(1.0, (0.1, 0.1, 0.05), position=(0.0, 0.0, -0.5), orientation=turned, name="bar")
    scene.add(ts.constraints.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0), name="pin"))
    tables = [ts.Table((0.0, 0.01, 0.01, 0.05), (0, 1, 2, 2), kind=kind) for kind in ("linear", "previous", "pchip")]
    scene.add(ts.forces.PointForce(bar, force=tuple(tables), name="pull"))
    bob = scene.add_point_mass(1.0, position=(0.02, 1.0, 0.0), velocity=(-1.0, 0.0, 0.0), name="bob")
    scene.add(ts.forces.Spring(scene.ground, bob, point_a=(0, 1, 0), stiffness=30.0, free_length=0.1, name="spring"))
    scene.add(ts.forces.PointForce(bob, force=pulse, name="pulse"))
    return scene


SCENES = {
    "point masses": bobs,
    "one body": top.build,
    "redundant": door.build,
    "driven": motor,
    "friction": stick_slip.build,
    "loop": slider_crank.build,
    "loads": loads,
    "rolling": coin.build,
}


def options(index):
    """With and without t_eval, dense output, events and histories, so that two of them meet in some run."""
    t_eval, dense, events, history = list(itertools.product((False, True), repeat=4))[index % 16]
    return {
        "t_eval": [0.0, 0.013, 0.03] if t_eval else None,
        "dense_output": dense,
        "events": (lambda t, state: state.q[0] - 0.4 * t, lambda t, state: t - 0.011) if events else None,
        "history": history,
    }


def runs():
    """Method, form, scene, options: every method with every scene that it serves, the options in turn."""
    cases = [(m, "tangent", s) for m in METHODS for s in SCENES if not (s == "friction" and m and KINDS[m].coupled)]
    explicit = [m for m in METHODS if m not in (None, "taylor") and not KINDS[m].implicit]
    cases += [(m, f, s) for f in FORMS[1:] for m, s in zip(itertools.cycle(explicit), SCENES, strict=False)]
    return [(*case, 3 * i + i // 16) for i, case in enumerate(cases)]


@pytest.mark.slow_but(
    "None-tangent-[!f]*", "[!is]*-tangent-one body-*", "*-null-space-one body-*", "*-maggi-kane-one body-*"
)
@pytest.mark.parametrize(("method", "form", "scene", "index"), runs(), ids=str)
def test_every_result_answers_everything(method, form, scene, index):
    scene, given = SCENES[scene](), options(index)
    solution = ts.simulate(scene, (0.0, 0.03), integrator=method, formulation=form, initial_tol=1e-6, **given)
    assert solution.success, solution.message
    if given["events"]:
        assert solution.t_events[1] == pytest.approx([0.011], abs=HELD)
    visit(scene, solution)
    went_on = ts.simulate(scene, (0.03, 0.04), integrator=method, formulation=form, state=solution.state)
    assert went_on.raise_if_failed().t[-1] == 0.04


@pytest.mark.parametrize("scene", SCENES)
def test_what_a_scene_tells(scene):
    scene = SCENES[scene]()
    for thing in (scene, scene.mobility(), scene.evaluate(), scene.assemble(), scene.ground):
        displayed(thing)
    for thing in (*scene.bodies, *scene.constraints, *scene.forces):
        displayed(thing)
        assert scene[thing.name] is thing


@pytest.mark.parametrize("scene", SCENES)
def test_a_scene_starts_where_a_run_has_ended(scene):
    scene = SCENES[scene]()
    run = ts.simulate(scene, (0.0, 0.01), initial_tol=1e-6)
    scene.set_start(run)
    np.testing.assert_allclose(scene.start, (run.state.q, run.state.qd), atol=HELD)
    ts.simulate(scene, (0.01, 0.02)).raise_if_failed()


def test_what_modes_and_ensembles_tell():
    scene = bobs()
    modes = scene.linearise(scene.equilibrium().state).modes()
    displayed(modes)
    assert len(modes.motions) == len(modes)
    for body in scene.bodies:
        assert np.isfinite(modes.participation(body)).all()
    names = [thing.name for thing in (*scene.bodies, *scene.constraints, *scene.forces)]
    found = ts.ensemble(scene, {"a.mass": [1.0, 2.0]}, (0.0, 0.01), keep=names)
    displayed(found)
    assert len(found.to_dataframe()) == 2


def test_a_run_that_fails_tells_as_much():
    scene = top.build()
    ended = ts.simulate(scene, (0.0, 1.0), max_steps=3, dense_output=True)
    displayed(ended)
    assert not ended.success
    assert ended.reached < 1.0
    with pytest.raises(ts.StepFailure) as caught:
        ended.raise_if_failed()
    assert caught.value.solution is ended
    assert np.isfinite(ended.at(ended.reached).q).all()
