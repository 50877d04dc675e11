"""Where surfaces touch, and where they touch at no single point."""

from __future__ import annotations

import numpy as np

from ..elements.bodies import rotation_matrix
from ..elements.markers import POINT
from ..jit.kernels import twin
from ..model.packed import index_of


def touching(packed, member, q):
    """Contact point, m, and unit normal towards a, (k, 3) each in the ground frame; None for what has no contact."""
    for i in range(member.parts.start, member.parts.stop):
        find = getattr(type(packed.constraints[i]), "contact", None)
        if find is not None:
            return tuple(level.T for level in twin(find)(_markers(packed, i, q), packed.parameters[i]))
    if getattr(member.constraint, "rubs", False):  # a point on a plane
        x = _markers(packed, member.parts.start, q)
        return x[:3].T, x[6:9].T
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
    """Coordinates (len(x), k) of the markers of a primitive, Points and Vectors, along positions q (k, n)."""
    part, found = packed.constraints[i], []
    for marker, s in zip(part.markers, packed.coordinates[i], strict=True):
        body, x = part.body_of(marker), np.broadcast_to(s, (len(q), 3))
        if body.dimension:
            at = packed.system.bodies[index_of(packed, body), 0]
            x = rotation_matrix(q[:, at + 3 : at + 7]) @ s if body.dimension == 7 else x
            x = x + q[:, at : at + 3] if marker.code == POINT else x
        found.append(x)
    return np.concatenate(found, axis=1).T
