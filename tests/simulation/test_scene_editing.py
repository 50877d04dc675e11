"""Scenes that change: what is removed, what refuses to go, old solutions, copies that share nothing."""

import copy
import pickle

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import HELD

C, F = ts.constraints, ts.forces
METHOD = {"integrator": "taylor"}


def chain(count=3):
    """Links on hinges, a spring at the last one."""
    scene = ts.Scene()
    links = [scene.add_body(1.0 + i, (0.1, 0.2, 0.3), (i + 0.5, 0.0, 0.0), name=f"link{i}") for i in range(count)]
    for i, (a, b) in enumerate(zip((scene.ground, *links), links, strict=False)):
        scene.add(C.Revolute.at(a, b, point=(i, 0, 0), axis=(0, 1, 0), name=f"hinge{i}"))
    scene.add(F.Spring(links[-1], scene.ground, point_b=(1, 0, 3), stiffness=5.0, name="spring"))
    return scene, links


def end(scene, **options):
    return ts.simulate(scene, (0.0, 0.3), **METHOD, **options).raise_if_failed()


def test_a_scene_without_what_was_removed_is_the_scene_that_never_had_it():
    scene, links = chain()
    end(scene)  # all is prepared
    assert scene.remove("spring").name == "spring"
    assert scene.remove(scene["hinge2"]).name == "hinge2"
    assert scene.remove(links[2]) is links[2]
    other, _ = chain(2)
    other.remove("spring")
    np.testing.assert_array_equal(end(scene).q, end(other).q)
    assert scene.row_names() == other.row_names()
    assert [body.name for body in scene.bodies] == ["link0", "link1"]


def test_bodies_after_a_removed_one_keep_their_results():
    """Handles know the solutions made before and after, though every place in q has moved."""
    scene, links = chain()
    free = scene.add_body(1.0, (1, 1, 1), (5.0, 0.0, 0.0), velocity=(0, 1, 0), name="free")
    before = end(scene)
    hinge, spring = scene["hinge1"], scene["spring"]
    kept = [before.position(free), before.reaction(hinge, on=links[1]), before.reaction(spring), before.energy]
    for name in ("hinge0", "hinge1"):
        scene.remove(name)
    scene.remove(links[0])
    after = end(scene)
    again = [before.position(free), before.reaction(hinge, on=links[1]), before.reaction(spring), before.energy]
    for one, other in zip(kept, again, strict=True):
        np.testing.assert_array_equal(one, other)
    assert before.position(links[0]).shape == (before.t.size, 3)
    np.testing.assert_allclose(after.position(free)[-1], before.position(free)[-1], atol=HELD)
    with pytest.raises(ts.InvalidBody, match="not a body of this scene"):
        after.position(links[0])


def test_a_constraint_may_come_back_and_a_body_may_not():
    scene, links = chain()
    first = end(scene).q[-1]
    spring = scene.remove("spring")
    scene.add(spring)
    np.testing.assert_array_equal(end(scene).q[-1], first)
    hinge = scene.remove("hinge2")
    scene.remove(spring)
    scene.remove(links[2])
    for make in (lambda: scene.add(hinge), lambda: scene.add(F.Torque(links[2], torque=(1, 0, 0)))):
        with pytest.raises(ts.InvalidBody, match=r"'link2' has been removed"):
            make()
    scene.add_body(1.0, (1, 1, 1), name="link2")  # the name is free again


def test_what_is_referred_to_stays():
    scene, links = chain()
    scene.add(F.RevoluteFriction(scene["hinge0"], kinetic=0.1, radius=0.1, name="rub"))
    for item, words in (
        (links[1], "'link1' can't be removed before what refers to it: hinge1, hinge2"),
        ("link2", "hinge2, spring"),
        (scene["hinge0"], "rub"),
    ):
        with pytest.raises(ts.InvalidArgument, match=words):
            scene.remove(item)
    assert len(scene.bodies) == 3


BAD = {
    "ground": (lambda s: s.ground, "ground can't"),
    "nothing": (lambda s: "nothing", "no body, constraint or force is named 'nothing'"),
    "none": (lambda s: None, "nothing like None"),
    "array": (lambda s: np.zeros(3), "nothing like"),
    "normalisation": (lambda s: s.constraints[-1], "belongs to its body"),
    "part": (lambda s: s.primitives[0], "part of Revolute 'hinge0'"),
    "other scene": (lambda s: chain()[1][0], "nothing like"),
}


@pytest.mark.parametrize(("item", "words"), BAD.values(), ids=BAD)
def test_what_is_not_there(item, words):
    scene, _ = chain()
    with pytest.raises(ts.InvalidArgument, match=words):
        scene.remove(item(scene))


def test_a_name_of_several():
    scene, links = chain()
    scene.add(F.Torque(links[0], torque=(1, 0, 0), name="link1"))
    with pytest.raises(ts.InvalidArgument, match="'link1' is the name of 2"):
        scene.remove("link1")


def swing(t):
    return 0.1 * t * t


def pull(t):
    return 0.1 * np.sin(t)


def test_a_copy_is_independent():
    scene, links = chain()
    scene.add(C.RotationMotor.of(scene["hinge0"], angle=swing, name="motor"))
    scene.add(F.Spring(links[0], scene.ground, point_b=(0, 0, 2), actuator=pull, name="rope"))
    options = {"integrator": "dop853", "t_eval": (0.0, 0.2)}
    first = ts.simulate(scene, (0.0, 0.2), **options)
    twin = scene.copy()
    assert [item.name for item in (*twin.bodies, *twin.constraints, *twin.forces)] == [
        item.name for item in (*scene.bodies, *scene.constraints, *scene.forces)
    ]
    np.testing.assert_array_equal(ts.simulate(twin, (0.0, 0.2), **options).q, first.q)
    assert twin[links[1]] is twin.bodies[1]
    assert twin[links[1]] is not links[1]
    assert twin[scene["motor"]] is twin["motor"]
    assert twin[scene.ground] is twin.ground
    twin["link1"].mass = 7.0
    twin.gravity = (0, 0, 0)
    twin.remove("spring")
    assert links[1].mass == 2.0
    assert len(scene.forces) == 2
    np.testing.assert_array_equal(ts.simulate(scene, (0.0, 0.2), **options).q, first.q)
    with pytest.raises(ts.InvalidConstraint, match=r"another scene|different scenes"):
        twin.add(C.Spherical(links[0], links[1]))
    with pytest.raises(ValueError, match="read-only"):
        twin["link0"].position[0] = 1.0
    assert pickle.loads(pickle.dumps(twin)).bodies[0].name == "link0"
    assert copy.deepcopy(twin).bodies[0].name == "link0"
