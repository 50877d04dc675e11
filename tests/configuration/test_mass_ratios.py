"""Rank is geometry: masses change neither mobility nor redundant rows; runs of unequal masses are right or refused."""

from functools import partial

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import tsdyn as ts
from tests.helpers.tolerances import CLOSE, FINE, HELD, ROUNDING

C, I = ts.constraints, ts.integrators
G = 9.81
RATIOS = [1e-15, 1e-12, 1e-9, 1e-7, 1e-5]


def welded(mass, tip=1000.0):
    """A light rod from (0, 0, 0), hinged about y, with a heavy bob welded to its end at (2, 0, 0)."""
    scene = ts.Scene()
    rod = scene.add_body(mass, (mass * 1e-4, mass / 3, mass / 3), position=(1, 0, 0), name="rod")
    bob = scene.add_body(tip, (tip / 10,) * 3, position=(2, 0, 0), name="bob")
    scene.add(C.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 1, 0), name="top"))
    scene.add(C.Fixed.at(rod, bob, point=(2, 0, 0), name="weld"))
    return scene


def as_one(mass, tip=1000.0):
    """Mass, first moment and moment of inertia of the two about the hinge."""
    return mass + tip, mass + 2.0 * tip, mass / 3 + mass + tip / 10 + 4.0 * tip


@pytest.mark.parametrize("mass", [*(1000.0 * ratio for ratio in RATIOS), 1e6, 1e12, 1e18])
def test_a_weld_leaves_one_degree_of_freedom(mass):
    found = welded(mass).mobility()
    assert (found.degrees_of_freedom, found.rank, len(found.redundant), found.singular) == (1, 13, 0, False)


@pytest.mark.parametrize("method", ["taylor", "dop853"])
@pytest.mark.parametrize("mass", [1e-9, 1e-8, 1e-7, 1e-6, 1e-3, 1e6, 1e12, 1e18])
def test_a_weld_swings_as_one_body(mass, method):
    _, first, J = as_one(mass)
    run = ts.simulate(welded(mass), (0.0, 0.5), integrator=method, rtol=1e-11, atol=1e-11)
    pendulum = solve_ivp(
        lambda t, y: (y[1], G * first / J * np.cos(y[0])), (0.0, 0.5), (0.0, 0.0), "DOP853", rtol=1e-13, atol=1e-14
    )
    assert run.angle("top")[-1] == pytest.approx(pendulum.y[0, -1], abs=FINE)
    assert run.stats.steps < 50
    assert max(run.constraint_error.acceleration) < HELD * G


@pytest.mark.parametrize("mass", [1e-11, 1e-12, 1e-15])
@pytest.mark.parametrize("formulation", ["tangent", "null-space"])
def test_ratios_beyond_double_precision_are_called_so(mass, formulation):
    with pytest.raises(ts.SingularConfiguration, match=r"mass ratio .* rod .* bob") as error:
        ts.simulate(welded(mass), (0.0, 1.0), formulation=formulation)
    assert "rank" not in str(error.value)


def chain(last):
    """Three links of 1 kg, and a heavy one at the end."""
    scene, before = ts.Scene(), None
    for i, mass in enumerate([1.0, 1.0, 1.0, last]):
        link = scene.add_body(mass, (mass / 12,) * 3, position=(i + 0.5, 0, 0))
        scene.add(C.Revolute.at(before or scene.ground, link, point=(i, 0, 0), axis=(0, 1, 0)))
        before = link
    return scene


@pytest.mark.parametrize("last", [1e8, 1e11, 1e12, 1e15])
def test_a_heavy_end_of_a_chain_is_no_loss_of_rank(last):
    assert chain(last).mobility().degrees_of_freedom == 4


@pytest.mark.parametrize("last", [1e8, 1e11, 1e12])
def test_a_chain_with_a_heavy_end_holds(last):
    run = ts.simulate(chain(last), (0.0, 1e-4 / np.sqrt(last)))
    assert run.success
    assert max(run.constraint_error.acceleration) < HELD * G


def test_a_chain_with_too_heavy_an_end_is_said_to_have_one():
    with pytest.raises(ts.SingularConfiguration, match="mass ratio"):
        ts.simulate(chain(1e15), (0.0, 1e-12))


@pytest.mark.parametrize("ratio", [1e-4, *RATIOS, 1e-3])
def test_a_light_body_on_a_heavy_one_changes_nothing(ratio):
    def angles(m):
        scene = ts.Scene()
        crane = scene.add_body(1e3, (1e3,) * 3, position=(1, 0, 0), name="crane")
        sensor = scene.add_body(m, (m / 100,) * 3, position=(2.1, 0, 0), name="sensor")
        scene.add(C.Revolute.at(scene.ground, crane, point=(0, 0, 0), axis=(0, 1, 0), name="a"))
        scene.add(C.Revolute.at(crane, sensor, point=(2, 0, 0), axis=(0, 1, 0), name="b"))
        run = ts.simulate(scene, (0.0, 1.0))
        return np.array([run.angle("a")[-1], run.angle("b")[-1]])

    np.testing.assert_allclose(angles(1e3 * ratio), angles(1e-20), atol=10.0 * ratio + CLOSE)


@pytest.mark.parametrize("mass", [1e-6, 1e-3, 1.0])
def test_equilibrium_and_modes_of_a_light_rod_with_a_heavy_bob(mass):
    _, first, J = as_one(mass)
    found = welded(mass).equilibrium()
    assert found.smallest_stiffness == pytest.approx(G * first / J, rel=HELD)
    np.testing.assert_allclose(found.reaction("top")[0], (0, 0, G * (mass + 1000.0)), rtol=0.0, atol=1e4 * HELD)
    modes = welded(mass).linearise(found.state).modes()
    assert 2 * np.pi * modes.frequency[0] == pytest.approx(np.sqrt(G * first / J), rel=HELD)


@pytest.mark.parametrize("mass", [1e-15, 1e-9, 1e-3, 1.0])
def test_assembly_beside_a_heavy_bob(mass):
    scene = ts.Scene()
    rod = scene.add_body(mass, (mass * 1e-4, mass / 3, mass / 3), position=(1, 0, 1e-3), name="rod")
    bob = scene.add_body(1e3, (100,) * 3, position=(2, 1e-3, 0), velocity=(0, 0, 1.0), name="bob")
    scene.add(C.Revolute(scene.ground, rod, point_b=(-1, 0, 0), axis_a=(0, 1, 0), axis_b=(0, 1, 0)))
    scene.add(C.Fixed(rod, bob, point_a=(1, 0, 0)))
    assert scene.assemble().residual < HELD
    expected = -2.0 * 1e3 / as_one(mass)[2]  # the angular momentum about the hinge is kept
    np.testing.assert_allclose(rod.angular_velocity, (0.0, expected, 0.0), atol=1e-6)
    np.testing.assert_allclose(bob.angular_velocity, rod.angular_velocity, atol=HELD)


@pytest.mark.parametrize("j", [0.0, 1e-14, 1e-10, 1e-8, 1e-6, 1e-2])
def test_velocities_of_assembly_share_out_spin_by_true_inertias(j):
    scene = ts.Scene(gravity=(0, 0, 0))
    a = scene.add_body(1.0, (1e-2, 1e-2, j), angular_velocity=(0, 0, 1.0), name="a")
    b = scene.add_body(1.0, (1e-2, 1e-2, 1e-7), position=(0, 0, 1), name="b")
    for body, z in ((a, 0), (b, 1)):
        scene.add(C.Revolute.at(scene.ground, body, point=(0, 0, z), axis=(0, 0, 1)))
    scene.add(C.Dot1(a, b, axis_a=(1, 0, 0), axis_b=(0, 1, 0)))
    scene.assemble()
    for body in (a, b):
        assert body.angular_velocity[2] == pytest.approx(j / (j + 1e-7), abs=ROUNDING)


def test_a_run_that_masses_end_is_said_to_end_of_them():
    masses = [1.591948041596244e-05, 48.477112141354716, 821466.8695683902, 511.711948631808, 1.1600604209217517e-06]
    run = ts.simulate(random_scene(330792, masses, 10.0), (0.0, 1e-3), max_steps=50)
    assert not run.success
    assert "mass ratio" in run.message
    assert "rank" not in run.message


# laws of random scenes


def random_scene(seed, masses, length=1.0):
    """A closed loop or a chain of random links: as many as masses; redundant rows where joints are all about y."""
    rng = np.random.default_rng(seed)
    count, planar, closed = len(masses), bool(rng.integers(2)), bool(rng.integers(2))
    points = np.cumsum(rng.normal(size=(count + 1, 3)) * (1.0, not planar, 1.0), axis=0) * length
    axes = [np.array((0.0, 1.0, 0.0)) if planar else rng.normal(size=3) for _ in range(count + 1)]
    shapes = rng.uniform(1.0, 2.0, (count, 3)) * length**2
    scene, before = ts.Scene(gravity=(0, 0, -G * length)), None
    for i, mass in enumerate(masses):
        middle = (points[i] + points[i + 1]) / 2
        link = scene.add_body(mass, mass * shapes[i], position=middle, name=f"link{i}")
        scene.add(C.Revolute.at(before or scene.ground, link, point=points[i], axis=axes[i], name=f"joint{i}"))
        before = link
    if closed:
        scene.add(C.Revolute.at(before, scene.ground, point=points[-1], axis=axes[-1], name="last"))
    return scene


def facts(scene):
    found = scene.mobility()
    names = tuple(row.name for row in found.redundant), tuple(row.name for row in found.dependent_here)
    return found.degrees_of_freedom, found.generic_degrees_of_freedom, found.rank, names


exponents = st.lists(st.floats(-15.0, 15.0), min_size=2, max_size=5)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), powers=exponents)
def test_masses_change_no_mobility(seed, powers):
    assert facts(random_scene(seed, 10.0 ** np.array(powers))) == facts(random_scene(seed, np.ones(len(powers))))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(2, 5), power=st.integers(-6, 6))
def test_lengths_change_no_mobility(seed, count, power):
    masses = np.ones(count)
    assert facts(random_scene(seed, masses, 10.0**power)) == facts(random_scene(seed, masses))


def leaning_disc(length, off):
    """A disc of a radius of half the length rolls on a plane; it is off the centroid by a share of the length."""
    scene = ts.Scene(gravity=(0, 0, -G * length))
    body = scene.add_body(1.3, np.array((0.08, 0.15, 0.08)) * length**2, position=(0, 0, 0.46 * length), name="disc")
    body.orientation, body.angular_velocity = (np.cos(0.2), np.sin(0.2), 0, 0), (0.4, 7.5, 0.7)
    places = {"center_a": (0, 0, off * length), "axis_a": (0, 1, 0), "normal_b": (0, 0, 1)}
    scene.add(C.RollingDisc(body, scene.ground, radius=0.5 * length, **places))
    scene.assemble()
    return scene, 3


def sleeve_on_a_rod(length, off):
    """A rod slides and doesn't turn, a sleeve slides along it: their points are off the centroids by the same share."""
    scene, point = ts.Scene(gravity=(0, 0, -G * length)), np.array((off, 0, off)) * length
    rod = scene.add_body(1.0, (length**2,) * 3, name="rod")
    sleeve = scene.add_body(1.0, (length**2,) * 3, position=(0, 0.7 * length, 0), name="sleeve")
    scene.add(C.Translational.at(rod, scene.ground, point=point, axis=(1, 0, 0)))
    scene.add(C.PointOnLine(sleeve, rod, point_a=point, point_b=point, axis_b=(0, 1, 0)))
    return scene, 5


def driven_thread(length, off, coupled=False):
    """A nut turned by a motor rises by its lead, as a Screw or by a Coupler."""
    scene, lead = ts.Scene(gravity=(0, 0, -G * length)), 0.2 * length
    nut = scene.add_body(1.0, (length**2,) * 3, name="nut", velocity=(0, 0, lead), angular_velocity=(0, 0, 1))
    places = {"point": np.array((off, 0, off)) * length, "axis": (0, 0, 1)}
    if coupled:
        joint = scene.add(C.Cylindrical.at(scene.ground, nut, **places))
        scene.add(C.Coupler((joint, "displacement"), (joint, "angle"), ratio=lead))
    else:
        joint = scene.add(C.Screw.at(scene.ground, nut, **places, lead=lead))
    scene.add(C.RotationMotor.of(joint, angle=ts.motions.time))
    scene.assemble()
    return scene, 0


def tied_bar(length, off):
    """A bar on a vertical axle between two ropes' ends, which pull in opposite directions: a couple alone."""
    scene = ts.Scene(gravity=(0, 0, -G * length))
    bar = scene.add_body(1.0, (length**2,) * 3, name="bar")
    scene.add(C.Revolute.at(scene.ground, bar, point=np.array((off, 0, 0)) * length, axis=(0, 0, 1)))
    ends = [(scene.ground, (-length, -0.5 * length, 0)), (bar, (-0.5 * length, 0, 0))]
    ends += [(bar, (0.5 * length, 0, 0)), (scene.ground, (length, 0.5 * length, 0))]
    scene.add(C.Rope(ends, always_taut=True))
    return scene, 0


BUILDS = (leaning_disc, sleeve_on_a_rod, driven_thread, partial(driven_thread, coupled=True), tied_bar)


@pytest.mark.slow_but("*-1.0")
@pytest.mark.parametrize("length", [1e-8, 1.0, 1e8])
@pytest.mark.parametrize("off", [0.0, 1e-17, 1e-9, 1e-3])
@pytest.mark.parametrize("build", BUILDS)
def test_arms_of_rounding_change_neither_mobility_nor_tolerances(build, off, length):
    """Rows have arms that no point shows: a radius, a way along a guide, a lead."""
    scene, freedom = build(length, off)
    found = scene.mobility()
    assert (found.degrees_of_freedom, found.redundant, found.singular) == (freedom, (), False)
    near = ts.simulate(build(1.0, 0.0)[0], (0.0, 0.1), rtol=1e-11, atol=1e-11)
    for method in (I.Taylor(), I.DOP853(1e-9, 1e-9 * length)):
        solution = ts.simulate(scene, (0.0, 0.1), integrator=method).raise_if_failed()
        np.testing.assert_allclose(solution.state.q[:3] / length, near.state.q[:3], atol=2.0 * off + 1e-8)
        assert not np.isnan(solution.multipliers).any()
        assert "tolerances" not in solution.message


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), powers=exponents)
@example(seed=0, powers=[0.0, -7.0, 12.0])  # S is regular with the axis rows alone
def test_unequal_masses_run_or_are_called_so(seed, powers):
    def redundant(masses):
        try:
            run = ts.simulate(random_scene(seed, masses), (0.0, 1e-12))
        except ts.SingularConfiguration as error:
            return str(error)
        return int(np.isnan(run.multipliers[-1]).sum())

    plain, found = redundant(np.ones(len(powers))), redundant(10.0 ** np.array(powers))
    assert found == plain or "mass ratio" in str(found)
