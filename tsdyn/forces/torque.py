"""Torque on one body: constant, a function of time, or of time and state.

n = N             frame="ground"     (1)  [N m], conjugate to the rotation of a
n = A(p_a) N      frame="body"       (2)
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from ..plugins import (
    Force,
    Given,
    GivenByScene,
    GivenByState,
    GivenInBody,
    Parameters,
    Point,
    Turn,
    given_series,
    scene_load,
    state_load,
    vector_load,
)

if TYPE_CHECKING:
    from ..hints import Body, Frame, VectorLoad


class Torque(Given, Force):
    """Torque on a rigid body.

    Parameters
    ----------
    torque : array_like (3,), ts.Table, or function of t or of (t, state); N m
        A function returns a tuple of three; state is as for PointForce, the array (13,) with the position (m) and
        velocity (m/s) of the centroid.

    Notes
    -----
    Its power is applied power. A new torque of the same kind may be set, as for PointForce.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> rotor = scene.add_body(mass=1.0, inertia=(1, 1, 2))
    >>> drive = scene.add(ts.forces.Torque(rotor, torque=(0, 0, 6), frame="body"))
    >>> solution = ts.simulate(scene, (0, 1))
    >>> print(f"{solution.angular_velocity(rotor)[-1, 2]:.4f} rad/s")
    3.0000 rad/s
    """

    markers = (Turn("a"),)
    quantities = MappingProxyType({"torque": vector_load})
    loads = sources = ("torque",)
    given = "torque"

    def __init__(
        self, a: Body | str, *, torque: VectorLoad | None = None, frame: Frame = "ground", name: str = ""
    ) -> None:
        super().__init__(a, None, name=name)
        self.take(torque, frame, "(Nx, Ny, Nz) in N m")

    @classmethod
    def example(cls, rng, a, b):
        """A random torque."""
        return cls(a, torque=rng.normal(size=3))


class _BodyTorque(GivenInBody, Torque):
    """In axes of the body."""

    markers = (Turn("a"), Parameters("a"))


class _StateTorque(GivenByState, Torque):
    """A function of time and state."""

    markers = (Point("a"), Parameters("a"), Turn("a"))
    first = 7

    @staticmethod
    def series(x, xd, par, k, s, out):
        """The vector in rows 0 to 2, a torque."""
        out[7], out[8], out[9] = given_series(x, par, k, s)

    quantities = MappingProxyType({"torque": state_load})


class _SceneTorque(GivenByScene, Torque):
    """A function of time and of the state of the scene."""

    turns = True
    quantities = MappingProxyType({"torque": scene_load})
