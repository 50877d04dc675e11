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
