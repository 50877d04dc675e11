"""Runs with contacts against independent references: minimal coordinates, quadratures, momentum balances."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk

import tsdyn as ts

C = ts.constraints
G = 9.81
TIGHT = {"rtol": 1e-13, "atol": 1e-13}


class Planar:
    """A system in minimal coordinates x with one gap, by DOP853: free, closed, impacts.

    Parameters
    ----------
    equations : function
        Of x, xd; returns M (n, n) and h (n,) of M xdd = h.
    gap : function
        Of x; returns the gap, its gradient J (n,), and a function of x, xd that returns d(J)/dt xd.
    e : float
    """

    def __init__(self, equations, gap, e):
        self.equations, self.gap, self.e = equations, gap, e
        self.impacts, self.phases = [], []

    def accelerations(self, x, xd, closed):
        """xdd, and the reaction where the gap is closed."""
        M, h = self.equations(x, xd)
        _, J, bias = self.gap(x)
        if not closed:
            return np.linalg.solve(M, h), 0.0
        n = x.size
        K = np.block([[M, -J[:, None]], [J[None], np.zeros((1, 1))]])
        found = np.linalg.solve(K, np.append(h, -bias(x, xd)))
        return found[:n], found[n]

    def run(self, x, xd, end):
        """Run to `end`; the state there."""
        t, closed, n = 0.0, False, len(x)
        state = np.concatenate([x, xd])
        while t < end:

            def rates(_, y, closed=closed):
                return np.concatenate([y[n:], self.accelerations(y[:n], y[n:], closed)[0]])

            def event(s, y, closed=closed, begun=t):
                value = self.accelerations(y[:n], y[n:], True)[1] if closed else self.gap(y[:n])[0]
                return value if s > begun + 1e-6 else 1.0  # beyond where it has just opened

            event.terminal, event.direction = True, -1
            run = solve_ivp(rates, (t, end), state, "DOP853", events=event, max_step=0.01, **TIGHT)
            self.phases.append((t, run.t[-1], closed))
            t, state = run.t[-1], run.y[:, -1].copy()
            if run.status != 1:
                break
            if closed:
                closed = False
                continue
            M, J = self.equations(state[:n], state[n:])[0], self.gap(state[:n])[1]
            inverse = np.linalg.solve(M, J)
            p = -(1.0 + self.e) * (J @ state[n:]) / (J @ inverse)
            self.impacts.append((t, p))
            state[n:] += inverse * p
            closed = self.e == 0.0 and self.accelerations(state[:n], state[n:], True)[1] > 0.0
        return state


# a double pendulum with a stop of its elbow


def arms(e):
    """Two bars of 1 m and 1 kg, straight down; the elbow bends one way."""
    scene = ts.Scene(gravity=(0, 0, -G))
    inertia = (1 / 12, 1 / 12, 1e-3)
    upper = scene.add_body(mass=1.0, inertia=inertia, position=(0, 0, -0.5), name="upper")
    lower = scene.add_body(mass=1.0, inertia=inertia, position=(0, 0, -1.5), name="lower")
    axis = {"axis": (0, 1, 0)}
    shoulder = scene.add(C.Revolute.at(scene.ground, upper, point=(0, 0, 0), **axis, name="shoulder"))
    elbow = scene.add(C.Revolute.at(upper, lower, point=(0, 0, -1), **axis, name="elbow"))
    scene.set(shoulder, angle=0.4)
    scene.set(elbow, angle=0.7)
    scene.add(C.Stop(elbow, lower=0.0, restitution=e, name="stop"))
    return scene


def arms_in_minimal_coordinates(x, xd):
    """Absolute angles (a, b) of the bars, from the vertical."""
    c, s = np.cos(x[0] - x[1]), np.sin(x[0] - x[1])
    M = np.array([[4 / 3, 0.5 * c], [0.5 * c, 1 / 3]])
    h = -np.array([0.5 * s * xd[1] ** 2 + 1.5 * G * np.sin(x[0]), -0.5 * s * xd[0] ** 2 + 0.5 * G * np.sin(x[1])])
    return M, h


@pytest.mark.parametrize(("e", "end"), [(1.0, 2.2), (0.5, 1.3), (0.0, 2.8)])
def test_an_elbow_with_a_stop(e, end):
    """Elastic, partly elastic, and plastic: closed for a while, until the reaction vanishes."""
    reference = Planar(arms_in_minimal_coordinates, lambda x: (x[1] - x[0], np.array([-1.0, 1.0]), lambda *_: 0.0), e)
    a, b, *rates = reference.run(np.array([0.4, 1.1]), np.zeros(2), end)
    solution = ts.simulate(arms(e), (0, end), **TIGHT)
    assert len(solution.impulses) == len(reference.impacts) >= 2
    times, impulses = np.array([(t, p) for t, _, p in solution.impulses]).T
    exact = np.array(reference.impacts).T
    assert np.abs(times - exact[0]).max() < 1e-10
    assert np.abs(impulses - exact[1]).max() < 1e-10
    bent = solution.angle("elbow")[-1]
    np.testing.assert_allclose([solution.angle("shoulder")[-1], bent], [a, b - a], atol=1e-10)
    np.testing.assert_allclose(solution.angle_rate("elbow")[-1], rates[1] - rates[0], atol=1e-9)
    held = [(t, until) for t, until, names in solution.phases if names]
    np.testing.assert_allclose(held, [(t, until) for t, until, closed in reference.phases if closed], atol=1e-10)


# a block on smooth ground: its centre moves along a vertical


def block(b, h, tilt, e=0.0, **friction):
    """Half width b, half height h; tilted about one of its lower edges."""
    scene, mass = ts.Scene(gravity=(0, 0, -G)), 2.0
    inertia, height = mass * (b * b + h * h) / 3, h * np.cos(tilt) + b * np.sin(tilt)
    turned = (np.cos(tilt / 2), 0, np.sin(tilt / 2), 0)
    body = scene.add_body(mass=mass, inertia=(inertia,) * 3, position=(0, 0, height), orientation=turned, name="block")
    scene.add(C.Parallel(body, scene.ground, axis_a=(0, 1, 0), axis_b=(0, 1, 0)))
    for i, corner in enumerate([(-b, 0, -h), (b, 0, -h), (b, 0, h)]):
        contact = {"normal_b": (0, 0, 1), "unilateral": True, "restitution": e, "name": f"edge {i}"}
        scene.add(C.PlaneContact(body, scene.ground, point_a=corner, **contact, **friction))
    return scene


class Smooth:
    """The same block, per unit of mass, turning about an edge that slides: its inertia and fall as functions of x."""

    def __init__(self, b, h):
        self.b, self.h, self.own = b, h, (b * b + h * h) / 3

    def inertia(self, x):
        """About the centre, and of the centre's height, (dz/dx)^2."""
        return self.own + (self.b * np.cos(x) - self.h * np.sin(x)) ** 2

    def fall(self, x, to):
        """Height of the centre at x less that at `to`, without cancellation."""
        mean, half = (x + to) / 2, (x - to) / 2
        return 2 * np.sin(half) * (self.b * np.cos(mean) - self.h * np.sin(mean))

    def time(self, top):
        """Seconds from rest at a tilt to the flat pose; x = top - u^2 removes the singular end."""

        def per_u(u):
            return 2 * u * np.sqrt(self.inertia(top - u * u) / (2 * G * self.fall(top, top - u * u)))

        return quad(per_u, 0, np.sqrt(top), epsabs=1e-14)[0]


def test_a_block_rocks_on_smooth_ground():
    """At each impact the rate falls by (I - m b^2) / (I + m b^2), and edges change; times between by quadrature."""
    b, h, top = 0.2, 0.5, 0.1
    solution = ts.simulate(block(b, h, top), (0, 1.0), **TIGHT)
    smooth, t, times = Smooth(b, h), 0.0, []
    factor = (smooth.own - b * b) / (smooth.own + b * b)
    for _ in range(5):
        times.append(t + smooth.time(top))
        height = factor**2 * smooth.fall(top, 0.0)
        top = brentq(lambda x, height=height: smooth.fall(x, 0.0) - height, 0, top, xtol=1e-15)
        t = times[-1] + smooth.time(top)
    np.testing.assert_allclose([t for t, *_ in solution.impulses[:5]], times, atol=1e-10)
    assert [name for _, name, _ in solution.impulses[:4]] == ["edge 0", "edge 1"] * 2
    assert [names for *_, names in solution.phases[:3]] == [("edge 1",), ("edge 0",), ("edge 1",)]
    assert solution.phases[-1][2] == ("edge 0", "edge 1")  # in finite time
    assert np.ptp(solution.position("block")[:, 0]) < 1e-13


def test_a_block_rocks_on_rough_ground():
    """Housner 1963: about an edge that sticks, the rate falls by 1 - 3/2 sin^2 at each impact; times by quadrature."""
    b, h, top, times, t = 0.2, 0.5, 0.1, [], 0.0
    solution = ts.simulate(block(b, h, top, kinetic=0.6), (0, 0.8), **TIGHT)
    smooth, whole, factor = Smooth(b, h), 4 / 3 * (b * b + h * h), 1 - 1.5 * b * b / (b * b + h * h)

    def swing(top):
        return quad(lambda u: 2 * u * np.sqrt(whole / (2 * G * smooth.fall(top, top - u * u))), 0, np.sqrt(top))[0]

    for _ in range(3):
        times.append(t + swing(top))
        height = factor**2 * smooth.fall(top, 0.0)
        top = brentq(lambda x, height=height: smooth.fall(x, 0.0) - height, 0, top, xtol=1e-15)
        t = times[-1] + swing(top)
    np.testing.assert_allclose([t for t, *_ in solution.impulses[:3]], times, atol=1e-9)
    assert [name for _, name, _ in solution.impulses[:3]] == ["edge 0", "edge 1", "edge 0"]


def test_a_flat_block_rests_at_once():
    """Below h^2 = 2 b^2 both edges hold: I < m b^2."""
    solution = ts.simulate(block(0.5, 0.4, 0.1), (0, 1.0))
    assert [names for *_, names in solution.phases] == [("edge 1",), ("edge 0", "edge 1")]


@pytest.mark.parametrize("law", ["newton", "poisson"])
def test_laws_of_impact_in_a_run(law):
    """A flat block on an elastic edge falls on its plastic one: by Poisson's law alone the former rebounds.

    Compression ends with impulses p of both edges; that of the elastic one, p_1, is given again, and the plastic one
    keeps its edge down: gd_1 = p_1 (G_11 - G_01^2 / G_00).
    """
    b, h, e = 0.5, 0.4, 0.8
    scene, smooth = block(b, h, 0.1), Smooth(b, h)
    scene["edge 1"].restitution = e
    solution = ts.simulate(scene, (0, 0.3), law=law, dense_output=True)
    t = solution.impulses[0][0]
    rate = np.sqrt(2 * G * smooth.fall(0.1, 0.0) / smooth.inertia(0.0))
    own, other = 1 + b * b / smooth.own, 1 - b * b / smooth.own
    _, p = np.linalg.solve([[own, other], [other, own]], [2 * b * rate, 0])
    exact = {"newton": 0.0, "poisson": e * p * (own - other**2 / own)}[law]
    assert abs(t - smooth.time(0.1)) < 1e-8
    assert abs(2 * b * np.abs(solution.at(t).angular_velocity("block")).max() - exact) < 1e-7
    assert np.diff(solution.energy).max() < 1e-7


def test_an_unknown_law_is_named():
    with pytest.raises(ts.InvalidArgument, match="law must be 'newton' or 'poisson', got 'stronge'"):
        ts.simulate(block(0.5, 0.4, 0.1), (0, 1), law="stronge")


def test_a_falling_box_tips_over():
    """Dropped on an edge beyond its balance; it turns until its side is down, at an instant by quadrature."""
    b, h, tilt, drop = 0.2, 0.5, 0.6, 0.3
    scene = block(b, h, tilt)
    scene.body("block").position = (0, 0, h * np.cos(tilt) + b * np.sin(tilt) + drop)
    solution = ts.simulate(scene, (0, 1.5), **TIGHT)
    fall, arm = np.sqrt(2 * drop / G), b * np.cos(tilt) - h * np.sin(tilt)
    first, name, p = solution.impulses[0]
    inertia = (b * b + h * h) / 3  # per unit of mass
    exact = 2.0 * G * fall / (1 + arm * arm / inertia)
    assert (name, abs(first - fall) < 1e-12, abs(p - exact) < 1e-11) == ("edge 1", True, True)
    smooth, rate = Smooth(b, h), exact / 2.0 * -arm / inertia
    energy = 0.5 * smooth.inertia(tilt) * rate**2

    def per_angle(x):
        return np.sqrt(smooth.inertia(x) / (2 * (energy + G * smooth.fall(tilt, x))))

    until = quad(per_angle, tilt, np.pi / 2, epsabs=1e-14)[0]
    closed = [names for *_, names in solution.phases[:3]]
    assert closed == [(), ("edge 1",), ("edge 1", "edge 2")]
    assert abs(solution.phases[2][0] - (fall + until)) < 1e-11
    np.testing.assert_allclose(solution.position("block")[-1], [0, 0, b], atol=1e-13)


# slider-crank with clearance


def clearance(e, radius=0.05, rod=0.3, play=2e-3, rate=20.0):
    """A crank that is driven; a smooth pin of the rod, with play, in the eye of a piston on a slide."""
    scene = ts.Scene(gravity=(0, 0, 0))
    bar = scene.add_body(mass=0.2, inertia=(1e-5, 1.5e-3, 1.5e-3), position=(radius + rod / 2, 0, 0), name="rod")
    piston = scene.add_body(mass=0.3, inertia=(1e-4,) * 3, position=(radius + rod, 0, 0), name="piston")
    tip = ts.motions.Sine(radius, rate, np.pi / 2), ts.motions.Sine(radius, rate), 0.0
    scene.add(C.PointDriver(scene.ground, bar, point_b=(-rod / 2, 0, 0), path=tip))
    scene.add(C.Parallel(scene.ground, bar, axis_a=(0, 0, 1), axis_b=(0, 0, 1)))
    scene.add(C.Translational.at(scene.ground, piston, point=piston.position, axis=(1, 0, 0)))
    contact = {"center_a": (rod / 2, 0, 0), "radius_a": 0.01, "radius_b": 0.01 + play, "inside": True}
    scene.add(C.SphereContact(bar, piston, **contact, restitution=e, name="pin"))
    bar.velocity = 0, radius * rate, 0
    return scene


def test_a_slider_crank_with_clearance():
    """Impacts of the pin in its eye, against minimal coordinates: angle of the rod, place of the piston."""
    e, end, r, L, play, w = 0.9, 0.1, 0.05, 0.3, 2e-3, 20.0
    scene = clearance(e, r, L, play, w)
    solution = ts.simulate(scene, (0, end), **TIGHT)

    def free(t, y):
        phi, _, dphi, v = y
        pull = -w * w * r * np.array([np.cos(w * t), np.sin(w * t)])  # acceleration of the crank pin
        torque = -0.2 * L / 2 * (np.cos(phi) * pull[1] - np.sin(phi) * pull[0])
        return [dphi, v, torque / (1.5e-3 + 0.2 * L * L / 4), 0.0]

    def pin(t, y):
        """From the eye's centre, and its rates by (dphi, v), and by time."""
        phi, x = y[:2]
        d = r * np.array([np.cos(w * t), np.sin(w * t)]) + L * np.array([np.cos(phi), np.sin(phi)]) - [x, 0.0]
        by = np.array([[-L * np.sin(phi), -1.0], [L * np.cos(phi), 0.0]])
        return d, by, w * r * np.array([-np.sin(w * t), np.cos(w * t)])

    t, y, exact = 0.0, np.array([0.0, r + L, 0.0, 0.0]), []
    M = np.array([1.5e-3 + 0.2 * L * L / 4, 0.3])
    while t < end:
        begun = t

        def gap(s, y, begun=begun):
            return play - np.linalg.norm(pin(s, y)[0]) if s > begun + 1e-9 else 1.0

        gap.terminal, gap.direction = True, -1
        run = solve_ivp(free, (t, end), y, "DOP853", events=gap, max_step=5e-4, **TIGHT)
        t, y = run.t[-1], run.y[:, -1].copy()
        if run.status != 1:
            break
        d, by, drift = pin(t, y)
        n = -d / np.linalg.norm(d)
        J = n @ by
        p = -(1 + e) * (J @ y[2:] + n @ drift) / (J @ (J / M))
        y[2:] += J / M * p
        exact.append((t, p))
    assert len(solution.impulses) == len(exact) > 8
    found = np.array([(t, p) for t, _, p in solution.impulses])
    np.testing.assert_allclose(found, exact, atol=1e-9)
    np.testing.assert_allclose(solution.position("piston")[-1, 0], y[1], atol=1e-10)


# chains onto a floor


def test_a_chain_falls_onto_a_floor():
    """Of beads in a column, each of which falls freely until it lands: so the impulses are known one by one."""
    scene, n, pitch, drop = ts.Scene(gravity=(0, 0, -G)), 20, 0.05, 0.01
    beads = [scene.add_point_mass(mass=0.1, position=(0, 0, drop + pitch * i), name=f"bead {i}") for i in range(n)]
    for bead in beads:
        contact = {"normal_b": (0, 0, 1), "unilateral": True, "name": f"floor {bead.name}"}
        scene.add(C.PlaneContact(bead, scene.ground, **contact))
    solution = ts.simulate(scene, (0, 0.5))
    falls = np.sqrt(2 * (drop + pitch * np.arange(n)) / G)
    np.testing.assert_allclose([t for t, *_ in solution.impulses], falls, atol=1e-13)
    np.testing.assert_allclose([p for *_, p in solution.impulses], 0.1 * G * falls, rtol=1e-12)


def test_momentum_of_a_chain_that_falls_onto_a_floor():
    """The floor's impulses and reactions over time, given by the run's own reports, make the change of momentum."""
    scene, n, L = ts.Scene(gravity=(0, 0, -G)), 6, 0.2
    last, tip = None, np.array([0, 0, 0.05])
    for i in range(n):
        lean = 0.3 * (-1) ** i
        along = L / 2 * np.array([np.sin(lean), 0, np.cos(lean)])
        turned = (np.cos(lean / 2), 0, np.sin(lean / 2), 0)
        link = scene.add_body(mass=0.1, inertia=(3.5e-4, 3.5e-4, 1e-5), position=tip + along, orientation=turned)
        if last:
            scene.add(C.Spherical.at(last, link, point=tip))
        last, tip = link, tip + 2 * along
        for end in (-L / 2, L / 2):
            contact = {"point_a": (0, 0, end), "normal_b": (0, 0, 1), "unilateral": True}
            scene.add(C.PlaneContact(link, scene.ground, **contact))
    solution = ts.simulate(scene, (0, 0.4), rtol=1e-11, atol=1e-11, dense_output=True)
    steady = 0.0
    for start, end, names in solution.phases:
        nodes, weights = np.polynomial.legendre.leggauss(40)
        if names and end - start > 1e-9:
            at = solution.at(start + (end - start) * (nodes + 1) / 2)
            steady += (end - start) / 2 * weights @ sum(at.reaction(name)[0][:, 2] for name in names)
    impulse = sum(p for *_, p in solution.impulses)
    change = np.diff(solution.linear_momentum[[0, -1], 2])[0]
    assert len(solution.impulses) > 4
    assert abs(impulse + steady - n * 0.1 * G * 0.4 - change) < 1e-9


@pytest.mark.parametrize("method", [None, "dop853"])
def test_a_contact_without_a_reaction_opens_where_it_is_pulled(method):
    """Two particles drift side by side, their reaction zero for some steps, until a force grows on the one ahead."""
    scene, pull = ts.Scene(gravity=(0, 0, 0)), ts.Table([0, 0.5, 1.5], [0, 0, 6.0], kind="linear")
    behind = scene.add_point_mass(mass=1.0, velocity=(0.3, 0, 0))
    ahead = scene.add_point_mass(mass=2.0, position=(1, 0, 0), velocity=(0.3, 0, 0))
    scene.add(C.SphereContact(behind, ahead, radius_a=0.5, radius_b=0.5, restitution=0.5, name="touch"))
    scene.add(ts.forces.PointForce(ahead, force=(pull, 0, 0)))
    solution = ts.simulate(scene, (0, 1.5), integrator=method, max_step=0.2)
    assert solution.phases == [(0.0, 0.5, ("touch",)), (0.5, 1.5, ())]
    assert solution.impulses == []
    assert np.diff(solution.t).min() >= 0.0
    np.testing.assert_allclose(solution.position(ahead)[-1, 0], 1.0 + 0.45 + 6.0 / 2.0 / 6.0, atol=1e-13)
    np.testing.assert_allclose(solution.position(behind)[-1, 0], 0.45, atol=1e-13)


@pytest.mark.parametrize("method", [None, "dop853"])
def test_a_contact_that_is_pulled_from_the_start_opens_there(method):
    """The reaction, zero at t = 0, has its event there: a time that no relative step changes."""
    scene = ts.Scene(gravity=(0, 0, 0))
    behind, ahead = (scene.add_point_mass(mass=2.0, position=(x, 0, 0)) for x in (0, 1))
    scene.add(C.SphereContact(behind, ahead, radius_a=0.5, radius_b=0.5, name="touch"))
    scene.add(ts.forces.PointForce(ahead, force=(6.0 * ts.motions.time, 0, 0)))
    solution = ts.simulate(scene, (0, 1.0), integrator=method)
    assert solution.phases[-1][1:] == (1.0, ())
    assert solution.phases[-1][0] < 1e-30
    np.testing.assert_allclose(solution.position(ahead)[-1, 0], 1.5, atol=1e-14)
    np.testing.assert_allclose(solution.position(behind)[-1], 0.0, atol=1e-30)


@pytest.mark.parametrize("count", [3, 4])
def test_balls_of_a_cradle_that_hang_at_rest_touch_without_a_reaction(count):
    """Rounding of a reaction that is zero opens no contact before the first ball comes, after a quarter of a period."""
    scene, last = ts.Scene(gravity=(0, 0, -9.81)), None
    for i in range(count):
        tilt = 0.5 * (i == 0)
        ball = scene.add_point_mass(1.0, (0.2 * i - np.sin(tilt), 0, -np.cos(tilt)))
        scene.add(C.Distance(ball, scene.ground, point_b=(0.2 * i, 0, 0)))
        if last is not None:
            scene.add(C.SphereContact(last, ball, radius_a=0.1, radius_b=0.1, name=f"{i}"))
        last = ball
    solution = ts.simulate(scene, (0, 0.55))
    start, end, touching = solution.phases[0]
    assert (start, touching) == (0.0, tuple(str(i) for i in range(2, count)))
    np.testing.assert_allclose(end, ellipk(np.sin(0.25) ** 2) / np.sqrt(9.81), rtol=1e-8)
    # Plastic: all go on together
    speed = np.sqrt(19.62 * (1 - np.cos(0.5)))
    np.testing.assert_allclose(
        [p for _, _, p in solution.impulses], speed * (1 - np.arange(1, count) / count), rtol=1e-8
    )


def square_of_rate(angle, mu, first):
    """Of a particle that slides on a ball of 1 m from an angle `first` off the top, at rest; angles rad, rates rad/s.

    d(w^2)/da - 2 mu w^2 = 2 G (sin a - mu cos a) is linear.
    """

    def particular(a):
        return G * ((4 * mu**2 - 2) * np.cos(a) - 6 * mu * np.sin(a)) / (1 + 4 * mu**2)

    return particular(angle) - particular(first) * np.exp(2 * mu * (angle - first))


@pytest.mark.parametrize("mu", [0.1, 0.3])
def test_a_particle_slides_off_a_rough_ball(mu):
    first = np.arctan(mu) + 0.1
    scene = ts.Scene(gravity=(0, 0, -G))
    particle = scene.add_point_mass(2.0, position=(np.sin(first), 0, np.cos(first)), name="particle")
    scene.add(C.SphereContact(particle, scene.ground, radius_a=0.0, radius_b=1.0, kinetic=mu, name="ball"))
    solution = ts.simulate(scene, (0, 5), rtol=1e-12, atol=1e-13, dense_output=True)
    leaves = brentq(lambda a: G * np.cos(a) - square_of_rate(a, mu, first), first, 1.5, xtol=1e-15)
    (_, end, names), (_, _, none) = solution.phases
    x, _, z = solution.at(end).position("particle")
    assert (names, none) == (("ball",), ())
    assert np.arctan2(x, z) == pytest.approx(leaves, abs=1e-12)
    assert np.ptp(solution.energy - solution.work) < 1e-11


def test_a_particle_comes_to_rest_in_a_rough_bowl():
    """It slides down from the side, up the other side, and sticks there, as in the closed form."""
    mu, static, first = 0.3, 0.4, -1.2  # off the bottom, where gravity has the other sign than on a ball
    stops = brentq(lambda a: square_of_rate(a - np.pi, -mu, first - np.pi), first + 0.1, 1.0, xtol=1e-15)
    assert 0.0 < stops < np.arctan(static)
    scene = ts.Scene(gravity=(0, 0, -G))
    particle = scene.add_point_mass(2.0, position=(np.sin(first), 0, -np.cos(first)), name="particle")
    law = {"inside": True, "kinetic": mu, "static": static}
    scene.add(C.SphereContact(particle, scene.ground, radius_a=0, radius_b=1, **law, name="bowl"))
    solution = ts.simulate(scene, (0, 5), rtol=1e-12, atol=1e-13)
    x, _, z = solution.position("particle")[-1]
    assert len(solution.phases) == 2
    assert solution.sticking("bowl")[-1]
    assert np.arctan2(x, -z) == pytest.approx(stops, abs=1e-12)


def test_a_particle_in_a_free_hollow_ball_keeps_the_momenta():
    scene = ts.Scene(gravity=(0, 0, 0))
    shell = scene.add_body(3.0, (0.5, 0.7, 0.6), angular_velocity=(0.5, 0.2, 1.0), name="shell")
    particle = scene.add_point_mass(1.0, position=(0.3, 0.1, 0), velocity=(1, 2, -0.5))
    law = {"kinetic": 0.4, "restitution": 0.2}
    scene.add(C.SphereContact(particle, shell, radius_a=0, radius_b=1, inside=True, **law, name="contact"))
    solution = ts.simulate(scene, (0, 4), rtol=1e-11, atol=1e-12, dense_output=True)
    assert solution.phases[-1][2] == ("contact",)
    for momentum in (solution.linear_momentum, solution.angular_momentum):
        assert np.ptp(momentum, axis=0).max() < 1e-12
    assert np.diff(solution.energy - solution.work).max() < 1e-12
