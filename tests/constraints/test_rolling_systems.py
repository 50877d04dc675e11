"""Systems of rolling bodies and blades: bicycle, trailers, snakeboard, against published data and closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts
from examples import bicycle, two_wheeled_robot
from tsdyn.rows.constraint_graph import build
from tsdyn.rows.interface import allocate_tangent

C = ts.constraints
UP = (0.0, 0.0, 1.0)


def trailers(count, radius, hitch=1.0, rate=0.5):
    """A train of trailers, axle hitched to axle, on circles about the origin: radius^2 shrinks by hitch^2 each."""
    scene = ts.Scene(gravity=(0, 0, 0))
    radii = np.sqrt(radius**2 - hitch**2 * np.arange(count + 1))
    angle, last = 0.0, scene.ground
    for i, own in enumerate(radii):
        place = own * np.array((np.cos(angle), np.sin(angle), 0.0))
        axle = scene.add_body(
            1.0 + 0.1 * (i % 3), (0.1, 0.1, 0.2), position=place, velocity=rate * np.cross(UP, place),
            orientation=(np.cos(angle / 2), 0, 0, np.sin(angle / 2)), angular_velocity=(0, 0, rate), name=f"axle {i}",
        )  # fmt: skip
        if i == 0:
            scene.add(C.Planar.at(scene.ground, axle, point=place, axis=UP))
        else:
            hinge = {"point": last.position, "axis": UP}
            scene.add(C.Revolute.at(last, axle, **hinge, name=f"hitch {i}"))
        scene.add(C.KnifeEdge(axle, scene.ground, axis_a=(1, 0, 0), normal_b=UP))
        last, angle = axle, angle - np.arctan2(hitch, radii[min(i + 1, count)])
    return scene, radii


def entries(count):
    """Numbers of the factorised matrix of all rows."""
    scene, _ = trailers(count, 40.0)
    graph, _ = build(scene.packed)
    return allocate_tangent(graph, 7 * len(scene.bodies)).rows.S.size


@pytest.mark.parametrize("count", [3, 100, pytest.param(1000, marks=pytest.mark.slow)])
def test_trailers_run_on_circles(count):
    """The whole train turns as one rigid body: each axle across its circle, no hinge moves, the speed stays."""
    scene, radii = trailers(count, 40.0)
    solution = ts.simulate(scene, (0.0, 1.0), t_eval=np.linspace(0, 1, 5), rtol=1e-12, atol=1e-12)
    for i in (0, count // 2, count):
        place = solution.position(f"axle {i}")
        turned = np.array([(np.cos(0.5 * t), np.sin(0.5 * t)) for t in solution.t])
        start = complex(*place[0, :2])
        expected = start * (turned[:, 0] + 1j * turned[:, 1])
        np.testing.assert_allclose(place[:, 0] + 1j * place[:, 1], expected, atol=1e-10)
        np.testing.assert_allclose(np.linalg.norm(place[:, :2], axis=1), radii[i], rtol=1e-12)
    assert np.ptp(solution.energy) < 1e-10 * solution.energy[0]
    assert solution.constraint_error.velocity.max() < 1e-12


@pytest.mark.slow
def test_trailers_cost_in_proportion_to_their_number():
    assert entries(400) < 4.1 * entries(100)


def test_a_train_has_two_degrees_of_freedom_of_velocities():
    """It drives and steers; every hitch is one more of positions."""
    for count in (0, 1, 7):
        mobility = trailers(count, 40.0)[0].mobility()
        assert mobility.degrees_of_freedom == 2
        assert "redundant rows      none" in str(mobility)


def test_snakeboard():
    """A rotor that swings and wheels that steer in turn propel the board, as the reduced equation has it.

    u' (m + J tan(f)^2 / l^2) = -(tan(f) / l) (J u f' / (l cos(f)^2) + I p''),  theta' = u tan(f) / l
    u: speed, f: steering angle of both axles, in opposite senses, p: of the rotor, I its inertia, J the whole
    """
    l, board, rotor, axle = 0.4, (3.0, 0.12), (1.0, 0.05), (0.4, 0.004)  # m; kg and kg m^2
    scene, t = ts.Scene(), ts.motions.time
    steering, swing = 0.5 * np.sin(2.0 * t), 1.5 * np.sin(2.0 * t + 0.7)

    def body(name, given, x=0.0, rate=0.0):
        mass, inertia = given
        return scene.add_body(mass, (0.1, 0.1, inertia), (x, 0, 0), angular_velocity=(0, 0, rate), name=name)

    deck, wheel = body("board", board), body("rotor", rotor, rate=3.0 * np.cos(0.7))
    axles = [body("front", axle, l, 1.0), body("rear", axle, -l, -1.0)]
    scene.add(C.Planar.at(scene.ground, deck, point=(0, 0, 0), axis=UP))
    for other, motion in ((wheel, swing), (axles[0], steering), (axles[1], -1.0 * steering)):
        hinge = scene.add(C.Revolute.at(deck, other, point=other.position, axis=UP, name=f"{other.name} hinge"))
        scene.set(hinge, angle=motion(0.0))
        scene.add(C.RotationMotor.of(hinge, angle=motion))
    for one in axles:
        scene.add(C.KnifeEdge(one, scene.ground, axis_a=(0, 1, 0), normal_b=UP))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 10.0), t_eval=np.linspace(0, 10, 41), rtol=1e-12, atol=1e-12)

    mass, inertia = board[0] + rotor[0] + 2 * axle[0], board[1] + rotor[1] + 2 * (axle[1] + axle[0] * l**2)

    def rate(t, y):
        u, theta = y[:2]
        f, fd, pdd = 0.5 * np.sin(2 * t), np.cos(2 * t), -6.0 * np.sin(2 * t + 0.7)
        k = np.tan(f) / l
        ud = -k * (inertia * u * fd / (l * np.cos(f) ** 2) + rotor[1] * pdd) / (mass + inertia * k**2)
        return ud, u * k, u * np.cos(theta), u * np.sin(theta)

    start = scene.bodies[0].velocity[0]
    found = solve_ivp(rate, (0, 10), (start, 0, 0, 0), "DOP853", solution.t, rtol=1e-13, atol=1e-13).y
    np.testing.assert_allclose(solution.position("board")[:, :2], found[2:].T, atol=1e-9)
    assert np.linalg.norm(found[2:, -1]) > 0.5  # it has gone somewhere


@pytest.mark.slow
def test_two_wheels_on_one_axle():
    """Of two rows across the path one is redundant, and one is not: a push from the side moves nothing."""
    scene = two_wheeled_robot.build()
    assert (scene.mobility().degrees_of_freedom, len(scene.mobility().redundant)) == (3, 1)
    assert len(scene.linearise().rates) == 3
    place = scene["body"].position
    scene.add(ts.forces.PointForce(scene["body"], point_a=(0, 0, -two_wheeled_robot.HEIGHT), force=(0, 5.0, 0)))
    solution = ts.simulate(scene, (0.0, 1.0)).raise_if_failed()
    np.testing.assert_allclose(solution.position("body"), np.tile(place, (solution.t.size, 1)), atol=1e-14)
    assert not solution.reaction_unique("left tyre").any()
    total = sum(solution.reaction(name)[0] for name in ("left tyre", "right tyre"))
    np.testing.assert_allclose(total, np.tile((0, -5.0, 9.81 * 9.6), (solution.t.size, 1)), atol=1e-11)


@pytest.mark.slow
def test_bicycle():
    """Published eigenvalues to 1e-9, self-stable between the published speeds, and a ride that recovers."""
    bicycle.check(ts.simulate(bicycle.build(), (0.0, 10.0)).raise_if_failed())
