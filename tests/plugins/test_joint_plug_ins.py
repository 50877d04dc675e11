"""Joints of one's own: the same interface as the built-in ones, and what is wrong with one is said."""

import re
from pathlib import Path

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.tolerances import HELD
from tsdyn.elements.joint import across

C = ts.constraints


def test_the_example_of_the_docs():
    text = (Path(__file__).parents[2] / "docs" / "plug-ins.md").read_text().split("# A joint of your own")[1]
    names = {}
    exec(re.search(r"```python\n(.*?)```", text, re.DOTALL)[1], names)
    assert names["scene"].row_names()[3] == "PinInSlot 'pin' slot[1]"
    np.testing.assert_allclose(names["force"][-1], (0, 0, 9.81), atol=HELD)


class Slot(ts.Joint):
    """A pin of a in a slot of b, square to it: a revolute joint that may slide along one direction across its axis."""

    markers = (ts.Point("a"), ts.Point("b"), ts.Vector("a"), ts.Vector("b"), ts.Vector("b", "slot_b"))

    def __init__(self, a, b, *, point_a=(0, 0, 0), point_b=(0, 0, 0), axis_a=None, axis_b=None, slot_b=None, name=""):
        super().__init__(a, b, (point_a, point_b, axis_a, axis_b, slot_b), name)

    def compose(self):
        yield "axis", C.Parallel(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b)
        yield (
            "slot",
            C.PointOnLine(self.a, self.b, point_a=self.point_a, point_b=self.point_b, axis_b=self.slot_b),
        )


def pair():
    scene = ts.Scene()
    return scene, *(scene.add_body(1.0, (1.0, 1.0, 1.0), name=name) for name in ("one", "two"))


def test_it_is_checked_registered_and_run_as_the_built_in_ones_are():
    ts.testing.check_primitive(Slot)
    assert Slot in C.registered_joints()
    scene, one, _ = pair()
    slot = scene.add(Slot.at(one, scene.ground, point=(0, 0, 0), axis=(0, 1, 0), slot=(1, 0, 0), name="s"))
    assert scene.row_names()[:4] == [f"Slot 's' {row}" for row in ("axis[0]", "axis[1]", "slot[0]", "slot[1]")]
    one.velocity, one.angular_velocity = (0.5, 0, 0), (0, 2.0, 0)
    solution = ts.simulate(scene, (0.0, 1.0)).raise_if_failed()
    np.testing.assert_allclose(solution.position(one)[-1], (0.5, 0, 0), atol=HELD)
    np.testing.assert_allclose(solution.reaction(slot)[0][-1], (0, 0, 9.81), atol=HELD)
    one.orientation = (0, 1, 0, 0)
    with pytest.raises(ts.InconsistentState, match=r"Slot 's'.*opposite"):
        ts.simulate(scene, (0.0, 1.0))


def test_directions_of_its_own_can_be_kept_from_opposing():
    class Square(ts.Joint):
        markers = (ts.Vector("a"), ts.Vector("b"))

        def __init__(self, a, b, *, axis_a, axis_b, name=""):
            super().__init__(a, b, (axis_a, axis_b), name)

        def compose(self):
            for direction in across(self.axis_b):
                yield "axis", C.Dot1(self.b, self.a, axis_a=direction, axis_b=self.axis_a)

        def aligned(self):
            return ((self.axis_a, self.axis_b),)

    scene, one, two = pair()
    scene.add(Square(one, two, axis_a=(0, 0, 1), axis_b=(0, 0, -1), name="mine"))
    with pytest.raises(ts.InconsistentState, match=r"mine.*opposite"):
        ts.simulate(scene, (0.0, 0.1))


def test_a_wrong_kernel_in_a_part_is_named():
    class Off(C.Dot1):
        @staticmethod
        def gamma(x, xd, par, t, out):
            out[0] = 0.0

    class Wrong(Slot):
        def compose(self):
            yield "angle", Off(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b)

    with pytest.raises(ts.testing.CheckFailed, match=r"Off in Wrong.*gamma\[0\]"):
        ts.testing.check_primitive(Wrong)


def composed(parts):
    """A joint class whose compose() yields parts(joint)."""

    def compose(self):
        yield from parts(self)

    return type("Odd", (Slot,), {"compose": compose})


def stranger(joint):
    third = joint.scene.add_body(1.0, (1, 1, 1))
    return [("point", C.Spherical(joint.a, third))]


def used(joint):
    part = C.Spherical(joint.a, joint.b)
    joint.scene.add(part)
    return [("point", part)]


def twice(joint):
    part = C.Dot1(joint.a, joint.b, axis_a=(1, 0, 0), axis_b=(0, 1, 0))
    return [("one", C.Fixed.at(joint.a, joint.b).parts[0]), ("two", part)]


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        (lambda joint: [C.Spherical(joint.a, joint.b)], "must yield"),
        (lambda joint: [("point", 3)], "must yield"),
        (lambda joint: [("p", C.EulerNormalization(joint.a))], "can't be a part"),
        (lambda joint: [("f", ts.forces.Torque(joint.a, torque=(1, 0, 0)))], "must yield"),
        (stranger, "own two bodies"),
        (used, "can't be a part"),
        (twice, "can't be a part"),
    ],
)
def test_what_is_no_part_is_refused(parts, words):
    scene, one, two = pair()
    joint = composed(parts).at(one, two, point=(0, 0, 0), axis=(0, 1, 0), slot=(1, 0, 0), name="mine")
    with pytest.raises(ts.InvalidConstraint, match=f"'mine'.*{words}"):
        scene.add(joint)
    assert joint not in scene.constraints


def test_markers_are_checked():
    with pytest.raises(ts.InvalidConstraint, match="joint Bad: markers"):
        type("Bad", (ts.Joint,), {"markers": "axis_a", "compose": lambda self: ()})


def test_a_row_that_a_part_counts_may_move_with_time():
    """A driven part: the joint's rows have a Phi_t."""

    class Driven(ts.Joint):
        markers = (ts.Point("a"), ts.Point("b"), ts.Vector("a"))

        def __init__(self, a, b, *, point_a=(0, 0, 0), point_b=(0, 0, 0), axis_a=None, value=0.0, name=""):
            super().__init__(a, b, (point_a, point_b, axis_a), name)
            self.value = value

        def compose(self):
            place = {"axis_a": self.axis_a, "point_a": self.point_a, "point_b": self.point_b}
            yield "drive", C.Dot2(self.a, self.b, **place, value=self.value)

    motion = (lambda t: 0.1 * t * t, lambda t: 0.2 * t, lambda t: 0.2 + 0.0 * t)
    scene, one, _ = pair()
    drive = scene.add(Driven(scene.ground, one, axis_a=(0, 0, 1), value=motion))
    solution = ts.simulate(scene, (0.0, 1.0)).raise_if_failed()
    np.testing.assert_allclose(solution.position(one)[-1], (0, 0, 0.1), atol=HELD)
    np.testing.assert_allclose(solution.reaction(drive)[0][-1], (0, 0, 9.81 + 0.2), atol=HELD)
