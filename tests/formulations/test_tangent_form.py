"""The form without a basis against the null-space form: the same motion and charts; its cost, and what it skips."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tsdyn as ts
from examples import pendulum_chain
from tests.helpers.constraint_levels import chains, check
from tests.helpers.fixed_steps import assembled
from tests.helpers.reference import NAMES, load
from tests.helpers.scenes import BETWEEN, MOTION, PRIMITIVES, build, random_body, random_chain, random_pair
from tests.helpers.tolerances import CLOSE, COARSE, EPS, FINE, HELD, ROUGH, TIGHT
from tsdyn.formulations.registry import formulation
from tsdyn.rows.constraint_graph import graph_of

C, F, I = ts.constraints, ts.forces, ts.integrators
FORMS = ("tangent", "null-space")


NEVER = 10**9  # a chart_interval that forces no chart; stages are placed on the manifold, as in the null-space form


def both(make, end, integrator, chart_interval=NEVER, **options):
    """A run in each form, of a scene of its own."""
    options["chart_interval"] = chart_interval
    return [
        ts.simulate(make(), (0.0, end), integrator=integrator, formulation=form, **options).raise_if_failed()
        for form in FORMS
    ]


def demand_same(one, two, growth):
    """The same steps and charts, and states that rounding has driven apart by no more than `growth` eps."""
    assert one.charts.reason == two.charts.reason
    np.testing.assert_allclose(one.charts.t, two.charts.t, rtol=CLOSE)
    np.testing.assert_allclose(one.steps.h, two.steps.h, rtol=ROUGH)
    np.testing.assert_array_equal(one.steps.accepted, two.steps.accepted)
    for name in ("q", "qd", "qdd"):
        a, b = getattr(one, name), getattr(two, name)
        assert np.abs(a - b).max() <= growth * EPS * (1.0 + np.abs(b).max()), name


def between_two_bodies():
    """Primitives between the same bodies, written from either of them, beside others at both."""
    scene = ts.Scene(gravity=(0.3, -0.2, -9.8))
    inertia = (0.2, 0.3, 0.25)
    a, b, c = (scene.add_body(mass=m, inertia=inertia, position=(0, 0, -z)) for m, z in ((1.2, 1), (0.7, 2), (0.9, 3)))
    scene.add(C.Spherical(a, scene.ground, point_a=(0, 0, 1)))
    scene.add(C.Spherical(a, b, point_a=(0, 0, -0.5), point_b=(0, 0, 0.5)))
    scene.add(C.Dot1(b, a, axis_a=(1, 0, 0), axis_b=(0, 1, 0)))
    scene.add(C.Dot1(a, b, axis_a=(0, 0, 1), axis_b=(0, 1, 0)))
    scene.add(C.Distance(c, b, point_a=(0, 0, 0.2), point_b=(0.1, 0, -0.3)))
    scene.add(C.Distance(b, c, point_a=(0.2, 0.1, -0.3), point_b=(0.1, 0, 0.1)))
    scene.add(C.Distance(c, scene.ground, point_b=(0.7, 0.3, -3.5)))
    return scene


def test_primitives_between_two_bodies_written_from_either_of_them():
    demand_same(*both(between_two_bodies, 0.2, I.Nystrom4(step=1e-3)), 2e4)


# growth of rounding over the run: steps add up, and the motion itself parts neighbours
GROWTH = {"sliding_top": 2e3, "two_body_pendulum": 2e4, "two_body_pendulum_spatial": 2e4, "chain_4": 2e4}


@pytest.mark.slow_for("chain_4*")
@pytest.mark.parametrize("interval", [NEVER, 7])
@pytest.mark.parametrize("name", GROWTH)
def test_thousands_of_steps_and_many_charts(name, interval):
    end = 1.0 if name == "chain_4" else 5.0
    one, two = both(lambda: load(name)[0], end, I.Nystrom4(step=end / 5000), chart_interval=interval)
    assert one.stats.steps == 5000
    assert one.stats.charts >= (12 if interval == NEVER else 700)
    demand_same(one, two, GROWTH[name])
    assert one.stats.evaluations == two.stats.evaluations
    assert one.stats.placements == two.stats.placements


@pytest.mark.parametrize("method", [I.RK45, I.DOP853])
@pytest.mark.parametrize("name", GROWTH)
def test_steps_do_not_depend_on_the_form(name, method):
    """The error norm is that of q and qd in either; a step's length comes from differences, to some eps / tolerance."""
    one, two = both(lambda: load(name)[0], 1.0, method(1e-7, 1e-9), t_eval=np.linspace(0.0, 1.0, 21))
    assert one.charts.reason == two.charts.reason
    np.testing.assert_array_equal(one.charts.steps, two.charts.steps)
    np.testing.assert_array_equal(one.steps.accepted, two.steps.accepted)
    np.testing.assert_allclose(one.steps.h[:-1], two.steps.h[:-1], rtol=3 * COARSE)
    np.testing.assert_allclose(one.q, two.q, atol=TIGHT)


@pytest.mark.parametrize(("method", "order"), [(I.Nystrom4, 4), (I.RK45, 5), (I.DOP853, 8)])
@pytest.mark.parametrize("name", ["sliding_top", "two_body_pendulum_spatial", "chain_4"])
def test_stages_off_the_manifold_differ_by_truncation(name, method, order):
    """Stages that stay where their sums put them are those of the same method: both forms agree to its order."""
    counts = np.array([30, 40, 60, 80] if order == 8 else [120, 240, 480])
    apart = []
    for count in counts:
        step = method(step=1.0 / count)
        one, two = both(lambda: load(name)[0], 1.0, step, chart_interval=None)
        check(one)
        apart.append(np.abs(one.q[-1] - two.q[-1]).max())
    assert -np.polyfit(np.log(counts), np.log(apart), 1)[0] > order - 0.8


def driven():
    """A point mass on a driven rail, a body on a ball below it, another point mass on a driven rod, and one alone."""
    scene = ts.Scene()
    slider = scene.add_point_mass(1.0, position=(0.3, 0.0, 0.0), velocity=(1.0, 0.0, 0.0))
    body = scene.add_body(**random_body(np.random.default_rng(5), position=(0.0, 0.0, -1.0)))
    bob = scene.add_point_mass(0.5, position=(0.5, 0.5, -2.0))
    scene.add(C.PlaneContact(slider, scene.ground, normal_b=(0.0, 1.0, 0.0)))
    scene.add(C.Dot2(scene.ground, slider, axis_a=(0.0, 0.0, 1.0), value=MOTION["value"]))
    scene.add(C.Spherical(slider, body, point_b=(0.1, 0.2, 0.4)))
    scene.add(C.Distance(body, bob, point_a=(0.0, -0.1, -0.3), length=MOTION["length"]))
    alone = scene.add_body(1.0, (0.1, 0.2, 0.3), position=(5.0, 0.0, 0.0), angular_velocity=(1.0, 5.0, 0.1))
    scene.add(F.Spring(alone, scene.ground, point_a=(0.1, 0.0, 0.0), stiffness=30.0, damping=0.1))
    scene.add(F.PointForce(bob, force=lambda t: (1.0, t, 0.0)))
    scene.assemble()
    return scene


def test_motions_forces_point_masses_and_loose_parts():
    one, two = both(driven, 3.0, I.Nystrom4(step=1e-3))
    demand_same(one, two, 2e4)
    check(one)
    scale = 1.0 + np.abs(two.multipliers).max()
    assert np.abs(one.multipliers - two.multipliers).max() < FINE * scale


def free_bodies():
    scene = ts.Scene()
    scene.add_body(2.0, (0.1, 0.2, 0.25), angular_velocity=(0.1, 6.0, 0.2), velocity=(1.0, 0.0, 3.0))
    scene.add_point_mass(1.0, position=(1.0, 0.0, 0.0), velocity=(0.0, 2.0, 0.0))
    return scene


def test_without_any_constraint():
    one, two = both(free_bodies, 2.0, I.Nystrom4(step=1e-3))
    demand_same(one, two, 2e3)
    assert set(one.charts.reason) == {"start", "turn of a body"}
    mass = one.scene.bodies[1]
    expected = mass.position + np.outer(one.t, mass.velocity) + 0.5 * np.outer(one.t**2, one.scene.gravity)
    assert np.abs(one.position(mass) - expected).max() < HELD


@pytest.mark.slow_but("*body to body")
@pytest.mark.parametrize("between", BETWEEN)
@pytest.mark.parametrize("name", PRIMITIVES)
def test_every_primitive(name, between, rng):
    definition = random_pair(rng, name, between)
    one, two = both(lambda: assembled(definition), 0.5, I.Nystrom4(step=1e-3))
    demand_same(one, two, 1e4)


@pytest.mark.slow
@given(definition=chains(), seed=st.integers(0, 100))
def test_random_chains(definition, seed):
    one, two = both(lambda: assembled(definition), 0.1, I.Nystrom4(step=2e-3))
    demand_same(one, two, 1e5)


def test_plug_in_with_parameters_and_gravity_free_chain(rng):
    definition = random_chain(rng, 5, gravity=(0.0, 0.0, 0.0))
    one, two = both(lambda: build(definition), 1.0, I.DOP853(step=0.01), chart_interval=1)
    demand_same(one, two, 1e5)


# size


def test_a_long_chain_is_on_its_constraints():
    """300 bodies: matrices of the null-space form would take a minute a second of motion, and more."""
    scene = pendulum_chain.build(300)
    options = {"integrator": I.DOP853(1e-6, 1e-6), "t_eval": np.linspace(0.0, 0.2, 7)}
    solution = ts.simulate(scene, (0.0, 0.2), **options).raise_if_failed()
    check(solution)
    at = scene.evaluate(solution.q[-1], solution.qd[-1], solution.t[-1])
    assert np.abs(at.qdd - solution.qdd[-1]).max() < CLOSE * np.abs(at.qdd).max()
    lam = solution.multipliers[-1]
    assert np.abs(at.multipliers - lam).max() < CLOSE * np.abs(lam).max()


def test_no_matrix_grows_with_the_square(monkeypatch):
    """Memory of a run, its start and its results, counted in floats of the largest array."""
    largest, zeros = [0], np.zeros

    def counted(shape, *arguments, **keywords):
        result = zeros(shape, *arguments, **keywords)
        largest[0] = max(largest[0], result.size)
        return result

    scene = pendulum_chain.build(200)
    scene.packed  # noqa: B018
    monkeypatch.setattr(np, "zeros", counted)
    solution = ts.simulate(scene, (0.0, 1e-2), integrator=I.Nystrom4(step=5e-3), t_eval=[0.0, 1e-2])
    solution.multipliers, solution.reaction(scene.constraints[3])
    assert solution.success
    assert largest[0] < 200 * 2000


def test_network_of_a_chain_has_no_fill():
    graph = graph_of(pendulum_chain.build(100).packed)
    assert graph.pattern.shape[1] < 100 * 36


# levers and units


def rod(length):
    """A rod that swings about its end; time goes with the square root of its length."""
    scene = ts.Scene(gravity=(0.0, 0.0, -10.0))
    level = (np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0)
    body = scene.add_body(3.0, (length**2, length**2, 0.1 * length**2), position=(length, 0, 0), orientation=level)
    scene.add(C.Spherical(scene.ground, body, point_b=(0.0, 0.0, length)))
    return scene


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("length", [1e-6, 1e3, 1e6])
def test_levers_of_any_length_run_alike(length, form):
    """Charts at the same angles, the same motion: the metric is that of the masses."""
    unit, scale = 2.0**-7, np.sqrt(length)
    short = ts.simulate(rod(1.0), (0.0, 4.0), integrator=I.Nystrom4(step=unit), formulation=form)
    long = ts.simulate(rod(length), (0.0, 4.0 * scale), integrator=I.Nystrom4(step=unit * scale), formulation=form)
    assert long.charts.reason == short.charts.reason
    np.testing.assert_array_equal(long.charts.steps, short.charts.steps)
    body = long.scene.bodies[0]
    tol = 1e-10 if form == "tangent" else 1e-8  # there |p| is kept as well as lengths are: to 1e-15 of the largest
    np.testing.assert_allclose(long.orientation(body), short.orientation(short.scene.bodies[0]), rtol=0, atol=tol)
    np.testing.assert_allclose(long.position(body) / length, short.position(short.scene.bodies[0]), rtol=0, atol=tol)


# what it falls back to, and what it skips


@pytest.mark.slow
def test_no_method_needs_a_basis():
    form = formulation("tangent")
    assert form.serving(I.SDIRK54()).basis_free
    assert form.serving(I.DOP853()) is form


@pytest.mark.parametrize("name", sorted(set(NAMES) & set(GROWTH)))
def test_what_is_skipped_is_counted(name):
    stats = both(lambda: load(name)[0], 0.5, I.Nystrom4(step=1e-3))[0].stats
    assert stats.newton_iterations + stats.solves_skipped >= stats.placements
    assert stats.checks_skipped > 0.5 * (stats.placements - stats.solves_skipped)
    assert stats.b_iterations == 0


def test_free_bodies_factorise_nothing():
    stats = ts.simulate(free_bodies(), (0.0, 1.0), integrator=I.Nystrom4(step=1e-3)).stats
    assert stats.factorizations == stats.newton_iterations == 0


def test_t_eval_and_dense_output_leave_the_run_alone():
    scene, _ = load("two_body_pendulum_spatial")
    plain = ts.simulate(scene, (0.0, 2.0), integrator=I.DOP853(1e-8, 1e-8))
    dense = ts.simulate(scene, (0.0, 2.0), integrator=I.DOP853(1e-8, 1e-8), dense_output=True, t_eval=plain.t[::3])
    np.testing.assert_array_equal(plain.q[::3], dense.q)
    np.testing.assert_array_equal(plain.steps.h, dense.steps.h)


def nothing(t, a, b, par, out):
    out[0] = 0.0


def branch(t, a, b, par, out):
    if a[0] > 1e9:
        out[0] = 1.0


@pytest.mark.slow
@pytest.mark.parametrize("method", [I.DOP853(1e-9, 1e-9), I.Nystrom4(step=1e-2)], ids=repr)
def test_a_scene_without_series_is_as_well_conditioned_as_it_is(method):
    """The same bits, and so the same work, as with a force of zero that has a series."""

    def last(function):
        scene, before = ts.Scene(), None
        for i in range(3):
            link = scene.add_body(1.0, (0.1, 0.1, 0.1), (i + 0.5, 0, 0))
            scene.add(C.Spherical.at(before or scene.ground, link, point=(i, 0, 0)))
            before = link
        scene.add(F.UserForce(before, function=function))
        return ts.simulate(scene, (0.0, 1.0), integrator=method).state

    one, other = last(nothing), last(branch)
    assert one.q.tobytes() == other.q.tobytes()
    assert one.qd.tobytes() == other.qd.tobytes()
