"""A state: what `solution.state` and `solution.at(t)` are, and what a run may start from."""

from typing import NamedTuple

import numpy as np

from .errors import InvalidArgument


class State(NamedTuple):
    """Time, positions, velocities, accelerations and multipliers at one instant."""

    t: float
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    multipliers: np.ndarray


class RememberingState(State):
    """A State that also says what forces remember, so that a run from it goes on counting turns."""

    @classmethod
    def of(cls, memory, *parts):
        """A state with its memory (slots,), or (k, slots) for k states."""
        state = cls(*parts)
        state.memory = memory
        return state

    def _replace(self, **changes):
        return self.of(self.memory, *super()._replace(**changes))


def remembered(state, slots):
    """What forces and constraints remember in a state given to `simulate`: zeros where it doesn't say."""
    memory = getattr(state, "memory", None)
    if memory is None and state is not None and slots:
        raise InvalidArgument(
            "parts of the scene count turns or hold a load, and this state doesn't say how many: give solution.state, "
            "what solution.at(t) returns or what an event function is given, as they are or changed by _replace."
        )
    if memory is None:
        return np.zeros(slots)
    if np.shape(memory) != (slots,):
        raise InvalidArgument(
            f"the state remembers {np.size(memory)} numbers and the scene has {slots}; use a state of this scene."
        )
    return memory
