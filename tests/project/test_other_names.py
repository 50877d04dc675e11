"""Names of other programs, and misspelt ones: refused with what they are called here."""

import copy
import pickle
import re

import pytest

import tsdyn as ts
from tsdyn.calls import ARGUMENTS, ATTRIBUTES, CLASSES

MODULES = ("constraints", "forces", "integrators")


@pytest.mark.parametrize(
    ("where", "name", "here"),
    [
        ("constraints", "Hinge", "ts.constraints.Revolute"),
        ("constraints", "HingeJoint", "ts.constraints.Revolute"),
        ("constraints", "Prismatic", "ts.constraints.Translational"),
        ("constraints", "Weld", "ts.constraints.Fixed"),
        ("constraints", "Ball", "ts.constraints.Spherical"),
        ("constraints", "Revolut", "did you mean ts.constraints.Revolute?"),
        ("forces", "Damper", "ts.forces.Spring, with damping="),
        ("integrators", "RK4", "ts.integrators.Nystrom4"),
        ("integrators", "Xyz", "dir(ts.integrators)"),
    ],
)
def test_classes_of_other_programs(where, name, here):
    with pytest.raises(ts.UnknownAttribute, match=re.escape(here)):
        getattr(getattr(ts, where), name)
    assert not hasattr(getattr(ts, where), name)


def test_names_of_the_package():
    with pytest.raises(ts.UnknownAttribute, match=re.escape("ts.constraints.Revolute")):
        _ = ts.Hinge
    with pytest.raises(ts.UnknownAttribute, match=re.escape("here it is ts.constraints.Revolute.")):
        _ = ts.Revolute


@pytest.fixture(scope="module")
def made():
    """A scene, and what is made of it, by name."""
    scene = ts.Scene()
    scene.add_point_mass(1.0, name="bob")
    solution = ts.simulate(scene, (0, 1))
    ensemble = ts.ensemble(scene, {"bob.mass": [1.0]}, (0, 1))
    return {"scene": scene, "solution": solution, "ensemble": ensemble, "state": solution.state}


@pytest.mark.parametrize(
    ("owner", "name", "here"),
    [
        ("scene", "add_rigid_body", "here it is scene.add_body(...)."),
        ("scene", "run", "here it is ts.simulate(scene, t_span)."),
        ("scene", "gravty", "did you mean gravity?"),
        ("solution", "y", "here it is solution.q or solution.qd."),
        ("solution", "time", "here it is solution.t."),
        ("solution", "x", "here it is solution.q or solution.position(body)."),
        ("solution", "sol", "here it is solution.at(t)."),
        ("solution", "multiplier", "did you mean multipliers?"),
        ("solution", "qddd", "did you mean qdd"),
        ("ensemble", "position", "here it is ensemble.case(i).position(body)."),
        ("ensemble", "statuses", "did you mean status?"),
        ("state", "time", "'State' object has no attribute 'time'; here it is state.t."),
    ],
)
def test_attributes_of_other_programs(owner, name, here, made):
    with pytest.raises(ts.UnknownAttribute, match=re.escape(here)):
        getattr(made[owner], name)
    assert not hasattr(made[owner], name)
    assert not hasattr(made[owner], "__array_interface__")
    copy.copy(made[owner])
    if owner != "ensemble":
        pickle.loads(pickle.dumps(made[owner]))


def test_errors_of_properties_are_their_own():
    class Broken(ts.Solution):
        @property
        def largest(self):
            return self.energy.larges

    scene = ts.Scene()
    scene.add_point_mass(1.0)
    broken = ts.simulate(scene, (0, 1))
    broken.__class__ = Broken
    with pytest.raises(AttributeError, match="larges"):
        _ = broken.largest


def test_arguments_of_other_programs():
    scene = ts.Scene()
    body = scene.add_body(1.0, (1.0, 1.0, 1.0))
    for call, words in (
        (lambda: ts.simulate(scene, (0, 1), method="rk45"), "here it is integrator="),
        (lambda: ts.forces.Spring(body, scene.ground, k=1.0), "here it is stiffness="),
        (lambda: ts.constraints.Revolute(body, scene.ground, point=(0, 0, 0)), "Revolute.at(a, b, point=...)"),
        (lambda: ts.constraints.Revolute(body, scene.ground, axis=(0, 0, 1)), "Revolute.at(a, b, axis=...)"),
    ):
        with pytest.raises(ts.InvalidCall, match=re.escape(words)):
            call()


def test_every_hint_leads_somewhere(made):
    for here in CLASSES.values():
        for path in re.findall(r"(?:^|ts\.)((?:constraints|forces|integrators)\.\w+|Scene|simulate)", here):
            found = ts
            for word in path.split("."):
                found = getattr(found, word)
    known = {word for owner in made.values() for word in dir(owner)}
    for here in ATTRIBUTES.values():
        assert all(re.match(r"\w+", word)[0] in known for word in here)
    known = " ".join(str(cls.__init__.__doc__) + str(cls.__doc__) for cls in ts.forces.registered())
    assert all(word in known or word in str(ts.simulate.__doc__) + str(ts.Scene.add_body.__doc__) for word in
               set(ARGUMENTS.values()))  # fmt: skip
