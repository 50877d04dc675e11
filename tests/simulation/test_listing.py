"""The list of parameters as a mapping."""

import pytest

import tsdyn as ts


def test_a_list_of_parameters_is_a_mapping():
    scene = ts.Scene()
    scene.add_point_mass(1.0, position=(1, 0, 0), name="bob")
    listed = scene.parameters()
    with pytest.raises(ts.UnknownParameter, match=r"^the scene has no parameter 'bob.mas'; did you mean bob.mass\?$"):
        listed["bob.mas"]
    with pytest.raises(KeyError):
        listed["bob.m"]
    assert "bob.m" not in listed
    assert "bob.mass" in listed
    assert (listed.get("bob.m"), listed.get("bob.m", 2), listed.get("bob.mass")) == (None, 2, 1.0)
    assert dict(listed).keys() == set(listed)


def test_bounds_of_stops_and_bounds_of_sticking_have_units():
    scene = ts.Scene()
    arm = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=1.0), position=(0.5, 0, 0), name="arm")
    hinge = scene.add(ts.constraints.Revolute.at(scene.ground, arm, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    scene.add(ts.constraints.Stop(hinge, lower=-1.0, upper=1.0, name="stop"))
    friction = {"torque": 1.0, "static_torque": 2.0, "force": 1.0, "static_force": 2.0}
    scene.add(ts.forces.CoulombFriction(arm, scene.ground, **friction, name="rub"))
    units = scene.parameters().units
    assert (units["stop.lower"], units["stop.upper"], units["stop.restitution"]) == ("rad or m", "rad or m", "1")
    assert (units["rub.static_force"], units["rub.static_torque"]) == ("N", "N m")
