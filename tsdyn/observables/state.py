"""A state: what `solution.state` and `solution.at(t)` are, and what a run may start from."""

from typing import NamedTuple

import numpy as np

from ..errors import InvalidArgument
from .kinematics import Kinematics


class State(NamedTuple):
    """Time, positions, velocities, accelerations and multipliers at one instant."""

    t: float
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    multipliers: np.ndarray


class RememberingState(Kinematics, State):
    """A State that knows the bodies and joints of its scene, and what forces remember, so that a run from it goes on.

    Attributes
    ----------
    memory : ndarray (slots,) or (k, slots)
        What forces remember.
    handles : Handles
    anchor : Anchor
        What the turns of joints are counted from.
    """

    @classmethod
    def of(cls, handles, memory, anchor, *parts):
        """A state, or k states."""
        state = cls(*parts)
        state.handles, state.memory, state.anchor = handles, memory, anchor
        return state

    def _replace(self, **changes):
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
    angles = state.angles if isinstance(state, Kinematics) else np.empty(0)
    if angles.size != prepared.handles.count:
        angles = prepared.handles.angles_at_start(t, q)
    for load in prepared.packed.loads if fresh else ():
        if getattr(load.force, "remembers_angle", False):
            row = prepared.handles.row(load.force.joint, "angle")
            memory[load.slot] = angles[row.first + load.force.which]
    return np.concatenate((angles, memory))
