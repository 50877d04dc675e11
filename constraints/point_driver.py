"""Point driver: a point of a body follows a prescribed path in the frame of another body.

    e_i.(x_b - x_a) = path_i(t)     (1)  three rows, Dot2; e_i are the axes of body a's frame

Never singular.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..plugins import Joint, Motion, Point, is_data, shown
from .dot2 import Dot2

if TYPE_CHECKING:
    from ..hints import BodyLike, Path


class PointDriver(Joint):
    """Prescribed path of a point of b in the frame of a; three rotations are free.

    Parameters
    ----------
    a, b : Body or ground
        Two different bodies of one scene; a is often the ground.
    path : sequence of three, m
        The coordinates of point_b relative to point_a along the axes of a: one of ts.motions, a function f of time or
        three (f, fd, fdd), data, or a float. Or data of vectors: a ts.Table, a spline of SciPy's, or (t, x) with x (k,
        3).

    Notes
    -----
    Three rows: path[0] to path[2]. `solution.reaction(driver, on=b)` is the driving force.

    Examples
    --------
    The pivot of a pendulum moves on a circle:

    >>> import numpy as np
    >>> import tsdyn as ts
    >>> scene, t = ts.Scene(), ts.motions.time
    >>> bob = scene.add_body(mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0.2, 0, -1), velocity=(0, 0.4, 0))
    >>> path = (0.2 * np.cos(2.0 * t), 0.2 * np.sin(2.0 * t), 0.0)
    >>> pivot = scene.add(ts.constraints.PointDriver(scene.ground, bob, point_b=(0, 0, 1), path=path))
    >>> place = ts.simulate(scene, (0, 1)).state.position(bob, point=(0, 0, 1))
    >>> print(place.round(6) + 0.0)
    [-0.083229  0.181859  0.      ]
    """

    markers = (Point("a"), Point("b"))

    def __init__(self, a: BodyLike, b: BodyLike, *, path: Path | None = None, **places: Any) -> None:
        super().__init__(a, b, **places)
        self.path = path

    def __setattr__(self, name, value):
        """Set an attribute, checked."""
        if name == "path":
            if is_data(value):
                value = Motion.components(value, 3, f"{self.name}: path")
            if not isinstance(value, (tuple, list, np.ndarray)) or len(value) != 3:
                raise self.error(
                    f"{self.name}: path must be three motions or numbers, the coordinates along the axes of a, got "
                    f"{shown(value)}."
                )
            value = tuple(Motion.wrap(part, f"{self.name}: path[{i}]") for i, part in enumerate(value))
        super().__setattr__(name, value)

    def compose(self):
        """Eq. (1)."""
        for axis, value in zip(np.eye(3), self.path, strict=True):
            yield ("path", Dot2(self.a, self.b, axis_a=axis, point_a=self.point_a, point_b=self.point_b, value=value))

    @classmethod
    def example(cls, rng, a, b):
        """A random instance at rest."""
        one, two, path = rng.normal(size=(3, 3))
        return cls(a, b, point_a=one, point_b=two, path=path)
