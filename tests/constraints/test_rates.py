"""Rows on velocities: knife edges against closed forms, by all methods; plug-ins; redundancy, refusals, analyses."""

import warnings

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import tsdyn as ts
from tests.helpers.tolerances import ALGEBRA, CLOSE, COARSE, EPS, FINE, HELD, NEAR, ROUNDING
from tsdyn.plugins import Motion
from tsdyn.runs import driver

C, F, M = ts.constraints, ts.forces, ts.motions
FLAT = {"axis_a": (0, 0, 1), "axis_b": (0, 0, 1)}
EDGE = {"axis_a": (0, 1, 0), "normal_b": (0, 0, 1)}
MASS, INERTIA, ARM = 2.0, 0.4, 0.5
SPEED, TURN = 1.0, 2.0  # of the blade along itself, m/s, and of the sleigh, rad/s
METHODS = {
    "taylor": 100.0,
    "dop853": 100.0,
    "rk45": 100.0,
    "radau": 1000.0,
    "sdirk54": 1000.0,
}  # errors over the tolerance


def body_on_ice(scene, velocity=(0, 0, 0), turn=0.0, **places):
    body = scene.add_body(
        mass=MASS, inertia=(0.3, 0.3, INERTIA), velocity=velocity, angular_velocity=(0, 0, turn), **places
    )
    scene.add(C.PlaneContact(body, scene.ground, normal_b=(0, 0, 1)))
    scene.add(C.Parallel(body, scene.ground, **FLAT))
    return body


def sleigh():
    """Chaplygin's: the blade is ARM behind the centroid."""
    scene = ts.Scene()
    body = body_on_ice(scene, (SPEED, ARM * TURN, 0.0), TURN, name="sleigh")
    scene.add(C.KnifeEdge(body, scene.ground, point_a=(-ARM, 0, 0), **EDGE, name="edge"))
    return scene


def exact_sleigh(t):
    """Position of the centroid (2,), angle, speed of the blade and turn: v = V tanh, omega = (V / rho) sech."""
    rho = np.sqrt(INERTIA / MASS + ARM**2)
    V = np.hypot(SPEED, rho * TURN)
    kappa, phase = ARM * V / rho**2, np.arctanh(SPEED / V)

    def angle(t):
        return (rho / ARM) * (2.0 * np.arctan(np.tanh((kappa * t + phase) / 2)) - 2.0 * np.arctan(np.tanh(phase / 2)))

    def speed(t):
        return V * np.tanh(kappa * t + phase)

    nodes, weights = np.polynomial.legendre.leggauss(60)
    s = 0.5 * t * (nodes + 1.0)
    blade = np.array([0.5 * t * (weights * speed(s) * f(angle(s))).sum() for f in (np.cos, np.sin)])
    theta = angle(t)
    arm = ARM * np.array([np.cos(theta), np.sin(theta)])
    return blade - [ARM, 0.0] + arm, theta, speed(t), V / rho / np.cosh(kappa * t + phase)


def held(solution):
    """All three levels at rounding."""
    error, size = solution.constraint_error, 1.0 + np.abs(solution.qd).max() ** 2 + np.abs(solution.qdd).max()
    assert max(level.max() for level in error) < 100.0 * EPS * size


@pytest.mark.slow_but("taylor", "dop853")
@pytest.mark.parametrize("method", METHODS)
def test_chaplygins_sleigh(method):
    scene, tol = sleigh(), 1e-8
    solution = ts.simulate(scene, (0.0, 2.0), integrator=method, rtol=tol, atol=tol, t_eval=[0.0, 0.7, 2.0])
    solution.raise_if_failed()
    for i, t in enumerate(solution.t):
        place, angle, speed, turn = exact_sleigh(t)
        p = solution.orientation("sleigh")[i]
        velocity = solution.velocity("sleigh")[i, :2]
        along = velocity @ [np.cos(angle), np.sin(angle)]
        got = [*solution.position("sleigh")[i, :2], 2.0 * np.arctan2(p[3], p[0]), along]
        expected = [*place, (angle + np.pi) % (2.0 * np.pi) - np.pi, speed]
        got[2] = (got[2] + np.pi) % (2.0 * np.pi) - np.pi
        np.testing.assert_allclose(got, expected, rtol=0, atol=METHODS[method] * tol)
        assert abs(solution.angular_velocity("sleigh")[i, 2] - turn) < METHODS[method] * tol
    # The reaction across the blade, at its point: m (v w + a wd)
    force, torque = solution.reaction("edge")
    across = np.array([-np.sin(angle), np.cos(angle)])
    wd = -MASS * ARM * speed * turn / (INERTIA + MASS * ARM**2)
    assert abs(force[-1, :2] @ across - MASS * (speed * turn + ARM * wd)) < 100.0 * METHODS[method] * tol
    assert np.abs(torque).max() < HELD
    held(solution)


@pytest.mark.slow_but("nystrom4")
@pytest.mark.parametrize(
    ("method", "order"),
    [(ts.integrators.ImplicitTrapezoid, 1.9), (ts.integrators.Radau, 4.8), (ts.integrators.Nystrom4, 3.8)],
    ids=["trapezoid", "radau", "nystrom4"],
)
def test_what_steps_leave_does_not_gather(method, order):
    """A sleigh that is light about its centroid turns far: velocities along the row drift from step to step no more."""

    def run(integrator, **options):
        scene = ts.Scene(gravity=(1.0, 0.3, -9.81))
        body = scene.add_body(1.0, (0.1, 0.1, 1e-3), velocity=(0.2, 0.3, 0), angular_velocity=(0, 0, 1), name="sleigh")
        scene.add(C.PlaneContact(body, scene.ground, normal_b=(0, 0, 1)))
        scene.add(C.Parallel(body, scene.ground, **FLAT))
        scene.add(C.KnifeEdge(body, scene.ground, point_a=(-0.3, 0, 0), **EDGE))
        return ts.simulate(scene, (0.0, 3.0), integrator=integrator, **options).raise_if_failed().q[-1]

    right = run("taylor", rtol=1e-13, atol=1e-13)
    errors = [np.abs(run(method(step=step)) - right).max() for step in (0.04, 0.02)]
    assert errors[1] < COARSE
    assert np.log2(errors[0] / errors[1]) > order


def test_a_plane_that_moves_and_turns():
    """On a disc that turns about its normal, the blade's velocity across is zero relative to the disc."""
    scene = ts.Scene(gravity=(1.0, 0.0, 0.0))
    disc = scene.add_body(mass=3.0, inertia=(1, 1, 2), angular_velocity=(0, 0, 1.5), name="disc")
    scene.add(C.Revolute.at(scene.ground, disc, point=(0, 0, 0), axis=(0, 0, 1)))
    skate = scene.add_body(mass=0.5, inertia=(0.1, 0.1, 0.1), position=(0.7, 0.2, 0), name="skate")
    scene.add(C.PlaneContact(skate, disc, normal_b=(0, 0, 1)))
    scene.add(C.Parallel(skate, disc, **FLAT))
    scene.add(C.KnifeEdge(skate, disc, **EDGE))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 3.0), rtol=1e-10, atol=1e-10).raise_if_failed()
    relative = solution.velocity("skate") - np.cross(solution.angular_velocity("disc"), solution.position("skate"))
    across = solution.rotation("skate")[:, :, 1]
    assert np.abs(np.einsum("ki,ki->k", relative, across)).max() < HELD
    assert np.ptp(solution.energy) < NEAR
    held(solution)


def train(count):
    """Skates in a row, each hinged to the one before."""
    scene, before = ts.Scene(gravity=(0.3, 1.0, -9.81)), None
    for i in range(count):
        skate = body_on_ice(scene, (1.0, 0, 0), position=(-i, 0, 0), name=f"skate {i}")
        scene.add(C.KnifeEdge(skate, scene.ground, **EDGE))
        if before is not None:
            scene.add(C.Dot2(before, skate, axis_a=(1, 0, 0), point_a=(-0.5, 0, 0), point_b=(0.5, 0, 0)))
            scene.add(C.Dot2(before, skate, axis_a=(0, 1, 0), point_a=(-0.5, 0, 0), point_b=(0.5, 0, 0)))
        before = skate
    scene["skate 0"].angular_velocity = (0, 0, 1.0)
    scene.assemble()
    return scene


@pytest.mark.slow_but("6")
@pytest.mark.parametrize("count", [6, 60])
def test_the_solver_agrees_with_dense_algebra(count):
    """M qdd + Phi_q^T lam = Q, Phi_q qdd + gamma = 0, blades being rows of Phi_q; long trains are sparse."""
    scene = train(count)
    solution = ts.simulate(scene, (0.0, 0.5)).raise_if_failed()
    found = scene.evaluate(solution.q[-1], solution.qd[-1])
    Phi_q, Mass = (x.toarray() if hasattr(x, "toarray") else x for x in (found.Phi_q, found.M))
    m, n = Phi_q.shape
    whole = np.block([[Mass, Phi_q.T], [Phi_q, np.zeros((m, m))]])
    right = np.linalg.lstsq(whole, np.concatenate((found.Q_A + found.S, -found.gamma)), rcond=None)[0]
    np.testing.assert_allclose(solution.qdd[-1], right[:n], rtol=0, atol=NEAR)
    np.testing.assert_allclose(solution.multipliers[-1], right[n:], rtol=0, atol=1e2 * NEAR)
    held(solution)
    mobility = scene.mobility()
    assert (mobility.degrees_of_freedom, mobility.position_degrees_of_freedom) == (2, count + 2)


@pytest.mark.slow
def test_a_run_goes_on_to_the_bit(tmp_path, monkeypatch):
    """Stopped in its second slice, a stored run is resumed to the bits of a whole one."""
    monkeypatch.setattr(driver, "FIRST_SLICE", 4)
    for method in (ts.integrators.Taylor(step=0.02), ts.integrators.DOP853(step=0.02), ts.integrators.Radau(step=0.02)):
        left, path = [2], tmp_path / f"{type(method).__name__}.zarr"

        def stop(fraction, left=left):
            left[0] -= 1
            if left[0] == 0:
                raise KeyboardInterrupt

        whole = ts.simulate(sleigh(), (0.0, 8.0), integrator=method, history=True)
        stopped = ts.simulate(
            sleigh(), (0.0, 8.0), integrator=method, history=True, store=path, checkpoint=0.0, progress=stop
        )
        assert not stopped.success
        resumed = ts.resume(path)
        assert len(whole.t) == 401
        for name in ("t", "q", "qd", "qdd", "multipliers"):
            np.testing.assert_array_equal(getattr(resumed, name), getattr(whole, name))


@pytest.mark.slow_for("lanes")
@pytest.mark.parametrize(
    ("method", "lanes"), [("taylor", None), ("taylor", 4), ("dop853", None)], ids=["taylor", "lanes", "dop853"]
)
def test_cases_of_an_ensemble_are_single_runs(method, lanes):
    masses = np.linspace(1.0, 4.0, 9)
    found = ts.ensemble(sleigh(), {"sleigh.mass": masses}, (0.0, 2.0), integrator=method, lanes=lanes)
    for i in (0, 8):
        alone = ts.simulate(sleigh().with_parameters({"sleigh.mass": masses[i]}), (0.0, 2.0), integrator=method)
        np.testing.assert_allclose(found.q[i], alone.q[-1], rtol=0, atol=NEAR if lanes else 0.0)
        assert np.abs(found.case(i).constraint_error.velocity).max() < HELD


# Redundant rows, and starts.


def test_a_second_blade_in_line_is_redundant():
    """Two blades on one line across: one row is dropped, of the motion nothing changes."""
    scene = ts.Scene(gravity=(5.0, 0.0, -9.81))
    cart = body_on_ice(scene, turn=2.0, name="cart")
    for y in (-0.3, 0.3):
        scene.add(C.KnifeEdge(cart, scene.ground, point_a=(0, y, 0), **EDGE))
    solution = ts.simulate(scene, (0.0, 3.0), rtol=1e-11, atol=1e-11, redundancy="drop").raise_if_failed()
    np.testing.assert_allclose(solution.position("cart")[-1, 0], 0.625 * np.sin(6.0) ** 2, rtol=0, atol=CLOSE)
    held(solution)
    assert len(scene.mobility().redundant) == 1
    assert (scene.mobility().degrees_of_freedom, scene.mobility().position_degrees_of_freedom) == (2, 3)


@pytest.mark.parametrize("first", [True, False], ids=["edge first", "rail first"])
def test_a_blade_on_a_rail_is_dropped_not_the_rail(first):
    """The rail's rows on positions hold what the blade's row on velocities follows from; after 1e4 steps they do."""
    scene = ts.Scene(gravity=(1.0, 1.0, -9.81))
    cart = scene.add_body(mass=1.0, inertia=(1, 1, 1), name="cart")

    def edge():
        scene.add(C.KnifeEdge(cart, scene.ground, **EDGE, name="edge"))

    if first:
        edge()
    scene.add(C.Translational(scene.ground, cart, axis_a=(1, 0, 0), axis_b=(1, 0, 0)))
    if not first:
        edge()
    solution = ts.simulate(scene, (0.0, 10.0), integrator=ts.integrators.Nystrom4(step=1e-3), redundancy="drop")
    solution.raise_if_failed()
    assert np.abs(solution.position("cart")[:, 1:]).max() < ALGEBRA
    np.testing.assert_allclose(solution.position("cart")[-1, 0], 50.0, rtol=ALGEBRA)
    assert [row.constraint.name for row in scene.mobility().redundant] == ["edge"]
    assert np.isnan(solution.multipliers[:, solution.rows("edge")]).all()  # which of the two pushes is not unique


def test_a_start_that_slips_is_refused_and_assembled():
    scene = sleigh()
    scene["sleigh"].velocity = (1.0, 0.0, 0.0)
    with pytest.raises(ts.InconsistentState, match=r"edge.*across"):
        ts.simulate(scene, (0.0, 1.0))
    report = scene.assemble()
    # The impulse across at the blade's point: P = m_e 1 m/s, 1 / m_e = 1 / m + ARM^2 / J
    impulse = 1.0 / (1.0 / MASS + ARM**2 / INERTIA)
    np.testing.assert_allclose(scene["sleigh"].velocity, (1.0, impulse / MASS, 0.0), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(scene["sleigh"].angular_velocity[2], 2.0 - impulse * ARM / INERTIA, rtol=ROUNDING)
    assert report.moved == 0.0
    scene["sleigh"].position = (0.3, 0.2, 0.1)
    scene.assemble()
    np.testing.assert_allclose(scene["sleigh"].position, (0.3, 0.2, 0.0), rtol=0, atol=ROUNDING)


def test_a_blade_that_lies_flat_is_refused():
    scene = ts.Scene()
    skate = scene.add_body(mass=1.0, inertia=(1, 1, 1))
    scene.add(C.KnifeEdge(skate, scene.ground, axis_a=(0, 0, 1), normal_b=(0, 0, 1), name="edge"))
    with pytest.raises(ts.TsdynError, match="edge"):
        ts.simulate(scene, (0.0, 1.0))


def test_files_keep_knife_edges(tmp_path):
    scene = sleigh()
    scene.save(tmp_path / "sleigh.toml")
    again = ts.simulate(ts.load(tmp_path / "sleigh.toml"), (0.0, 1.0))
    np.testing.assert_array_equal(again.q, ts.simulate(scene, (0.0, 1.0)).q)


# Rows of a user's own.


class Belt(ts.Primitive):
    """The point stays on z = 0, and a belt whose speed along x is u(t) + y^2 carries it."""

    rows, rate_rows, markers, prescribed, slots = 1, 1, (ts.Point("a"),), "speed", 1

    def __init__(self, a, *, speed=1.0, **places):
        super().__init__(a, None, **places)
        self.speed = speed

    def parameters(self):
        return Motion.places(self.speed)

    @staticmethod
    def phi(x, par, t, out):
        out[0] = x[2]

    @staticmethod
    def jacobian(x, par, t, out):
        out[0, 2] = 1.0

    @staticmethod
    def gamma(x, xd, par, t, out):
        out[0] = 0.0

    @staticmethod
    def rate(x, xd, par, t, out):
        out[0] = xd[0] - par[0] - x[1] * x[1]

    @staticmethod
    def rate_jacobian(x, par, t, out):
        out[0, 0] = 1.0

    @staticmethod
    def rate_gamma(x, xd, par, t, out):
        out[0] = -par[1] - 2.0 * x[1] * xd[1]

    @staticmethod
    def series(x, par, k, s, out):
        s[0, k] = x[1]
        if k == 0:
            out[0, 2] = out[1, 0] = 1.0

    @staticmethod
    def series_t(x, par, k, s, out):
        out[0] = 0.0
        out[1] = -s[1, k]
        for j in range(k + 1):
            out[1] -= s[0, j] * s[0, k - j]


@pytest.mark.slow_but("dop853-constant")
@pytest.mark.parametrize("speed", [0.5, 0.5 + 0.3 * np.sin(2.0 * M.time)], ids=["constant", "motion"])
@pytest.mark.parametrize("method", METHODS)
def test_a_plug_in_with_both_sorts_of_rows(method, speed):
    """y falls freely; x follows from the belt's speed; the belt's force does work."""
    scene = ts.Scene(gravity=(0.0, -1.0, -9.81))
    bead = scene.add_body(1.0, (0.1, 0.2, 0.3), position=(0, 0.3, 0), angular_velocity=(0.1, 0.2, 1), name="bead")
    scene.add(Belt(bead, speed=speed))
    scene.assemble()
    solution = ts.simulate(
        scene, (0.0, 1.5), integrator=method, rtol=1e-10, atol=1e-10, dense_output=True, t_eval=np.linspace(0, 1.5, 16)
    ).raise_if_failed()
    t = solution.t
    moved = 0.5 * t + (0.0 if speed == 0.5 else 0.15 * (1.0 - np.cos(2.0 * t)))
    moved = moved + 0.09 * t - 0.1 * t**3 + 0.05 * t**5
    path = np.stack((moved, 0.3 - 0.5 * t**2, 0.0 * t), axis=1)
    np.testing.assert_allclose(solution.position("bead"), path, rtol=0, atol=METHODS[method] * 1e-10)
    held(solution)
    assert np.ptp(solution.energy) > 0.1
    assert np.ptp(solution.energy - solution.work) < NEAR


@pytest.mark.slow
def test_the_checker_knows_rows_on_velocities():
    with pytest.warns(UserWarning, match=r"rate\[0\] is the derivative of a function of positions"):
        ts.testing.check_primitive(InPhi, states=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ts.testing.check_primitive(Belt, states=1)
    with pytest.raises(ts.testing.CheckFailed, match=r"rate\[0\] is not linear in xd"):
        ts.testing.check_primitive(Quadratic, states=1)


class InPhi(Belt):
    """Its rate is that of x."""

    @staticmethod
    def rate(x, xd, par, t, out):
        out[0] = xd[0] - par[0]

    @staticmethod
    def rate_gamma(x, xd, par, t, out):
        out[0] = -par[1]

    @staticmethod
    def series_t(x, par, k, s, out):
        out[0], out[1] = 0.0, -s[1, k]


class Quadratic(Belt):
    """No row on velocities."""

    @staticmethod
    def rate(x, xd, par, t, out):
        out[0] = xd[0] * xd[0]


def test_wrong_numbers_of_rows_are_refused():
    for body, word in (
        ({"rows": 0}, "rate_rows"),
        ({"rows": 0, "rate_rows": -1}, "rate_rows"),
        ({"rows": 0, "rate_rows": 1}, "write rate as a static method"),
    ):
        with pytest.raises(ts.InvalidConstraint, match=word):
            type("Mine", (ts.Primitive,), {"markers": (ts.Point("a"),), **body})


# Analyses.


def test_eigenvalues_of_a_sleigh_that_slides_straight():
    """One eigenvalue -m a v / (J + m a^2): stable with the blade behind; four are zero."""
    for speed in (2.0, -2.0):
        scene = ts.Scene()
        body = body_on_ice(scene, (speed, 0, 0), name="sleigh")
        scene.add(C.KnifeEdge(body, scene.ground, point_a=(-ARM, 0, 0), **EDGE))
        linear = scene.linearise()
        expected = -MASS * ARM * speed / (INERTIA + MASS * ARM**2)
        np.testing.assert_allclose(linear.eigenvalues(), [0, 0, 0, 0, expected], rtol=0, atol=ROUNDING)
        assert (len(linear.coordinates), len(linear.rates), linear.M.shape, linear.K.shape) == (3, 2, (2, 2), (2, 3))
        found = np.linalg.eigvals(linear.state_space().A)
        assert abs(found[np.abs(found).argmax()] - expected) < ROUNDING


def springy():
    """A skate on a spring with a damper."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81))
    skate = scene.add_body(mass=MASS, inertia=(0.3, 0.3, INERTIA), position=(1.0, 0, 0), name="skate")
    scene.add(C.PlaneContact(skate, scene.ground, normal_b=(0, 0, 1)))
    scene.add(C.Parallel(skate, scene.ground, **FLAT))
    scene.add(C.KnifeEdge(skate, scene.ground, point_a=(-0.2, 0, 0), axis_a=(1, 0, 0), normal_b=(0, 0, 1)))
    scene.add(F.Spring(skate, scene.ground, point_a=(0.1, 0, 0), stiffness=10.0, damping=0.1, free_length=0.4))
    return scene


def planar(y):
    """Of the blade's point x, y, the angle, the speed along the blade (0, 1) and the turn: their rates."""
    X, Y, angle, v, w = y
    e, f = np.array([-np.sin(angle), np.cos(angle)]), np.array([np.cos(angle), np.sin(angle)])
    end, rate = np.array([X, Y]) + 0.3 * f, (v + 0.3 * w) * e
    length = np.sqrt(end @ end)
    along = -(10.0 * (length - 0.4) + 0.1 * (rate @ end) / length) * (end @ e) / length
    # Along the blade m (vd + 0.2 wd) = F.e;  about the centroid J wd = 0.1 F.e: the blade pushes across
    wd = 0.1 * along / INERTIA
    return np.array([v * e[0], v * e[1], w, along / MASS - 0.2 * wd, wd])


def test_a_steady_turn_and_its_eigenvalues():
    """Found with a spin; linearised about it: eigenvalues of the equations in axes that turn with it."""
    scene, spin = springy(), 2.0
    found = scene.equilibrium(spin=(0, 0, spin))
    state = found.state
    p, r = state.orientation("skate"), state.position("skate")
    angle = 2.0 * np.arctan2(p[3], p[0])
    e, f = np.array([-np.sin(angle), np.cos(angle)]), np.array([np.cos(angle), np.sin(angle)])
    point = r[:2] - 0.2 * f
    y = np.array([*point, angle, (spin * np.array([-point[1], point[0]])) @ e, spin])
    turned = np.array([-spin * y[1], spin * y[0], spin, 0.0, 0.0])
    np.testing.assert_allclose(planar(y), turned, rtol=0, atol=NEAR)
    # d/dt y - turned(y), differences of fourth order
    h, A = 1e-3, np.zeros((5, 5))
    for j in range(5):
        d = h * np.eye(5)[j]
        A[:, j] = (8.0 * (planar(y + d) - planar(y - d)) - planar(y + 2 * d) + planar(y - 2 * d)) / (12.0 * h)
    A[0, 1] += spin
    A[1, 0] -= spin
    expected, got = np.linalg.eigvals(A), scene.linearise(state).eigenvalues()
    for value in got:
        assert np.abs(expected - value).min() < 1e-6, (got, expected)
    assert len(got) == 5
    later = ts.simulate(scene, (0.0, 1.0), state=state, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(later.position("skate"), axis=1), np.linalg.norm(r), rtol=0, atol=1e-6)


def test_a_skate_rests_across_a_slope():
    """Across the slope the blade holds it, along it a spring does."""
    scene = ts.Scene(gravity=(1.0, 0.5, -9.81))
    skate = body_on_ice(scene, name="skate")
    edge = scene.add(C.KnifeEdge(skate, scene.ground, axis_a=(1, 0, 0), normal_b=(0, 0, 1)))
    scene.add(F.Spring(skate, scene.ground, point_a=(0, 0.5, 0), point_b=(0, -3, 0), stiffness=10.0, free_length=3.0))
    found = scene.equilibrium()
    assert found.unbalanced < HELD
    force, _ = found.reaction(edge)
    np.testing.assert_allclose(found.state.position(skate)[2], 0.0, rtol=0, atol=ROUNDING)
    spring = -10.0 * (np.linalg.norm(found.state.position(skate, (0, 0.5, 0)) - [0, -3, 0]) - 3.0)
    along = found.state.position(skate, (0, 0.5, 0)) - [0, -3, 0]
    left = force + spring * along / np.linalg.norm(along) + MASS * np.array([1.0, 0.5, 0.0])
    np.testing.assert_allclose(left[:2], 0.0, rtol=0, atol=CLOSE)


def test_a_motion_that_is_not_steady_is_not_linearised():
    with pytest.raises(ts.InvalidArgument, match=r"edge.*row on velocities"):
        sleigh().linearise()


def test_it_is_the_motion_of_reduced_equations():
    """The springy skate in motion, against its planar equations by another integrator."""
    scene = springy()
    skate = scene["skate"]
    skate.angular_velocity = (0, 0, 1.0)
    skate.velocity = (0, 0.9, 0)  # of the centroid: (v + 0.2 w) e
    right = solve_ivp(lambda t, y: planar(y), (0, 2), [0.8, 0.0, 0.0, 0.7, 1.0], rtol=1e-12, atol=1e-13).y[:, -1]
    solution = ts.simulate(scene, (0.0, 2.0), rtol=1e-11, atol=1e-11).raise_if_failed()
    np.testing.assert_allclose(solution.state.position(skate, (-0.2, 0, 0))[:2], right[:2], rtol=0, atol=NEAR)
    held(solution)


def test_inverse_dynamics_of_a_motion():
    """The thrust along the blade that was given is found, whatever the blade's own force."""
    scene = ts.Scene(gravity=(0.0, 0.0, -9.81))
    skate = body_on_ice(scene, (1.0, 0, 0), 0.7, name="skate")
    scene.add(C.KnifeEdge(skate, scene.ground, **EDGE, name="edge"))
    scene.add(F.PointForce(skate, force=(2.0, 0.0, 0.0), frame="body", name="thrust"))
    scene.add(F.Torque(skate, torque=(0.0, 0.0, 0.2), name="turn"))
    solution = ts.simulate(scene, (0.0, 2.0), rtol=1e-10, atol=1e-10)
    found = scene.inverse_dynamics(solution, ["thrust.x", "turn.z"])
    np.testing.assert_allclose(found.loads["thrust.x"], 2.0, rtol=0, atol=FINE)
    np.testing.assert_allclose(found.loads["turn.z"], 0.2, rtol=0, atol=FINE)
    np.testing.assert_allclose(found.reaction("edge")[0], solution.reaction("edge")[0], rtol=0, atol=FINE)


def cart(left, right, radius=0.2, track=0.8):
    """A platform on two driven wheels, guided parallel to the floor; its wheels turn by functions of time."""
    scene = ts.Scene()
    deck = scene.add_body(10.0, (1.0, 1.0, 2.0), position=(0, 0, radius), name="deck")
    scene.add(C.Planar.at(scene.ground, deck, point=(0, 0, radius), axis=(0, 0, 1)))
    motors = []
    for name, y, turn in (("left", track / 2, left), ("right", -track / 2, right)):
        wheel = scene.add_body(1.0, (0.01, 0.02, 0.01), position=(0, y, radius), name=name)
        hinge = scene.add(C.Revolute.at(deck, wheel, point=(0, y, radius), axis=(0, 1, 0), name=f"{name} hinge"))
        scene.add(C.RollingDisc(wheel, scene.ground, axis_a=(0, 1, 0), radius=radius, normal_b=(0, 0, 1)))
        motors.append(scene.add(C.RotationMotor.of(hinge, angle=turn, name=f"{name} motor")))
    return scene, motors


def test_kinematics_of_driven_wheels():
    """Speed R (l' + r') / 2, yaw rate R (r' - l') / track: a clothoid. The motors' work is kinetic energy."""
    time = ts.motions.time
    scene, motors = cart(2.0 * time - 0.6 * time**2, 2.0 * time + 0.6 * time**2)
    t = np.linspace(0.0, 3.0, 7)
    found = scene.kinematics(t)
    assert found.success
    np.testing.assert_array_equal(found.t, t)
    heading, ways = 0.3 * t**2, []
    for f in (np.cos, np.sin):
        ways.append([0.4 * quad(lambda s, f=f: f(0.3 * s * s), 0.0, end, epsabs=1e-13)[0] for end in t])
    np.testing.assert_allclose(found.position("deck")[:, :2], np.stack(ways, axis=1), atol=FINE)
    first = found.rotation("deck")[:, :, 0]
    np.testing.assert_allclose(first[:, :2], np.stack((np.cos(heading), np.sin(heading)), axis=1), atol=FINE)
    assert max(map(max, found.constraint_error)) < HELD
    wheels = 2.0 * (0.02 * 1.2**2 + 1.0 * 0.24**2 + 0.01 * 0.6**2)  # spin, path and yaw of both, over t t'
    power = sum(found.power_of(motor) for motor in motors)
    np.testing.assert_allclose(power, (2.0 * 0.6**2 + wheels) * t, atol=FINE)
    with pytest.raises(ts.InvalidArgument, match="t must increase from the start, t = 0 s: with rows on velocities"):
        scene.kinematics([1.0, 0.5])


def test_kinematics_names_the_freedom_that_rows_on_velocities_leave():
    with pytest.raises(ts.InvalidArgument, match=r"2 degrees of freedom are left"):
        sleigh().kinematics([0.0, 1.0])


@pytest.mark.slow
def test_a_ball_on_its_head_rolls_over():
    """0.05 m of the centroid from the centre: m g c / (J + m (R - c)^2) about the stable pose, reached from the top."""
    scene = ts.Scene()
    scene.add_body(2.0, (0.02, 0.02, 0.02), position=(0, 0, 0.25), name="ball")
    scene.add(ts.constraints.RollingBall("ball", scene.ground, center_a=(0, 0, -0.05), radius=0.2, normal_b=(0, 0, 1)))
    found = scene.equilibrium()
    assert found.stable
    assert abs(found.state.rotation("ball")[2, 2] + 1.0) < 1e-9
    assert abs(found.smallest_stiffness - 2.0 * 9.81 * 0.05 / (0.02 + 2.0 * 0.15**2)) < 1e-6
