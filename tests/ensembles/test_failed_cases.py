"""Ensembles of which cases fail: the first reason is shown."""

import tsdyn as ts


def rods():
    scene = ts.Scene()
    bob = scene.add_point_mass(1.0, position=(1, 0, 0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, length=1.0, name="rod"))
    return scene


def test_the_first_reason_is_shown():
    for lengths, first in (([2.0, 3.0], 0), ([1.0, 3.0], 1)):
        found = ts.ensemble(rods(), {"rod.length": lengths}, (0.0, 0.1))
        for text in (repr(found), found._repr_html_()):
            assert f"case {first}: the initial position breaks 1 constraint row" in text
            assert "rod: Phi = " in text
    assert "case" not in repr(ts.ensemble(rods(), {"bob.mass": [1.0, 2.0]}, (0.0, 0.1))).partition("cases")[2]
