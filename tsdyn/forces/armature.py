"""Armature: inertia of a joint coordinate, such as that of the rotor of a geared motor.

    T = I (ratio cd)^2 / 2                           (1)  [J]  c: the angle or the displacement of the joint
    load on the coordinate = -I ratio^2 cdd          (2)  [N m] or [N]

The rotor turns about the axis of the joint, carried by none of the bodies: (1) has no gyroscopic terms, and is no
momentum of the bodies. sqrt(I) |ratio| c is the inertia row of the solver.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from ..constraints.angle_term import AngleTerm
from ..constraints.displacement_term import DisplacementTerm
from ..constraints.revolute import Revolute
from ..plugins import Force, InvalidForce, JointLoad, Turn, angles, displacements, finite, not_negative, stop_waiting

if TYPE_CHECKING:
    from ..hints import Joint
    from ..plugins import Primitive


class _AngleInertia(AngleTerm):
    """The row of an angle, whose turns don't matter."""

    summed, memory, remember = False, 0, None

    def parameters(self):
        """(sqrt(I) |ratio|, no offset, no turn)."""
        return self.ratio, 0.0, 0.0


class _TravelInertia(DisplacementTerm):
    """The row of a displacement."""

    summed = False


class Armature(JointLoad, Force):
    """Inertia of a joint coordinate: the rotor of a geared motor, or the mass of a linear drive.

    Parameters
    ----------
    joint : Joint
        Of the scene, with an angle or a displacement: Revolute, Translational, Cylindrical, Screw, Universal, ...
    inertia : float, kg m^2, or kg for a displacement
        Of the rotor, about its own axis.
    ratio : float
        Turns of the rotor for one of the joint; the inertia felt at the joint is inertia ratio^2.
    which : int
        Index of the coordinate, of a joint with several: angles first, then displacements.

    Raises
    ------
    InvalidForce
        If the joint has no such coordinate or isn't in the scene, the inertia is negative, or the ratio is zero.

    Notes
    -----
    Its kinetic energy inertia (ratio rate)^2 / 2 counts in `solution.kinetic_energy`. It is the `armature` of MuJoCo
    and of Pinocchio: the rotor has no gyroscopic effect, and no part in momentum. `solution.reaction(armature, on=b)`
    is the load -inertia ratio^2 (acceleration of the coordinate) that it exerts. Equilibria don't depend on it.

    Examples
    --------
    A torque of 6 N m accelerates a wheel of 2 kg m^2 through a gear of 10 to 1, with a rotor of 0.01 kg m^2:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> wheel = scene.add_body(mass=1.0, inertia=(1, 1, 2))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1)))
    >>> rotor = scene.add(ts.forces.Armature(hinge, inertia=0.01, ratio=10.0))
    >>> torque = scene.add(ts.forces.Torque(wheel, torque=(0, 0, 6.0)))
    >>> print(f"{ts.simulate(scene, (0, 1)).state.angle_rate(hinge):.6f} rad/s")
    2.000000 rad/s
    """

    markers = (Turn("a"), Turn("b"))
    particles = True
    memory, remember = 0, None
    adds_inertia = True
    loads = ()
    quantities = MappingProxyType({"inertia": not_negative, "ratio": finite})
    coordinate = "an angle or a displacement"
    kind_of_example = Revolute

    def __init__(self, joint: Joint, *, inertia: float, ratio: float = 1.0, which: int = 0, name: str = "") -> None:
        self._join(joint, which, name)
        self.inertia, self.ratio = inertia, ratio

    @staticmethod
    def geometries(joint):
        """Angles, then displacements."""
        return [*angles(joint), *displacements(joint)]

    @staticmethod
    def directions(geometry):
        """None."""
        return ()

    def check(self):
        """A joint that the scene has, and a ratio."""
        self._demand_added(self.joint)
        if self.ratio == 0.0:
            raise InvalidForce(f"{self.name}: ratio must not be zero; leave the armature out, or set inertia=0.")

    def parameters(self):
        """None: it is no force."""
        return ()

    @property
    def inertia_row(self) -> Primitive:
        """The coordinate times sqrt(I) |ratio|."""
        own, other, *places = self.geometry
        kind = _AngleInertia if self.which < len(angles(self.joint)) else _TravelInertia
        given = dict(zip((marker.argument for marker in kind.markers), places, strict=True))
        row = kind(own, other, ratio=float(np.sqrt(self.inertia) * abs(self.ratio)), **given, name=self.name)
        stop_waiting(row)
        return row

    @staticmethod
    def law(x, xd, par, t, out):
        """None: the inertia is in the mass matrix."""
        for i in range(6):
            out[i] = 0.0 * xd[i]

    @staticmethod
    def series(x, xd, par, k, s, out):
        """None."""

    @classmethod
    def example(cls, rng, a, b):
        """On a hinge that is added to the scene."""
        joint = Revolute(a, b, axis_a=rng.normal(size=3), axis_b=rng.normal(size=3))
        return cls(a.scene.add(joint), inertia=rng.uniform(0.5, 2.0), ratio=rng.uniform(1.0, 2.0))
