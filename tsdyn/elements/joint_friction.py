"""Base of joint friction: laws in proportion to the reaction of their own joint or contact.

    friction on a   = par[-1] times `law` for unit normal load
    par[-1]         = normal_load(x, f, par), f (6,) the force and torque that the constraint exerts

The normal load depends on the multipliers and they on the friction: both are solved for together (friction_solve.py).
Taylor series take two more kernels: `series`, of `law` for par[-1] = 1, and normal_series(x, f, par, k, s), which
returns coefficient k of the normal load from coefficients k of x and f. It may be called twice for an order, each time
with all lower orders known; what it leaves out as negligible, it does so by order zero (normal_series.py).
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Never, Self

import numpy as np

from ..calls import fitting, unknown_argument
from ..errors import InvalidForce
from ..validation import label, not_negative, positive
from .friction_laws import optional, slip_of
from .markers import TURN, Marker, Point, Turn, Vector
from .tolerances import STRIBECK

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from ..hints import AnyBody, Attachment, Floats, Random

AXIS = (Point("a"), Turn("a"), Point("b"), Turn("b"), Vector("a"))


class JointFriction:
    """Mixed in before `Force`: friction that follows from the reaction of a constraint.

    Set `joints` and `markers` (Point a, Turn a, Point b, Turn b, then what the law needs, all of them arguments of the
    constraint), write `law`, linear in par[-1], and `normal_load`, in one file of your own.

    Parameters
    ----------
    joint : constraint
        A joint or contact of the scene; it determines where the friction acts.
    kinetic : float
        Coefficient of friction while sliding.
    static : float, optional
        Coefficient near rest, at least the kinetic one (default).
    slip_velocity : float, m/s, optional
        Regularisation: velocity at which the friction is 71% of its magnitude. Sticking is replaced by slower creep: by
        default 1e-9 m/s, so that a joint under nine tenths of its friction creeps by 2e-7 m in 100 s. Less than
        1e-11 m/s acts as 1e-11 m/s. Explicit methods that are asked for by name, and the Maggi/Kane form, need steps in
        proportion to it where the joint comes to rest: give 1e-3 m/s for them.
    stribeck_velocity : float, m/s, optional
        Velocity at which the excess of the static over the kinetic coefficient has fallen to 37%; by default
        10 slip_velocity, or 0.01 m/s where that is left out.
    preload : float, N
        Normal load in addition to the reaction.
    name : str, optional

    Raises
    ------
    InvalidForce
        If the joint is of another class or isn't in its scene, or a number is negative, not finite or impossible.
    RedundantConstraints
        At the start of a run, if the reaction is not unique.

    Attributes
    ----------
    joints : tuple of classes
        The constraints whose friction it can be.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> block = scene.add_point_mass(mass=1.0)
    >>> table = scene.add(ts.constraints.PlaneContact(block, scene.ground, normal_b=(0, 0, 1), name="table"))
    >>> friction = scene.add(ts.forces.ContactFriction(table, kinetic=0.2, static=0.3))
    >>> isinstance(friction, ts.JointFriction), friction
    (True, <ContactFriction 'ContactFriction(table)'>)
    """

    joints: tuple[type, ...] = ()
    sources = ("kinetic", "static")
    markers: tuple[Marker, ...] = ()
    particles = True
    slips = sharp = True  # at rest, and where a part of the normal load passes zero
    quantities: Mapping[str, Callable[..., Any]] = MappingProxyType(
        {
            "kinetic": not_negative,
            "static": optional(not_negative),
            "slip_velocity": optional(positive),
            "stribeck_velocity": optional(positive),
            "preload": not_negative,
        }
    )

    @fitting
    def __init__(
        self,
        joint: Attachment,
        *,
        kinetic: float,
        static: float | None = None,
        slip_velocity: float | None = None,
        stribeck_velocity: float | None = None,
        preload: float = 0.0,
        name: str = "",
        **geometry: Any,
    ) -> None:
        kind = self._kind()
        name = label(name, kind, InvalidForce)
        if not isinstance(joint, self.joints):
            names = " or ".join(cls.__name__ for cls in self.joints)
            raise InvalidForce(f"{name or kind}: joint must be a {names} of the scene, got {joint!r}.")
        for unknown in geometry.keys() - self.quantities.keys():
            raise unknown_argument(kind, unknown, [*self.quantities, "name"])
        self.__dict__["joint"] = joint
        super().__init__(joint.a, joint.b, self.coordinates, name)
        self.kinetic, self.static, self.preload = kinetic, static, preload
        self.slip_velocity, self.stribeck_velocity = slip_velocity, stribeck_velocity
        for key, value in geometry.items():
            setattr(self, key, value)
        self.check()

    def _untitled(self, bodies):
        return f"{self._kind()}({self.joint.name})"

    @property
    def coordinates(self) -> tuple[Floats, ...]:
        """Where the markers are, (3,) each: where the joint's are."""
        return tuple(
            np.zeros(3) if marker.code == TURN else getattr(self.joint, marker.argument) for marker in self.markers
        )

    def __setattr__(self, name: str, value: Never) -> None:
        """Set an attribute, checked; where it acts is the joint's."""
        if name == "coordinates":
            return
        if name == "joint" or name in [marker.argument for marker in self.markers if marker.code != TURN]:
            raise self.error(f"{self.name}: {name} is that of its joint {self.joint.name!r}; set it there.")
        super().__setattr__(name, value)

    def check(self) -> None:
        """A joint that the scene has, and friction no smaller at rest than sliding."""
        if not self.joint.added:
            raise self.error(f"{self.name}: add its joint {self.joint.name!r} to the scene first.")
        if self.__dict__.get("static") is not None and self.static < self.kinetic:
            raise self.error(
                f"{self.name}: static must be at least kinetic = {self.kinetic:g}, got {self.static:g}; leave it out "
                "where they are the same."
            )

    def parameters(self) -> tuple[Any, ...]:
        """(mu, mu_s, v_s, v_0, preload), then the geometry."""
        static = self.kinetic if self.static is None else self.static
        stribeck = self.stribeck_velocity
        if stribeck is None:
            stribeck = STRIBECK if self.slip_velocity is None else 10.0 * self.slip_velocity
        return self.kinetic, static, stribeck, slip_of(self.slip_velocity), self.preload, *self.geometry()

    def geometry(self) -> tuple[float, ...]:
        """What `law` and `normal_load` need besides, floats."""
        return ()

    def __getattr__(self, name: str) -> Any:
        """The body-frame coordinates of a marker, by its argument: those of the joint."""
        if name in [marker.argument for marker in self.markers] and "joint" in self.__dict__:
            return getattr(self.joint, name)
        return super().__getattr__(name)

    @classmethod
    def example(cls, rng: Random, a: AnyBody, b: AnyBody) -> Self:
        """A random one, on a joint that is added to the scene, regularised over the velocities of a test."""
        kind = cls.joints[0]
        places = {m.argument: rng.normal(size=3) for m in cls.markers if m.code != TURN}
        places |= {m.argument: rng.normal(size=3) for m in kind.markers if m.argument.startswith("axis")}
        joint = a.scene.add(kind(a, b, **places))
        (mu, more), (v0, vs) = rng.uniform(0.5, 1.0, 2), rng.uniform(4.0, 6.0, 2)
        return cls(joint, kinetic=mu, static=mu + more, slip_velocity=v0, stribeck_velocity=vs, **cls.sizes(rng))

    @classmethod
    def sizes(cls, rng: Random) -> dict[str, float]:
        """Random arguments of the geometry, for tests."""
        return {}
