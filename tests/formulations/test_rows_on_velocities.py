"""Rows on velocities by every method in every form: closed forms, agreement, orders, levels between the steps."""

import numpy as np
import pytest

import tsdyn as ts
from examples import bicycle, coin, turntable
from tests.helpers import closed_loops, skates
from tests.helpers.reduced_ode import Mixed, difference
from tests.helpers.tolerances import FINE, HELD, NEAR, TIGHT

I = ts.integrators
WAVE = ts.motions.Sine(amplitude=0.5, frequency=3.0, offset=1.0)
SCENES = {
    "skate": skates.skate,
    "sleigh": skates.sleigh,
    "blades in a line": lambda: skates.sleigh(3),
    "blade on a rail": skates.guided,
    "on a table": skates.on_a_table,
    "belt": lambda: skates.belt(2.0),
    "belt of time": lambda: skates.belt(WAVE),
    "rough hinge": skates.rough,
    "beside redundant hinges": skates.beside_hinges,
    "coin": coin.build,
    "turntable": turntable.build,
    "bicycle": bicycle.build,
}
WAYS = {  # options, largest error
    "dop853": ({"integrator": I.DOP853(1e-12, 1e-12)}, TIGHT),
    "dop853, placed": ({"integrator": I.DOP853(5e-13, 5e-13), "chart_interval": 3}, TIGHT),
    "dop853, null-space": ({"integrator": I.DOP853(1e-12, 1e-12), "formulation": "null-space"}, TIGHT),
    "dop853, maggi-kane": ({"integrator": I.DOP853(1e-12, 1e-12), "formulation": "maggi-kane"}, TIGHT),
    "nystrom4": ({"integrator": I.Nystrom4(step=1e-3)}, NEAR),
    "nystrom4, null-space": ({"integrator": I.Nystrom4(step=1e-3), "formulation": "null-space"}, NEAR),
    "rk45, null-space": ({"integrator": I.RK45(1e-11, 1e-11), "formulation": "null-space"}, FINE),
    "radau": ({"integrator": I.Radau(1e-11, 1e-11)}, FINE),
    "sdirk54": ({"integrator": I.SDIRK54(1e-9, 1e-9)}, NEAR),
    "sdirk54, null-space": ({"integrator": I.SDIRK54(1e-9, 1e-9), "formulation": "null-space"}, NEAR),
    "trapezoid": ({"integrator": I.ImplicitTrapezoid(1e-7, 1e-7)}, 1e-5),
    "trapezoid, null-space": ({"integrator": I.ImplicitTrapezoid(1e-7, 1e-7), "formulation": "null-space"}, 1e-5),
}
SPAN = 2.0


def off(one, other):
    return max(np.abs(one.q[-1] - other.q[-1]).max(), np.abs(one.qd[-1] - other.qd[-1]).max())


def by_series(scene, **options):
    return ts.simulate(scene, (0, SPAN), integrator=I.Taylor(tol=1e-15), **options).raise_if_failed()


@pytest.mark.slow_but("*sleigh-dop853*", "*table-dop*null*", "*hinges-dop*null*", "*skate-radau")
@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
@pytest.mark.parametrize("name", SCENES)
def test_methods_and_forms_agree_with_series(name, way):
    """The three levels hold to rounding, the motion is that of the series, by methods and forms of every kind."""
    scene, (options, tol) = SCENES[name](), way
    solution = ts.simulate(scene, (0, SPAN), **options).raise_if_failed()
    assert off(solution, by_series(scene)) < tol
    errors = solution.constraint_error
    drifts = options.get("formulation") == "maggi-kane"
    assert max(errors.velocity.max(), errors.acceleration.max()) < HELD
    assert errors.position.max() < (NEAR if drifts else HELD)


@pytest.mark.parametrize(
    ("method", "formulation"),
    [("taylor", "tangent"), ("dop853", "tangent"), ("dop853", "null-space"), ("dop853", "maggi-kane")],
)
def test_skate_on_a_slope(method, formulation):
    """Without rows on positions: Maggi's equations, in closed form."""
    options = {"integrator": method, "rtol": 1e-12, "atol": 1e-12, "formulation": formulation}
    solution = ts.simulate(skates.skate(), (0, 5), **options)
    x, y, xd, yd = skates.skate_at(solution.t)
    np.testing.assert_allclose(solution.position("skate")[:, :2], np.stack([x, y], 1), atol=TIGHT)
    np.testing.assert_allclose(solution.velocity("skate")[:, :2], np.stack([xd, yd], 1), atol=TIGHT)
    # The blade's push across turns the path: m (speed w + g sin(w t)) = 2 m g sin(w t)
    push = 2.0 * skates.SLOPE * np.sin(skates.TURN * solution.t)
    force, _ = solution.reaction("edge")
    np.testing.assert_allclose(np.linalg.norm(force, axis=1), np.abs(push), atol=FINE)


@pytest.mark.parametrize("formulation", ["tangent", "null-space", "maggi-kane"])
@pytest.mark.parametrize("name", ["sleigh", "on a table"])
def test_a_blade_does_no_work(name, formulation):
    solution = ts.simulate(SCENES[name](), (0, SPAN), integrator=I.DOP853(1e-12, 1e-12), formulation=formulation)
    assert np.ptp(solution.energy) < TIGHT


def test_the_table_keeps_its_angular_momentum():
    """The hinge has no torque about its axis, whatever the blade does between table and skate."""
    momentum = by_series(skates.on_a_table()).angular_momentum[:, 2]
    assert np.ptp(momentum) < HELD


ORDERS = {  # method, options, steps, least order observed
    "nystrom4": (I.Nystrom4, {}, (0.04, 0.02, 0.01), 3.9),
    "nystrom4, placed": (I.Nystrom4, {"chart_interval": 4}, (0.04, 0.02, 0.01), 3.9),
    "nystrom4, null-space": (I.Nystrom4, {"formulation": "null-space"}, (0.04, 0.02, 0.01), 3.9),
    "nystrom4, maggi-kane": (I.Nystrom4, {"formulation": "maggi-kane"}, (0.04, 0.02, 0.01), 3.9),
    "rk45": (I.RK45, {}, (0.04, 0.02, 0.01), 4.6),
    "rk45, placed": (I.RK45, {"chart_interval": 4}, (0.04, 0.02, 0.01), 4.6),
    "rk45, null-space": (I.RK45, {"formulation": "null-space"}, (0.04, 0.02, 0.01), 4.6),
    "dop853": (I.DOP853, {}, (0.2, 0.1), 7.6),
    "sdirk54": (I.SDIRK54, {}, (0.04, 0.02, 0.01), 3.8),
    "sdirk54, null-space": (I.SDIRK54, {"formulation": "null-space"}, (0.1, 0.05, 0.025), 3.8),
    "trapezoid": (I.ImplicitTrapezoid, {}, (0.04, 0.02, 0.01), 1.95),
    "trapezoid, null-space": (I.ImplicitTrapezoid, {"formulation": "null-space"}, (0.04, 0.02, 0.01), 1.95),
    "radau": (I.Radau, {}, (0.2, 0.1), 4.6),
}


@pytest.mark.slow_but("nystrom4, null-space", "rk45, placed", "radau")
@pytest.mark.parametrize("case", ORDERS.values(), ids=ORDERS)
def test_order(case):
    """Errors fall with the order of the method, on a sleigh with rows of both sorts."""
    kind, options, steps, order = case
    scene, errors = skates.sleigh(), []
    reference = by_series(scene)
    for h in steps:
        errors.append(off(ts.simulate(scene, (0, SPAN), integrator=kind(step=h), **options), reference))
    assert np.log2(errors[0] / errors[-1]) / (len(steps) - 1) > order, errors


BETWEEN = {  # options of coarse runs, how far between the steps from the series
    "taylor": ({"integrator": I.Taylor(tol=1e-13)}, FINE),
    "dop853": ({"integrator": I.DOP853(1e-9, 1e-9)}, NEAR),
    "dop853, null-space": ({"integrator": I.DOP853(1e-9, 1e-9), "formulation": "null-space"}, NEAR),
    "rk45, null-space": ({"integrator": I.RK45(1e-8, 1e-8), "formulation": "null-space"}, 1e-6),
    "nystrom4, null-space": ({"integrator": I.Nystrom4(step=0.01), "formulation": "null-space"}, 1e-6),
    "radau": ({"integrator": I.Radau(1e-8, 1e-8)}, 1e-6),
    "sdirk54, null-space": ({"integrator": I.SDIRK54(1e-8, 1e-8), "formulation": "null-space"}, 1e-6),
}


@pytest.mark.slow_but("taylor", "dop853*", "nystrom4*")
@pytest.mark.parametrize("way", BETWEEN.values(), ids=BETWEEN)
def test_dense_output(way):
    """Between the steps positions, velocities and rows are those of the motion."""
    (options, tol), scene, t = way, skates.sleigh(), np.linspace(0.01, SPAN, 97)
    solution = ts.simulate(scene, (0, SPAN), dense_output=True, **options)
    at, right = solution.at(t), by_series(scene, dense_output=True).at(t)
    np.testing.assert_allclose(at.q, right.q, atol=tol)
    np.testing.assert_allclose(at.qd, right.qd, atol=tol)
    outputs = ts.simulate(scene, (0, SPAN), t_eval=t, **options)
    errors = outputs.constraint_error
    assert max(errors.position.max(), errors.velocity.max(), errors.acceleration.max()) < HELD


@pytest.mark.parametrize("doubled", [False, True], ids=["one axle", "two axles"])
@pytest.mark.parametrize("formulation", ["tangent", "null-space", "maggi-kane"])
def test_redundant_rows_beside_rows_on_velocities(formulation, doubled):
    """A force of 10 N on a carriage of 3 kg and a rolling wheel of 1 kg, J / R^2 = 1 kg: the rail holds it already."""
    scene, place = ts.Scene(), (0, 0, 0.2)
    car = scene.add_body(3.0, (0.2, 0.2, 0.2), position=place, name="car")
    wheel = scene.add_body(1.0, (0.02, 0.04, 0.02), position=place, name="wheel")
    scene.add(ts.constraints.Translational.at(scene.ground, car, point=place, axis=(1, 0, 0)))
    for y in (0.0, 0.1)[: 1 + doubled]:
        scene.add(ts.constraints.Revolute.at(car, wheel, point=(0, y, 0.2), axis=(0, 1, 0)))
    scene.add(ts.constraints.RollingDisc(wheel, scene.ground, axis_a=(0, 1, 0), radius=0.2, normal_b=(0, 0, 1)))
    scene.add(ts.forces.PointForce(car, force=(10, 0, 0)))
    solution = ts.simulate(scene, (0, 1), integrator=I.DOP853(1e-12, 1e-12), formulation=formulation)
    solution.raise_if_failed()
    assert abs(solution.position("car")[-1, 0] - 1.0) < TIGHT


def stiff():
    """A skate on a stiff spring with a damper of 1e6 N s/m, at its free length: it turns about the spring's end."""
    scene, spring = skates.skate(), {"stiffness": 1e8, "damping": 1e6, "free_length": np.hypot(0.8, 1.9)}
    scene.add(ts.forces.Spring("skate", scene.ground, point_a=(0.2, 0.1, 0), point_b=(1, 2, 0), **spring))
    return scene


@pytest.mark.slow
def test_stiff_scenes_take_long_steps_in_the_null_space_form():
    """Steps of a thousand times what an explicit method could take; the motion is that of the tangent form."""
    runs = [
        ts.simulate(stiff(), (0, SPAN), integrator=I.SDIRK54(1e-7, 1e-7), formulation=formulation).raise_if_failed()
        for formulation in ("tangent", "null-space")
    ]
    assert off(*runs) < 1e-5
    assert runs[1].stats.steps < 1000
    assert runs[1].stats.jacobians < runs[1].stats.steps
    assert runs[1].constraint_error.velocity.max() < HELD


@pytest.mark.slow
def test_the_default_method_turns_to_an_implicit_one_in_the_null_space_form():
    solution = ts.simulate(stiff(), (0, SPAN), rtol=1e-6, atol=1e-6, formulation="null-space").raise_if_failed()
    assert "The motion is stiff: SDIRK54 took over" in solution.message
    assert off(solution, ts.simulate(stiff(), (0, SPAN), integrator=I.SDIRK54(1e-8, 1e-8))) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("name", ["skate", "sleigh", "on a table", "belt of time", "coin", "bicycle"])
def test_jacobian_of_the_null_space_form(name, rng):
    """Derivatives of (vd, wd) by (v, w), away from the chart's start and its time, against differences."""
    scene, t = SCENES[name](), 0.2
    scene.add(ts.forces.Spring(scene.bodies[0], scene.ground, point_b=(1, 2, 3), stiffness=3.0, damping=2.0))
    ode = Mixed(scene)
    z = ode.start + np.concatenate([0.05 * rng.normal(size=ode.nx), rng.normal(size=ode.ny)])
    rates, J = ode.f(z, t), ode.jacobian(t)
    expected = difference(lambda x: ode.f(x, t), z, 1e-3)
    np.testing.assert_allclose(J, expected, rtol=0, atol=1e-8 * (1.0 + np.abs(expected).max() + np.abs(rates).max()))


@pytest.mark.slow
@pytest.mark.parametrize("method", [I.RK45(1e-9, 1e-9), I.SDIRK54(1e-8, 1e-8)], ids=["rk45", "sdirk54"])
def test_the_null_space_form_crosses_singular_configurations(method):
    """A parallelogram turns over and over beside a ball that rolls down a wall, at g / (1 + J / m R^2)."""
    scene = closed_loops.parallelogram(planar=True)
    moving = {"velocity": (1, 0, 0), "angular_velocity": (0, 2, 0)}
    ball = scene.add_body(1.0, (0.1, 0.1, 0.1), (0, 0, 5.5), **moving, name="ball")
    scene.add(ts.constraints.RollingBall(ball, scene.ground, radius=0.5, point_b=(0, 0, 5), normal_b=(0, 0, 1)))
    solution = ts.simulate(scene, (0, 5), integrator=method, formulation="null-space").raise_if_failed()
    other = ts.simulate(scene, (0, 5)).raise_if_failed()
    turned = closed_loops.angles(solution)
    assert turned[0][-1] - turned[0][0] > 8.0 * np.pi
    assert off(solution, other) < 1e-5
    np.testing.assert_allclose(solution.position("ball")[-1], (5.0, -12.5 * 9.81 / 1.4, 5.5), atol=NEAR)


def test_series_against_differences():
    """The motion within a step of series, against central differences of order eight of its own values."""
    solution = by_series(skates.sleigh(), dense_output=True)
    weights, h, t = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]), 0.01, 0.73
    at = solution.at(t + h * np.arange(-4, 5))
    rates, accelerations = weights @ at.q / h, weights @ at.qd / h
    middle = solution.at(t)
    np.testing.assert_allclose(rates, middle.qd, atol=TIGHT)
    np.testing.assert_allclose(accelerations, middle.qdd, atol=TIGHT)


@pytest.mark.parametrize("order", [6, 11])
def test_order_of_series(order):
    """Errors of steps of fixed length fall with h^(order + 1) in velocities."""
    scene, errors = skates.sleigh(), []
    reference = by_series(scene)
    for h in (0.1, 0.05):
        errors.append(off(ts.simulate(scene, (0, SPAN), integrator=I.Taylor(step=h, order=order)), reference))
    assert np.log2(errors[0] / errors[1]) > order - 0.3, errors


@pytest.mark.slow
@pytest.mark.parametrize("method", [I.Taylor(step=0.05), I.RK45(step=0.005), I.Nystrom4(step=1e-3)])
def test_rows_hold_over_many_steps(method):
    """Rows on velocities stay at rounding, without growth, over 10^5 steps; so does the energy by series."""
    scene, end = skates.sleigh(), 1e5 * method.step
    solution = ts.simulate(scene, (0, end), t_eval=np.linspace(0, end, 2001), history=False, integrator=method)
    error = solution.raise_if_failed().constraint_error.velocity
    assert error.max() < HELD
    assert error[1001:].max() < 2.0 * error[:1001].max() + HELD / 100
    if isinstance(method, I.Taylor):
        assert np.ptp(solution.energy) < FINE
