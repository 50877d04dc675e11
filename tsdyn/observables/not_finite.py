"""Which forces are not finite: what a run that ends there can name."""

import numpy as np

from ..validation import counted
from .generalised_forces import force_loads

FEW = 3  # forces named in a message


def not_finite(packed, t, q, qd, slots):
    """Say which forces give inf or nan at a state, "" for none; slots: what forces remember."""
    state = np.array([t]), q[None], qd[None], np.asarray(slots, float)[None]
    with np.errstate(all="ignore"):
        struck = _struck(packed, force_loads(packed.system, *state)[0])
        found = [load.force.name for load in packed.loads if _strikes(packed, load, struck, state)]
    if not found:
        return ""
    more = f" and {counted(len(found) - FEW, 'other force')}" if len(found) > FEW else ""
    verb = "is" if len(found) == 1 else "are"
    return f"{', '.join(map(repr, found[:FEW]))}{more} {verb} inf or nan at t = {t:.9g} s."


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
