"""Fixed joint: no relative motion.

    x_a - x_b = 0            (1)  three rows, Spherical
    f_a.b = 0,  g_a.b = 0    (2)  two rows, Parallel
    f_a.g_b = 0              (3)  Dot1

f_a and f_b are the references, made perpendicular to the axes; g = axis x f. The rows also admit half a turn about f, g
or the axis; such a start is refused. Never singular.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

from ..plugins import FramedJoint, Ground, Placing, PointMass, rotation_matrix
from .dot1 import Dot1
from .parallel import Parallel
from .spherical import Spherical

if TYPE_CHECKING:
    from ..hints import ArrayLike, BodyLike

DEFAULT = (0.0, 0.0, 1.0)  # the axis in the frame of a; its choice is arbitrary


class Fixed(FramedJoint):
    """Weld one body to another.

    Parameters
    ----------
    axis_a, axis_b, reference_a, reference_b : array_like (3,), optional
        An axis and a direction not parallel to it, in the body frames, which the joint keeps parallel. Directions that
        aren't given follow from the present poses; without any, the present relative orientation is kept.

    Notes
    -----
    The points coincide. Rows: point[0] to point[2], axis[0], axis[1], turn. `Fixed.at(a, b)` takes the bodies as they
    stand now; the point, in the ground frame, is the centroid of b, or of a where b is the ground, unless `point=` says
    another.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> beam = scene.add_body(mass=2.0, inertia=(1, 1, 1), position=(1, 0, 0))
    >>> clamp = scene.add(ts.constraints.Fixed.at(beam, scene.ground, point=(0, 0, 0)))
    >>> force, torque = ts.simulate(scene, (0, 1)).reaction(clamp)
    >>> print(force[-1].round(6) + 0.0, torque[-1].round(6) + 0.0)
    [ 0.  0. 20.] [  0. -20.   0.]
    """

    @Placing
    def at(cls, a: BodyLike, b: BodyLike | None = None, *, point: ArrayLike | None = None, **arguments: Any) -> Self:
        """Make the joint from points and directions in the ground frame; all are optional."""
        bodies = [body for body in (b, a) if isinstance(body, (PointMass, Ground))]
        if point is None and len(bodies) == 2 and not {"point_a", "point_b"} & arguments.keys():
            point = (bodies[0] if bodies[0].dimension else bodies[1]).position
        if point is not None:
            arguments["point"] = point
        return super().at(a, b, **arguments)

    def _places(self, given):
        """Fill in missing axes from the present poses."""
        axes = [self._place(self.markers[i], DEFAULT if given[i] is None else given[i]) for i in (2, 3)]
        A, B = (rotation_matrix(body.orientation) for body in (self.a, self.b))
        if given[2] is None and given[3] is not None:
            axes[0] = A.T @ (B @ axes[1])
        elif given[3] is None:
            axes[1] = B.T @ (A @ axes[0])
        return super()._places([*given[:2], *axes, *given[4:]])

    def compose(self):
        """Eqs. (1) to (3)."""
        (f_a, _), (_, g_b) = self.frames
        yield "point", Spherical(self.a, self.b, point_a=self.point_a, point_b=self.point_b)
        yield "axis", Parallel(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b)
        yield "turn", Dot1(self.a, self.b, axis_a=f_a, axis_b=g_b)
