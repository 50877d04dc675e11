"""Constraints that can't be met: the smallest set that conflicts is named, and nothing else."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.sketches import Builder, polar
from tests.helpers.tolerances import HELD, ROUNDING

C = ts.constraints
X, Y, Z = np.eye(3)


def refused(scene, **arguments):
    """The error of an assembly that must fail, and the names in it; the bodies stay."""
    before = scene.start
    with pytest.raises(ts.InconsistentState) as caught:
        scene.assemble(**arguments)
    for one, other in zip(before, scene.start, strict=True):
        np.testing.assert_array_equal(one, other)
    error = caught.value
    named = [constraint for constraint in error.constraints if constraint.title in str(error)]
    assert len(named) == min(len(error.constraints), 8)
    return str(error), {constraint.name for constraint in error.constraints}


def bystanders(scene):
    """A pendulum and a bead on a table, far from it all, that are off, too."""
    rod = scene.add_body(1.0, (0.1, 0.1, 0.02), (5.0, 0.1, -0.4), name="pendulum")
    scene.add(C.Revolute(rod, scene.ground, point_a=(0, 0, 0.5), point_b=(5, 0, 0), axis_a=Y, axis_b=Y, name="hook"))
    bead = scene.add_point_mass(1.0, (6.0, 0.0, 0.3), name="bead")
    scene.add(C.PlaneContact(bead, scene.ground, normal_b=Z, name="table"))
    scene.add(C.Distance(bead, rod, length=1.3, name="string"))


def chain_of(count):
    """Links of half a metre in a straight row from the ground, on balls; the builder and the links."""
    m, points = Builder(), [0.5 * i * polar(0.0) for i in range(count + 1)]
    links = [m.link(f"link {i}", points[i], points[i + 1]) for i in range(count)]
    for i in range(count):
        m.ball(links[i - 1] if i else None, links[i], points[i], f"ball {i}")
    return m, links


def triangle():
    """Three rods of 1, 1 and 3 m between three beads."""
    scene = ts.Scene()
    a, b, c = (scene.add_point_mass(1.0, x) for x in ((0, 0, 0), (1.5, 0, 0), (0.7, 1.0, 0.1)))
    for one, other, length in ((a, b, 3.0), (b, c, 1.0), (c, a, 1.0)):
        scene.add(C.Distance(one, other, length=length, name=f"rod of {length:g} m {one.name}-{other.name}"))
    rope = scene.add(C.Distance(a, scene.ground, point_b=(0, 0, 2), length=2.0, name="rope"))
    assert rope.name == "rope"
    return scene, {f"rod of {n} m {pair}" for n, pair in ((3, "body1-body2"), (1, "body2-body3"), (1, "body3-body1"))}


def open_four_bar():
    """The ground is longer than crank, coupler and rocker together."""
    m = Builder()
    a, b, c, d = (np.array(x, float) for x in ((0, 0, 0), (0, 1, 0), (1, 1.2, 0), (2, 0, 0)))
    one, two, three = m.link("crank", a, b), m.link("coupler", b, c), m.link("rocker", c, d)
    scene = m.scene
    m.pin(None, one, a, name="A"), m.pin(one, two, b, name="B"), m.pin(two, three, c, name="C")
    scene.add(C.Revolute(three, scene.ground, point_a=(0.6, 0, 0), point_b=(5, 0, 0), axis_a=Z, axis_b=Z, name="D"))
    return scene, {"A", "B", "C", "D"}


def contradicting_welds():
    scene = ts.Scene()
    one, two = (scene.add_body(1.0, (1, 1, 1), x) for x in ((0, 0, 0), (1.0, 0, 0)))
    for name, x in (("weld", 1.0), ("other weld", 1.2)):
        scene.add(C.Fixed(one, two, point_a=(x, 0, 0), name=name))
    scene.add(C.Spherical(one, scene.ground, point_b=(0.1, 0, 0), name="pivot"))
    return scene, {"weld", "other weld"}


def rod_against_ball():
    """The ball holds the ends at 0.5 m, the rod wants 0.8 m."""
    scene = ts.Scene()
    leg = scene.add_body(1.0, (0.1, 0.1, 0.1), (0.2, 0.1, 0.0), name="leg")
    scene.add(C.Spherical(leg, scene.ground, name="ball"))
    scene.add(C.Distance(leg, scene.ground, point_b=(0.5, 0, 0), length=0.8, name="stay"))
    scene.add(C.Dot1(leg, scene.ground, axis_a=Z, axis_b=X, value=0.2, name="lean"))
    return scene, {"ball", "stay"}


def door_off_its_hinges():
    """Three hinges, of which the last is 1 mm off the line of the others: any two that agree would do."""
    scene = ts.Scene()
    leaf = scene.add_body(20.0, (7.0, 8.2, 1.3), (0.45, 0.0, 1.0), name="leaf")
    for i, (x, z) in enumerate(((0.0, 0.2), (0.0, 1.0), (0.001, 1.8))):
        points = {"point_a": (-0.45, 0, z - 1.0), "point_b": (x, 0, z)}
        scene.add(C.Revolute(leaf, scene.ground, **points, axis_a=Z, axis_b=Z, name=f"hinge {i + 1}"))
    return scene, [{"hinge 1", "hinge 3"}, {"hinge 2", "hinge 3"}]


CONFLICTS = (triangle, open_four_bar, contradicting_welds, rod_against_ball, door_off_its_hinges)


@pytest.mark.slow_but("rod_against_ball-alone", "contradicting_welds-alone")
@pytest.mark.parametrize("company", [False, True], ids=["alone", "in company"])
@pytest.mark.parametrize("build", CONFLICTS)
def test_the_smallest_set_is_named(build, company):
    scene, expected = build()
    if company:
        bystanders(scene)
    message, names = refused(scene)
    assert names == expected or names in expected
    assert "conflict" in message
    assert "|Phi| = " in message
    assert not any(name in message for name in ("hook", "table", "string", "rope", "pivot", "lean"))


@pytest.mark.slow_but("contradicting_welds")
@pytest.mark.parametrize("build", CONFLICTS)
def test_without_any_of_them_the_rest_can_be_met(build):
    _, names = refused(build()[0])
    for name in names:
        scene, _ = build()
        scene._added = [constraint for constraint in scene._added if constraint.name in names - {name}]
        scene.touch()
        assert scene.assemble(folds="free").residual < HELD


@pytest.mark.slow
def test_bodies_held_fixed_are_part_of_it():
    scene = ts.Scene()
    one, two = (scene.add_body(1.0, (0.1, 0.1, 0.1), x, name=f"part at {x[0]}") for x in ((0, 0, 0), (3.0, 0, 0)))
    link = scene.add_body(1.0, (0.1, 0.1, 0.1), (1.5, 0.3, 0), name="link")
    scene.add(C.Spherical(one, link, point_b=(-1, 0, 0), name="left"))
    scene.add(C.Spherical(link, two, point_a=(1, 0, 0), name="right"))
    message, names = refused(scene, fixed=(one, two))
    assert names == {"left", "right"}
    assert "with part at 0, part at 3.0 held fixed" in message
    assert scene.assemble(fixed=(one,)).residual < ROUNDING
    np.testing.assert_array_equal(one.position, np.zeros(3))


def test_one_that_nothing_can_meet():
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1, 1, 1), (0.3, 0.2, 0.0))
    scene.add(C.Spherical(rod, scene.ground, point_a=(0, 0, 1), name="pivot"))
    scene.add(C.Dot2(scene.ground, rod, axis_a=Z, point_b=(0, 0, 1), value=0.7, name="lift"))
    _, names = refused(scene)
    assert names == {"pivot", "lift"}
    message, names = refused(scene, fixed=(rod,))
    assert "infeasible on its own" in message
    assert len(names) == 1


@pytest.mark.slow
def test_many_suspects():
    """A chain of ten links that is too short for its ends: all of it conflicts, and the rod across it doesn't."""
    m, links = chain_of(10)
    scene = m.scene
    scene.add(C.Spherical(links[-1], scene.ground, point_a=(0.25, 0, 0), point_b=(6, 0, 0), name="far ball"))
    scene.add(C.Dot1(links[4], scene.ground, axis_a=Z, axis_b=Y, value=0.1, name="roll"))
    message, names = refused(scene)
    assert names == {f"ball {i}" for i in range(10)} | {"far ball"}
    assert "and 3 more" in message


@pytest.mark.slow
def test_a_rod_whose_ends_a_ball_holds_together():
    """At the least that is left over the rod has no length, nor a derivative; it isn't the rod alone."""
    m, links = chain_of(5)
    ends = {"point_a": (0.25, 0, 0), "point_b": (-0.25, 0, 0)}
    m.scene.add(C.Distance(links[2], links[3], **ends, length=0.3, name="rod"))
    links[3].position = np.add(links[3].position, (0.0, 0.02, 0.01))
    _, names = refused(m.scene)
    assert names == {"ball 3", "rod"}


@pytest.mark.slow
def test_rates_that_contradict_are_named():
    """Two rods of one length that say the same now; one of them is about to shorten."""
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, (1.1, 0.2, 0.0))
    scene.add(C.Distance(bead, scene.ground, length=1.0, name="still"))
    motion = (lambda t: 1.0 - 0.5 * t, lambda t: -0.5 + 0.0 * t, lambda t: 0.0 * t)
    scene.add(C.Distance(bead, scene.ground, length=motion, name="winch"))
    with pytest.raises(ts.InconsistentState, match=r"no velocities.*(winch|still).*equal rates"):
        scene.assemble()
    with pytest.raises(ts.InconsistentState, match="conflict"):
        scene.assemble(t=0.5)
