"""A start that a plan knows: of a scene while it has the same arrays, of a state while it has the same bits."""

from typing import NamedTuple

import numpy as np

from ..observables.kinematics import Anchor
from ..observables.state import RememberingState, State, remembered

FLOAT, STATES = np.dtype(float), (State, RememberingState)


class Start(NamedTuple):
    """A start that has been checked and projected."""

    given: object  # q, qd of the scene's bodies, which the scene keeps as long as they are; None for a state
    bits: tuple  # of a state
    t: float
    remembered: np.ndarray
    q: np.ndarray
    qd: np.ndarray


def bits_of(state, prepared, t):
    """All that a run from a state knows of it, as bytes; None for a state of another kind."""
    if type(state) not in STATES:
        return None
    q, qd, memory = state.q, state.qd, getattr(state, "memory", None)
    if not (_is_plain(q) and _is_plain(qd)):
        return None
    if prepared.remembers:
        return (*_turns_of(state, prepared, t), q.tobytes(), qd.tobytes())
    if memory is not None and not (_is_plain(memory) and memory.size == 0):
        return None
    return q.tobytes(), qd.tobytes()


def _turns_of(state, prepared, t):
    """What a state says of joints and forces beside positions and velocities."""
    if type(state) is RememberingState and state.handles is prepared.handles and _is_plain(state.memory):
        anchor = state.anchor
        if type(anchor) is Anchor and type(anchor.h) is float and all(map(_is_plain, (anchor.angles, *anchor.levels))):
            return state.memory.tobytes(), anchor.h, *(array.tobytes() for array in (anchor.angles, *anchor.levels))
    return (remembered(state, prepared, t, state.q).tobytes(),)


def _is_plain(array):
    return type(array) is np.ndarray and array.dtype is FLOAT and array.ndim == 1
