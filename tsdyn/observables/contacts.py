"""Where surfaces touch along a motion."""

from __future__ import annotations

import numpy as np

from ..jit.kernels import twin
from .diagnostics import marker_jets, starts_of


def touching(packed, member, q):
    """Contact point, m, and unit normal towards a, (k, 3) each in the ground frame; None for what has no contact."""
    for i in range(member.parts.start, member.parts.stop):
        part = packed.constraints[i]
        find = getattr(type(part), "contact", None)
        if find is not None:
            jets = marker_jets(starts_of(packed), part, packed.coordinates[i], q, q, q)
            x = np.array([np.broadcast_to(c.x, len(q)) for place in jets for c in place])
            return tuple(level.T for level in twin(find)(x, packed.parameters[i]))
    return None
