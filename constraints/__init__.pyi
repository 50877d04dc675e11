# Written by tools/stubs.py: do not edit.
from collections.abc import Iterator
from typing import Any, Self

from ..hints import AnyBody, ArrayLike, Attribute, Axes, Body, BodyLike, Floats, Function, Joint, JointCoordinate, Orientation, Path, Points, Prescribed, Primitive, References, RopePoints

class AngleDriver(References, Primitive):
    across_a: Attribute[ArrayLike, Floats]
    angle: Attribute[Prescribed, Any]
    def __init__(self, a: BodyLike, b: BodyLike, *, reference_a: ArrayLike | None = ..., across_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., angle: Prescribed = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, reference: ArrayLike | None = ..., across: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., across_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., angle: Prescribed = ..., name: str = ...) -> Self: ...
    @property
    def opposed(self) -> tuple[Any, ...]: ...

class AngleRate(Primitive):
    zero_a: Attribute[ArrayLike, Floats]
    quarter_a: Attribute[ArrayLike, Floats]
    hand_b: Attribute[ArrayLike, Floats]
    def __init__(self, a: BodyLike, b: BodyLike, *, zero_a: ArrayLike | None = ..., quarter_a: ArrayLike | None = ..., hand_b: ArrayLike | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, zero: ArrayLike | None = ..., quarter: ArrayLike | None = ..., hand: ArrayLike | None = ..., zero_a: ArrayLike | None = ..., quarter_a: ArrayLike | None = ..., hand_b: ArrayLike | None = ..., name: str = ...) -> Self: ...

class AngleTerm(References, Primitive):
    across_a: Attribute[ArrayLike, Floats]
    ratio: float
    offset: float
    def __init__(self, a: BodyLike, b: BodyLike, *, reference_a: ArrayLike | None = ..., across_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., ratio: float = ..., offset: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, reference: ArrayLike | None = ..., across: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., across_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., ratio: float = ..., offset: float = ..., name: str = ...) -> Self: ...

class Blade(Points, Primitive):
    axis_a: Attribute[ArrayLike, Floats]
    along_b: Attribute[ArrayLike, Floats]
    across_b: Attribute[ArrayLike, Floats]
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., axis_a: ArrayLike | None = ..., point_b: ArrayLike = ..., along_b: ArrayLike | None = ..., across_b: ArrayLike | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., axis: ArrayLike | None = ..., along: ArrayLike | None = ..., across: ArrayLike | None = ..., point_a: ArrayLike = ..., axis_a: ArrayLike | None = ..., point_b: ArrayLike = ..., along_b: ArrayLike | None = ..., across_b: ArrayLike | None = ..., name: str = ...) -> Self: ...

class ConstantAngle(Axes, Joint):
    angle: Attribute[Prescribed, Any]
    def __init__(self, a: BodyLike, b: BodyLike, *, axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., angle: Prescribed | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, axis: ArrayLike | None = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., angle: Prescribed | None = ..., name: str = ...) -> Self: ...

class CylinderContact(Primitive):
    center_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    first_b: Attribute[ArrayLike, Floats]
    second_b: Attribute[ArrayLike, Floats]
    radius: float
    cylinder_radius: float
    inside: bool
    def __init__(self, a: BodyLike, b: BodyLike, *, center_a: ArrayLike = ..., point_b: ArrayLike = ..., first_b: ArrayLike | None = ..., second_b: ArrayLike | None = ..., radius: float | None = ..., cylinder_radius: float | None = ..., inside: bool = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, center: ArrayLike = ..., point: ArrayLike = ..., first: ArrayLike | None = ..., second: ArrayLike | None = ..., center_a: ArrayLike = ..., point_b: ArrayLike = ..., first_b: ArrayLike | None = ..., second_b: ArrayLike | None = ..., radius: float | None = ..., cylinder_radius: float | None = ..., inside: bool = ..., name: str = ...) -> Self: ...

class Cylindrical(Points, Axes, Joint):
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., axis: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., name: str = ...) -> Self: ...

class DisplacementRate(Points, Primitive):
    axis_a: Attribute[ArrayLike, Floats]
    def __init__(self, a: BodyLike, b: BodyLike, *, axis_a: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, axis: ArrayLike | None = ..., point: ArrayLike = ..., axis_a: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., name: str = ...) -> Self: ...

class DisplacementTerm(Points, Primitive):
    axis_a: Attribute[ArrayLike, Floats]
    ratio: float
    offset: float
    def __init__(self, a: BodyLike, b: BodyLike, *, axis_a: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., ratio: float = ..., offset: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, axis: ArrayLike | None = ..., point: ArrayLike = ..., axis_a: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., ratio: float = ..., offset: float = ..., name: str = ...) -> Self: ...

class Distance(Points, Primitive):
    length: Attribute[Prescribed, Any]
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., length: Prescribed | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., length: Prescribed | None = ..., name: str = ...) -> Self: ...

class EulerNormalization(Primitive):
    def __init__(self, a: Body, *, name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: Body, *, name: str = ...) -> Self: ...

class Gear(Points, References, Primitive):
    axis_a: Attribute[ArrayLike, Floats]
    ratio: float
    offset: float
    def __init__(self, a: BodyLike, b: BodyLike, *, axis_a: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., ratio: float | None = ..., offset: float | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, axis: ArrayLike | None = ..., reference: ArrayLike | None = ..., point: ArrayLike = ..., axis_a: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., ratio: float | None = ..., offset: float | None = ..., name: str = ...) -> Self: ...

class KnifeEdge(Joint):
    point_a: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    normal_b: Attribute[ArrayLike, Floats]
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., axis_a: ArrayLike | None = ..., normal_b: ArrayLike | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., axis: ArrayLike | None = ..., normal: ArrayLike | None = ..., point_a: ArrayLike = ..., axis_a: ArrayLike | None = ..., normal_b: ArrayLike | None = ..., name: str = ...) -> Self: ...

class Parallel(Axes, Joint):
    def __init__(self, a: BodyLike, b: BodyLike, *, axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, axis: ArrayLike | None = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., name: str = ...) -> Self: ...

class Planar(Points, Axes, Joint):
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., axis: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., name: str = ...) -> Self: ...

class PointDriver(Points, Joint):
    path: Attribute[Path, Any]
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., path: Path | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., path: Path | None = ..., name: str = ...) -> Self: ...

class PointOnLine(Points, Joint):
    axis_b: Attribute[ArrayLike, Floats]
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_b: ArrayLike | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., axis: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_b: ArrayLike | None = ..., name: str = ...) -> Self: ...

class RackAndPinion(Points, Axes, Joint):
    direction_a: Attribute[ArrayLike, Floats]
    reference_b: Attribute[ArrayLike, Floats]
    radius: float
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., direction_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., radius: float | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., axis: ArrayLike | None = ..., direction: ArrayLike | None = ..., reference: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., direction_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., radius: float | None = ..., name: str = ...) -> Self: ...

class Revolute(Points, Axes, Joint):
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., axis: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., name: str = ...) -> Self: ...

class SmoothContact(Primitive):
    center_a: Attribute[ArrayLike, Floats]
    first_a: Attribute[ArrayLike, Floats]
    second_a: Attribute[ArrayLike, Floats]
    third_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    normal_b: Attribute[ArrayLike, Floats]
    semi_axes: Attribute[ArrayLike, Floats]
    tyre_radius: float
    def __init__(self, a: BodyLike, b: BodyLike, *, center_a: ArrayLike = ..., first_a: ArrayLike | None = ..., second_a: ArrayLike | None = ..., third_a: ArrayLike | None = ..., point_b: ArrayLike = ..., normal_b: ArrayLike | None = ..., semi_axes: ArrayLike | None = ..., tyre_radius: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, center: ArrayLike = ..., first: ArrayLike | None = ..., second: ArrayLike | None = ..., third: ArrayLike | None = ..., point: ArrayLike = ..., normal: ArrayLike | None = ..., center_a: ArrayLike = ..., first_a: ArrayLike | None = ..., second_a: ArrayLike | None = ..., third_a: ArrayLike | None = ..., point_b: ArrayLike = ..., normal_b: ArrayLike | None = ..., semi_axes: ArrayLike | None = ..., tyre_radius: float = ..., name: str = ...) -> Self: ...

class Span(Points, Primitive):
    offset: float
    least: float
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., offset: float = ..., least: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., offset: float = ..., least: float = ..., name: str = ...) -> Self: ...

class SphereRolling(Primitive):
    center_a: Attribute[ArrayLike, Floats]
    first_a: Attribute[ArrayLike, Floats]
    second_a: Attribute[ArrayLike, Floats]
    third_a: Attribute[ArrayLike, Floats]
    center_b: Attribute[ArrayLike, Floats]
    first_b: Attribute[ArrayLike, Floats]
    second_b: Attribute[ArrayLike, Floats]
    third_b: Attribute[ArrayLike, Floats]
    distance: float
    share: float
    def __init__(self, a: BodyLike, b: BodyLike, *, center_a: ArrayLike = ..., first_a: ArrayLike | None = ..., second_a: ArrayLike | None = ..., third_a: ArrayLike | None = ..., center_b: ArrayLike = ..., first_b: ArrayLike | None = ..., second_b: ArrayLike | None = ..., third_b: ArrayLike | None = ..., distance: float, share: float, name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, center: ArrayLike = ..., first: ArrayLike | None = ..., second: ArrayLike | None = ..., third: ArrayLike | None = ..., center_a: ArrayLike = ..., first_a: ArrayLike | None = ..., second_a: ArrayLike | None = ..., third_a: ArrayLike | None = ..., center_b: ArrayLike = ..., first_b: ArrayLike | None = ..., second_b: ArrayLike | None = ..., third_b: ArrayLike | None = ..., distance: float, share: float, name: str = ...) -> Self: ...

class Spherical(Points, Primitive):
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., name: str = ...) -> Self: ...

class Thread(Points, References, Primitive):
    across_a: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    lead: float
    def __init__(self, a: BodyLike, b: BodyLike, *, reference_a: ArrayLike | None = ..., across_a: ArrayLike | None = ..., axis_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., lead: float | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, reference: ArrayLike | None = ..., across: ArrayLike | None = ..., axis: ArrayLike | None = ..., point: ArrayLike = ..., reference_a: ArrayLike | None = ..., across_a: ArrayLike | None = ..., axis_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., lead: float | None = ..., name: str = ...) -> Self: ...

class TranslationMotor(Points, Joint):
    axis_a: Attribute[ArrayLike, Floats]
    displacement: Attribute[Prescribed, Any]
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., displacement: Prescribed = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., axis: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., displacement: Prescribed = ..., name: str = ...) -> Self: ...
    @classmethod
    def of(cls, joint: Joint, *, displacement: Prescribed, name: str = ...) -> Self: ...

class Universal(Points, Axes, Joint):
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., axis: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., name: str = ...) -> Self: ...

class Coupler(Joint):
    @property
    def dependent(self) -> JointCoordinate: ...
    @property
    def independents(self) -> JointCoordinate: ...
    ratio: ArrayLike | float
    offset: float
    polynomial: Attribute[ArrayLike, Floats]
    function: Prescribed | Function
    def __init__(self, dependent: JointCoordinate, independents: JointCoordinate, *, ratio: ArrayLike | float | None = ..., offset: float = ..., polynomial: ArrayLike | None = ..., function: Prescribed | Function | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, dependent: JointCoordinate, *, ratio: ArrayLike | float | None = ..., offset: float = ..., polynomial: ArrayLike | None = ..., function: Prescribed | Function | None = ..., name: str = ...) -> Self: ...
    @property
    def bodies(self) -> tuple[AnyBody, ...]: ...
    @property
    def functions(self) -> list[CoordinateFunction]: ...
    @property
    def plain(self) -> bool: ...
    @property
    def ratios(self) -> list[float]: ...

class CylinderRolling(CylinderContact):
    center_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    first_b: Attribute[ArrayLike, Floats]
    second_b: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    first_a: Attribute[ArrayLike, Floats]
    second_a: Attribute[ArrayLike, Floats]
    third_a: Attribute[ArrayLike, Floats]
    radius: float
    cylinder_radius: float
    inside: bool
    def __init__(self, a: BodyLike, b: BodyLike, *, center_a: ArrayLike = ..., point_b: ArrayLike = ..., first_b: ArrayLike | None = ..., second_b: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., first_a: ArrayLike | None = ..., second_a: ArrayLike | None = ..., third_a: ArrayLike | None = ..., radius: float | None = ..., cylinder_radius: float | None = ..., inside: bool = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, center: ArrayLike = ..., point: ArrayLike = ..., first: ArrayLike | None = ..., second: ArrayLike | None = ..., axis: ArrayLike | None = ..., third: ArrayLike | None = ..., center_a: ArrayLike = ..., point_b: ArrayLike = ..., first_b: ArrayLike | None = ..., second_b: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., first_a: ArrayLike | None = ..., second_a: ArrayLike | None = ..., third_a: ArrayLike | None = ..., radius: float | None = ..., cylinder_radius: float | None = ..., inside: bool = ..., name: str = ...) -> Self: ...

class Dot1(Axes, Primitive):
    value: Attribute[Prescribed, Any]
    def __init__(self, a: BodyLike, b: BodyLike, *, axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., value: Prescribed = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, axis: ArrayLike | None = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., value: Prescribed = ..., name: str = ...) -> Self: ...

class Dot2(Points, Primitive):
    axis_a: Attribute[ArrayLike, Floats]
    value: Attribute[Prescribed, Any]
    def __init__(self, a: BodyLike, b: BodyLike, *, axis_a: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., value: Prescribed = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, axis: ArrayLike | None = ..., point: ArrayLike = ..., axis_a: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., value: Prescribed = ..., name: str = ...) -> Self: ...

class Fixed(Points, Axes, References, Joint):
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike | None = ..., axis: ArrayLike | None = ..., reference: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., name: str = ...) -> Self: ...
    @property
    def frames(self) -> tuple[Any, ...]: ...

class PlaneContact(Points, Primitive):
    normal_b: Attribute[ArrayLike, Floats]
    unilateral: bool
    restitution: float
    kinetic: float
    static: float
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., normal_b: ArrayLike | None = ..., unilateral: bool = ..., restitution: float = ..., kinetic: float = ..., static: float | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., normal: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., normal_b: ArrayLike | None = ..., unilateral: bool = ..., restitution: float = ..., kinetic: float = ..., static: float | None = ..., name: str = ...) -> Self: ...
    @property
    def has_friction(self) -> bool: ...

class Ratchet(Joint):
    @property
    def joint(self) -> Joint: ...
    direction: int
    def __init__(self, joint: JointCoordinate, direction: int = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, joint: JointCoordinate, direction: int = ..., name: str = ...) -> Self: ...
    @property
    def has_friction(self) -> bool: ...

class RollingBallOnCylinder(Joint):
    center_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    radius: float
    cylinder_radius: float
    inside: bool
    slip: bool
    def __init__(self, a: BodyLike, b: BodyLike, *, center_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_b: ArrayLike | None = ..., radius: float | None = ..., cylinder_radius: float | None = ..., inside: bool = ..., slip: bool = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, center: ArrayLike = ..., point: ArrayLike = ..., axis: ArrayLike | None = ..., center_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_b: ArrayLike | None = ..., radius: float | None = ..., cylinder_radius: float | None = ..., inside: bool = ..., slip: bool = ..., name: str = ...) -> Self: ...

class RollingContact(SmoothContact):
    center_a: Attribute[ArrayLike, Floats]
    first_a: Attribute[ArrayLike, Floats]
    second_a: Attribute[ArrayLike, Floats]
    third_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    normal_b: Attribute[ArrayLike, Floats]
    first_b: Attribute[ArrayLike, Floats]
    second_b: Attribute[ArrayLike, Floats]
    semi_axes: Attribute[ArrayLike, Floats]
    tyre_radius: float
    def __init__(self, a: BodyLike, b: BodyLike, *, center_a: ArrayLike = ..., first_a: ArrayLike | None = ..., second_a: ArrayLike | None = ..., third_a: ArrayLike | None = ..., point_b: ArrayLike = ..., normal_b: ArrayLike | None = ..., first_b: ArrayLike | None = ..., second_b: ArrayLike | None = ..., semi_axes: ArrayLike | None = ..., tyre_radius: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, center: ArrayLike = ..., first: ArrayLike | None = ..., second: ArrayLike | None = ..., third: ArrayLike | None = ..., point: ArrayLike = ..., normal: ArrayLike | None = ..., center_a: ArrayLike = ..., first_a: ArrayLike | None = ..., second_a: ArrayLike | None = ..., third_a: ArrayLike | None = ..., point_b: ArrayLike = ..., normal_b: ArrayLike | None = ..., first_b: ArrayLike | None = ..., second_b: ArrayLike | None = ..., semi_axes: ArrayLike | None = ..., tyre_radius: float = ..., name: str = ...) -> Self: ...

class RotationMotor(Points, Axes, References, Joint):
    angle: Attribute[Prescribed, Any]
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., angle: Prescribed = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., axis: ArrayLike | None = ..., reference: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., angle: Prescribed = ..., name: str = ...) -> Self: ...
    @property
    def frames(self) -> tuple[Any, ...]: ...
    @classmethod
    def of(cls, joint: Joint, *, angle: Prescribed, which: int = ..., name: str = ...) -> Self: ...

class Screw(Points, Axes, References, Joint):
    lead: float
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., lead: float | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., axis: ArrayLike | None = ..., reference: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., lead: float | None = ..., name: str = ...) -> Self: ...
    @property
    def frames(self) -> tuple[Any, ...]: ...
    @property
    def travel_per_radian(self) -> float: ...

class SphereContact(Joint):
    center_a: Attribute[ArrayLike, Floats]
    center_b: Attribute[ArrayLike, Floats]
    radius_a: float
    radius_b: float
    normal_b: Attribute[ArrayLike, Floats]
    inside: bool
    restitution: float
    kinetic: float
    static: float
    def __init__(self, a: BodyLike, b: BodyLike, *, center_a: ArrayLike = ..., center_b: ArrayLike = ..., radius_a: float, radius_b: float | None = ..., normal_b: ArrayLike | None = ..., inside: bool = ..., restitution: float = ..., kinetic: float = ..., static: float | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, center: ArrayLike = ..., center_a: ArrayLike = ..., center_b: ArrayLike = ..., radius_a: float, radius_b: float | None = ..., normal_b: ArrayLike | None = ..., inside: bool = ..., restitution: float = ..., kinetic: float = ..., static: float | None = ..., name: str = ...) -> Self: ...
    @property
    def has_friction(self) -> bool: ...

class Stop(Joint):
    @property
    def joint(self) -> Joint: ...
    lower: float
    upper: float
    restitution: float
    def __init__(self, joint: JointCoordinate, lower: float | None = ..., upper: float | None = ..., restitution: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, joint: JointCoordinate, lower: float | None = ..., upper: float | None = ..., restitution: float = ..., name: str = ...) -> Self: ...
    @property
    def geometry(self) -> Any: ...
    @property
    def has_friction(self) -> bool: ...

class Translational(Points, Axes, References, Joint):
    def __init__(self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, point: ArrayLike = ..., axis: ArrayLike | None = ..., reference: ArrayLike | None = ..., point_a: ArrayLike = ..., point_b: ArrayLike = ..., axis_a: ArrayLike | None = ..., axis_b: ArrayLike | None = ..., reference_a: ArrayLike | None = ..., reference_b: ArrayLike | None = ..., name: str = ...) -> Self: ...
    @property
    def frames(self) -> tuple[Any, ...]: ...

class Rope(Joint):
    @property
    def points(self) -> RopePoints: ...
    length: float
    @property
    def always_taut(self) -> bool: ...
    restitution: float
    def __init__(self, points: RopePoints, length: float | None = ..., always_taut: bool = ..., restitution: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, points: RopePoints, length: float | None = ..., always_taut: bool = ..., restitution: float = ..., name: str = ...) -> Self: ...
    @property
    def bodies(self) -> tuple[AnyBody, ...]: ...
    @property
    def has_friction(self) -> bool: ...

class RollingBall(Joint):
    center_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    normal_b: Attribute[ArrayLike, Floats]
    radius: float
    slip: bool
    kinetic: float
    static: float
    restitution: float
    def __init__(self, a: BodyLike, b: BodyLike, *, center_a: ArrayLike = ..., point_b: ArrayLike = ..., normal_b: ArrayLike | None = ..., radius: float | None = ..., slip: bool = ..., kinetic: float | None = ..., static: float | None = ..., restitution: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, center: ArrayLike = ..., point: ArrayLike = ..., normal: ArrayLike | None = ..., center_a: ArrayLike = ..., point_b: ArrayLike = ..., normal_b: ArrayLike | None = ..., radius: float | None = ..., slip: bool = ..., kinetic: float | None = ..., static: float | None = ..., restitution: float = ..., name: str = ...) -> Self: ...
    @property
    def has_friction(self) -> bool: ...
    def rolling(self) -> Iterator[tuple[str, Any]]: ...
    @property
    def unilateral(self) -> bool: ...

class RollingDisc(Joint):
    center_a: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    normal_b: Attribute[ArrayLike, Floats]
    radius: float
    tyre_radius: float
    slip: bool
    kinetic: float
    static: float
    restitution: float
    def __init__(self, a: BodyLike, b: BodyLike, *, center_a: ArrayLike = ..., axis_a: ArrayLike | None = ..., point_b: ArrayLike = ..., normal_b: ArrayLike | None = ..., radius: float | None = ..., tyre_radius: float = ..., slip: bool = ..., kinetic: float | None = ..., static: float | None = ..., restitution: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, center: ArrayLike = ..., axis: ArrayLike | None = ..., point: ArrayLike = ..., normal: ArrayLike | None = ..., center_a: ArrayLike = ..., axis_a: ArrayLike | None = ..., point_b: ArrayLike = ..., normal_b: ArrayLike | None = ..., radius: float | None = ..., tyre_radius: float = ..., slip: bool = ..., kinetic: float | None = ..., static: float | None = ..., restitution: float = ..., name: str = ...) -> Self: ...
    @property
    def has_friction(self) -> bool: ...
    def rolling(self) -> Iterator[tuple[str, Any]]: ...
    @property
    def unilateral(self) -> bool: ...

class RollingEllipsoid(Joint):
    center_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    normal_b: Attribute[ArrayLike, Floats]
    semi_axes: Attribute[ArrayLike, Floats]
    axes_a: Orientation
    slip: bool
    kinetic: float
    static: float
    restitution: float
    def __init__(self, a: BodyLike, b: BodyLike, *, center_a: ArrayLike = ..., point_b: ArrayLike = ..., normal_b: ArrayLike | None = ..., semi_axes: ArrayLike | None = ..., axes_a: Orientation | None = ..., slip: bool = ..., kinetic: float | None = ..., static: float | None = ..., restitution: float = ..., name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: BodyLike, b: BodyLike, *, center: ArrayLike = ..., point: ArrayLike = ..., normal: ArrayLike | None = ..., center_a: ArrayLike = ..., point_b: ArrayLike = ..., normal_b: ArrayLike | None = ..., semi_axes: ArrayLike | None = ..., axes_a: Orientation | None = ..., slip: bool = ..., kinetic: float | None = ..., static: float | None = ..., restitution: float = ..., name: str = ...) -> Self: ...
    @property
    def has_friction(self) -> bool: ...
    def rolling(self) -> Iterator[tuple[str, Any]]: ...
    @property
    def unilateral(self) -> bool: ...

def registered() -> tuple[type[Primitive], ...]: ...

def registered_joints() -> tuple[type[Joint], ...]: ...
