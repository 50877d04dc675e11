# Written by tools/stubs.py: do not edit.
from collections.abc import Callable
from typing import Any, Self

from .. import JointFriction
from ..constraints import Revolute, Translational
from ..hints import Actuators, ArrayLike, Attachment, Attribute, Axes, Body, BodyLike, ControlLaw, Floats, Force, Frame, Joint, JointLaw, JointLoads, Load, PointMass, Points, Primitive, References, RopePoints, VectorLoad

class Bushing(Points, Force):
    stiffness: Attribute[ArrayLike, Floats]
    damping: Attribute[ArrayLike, Floats]
    torsional_stiffness: Attribute[ArrayLike, Floats]
    torsional_damping: Attribute[ArrayLike, Floats]
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., stiffness: ArrayLike = ..., damping: ArrayLike = ..., torsional_stiffness: ArrayLike = ..., torsional_damping: ArrayLike = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., stiffness: ArrayLike = ..., damping: ArrayLike = ..., torsional_stiffness: ArrayLike = ..., torsional_damping: ArrayLike = ..., name: str = ...) -> Self: ...

class Spring(Points, Force):
    stiffness: float
    damping: float
    free_length: float
    actuator: Attribute[Load, Any]
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., stiffness: float = ..., damping: float = ..., free_length: float | None = ..., actuator: Load = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., stiffness: float = ..., damping: float = ..., free_length: float | None = ..., actuator: Load = ..., name: str = ...) -> Self: ...

class TorsionalSpring(Axes, References, Force):
    stiffness: float
    damping: float
    free_angle: float
    actuator: Attribute[Load, Any]
    def __init__(self, a: BodyLike, b: BodyLike, *, axis_a: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., stiffness: float = ..., damping: float = ..., free_angle: float = ..., actuator: Load = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, axis: ArrayLike | None = ..., reference: ArrayLike | None = ..., axis_a: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., stiffness: float = ..., damping: float = ..., free_angle: float = ..., actuator: Load = ..., name: str = ...) -> Self: ...

class Armature(Force):
    @property
    def joint(self) -> Joint: ...
    inertia: float
    ratio: float
    @property
    def which(self) -> int: ...
    def __init__(self, joint: Joint, *, inertia: float, ratio: float = ..., which: int = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, joint: Joint, *, inertia: float, ratio: float = ..., which: int = ..., name: str = ...) -> Self: ...
    @property
    def geometry(self) -> Any: ...
    @property
    def inertia_row(self) -> Primitive: ...

class Cable(Force):
    points: RopePoints
    stiffness: float
    damping: float
    free_length: float
    def __init__(self, points: RopePoints, *, stiffness: float = ..., damping: float = ..., free_length: float | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, points: RopePoints, *, stiffness: float = ..., damping: float = ..., free_length: float | None = ..., name: str = ...) -> Self: ...
    def forget(self) -> None: ...
    @property
    def function_of_state(self) -> Any: ...

class ContactFriction(JointFriction, Force):
    @property
    def joint(self) -> Attachment: ...
    kinetic: float
    static: float | None
    slip_velocity: float | None
    stribeck_velocity: float | None
    preload: float
    def __init__(self, joint: Attachment, *, kinetic: float, static: float | None = ..., slip_velocity: float | None = ..., stribeck_velocity: float | None = ..., preload: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, joint: Attachment, *, kinetic: float, static: float | None = ..., slip_velocity: float | None = ..., stribeck_velocity: float | None = ..., preload: float = ..., name: str = ...) -> Self: ...

class Control(Force):
    function: ControlLaw
    actuators: Actuators
    period: float | None
    def __init__(self, function: ControlLaw, actuators: Actuators = ..., *, period: float | None = ..., name: str = ...) -> None: ...
    def actions(self) -> list[Action]: ...
    @classmethod
    def at(cls, function: ControlLaw, actuators: Actuators = ..., *, period: float | None = ..., name: str = ...) -> Self: ...
    def forget(self) -> None: ...
    @property
    def function_of_state(self) -> Any: ...
    def results(self, function: Any, t: Any, state: Any, numbers: Any) -> list[Any]: ...
    def titles(self) -> list[str]: ...

class CoulombFriction(Force):
    force: float
    torque: float
    slip_velocity: float | None
    slip_rate: float | None
    point_a: Attribute[ArrayLike, Floats]
    def __init__(self, a: BodyLike, b: BodyLike, *, force: float = ..., torque: float = ..., slip_velocity: float | None = ..., slip_rate: float | None = ..., point_a: ArrayLike = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., force: float = ..., torque: float = ..., slip_velocity: float | None = ..., slip_rate: float | None = ..., point_a: ArrayLike = ..., name: str = ...) -> Self: ...

class JointForce(JointLoads, Force):
    def __init__(self, joint: Attachment, *, function: JointLaw, period: float | None = ..., which: int = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, joint: Attachment, *, function: JointLaw, period: float | None = ..., which: int = ..., name: str = ...) -> Self: ...

class JointTorque(JointLoads, Force):
    def __init__(self, joint: Attachment, *, function: JointLaw, period: float | None = ..., which: int = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, joint: Attachment, *, function: JointLaw, period: float | None = ..., which: int = ..., name: str = ...) -> Self: ...

class PointForce(Force):
    point_a: Attribute[ArrayLike, Floats]
    force: Attribute[VectorLoad, Any]
    frame: Frame
    def __init__(self, a: PointMass | str, *, point_a: ArrayLike = ..., force: VectorLoad | None = ..., frame: Frame = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: PointMass | str, *, point: ArrayLike = ..., point_a: ArrayLike = ..., force: VectorLoad | None = ..., frame: Frame = ..., name: str = ...) -> Self: ...
    def take(self, value: Any, frame: str, hint: str) -> None: ...

class RevoluteFriction(JointFriction, Force):
    @property
    def joint(self) -> Revolute: ...
    radius: float
    kinetic: float
    collar_radius: float
    length: float | None
    static: float | None
    slip_velocity: float | None
    stribeck_velocity: float | None
    preload: float
    def __init__(self, joint: Revolute, *, radius: float, kinetic: float, collar_radius: float = ..., length: float | None = ..., static: float | None = ..., slip_velocity: float | None = ..., stribeck_velocity: float | None = ..., preload: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, joint: Revolute, *, radius: float, kinetic: float, collar_radius: float = ..., length: float | None = ..., static: float | None = ..., slip_velocity: float | None = ..., stribeck_velocity: float | None = ..., preload: float = ..., name: str = ...) -> Self: ...

class Torque(Force):
    torque: Attribute[VectorLoad, Any]
    frame: Frame
    def __init__(self, a: Body | str, *, torque: VectorLoad | None = ..., frame: Frame = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: Body | str, *, torque: VectorLoad | None = ..., frame: Frame = ..., name: str = ...) -> Self: ...
    def take(self, value: Any, frame: str, hint: str) -> None: ...

class TranslationalFriction(JointFriction, Force):
    @property
    def joint(self) -> Translational: ...
    kinetic: float
    length: float | None
    width: float | None
    static: float | None
    slip_velocity: float | None
    stribeck_velocity: float | None
    preload: float
    def __init__(self, joint: Translational, *, kinetic: float, length: float | None = ..., width: float | None = ..., static: float | None = ..., slip_velocity: float | None = ..., stribeck_velocity: float | None = ..., preload: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, joint: Translational, *, kinetic: float, length: float | None = ..., width: float | None = ..., static: float | None = ..., slip_velocity: float | None = ..., stribeck_velocity: float | None = ..., preload: float = ..., name: str = ...) -> Self: ...

class UserForce(Points, Force):
    function: Callable[..., object]
    def __init__(self, a: PointMass | str, b: BodyLike | None = ..., *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., function: Callable[..., object], parameters: ArrayLike = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: PointMass | str, b: BodyLike | None = ..., *, point: ArrayLike = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., function: Callable[..., object], parameters: ArrayLike = ..., name: str = ...) -> Self: ...
    def forget(self) -> None: ...
    @property
    def function_of_state(self) -> Any: ...

class ViscousFriction(Force):
    damping: float
    torsional_damping: float
    point_a: Attribute[ArrayLike, Floats]
    def __init__(self, a: BodyLike, b: BodyLike, *, damping: float = ..., torsional_damping: float = ..., point_a: ArrayLike = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., damping: float = ..., torsional_damping: float = ..., point_a: ArrayLike = ..., name: str = ...) -> Self: ...

def registered() -> tuple[type[Force], ...]: ...
