"""Force on a point of one body: constant, a function of time, or of time and state.

f = F             frame="ground"     (1)  [N], conjugate to x_a
f = A(p_a) F      frame="body"       (2)
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from ..plugins import (
    Force,
    Given,
    GivenByScene,
    GivenByState,
    GivenInBody,
    Parameters,
    Point,
    Turn,
    scene_load,
    state_load,
    vector_load,
)

if TYPE_CHECKING:
    from ..hints import Frame, PointMass, VectorLoad


class PointForce(Given, Force):
    """Force on a point of a body.

    Parameters
    ----------
    a : Body
        A rigid body or a point mass.
    force : array_like (3,), ts.Table, or function of t or of (t, state); N
        A function returns a tuple of three. If it calls methods of its argument state, such as `state.angle("hinge")`,
        state is that of the scene, as for `Control`. Otherwise state is an array (13,): position of the point (m),
        Euler parameters, velocity of the point (m/s) and angular velocity (rad/s), ground frame.

    Notes
    -----
    Its power is applied power. The kind of force (vector, function of time, function of state) is fixed when it is
    made; a new one of the same kind may be set.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, 0))
    >>> puck = scene.add_body(mass=2.0, inertia=(1, 1, 1))
    >>> push = scene.add(ts.forces.PointForce(puck, force=(4, 0, 0)))
    >>> solution = ts.simulate(scene, (0, 1))
    >>> print(f"{solution.position(puck)[-1, 0]:.4f} m, {solution.power[-1]:.4f} W")
    1.0000 m, 8.0000 W
    """

    markers = (Point("a"),)
    quantities = MappingProxyType({"force": vector_load})
    loads = sources = ("force",)
    given = "force"

    def __init__(
        self, a: PointMass | str, *, force: VectorLoad | None = None, frame: Frame = "ground", **places: Any
    ) -> None:
        super().__init__(a, None, **places)
        self.take(force, frame, "(Fx, Fy, Fz) in N")

    @classmethod
    def example(cls, rng, a, b):
        """A random force."""
        return cls(a, point_a=rng.normal(size=3), force=rng.normal(size=3))


class _BodyPointForce(GivenInBody, PointForce):
    """In axes of the body."""

    markers = (Point("a"), Parameters("a"))


class _StatePointForce(GivenByState, PointForce):
    """A function of time and state."""

    markers = (Point("a"), Parameters("a"), Turn("a"))
    particles = True
    quantities = MappingProxyType({"force": state_load})


class _ScenePointForce(GivenByScene, PointForce):
    """A function of time and of the state of the scene."""

    quantities = MappingProxyType({"force": scene_load})
