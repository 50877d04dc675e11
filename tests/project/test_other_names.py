"""Names of other programs, and misspelt ones: refused with what they are called here."""

import re

import pytest

import tsdyn as ts
from tsdyn.other_names import ARGUMENTS, CLASSES, METHODS

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
    with pytest.raises(AttributeError, match=re.escape("scene.add_body")):
        _ = ts.Scene().add_rigid_body


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


def test_every_hint_leads_somewhere():
    for here in CLASSES.values():
        for path in re.findall(r"(?:^|ts\.)((?:constraints|forces|integrators)\.\w+|Scene|simulate)", here):
            found = ts
            for word in path.split("."):
                found = getattr(found, word)
    for here in METHODS.values():
        for name in re.findall(r"^scene\.(\w+)", here):
            assert hasattr(ts.Scene(), name)
    known = " ".join(str(cls.__init__.__doc__) + str(cls.__doc__) for cls in ts.forces.registered())
    assert all(word in known or word in str(ts.simulate.__doc__) + str(ts.Scene.add_body.__doc__) for word in
               set(ARGUMENTS.values()))  # fmt: skip
