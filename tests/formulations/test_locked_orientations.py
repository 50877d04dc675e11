"""Bodies that a scene never turns cost no rotation: nothing else about them changes, and what may turn, turns."""

import pickle

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.locked_scenes import SCENES, C, F, X, Y, Z, block, floating, slider_crank, slides, welded
from tests.helpers.minimal_coordinates import balance
from tests.helpers.tolerances import ALGEBRA, CLOSE, EXACT, FAIR, FINE, HELD, ROUGH, ROUNDING, TIGHT
from tsdyn.formulations.locked_orientations import keep_turning, moving_graph, still
from tsdyn.rows.constraint_graph import graph_of

I = ts.integrators
END = 1.0
TIMES = np.linspace(0.0, END, 11)
METHODS = {
    "dop853": {"integrator": I.DOP853(1e-12, 1e-12)},
    "taylor": {"integrator": I.Taylor(1e-14)},
    "nystrom4": {"integrator": I.Nystrom4(step=1e-3)},
}
NULL_SPACE = {"integrator": I.DOP853(1e-12, 1e-12), "formulation": "null-space"}


def turning(scene):
    """The scene with no body taken for still."""
    keep_turning(scene.packed, range(len(scene.bodies)))
    return scene


def run(scene, method="dop853", **options):
    options = {"t_eval": TIMES, **METHODS.get(method, NULL_SPACE), **options}
    return ts.simulate(scene, (0.0, END), **options).raise_if_failed()


@pytest.fixture(scope="module")
def references():
    """Solutions with every coordinate, by Eq. 26, made once each."""
    known = {}

    def reference(name):
        if name not in known:
            known[name] = run(SCENES[name][0](), "null-space")
        return known[name]

    return reference


@pytest.mark.slow_for("hub-*")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", SCENES)
def test_the_motion_is_that_with_every_rotation(name, method, references):
    build, count = SCENES[name]
    solution, other = run(build(), method), references(name)
    assert solution.stats.rotations_skipped == count * solution.stats.evaluations > 0
    assert other.stats.rotations_skipped == 0
    tol = 1e-8 if method == "nystrom4" else 2e-11
    for one, two in ((solution.q, other.q), (solution.qd, other.qd)):
        np.testing.assert_allclose(one, two, rtol=0, atol=tol * (1.0 + np.abs(two).max()))
    np.testing.assert_allclose(solution.qdd, other.qdd, rtol=0, atol=10 * tol * (1.0 + np.abs(other.qdd).max()))
    assert (np.isnan(solution.multipliers) == np.isnan(other.multipliers)).all()
    both = [np.nan_to_num(s.multipliers) for s in (solution, other)]
    np.testing.assert_allclose(*both, rtol=0, atol=50 * tol * (1.0 + np.abs(both[1]).max()))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", SCENES)
def test_constraints_hold_and_reactions_balance(name, method):
    solution = run(SCENES[name][0](), method)
    error = solution.constraint_error
    assert error.position.max() < 2 * ROUNDING
    assert error.velocity.max() < 2 * ROUNDING * (1.0 + np.abs(solution.qd).max())
    assert error.acceleration.max() < 2 * ALGEBRA * (1.0 + np.abs(solution.qdd).max())
    assert balance(solution) < TIGHT
    for i in still(solution.packed).bodies:
        body = solution.scene.bodies[i]
        assert (solution.orientation(body) == solution.orientation(body)[0]).all()
        assert not solution.angular_velocity(body).any()
        assert not solution.angular_acceleration(body).any()


@pytest.mark.parametrize("name", SCENES)
def test_steps_are_those_with_every_rotation(name):
    """The same errors are measured, so the same steps are made."""
    one, other = run(SCENES[name][0]()), run(turning(SCENES[name][0]()))
    assert other.stats.rotations_skipped == 0
    assert abs(one.stats.steps - other.stats.steps) <= 0.02 * other.stats.steps
    np.testing.assert_allclose(one.q, other.q, rtol=0, atol=TIGHT)


@pytest.mark.parametrize("name", SCENES)
def test_the_equations_are_fewer(name):
    packed = run(SCENES[name][0]()).packed
    whole, left = graph_of(packed), moving_graph(packed)
    counts = [(graph.row >= 0).sum() - graph.dropped.size for graph in (whole, left)]
    assert counts[0] - counts[1] == 3 * len(still(packed).bodies) > 0
    assert len(whole.welds) >= len(left.welds) >= len(whole.welds) // 2
    assert (left.bodies[:, 0] == whole.bodies[:, 0]).all()


def test_a_scene_that_turns_everything_has_one_network():
    plain = ts.Scene()
    body = block(plain, (0.0, 0.0, -1.0), 0.2)
    plain.add(C.Revolute.at(body, plain.ground, point=(0.0, 0.0, 0.0), axis=Y))
    assert moving_graph(plain.packed) is graph_of(plain.packed)
    assert run(plain).stats.rotations_skipped == 0


@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_a_start_that_is_off_is_put_right(method):
    """By 1e-10 in orientation, place and speed: what is accepted is projected, by every row."""
    scene = slides()
    exact = run(slides(), method)
    q, qd = scene.start
    rng = np.random.default_rng(1)
    state = exact.state._replace(t=0.0, q=q + 1e-10 * rng.normal(size=q.size), qd=qd + 1e-10 * rng.normal(size=q.size))
    solution = run(scene, method, state=state)
    assert solution.stats.rotations_skipped > 0
    error = solution.constraint_error
    assert error.position.max() < 2 * ROUNDING
    assert error.velocity.max() < 2 * ALGEBRA
    np.testing.assert_allclose(solution.q, exact.q, rtol=0, atol=FAIR)
    for i in still(solution.packed).bodies:
        p = solution.orientation(scene.bodies[i])
        assert (np.abs((p * p).sum(axis=1) - 1.0) < EXACT).all()
        assert not solution.angular_velocity(scene.bodies[i]).any()


def test_a_start_that_turns_what_is_held_is_refused():
    scene = slides()
    scene.bodies[0].angular_velocity = (0.0, 0.0, 1e-3)
    with pytest.raises(ts.InconsistentState, match="velocity"):
        run(scene)
    scene = slides()
    body = scene.bodies[0]
    body.orientation = Rotation.from_rotvec((1e-3, 0.0, 0.0)) * Rotation.from_quat(body.orientation, scalar_first=True)
    with pytest.raises(ts.InconsistentState, match="position"):
        run(scene)


@pytest.mark.parametrize("method", ["dop853", "taylor"])
@pytest.mark.parametrize("name", ["slider-crank", "rails", "driven"])
def test_a_run_goes_on_from_a_state_and_from_a_file(name, method):
    whole = run(SCENES[name][0](), method, dense_output=True)
    scene = SCENES[name][0]()
    half = ts.simulate(scene, (0.0, 0.5), **METHODS[method]).raise_if_failed()
    rest = ts.simulate(scene, (0.5, END), state=half.state, **METHODS[method]).raise_if_failed()
    np.testing.assert_allclose(rest.q[-1], whole.q[-1], rtol=0, atol=FINE)
    again = pickle.loads(pickle.dumps(half))
    np.testing.assert_array_equal(again.multipliers, half.multipliers)
    rest = ts.simulate(again.scene, (0.5, END), state=again.state, **METHODS[method]).raise_if_failed()
    assert rest.stats.rotations_skipped > 0
    np.testing.assert_allclose(rest.q[-1], whole.q[-1], rtol=0, atol=FINE)
    np.testing.assert_allclose(whole.at(0.5).q, half.q[-1], rtol=0, atol=FINE)


@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_states_between_the_steps_and_events(method):
    scene = slider_crank()
    solution = run(
        scene, method, t_eval=None, dense_output=True, events=lambda t, state: state.q[14] - 0.65, formulation="tangent"
    )
    other = run(scene, "null-space", t_eval=None, dense_output=True)
    times = np.linspace(0.0, END, 57)
    found, expected = solution.at(times), other.at(times)
    np.testing.assert_allclose(found.q, expected.q, rtol=0, atol=FINE)
    np.testing.assert_allclose(found.qd, expected.qd, rtol=0, atol=CLOSE)
    assert (found.q[:, 17:21] == found.q[0, 17:21]).all()
    assert len(solution.t_events[0]) > 0
    np.testing.assert_allclose([q[14] for q in solution.q_events[0]], 0.65, rtol=0, atol=HELD)
    np.testing.assert_array_equal(solution.q_events[0][:, 17:21], found.q[: len(solution.t_events[0]), 17:21])


@pytest.mark.parametrize("method", METHODS)
def test_another_orientation_between_runs(method):
    """Rows that hold a body at an angle hold it at two: the scene is run at one, then at the other."""

    def build(sign):
        scene = ts.Scene(gravity=(1.0, 0.0, 0.0))
        turn = Rotation.from_rotvec((0.0, 0.0, sign * 0.5))
        body = scene.add_body(1.0, (0.1, 0.2, 0.3), orientation=turn)
        for axis in (X, Y):
            scene.add(C.Dot1(scene.ground, body, axis_a=axis, axis_b=Z))
        scene.add(C.Dot1(scene.ground, body, axis_a=X, axis_b=X, value=np.cos(0.5)))
        scene.add(C.PlaneContact(body, scene.ground, normal_b=Z))
        bob = scene.add_point_mass(1.0, position=turn.apply((0.0, 1.0, 0.0)))
        scene.add(C.Distance(body, bob, point_a=(0.3, 0.0, 0.0)))
        scene.add(F.Spring(body, scene.ground, point_a=(0.5, 0.0, 0.0), stiffness=30.0))
        return scene

    scene, other = build(1), build(-1)
    first = run(scene, method)
    for one, two in zip(scene.bodies, other.bodies, strict=True):
        one.position = two.position
    scene.bodies[0].orientation = other.bodies[0].orientation
    second = run(scene, method)
    for solution, sign in ((first, 1), (second, -1)):
        exact = run(build(sign), "null-space")
        assert solution.stats.rotations_skipped > 0
        np.testing.assert_allclose(solution.q, exact.q, rtol=0, atol=1e-8 if method == "nystrom4" else 1e-11)
    assert np.abs(first.q - second.q).max() > 0.1


def test_what_a_function_of_time_turns_is_not_still():
    scene = ts.Scene()
    body = block(scene, (0.0, 0.0, 0.0), 0.0)
    hinge = scene.add(C.Revolute.at(scene.ground, body, point=(0.0, 0.0, 0.0), axis=Z))
    scene.add(C.RotationMotor.of(hinge, angle=2.0 * ts.motions.time))
    body.angular_velocity = (0.0, 0.0, 2.0)
    for method in ("dop853", "taylor"):
        solution = run(scene, method)
        assert solution.stats.rotations_skipped == 0
        np.testing.assert_allclose(solution.angular_velocity(body)[:, 2], 2.0, rtol=0, atol=HELD)


@pytest.mark.slow
def test_a_value_that_becomes_a_function_of_time_sets_a_body_free():
    scene = floating()
    assert run(scene).stats.rotations_skipped > 0
    row = scene.constraints[1]
    value = float(row.value)
    row.value = (lambda t: value + 0.1 * t**3, lambda t: 0.3 * t**2, lambda t: 0.6 * t)
    solution = run(scene)
    assert solution.stats.rotations_skipped == 0
    other = run(scene, "null-space")
    np.testing.assert_allclose(solution.q, other.q, rtol=0, atol=FINE)
    row.value = value
    assert run(scene).stats.rotations_skipped > 0


def test_rows_that_hold_no_orientation_hold_nothing():
    """Three rows of rank two: not these hold the body but a fourth, which is on points."""
    scene = ts.Scene()
    body = block(scene, (0.0, 0.0, 0.0), 0.0)
    scene.add(C.Parallel(scene.ground, body, axis_a=Z, axis_b=Z))
    tilted = np.array([np.sin(0.3), 0.0, np.cos(0.3)])
    scene.add(C.Dot1(scene.ground, body, axis_a=Z, axis_b=tilted, value=float(Z @ tilted)))
    scene.add(C.Dot2(scene.ground, body, axis_a=Y, point_b=(1.0, 0.0, 0.0)))
    body.velocity = (0.0, -1.0, 0.0)
    body.angular_velocity = (0.0, 0.0, 1.0)
    solution, other = run(scene), run(scene, "null-space")
    assert solution.stats.rotations_skipped == 0
    np.testing.assert_allclose(solution.q, other.q, rtol=0, atol=FINE)
    assert np.abs(solution.angular_velocity(body)).max() > 0.1


class Upright(ts.Primitive):
    """The Euler parameters of a body are those of its start: three rows on no direction and on no other body."""

    rows = 3
    markers = (ts.Parameters("a"),)

    def __init__(self, a, *, name=""):
        super().__init__(a, None, (None,), name)
        self.start = tuple(float(e) for e in a.orientation[1:])

    def parameters(self):
        return self.start

    @staticmethod
    def phi(x, par, t, out):
        for i in range(3):
            out[i] = x[i + 1] - par[i]

    @staticmethod
    def jacobian(x, par, t, out):
        for i in range(3):
            out[i, i + 1] = 1.0

    @staticmethod
    def gamma(x, xd, par, t, out):
        for i in range(3):
            out[i] = 0.0


@pytest.mark.slow
def test_a_constraint_of_a_users_own_holds_a_body():
    scene = ts.Scene()
    body = block(scene, (0.0, 0.0, 0.0), 0.4)
    row = scene.add(Upright(body))
    scene.add(F.Spring(scene.ground, body, point_a=Z, point_b=(0.3, 0.1, 0.0), stiffness=60.0))
    bob = block(scene, (0.3, 0.0, -0.5), 0.2)
    scene.add(C.Spherical.at(body, bob, point=(0.1, 0.0, 0.0)))
    solution, other = run(scene), run(scene, "null-space")
    assert solution.stats.rotations_skipped == solution.stats.evaluations
    np.testing.assert_allclose(solution.q, other.q, rtol=0, atol=TIGHT)
    lam = solution.multipliers[:, solution.rows(row)]
    assert np.abs(lam).max() > 0.1
    np.testing.assert_allclose(lam, other.multipliers[:, other.rows(row)], rtol=0, atol=CLOSE)


@pytest.mark.parametrize("form", ["null-space", "maggi-kane"])
def test_forms_with_a_basis_keep_every_coordinate(form):
    solution = run(slider_crank(), "", integrator=I.RK45(1e-9, 1e-9), formulation=form)
    assert solution.stats.rotations_skipped == 0


@pytest.mark.slow
def test_implicit_methods_keep_every_coordinate():
    solution = run(slides(), "", integrator=I.SDIRK54(1e-9, 1e-9), formulation="tangent")
    assert solution.stats.rotations_skipped == 0
    np.testing.assert_allclose(solution.q[-1], run(slides()).q[-1], rtol=0, atol=ROUGH)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_the_profile_accounts_for_it(method):
    found = ts.profile(slides(), (0.0, END), t_eval=(0.0, END), advice=False, **METHODS[method])
    assert found.solution.stats.rotations_skipped > 0
    assert "rotations of bodies that never turn" in str(found)


@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_memory_is_used_again_after_an_edit(method):
    """The scene's numbers change between runs, and come back: so do the results, to the last bit."""
    scene = welded()
    first = run(scene, method)
    mass = scene.bodies[1].mass
    scene.bodies[1].mass = 2.0 * mass
    between = run(scene, method)
    scene.bodies[1].mass = mass
    again = run(scene, method)
    assert np.abs(between.q - first.q).max() > 1e-3
    np.testing.assert_array_equal(again.q, first.q)
    np.testing.assert_array_equal(again.multipliers, first.multipliers)


@pytest.mark.slow
def test_reactions_among_redundant_rows_are_as_unique_as_before():
    """Of a carriage on two rails the rails' reactions are not, that of the bob's ball joint is."""
    scene = SCENES["rails"][0]()
    solution = run(scene)
    assert solution.stats.rotations_skipped > 0
    assert [bool(solution.reaction_unique(joint).all()) for joint in scene.constraints[:3]] == [False, False, True]
    whole = run(turning(SCENES["rails"][0]()))
    for one, two in zip(scene.constraints, whole.scene.constraints, strict=True):
        for ours, theirs in zip(solution.reaction(one), whole.reaction(two), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=CLOSE * (1.0 + np.abs(theirs).max()))
