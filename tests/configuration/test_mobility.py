"""`scene.mobility()`: degrees of freedom and redundant rows, everywhere or just here, against known mechanisms."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.sketched_mechanisms import MECHANISMS
from tests.helpers.sketches import Builder, polar
from tests.helpers.tolerances import CLOSE
from tsdyn.configuration import continuation as kinetic
from tsdyn.observables.evaluate import constraint_arrays
from tsdyn.stress import rods as mechanisms

C = ts.constraints
Z = np.array([0.0, 0.0, 1.0])

# degrees of freedom and redundant rows, by hand: planar loops of revolute joints have three rows too many
KNOWN = {
    "four_bar": (1, 3),
    "slider_crank": (1, 3),
    "six_bar": (1, 6),
    "rssr": (2, 0),
    "hooke_joint": (1, 2),
    "parallelogram": (1, 3),
    "sarrus": (1, 1),
    "scissor": (1, 2),
    "five_bar": (2, 3),
    "door": (1, 10),
    "tripod": (3, 0),
    "double_rocker": (1, 3),
}


def rank(scene):
    """Of Phi_q itself."""
    Phi_q = constraint_arrays(scene.system, *scene.start, 0.0)[1]
    return int(np.linalg.matrix_rank(Phi_q, tol=1e-9)), Phi_q


def flat_parallelogram():
    m, a, d, out = Builder(), np.zeros(3), 2.0 * polar(0.0), 1.2 * polar(0.0)
    one, two, three = m.link("left", a, a + out), m.link("coupler", a + out, d + out), m.link("right", d, d + out)
    m.pin(None, one, a), m.pin(one, two, a + out), m.pin(two, three, d + out), m.pin(three, None, d)
    return m.scene


@pytest.mark.parametrize("name", KNOWN)
def test_known_mechanisms(name, rng):
    scene = MECHANISMS[name](rng).scene
    found = scene.mobility()
    freedom, redundant = KNOWN[name]
    assert (found.degrees_of_freedom, found.generic_degrees_of_freedom) == (freedom, freedom)
    assert len(found.redundant) == redundant
    assert not found.singular
    assert found.dependent_here == ()
    n, m = scene.start[0].size, len(scene.row_names())
    assert (found.coordinates, found.rows, found.rank) == (n, m, n - freedom)
    assert m - found.rank == redundant


@pytest.mark.parametrize("name", KNOWN)
def test_rows_named_are_those_that_can_go(name, rng):
    """Without them Phi_q has the same rank and full row rank; each is a combination of those it depends on."""
    scene = MECHANISMS[name](rng).scene
    found, names = scene.mobility(), scene.row_names()
    r, Phi_q = rank(scene)
    gone = [names.index(row.name) for row in found.redundant]
    rest = np.delete(Phi_q, gone, axis=0)
    assert rest.shape[0] == np.linalg.matrix_rank(rest, tol=1e-9) == r == found.rank
    own = [i for i, name in enumerate(names) if "EulerNormalization" in name]
    assert not set(gone) & set(own)
    for row in found.redundant:
        others = [names.index(other) for other in row.depends_on] + own  # unit length of p goes without saying
        left = Phi_q[others].T @ np.linalg.lstsq(Phi_q[others].T, Phi_q[names.index(row.name)], rcond=None)[0]
        np.testing.assert_allclose(left, Phi_q[names.index(row.name)], atol=CLOSE)
        assert any(row.name.startswith(constraint.title) for constraint in [row.constraint])


def test_redundant_rows_of_a_loop_are_in_its_last_joint(rng):
    found = MECHANISMS["four_bar"](rng).scene.mobility()
    assert {row.constraint.name for row in found.redundant} == {"pin rocker-ground"}
    assert {row.name.split("' ")[1] for row in found.redundant} == {"point[2]", "axis[0]", "axis[1]"}


def test_whole_joints_are_told_as_such(rng):
    found = MECHANISMS["door"](rng).scene.mobility()
    text = str(found)
    assert "all of Revolute 'hinge 2' depend on Revolute 'hinge 1' point[0]" in text
    assert "all of Revolute 'hinge 3'" in text
    assert repr(found) == "<Mobility: 1 degree of freedom, rank 6 of 16 rows, 10 redundant rows>"
    page = found._repr_html_()
    assert "<caption>Mobility</caption>" in page
    assert "hinge 3" in page


def test_a_singular_configuration_is_told_from_redundancy():
    found = flat_parallelogram().mobility()
    assert found.singular
    assert (found.degrees_of_freedom, found.generic_degrees_of_freedom) == (2, 1)
    assert len(found.redundant) == 3
    assert len(found.dependent_here) == 1
    assert "2 here, 1 nearby: this configuration is singular" in str(found)
    assert "(just here) depends on" in str(found)
    assert "singular here" in repr(found)


def test_a_vanishing_row():
    """The cosine of an angle is driven to one, and there its row is zero."""
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1, 1, 1))
    motion = (lambda t: np.sin(t), lambda t: np.cos(t), lambda t: -np.sin(t))
    scene.add(C.Dot1(rod, scene.ground, axis_a=Z, axis_b=Z, value=motion, name="tilt"))
    found = scene.mobility(t=np.pi / 2)
    assert found.degrees_of_freedom == 6
    row = (*found.redundant, *found.dependent_here)[0]
    assert row.name == "tilt"
    assert row.depends_on == ()
    assert "nothing else" in str(found)


def test_at_other_positions_and_of_free_bodies(rng):
    scene = ts.Scene()
    scene.add_body(1.0, (1, 1, 1))
    scene.add_point_mass(1.0)
    found = scene.mobility()
    assert (found.degrees_of_freedom, found.rank, found.redundant) == (9, 1, ())
    bar = MECHANISMS["four_bar"](rng)
    q = bar.scene.start[0]
    bar.disturb(rng)
    with pytest.raises(ts.InconsistentState, match="assemble"):
        bar.scene.mobility()
    assert bar.scene.mobility(q).degrees_of_freedom == 1
    with pytest.raises(ts.InvalidArgument, match="21 finite numbers"):
        bar.scene.mobility(q[:-1])
    with pytest.raises(ts.InvalidArgument, match="t must be"):
        bar.scene.mobility(q, t=np.nan)


@pytest.mark.parametrize("name", ["four_bar", "sarrus", "door", "tripod"])
def test_sparse_matrices_say_the_same(name, monkeypatch, rng):
    scene = MECHANISMS[name](rng).scene
    dense = scene.mobility()
    monkeypatch.setattr(kinetic, "DENSE", 0)
    sparse = scene.mobility()
    assert str(sparse) == str(dense)


@pytest.mark.slow
def test_large_scenes(monkeypatch):
    found = mechanisms.build(mechanisms.tree(9)).mobility()
    assert (found.degrees_of_freedom, found.redundant) == (3 * 511, ())
    loop = mechanisms.build(mechanisms.loop(150))
    assert loop.mobility().degrees_of_freedom == 3 * 150 - 3
    monkeypatch.setattr("tsdyn.configuration.mobility.MOST_ROWS", 400)
    with pytest.raises(ts.InvalidArgument, match="closed loops of this scene have 453"):
        loop.mobility()
