"""Friction of joints and contacts that follows from their reactions."""

import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tsdyn as ts

C, F = ts.constraints, ts.forces
G = 9.81
EXACT = {"integrator": "dop853", "rtol": 1e-11, "atol": 1e-11}


def coefficient(v, mu, static, stribeck, slip):
    return (mu + (static - mu) * np.exp(-((v / stribeck) ** 2))) * v / np.hypot(v, slip)


def block(mu, angle, speed=0.0, **more):
    """A point mass on an inclined plane."""
    scene = ts.Scene()
    along = np.array([np.cos(angle), 0.0, np.sin(angle)])
    body = scene.add_point_mass(2.0, velocity=speed * along)
    contact = scene.add(C.PlaneContact(body, scene.ground, normal_b=(-np.sin(angle), 0, np.cos(angle))))
    friction = scene.add(F.ContactFriction(contact, kinetic=mu, **more))
    return scene, body, contact, friction, along


def pendulum(mu=0.3, **more):
    """A bar that falls about a rough pin along y."""
    scene = ts.Scene()
    bar = scene.add_body(2.0, (0.2, 0.3, 0.25), position=(0.8, 0, 0), name="bar")
    pin = scene.add(C.Revolute(bar, scene.ground, point_a=(-0.8, 0, 0), axis_a=(0, 1, 0), axis_b=(0, 1, 0), name="pin"))
    given = {"static": 0.4, "slip_velocity": 0.01, "stribeck_velocity": 0.05} | more
    return scene, bar, pin, scene.add(F.RevoluteFriction(pin, radius=0.05, kinetic=mu, **given))


def pendulum_rates(t, y):
    """Minimal coordinates: the angle below the horizontal; the reaction by fixed-point iteration."""
    angle, rate = y
    c, s = np.cos(angle), np.sin(angle)
    mu, N = coefficient(0.05 * rate, 0.3, 0.4, 0.05, 0.01), 2.0 * G
    for _ in range(60):
        acceleration = (2.0 * G * 0.8 * c - 0.05 * mu * N) / (0.3 + 2.0 * 0.64)
        x, z = -0.8 * (s * acceleration + c * rate**2), -0.8 * (c * acceleration - s * rate**2)
        N = 2.0 * np.hypot(x, z + G)
    return rate, acceleration


def demand_balance(scene, solution, items, tol=1e-12):
    """Newton's and Euler's equations of every body, from the reactions of these constraints and forces."""
    for body in scene.bodies:
        force = body.mass * (np.array(scene.gravity) - solution.acceleration(body))
        torque = np.zeros_like(force)
        for item in items:
            if body not in (item.a, item.b):
                continue
            f, n = solution.reaction(item, on=body)
            force += f
            letter = "a" if body is item.a else "b"
            arm = getattr(item, f"point_{letter}", np.zeros(3))
            if body.dimension == 7:
                arm = solution.rotation(body) @ arm
                torque += n + np.cross(arm, f)
        assert np.abs(force).max() < tol * 100
        if body.dimension == 7:
            A, w = solution.rotation(body), solution.angular_velocity(body)
            spin = w @ body.inertia if np.ndim(body.inertia) == 2 else w * body.inertia
            change = solution.angular_acceleration(body) @ np.atleast_2d(body.inertia) + np.cross(w, spin)
            assert np.abs(np.einsum("kij,kj->ki", A, change) - torque).max() < tol * 100


@pytest.mark.parametrize("formulation", ["tangent", "null-space", "maggi-kane"])
def test_a_block_on_a_slope_brakes_as_it_should(formulation):
    scene, body, contact, friction, along = block(0.3, 0.5, 3.0, slip_velocity=1e-7)
    solution = ts.simulate(scene, (0.0, 0.4), formulation=formulation, **EXACT)
    rate = -G * (np.sin(0.5) + 0.3 * np.cos(0.5))
    assert solution.success
    np.testing.assert_allclose(solution.position(body)[-1], (3.0 * 0.4 + rate * 0.08) * along, atol=1e-12)
    force, torque = solution.reaction(friction)
    np.testing.assert_allclose(force, np.broadcast_to(-0.3 * 2 * G * np.cos(0.5) * along, force.shape), rtol=1e-12)
    assert not torque.any()
    np.testing.assert_allclose(solution.dissipation, -(force * solution.velocity(body)).sum(axis=1), rtol=1e-12)
    assert np.abs(solution.power).max() < 1e-13
    demand_balance(scene, solution, (contact, friction))


def test_a_block_that_sticks_creeps_at_the_speed_of_the_regularisation():
    scene, body, _, _, along = block(0.8, 0.5, slip_velocity=1e-3)
    solution = ts.simulate(scene, (0.0, 2.0))
    assert solution.success
    assert "SDIRK54" in solution.method
    ratio = np.tan(0.5) / 0.8
    creep = 1e-3 * ratio / np.sqrt(1.0 - ratio**2)
    np.testing.assert_allclose(solution.velocity(body)[-1], -creep * along, atol=1e-9)


def test_stribecks_peak():
    """Held up to the static coefficient, and braked by the kinetic one when it slides."""
    given = {"static": 0.7, "slip_velocity": 1e-5, "stribeck_velocity": 1e-2}
    for angle, slides in ((np.arctan(0.68), False), (np.arctan(0.72), True)):
        scene, body, _, friction, _ = block(0.3, angle, **given)
        solution = ts.simulate(scene, (0.0, 1.0))
        speed = np.linalg.norm(solution.velocity(body)[-1])
        assert solution.success
        assert (speed > 1.0) == slides
        if slides:
            size = np.linalg.norm(solution.reaction(friction)[0][-1])
            assert size == pytest.approx(0.3 * 2 * G * np.cos(angle), rel=1e-9)


@pytest.mark.parametrize("formulation", ["tangent", "null-space"])
def test_a_pendulum_on_a_rough_pin(formulation):
    """Against minimal coordinates in SciPy: it comes to rest, through many turns of the direction."""
    scene, bar, pin, friction = pendulum()
    solution = ts.simulate(scene, (0.0, 3.0), formulation=formulation, **EXACT)
    angle, rate = solve_ivp(pendulum_rates, (0, 3), (0, 0), method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(solution.position(bar)[-1], (0.8 * np.cos(angle), 0, -0.8 * np.sin(angle)), atol=1e-10)
    np.testing.assert_allclose(solution.angular_velocity(bar)[-1], (0, rate, 0), atol=1e-10)
    errors = solution.constraint_error
    assert max(errors.position.max(), errors.velocity.max()) < 1e-13
    assert errors.acceleration.max() < 1e-12
    F_pin, _ = solution.reaction(pin)
    v = 0.05 * solution.angular_velocity(bar)[:, 1]
    torque = -0.05 * coefficient(v, 0.3, 0.4, 0.05, 0.01) * np.hypot(F_pin[:, 0], F_pin[:, 2])
    np.testing.assert_allclose(solution.reaction(friction)[1][:, 1], torque, atol=1e-12)
    demand_balance(scene, solution, (pin, friction))


def test_implicit_and_fixed_steps_and_dense_output_agree():
    scene, _bar, *_ = pendulum()
    exact = ts.simulate(scene, (0.0, 1.0), dense_output=True, **EXACT)
    for method in (
        ts.integrators.SDIRK54(1e-9, 1e-9),
        ts.integrators.Nystrom4(step=1e-3),
        ts.integrators.RK45(1e-9, 1e-9),
    ):
        solution = ts.simulate(scene, (0.0, 1.0), integrator=method)
        assert np.abs(solution.q[-1] - exact.q[-1]).max() < 1e-8
    np.testing.assert_allclose(exact.energy - exact.work, exact.energy[0], atol=1e-9)
    state = exact.at(0.5)
    again = ts.simulate(scene, (0.5, 1.0), state=state, **EXACT)
    np.testing.assert_allclose(again.q[-1], exact.q[-1], atol=1e-10)
    np.testing.assert_allclose(again.multipliers[0], state.multipliers, atol=1e-11)


def slide(length=None, width=None):
    """A slide that is pulled beside its guide, along x; the guide is the ground."""
    scene = ts.Scene()
    body = scene.add_body(2.0, (0.1, 0.2, 0.3), velocity=(1.5, 0, 0), name="slide")
    guide = scene.add(C.Translational(body, scene.ground, axis_a=(1, 0, 0), axis_b=(1, 0, 0), name="guide"))
    friction = scene.add(F.TranslationalFriction(guide, kinetic=0.25, slip_velocity=1e-6, length=length, width=width))
    scene.add(F.PointForce(body, point_a=(0, 0.2, 0.3), force=(6, 0, 4)))
    return scene, body, guide, friction


@pytest.mark.parametrize("formulation", ["tangent", "null-space"])
@pytest.mark.parametrize(("length", "width"), [(None, None), (0.5, None), (None, 0.4), (0.5, 0.4)])
def test_a_slide_that_is_tilted_in_its_guide(length, width, formulation):
    """Torques of the load at (0, 0.2, 0.3): 0.2 * 4 about x, 0.3 * 6 about y, -0.2 * 6 about z."""
    scene, body, guide, friction = slide(length, width)
    N = 2.0 * G - 4.0
    N += 0.0 if width is None else 0.8 / width
    N += 0.0 if length is None else 2.0 / length * np.hypot(1.8, 1.2)
    acceleration = (6.0 - 0.25 * N) / 2.0
    end = min(0.5, 0.9 * 1.5 / max(-acceleration, 1e-9))  # while it slides on
    solution = ts.simulate(scene, (0.0, end), formulation=formulation, **EXACT)
    np.testing.assert_allclose(solution.position(body)[-1, 0], 1.5 * end + 0.5 * acceleration * end**2, atol=1e-11)
    np.testing.assert_allclose(solution.reaction(friction)[0][:, 0], -0.25 * N, rtol=1e-11)
    demand_balance(scene, solution, (guide, friction, *scene.forces[1:]))


def test_the_collar_and_the_length_of_a_pin():
    """A wheel on a horizontal shaft: its weight across, a push along, and a torque that tilts."""
    scene = ts.Scene()
    wheel = scene.add_body(3.0, (0.2, 0.2, 0.1), angular_velocity=(0, 0, 20.0), name="wheel")
    wheel.orientation = (np.sqrt(0.5), np.sqrt(0.5), 0, 0)  # its z along -y
    shaft = scene.add(C.Revolute.at(wheel, scene.ground, point=(0, 0, 0), axis=(0, 1, 0)))
    friction = scene.add(
        F.RevoluteFriction(
            shaft, radius=0.02, kinetic=0.1, collar_radius=0.03, length=0.1, preload=5.0, slip_velocity=1e-9
        )
    )
    scene.add(F.PointForce(wheel, force=(0, 7.0, 0)))
    scene.add(F.Torque(wheel, torque=(0.4, 0, 0)))
    N = 5.0 + 3.0 * G + 1.5 * 7.0 + 20.0 * 0.4
    solution = ts.simulate(scene, (0.0, 1.0), **EXACT)
    np.testing.assert_allclose(solution.angular_velocity(wheel)[-1], (0, 0, 20.0 - 0.1 * 0.02 * N / 0.1), atol=1e-10)
    assert np.linalg.norm(solution.reaction(friction)[1][-1]) == pytest.approx(0.1 * 0.02 * N, rel=1e-12)


def chain(count, rough=True):
    """Links that hang from rough pins, spinning about skewed axes."""
    scene, rng = ts.Scene(), np.random.default_rng(3)
    last, joints = scene.ground, []
    for i in range(count):
        link = scene.add_body(1.0, (0.02, 0.03, 0.04), position=(0.4 * (i + 0.5), 0, 0), name=f"link{i}")
        axis = (0.3 * rng.normal(), 1.0, 0.3 * rng.normal())
        joints.append(scene.add(C.Revolute.at(link, last, point=(0.4 * i, 0, 0), axis=axis)))
        last = link
    if rough:
        for joint in joints:
            given = {"collar_radius": 0.02, "length": 0.05, "slip_velocity": 0.02}
            scene.add(F.RevoluteFriction(joint, radius=0.03, kinetic=0.3, static=0.5, **given))
    return scene, joints


def test_many_rough_joints_against_the_equations_in_numpy():
    """The solver's accelerations and reactions against `evaluate`, which solves the dense equations by its own code."""
    scene, joints = chain(6)
    every = {}
    for formulation in ("tangent", "null-space"):
        solution = every[formulation] = ts.simulate(
            scene, (0.0, 0.3), formulation=formulation, integrator="dop853", rtol=1e-9, atol=1e-9
        )
        for k in range(0, solution.t.size, 7):
            seen = scene.evaluate(solution.q[k], solution.qd[k], solution.t[k])
            scale = np.abs(seen.qdd).max()
            np.testing.assert_allclose(solution.qdd[k], seen.qdd, atol=1e-11 * scale)
            np.testing.assert_allclose(solution.multipliers[k], seen.multipliers, atol=1e-11 * scale)
        demand_balance(scene, solution, (*joints, *scene.forces), tol=1e-10)
    last = [solution.q[-1] for solution in every.values()]
    np.testing.assert_allclose(*last, atol=1e-7)


def test_evaluate_of_a_large_scene():
    scene, _ = chain(150)
    seen = scene.evaluate()
    solution = ts.simulate(scene, (0.0, 1e-4), integrator="rk45", max_steps=1)
    scale = np.abs(seen.qdd).max()
    np.testing.assert_allclose(solution.qdd[0], seen.qdd, atol=1e-10 * scale)
    residual = seen.M @ seen.qdd + seen.Phi_q.T @ seen.multipliers - seen.Q_A - seen.S
    assert np.abs(residual).max() < 1e-9 * scale


def four_bar(rough_at=(0, 1, 2, 3), **more):
    """A planar four-bar of four revolutes: three rows too many."""
    scene = ts.Scene()
    points = np.array([(0, 0, 0), (0, 0, 0.3), (0.8, 0, 0.7), (0.9, 0, 0)])
    last, joints = scene.ground, []
    for i in range(3):
        a, b = points[i], points[i + 1]
        d = (b - a) / np.linalg.norm(b - a)
        half = 0.5 * np.arctan2(-d[2], d[0])
        link = scene.add_body(
            1.0 + i, (0.01, 0.1, 0.1), (a + b) / 2, (np.cos(half), 0, np.sin(half), 0), name=f"bar{i}"
        )
        joints.append(scene.add(C.Revolute.at(link, last, point=a, axis=(0, 1, 0), name=f"pin{i}")))
        last = link
    joints.append(scene.add(C.Revolute.at(last, scene.ground, point=points[3], axis=(0, 1, 0), name="pin3")))
    for i in rough_at:
        scene.add(F.RevoluteFriction(joints[i], radius=0.02, kinetic=0.2, slip_velocity=0.01, **more))
    return scene, joints


def test_redundant_constraints_whose_needed_reactions_are_unique():
    scene, joints = four_bar()
    solution = ts.simulate(scene, (0.0, 1.0), dense_output=True, **EXACT)
    assert solution.success
    assert not solution.reaction_unique(joints[0]).any()
    np.testing.assert_allclose(solution.energy - solution.work, solution.energy[0], atol=1e-8)
    other = ts.simulate(scene, (0.0, 1.0), formulation="null-space", **EXACT)
    np.testing.assert_allclose(solution.q[-1], other.q[-1], atol=1e-9)
    seen = scene.evaluate(solution.q[3], solution.qd[3], solution.t[3])
    np.testing.assert_allclose(seen.qdd, solution.qdd[3], atol=1e-9)


def test_friction_from_a_reaction_that_is_not_unique_is_refused():
    scene, _ = four_bar(rough_at=(1,), length=0.1)
    with pytest.raises(ts.RedundantConstraints, match=r"RevoluteFriction\(pin1\).*not unique"):
        ts.simulate(scene, (0.0, 1.0))


def rod(angle, mu, kind=F.ContactFriction):
    """A rod that slides over a plane on its lower end, leaning away from where it goes: Painleve's."""
    scene = ts.Scene()
    turn = (np.cos(-0.5 * angle), 0, np.sin(-0.5 * angle), 0)
    body = scene.add_body(
        1.0, (1e-3, 1 / 3, 1 / 3), (np.cos(angle), 0, np.sin(angle)), turn, velocity=(-3, 0, 0), name="rod"
    )
    scene.add(C.Planar.at(body, scene.ground, point=(0, 0, 0), axis=(0, 1, 0)))
    contact = scene.add(C.PlaneContact(body, scene.ground, point_a=(-1, 0, 0), normal_b=(0, 0, 1)))
    scene.add(kind(contact, kinetic=mu, slip_velocity=1e-4))
    return scene


def test_a_mechanism_that_jams_says_so():
    """Above mu = (1 + 3 c^2) / (3 s c), 4 / 3 at 1.1 rad, no reaction is in balance with its friction."""
    assert ts.simulate(rod(1.1, 1.3), (0.0, 0.01), **EXACT).success
    with pytest.raises(ts.InconsistentState, match="mechanism may jam"):
        ts.simulate(rod(1.1, 1.4), (0.0, 0.01), **EXACT)
    with pytest.raises(ts.SingularConfiguration, match="mechanism may jam"):
        rod(1.1, 1.4).evaluate()


class SuddenFriction(F.ContactFriction):
    """Twice as much from one moment on."""

    @staticmethod
    def law(x, xd, par, t, out):
        more = 1.0 if t < 0.004 else 2.0
        f = -par[-1] * more * par[0] / np.sqrt(xd[0] * xd[0] + par[3] * par[3])
        out[0], out[6] = f * xd[0], -f * xd[0]


def test_jamming_on_the_way_ends_the_run():
    scene = rod(1.1, 1.0, SuddenFriction)
    solution = ts.simulate(scene, (0.0, 1.0), **EXACT)
    assert not solution.success
    assert solution.status == ts.Status.JAMMED
    assert solution.reached == pytest.approx(0.004, abs=1e-6)
    assert "consistent with the friction" in solution.message
    for numbers in (solution.q, solution.qd, solution.qdd, solution.multipliers):
        assert np.isfinite(numbers).all()
        assert len(numbers) > 3


class BallFriction(ts.JointFriction, ts.Force):
    """Friction of a ball joint in all directions: a plug-in."""

    joints = (C.Spherical,)
    markers = (ts.Point("a"), ts.Turn("a"), ts.Point("b"), ts.Turn("b"))
    quantities = {**ts.JointFriction.quantities, "radius": lambda value, *where: float(value)}  # noqa: RUF012

    def geometry(self):
        return (self.radius,)

    @staticmethod
    def law(x, xd, par, t, out):
        w0, w1, w2 = xd[3] - xd[9], xd[4] - xd[10], xd[5] - xd[11]
        v = par[5] * np.sqrt(w0 * w0 + w1 * w1 + w2 * w2 + (par[3] / par[5]) ** 2)
        n = -par[-1] * par[5] * par[5] * par[0] / v
        out[3], out[4], out[5] = n * w0, n * w1, n * w2
        out[9], out[10], out[11] = -n * w0, -n * w1, -n * w2

    @staticmethod
    def normal_load(x, f, par):
        return np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])

    @staticmethod
    def dissipation(x, xd, par, t):
        w0, w1, w2 = xd[3] - xd[9], xd[4] - xd[10], xd[5] - xd[11]
        ww = w0 * w0 + w1 * w1 + w2 * w2
        return par[-1] * par[5] * par[0] * ww / np.sqrt(ww + (par[3] / par[5]) ** 2)

    @classmethod
    def sizes(cls, rng):
        return {"radius": rng.uniform(0.5, 1.0)}


def test_a_plug_in():
    ts.testing.check_force(BallFriction)
    scene = ts.Scene()
    body = scene.add_body(1.0, (0.1, 0.1, 0.1), position=(0.5, 0, 0), angular_velocity=(1, 2, 3))
    body.velocity = np.cross((1, 2, 3), (0.5, 0, 0))
    ball = scene.add(C.Spherical(body, scene.ground, point_a=(-0.5, 0, 0)))
    friction = scene.add(BallFriction(ball, radius=0.05, kinetic=0.2, slip_velocity=0.01))
    ends = [ts.simulate(scene, (0, 0.5), formulation=form, **EXACT) for form in ("tangent", "null-space")]
    np.testing.assert_allclose(ends[0].q[-1], ends[1].q[-1], atol=1e-9)
    assert (ends[0].dissipation > 0).all()
    demand_balance(scene, ends[0], (ball, friction))


def test_taylor_refuses_by_name_and_the_default_takes_another():
    scene, *_ = pendulum()
    with pytest.raises(ts.InvalidArgument, match=r"RevoluteFriction\(pin\): its magnitude depends on a reaction"):
        ts.simulate(scene, (0.0, 1.0), integrator="taylor")
    assert "DOP853" in ts.simulate(scene, (0.0, 0.05)).method


def test_attributes_can_be_set_and_geometry_is_the_joints():
    scene, _bar, pin, friction = pendulum()
    before = ts.simulate(scene, (0.0, 0.5), **EXACT).q[-1]
    friction.static = None
    friction.kinetic = 0.0005
    smooth = ts.simulate(scene, (0.0, 0.5), **EXACT).q[-1]
    assert np.abs(before - smooth).max() > 1e-3
    friction.kinetic, friction.static = 0.3, 0.4
    np.testing.assert_array_equal(ts.simulate(scene, (0.0, 0.5), **EXACT).q[-1], before)
    np.testing.assert_array_equal(friction.axis_a, pin.axis_a)
    with pytest.raises(ts.InvalidForce, match="axis_a is that of its joint"):
        friction.axis_a = (1, 0, 0)
    with pytest.raises(ts.UnknownAttribute, match="radius"):
        friction.radus = 1.0


def test_solutions_are_pickled():
    scene, _, _pin, _friction = pendulum()
    solution = ts.simulate(scene, (0.0, 0.5), **EXACT)
    again = pickle.loads(pickle.dumps(solution))
    np.testing.assert_array_equal(again.multipliers, solution.multipliers)
    np.testing.assert_array_equal(again.dissipation, solution.dissipation)


def test_wrong_arguments():
    scene, bar, pin, _ = pendulum()
    other = ts.Scene()
    loose = C.Revolute(bar, scene.ground, axis_a=(0, 1, 0), axis_b=(0, 1, 0), name="loose")
    cases = [
        (lambda: F.RevoluteFriction(loose, radius=0.1, kinetic=0.1), "add its joint 'loose' to the scene first"),
        (lambda: F.RevoluteFriction(bar, radius=0.1, kinetic=0.1), "joint must be a Revolute"),
        (lambda: F.TranslationalFriction(pin, kinetic=0.1), "joint must be a Translational"),
        (lambda: F.ContactFriction(pin, kinetic=0.1), "joint must be a PlaneContact"),
        (lambda: F.RevoluteFriction(pin, radius=0.0, kinetic=0.1), "radius must be a positive"),
        (lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=-0.1), "kinetic must be a finite number"),
        (lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=np.nan), "kinetic must be a finite number"),
        (lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=0.0), "zero at all times"),
        (lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=0.3, static=0.2), "static must be at least kinetic"),
        (
            lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=0.3, slip_velocity=0.0),
            "slip_velocity must be a positive",
        ),
        (lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=0.3, length=-1.0), "length must be a positive"),
        (lambda: F.RevoluteFriction(pin, radius=0.1, kinetic=0.3, preload="much"), "preload must be a finite number"),
    ]
    for make, message in cases:
        with pytest.raises(ts.InvalidForce, match=message):
            make()
    with pytest.raises(TypeError, match=r"RevoluteFriction\(\) has no argument slip. It has .*slip_velocity"):
        F.RevoluteFriction(pin, radius=0.1, kinetic=0.1, slip=0.1)
    friction = F.RevoluteFriction(pin, radius=0.1, kinetic=0.1)
    with pytest.raises(ts.InvalidForce, match="another scene"):
        other.add(friction)
    scene.add(friction)
    with pytest.raises(ts.InvalidForce, match="static must be at least"):
        friction.static = 0.01
    assert friction.static is None
