"""Taylor series of whole scenes against the equations of motion, and their trajectories against DOP853's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.plug_ins import Rod, Soft
from tests.helpers.scenes import (
    BETWEEN,
    PRIMITIVES,
    build,
    product,
    random_body,
    random_chain,
    random_pair,
    rotation,
    unit,
)
from tests.helpers.tolerances import ALGEBRA, FINE, HELD, ROUNDING, TIGHT
from tsdyn.elements.bodies import transform_g
from tsdyn.elements.loops.constraint_series import BODY_ROW, S_OMEGA, S_R
from tsdyn.taylor.layout import room
from tsdyn.workspaces import B_DATA, B_H

C, F = ts.constraints, ts.forces
ORDER = 16
PLACES = {"point_a": (0.2, -0.3, 0.1), "point_b": (-0.1, 0.2, 0.3)}
AXES = {"axis_a": (0, 0.2, 1), "reference_a": (1, 0, 0), "reference_b": (0.9, 0.4, 0.1)}
BOTH = {
    "spring": (F.Spring, PLACES | {"stiffness": 8.0, "damping": 0.7, "free_length": 0.4, "actuator": 0.3}),
    "spring, undamped": (F.Spring, PLACES | {"stiffness": 8.0}),
    "torsional spring": (
        F.TorsionalSpring,
        AXES | {"stiffness": 2.0, "damping": 0.1, "free_angle": 0.4, "actuator": 0.2},
    ),
    "bushing": (
        F.Bushing,
        PLACES
        | {"stiffness": (4, 5, 6), "damping": (0.1, 0.2, 0.3)}
        | {"torsional_stiffness": (1, 2, 3), "torsional_damping": (0.3, 0.2, 0.1)},
    ),
    "bushing, linear": (F.Bushing, PLACES | {"stiffness": (4, 5, 6)}),
    "bushing, torsional": (F.Bushing, {"torsional_stiffness": (1, 2, 3)}),
}
ONE = {
    "friction": (F.ViscousFriction, {"point_a": (0.2, -0.3, 0.1), "damping": 0.7, "torsional_damping": 0.2}),
    "force": (F.PointForce, {"point_a": (0.2, -0.3, 0.1), "force": (3, 1, 2)}),
    "force, of the body": (F.PointForce, {"point_a": (0.2, -0.3, 0.1), "force": (3, 1, 2), "frame": "body"}),
    "torque": (F.Torque, {"torque": (0.3, 0.1, 0.2)}),
    "torque, of the body": (F.Torque, {"torque": (0.3, 0.1, 0.2), "frame": "body"}),
    "plug-in": (Soft, {"point_a": (0.2, -0.3, 0.1)}),
}
ALONE = [(name, between) for name in BOTH for between in BETWEEN] + [(name, "body to body") for name in ONE]


def add(scene, name, between="body to body"):
    """Add a force between the first two bodies of a scene, or one of them and the ground."""
    kind, arguments = (BOTH | ONE)[name]
    everything = [scene.ground, *scene.bodies]
    a, b = (everything[i] for i in BETWEEN[between])
    on = (a,) if kind in (F.PointForce, F.Torque, Soft) else (a, b)
    return scene.add(kind(*on, **arguments))


def first_step(scene):
    """The series of a run's first step: h, and for each body r (k, 3), A (k, 3, 3) and omega' (k - 1, 3)."""
    method = ts.integrators.Taylor(order=ORDER)
    solution = ts.simulate(scene, (0.0, 1.0), integrator=method, dense_output=True, max_steps=1)
    block, orders = solution._trajectory.blocks[0], room(ORDER)
    data = block[B_DATA + 1 + solution.q.shape[1] :]
    bodies = []
    for b in range(len(scene.bodies)):
        row = data[b * BODY_ROW * orders : (b + 1) * BODY_ROW * orders]
        part = {first: row[first * orders : (first + 4) * orders].reshape(-1, 4)[:, :3] for first in (S_R, S_OMEGA)}
        A = row[: 12 * orders].reshape(-1, 3, 4)[:, :, :3].swapaxes(1, 2)
        bodies.append((part[S_R][: ORDER + 2], A[: ORDER + 2], part[S_OMEGA][: ORDER + 1]))
    return block[B_H], bodies


def value(series, t, derivative=0):
    """A polynomial or its derivative at t, coefficients along the first axis."""
    for _ in range(derivative):
        series = series[1:] * np.arange(1, len(series)).reshape(-1, *[1] * (series.ndim - 1))
    return np.tensordot(t ** np.arange(len(series)), series, 1)


def solves_the_equations(scene):
    """r'' and omega'' of the first step's series, within it and before it, are what `evaluate` finds at its q and qd.

    As the polynomials end at order 17, what is left is as small as rounding only where they are short enough.
    """
    h, bodies = first_step(scene)
    for t in (-0.5 * h, 0.2 * h, 0.5 * h):
        q, qd, expected = [], [], []
        for (r, A, omega), body in zip(bodies, scene.bodies, strict=True):
            q.append(value(r, t))
            qd.append(value(r, t, 1))
            expected.append(value(r, t, 2))
            if body.dimension == 7:
                np.testing.assert_allclose(value(A, t).T @ value(A, t), np.eye(3), rtol=0, atol=ROUNDING)
                p = np.roll(Rotation.from_matrix(value(A, t)).as_quat(), 1)
                q.append(p if p @ body.orientation > 0 else -p)
                qd.append(product(q[-1], np.append(0.0, value(omega, t))) / 2)
                expected.append(value(omega, t, 1))
        q, qd = np.concatenate(q), np.concatenate(qd)
        at = scene.evaluate(q, qd)
        assert np.abs(at.Phi).max(initial=0.0) < ALGEBRA
        assert np.abs(at.Phi_q @ qd).max(initial=0.0) < HELD
        got, i = [], 0
        for body in scene.bodies:
            got.append(at.qdd[i : i + 3])
            if body.dimension == 7:
                got.append(2 * transform_g(q[None, i + 3 : i + 7])[0] @ at.qdd[i + 3 : i + 7])
            i += body.dimension
        got, expected = np.concatenate(got), np.concatenate(expected)
        np.testing.assert_allclose(expected, got, rtol=0, atol=HELD * (1 + np.abs(got).max()))


def follows_the_same_path(scene, end=0.6):
    """The trajectory of the Taylor integrator at all times of an output, and DOP853's."""
    times = np.linspace(0.0, end, 7)
    run = ts.simulate(scene, (0, end), integrator=ts.integrators.Taylor(tol=1e-14), t_eval=times).raise_if_failed()
    method = ts.integrators.DOP853(rtol=1e-13, atol=1e-13)
    reference = ts.simulate(scene, (0, end), integrator=method, t_eval=times).raise_if_failed()
    size = 1 + np.abs(reference.qdd).max()  # how fast errors of the velocities grow
    for name in ("q", "qd", "qdd"):
        got, expected = getattr(run, name), getattr(reference, name)
        np.testing.assert_allclose(got, expected, rtol=0, atol=TIGHT * size * (size if name == "qdd" else 1))


def chain(rng):
    """Two links from the ground, their inertias full matrices."""
    return build(random_chain(rng, 2))


@pytest.mark.slow_for("plug-in*", "force, of the body*", "torque, of the body*")
@pytest.mark.parametrize(("name", "between"), ALONE)
def test_a_force_alone(name, between, rng):
    scene = chain(rng)
    add(scene, name, between)
    solves_the_equations(scene)
    follows_the_same_path(scene)


@pytest.mark.parametrize("between", BETWEEN)
@pytest.mark.parametrize("name", [name for name in PRIMITIVES if "driven" not in name])
def test_a_primitive_alone(name, between, rng):
    scene = build(random_pair(rng, name, between))
    scene.assemble()
    solves_the_equations(scene)
    follows_the_same_path(scene)


@pytest.mark.slow
@pytest.mark.parametrize("between", BETWEEN)
def test_a_plug_in_with_a_square_root(between, rng):
    scene = ts.Scene()
    for place in ((0, 0, 1), (1.2, 0.4, -0.3)):
        scene.add_body(**random_body(rng, position=place))
    everything = [scene.ground, *scene.bodies]
    a, b = (everything[i] for i in BETWEEN[between])
    scene.add(Rod(a, b, point_a=0.4 * unit(rng), point_b=0.4 * unit(rng), length=1.5))
    scene.assemble()
    solves_the_equations(scene)
    follows_the_same_path(scene)


@pytest.mark.parametrize("end", ["body", "ground", "point mass"])
def test_forces_on_point_masses(end, rng):
    """Their Euler parameters are (1, 0, 0, 0) and they take no torque."""
    scene = ts.Scene(gravity=(1, 2, 3))
    mass = scene.add_point_mass(0.7, position=(1, 2, 3), velocity=rng.normal(size=3))
    body = scene.add_body(**random_body(rng))
    other = scene.add_point_mass(0.3, position=(-1, 1, 2), velocity=rng.normal(size=3))
    b = {"body": body, "ground": scene.ground, "point mass": other}[end]
    scene.add(F.Spring(mass, b, stiffness=5.0, damping=0.2, free_length=1.0))
    scene.add(F.Spring(b, mass, stiffness=1.0))
    scene.add(F.PointForce(other, force=(1, 0, 0)))
    if end != "point mass":
        scene.add(F.ViscousFriction(mass, b, damping=0.3))
        scene.add(C.Distance(other, b))
    scene.assemble()
    solves_the_equations(scene)
    follows_the_same_path(scene)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 3])
def test_everything_together(seed):
    """All forces and a plug-in on a chain with a loop; two constraints between the same bodies.

    Not from where the torsional spring passes half a turn: `evaluate` counts its turns anew.
    """
    rng = np.random.default_rng(seed)
    scene = build(random_chain(rng, 3))
    one, two, three = scene.bodies
    mass = scene.add_point_mass(0.4, position=three.position + unit(rng))
    scene.add(Rod(three, mass, length=1.0))
    scene.add(C.Distance(mass, one))
    scene.add(C.Dot1(one, two, axis_a=(1, 2, 3), axis_b=(2, 0, 1), value=0.2))
    for name, between in (*((name, "body to body") for name in (*BOTH, *ONE)), ("bushing", "ground to body")):
        add(scene, name, between)
    scene.add(F.Spring(three, mass, point_a=(0.3, 0, 0), stiffness=3.0))
    scene.add(F.ViscousFriction(mass, three, damping=0.2))
    scene.assemble()
    solves_the_equations(scene)
    follows_the_same_path(scene, 0.3)


def test_turns_are_counted_over_many_steps():
    """A rotor winds up a torsional spring by more than two turns and comes back, as its closed form says."""
    J, k, w = 0.5, 0.2, 9.0
    scene = ts.Scene(gravity=(0, 0, 0))
    rotor = scene.add_body(1.0, (1.0, 1.0, J), angular_velocity=(0, 0, w))
    scene.add(C.Spherical(rotor, scene.ground))
    spring = {"axis_a": (0, 0, 1), "reference_a": (1, 0, 0), "reference_b": (1, 0, 0), "stiffness": k}
    scene.add(F.TorsionalSpring(scene.ground, rotor, **spring))
    rate = np.sqrt(k / J)
    times = np.linspace(0, 9, 19)
    solution = ts.simulate(scene, (0, 9), integrator=ts.integrators.Taylor(tol=1e-13), t_eval=times).raise_if_failed()
    angle = w / rate * np.sin(rate * times)
    assert np.ptp(angle) > 4 * np.pi
    A = np.stack([rotation(p) for p in solution.q[:, 3:]])
    np.testing.assert_allclose(A[:, 0, 0], np.cos(angle), rtol=0, atol=FINE)
    np.testing.assert_allclose(A[:, 1, 0], np.sin(angle), rtol=0, atol=FINE)


def test_forces_that_are_absent_leave_nothing_to_run(rng):
    scene = chain(rng)
    solution = ts.simulate(scene, (0.0, 0.1), integrator=ts.integrators.Taylor(), dense_output=True)
    assert solution.success
    (memory,) = scene._prepared._spare["taylor", 30][:1]
    assert memory.context.expansion.forces.size == memory.context.expansion.table.size == 0
