"""Constant angle between a direction of each body; all other motion is free.

    a.b = cos(angle)     (1)  Dot1

Singular if a and b are parallel (an angle of 0 or pi): use Parallel.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import Joint, Smooth, Vector, number, rotation_matrix, shown
from .dot1 import Dot1

if TYPE_CHECKING:
    from ..hints import BodyLike, Prescribed


class ConstantAngle(Joint):
    """Constant angle between a direction of one body and a direction of another.

    Parameters
    ----------
    angle : float or one of ts.motions, rad; optional
        The angle, between 0 and pi (exclusive: the row is singular there); None takes the angle of the present poses.

    Raises
    ------
    InvalidConstraint
        If an axis is missing or zero, the angle is out of its range, or a body is wrong.

    Notes
    -----
    One row: angle. `ConstantAngle.at(a, b, axis_a=, axis_b=)` takes both directions in the ground frame.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> mast = scene.add_body(mass=1.0, inertia=(1, 1, 1))
    >>> lean = scene.add(ts.constraints.ConstantAngle.at(mast, scene.ground, axis_a=(1, 0, 1), axis_b=(0, 0, 1)))
    >>> print(f"{lean.angle:.4f} rad")
    0.7854 rad
    """

    markers = (Vector("a"), Vector("b"))

    def __init__(self, a: BodyLike, b: BodyLike, *, angle: Prescribed | None = None, **places: Any) -> None:
        super().__init__(a, b, **places)
        if angle is None:
            u, v = (rotation_matrix(body.orientation) @ s for body, s in zip((a, b), self.coordinates, strict=True))
            angle = float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))
        self.angle = angle

    def check(self):
        """Refuse an angle at which the row is singular."""
        angle = number(self.angle(0.0) if isinstance(self.angle, Smooth) else self.angle)
        if not (0.0 < angle < math.pi and abs(math.cos(angle)) < 1.0):
            raise self.error(
                f"{self.name}: angle must lie between 0 and pi rad, got {shown(self.angle)}; to keep two directions "
                "parallel use Parallel."
            )

    def compose(self):
        """Eq. (1)."""
        cosine = np.cos(self.angle) if isinstance(self.angle, Smooth) else math.cos(self.angle)
        yield "angle", Dot1(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b, value=cosine)
