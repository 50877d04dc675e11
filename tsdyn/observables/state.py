"""A state: the type of `solution.state` and `solution.at(t)`, and a possible start of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import InvalidArgument
from .kinematics import Kinematics

if TYPE_CHECKING:
    from ..hints import Floats, Handles


class _Arrays(NamedTuple):
    t: float
    q: Floats
    qd: Floats
    qdd: Floats
    multipliers: Floats


class State(Kinematics["float | Any"], _Arrays):
    """Time, positions, velocities, accelerations and multipliers at one instant.

    Parameters
    ----------
    t : float, s
    q, qd, qdd : ndarray (n,)
    multipliers : ndarray (m,)

    Notes
    -----
    A state that a run hands out (`solution.state`, `solution.at(t)`, what an event is given) knows its scene, so it can
    be asked for the motion of bodies and joints, too.

    Examples
    --------
    A run that stops half-way, and another one that goes on:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> half = ts.simulate(scene, (0, 0.5)).state
    >>> print(f"{half.t} s: {half.position(bob).round(4)} m")
    0.5 s: [ 0.3721  0.     -0.9282] m
    >>> print(ts.simulate(scene, (half.t, 1.0), state=half).state.position(bob).round(4))
    [-0.9889  0.     -0.1483]
    """

    __slots__ = ()

    @property
    def handles(self) -> Handles:
        """The bodies and joints of its scene."""
        raise InvalidArgument(
            "this state is arrays alone and knows no bodies and joints: ask solution.state, solution.at(t), or the "
            "state that an event is given."
        )


class RememberingState(State):
    """A State that knows the bodies and joints of its scene, and what forces remember, so that a run from it goes on.

    Attributes
    ----------
    memory : ndarray (slots,) or (k, slots)
        What forces remember.
    handles : Handles
    anchor : Anchor
        What the turns of joints are counted from.
    """

    handles: Any = None
    memory: Any = None
    anchor: Any = None

    @classmethod
    def of(cls, handles, memory, anchor, *parts):
        """A state, or k states."""
        state = cls(*parts)
        state.handles, state.memory, state.anchor = handles, memory, anchor
        return state

    def _replace(self, **changes: Any) -> RememberingState:
        return self.of(self.handles, self.memory, self.anchor, *super()._replace(**changes))


def remembered(state, prepared, t, q):
    """What a run from a state given to `simulate`, or None, goes on from: joints' angles, then what forces remember."""
    slots, memory = prepared.packed.system.memory.size, getattr(state, "memory", None)
    if state is None and not (slots or prepared.handles.count):
        return np.empty(0)
    if memory is None and state is not None and slots:
        raise InvalidArgument(
            "parts of the scene count turns or hold a load, and this state doesn't say how many: give solution.state, "
            "what solution.at(t) returns or what an event function is given, as they are or changed by _replace."
        )
    fresh = memory is None
    memory = np.zeros(slots) if fresh else memory
    if np.shape(memory) != (slots,):
        raise InvalidArgument(
            f"the state remembers {np.size(memory)} numbers and the scene has {slots}; use a state of this scene."
        )
    angles = state.angles if getattr(state, "anchor", None) is not None else np.empty(0)
    if angles.size != prepared.handles.count:
        angles = prepared.handles.angles_at_start(t, q)
    for load in prepared.packed.loads if fresh else ():
        if getattr(load.force, "remembers_angle", False):
            row = prepared.handles.row(load.force.joint, "angle")
            memory[load.slot] = angles[row.first + load.force.which]
    return np.concatenate((angles, memory))
