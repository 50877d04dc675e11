"""`scene.assemble()` from far away, and what cannot be met: refused by name, and nothing changes."""

import math

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.mechanisms import assert_same, mechanism, residuals, snapshot, unit
from tests.helpers.tolerances import EXACT, NEAR, ROUNDING

C = ts.constraints


@pytest.mark.parametrize("angle", [0.5, 1.5, 2.5, 3.1])
def test_from_far_away(angle):
    """A rod hinged at both ends' height, turned away by up to half a turn."""
    scene = ts.Scene()
    rod = scene.add_body(
        1.0, (0.1, 1.0, 1.0), orientation=(math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0), name="rod"
    )
    scene.add(C.Spherical(rod, scene.ground, point_a=(-1, 0, 0), name="pivot"))
    scene.add(C.Distance(rod, scene.ground, point_a=(1, 0, 0), point_b=(2, 0, 0.5), length=0.5, name="string"))
    report = scene.assemble()
    assert max(residuals(scene)) <= ROUNDING
    assert report.moved <= 3.0
    assert np.linalg.norm(rod.orientation) == pytest.approx(1.0, abs=EXACT)


def too_far():
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, (1.0, 0.0, 0.3), (1.0, 2.0, 3.0), name="bead")
    scene.add(C.Distance(bead, scene.ground, length=1.0, name="near"))
    scene.add(C.Distance(bead, scene.ground, point_b=(5, 0, 0), length=1.0, name="far"))
    return scene, ("near", "far")


def folded():
    """Nothing says which way to go."""
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, name="bead")
    scene.add(C.Distance(bead, scene.ground, length=1.0, name="string"))
    return scene, ("string",)


def steep():
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1, 1, 1), unit(np.random.default_rng(2), 3), angular_velocity=(1, 2, 3), name="rod")
    scene.add(C.Dot1(rod, scene.ground, axis_a=(0, 0, 1), axis_b=(0, 0, 1), value=0.9, name="lean"))
    scene.add(C.Dot1(rod, scene.ground, axis_a=(0, 0, 1), axis_b=(1, 0, 0), value=0.9, name="lean too"))
    return scene, ("lean",)


REFUSED = {
    "too far": (too_far, ts.InconsistentState),
    "no direction": (folded, ts.InconsistentState),
    "two cosines": (steep, ts.InconsistentState),
}


@pytest.mark.slow_for("two cosines", "too far")
@pytest.mark.parametrize(("build", "error"), REFUSED.values(), ids=REFUSED.keys())
def test_what_cannot_be_met_is_named_and_nothing_changes(build, error):
    scene, names = build()
    before = snapshot(scene)
    with pytest.raises(error) as caught:
        scene.assemble()
    assert all(name in str(caught.value) for name in names), str(caught.value)
    assert_same(before, snapshot(scene))


def test_rows_that_say_the_same_are_no_hindrance():
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, (1.0, 0.0, 0.3), (1.0, 2.0, 3.0), name="bead")
    for name in ("one", "two"):
        scene.add(C.Distance(bead, scene.ground, length=1.0, name=name))
    report = scene.assemble()
    assert max(report.residual, report.velocity_residual) <= EXACT
    outward = np.array([1.0, 0.0, 0.3]) / math.hypot(1.0, 0.3)
    np.testing.assert_allclose(bead.position, outward, atol=NEAR)
    assert bead.velocity @ bead.position == pytest.approx(0.0, abs=EXACT)
    assert bead.velocity[1] == 2.0


@pytest.mark.slow
def test_a_row_that_vanishes_where_it_is_met_is_refused():
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, name="bead")
    motion = (lambda t: 1.0 - t, lambda t: -1.0 + 0.0 * t, lambda t: 0.0 * t)
    scene.add(C.Distance(bead, scene.ground, length=motion, name="winch"))
    with pytest.raises(ts.SingularConfiguration, match=r"winch.*singular here"):
        scene.assemble(t=1.0)


@pytest.mark.slow_but("nan-f")
@pytest.mark.parametrize("part", [0, 1], ids=["f", "fd"])
@pytest.mark.parametrize("value", [math.nan, math.inf], ids=str)
def test_motion_that_is_no_number_at_t_is_named_and_nothing_changes(part, value):
    motion = [lambda t: 1.0, lambda t: 0.0, lambda t: 0.0]
    good = motion[part](0.0)
    motion[part] = lambda t: good if t < 1.0 else value
    scene = ts.Scene()
    bead = scene.add_point_mass(1.0, (1.0, 0.0, 0.5), (1.0, 2.0, 3.0), name="bead")
    scene.add(C.Distance(bead, scene.ground, length=tuple(motion), name="string"))
    before = snapshot(scene)
    with pytest.raises(ts.TsdynError, match=r"(?s)string.*finite"):
        scene.assemble(t=2.0)
    assert_same(before, snapshot(scene))


def test_nothing_to_do():
    scene = ts.Scene()
    scene.add_point_mass(1.0, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    before = snapshot(scene)
    report = scene.assemble()
    assert (report.moved, report.residual, report.velocity_changed, report.velocity_residual) == (0.0,) * 4
    assert_same(before, snapshot(scene))


def test_simulate_does_not_assemble():
    """What is inconsistent is refused, and the message leads here."""
    scene = mechanism(np.random.default_rng(0))
    before = snapshot(scene)
    with pytest.raises(ts.InconsistentState, match="assemble"):
        ts.simulate(scene, (0.0, 1.0))
    assert_same(before, snapshot(scene))
