"""scene.evaluate against NumPy formulas of the tests' own: quaternion products, complex steps, Cauchy integrals."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers import closed_loops
from tests.helpers.scenes import (
    BETWEEN,
    PRIMITIVES,
    build,
    constraints,
    product,
    random_chain,
    random_pair,
    slices,
    start,
    taylor,
    unit,
)
from tests.helpers.tolerances import CLOSE, EPS

COMPLEX = 1e-40  # a complex step: nothing cancels
DOZENS = 200 * EPS  # times the size of what is compared: a few dozen operations
CAUCHY = 2000 * EPS  # second derivatives by Cauchy's integral


def close(got, expected, tolerance=DOZENS, size=0.0):
    scale = 1.0 + max(np.abs(expected).max(initial=0.0), np.abs(size).max(initial=0.0))
    np.testing.assert_allclose(got, expected, atol=tolerance * scale, rtol=0)


def definitions():
    """Pairs with every primitive both ways, chains, free bodies, point masses."""
    rng = np.random.default_rng(7)
    result = {f"{name}, {between}": random_pair(rng, name, between) for name in PRIMITIVES for between in BETWEEN}
    result |= {f"chain of {n}": random_chain(rng, n) for n in (1, 4)}
    mass = {"mass": 0.7, "position": rng.normal(size=3), "velocity": rng.normal(size=3)}
    free = random_chain(rng, 1)["bodies"] + [mass]
    result["free"] = {"gravity": (1.0, 2.0, 3.0), "bodies": free, "constraints": []}
    rod = ("Distance", 2, 1, {"point_b": unit(rng), "length": 1.3})
    plane = ("PlaneContact", 2, 0, {"point_b": unit(rng), "normal_b": unit(rng)})
    result["point mass on a rod and a plane"] = {**result["free"], "constraints": [rod, plane]}
    return result


CASES = definitions()
cases = pytest.mark.parametrize("definition", CASES.values(), ids=CASES.keys())


def states(definition, rng, count=3):
    """The start, and states that satisfy nothing, the Euler parameters not even of unit length."""
    yield *start(definition), 0.0
    n = start(definition)[0].size
    for _ in range(count):
        yield rng.normal(size=n), 3.0 * rng.normal(size=n), rng.uniform(0.0, 2.0)


def kinetic_energy(definition, q, qd):
    """From m |rd|^2 / 2 and omega = 2 p* pd."""
    total = 0.0
    for part, body in zip(slices(definition), definition["bodies"], strict=True):
        x, xd = q[part], qd[part]
        total = total + body["mass"] * (xd[:3] @ xd[:3]) / 2
        if "inertia" in body:
            omega = 2 * product(x[3:] * [1, -1, -1, -1], xd[3:])[1:]
            total = total + omega @ np.asarray(body["inertia"]) @ omega / 2
    return total


def mass_matrix(definition, q):
    """The Hessian of the kinetic energy in qd, which is a quadratic form: T(a + b) - T(a) - T(b)."""
    e = np.eye(q.size)
    T = [kinetic_energy(definition, q, row) for row in e]
    return np.array(
        [[kinetic_energy(definition, q, e[i] + e[j]) - T[i] - T[j] for j in range(q.size)] for i in range(q.size)]
    )


def velocity_forces(definition, q, qd):
    """S = dT/dq - (d/dt M) qd, by complex steps."""

    def along_q(i):
        return kinetic_energy(definition, q + 1j * COMPLEX * np.eye(q.size)[i], qd).imag / COMPLEX

    M_d = mass_matrix(definition, q + 1j * COMPLEX * qd).imag / COMPLEX
    return np.array([along_q(i) for i in range(q.size)]) - M_d @ qd


@cases
def test_start_is_that_of_the_bodies(definition):
    scene = build(definition)
    q, qd = start(definition)
    for a, b in zip(scene.evaluate(), scene.evaluate(q, qd, 0.0), strict=True):
        close(a, b, 1e5 * EPS)  # qdd may be ill-conditioned; q and qd agree to rounding


@pytest.mark.slow_but(
    "chain of 1", "free", "Dot2, body to body", "Spherical, body to ground", "Distance, driven, body to body"
)
@cases
def test_mass_matrix_and_forces(definition, rng):
    scene = build(definition)
    for q, qd, t in states(definition, rng):
        got = scene.evaluate(q, qd, t)
        M = mass_matrix(definition, q)
        close(got.M, M)
        close(qd @ got.M @ qd / 2, kinetic_energy(definition, q, qd))
        close(got.S, velocity_forces(definition, q, qd), size=np.abs(M) @ qd**2)
        weight = np.zeros(q.size)
        for part, body in zip(slices(definition), definition["bodies"], strict=True):
            weight[part][:3] = body["mass"] * np.array(definition["gravity"])
        close(got.Q_A, weight)


@cases
def test_constraints_and_their_derivatives(definition, rng):
    scene = build(definition)
    for q, qd, t in states(definition, rng):
        got = scene.evaluate(q, qd, t)
        n = q.size
        Phi_q = np.stack(
            [constraints(definition, q + 1j * COMPLEX * row, t).imag / COMPLEX for row in np.eye(n)], axis=1
        )
        close(got.Phi, constraints(definition, q, t), size=q**2)
        close(got.Phi_q, Phi_q, size=q**2)
        close(got.Phi_t, constraints(definition, q + 0j, t + 1j * COMPLEX).imag / COMPLEX)
        radius = 1 / (1 + np.abs(qd).max())
        second = taylor(lambda s, q=q, qd=qd, t=t: constraints(definition, q + s * qd, t + s), radius)[2]
        close(got.gamma, second, CAUCHY, size=(np.abs(Phi_q).max(initial=0.0) + 1) * (1 + qd @ qd))


@cases
def test_accelerations_and_multipliers_solve_the_equations(definition):
    scene = build(definition)
    for case in range(3):
        if case:
            rng = np.random.default_rng(case)
            scene.assemble()
            for body in scene.bodies:
                body.velocity = rng.normal(size=3)
        got = scene.evaluate()
        close(got.M @ got.qdd + got.Phi_q.T @ got.multipliers, got.Q_A + got.S, size=got.Phi_q.T @ got.multipliers)
        close(got.Phi_q @ got.qdd + got.gamma, 0.0 * got.gamma, size=[got.gamma, np.abs(got.Phi_q) @ np.abs(got.qdd)])


@pytest.mark.slow_but("*body to body", "*-free", "*-chain*")
@cases
@pytest.mark.parametrize("formulation", ["tangent", "null-space", "maggi-kane"])
def test_first_row_of_a_solution(definition, formulation):
    scene = build(definition)
    scene.assemble()
    got = scene.evaluate()
    solution = ts.simulate(
        scene, (0.0, 1e-3), integrator=ts.integrators.Nystrom4(1e-3), formulation=formulation, constraint_tol=EPS
    )
    condition = np.linalg.cond(got.Phi_q) ** 2 if got.Phi_q.size else 1.0
    tolerance = DOZENS * condition * (1 + np.abs(got.qdd).max())
    np.testing.assert_allclose(solution.qdd[0], got.qdd, atol=tolerance, rtol=0)
    forces = np.abs(got.M).max() * (1 + np.abs(got.qdd).max())
    np.testing.assert_allclose(solution.multipliers[0], got.multipliers, atol=DOZENS * condition * forces, rtol=0)


def test_every_row_of_a_solution(rng):
    definition = random_chain(rng, 3)
    scene = build(definition)
    solution = ts.simulate(scene, (0.0, 1.0), t_eval=np.linspace(0.0, 1.0, 29), constraint_tol=EPS)
    for i, t in enumerate(solution.t):
        got = scene.evaluate(solution.q[i], solution.qd[i], t)
        close(solution.qdd[i], got.qdd, 10 * CAUCHY)
        close(solution.multipliers[i], got.multipliers, 10 * CAUCHY)
        close(solution.kinetic_energy[i], kinetic_energy(definition, solution.q[i], solution.qd[i]))


def test_driven_rows_at_a_later_time(rng):
    """qdd and the multipliers along a driven motion."""
    definition = random_pair(rng, "Distance, driven", "body to ground")
    scene = build(definition)
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 1.0), t_eval=np.linspace(0.0, 1.0, 29), constraint_tol=EPS)
    for i, t in enumerate(solution.t):
        got = scene.evaluate(solution.q[i], solution.qd[i], t)
        close(got.Phi_q @ solution.qd[i] + got.Phi_t, 0.0 * got.Phi, 500 * EPS, size=solution.qd[i])
        close(solution.qdd[i], got.qdd, 10 * CAUCHY)
        close(solution.multipliers[i], got.multipliers, 10 * CAUCHY)


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ({"q": np.zeros(3)}, "q must be"),
        ({"qd": np.zeros(8)}, "qd must be"),
        ({"q": np.full(7, np.nan)}, "q must be"),
        ({"q": "upright"}, "q must be"),
        ({"t": np.inf}, "t must be"),
    ],
)
def test_impossible_states_are_refused(arguments, what):
    scene = ts.Scene()
    scene.add_body(1.0, (1.0, 1.0, 1.0))
    with pytest.raises(ts.InvalidArgument, match=what):
        scene.evaluate(**arguments)


def test_evaluation_leaves_its_arguments_and_the_scene_alone(rng):
    definition = random_chain(rng, 2)
    scene = build(definition)
    q, qd = start(definition)
    copies = q.copy(), qd.copy()
    first = scene.evaluate(q, qd, 0.3)
    np.testing.assert_array_equal((q, qd), copies)
    for array in first:
        array[...] = 7.0  # the caller's own
    second = scene.evaluate(q, qd, 0.3)
    assert not (second.M == 7.0).any()
    np.testing.assert_array_equal(scene.bodies[0].position, definition["bodies"][0]["position"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "redundant"),
    [
        (closed_loops.ring(150), 3),
        (closed_loops.parallelogram(0.6, loops=80), 3 * 80),
        (closed_loops.parallelogram(0.6, loops=300), 3 * 300),
        (closed_loops.ring(30), 3),
    ],
    ids=["ring", "row of loops", "long row of loops", "dense"],
)
def test_redundant_rows_of_scenes_of_any_size(scene, redundant):
    found = scene.evaluate()
    lam = np.where(np.isnan(found.multipliers), 0.0, found.multipliers)
    assert np.isnan(found.multipliers).sum() == redundant
    size = np.abs(found.Q_A).max()
    np.testing.assert_allclose(found.M @ found.qdd + found.Phi_q.T @ lam, found.Q_A + found.S, atol=CLOSE * size)
    np.testing.assert_allclose(found.Phi_q @ found.qdd, -found.gamma, atol=CLOSE * (1.0 + np.abs(found.qdd).max()))
    if redundant < 900:
        start = ts.simulate(scene, (0.0, 1e-3))
        np.testing.assert_allclose(found.qdd, start.qdd[0], atol=CLOSE * (1.0 + np.abs(found.qdd).max()))
    tumbling = np.random.default_rng(1).normal(size=found.qdd.size)
    with pytest.raises(ts.SingularConfiguration, match="not unique"):
        scene.evaluate(qd=tumbling)  # what redundant rows ask for contradicts the others


def test_loads_that_overflow_are_refused():
    scene = ts.Scene()
    mass = scene.add_point_mass(mass=1.0)
    for _ in range(2):
        scene.add(ts.forces.PointForce(mass, force=(1e308, 0.0, 0.0)))
    with pytest.raises(ts.InconsistentState, match="Q_A is not finite"):
        scene.evaluate()
