"""Coordinates of joints: angles over any number of turns, displacements, rates; in solutions, states and events."""

import pickle

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.tolerances import CLOSE, FAIR, HELD, LOOSE, NEAR, ROUGH, ROUNDING
from tsdyn import constraints as c

SPEED = 20.0  # rad/s of the arm; the wheel turns against it by -4 times as much
METHODS = ["taylor", "dop853"]
SLOW = ["rk45", "sdirk54", "nystrom4"]  # ImplicitTrapezoid counts as SDIRK54 does, and takes minutes


def carousel():
    """A wheel on an arm that turns about the vertical: both turn uniformly."""
    scene = ts.Scene()
    arm = scene.add_body(
        2.0, (0.1, 0.1, 0.1), (1, 0, 0), velocity=(0, SPEED, 0), angular_velocity=(0, 0, SPEED), name="arm"
    )
    wheel = scene.add_body(
        1.0,
        (0.1, 0.2, 0.3),
        (1.5, 0, 0),
        velocity=(0, 1.5 * SPEED, 0),
        angular_velocity=(0, 0, -3 * SPEED),
        name="wheel",
    )
    scene.add(c.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 0, 1), name="hinge"))
    scene.add(c.Revolute.at(arm, wheel, point=(1.5, 0, 0), axis=(0, 0, 1), name="hub"))
    return scene


def tumbling(joint, **arguments):
    """Two bodies that tumble, with a joint between them."""
    scene = ts.Scene()
    a = scene.add_body(1.0, (0.2, 0.3, 0.4), (0, 0, 0), angular_velocity=(1, -2, 0.5), name="a")
    b = scene.add_body(2.0, (0.3, 0.2, 0.4), (0, 0, 0.8), angular_velocity=(0.5, 1, 3), velocity=(1, 2, 0), name="b")
    joint = scene.add(joint.at(a, b, point=(0, 0, 0.3), name="joint", **arguments))
    scene.assemble()
    return scene, joint


def quotient(f, t, h=1e-3):
    """The derivative of f at t, of order four."""
    return (8.0 * (f(t + h) - f(t - h)) - (f(t + 2 * h) - f(t - 2 * h))) / (12.0 * h)


@pytest.mark.parametrize("method", METHODS + [pytest.param(name, marks=pytest.mark.slow) for name in SLOW])
def test_turns_are_counted_however_few_outputs_there_are(method):
    integrator = ts.integrators.Nystrom4(step=2e-3) if method == "nystrom4" else method
    tolerances = {} if method == "nystrom4" else {"rtol": 1e-9, "atol": 1e-9}
    end = 3.0
    sparse = ts.simulate(carousel(), (0, end), integrator=integrator, t_eval=[1.1, end], **tolerances)
    every = ts.simulate(carousel(), (0, end), integrator=integrator, **tolerances)
    for solution in (sparse, every):
        assert solution.angle("hinge") == pytest.approx(SPEED * solution.t, abs=LOOSE)
        assert solution.angle("hub") == pytest.approx(-4.0 * SPEED * solution.t, abs=1e-3)
        assert solution.angle_rate("hub") == pytest.approx(np.full(solution.t.size, -4.0 * SPEED), abs=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_turns_are_counted_between_the_steps_and_on_from_a_state(method):
    options = {"integrator": method, "rtol": 1e-10, "atol": 1e-10}
    scene = carousel()
    first = ts.simulate(scene, (0, 2), dense_output=True, **options)
    t = np.linspace(0, 2, 301)
    assert first.at(t).angle("hub") == pytest.approx(-4.0 * SPEED * t, abs=ROUGH)
    assert first.at(1.3).angle("hub") == pytest.approx(-4.0 * SPEED * 1.3, abs=ROUGH)
    for state in (first.state, first.at(2.0), pickle.loads(pickle.dumps(first.state))):
        rest = ts.simulate(scene, (2, 3), state=state, t_eval=[2.9], **options)
        assert rest.angle("hub") == pytest.approx([-4.0 * SPEED * 2.9], abs=ROUGH)
    again = pickle.loads(pickle.dumps(first))
    assert (again.angle("hub") == first.angle("hub")).all()


def test_events_know_angles_over_turns():
    scene = carousel()

    def turned(t, state):
        return state.angle("hinge") - 9.0 * np.pi

    def enough(t, state):
        return state.angle("hub") + 150.0

    enough.terminal = True
    solution = ts.simulate(scene, (0, 5), events=[turned, enough])
    assert solution.t_events[0] == pytest.approx([9.0 * np.pi / SPEED], rel=NEAR)
    assert solution.reached == pytest.approx(150.0 / (4.0 * SPEED), rel=NEAR)
    assert solution.angle("hub")[-1] == pytest.approx(-150.0, abs=ROUGH)
    assert solution.state.angle("hub") == pytest.approx(-150.0, abs=ROUGH)


def test_events_are_given_positions_and_rates():
    seen = []

    def look(t, state):
        seen.append((state.position("arm"), state.velocity("arm", point=(0.5, 0, 0)), state.angle_rate("hinge")))
        assert state.rotation("arm").shape == (3, 3)
        return 1.0

    ts.simulate(carousel(), (0, 0.1), events=look)
    position, velocity, rate = seen[0]
    assert position.tolist() == [1, 0, 0]
    assert velocity == pytest.approx([0, 1.5 * SPEED, 0])
    assert rate == pytest.approx(SPEED)


def test_an_angle_is_that_of_the_rotation_between_the_bodies():
    scene, joint = tumbling(c.Cylindrical, axis=(1, 2, 2))
    solution = ts.simulate(scene, (0, 2), dense_output=True, rtol=1e-11, atol=1e-11)
    between = [solution.rotation("a").transpose(0, 2, 1)] @ solution.rotation("b")
    turn = Rotation.from_matrix(between[0]).as_rotvec() @ joint.axis_a
    assert np.angle(np.exp(1j * (solution.angle(joint) - turn))) == pytest.approx(0, abs=HELD)
    apart = solution.position("b", point=joint.point_b) - solution.position("a", point=joint.point_a)
    along = (solution.rotation("a") @ joint.axis_a * apart).sum(axis=1)
    assert solution.displacement(joint) == pytest.approx(along, abs=ROUNDING)


@pytest.mark.parametrize(
    ("kind", "arguments", "coordinates"),
    [
        (c.Cylindrical, {"axis": (1, 2, 2)}, ("angle", "displacement")),
        (c.Universal, {"axis": (1, 0, 0), "axis_b": (0, 1, 0)}, ("angle",)),
        (c.Screw, {"axis": (0, 1, 2), "lead": 0.1}, ("angle", "displacement")),
    ],
)
def test_rates_and_accelerations_are_derivatives(kind, arguments, coordinates):
    scene, joint = tumbling(kind, **arguments)
    solution = ts.simulate(scene, (0, 2), dense_output=True, rtol=1e-11, atol=1e-11)
    for name in coordinates:
        value, rate = (lambda t, n=n: getattr(solution.at(t), n)(joint) for n in (name, f"{name}_rate"))
        assert rate(0.7) == pytest.approx(quotient(value, 0.7), rel=FAIR, abs=FAIR)
        gain = getattr(solution.at(0.7), f"{name}_acceleration")(joint)
        assert gain == pytest.approx(quotient(rate, 0.7), rel=FAIR, abs=FAIR)
        assert getattr(solution, f"{name}_acceleration")(joint).shape[0] == solution.t.size


def test_angles_of_a_universal_joint_turn_the_bodies():
    scene, joint = tumbling(c.Universal, axis=(1, 0, 0), axis_b=(0, 1, 0))
    start = scene.body("a").orientation, scene.body("b").orientation
    solution = ts.simulate(scene, (0, 2))
    one, other = solution.angle(joint).T
    first = Rotation.from_rotvec(one[:, None] * joint.axis_a)
    second = Rotation.from_rotvec(other[:, None] * joint.axis_b)
    A, B = (Rotation.from_quat(np.roll(p, -1)) for p in start)
    built = first[0].inv() * (A.inv() * B) * second[0].inv()  # as it was before scene.assemble
    expected = (first * built * second).as_matrix()
    assert solution.rotation("a").transpose(0, 2, 1) @ solution.rotation("b") == pytest.approx(expected, abs=CLOSE)


def test_points_of_bodies_move_with_them():
    scene, _ = tumbling(c.Spherical)
    solution = ts.simulate(scene, (0, 2), dense_output=True, rtol=1e-11, atol=1e-11)
    s = (0.3, -0.2, 0.5)
    state = solution.at(0.7)
    assert state.position("b", s) == pytest.approx(state.position("b") + state.rotation("b") @ s)
    assert state.velocity("b", s) == pytest.approx(quotient(lambda t: solution.at(t).position("b", s), 0.7), abs=NEAR)
    assert state.acceleration("b", point=s) == pytest.approx(
        quotient(lambda t: solution.at(t).velocity("b", s), 0.7), abs=FAIR
    )
    assert solution.acceleration("b", point=s).shape == (solution.t.size, 3)


def test_a_motor_and_its_joint_have_the_angle_prescribed():
    scene = ts.Scene()
    arm = scene.add_body(2.0, (0.1, 0.2, 0.1), (0.5, 0, 0), velocity=(0, 0, -6), angular_velocity=(0, 12, 0))
    hinge = scene.add(c.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    motor = scene.add(c.RotationMotor.of(hinge, angle=ts.motions.Ramp(0.0, 12.0), name="motor"))
    brake = scene.add(
        ts.forces.TorsionalSpring(
            scene.ground, arm, axis_a=(0, 1, 0), reference_a=(1, 0, 0), reference_b=(1, 0, 0), damping=1.5
        )
    )
    solution = ts.simulate(scene, (0, 4), t_eval=[0, 3.0, 4.0], dense_output=True)
    for item in (hinge, "motor"):
        assert solution.angle(item) == pytest.approx([0, 36, 48], abs=CLOSE)
    _, torque = solution.reaction("motor", on=arm)
    assert solution.power_of(motor) == pytest.approx(12.0 * torque[:, 1])
    assert solution.power_of("motor") + solution.power_of(brake) == pytest.approx(solution.power - solution.dissipation)
    put_in, lost = solution.work_of(motor), solution.work_of(brake)
    assert lost[-1] < 0.0
    assert put_in + lost == pytest.approx(solution.energy - solution.energy[0], abs=NEAR)
    assert solution.power_of(hinge) == pytest.approx([0, 0, 0], abs=HELD)


def test_a_screw_counts_the_turns_that_its_travel_says():
    scene = ts.Scene(gravity=(0, 0, 0))
    nut = scene.add_body(1.0, (0.1, 0.1, 0.1), (0, 0, 0.5), velocity=(0, 0, 0.2), angular_velocity=(0, 0, 20))
    screw = scene.add(c.Screw(scene.ground, nut, axis_a=(0, 0, 1), axis_b=(0, 0, 1), lead=0.01))
    solution = ts.simulate(scene, (0, 3), t_eval=[0, 3])
    assert solution.displacement(screw) == pytest.approx([0.5, 1.1], abs=CLOSE)
    assert solution.angle(screw) == pytest.approx([50, 110], abs=ROUGH)


class Hinge(ts.Joint):
    """A plug-in: a Revolute by another name, its coordinate declared."""

    markers = c.Revolute.markers
    joint_coordinates = (ts.Angle(),)

    def __init__(self, a, b, *, point_a=(0, 0, 0), point_b=(0, 0, 0), axis_a=None, axis_b=None, name=""):
        super().__init__(a, b, (point_a, point_b, axis_a, axis_b), name)

    def compose(self):
        yield "hinge", c.Revolute(self.a, self.b, **{m.argument: getattr(self, m.argument) for m in self.markers})


def test_a_joint_of_ones_own_declares_its_coordinates():
    scene, joint = tumbling(Hinge, axis=(1, 2, 2))
    other, revolute = tumbling(c.Revolute, axis=(1, 2, 2))
    angles = [ts.simulate(s, (0, 1)).angle(j) for s, j in ((scene, joint), (other, revolute))]
    assert (angles[0] == angles[1]).all()


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda s: s.angle("hing"), "did you mean 'hinge'"),
        (lambda s: s.displacement("hinge"), "it has an angle"),
        (lambda s: s.angle("arm"), "no constraint or force is named 'arm'"),
        (lambda s: s.angle(s.scene.bodies[0]), "no coordinate"),
        (lambda s: s.angle(carousel().constraints[0]), "not a constraint or force of this"),
        (lambda s: s.position("ram"), "did you mean 'arm'"),
        (lambda s: s.position("arm", point=(1, 2)), "three finite numbers"),
        (lambda s: s.reaction("hinge", on="hub"), "no body is named 'hub'"),
        (lambda s: s.power_of("xyz"), "there are 'hinge', 'hub'"),
    ],
)
def test_what_there_is_not_is_refused_by_name(ask, message):
    with pytest.raises(ts.TsdynError, match=message):
        ask(ts.simulate(carousel(), (0, 0.01)))
