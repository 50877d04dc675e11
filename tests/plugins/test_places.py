"""Arguments that follow from markers: of plug-ins without an `__init__`, and of those that pass `**places` on."""

import inspect

import numpy as np
import pytest

import tsdyn as ts
from tsdyn.elements import joint


@pytest.fixture
def pin_in_slot():
    before = dict(joint._registry)

    class PinInSlot(ts.Joint):
        """A pin in a slot along x.

        Notes
        -----
        Rows: slot[0], slot[1].
        """

        markers = (ts.Point("a"), ts.Point("b"), ts.Vector("b", "slot_b"))

        def compose(self):
            points = {"point_a": self.point_a, "point_b": self.point_b}
            yield "slot", ts.constraints.PointOnLine(self.a, self.b, **points, axis_b=self.slot_b)

    yield PinInSlot
    joint._registry.clear()
    joint._registry.update(before)


def test_a_class_without_init_has_the_arguments_of_its_markers(pin_in_slot):
    scene = ts.Scene()
    body = scene.add_body(1.0, (1, 1, 1))
    pin = pin_in_slot(body, "ground", point_a=(1, 0, 0), slot_b=(0, 0, 2), name="pin")
    np.testing.assert_array_equal((pin.point_a, pin.point_b, pin.slot_b), ((1, 0, 0), (0, 0, 0), (0, 0, 1)))
    assert (pin.name, pin.b) == ("pin", scene.ground)
    assert {"point_a", "point_b", "slot_b", "name"} <= {*inspect.signature(pin_in_slot).parameters}
    placed = pin_in_slot.at(body, scene.ground, point=(0, 1, 0), slot=(1, 0, 0))
    np.testing.assert_array_equal((placed.point_a, placed.point_b), ((0, 1, 0), (0, 1, 0)))
    with pytest.raises(ts.InvalidCall, match="no argument slot_a; did you mean slot_b"):
        pin_in_slot(body, scene.ground, slot_a=(0, 0, 1))
    with pytest.raises(ts.InvalidConstraint, match="slot_b"):
        pin_in_slot(body, scene.ground)


def test_a_class_without_init_is_called_by_its_signature(pin_in_slot):
    scene = ts.Scene()
    body = scene.add_body(1.0, (1, 1, 1))
    assert list(inspect.signature(pin_in_slot).parameters) == ["a", "b", "point_a", "point_b", "slot_b", "name"]
    with pytest.raises(ts.InvalidCall, match="missing a required argument: 'b'"):
        pin_in_slot(body)
    with pytest.raises(
        ts.InvalidCall, match="takes a, b by position, got 3 arguments there; name the others: point_a="
    ):
        pin_in_slot(body, scene.ground, (1, 0, 0))
    with pytest.raises(ts.InvalidCall, match="It has a, b, point_a, point_b, slot_b, name"):
        pin_in_slot(body, scene.ground, slots=(0, 0, 1))


def test_values_are_checked_when_one_is_made(pin_in_slot):
    class ShortPin(pin_in_slot):
        def check(self):
            if not np.linalg.norm(self.point_a) < 1.0:
                raise self.error(f"{self.name}: point_a is beyond 1 m.")

    scene = ts.Scene()
    body = scene.add_body(1.0, (1, 1, 1))
    ShortPin(body, scene.ground, slot_b=(0, 0, 1), point_a=(0.5, 0, 0))
    with pytest.raises(ts.InvalidConstraint, match="point_a is beyond 1 m"):
        ShortPin(body, scene.ground, slot_b=(0, 0, 1), point_a=(1, 0, 0))


def test_docstrings_describe_arguments_of_markers_and_of_bases(pin_in_slot):
    text = inspect.getdoc(pin_in_slot)
    assert text.index("Parameters\n") < text.index("Raises\n") < text.index("Notes\n")
    for entry in (
        "a, b : Body or ground",
        "point_a, point_b : array_like (3,), m",
        "slot_b : array_like",
        "name : str",
    ):
        assert entry in text, entry
    friction = inspect.getdoc(ts.forces.RevoluteFriction)
    assert friction.index("radius :") < friction.index("static :")
    assert "RedundantConstraints" in friction
    assert "rtol, atol : float" in inspect.getdoc(ts.integrators.SDIRK54)


def test_every_argument_of_a_built_in_class_is_described():
    for space in (ts.constraints, ts.forces, ts.integrators):
        for name in space.__all__:
            kind = getattr(space, name)
            if isinstance(kind, type):
                parameters = inspect.getdoc(kind).partition("Parameters\n")[2].partition("\n\n")[0]
                for argument in inspect.signature(kind).parameters:
                    assert argument in parameters, f"{name}: {argument}"
