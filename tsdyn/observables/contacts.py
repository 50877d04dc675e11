"""Where surfaces touch, and where they touch at no single point."""

from __future__ import annotations

import numpy as np

from ..jit.kernels import twin
from .diagnostics import marker_jets, starts_of


def touching(packed, member, q):
    """Contact point, m, and unit normal towards a, (k, 3) each in the ground frame; None for what has no contact."""
    for i in range(member.parts.start, member.parts.stop):
        find = getattr(type(packed.constraints[i]), "contact", None)
        if find is not None:
            return tuple(level.T for level in twin(find)(_markers(packed, i, q), packed.parameters[i]))
    return None


def singular_place(packed, q):
    """Name the first constraint whose own singular place is at q (n,), and say what it is; "" elsewhere."""
    known = packed.derived.with_singular_places
    if known is None:
        parts = enumerate(packed.constraints)
        known = packed.derived.with_singular_places = [i for i, part in parts if hasattr(type(part), "singular_place")]
    for i in known:
        part = packed.constraints[i]
        said = twin(type(part).singular_place)(_markers(packed, i, q[None])[:, 0], packed.parameters[i])
        if said:
            return f"{part.name}: {said}"
    return ""


def _markers(packed, i, q):
    """Coordinates (len(x), k) of the markers of a primitive along positions q (k, n)."""
    jets = marker_jets(starts_of(packed), packed.constraints[i], packed.coordinates[i], q, q, q)
    return np.array([np.broadcast_to(c.x, len(q)) for place in jets for c in place])
