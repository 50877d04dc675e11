"""Which forces are not finite, raise an exception or change at once: what a run that ends there can name."""

from typing import NamedTuple

import numpy as np

from ..validation import counted
from .generalised_forces import force_loads
from .raised import raised

FEW = 3  # forces named in a message


class NotFinite(NamedTuple):
    """What there is to say, "" for nothing, and the exception of a user's function that is behind it, or None."""

    said: str
    cause: Exception | None


def not_finite(packed, t, q, qd, slots):
    """Which forces give inf or nan at a state, a `NotFinite`; slots: what forces remember."""
    state = np.array([t]), q[None], qd[None], np.asarray(slots, float)[None]
    with np.errstate(all="ignore"):
        struck = _struck(packed, force_loads(packed.system, *state)[0])
        forces = [load.force for load in packed.loads if _strikes(packed, load, struck, state)]
    found = [force.name for force in forces]
    if not found:
        return NotFinite("", None)
    for force in forces[:FEW]:
        error = raised(packed, force, t, q, qd)
        if error is not None:
            said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
            return NotFinite(f"The function of {force.name!r} raises {said.rstrip('.')}, at t = {t:.9g} s.", error)
    more = f" and {counted(len(found) - FEW, 'other force')}" if len(found) > FEW else ""
    verb = "is" if len(found) == 1 else "are"
    return NotFinite(f"{', '.join(map(repr, found[:FEW]))}{more} {verb} inf or nan at t = {t:.9g} s.", None)


def jumping(packed, t, q, qd, slots, lengths):
    """Names of the forces that change by as much within the shorter one of two lengths (m or rad) on both sides of q.

    Along qd, or all coordinates at rest. A smooth force changes in proportion to the length.
    """
    step = qd / np.abs(qd).max() if qd.any() else np.ones(q.size)
    places = np.array([q + side * length * step for length in lengths for side in (-1.0, 1.0)])
    state = np.full(4, t), places, np.tile(qd, (4, 1)), np.tile(np.asarray(slots, float), (4, 1))
    found = []
    for load in packed.loads:
        with np.errstate(all="ignore"):
            Q = force_loads(packed.system._replace(forces=load.alone), *state)
        near, far = np.abs(Q[1::2] - Q[::2]).max(axis=1)
        if near > 0.5 * far and near > 0.5 * np.abs(Q).max():
            found.append(load.force.name)
    return found


def _struck(packed, Q):
    """The bodies on which the sum of the forces is not finite, by id."""
    bad = ~np.isfinite(Q)
    return {
        id(body) for body, (at, n) in zip(packed.bodies, packed.system.bodies, strict=True) if bad[at : at + n].any()
    }


def _strikes(packed, load, struck, state):
    """Whether a force is not finite; forces on other bodies than those struck aren't evaluated."""
    if not struck & {id(load.force.a), id(load.force.b)}:
        return False
    return not np.isfinite(force_loads(packed.system._replace(forces=load.alone), *state)).all()
