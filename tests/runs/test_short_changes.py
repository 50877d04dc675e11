"""Pulses, bumps, edges and kinks of functions, each a small part of a run: no step passes over them."""

import math

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import FAIR, FINE, LOOSE, ROUGH
from tsdyn.model.equations import depends_on_time
from tsdyn.motions.knots import changes, sample_times, stops_of

C, F, I, M = ts.constraints, ts.forces, ts.integrators, ts.motions
SPAN, AREA, BUMP = (0, 100), 0.1, 0.05 * math.sqrt(math.pi)  # N s: the impulses of box and bump
METHODS = {
    "default": {},
    "taylor": {"integrator": "taylor"},
    **{name: {"integrator": name} for name in ("dop853", "rk45", "radau", "sdirk54", "implicit_trapezoid")},
    "null-space": {"integrator": "dop853", "formulation": "null-space"},
    "maggi-kane": {"integrator": "rk45", "formulation": "maggi-kane"},
}
STAGES = [name for name in METHODS if name != "taylor"]


def box(t):
    return 1.0 if 50.0 < t < 50.1 else 0.0


def box_up(t):
    return (0.0, 0.0, 1.0 if 50.0 < t < 50.1 else 0.0)


def bump_up(t):
    return (0.0, 0.0, np.exp(-(((t - 50.0) / 0.05) ** 2)))


def box_of_state(t, state, *, start=50.0):
    return (0.0, 0.0, 1.0 if start < t < start + 0.1 else 0.0)


def box_of_joint(t, coordinate, rate):
    return 1.0 if 50.0 < t < 50.1 else 0.0


def brake(t, coordinate, rate):
    return -20.0 * rate if 50.0 < t < 50.1 else 0.0


def user(t, a, b, par, out):
    out[2] = par[0] if 50.0 < t < 50.1 else 0.0


class Kick(ts.Force):
    """A plug-in whose law depends on time."""

    markers = (ts.Point("a"),)

    @staticmethod
    def law(x, xd, par, t, out):
        """A box."""
        out[2] = 1.0 if 50.0 < t < 50.1 else 0.0


def ball(force, span=SPAN, **options):
    """Rate along z at the end of a mass of 1 kg, at rest at first."""
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_point_mass(1.0)
    scene.add(F.PointForce(body, force=force, name="push"))
    solution = ts.simulate(scene, span, **options)
    assert solution.success, solution.message
    return solution.state.velocity(body)[2]


@pytest.mark.slow_but("*box*-dop853", "box_up-default", "box_up-radau")
@pytest.mark.parametrize("name", STAGES)
@pytest.mark.parametrize("force", [box_up, box_of_state])
def test_a_box_of_a_thousandth_of_the_run(force, name):
    assert ball(force, **METHODS[name]) == pytest.approx(AREA, rel=ROUGH)


@pytest.mark.slow_but("taylor", "dop853")
@pytest.mark.parametrize("name", METHODS)
def test_a_smooth_bump_of_a_thousandth_of_the_run(name):
    assert ball(bump_up, **METHODS[name]) == pytest.approx(BUMP, rel=ROUGH)


def narrow(t, state, *, at=50.0, width=0.1, sway=0.0, rate=1.0):
    return (0.0, 0.0, sway * np.cos(rate * t) + max(0.0, 1.0 - abs(t - at) / width))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_triangles_anywhere_and_on_a_sway(seed):
    """The impulse of a triangle is its width, that of the sway sway sin(rate t) / rate."""
    rng = np.random.default_rng(seed)
    end = 10.0 ** rng.uniform(-1, 4)
    width = end * 10.0 ** rng.uniform(-3, -1)
    values = {"at": rng.uniform(width, end - width), "width": width}
    values |= {"sway": rng.choice((0.0, 0.1, 10.0)), "rate": 10.0 ** rng.uniform(0, 2.5) / end}
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_point_mass(1.0)
    scene.add(F.PointForce(body, force=narrow, name="push"))
    scene = scene.with_parameters({f"push.force.{name}": value for name, value in values.items()})
    swayed = values["sway"] * math.sin(values["rate"] * end) / values["rate"]
    for method in ("dop853", "rk45"):
        solution = ts.simulate(scene, (0, end), integrator=method, rtol=FINE, atol=FAIR * width)  # of the sway, too
        assert solution.state.velocity(body)[2] - swayed == pytest.approx(width, rel=LOOSE)


def hinged(**body):
    scene = ts.Scene(gravity=(0, 0, 0))
    arm = scene.add_body(1.0, (1, 1, 1), name="arm", **body)
    return scene, arm, scene.add(C.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 0, 1)))


def turned(make, expected, **body):
    scene, arm, hinge = hinged(**body)
    scene.add(make(scene, arm, hinge))
    assert ts.simulate(scene, SPAN).state.angular_velocity(arm)[2] == pytest.approx(expected, rel=ROUGH)


@pytest.mark.slow
def test_every_force_that_takes_a_function():
    frame = {"axis_a": (0, 0, 1), "reference_a": (1, 0, 0), "reference_b": (1, 0, 0), "stiffness": 0.0}
    turned(lambda scene, arm, hinge: F.JointTorque(hinge, function=box_of_joint), AREA)
    turned(lambda scene, arm, hinge: F.Torque(arm, torque=box_up), AREA)
    turned(lambda scene, arm, hinge: F.TorsionalSpring(scene.ground, arm, actuator=box, **frame), AREA)
    turned(lambda scene, arm, hinge: F.UserForce(arm, function=twist, parameters=(1.0,)), AREA)
    # a brake is zero at rest: w = w0 exp(-20 0.1)
    turned(lambda scene, arm, hinge: F.JointTorque(hinge, function=brake), math.exp(-2), angular_velocity=(0, 0, 1))
    scene = ts.Scene(gravity=(0, 0, 0))
    bodies = [scene.add_point_mass(1.0, position=(i, 0, 0)) for i in range(3)]
    slide = scene.add_body(1.0, (1, 1, 1))
    joint = scene.add(C.Translational.at(scene.ground, slide, point=(0, 0, 0), axis=(0, 0, 1)))
    scene.add(F.JointForce(joint, function=box_of_joint))
    scene.add(F.Spring(bodies[1], scene.ground, stiffness=0.0, actuator=box))
    scene.add(F.UserForce(bodies[2], function=user, parameters=(1.0,)))
    scene.add(Kick(bodies[0]))
    state = ts.simulate(scene, SPAN).state
    rates = state.velocity(bodies[0])[2], state.velocity(bodies[1])[0], state.velocity(bodies[2])[2]
    np.testing.assert_allclose((*rates, state.velocity(slide)[2]), (AREA, -AREA, AREA, AREA), rtol=ROUGH)


def twist(t, a, b, par, out):
    out[5] = par[0] if 50.0 < t < 50.1 else 0.0


@pytest.mark.slow_but("taylor")
@pytest.mark.parametrize("name", ["taylor", "dop853", "radau"])
def test_a_motion_with_a_bump(name):
    """A driven support leaves a mass on a spring of 1 N/m with v = k area exp(-(w tau / 2)^2), by linear response."""
    scene, t = ts.Scene(gravity=(0, 0, 0)), M.time
    support, mass = scene.add_point_mass(1.0), scene.add_point_mass(1.0, position=(1, 0, 0))
    path = (0.01 * np.exp(-(((t - 50.0) / 0.05) ** 2)), 0.0, 0.0)
    scene.add(C.PointDriver(scene.ground, support, path=path))
    scene.add(C.Dot2(scene.ground, mass, axis_a=(0, 1, 0)))
    scene.add(C.Dot2(scene.ground, mass, axis_a=(0, 0, 1)))
    scene.add(F.Spring(support, mass, stiffness=1.0))
    solution = ts.simulate(scene, SPAN, integrator=name)
    assert solution.energy[-1] == pytest.approx(0.5 * (0.01 * BUMP * math.exp(-(0.025**2))) ** 2, rel=ROUGH)


SMOOTH = {
    "zero": lambda t: 0.0 * t,
    "constant": lambda t: 0.0 * t + 1.7,
    "sine": np.sin,
    "fast sine": lambda t: np.sin(100.0 * t),
    "chirp": lambda t: np.sin(t * t),
    "power": lambda t: t**7,
    "decay": lambda t: np.exp(-t),
    "wide bump": lambda t: np.exp(-(((t - 50) / 20) ** 2)),
    "noise": lambda t: np.random.default_rng(0).normal(size=t.size),
    "not finite": lambda t: t * np.nan,
}


@pytest.mark.parametrize("function", SMOOTH.values(), ids=SMOOTH)
def test_what_keeps_steps_short_itself_is_no_change(function):
    t = sample_times(*map(float, SPAN))
    assert changes(t, [function(t)]).size == 0


def test_steps_that_see_a_change_stay_as_they_are(monkeypatch):
    """Natural steps are shorter than the samples here, and the same to the bit without the changes."""

    def run():
        scene = ts.Scene(gravity=(0, 0, 0))
        body = scene.add_point_mass(1.0, position=(0, 0, 1), velocity=(0, 0, 1))
        scene.add(F.Spring(body, scene.ground, stiffness=1e8))
        scene.add(F.PointForce(body, force=box_up))
        return ts.simulate(scene, (49.5, 50.5), integrator="dop853").q

    found = run()
    monkeypatch.setattr("tsdyn.simulation.scene_cache.changes", lambda t, functions: np.empty((0, 2)))
    np.testing.assert_array_equal(run(), found)


@pytest.mark.parametrize("ulps", [-2, -1, 0, 1, 2])
def test_a_change_that_ends_beside_another_stop_is_none(ulps):
    """Times that differ by rounding leave no step of nothing."""
    instant = 0.4 + ulps * np.spacing(0.4)
    stops = stops_of([], np.array([instant]), np.array([(0.3, 0.4), (0.4, 0.5), (0.9, 1.0)]), 0.0, 1.0)
    np.testing.assert_array_equal(stops, [(instant, 1.0, instant), (0.5, 0.0, 0.4)])


@pytest.mark.slow
def test_a_change_in_cases_of_an_ensemble():
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_point_mass(1.0, name="ball")
    scene.add(F.PointForce(body, force=box_of_state, name="push"))
    given = {"push.force.start": [50.0, 20.3, 91.0], "ball.mass": [1.0, 2.0, 1.0]}
    found = ts.ensemble(scene, given, SPAN)
    np.testing.assert_allclose(found.qd[:, 2], (AREA, 0.5 * AREA, AREA), rtol=ROUGH)
    found = ts.ensemble(scene, {"ball.mass": [1.0, 4.0]}, SPAN)
    np.testing.assert_allclose(found.qd[:, 2], (AREA, 0.25 * AREA), rtol=ROUGH)


def failing(force):
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add(F.PointForce(scene.add_point_mass(1.0), force=force, name="push"))
    return ts.simulate(scene, SPAN, integrator="dop853")


def nan_for_a_while(t):
    return (0.0, 0.0, math.nan if 50.0 < t < 50.1 else 1.0)


def raises_for_a_while(t):
    if 50.0 < t < 50.1:
        raise ValueError("not now")
    return (0.0, 0.0, 1.0)


def hashed(t):
    x = math.sin(t * 12.9898e6) * 43758.5453e3
    return (0.0, 0.0, x - math.floor(x))


def hashed_later(t):
    x = math.sin(t * 12.9898e6) * 43758.5453e3
    return (0.0, 0.0, x - math.floor(x) if t > 50.0 else 0.0)


@pytest.mark.parametrize(
    ("force", "reached", "words"),
    [
        (nan_for_a_while, 50.0, r"push.* is inf or nan at t = 50"),
        (raises_for_a_while, 50.0, r"push.* raises ValueError: not now"),
        (hashed, 0.0, r"push: force: the function is noise.*max_step"),
        (hashed_later, 50.0, r"push: force: the function is noise.*max_step"),
    ],
)
def test_what_ends_a_run(force, reached, words):
    solution = failing(force)
    assert not solution.success
    assert solution.state.t == pytest.approx(reached, abs=1e-3)
    with pytest.raises(ts.StepFailure, match=words):
        solution.raise_if_failed()


def test_fixed_steps_say_what_they_dont_resolve():
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add(F.PointForce(scene.add_point_mass(1.0), force=box_up, name="push"))
    said = ts.simulate(scene, SPAN, integrator=I.Nystrom4(step=0.5)).message
    assert "push: force: the function changes within 0.049 s at t = 50.0" in said
    assert "max_step, or an adaptive method" in said
    assert ts.simulate(scene, SPAN, integrator=I.Nystrom4(step=0.04)).message == ts.Status.SUCCESS.sentence


def drag(t, state):
    return (-state[7], -state[8], -state[9])


def later(t, state):
    return (lambda: (0.0, 0.0, t))()


@pytest.mark.slow
def test_what_doesnt_read_the_time_is_not_sampled():
    scene = ts.Scene()
    body = scene.add_point_mass(1.0)
    told = [depends_on_time(scene.add(F.PointForce(body, force=force))) for force in (drag, box_of_state, later)]
    assert told == [False, True, True]
    assert depends_on_time(scene.add(Kick(body)))
