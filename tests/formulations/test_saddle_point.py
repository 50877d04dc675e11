"""The saddle-point matrix of implicit methods without a basis: its derivatives, its solves, the motions it gives."""

import numpy as np
import pytest

import tsdyn as ts
from benchmarks.scenes import SCENES as MECHANISMS
from benchmarks.stiff import hung, jointed
from benchmarks.stiff_chain import chain
from tests.helpers import closed_loops, locked_scenes, rough_joints
from tests.helpers.every_force import everything
from tests.helpers.reduced_ode import difference
from tests.helpers.reference import demand_on_the_manifold
from tests.helpers.scenes import build, random_chain
from tests.helpers.stages import Stages
from tests.helpers.tolerances import CLOSE
from tsdyn.stress import gallery, rods

SDIRK54, ImplicitTrapezoid = ts.integrators.SDIRK54, ts.integrators.ImplicitTrapezoid
QUOTIENT = 1e-10  # of the size: what rounding and differences of sixth order leave
by_name = {"ids": lambda x: getattr(x, "__name__", str(x))}
SCENES = {
    "joint": lambda rng: jointed(1e-5),
    "points": lambda rng: hung(1e-4),
    "chain": lambda rng: build(random_chain(rng, 3)),
    "every force": lambda rng: everything(rng)[0],
    "loop": lambda rng: rods.build(rods.loop(4)),
}


@pytest.mark.slow_but("joint", "points")
@pytest.mark.parametrize("name", SCENES)
def test_stiffness_and_damping_of_bodies(name, rng):
    """Those of forces, and of constraints with any multipliers, against differences of the loads on the bodies."""
    stages, t = Stages(SCENES[name](rng)), 0.2
    x, y = (stages.moving * part * rng.normal(size=stages.k) for part in (0.05, 1.0))
    stages.f(x, stages.y + y, t)
    lam = rng.normal(size=len(stages.context.system.segments))
    graph, still = stages.context.graph, np.zeros(6 * len(stages.context.graph.bodies))
    lam[graph.normals[graph.normals >= 0]] = 0.0
    K, C = stages.blocks(t, lam)
    expected = (
        difference(lambda dx: stages.loads(t, lam, dx, still), still, 1e-3),
        difference(lambda dv: stages.loads(t, lam, still, dv), still, 1e-3),
    )
    turning = np.concatenate([[True] * 3 + [length == 7] * 3 for length in graph.bodies[:, 1]])
    for found, right in zip((K, C), expected, strict=True):
        right = right * turning * turning[:, None]
        np.testing.assert_allclose(found, right, rtol=0, atol=QUOTIENT * (1.0 + np.abs(right).max()))


def demand_corrections(stages, y, g, rng, share):
    """A softened error in the middle of the chart, against dense solves; tangent parts."""
    P0, t, x = stages.projection, 0.0, np.zeros(stages.k)
    f_x = difference(lambda x: stages.f(x, y, t), x, 1e-3)
    f_y = difference(lambda y: stages.f(x, y, t), y, 1e-3)
    ex, ey, one = *(stages.moving * rng.normal(size=(2, stages.k))) @ P0.T, np.eye(stages.k)
    whole = np.block([[one, -g * one], [-g * f_x, one - g * f_y]])
    right = np.linalg.solve(whole, np.concatenate((ex, ey))).reshape(2, -1) @ P0.T
    stages.f(x, y, t)
    assert stages.check() == 0
    found = stages.softened(ex, g, ey).reshape(2, -1) @ P0.T
    np.testing.assert_allclose(found, right, rtol=0, atol=(share * g + CLOSE) * np.abs(right).max())


@pytest.mark.slow_but("joint-*")
@pytest.mark.parametrize("g", [1e-3, 1e-2])
@pytest.mark.parametrize("name", ["joint", "chain"])
def test_newton_corrections(name, g, rng):
    """Exact at rest; in motion, but for changes of normal parts, a share g omega."""
    scene = SCENES[name](rng)
    for body in scene.bodies:
        body.velocity = body.angular_velocity = (0.0, 0.0, 0.0)
    stages = Stages(scene)
    demand_corrections(stages, np.zeros(stages.k), g, rng, 0.0)
    y = stages.projection @ (stages.moving * rng.normal(size=stages.k))
    demand_corrections(stages, y, g, rng, 0.5 * np.abs(y).max())


def lean():
    """Rods without inertia about their axes, held by hinges; every second hinge has a spring."""
    scene = ts.Scene()
    before = scene.ground
    for i in range(4):
        rod = scene.add_body(1.0, (0.0, 1.0 / 12.0, 1.0 / 12.0), (i + 0.5, 0.0, 0.0))
        axis = (0.0, 1.0, 0.0) if i % 2 else (0.0, 0.0, 1.0)
        scene.add(ts.constraints.Revolute.at(before, rod, point=(i, 0, 0), axis=axis))
        before = rod
    scene.add(ts.forces.Spring(rod, scene.ground, point_b=(4.0, 0.0, 1.0), stiffness=1e4, damping=10.0))
    return scene


def free():
    scene = ts.Scene()
    scene.add_body(1.0, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0), angular_velocity=(0.1, 3.0, 0.2))
    return scene


def net(count=3):
    """Masses on springs, without a constraint."""
    scene = ts.Scene()
    masses = {(i, j): scene.add_point_mass(1.0, (i, j, 0.01 * i * j)) for i in range(count) for j in range(count)}
    for (i, j), mass in masses.items():
        for other in (masses.get((i + 1, j)), masses.get((i, j + 1))):
            if other is not None:
                scene.add(ts.forces.Spring(mass, other, stiffness=1e4, damping=10.0, free_length=1.0))
    scene.add(ts.forces.Spring(masses[0, 0], scene.ground, point_b=(0.0, 0.0, 1.0), stiffness=1e4, damping=10.0))
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "end"),
    [
        (free, 1.0),
        (net, 0.1),
        (jointed, 0.3),
        (closed_loops.four_bar, 0.5),  # with redundant rows
        (lambda: locked_scenes.slider_crank(), 0.3),  # bodies that never turn
        (lambda: locked_scenes.hub(8), 0.1),
        (lambda: rods.build(rods.loop(6)), 0.2),
        (lambda: rods.build(rods.net(2, 2)), 0.1),
        (gallery.governor, 0.3),
        (lean, 0.3),
        (lambda: rough_joints.chain(3)[0], 0.3),
        (lambda: rough_joints.four_bar()[0], 0.3),
    ],
    ids=[
        "free",
        "net",
        "jointed",
        "four-bar",
        "slider",
        "hub",
        "loop",
        "rods",
        "governor",
        "lean",
        "rough",
        "rough-four",
    ],
)
def test_the_motion_is_that_of_the_null_space_form(make, end):
    """Within the tolerance, on all three levels of the constraints, in no more steps."""
    one, two = (
        ts.simulate(make(), (0.0, end), integrator=SDIRK54(1e-7, 1e-7), formulation=form).raise_if_failed()
        for form in ("tangent", "null-space")
    )
    np.testing.assert_allclose(one.q[-1], two.q[-1], rtol=0, atol=1e-7)
    demand_on_the_manifold(one, one)
    assert one.stats.steps <= 3 + 1.1 * two.stats.steps
    assert one.stats.stage_iterations <= 1.3 * two.stats.stage_iterations  # with matrices that are kept longer


@pytest.mark.slow_but("SDIRK54")
@pytest.mark.parametrize("method", [SDIRK54, ImplicitTrapezoid], **by_name)
def test_iterations_and_memory_of_a_stiff_chain(method):
    """In a transient hardly more than one correction a stage, two at the last, few matrices, memory as of the bodies.

    Factors of S are made at the ends of steps, those of N there, too, and with iteration matrices.
    """
    sizes = []
    for links in (8, 16):
        scene = chain(links)
        stats = ts.simulate(scene, (0.0, 0.1), integrator=method(1e-4, 1e-4)).raise_if_failed().stats
        tried = stats.steps + stats.rejected
        assert stats.stage_iterations <= (1.2 * (len(method.tableau.c) - 2) + 2) * tried
        assert stats.iteration_matrices < 0.7 * tried
        assert stats.factorizations - stats.iteration_matrices < 3 * tried
        assert stats.jacobians == 1
        sizes.append(max(memory.nbytes for spare in scene._prepared._spare.values() for memory in spare))
    assert sizes[1] < 2.1 * sizes[0]


def test_a_matrix_serves_a_long_chain_that_turns():
    """Reactions are balanced at the present rows, by factors that contract however long the chain is."""
    scene, end = MECHANISMS["chain of 64"].build(), MECHANISMS["chain of 64"].end
    stats = ts.simulate(scene, (0.0, end), integrator=SDIRK54(1e-2, 1e-2)).raise_if_failed().stats
    assert stats.iteration_matrices < stats.steps


def test_long_fixed_steps_need_no_matrix_that_contracts_well():
    """Where bodies turn by much within a step, terms that the matrix leaves out decide the contraction."""
    scene = MECHANISMS["two-body pendulum"].build()
    ts.simulate(scene, (0.0, 3.0), integrator=ImplicitTrapezoid(step=0.03)).raise_if_failed()


def test_a_chart_that_turns_keeps_its_matrix():
    """A free body has no stiffness: one matrix serves every chart until the step changes."""
    stats = ts.simulate(free(), (0.0, 5.0), integrator=SDIRK54(1e-6, 1e-6)).raise_if_failed().stats
    assert stats.charts > 3 * stats.iteration_matrices


@pytest.mark.slow
def test_the_default_method_turns_to_implicit_stages_in_large_scenes():
    solution = ts.simulate(chain(110), (0.0, 0.05), rtol=1e-3, atol=1e-3, t_eval=(0.0, 0.05)).raise_if_failed()
    assert solution.method.startswith("Radau")
    assert solution.formulation == "tangent"


@pytest.mark.slow_but("SDIRK54")
@pytest.mark.parametrize("method", [SDIRK54, ImplicitTrapezoid], **by_name)
def test_matrices_of_a_smooth_stretch(method):
    """One matrix serves several steps where their length hardly changes."""
    scene = chain(8)
    start = ts.simulate(scene, (0.0, 0.4), integrator=method(1e-4, 1e-4)).raise_if_failed().state
    stats = ts.simulate(scene, (0.4, 1.0), state=start, integrator=method(1e-4, 1e-4)).raise_if_failed().stats
    assert stats.iteration_matrices < 0.5 * stats.steps
