"""Mirrored branches of joints: rows that align directions also admit opposed ones; such a start is refused."""

import numpy as np

from ..elements.bodies import IDENTITY, rotation_matrix
from ..errors import InconsistentState
from .motor_starts import demand_turns, elsewhere


def demand_aligned(packed, q, t):
    """Refuse positions q (n,) at t that meet the rows with directions opposed or turns away, by the joint's name."""
    opposed, titles = _opposed(packed, q, t)
    opposed = np.flatnonzero(opposed)
    if opposed.size:
        names = list(dict.fromkeys(titles[i] for i in opposed))
        more = f" and {len(names) - 8} more" if len(names) > 8 else ""
        raise InconsistentState(
            f"{', '.join(names[:8])}{more}: directions that the joint keeps parallel point opposite ways here. Its "
            "rows hold so, too, but it is the mirrored joint. Give one of the axes (or references) the other sign, or "
            "turn a body half a turn." + "".join(f"\n{each}" for each in elsewhere(packed, t, q))
        )
    demand_turns(packed, q, t)


def are_aligned(packed, q, t):
    """Which of many positions (k, n) at t `demand_aligned` lets pass."""
    return ~_opposed(packed, q, t)[0].any(axis=-1)


def _opposed(packed, q, t):
    """Which pairs of directions are opposed at positions q (..., n), and their titles."""
    if packed.derived.aligned is None:
        packed.derived.aligned = _pairs(packed)
    titles, places, directions, moving = packed.derived.aligned
    if not titles:
        return np.zeros((*q.shape[:-1], 0), bool), titles
    if moving:
        directions = directions.copy()
        for i, direction in moving:
            directions[0, i] = direction(t)
    p = np.concatenate((q, np.broadcast_to(IDENTITY, (*q.shape[:-1], 4))), axis=-1)[..., places]
    turned = np.einsum("...skij,skj->...ski", rotation_matrix(p), directions)
    return ~((turned[..., 0, :, :] * turned[..., 1, :, :]).sum(axis=-1) > 0.0), titles


def _pairs(packed):
    """Titles; where the Euler parameters of both bodies are in (q, 1, 0, 0, 0), (2, k, 4); directions (2, k, 3).

    Then the places of first directions that are functions of time, with them.
    """
    starts = {id(body): int(at) + 3 for body, (at, _) in zip(packed.bodies, packed.system.bodies, strict=True)}
    ground = int(packed.system.bodies[:, 1].sum())
    titles, places, directions, moving = [], [], [], []
    for member in packed.members:
        for pair in getattr(member.constraint, "opposed", ()):
            titles.append(member.constraint.title)
            places.append([starts.get(id(body), ground) for body, _ in pair])
            (_, first), (_, second) = pair
            if callable(first):
                moving.append((len(directions), first))
                first = np.zeros(3)  # of another time each time
            directions.append([first, second])
    places = np.array(places, np.int64).reshape(-1, 2).T[..., None] + np.arange(4)
    return titles, places, np.array(directions).reshape(-1, 2, 3).swapaxes(0, 1), moving
