"""Times are compared relative to the step, the run and their own rounding: any unit of time gives the same motion."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PPoly

import tsdyn as ts
from tests.helpers.tolerances import ALGEBRA, CLOSE, FAIR, HELD, NEAR, ROUNDING
from tsdyn.files.run_tables import output_times

I, C = ts.integrators, ts.constraints
END = 2.0  # units of time
SCALES = [1e-15, 1e-9, 1e9, 1e15]  # s
every_scale = pytest.mark.parametrize("unit", SCALES, ids="{:g} s".format)


def double_pendulum(unit):
    """Two bodies in space on a spring, and a damper; lengths and masses stay, velocities and forces follow the unit."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81 / unit**2))
    upper = scene.add_body(
        1.0, (0.1, 0.2, 0.3), (0.5, 0, 0), velocity=(0, 0, -0.15 / unit), angular_velocity=(0, 0.3 / unit, 0), name="a"
    )
    lower = scene.add_body(
        1.0, (0.1, 0.2, 0.3), (1.5, 0, 0), velocity=(0, 0, -0.45 / unit), angular_velocity=(0, 0.3 / unit, 0), name="b"
    )
    scene.add(C.Revolute.at(upper, scene.ground, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    scene.add(C.Spherical(upper, lower, point_a=(0.5, 0, 0), point_b=(-0.5, 0, 0)))
    stiffness, damping = 20.0 / unit**2, 0.3 / unit
    scene.add(ts.forces.Spring(lower, scene.ground, point_b=(2, 1, 1), stiffness=stiffness, damping=damping))
    return scene


def driven(unit):
    """A motor that follows a table, and a body on it."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81 / unit**2))
    upper = scene.add_body(1.0, (0.1, 0.2, 0.3), (0.5, 0, 0), name="a")
    lower = scene.add_body(1.0, (0.1, 0.2, 0.3), (1.5, 0, 0), name="b")
    hinge = scene.add(C.Revolute.at(upper, scene.ground, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    table = CubicSpline(np.array([0.0, 0.3, 0.7, 1.3, 2.5]) * unit, [0.0, 0.2, 0.1, 0.5, 0.3])
    scene.add(C.RotationMotor.of(hinge, angle=table))
    scene.add(C.Spherical(upper, lower, point_a=(0.5, 0, 0), point_b=(-0.5, 0, 0)))
    scene.assemble()
    return scene


def measured(scene, unit, method, **options):
    """A run in units of time: positions, velocities, accelerations, dense output, multipliers and event times."""
    solution = ts.simulate(
        scene,
        (0.0, END * unit),
        integrator=method,
        t_eval=np.linspace(0.0, END, 33) * unit,
        dense_output=True,
        events=[lambda t, state: state.position("a")[0] - 0.3, lambda t, state: np.cos(9.0 * t / unit)],
        **options,
    ).raise_if_failed()
    state = solution.at(np.linspace(0.01, 1.9, 7) * unit)
    return (
        solution.q, solution.qd * unit, solution.qdd * unit**2, state.q, state.qd * unit,
        solution.multipliers * unit**2, *(times / unit for times in solution.t_events),
    )  # fmt: skip


def bits(scene, step, power):
    expected = measured(scene(1.0), 1.0, step(1.0))
    unit = 2.0**power
    for one, other in zip(measured(scene(unit), unit, step(unit)), expected, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("power", [-50, 3, 50])
@pytest.mark.parametrize("kind", [I.Nystrom4, I.RK45, I.DOP853], ids=lambda kind: kind.__name__)
def test_powers_of_two_change_no_bit_of_fixed_steps(kind, power):
    bits(double_pendulum, lambda unit: kind(step=0.02 * unit), power)


@pytest.mark.parametrize("power", [-4, 4])
def test_powers_of_two_change_no_bit_of_series(power):
    bits(double_pendulum, lambda unit: I.Taylor(step=0.05 * unit), power)


def digits(scene, method, unit, tolerance):
    for one, other in zip(measured(scene(unit), unit, method), measured(scene(1.0), 1.0, method), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=tolerance * (1.0 + np.abs(other).max()))


ADAPTIVE = [None, I.Taylor(1e-12), I.DOP853(1e-10, 1e-10), I.RK45(1e-8, 1e-8)]
IMPLICIT = [I.SDIRK54(1e-8, 1e-8), I.Radau(1e-8, 1e-8)]


@every_scale
@pytest.mark.parametrize("method", ADAPTIVE, ids=repr)
def test_the_same_digits_in_femtoseconds_and_in_years(method, unit):
    """RK45 began with 1e-6 s whatever the run's length; coefficients of series overflowed or vanished."""
    digits(double_pendulum, method, unit, FAIR)


@pytest.mark.slow
@every_scale
@pytest.mark.parametrize("method", [*ADAPTIVE, *IMPLICIT], ids=repr)
def test_the_same_digits_of_driven_scenes(method, unit):
    digits(driven, method, unit, 1e2 * FAIR)


@pytest.mark.slow
@every_scale
@pytest.mark.parametrize("kind", [I.ImplicitTrapezoid, I.SDIRK54, I.Radau], ids=lambda kind: kind.__name__)
def test_the_same_digits_of_implicit_fixed_steps(kind, unit):
    expected = measured(double_pendulum(1.0), 1.0, kind(step=0.02))
    for one, other in zip(measured(double_pendulum(unit), unit, kind(step=0.02 * unit)), expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=CLOSE * (1.0 + np.abs(other).max()))


@pytest.mark.parametrize("order", [None, 28])
@every_scale
def test_energy_of_a_series_of_any_rate(unit, order):
    """A coefficient of order 28 is 1e420 at 1e15 / s."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81 / unit**2))
    arm = scene.add_body(1.0, (0.1, 0.2, 0.3), (0.5, 0, 0))
    scene.add(C.Spherical(arm, scene.ground, point_a=(-0.5, 0, 0)))
    solution = ts.simulate(scene, (0.0, 3.0 * unit), integrator=I.Taylor(order=order)).raise_if_failed()
    assert np.abs(solution.energy).max() < HELD * solution.kinetic_energy.max()


@every_scale
def test_kinematics_sampled_controllers_and_stores(unit, tmp_path):
    """Numbers of instants, positions at them, and a run that is read from its store."""

    def parts(unit, path):
        times = np.linspace(0.0, END, 21) * unit
        scene = ts.Scene(gravity=(0.0, 0.0, -9.81 / unit**2))
        arm = scene.add_body(1.0, (0.1, 0.2, 0.3), (0.5, 0, 0), name="arm")
        hinge = scene.add(C.Revolute.at(arm, scene.ground, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
        asked = []

        def controller(t, angle, rate):
            asked.append(t)
            return (-4.0 * angle - 0.5 * rate * unit) / unit**2

        scene.add(ts.forces.JointTorque(hinge, function=controller, period=0.05 * unit))
        method = I.Nystrom4(step=0.01 * unit)
        run = ts.simulate(scene, (0.0, END * unit), integrator=method, store=path, checkpoint=1e-3)
        count = len(asked)
        again = ts.load(path, scene=scene)
        driven = ts.Scene()
        arm = driven.add_body(1.0, (0.1, 0.2, 0.3), (0.5, 0, 0), name="arm")
        hinge = driven.add(C.Revolute.at(arm, driven.ground, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
        driven.add(C.RotationMotor.of(hinge, angle=lambda t: 0.3 * np.sin(7.0 * t / unit)))
        driven.assemble()
        followed = driven.kinematics(times)
        return count, run.q, np.asarray(again.q), followed.q, followed.qd * unit

    count, *expected = parts(1.0, tmp_path / "one.h5")
    other, *found = parts(unit, tmp_path / "other.h5")
    assert other == count == 40
    for one, two in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, two, rtol=0, atol=ALGEBRA)


@pytest.mark.slow
@every_scale
def test_ensembles(unit):
    masses = {"a.mass": np.linspace(1.0, 2.0, 6)}
    one, other = (ts.ensemble(double_pendulum(t), masses, (0.0, END * t)) for t in (1.0, unit))
    np.testing.assert_allclose(other.q, one.q, rtol=0, atol=FAIR)
    np.testing.assert_allclose(other.qd * unit, one.qd, rtol=0, atol=10 * FAIR)


@pytest.mark.parametrize("unit", [1e-15, 1e-3, 1e15], ids="{:g} s".format)
def test_from_rest_to_a_tight_tolerance(unit):
    """Accelerations over atol asked for a first step of 1e-20 of the run."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81 / unit**2))
    arm = scene.add_body(1.0, (0.1, 0.2, 0.3), (0.5, 0, 0))
    scene.add(C.Revolute.at(arm, scene.ground, point=(0, 0, 0), axis=(0, 1, 0)))
    solution = ts.simulate(scene, (0.0, 10.0 * unit), integrator=I.DOP853(1e-12, 1e-12)).raise_if_failed()
    assert np.abs(solution.energy).max() < NEAR * solution.kinetic_energy.max()


# knots and events much nearer to the start than the end is


def test_pulses_at_the_start_of_a_long_run():
    """Momentum of a pulse of 1e13 N over 1e-13 s, in a run of 100 s: its knots were one with each other."""
    pulse = CubicSpline(np.array([0.0, 1.0, 2.0, 3.0]) * 1e-13, [0.0, 1e13, 0.0, 0.0])
    load = PPoly(np.column_stack((pulse.c, np.zeros(4))), np.append(pulse.x, 1e3))  # and nothing from then on
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0))
    mass = scene.add_point_mass(1.0)
    scene.add(ts.forces.PointForce(mass, force=(load, 0.0, 0.0)))
    solution = ts.simulate(scene, (0.0, 100.0), integrator=I.Nystrom4(step=10.0))
    np.testing.assert_allclose(solution.state.velocity(mass)[0], pulse.integrate(0.0, 3e-13), rtol=NEAR)


@pytest.mark.parametrize("unit", [1e-15, 1e-13, 1e-10, 1.0, 1e10])
@pytest.mark.parametrize("method", [None, I.DOP853()], ids=repr)
def test_event_times_are_relative(unit, method):
    """Bodies from rest under constant acceleration reach 1 m, and 1e-12 m, at sqrt(2 d / a)."""
    scene = ts.Scene(gravity=(2.0 / unit**2, 0.0, 0.0))
    scene.add_point_mass(1.0, name="ball")
    events = [lambda t, state, d=d: state.position("ball")[0] - d for d in (1.0, 1e-12)]
    far, near = ts.simulate(scene, (0.0, 1.51 * unit), integrator=method, events=events).t_events
    np.testing.assert_allclose([far[0], near[0]], [unit, 1e-6 * unit], rtol=HELD)


# offsets: comparisons to the rounding of the times


@pytest.mark.parametrize("start", [0.0, 1e9, -1e9])
def test_stops_within_rounding_of_each_other(start):
    """Knots, instants and grid at the same places: no step of 1e-7 s, and no instant left out."""
    asked = []
    scene = ts.Scene()
    arm = scene.add_body(1.0, (0.1, 0.2, 0.3), (0.5, 0, 0))
    hinge = scene.add(C.Revolute.at(arm, scene.ground, point=(0, 0, 0), axis=(0, 1, 0)))
    table = ts.Table(start + np.arange(21) * 0.07, np.sin(np.arange(21)))
    scene.add(ts.forces.Spring(arm, scene.ground, point_b=(0, 0, 3), stiffness=1.0, actuator=table))
    scene.add(ts.forces.JointTorque(hinge, function=lambda t, x, v: asked.append(t) or -x, period=0.07))
    solution = ts.simulate(scene, (start, start + 1.05), integrator=I.Nystrom4(step=0.01)).raise_if_failed()
    assert np.diff(solution.t).min() > 0.0099
    assert len(asked) == (15 if start == 0.0 else 16)  # from an instant on, and from between two


def test_fixed_steps_far_from_zero():
    scene = ts.Scene()
    scene.add_point_mass(1.0)
    for end in (0.1, 0.3, 0.7):
        solution = ts.simulate(scene, (1e9, 1e9 + end), integrator=I.Nystrom4(step=1e-3))
        assert solution.stats.steps == round(1e3 * end)
    assert np.diff(output_times(1e9, 1e9 + 0.3, 1e-3)).min() > 9e-4


def test_kinematics_far_from_zero():
    """A motor of 100 rad/s takes steps of 2 ms, 1e9 s from zero as anywhere."""
    start, scene = 1e9, ts.Scene()
    arm = scene.add_body(1.0, (0.1, 0.2, 0.3), (0.5, 0, 0))
    hinge = scene.add(C.Revolute.at(arm, scene.ground, point=(0, 0, 0), axis=(0, 1, 0)))
    scene.add(C.RotationMotor.of(hinge, angle=100.0 * (ts.motions.time - start)))
    scene.assemble(t=start)
    times = start + np.linspace(0.0, 1.0, 11)
    solution = scene.kinematics(times)
    assert solution.success
    turned = np.abs(solution.angle(hinge) - solution.angle(hinge)[0])
    np.testing.assert_allclose(turned, 100.0 * (times - start), rtol=0, atol=ROUNDING * start)


# values of events


@pytest.mark.parametrize("terminal", [False, True])
@pytest.mark.parametrize("scale", [1e-150, 1e-200, -1e-300, 1e-310, 1e200, 1e300, -2e307])
def test_values_of_any_size(scale, terminal):
    def crossing(t, state):
        return scale * (t - 1.0)

    crossing.terminal = terminal
    scene = ts.Scene()
    scene.add_point_mass(1.0)
    events = [crossing, lambda t, state: scale * np.sin(20.0 * t + 0.1), lambda t, state: scale * (t - 0.5) ** 2]
    with np.errstate(all="raise", under="ignore"):
        one, many, touch = ts.simulate(scene, (0.0, 3.0), integrator=I.DOP853(), events=events).t_events
    expected = (np.arange(1, 30) * np.pi - 0.1) / 20.0
    np.testing.assert_allclose(one, [1.0], rtol=HELD)
    np.testing.assert_allclose(many, expected[expected < (1.0 if terminal else 3.0)], rtol=0, atol=HELD)
    np.testing.assert_allclose(touch, [0.5], rtol=0, atol=1e2 * FAIR)  # its values round to zero around


def test_values_that_span_all_sizes():
    scene = ts.Scene()
    scene.add_point_mass(1.0)
    events = [lambda t, state, a=a: np.exp(900.0 * (t / 3.0 - 0.5)) - a for a in (1e180, 1.0, 1e-180)]
    times = ts.simulate(scene, (0.0, 3.0), integrator=I.DOP853(), events=events).t_events
    expected = [3.0 * (0.5 + np.log(a) / 900.0) for a in (1e180, 1.0, 1e-180)]
    np.testing.assert_allclose(np.concatenate(times), expected, rtol=HELD)


def test_a_run_from_a_terminal_event_on_with_time_set_to_zero():
    """Each leg finds the next event, not the zero that it begins at."""
    scene = ts.Scene(gravity=(0.0, 0.0, -10.0))
    ball = scene.add_point_mass(1.0, position=(1e3, 0.0, 1e3 + 5.0))

    def lands(t, state):
        return state.position(ball)[2] - 1e3

    lands.terminal, lands.direction = True, -1
    state, legs = None, []
    for _ in range(4):
        solution = ts.simulate(scene, (0.0, 5.0), integrator=I.DOP853(step=0.01), events=lands, state=state)
        assert solution.status == ts.Status.EVENT
        legs.append(solution.state.t)
        state = solution.state._replace(t=0.0, qd=-solution.state.qd)
    np.testing.assert_allclose(legs, [1.0, 2.0, 2.0, 2.0], rtol=0, atol=FAIR)
