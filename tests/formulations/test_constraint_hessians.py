"""Second derivatives of constraints, turns of bodies and directions, against complex steps and dense algebra."""

import numpy as np
import pytest

import tsdyn as ts
from examples.bead_on_surface import OnEllipsoid
from examples.driven_pivot import DrivenPivot
from tests.helpers import built_in
from tests.helpers.reduced_ode import difference, evaluate_curvature
from tests.helpers.scenes import rotation, unit
from tests.helpers.tolerances import EPS
from tsdyn.elements.loads import JointLoad
from tsdyn.elements.loops.forces import turn_block, turn_of_bodies, turn_of_directions
from tsdyn.elements.markers import PARAMETERS, POINT
from tsdyn.errors import TsdynError
from tsdyn.jit.kernels import entry, twin
from tsdyn.model.equations import with_curvatures, with_force_jacobians
from tsdyn.observables.evaluate import constraint_arrays
from tsdyn.testing.plug_in_checks import evaluate_force_jacobian

# Constraints that are no polynomials of the positions, and the step of their differences
TRANSCENDENTAL = (
    "Thread", "Gear", "AngleTerm", "AngleRate", "Span", "SmoothContact", "RollingContact", "CylinderContact",
    "CylinderRolling", "SphereRolling",
)  # fmt: skip
SMOOTH = 2e-3
CLOSE = 5e-4  # of spheres, whose centres may be near each other here
POLYNOMIAL = 0.05  # of differences of polynomials of degree six and less, which they are exact for
C, F = ts.constraints, ts.forces
WAVE = (lambda t: 0.5 + 0.3 * np.sin(2.0 * t), lambda t: 0.6 * np.cos(2.0 * t), lambda t: -1.2 * np.sin(2.0 * t))
KINDS = {kind.__name__: kind.example for kind in built_in.PRIMITIVES}
KINDS |= {kind.__name__: kind.example for kind in (OnEllipsoid, DrivenPivot)}
KINDS |= {
    f"{name}, driven": lambda rng, a, b, name=name, word=word: getattr(C, name)(
        a, b, **random_places(name, rng, a, b), **{word: WAVE}
    )
    for name, word in (("Distance", "length"), ("Dot1", "value"), ("Dot2", "value"))
}
PLACES = {"Distance": ("point_a", "point_b"), "Dot1": ("axis_a", "axis_b"), "Dot2": ("axis_a", "point_a", "point_b")}


def random_places(name, rng, a, b):
    return {place: rng.normal(size=3) for place in PLACES[name]}


def bodies_of(scene, rng):
    for _ in range(2):
        scene.add_body(1.0, (1.0, 1.1, 1.2), rng.normal(size=3), unit(rng, 4))
    for _ in range(2):
        scene.add_point_mass(1.0, rng.normal(size=3))
    return scene.bodies


PAIRS = {
    "bodies": lambda s, b: (b[0], b[1]),
    "body and ground": lambda s, b: (b[0], s.ground),
    "ground and body": lambda s, b: (s.ground, b[1]),
    "body and mass": lambda s, b: (b[1], b[2]),
    "mass and body": lambda s, b: (b[3], b[0]),
    "masses": lambda s, b: (b[2], b[3]),
    "mass and ground": lambda s, b: (b[2], s.ground),
}


def instances(name, rng):
    """Scenes with one instance each, for every pair of bodies that the kind takes."""
    for pair in PAIRS.values():
        scene = ts.Scene()
        a, b = pair(scene, bodies_of(scene, rng))
        try:
            constraint = KINDS[name](rng, a, b)
        except TsdynError:
            if name in ("Spherical", "Distance"):
                at = {"point_a": rng.normal(size=3) * (a.dimension != 3), "point_b": rng.normal(size=3)}
                at["point_b"] *= b.dimension != 3
                constraint = getattr(C, name)(a, b, **at)
            elif pair is PAIRS["bodies"]:
                raise
            else:
                continue
        scene.add(constraint)
        yield scene


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_second_derivatives_of_constraints(name, rng):
    """At states that satisfy nothing, |p| other than one; every row against differences of Phi_q, Phi_t and gamma."""
    count = 0
    for scene in instances(name, rng):
        packed = scene.packed
        system, (q, _) = with_curvatures(packed), scene.start
        system = system._replace(reals=system.reals.copy())
        q = q + 0.3 * rng.normal(size=q.size)
        qd, qdd = rng.normal(size=(2, q.size))
        m, t = system.segments.shape[0], rng.uniform(0.1, 2.0)
        lam = rng.normal(size=m)

        def rows(x, level, system=system, qd=qd, qdd=qdd, t=t, lam=lam):
            _, Phi_q, Phi_t, gamma = constraint_arrays(system, x, qd, t)
            return (Phi_q.T @ lam, Phi_q @ qd + Phi_t, Phi_q @ qdd + gamma)[level]

        K, G1, G2 = rng.normal(size=(q.size, q.size)), np.zeros((m, q.size)), np.zeros((m, q.size))
        before = K.copy()
        evaluate_curvature(system, q, qd, qdd, t, lam, K, G1, G2)
        for level, got in enumerate((K - before, G1, G2)):
            smooth = CLOSE if name == "SphereRolling" else SMOOTH
            step, room = (smooth, 1e-8) if name in TRANSCENDENTAL else (POLYNOMIAL, 100 * EPS / POLYNOMIAL)
            expected = difference(lambda x, level=level, rows=rows: rows(x, level), q, step)
            size = 1.0 + np.abs(rows(q, level)).max() + np.abs(expected).max()
            np.testing.assert_allclose(got, expected, rtol=0, atol=room * size)
            assert np.abs(expected).max() > 0.1  # the normalisations' at least
        count += 1
    assert count >= {"Spherical": 7, "Distance": 7, "PlaneContact": 3}.get(name, 1)


def random_turn(rng):
    p = unit(rng, 4)
    return p, rotation(p)


def test_turn_of_bodies(rng):
    turn = np.zeros(4)
    for _ in range(20):
        (p, A), (before, B) = random_turn(rng), random_turn(rng)
        twin(turn_of_bodies)(before, p, turn)
        np.testing.assert_allclose(rotation(turn), A @ B.T, rtol=0, atol=10 * EPS)


def test_turn_of_directions(rng):
    """It turns one direction into the other by the angle between them."""
    turn, none, seen = np.zeros(4), (1.0, 0.0, 0.0, 0.0), 0
    for _ in range(40):
        a, b = rng.uniform(0.1, 10.0) * unit(rng), rng.uniform(0.1, 10.0) * unit(rng)
        twin(turn_of_directions)(a, b, turn)
        cosine = a @ b / np.linalg.norm(a) / np.linalg.norm(b)
        if cosine < -0.5:
            assert tuple(turn) == none
            continue
        seen += 1
        R = rotation(turn)
        np.testing.assert_allclose(R @ a / np.linalg.norm(a), b / np.linalg.norm(b), rtol=0, atol=20 * EPS)
        assert (np.trace(R) - 1.0) / 2.0 == pytest.approx(cosine, abs=20 * EPS)
    assert 10 < seen < 40
    for a, b in (((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), ((0.0, 1.0, 0.0),) * 2):
        turn[:] = np.nan
        twin(turn_of_directions)(np.array(a), np.array(b), turn)
        assert tuple(turn) == none


@entry
def turned(code_row, code_column, r, kept, size, row, column, out):
    """An entry for `turn_block`, which needs the stack."""
    turn_block(code_row, code_column, r, kept, size, row, column, out)


def left_product(r):
    """L with L p = r p, of quaternions."""
    e0, e = r[0], r[1:]
    cross = np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
    return np.block([[np.array([[e0]]), -e[None]], [e[:, None], e0 * np.eye(3) + cross]])


@pytest.mark.parametrize("code_row", [POINT, PARAMETERS])
@pytest.mark.parametrize("code_column", [POINT, PARAMETERS])
def test_turn_block(code_row, code_column, rng):
    """The block of one pair of markers among 11 rows, and nothing else."""
    matrices = {POINT: rotation, PARAMETERS: left_product}
    r, kept, out = unit(rng, 4), rng.normal(size=(11, 11)), np.full((11, 11), np.nan)
    turned(code_row, code_column, r, kept.ravel(), 11, 3, 7, out)
    left, right = matrices[code_row](r), matrices[code_column](r)
    n, m = len(left), len(right)
    expected = left @ kept[3 : 3 + n, 7 : 7 + m] @ right.T
    np.testing.assert_allclose(out[3 : 3 + n, 7 : 7 + m], expected, rtol=0, atol=50 * EPS)
    assert np.isfinite(out).sum() == n * m


NOT_INTERNAL = F.PointForce, F.Torque, F.UserForce, F.Control, F.Cable  # loads in space; laws of the whole scene
INTERNAL = [kind for kind in built_in.FORCES if kind not in NOT_INTERNAL]
INTERNAL = [k for k in INTERNAL if k.__module__.startswith("tsdyn.") and not issubclass(k, JointLoad)]


@pytest.mark.slow
@pytest.mark.parametrize("swapped", [False, True], ids=["a to b", "b to a"])
@pytest.mark.parametrize("kind", INTERNAL, ids=lambda kind: kind.__name__)
def test_kept_derivatives_are_exact_in_a_scene_turned_as_a_whole(kind, swapped, rng):
    """Laws see relative motion, so a turn, a shift and a drift of everything leave nothing to take anew."""
    scene = ts.Scene()
    for _ in range(2):
        scene.add_body(1.0, (1.0, 1.1, 1.2), rng.normal(size=3), unit(rng, 4))
    force = scene.add(kind.example(rng, *scene.bodies[:: -1 if swapped else 1]))
    system, size = with_force_jacobians(scene.packed)
    system = system._replace(reals=system.reals.copy())
    system.reals[system.normals] = 1.0
    q, qd = scene.start[0], rng.normal(size=14)

    def jacobians(q, qd, anew, kept):
        out = np.zeros((2, 14, 14))
        evaluate_force_jacobian(system, q, qd, 0.4, np.zeros(14), *out, anew, kept)
        return out

    p, kept = unit(rng, 4), np.zeros(size)
    if kind is F.Spring:  # its frame follows the line of its two points; a turn about that is lost on it
        line = _span(scene, force, q)
        axis = np.cross(line, rng.normal(size=3))
        p = np.append(np.cos(0.5), np.sin(0.5) * axis / np.linalg.norm(axis))
    R, L = rotation(p), left_product(p)
    move = np.kron(np.eye(2), np.block([[R, np.zeros((3, 4))], [np.zeros((4, 3)), L]]))
    shift, drift = (np.tile(np.append(x, np.zeros(4)), 2) for x in rng.normal(size=(2, 3)))
    first = jacobians(q, qd, 1, kept)
    then = move @ q + shift, move @ qd + drift
    got, anew = jacobians(*then, 0, kept), jacobians(*then, 1, np.zeros(size))
    rounding = 1000 * EPS * np.abs(first).max()
    np.testing.assert_allclose(got, anew, rtol=0, atol=rounding)
    np.testing.assert_allclose(anew, move @ first @ move.T, rtol=0, atol=rounding)
    assert np.abs(anew - first).max() > 0.1 * np.abs(first).max()  # so a frame was needed


def _span(scene, force, q):
    """From the first marker's point to the second's."""
    where = {id(body): 7 * i for i, body in enumerate(scene.bodies)}
    ends = [
        q[where[id(x)] :][:3] + rotation(q[where[id(x)] + 3 :][:4]) @ s
        for x, s in zip((force.a, force.b), force.coordinates[:2], strict=True)
    ]
    return ends[1] - ends[0]
