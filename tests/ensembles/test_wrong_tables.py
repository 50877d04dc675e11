"""Tables with mistakes: what is wrong with all cases is told at once, what is wrong with one beside the others."""

import numpy as np
import pytest

import tsdyn as ts

SPAN = (0.0, 0.02)


def ball():
    """A ball on a rod and a spring, which is pushed."""
    scene = ts.Scene(gravity=(0, 0, -10))
    bob = scene.add_body(1.0, (0.1, 0.2, 0.25), position=(1, 0, 0), name="bob")
    scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    scene.add(ts.forces.Spring(bob, scene.ground, point_a=(0, 0.1, 0), stiffness=30.0, name="spring"))
    scene.add(ts.forces.Bushing(bob, scene.ground, stiffness=0.1, name="bush"))
    scene.add(ts.forces.PointForce(bob, force=(1, 0, 0), name="push"))
    return scene


BAD = {  # value of a case -> what its message shows
    "bob.mass": (-1.0, "got -1.0."),
    "bob.inertia": ((1.0, np.nan, 1.0), "got [1.0, nan, 1.0]."),
    "bob.orientation": ((np.nan, 0.0, 0.0, 1.0), "[nan, 0.0, 0.0, 1.0]"),
    "bob.velocity": ((0.0, np.inf, 0.0), "got [0.0, inf, 0.0]."),
    "gravity": ((np.nan, 0.0, 0.0), "got [nan, 0.0, 0.0]."),
    "rod.point_b": ((np.nan, 0.0, 0.0), "got [nan, 0.0, 0.0]."),
    "rod.length": (np.nan, "nan"),
    "spring.stiffness": (-2.0, "got -2.0."),
    "bush.stiffness": ((1.0, -1.0, 0.0), "got [1.0, -1.0, 0.0]."),
    "push.force": ((np.inf, 0.0, 0.0), "got [inf, 0.0, 0.0]."),
}


@pytest.mark.parametrize("name", BAD)
def test_messages_show_plain_numbers(name):
    scene, (bad, said) = ball(), BAD[name]
    good = scene.parameters()[name]
    good = np.diagonal(good) if name == "bob.inertia" else good
    found = ts.ensemble(scene, {name: np.stack([good, np.asarray(bad)])}, SPAN, threads=1)
    assert found.success.tolist() == [True, False], found.message
    assert said in found.message[1]
    assert "array(" not in found.message[1]
    assert "np." not in found.message[1]


def test_messages_are_short_where_values_are_long():
    with pytest.raises(ts.InvalidBody, match="must be three finite numbers") as caught:
        ts.Scene().add_point_mass(mass=1.0, position=np.arange(1000.0))
    assert len(str(caught.value)) < 300
