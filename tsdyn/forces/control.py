"""A control law of the whole scene: a function of time and state that gives a number to each of several actuators.

    u = function(t, state)                           (1)  continuous
    u = function(t_k, state(t_k))                    (2)  from t_k = k period to t_{k+1}

u_i is the torque or force of a joint as of JointTorque and JointForce, the tension of a spring's actuator, or
multiplies the vector of a PointForce or Torque.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import (
    Action,
    Force,
    SceneLaw,
    Turn,
    angles,
    displacements,
    instants,
    label,
    named,
    scene_law,
    stop_waiting,
)
from .point_force import PointForce
from .spring import Spring
from .torque import Torque

if TYPE_CHECKING:
    from ..hints import Actuators, ControlLaw

HOW = (
    "an actuator is a joint with an angle or a displacement, by name or handle, (joint, 'angle') or (joint, 'angle', "
    "1) where it has several, a Spring, or a PointForce or Torque that is made for it and not added itself"
)


class Control(SceneLaw, Force):
    """Torques and forces of several actuators as one function of time and of the state of the scene.

    Parameters
    ----------
    function : callable (t, state) -> float, or sequence of floats
        One number for each actuator. state is that of events: `state.angle("hinge")`, `state.angle_rate`,
        `state.displacement`, `state.position("arm", point)`, `state.velocity`, `state.rotation`, ..., with bodies and
        joints by name or handle, and `state.t`, `state.q`, `state.qd`. It has no accelerations and reactions: these
        follow from the forces. Without a period the function depends on its arguments alone. If it is arithmetic and
        functions of NumPy, without branches, it runs compiled; else Python calls it at each evaluation, which takes
        tens of microseconds. `print(ts.prepare(scene))` says which. Keyword arguments with defaults are parameters of
        the scene: `def law(t, state, *, gain=2.0)`. With a period, any callable; it is called at the sampling times
        only, in their order, as for JointTorque.
    actuators : sequence
        What the numbers act as. A joint, by handle or name: its torque (N m) or force (N), as of JointTorque and
        JointForce; of a joint with several coordinates (joint, "angle"), (joint, "displacement") or (joint, "angle",
        1). A Spring: the tension (N) of its actuator, added to what it has. A PointForce or Torque with a constant
        vector, made for the Control and not added to the scene: the number multiplies the vector.
    period : float, s, optional
        Sampling period: the function is called at k period, and its values are held in between. Steps end at sampling
        times.

    Raises
    ------
    InvalidForce
        If the function can't be called with (t, state), if there is no actuator, or one is of another scene, isn't
        added or has several coordinates. When it is added: if the function gives another number of values, or raises
        what no other state mends.
    InvalidBody, InvalidConstraint
        When it is added: if the function asks for a body or a joint that the scene hasn't.

    Notes
    -----
    Its power is applied power. A value that is not finite, or an exception of the function, ends the run.

    Examples
    --------
    A cart keeps a pendulum upright:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> cart = scene.add_body(mass=1.0, inertia=(1, 1, 1), name="cart")
    >>> rod = scene.add_body(mass=0.2, inertia=(0.01, 0.01, 0.001), position=(0, 0, 0.5), name="rod")
    >>> rail = ts.constraints.Translational.at(scene.ground, cart, point=(0, 0, 0), axis=(1, 0, 0), name="rail")
    >>> hinge = ts.constraints.Revolute.at(cart, rod, point=(0, 0, 0), axis=(0, 1, 0), name="hinge")
    >>> _ = scene.add(rail), scene.add(hinge)
    >>> def balance(t, state):
    ...     x, v = state.displacement("rail"), state.displacement_rate("rail")
    ...     return 2.0 * x + 4.0 * v + 50.0 * state.angle("hinge") + 12.0 * state.angle_rate("hinge")
    >>> control = scene.add(ts.forces.Control(balance, actuators=["rail"]))
    >>> _ = scene.set("hinge", angle=0.1)
    >>> print(f"{abs(ts.simulate(scene, (0, 20)).state.angle('hinge')):.4f} rad")
    0.0000 rad
    """

    markers = (Turn("a"),)
    particles = True
    loads, given = ("function",), "function"
    permanent = ("actuators",)
    each = ", one for each actuator"
    quantities = MappingProxyType({"function": scene_law, "period": instants})

    def __init__(
        self, function: ControlLaw, actuators: Actuators = (), *, period: float | None = None, name: str = ""
    ) -> None:
        given = label(name, "Control", self.error)
        self.name = given or "Control"
        if not isinstance(actuators, (list, tuple)) or not actuators:
            raise self.error(f"{self.name}: actuators must be a list of one or more, got {actuators!r}; {HOW}.")
        self.function, self.period = function, period
        self.__dict__.update(actuators=tuple(actuators), _name=given)
        known = [scene for one in actuators if (scene := getattr(_item(one), "scene", None)) is not None]
        if known:
            self.place_in(known[0])

    def place_in(self, scene: Any) -> None:
        """Find the actuators in their scene."""
        if "_found" in self.__dict__:
            return
        self.__dict__["_found"] = tuple(self._actuator(scene, given) for given in self.actuators)
        (first, *_), name = self.bodies or (None,), self._name
        super().__init__(first, None, name=name)

    def _untitled(self, bodies):
        return f"Control({', '.join(item.name for item, *_ in self._found)})"

    def _actuator(self, scene, given):
        """(item, kind of coordinate, which); of a Spring, a PointForce or a Torque the item alone."""
        item, *which = given if isinstance(given, tuple) and given else (given,)
        if isinstance(item, str):
            joints = [each for each in scene.constraints if angles(each) or displacements(each)]
            item = named(
                [*joints, *scene.forces], item, "spring, or joint with an angle or a displacement,", self.error
            )
        is_item = hasattr(item, "added")  # a constraint or a force
        if not is_item or item.scene is not scene:
            where = "belongs to another scene" if is_item else "is none"
            raise self.error(f"{self.name}: the actuator {item!r} {where}; {HOW}.")
        if isinstance(item, (PointForce, Torque)) and not which:
            vector = getattr(item, item.given)
            if item.added or not isinstance(vector, np.ndarray):
                raise self.error(
                    f"{self.name}: {item.name} must have a constant vector, and must not be added itself; {HOW}."
                )
            stop_waiting(item)
            return (item,)
        if not item.added:
            raise self.error(f"{self.name}: add its actuator {item.name!r} to the scene first.")
        if isinstance(item, Spring) and not which:
            return (item,)
        if isinstance(item, Force):
            raise self.error(f"{self.name}: {item.name!r} is a force, whose coordinates can't be driven; {HOW}.")
        found = [("angle", i) for i in range(len(angles(item)))]
        found += [("displacement", i) for i in range(len(displacements(item)))]
        wanted = [one for one in found if list(one)[: len(which)] == which]
        if len(wanted) != 1:
            known = ", ".join(f"({kind!r}, {i})" for kind, i in found) or "none"
            raise self.error(f"{self.name}: the actuator {item.name!r} has the coordinates {known}; {HOW}.")
        return item, *wanted[0]

    @property
    def referred(self) -> tuple[Any, ...]:
        """Its actuators, and their bodies."""
        return *super().referred, *(item for item, *_ in self._found), *self.bodies

    def actions(self) -> list[Action]:
        """What each value acts as."""
        return [_action(*actuator) for actuator in self._found]

    def titles(self) -> list[str]:
        """Names of its actuators, with numbers where a joint or spring is several."""
        names = [item.name for item, *_ in self._found]
        return [
            name if names.count(name) == 1 else f"{name} {names[: i + 1].count(name)}" for i, name in enumerate(names)
        ]

    @classmethod
    def example(cls, rng, a, b):
        """Two components of a force on a, and a torque, that depend on both bodies."""
        body, other = (a, b) if a.dimension else (b, a)
        push = [PointForce(body, point_a=rng.normal(size=3), force=rng.normal(size=3), frame="body") for _ in range(2)]
        return cls(
            _Example(body.name, other.name if other.dimension else body.name), [*push, Torque(body, torque=(1, 2, 3))]
        )


class _Example:
    def __init__(self, *names):
        self.names = names

    def __call__(self, t, state):
        a, b = self.names
        return (
            state.position(a)[0] * state.velocity(b)[1],
            np.sin(t) - state.angular_velocity(b)[2],
            state.rotation(a)[0, 1],
        )


def _item(given):
    return given[0] if isinstance(given, tuple) and given else given


def _action(item, kind="", which=0):
    if isinstance(item, Spring):
        return Action(False, item.a, item.b, None, (), tuple(item.point_a.tolist()), tuple(item.point_b.tolist()))
    if not kind:
        point = () if isinstance(item, Torque) else (tuple(item.point_a.tolist()),)
        frame, vector = item.a if item.frame == "body" else None, getattr(item, item.given)
        return Action(isinstance(item, Torque), item.a, None, frame, tuple(vector.tolist()), *point)
    geometry = (angles if kind == "angle" else displacements)(item)[which]
    if kind == "angle":
        axis = np.cross(geometry.f, geometry.g)
        return Action(True, geometry.other, geometry.own, geometry.own, tuple(axis.tolist()))
    return Action(False, geometry.other, geometry.own, geometry.own, tuple(geometry.e), tuple(geometry.s_other))
