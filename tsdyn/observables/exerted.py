"""Forces and torques that the constraints and forces of a scene exert, of solutions, states and equilibria alike."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting_methods
from ..errors import InvalidBody, InvalidConstraint
from ..model.handles import handles_of
from ..model.packed import member_of
from .friction_reactions import with_normal_loads
from .reactions import force_reaction, loads_of
from .reactions import reaction as constraint_reaction

if TYPE_CHECKING:
    from ..hints import BodyLike, Floats, Handles, ItemLike


def member(packed, constraint):
    """The `Member` of a constraint of the scene."""
    found = member_of(packed, constraint)
    if found is None:
        raise InvalidConstraint(f"{constraint!r} is not a constraint or force of this solution's scene.")
    return found


def acted(packed, item, on):
    """The body on which the load of an item is asked for: a handle, a name, or None for the item's own choice."""
    if on is None:
        return item.on
    handles = handles_of(packed)
    on = handles.body(on) if isinstance(on, str) else handles.own(on)
    if on is item.a or on is item.b:
        if on.dimension:
            return on
        raise InvalidBody(f"{item.name}: the load on the ground is the opposite of the load on {item.on.name!r}.")
    if getattr(on, "dimension", 0):
        on = handles.body(on)  # refuses one of another scene
    raise InvalidBody(f"{item.name}: on must be one of its bodies, got {on!r}.")


def exerted(motion, item, on):
    """Force and torque (k, 3) of an item along a motion, on a body of it.

    A motion has packed, system, t (k,), q and qd (k, n), multipliers (k, m) and _memory (k, slots).
    """
    item = handles_of(motion.packed).item(item)
    load = loads_of(motion.packed).get(id(item))
    if load is not None:
        return force_reaction(motion, load, acted(motion.packed, item, on))
    return constraint_reaction(motion, member(motion.packed, item), acted(motion.packed, item, on))


@fitting_methods
class Exerting:
    """Mixed into states that know their scene: `packed`, t, q, qd, qdd, multipliers and the `memory` of forces."""

    __slots__ = ()
    packed: Any
    memory: Any
    t: Any
    q: Floats
    qd: Floats
    qdd: Floats
    multipliers: Floats

    @property
    def handles(self) -> Handles:
        """The bodies and joints of the scene."""
        return handles_of(self.packed)

    def reaction(self, item: ItemLike, on: BodyLike | None = None) -> tuple[Floats, Floats]:
        """Force (N) and torque (N m) that a constraint, a joint as a whole, or a force exerts: (3,) each.

        As `Solution.reaction` has them: on a, or b if a is the ground; in the ground frame, the torque about the item's
        first point on that body. A state at k times gives (k, 3).
        """
        packed, levels = self.packed, (self.q, self.qd, self.qdd, self.multipliers)
        t, (q, qd, qdd, lam) = np.atleast_1d(self.t), map(np.atleast_2d, levels)
        memory = with_normal_loads(packed, t, q, qd, qdd, np.atleast_2d(self.memory))
        motion = SimpleNamespace(packed=packed, system=packed.system, t=t, q=q, qd=qd, multipliers=lam, _memory=memory)
        force, torque = exerted(motion, item, on)
        return (force, torque) if np.ndim(self.t) else (force[0], torque[0])
