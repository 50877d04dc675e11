"""Scenes of many bodies: what they take grows as they do, and they answer to the same rules as small ones."""

import pickle
from itertools import pairwise

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers import driven
from tests.helpers.constraint_levels import check
from tests.helpers.scenes import random_body, random_primitive
from tests.helpers.tolerances import CLOSE, COARSE, FAIR, FINE, TIGHT
from tsdyn.configuration import continuation as kinetic
from tsdyn.configuration import initial_conditions as start
from tsdyn.errors import RedundantConstraints, Status
from tsdyn.observables.diagnostics import constraint_rows
from tsdyn.observables.evaluate import constraint_arrays
from tsdyn.rows import constraint_graph as hubs
from tsdyn.simulation.scene_cache import prepared
from tsdyn.stress import rods as mechanisms
from tsdyn.taylor import layout as expansion_pack

C = ts.constraints
FAMILIES = {
    "chain": mechanisms.chain,
    "tree": lambda n: mechanisms.tree(int(np.log2(n)) + 1),
    "loop": mechanisms.loop,
    "hub": mechanisms.hub,
    "net": lambda n: mechanisms.net(*2 * [round(np.sqrt(n / 2))]),
}
METHODS = {
    "default": {},
    "dop853": {"integrator": ts.integrators.DOP853(1e-8, 1e-8)},
    "nystrom4": {"integrator": ts.integrators.Nystrom4(step=1e-3)},
}


def wheel(spokes):
    """A hub with rods around it, whose ends are held together by rods without mass: loops that all meet at the hub."""
    scene = mechanisms.build(mechanisms.hub(spokes))
    rods = scene.bodies[1:]
    for a, b in pairwise(rods):
        scene.add(C.Distance(a, b, point_a=mechanisms.FAR, point_b=mechanisms.FAR))
    return scene


def spider(legs):
    """Point masses on strings from one that falls, and from a second that hangs from it."""
    scene = ts.Scene()
    middle = [scene.add_point_mass(10.0), scene.add_point_mass(10.0, position=(0.0, 0.0, -1.0))]
    scene.add(C.Spherical(middle[0], scene.ground))
    scene.add(C.Distance(*middle))
    for i in range(legs):
        angle = 2.0 * np.pi * i / legs
        place = middle[i % 2].position + np.array([np.cos(angle), np.sin(angle), 0.0])
        scene.add(C.Distance(middle[i % 2], scene.add_point_mass(1.0, position=place)))
    return scene


def numbers(value):
    """Bytes of the arrays and records in a tuple of them."""
    return sum(map(numbers, value)) if isinstance(value, tuple) else memoryview(value).nbytes


def memory(scene):
    """Bytes of all that a run of each kind keeps, but for what it records."""
    kept = prepared(scene)
    total = numbers(kept.packed.system)
    for options in METHODS.values():
        ts.simulate(scene, (0.0, 1e-3), t_eval=(0.0, 1e-3), **options).raise_if_failed()
    for (memory,) in kept._spare.values():
        total += numbers(memory.context) + numbers(memory.run)
    return total


@pytest.mark.slow
@pytest.mark.parametrize("family", [*FAMILIES, "wheel"])
def test_memory_grows_as_the_scene_does(family):
    make = wheel if family == "wheel" else lambda n: mechanisms.build(FAMILIES[family](n))
    small, large = make(60), make(240)
    ratio = len(large.bodies) / len(small.bodies)
    fill = 1.3 if family == "net" else 1.1  # n log n entries remain of a net
    assert memory(large) < fill * ratio * memory(small)


@pytest.mark.slow
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize(
    "definition",
    [mechanisms.chain(1024), mechanisms.tree(10), mechanisms.loop(1024), mechanisms.hub(1024), mechanisms.net(20, 20)],
    ids=["chain", "tree", "loop", "hub", "net"],
)
def test_constraints_hold_for_a_thousand_bodies(definition, options):
    check(ts.simulate(mechanisms.build(definition), (0.0, 0.02), **options).raise_if_failed())


HUBS = {"hub": lambda: mechanisms.build(mechanisms.hub(40)), "wheel": lambda: wheel(40), "spider": lambda: spider(100)}


@pytest.mark.slow
@pytest.mark.parametrize("options", [*METHODS.values(), {"formulation": "null-space"}], ids=[*METHODS, "null-space"])
@pytest.mark.parametrize("scene", HUBS.values(), ids=HUBS)
def test_a_hub_moves_as_in_one_piece(scene, options, monkeypatch):
    if "formulation" in options:
        options = options | METHODS["nystrom4"]
    span, found = ((0.0, 0.01) if "formulation" in options else (0.0, 0.1)), []
    for largest in (hubs.LARGEST, 10**6):
        monkeypatch.setattr(hubs, "LARGEST", largest)
        found.append(ts.simulate(scene(), span, t_eval=np.linspace(*span, 4), **options).raise_if_failed())
    cut, whole = found
    assert cut.stats.steps == whole.stats.steps
    check(cut)
    for name in ("q", "qd", "qdd", "multipliers"):
        got, expected = getattr(cut, name), getattr(whole, name)
        np.testing.assert_allclose(got, expected, rtol=0, atol=TIGHT * (1 + np.abs(expected).max()))


def test_a_hub_is_cut():
    """Uncut, 200 rods would give a dense block of 180 000 numbers, and time that grows with the cube."""
    graph = prepared(mechanisms.build(mechanisms.hub(200))).series.graph
    assert graph.pattern.shape[1] < 200 * 120
    assert graph.welds.shape[0] > 0
    small = prepared(mechanisms.build(mechanisms.hub(12))).series.graph
    assert small.welds.shape[0] == 0


@pytest.mark.parametrize("large", [start.limits.LISTED_ENTRIES, 0], ids=["by name", "without matrices"])
def test_rows_that_depend_on_each_other_at_a_hub(large, monkeypatch):
    """Fifty rods hold the hub in its place, of which six would do."""
    monkeypatch.setattr(start.limits, "LISTED_ENTRIES", large)
    scene = ts.Scene()
    hub = scene.add_body(1.0, (0.1, 0.1, 0.1))
    rng = np.random.default_rng(1)
    for _ in range(50):
        point = rng.normal(size=3)
        scene.add(C.Distance(hub, scene.ground, point_a=0.1 * rng.normal(size=3), point_b=point))
        bob = scene.add_point_mass(1.0, position=rng.normal(size=3))
        scene.add(C.Distance(hub, bob))
    with pytest.raises(RedundantConstraints, match="depend"):
        ts.simulate(scene, (0.0, 1.0), redundancy="refuse")


@pytest.mark.slow
@pytest.mark.parametrize("build", [lambda: wheel(20), driven.everything], ids=["wheel", "driven"])
def test_series_that_are_far_from_the_processor(build, monkeypatch):
    """What is brought into the cache ahead of its use changes no number."""
    runs = []
    for limit in (expansion_pack.FAR, 0):
        monkeypatch.setattr(expansion_pack, "FAR", limit)
        runs.append(ts.simulate(build(), (0.0, 0.5)).raise_if_failed())
    np.testing.assert_array_equal(runs[0].q, runs[1].q)


@pytest.mark.slow
@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_an_interrupt_is_answered_soon(options):
    """A run comes back from its kernels when it has made so many steps, fewer in a larger scene."""

    def progress(fraction):
        raise KeyboardInterrupt

    scene = mechanisms.build(mechanisms.chain(1000))
    solution = ts.simulate(scene, (0.0, 1.0), progress=progress, max_steps=1000, **options)
    assert solution.status == Status.INTERRUPTED
    assert 0 < solution.stats.steps <= 20


def test_names_of_many_bodies():
    scene = ts.Scene()
    bodies = [scene.add_point_mass(1.0) for _ in range(300)]
    assert [body.name for body in bodies] == [f"body{i}" for i in range(1, 301)]
    bodies[4].name = "other"
    assert scene.add_point_mass(1.0, name="body5").name == "body5"
    with pytest.raises(ts.errors.InvalidBody, match="other"):
        scene.add_point_mass(1.0, name="other")
    bodies[7].name = "body301"
    assert scene.add_point_mass(1.0).name == "body302"
    item = scene.add(C.Distance(bodies[0], bodies[1], length=1.0))
    with pytest.raises(ts.errors.InvalidConstraint, match="before"):
        scene.add(item)


class Sign(ts.Primitive):
    """A plug-in that looks at its parameter."""

    rows = 1
    markers = (ts.Point("a"), ts.Point("b"))

    def __init__(self, a, b, *, point_a=(0, 0, 0), point_b=(0, 0, 0), side=1.0, name=""):
        super().__init__(a, b, (point_a, point_b), name)
        self.side = float(side)

    def parameters(self):
        return (self.side,)

    @staticmethod
    def phi(x, par, t, out):
        out[0] = x[0] - x[3] if par[0] > 0.0 else x[1] - x[4]

    @staticmethod
    def jacobian(x, par, t, out):
        i = 0 if par[0] > 0.0 else 1
        out[0, i], out[0, 3 + i] = 1.0, -1.0

    @staticmethod
    def gamma(x, xd, par, t, out):
        out[0] = 0.0


def crowd(rng):
    """Bodies, point masses and the ground, with several of each kind of constraint between them, consistent or not."""
    scene = ts.Scene()
    bodies = [scene.ground, *(scene.add_body(**random_body(rng)) for _ in range(4))]
    bodies += [scene.add_point_mass(1.0, position=rng.normal(size=3)) for _ in range(3)]
    for name in ("Spherical", "Distance", "Distance, driven", "Dot1", "Dot1, driven", "Dot2", "PlaneContact"):
        for _ in range(4):
            kind, a, b, arguments = random_primitive(rng, name, *rng.permutation(5)[:2].tolist())
            scene.add(getattr(C, kind)(bodies[a], bodies[b], **arguments))
    for i in range(5, 8):
        scene.add(C.Distance(bodies[i], bodies[i - 4], length=0.7 + 0.1 * i))
        scene.add(Sign(bodies[i], bodies[i - 4], side=(-1) ** i))
    return scene


@pytest.mark.slow
def test_errors_of_many_constraints_at_once(rng):
    """What constraint_error is made of is Phi and Phi_q qd + Phi_t, whatever the constraints have in common."""
    scene = crowd(rng)
    n = sum(body.dimension for body in scene.bodies)
    t, q, qd = np.array([0.3, 0.7]), rng.normal(size=(2, n)), rng.normal(size=(2, n))
    Phi, rates, accelerations = constraint_rows(scene.packed, t, q, qd, np.zeros((2, n)))
    for i in range(2):
        arrays = scene.packed.system, q[i], qd[i], t[i]
        expected = constraint_arrays(*arrays)
        size = 1e-13 * (1 + np.abs(expected[1]).max() ** 2) * n
        np.testing.assert_allclose(Phi[i], expected[0], rtol=0, atol=size)
        np.testing.assert_allclose(rates[i], expected[1] @ qd[i] + expected[2], rtol=0, atol=size)
        np.testing.assert_allclose(accelerations[i], expected[3], rtol=0, atol=10 * size)


@pytest.mark.slow
def test_reactions_of_one_of_many(rng):
    """A constraint's force is -Phi_r^T lam of its rows alone, driven ones and the last of their kind included."""
    scene = ts.Scene()
    bodies = [scene.ground]
    motion = (lambda t: 1.0 + 0.1 * np.sin(t), lambda t: 0.1 * np.cos(t), lambda t: -0.1 * np.sin(t))
    for i in range(6):
        bodies.append(scene.add_body(**random_body(rng, position=(i + 1.0, 0.0, 0.0)) | {"velocity": (0.0, 0.0, 0.0)}))
        length = motion if i % 2 else None
        scene.add(C.Distance(bodies[-1], bodies[-2], length=length))
        scene.add(C.Dot1(bodies[-1], bodies[-2], axis_a=(0, 0, 1), axis_b=rng.normal(size=3), value=0.1))
    scene.assemble()
    solution = ts.simulate(scene, (0.0, 0.2), t_eval=(0.0, 0.2)).raise_if_failed()
    row = 0
    for constraint in scene.constraints:
        rows, row = slice(row, row + constraint.rows), row + constraint.rows
        at = int(scene.system.bodies[constraint.a.index, 0])
        for i in range(2):
            Phi_q = scene.evaluate(solution.q[i], solution.qd[i], solution.t[i]).Phi_q
            expected = -Phi_q[rows, at : at + 3].T @ solution.multipliers[i, rows]
            np.testing.assert_allclose(solution.reaction(constraint)[0][i], expected, atol=FINE)
    with pytest.raises(ts.errors.InvalidConstraint):
        solution.reaction(C.Distance(*bodies[:2], length=1.0))


def moved(scene, rng):
    """The scene with its bodies a little out of place."""
    for body in scene.bodies:
        p = body.orientation + 0.02 * rng.normal(size=4)
        body.position, body.orientation = body.position + 0.02 * rng.normal(size=3), p / np.linalg.norm(p)
    return scene


def test_assembly_with_sparse_matrices(rng, monkeypatch):
    scene = moved(mechanisms.build(mechanisms.loop(12)), rng)
    before, fixed, found = scene.start, scene.bodies[3:4], []
    for large in (kinetic.DENSE, 0):
        scene.place(*before)
        monkeypatch.setattr(kinetic, "DENSE", large)
        report = scene.assemble(fixed=fixed)
        found.append((*scene.start, report.moved, report.residual, report.velocity_residual))
    for dense, sparse in zip(*found, strict=True):
        np.testing.assert_allclose(sparse, dense, rtol=0, atol=FINE)
    scene.add(C.Distance(scene.bodies[0], scene.bodies[1], point_a=mechanisms.FAR, point_b=mechanisms.NEAR, length=0.1))
    with pytest.raises(ts.errors.InconsistentState):
        scene.assemble()


@pytest.mark.slow
def test_assembly_of_a_thousand_bodies(rng):
    scene = moved(mechanisms.build(mechanisms.chain(1000)), rng)
    report = scene.assemble()
    assert report.residual < CLOSE
    ts.simulate(scene, (0.0, 1e-3)).raise_if_failed()


def test_a_large_scene_goes_on_from_a_state_and_from_a_file():
    scene = mechanisms.build(mechanisms.hub(300))
    half = ts.simulate(scene, (0.0, 0.1), t_eval=(0.0, 0.1))
    whole = ts.simulate(scene, (0.0, 0.2), t_eval=(0.0, 0.1, 0.2))
    copy, state = pickle.loads(pickle.dumps((scene, half.state)))
    rest = ts.simulate(copy, (0.1, 0.2), state=state, t_eval=(0.1, 0.2))
    np.testing.assert_allclose(rest.q[-1], whole.q[-1], rtol=0, atol=FAIR)
    check(pickle.loads(pickle.dumps(rest)))
    assert np.ptp(whole.energy) < COARSE * np.abs(whole.kinetic_energy).max()
    force, _ = whole.reaction(scene.constraints[0])
    weight = sum(body.mass for body in scene.bodies) * 9.81
    z = whole.q.reshape(3, -1, 7)[:, :, 2], whole.qdd.reshape(3, -1, 7)[:, :, 2]
    masses = np.array([body.mass for body in scene.bodies])
    np.testing.assert_allclose(force[:, 2], weight + z[1] @ masses, rtol=CLOSE)
