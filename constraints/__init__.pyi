# Written by tools/stubs.py: do not edit.
from typing import Any, Self

from ..hints import ArrayLike, Attribute, Body, BodyLike, Floats, Joint, Path, Prescribed, Primitive

class AngleDriver(Primitive):
    reference_a: Attribute[ArrayLike, Floats]
    across_a: Attribute[ArrayLike, Floats]
    reference_b: Attribute[ArrayLike, Floats]
    angle: Attribute[Prescribed, Any]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        reference_a: ArrayLike | None = ...,
        across_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        angle: Prescribed = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        reference: ArrayLike | None = ...,
        across: ArrayLike | None = ...,
        reference_a: ArrayLike | None = ...,
        across_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        angle: Prescribed = ...,
        name: str = ...,
    ) -> Self: ...
    @property
    def opposed(self) -> tuple[Any, ...]: ...

class ConstantAngle(Joint):
    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    angle: Attribute[Prescribed, Any]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        angle: Prescribed | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        axis: ArrayLike | None = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        angle: Prescribed | None = ...,
        name: str = ...,
    ) -> Self: ...

class Cylindrical(Joint):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        axis: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> Self: ...

class Distance(Primitive):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    length: Attribute[Prescribed, Any]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        length: Prescribed | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        length: Prescribed | None = ...,
        name: str = ...,
    ) -> Self: ...

class Dot1(Primitive):
    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    value: Attribute[Prescribed, Any]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        value: Prescribed = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        axis: ArrayLike | None = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        value: Prescribed = ...,
        name: str = ...,
    ) -> Self: ...

class Dot2(Primitive):
    axis_a: Attribute[ArrayLike, Floats]
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    value: Attribute[Prescribed, Any]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        axis_a: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        value: Prescribed = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        axis: ArrayLike | None = ...,
        point: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        value: Prescribed = ...,
        name: str = ...,
    ) -> Self: ...

class EulerNormalization(Primitive):
    def __init__(self, a: Body, *, name: str = ...) -> None: ...
    @classmethod
    def at(cls, a: Body, *, name: str = ...) -> Self: ...

class Gear(Primitive):
    axis_a: Attribute[ArrayLike, Floats]
    reference_a: Attribute[ArrayLike, Floats]
    reference_b: Attribute[ArrayLike, Floats]
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    ratio: float
    offset: float
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        axis_a: ArrayLike | None = ...,
        reference_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        ratio: float | None = ...,
        offset: float | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        axis: ArrayLike | None = ...,
        reference: ArrayLike | None = ...,
        point: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        reference_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        ratio: float | None = ...,
        offset: float | None = ...,
        name: str = ...,
    ) -> Self: ...

class Parallel(Joint):
    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        axis: ArrayLike | None = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> Self: ...

class Planar(Joint):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        axis: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> Self: ...

class PlaneContact(Primitive):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    normal_b: Attribute[ArrayLike, Floats]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        normal_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        normal: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        normal_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> Self: ...

class PointDriver(Joint):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    path: Attribute[Path, Any]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        path: Path | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        path: Path | None = ...,
        name: str = ...,
    ) -> Self: ...

class PointOnLine(Joint):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        axis: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> Self: ...

class RackAndPinion(Joint):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    direction_a: Attribute[ArrayLike, Floats]
    reference_b: Attribute[ArrayLike, Floats]
    radius: float
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        direction_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        radius: float | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        axis: ArrayLike | None = ...,
        direction: ArrayLike | None = ...,
        reference: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        direction_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        radius: float | None = ...,
        name: str = ...,
    ) -> Self: ...

class Revolute(Joint):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        axis: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> Self: ...

class Spherical(Primitive):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    def __init__(
        self, a: BodyLike, b: BodyLike, *, point_a: ArrayLike = ..., point_b: ArrayLike = ..., name: str = ...
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        name: str = ...,
    ) -> Self: ...

class Thread(Primitive):
    reference_a: Attribute[ArrayLike, Floats]
    across_a: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    reference_b: Attribute[ArrayLike, Floats]
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    lead: float
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        reference_a: ArrayLike | None = ...,
        across_a: ArrayLike | None = ...,
        axis_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        lead: float | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        reference: ArrayLike | None = ...,
        across: ArrayLike | None = ...,
        axis: ArrayLike | None = ...,
        point: ArrayLike = ...,
        reference_a: ArrayLike | None = ...,
        across_a: ArrayLike | None = ...,
        axis_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        lead: float | None = ...,
        name: str = ...,
    ) -> Self: ...

class TranslationMotor(Joint):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    displacement: Attribute[Prescribed, Any]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        displacement: Prescribed = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        axis: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        displacement: Prescribed = ...,
        name: str = ...,
    ) -> Self: ...
    @classmethod
    def of(cls, joint: Joint, *, displacement: Prescribed, name: str = ...) -> Self: ...

class Universal(Joint):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike | None = ...,
        axis: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        name: str = ...,
    ) -> Self: ...

class Fixed(Joint):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    reference_a: Attribute[ArrayLike, Floats]
    reference_b: Attribute[ArrayLike, Floats]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        reference_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike | None = ...,
        axis: ArrayLike | None = ...,
        reference: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        reference_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> Self: ...
    @property
    def frames(self) -> tuple[Any, ...]: ...

class RotationMotor(Joint):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    reference_a: Attribute[ArrayLike, Floats]
    reference_b: Attribute[ArrayLike, Floats]
    angle: Attribute[Prescribed, Any]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        reference_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        angle: Prescribed = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        axis: ArrayLike | None = ...,
        reference: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        reference_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        angle: Prescribed = ...,
        name: str = ...,
    ) -> Self: ...
    @property
    def frames(self) -> tuple[Any, ...]: ...
    @classmethod
    def of(cls, joint: Joint, *, angle: Prescribed, name: str = ...) -> Self: ...

class Screw(Joint):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    reference_a: Attribute[ArrayLike, Floats]
    reference_b: Attribute[ArrayLike, Floats]
    lead: float
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        reference_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        lead: float | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        axis: ArrayLike | None = ...,
        reference: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        reference_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        lead: float | None = ...,
        name: str = ...,
    ) -> Self: ...
    @property
    def frames(self) -> tuple[Any, ...]: ...
    @property
    def travel_per_radian(self) -> float: ...

class Translational(Joint):
    point_a: Attribute[ArrayLike, Floats]
    point_b: Attribute[ArrayLike, Floats]
    axis_a: Attribute[ArrayLike, Floats]
    axis_b: Attribute[ArrayLike, Floats]
    reference_a: Attribute[ArrayLike, Floats]
    reference_b: Attribute[ArrayLike, Floats]
    def __init__(
        self,
        a: BodyLike,
        b: BodyLike,
        *,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        reference_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> None: ...
    @classmethod
    def at(
        cls,
        a: BodyLike,
        b: BodyLike,
        *,
        point: ArrayLike = ...,
        axis: ArrayLike | None = ...,
        reference: ArrayLike | None = ...,
        point_a: ArrayLike = ...,
        point_b: ArrayLike = ...,
        axis_a: ArrayLike | None = ...,
        axis_b: ArrayLike | None = ...,
        reference_a: ArrayLike | None = ...,
        reference_b: ArrayLike | None = ...,
        name: str = ...,
    ) -> Self: ...
    @property
    def frames(self) -> tuple[Any, ...]: ...

def registered() -> tuple[type[Primitive], ...]: ...

def registered_joints() -> tuple[type[Joint], ...]: ...
