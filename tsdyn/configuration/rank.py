"""Redundant rows of Phi_q: detection, and their names."""

import numpy as np

from ..constraints.euler_normalization import EulerNormalization
from ..errors import RedundantConstraints
from ..maths.row_rank import farthest_first, rank_of, singular_values, unit_rows
from ..sparse.length_metric import coordinate_scales
from .row_dependence import partners
from .start_violations import refuse_vanished


def check_rank(scene, Phi_q):
    """Refuse dependent rows of Phi_q, by name."""
    Phi_q = Phi_q * coordinate_scales(scene.packed)
    m = Phi_q.shape[0]
    if m == 0:
        return
    lengths = np.linalg.norm(Phi_q, axis=1)
    if not lengths.all():
        refuse_vanished(scene.row_names()[int(np.argmin(lengths))])
    rank = rank_of(Phi_q)
    if rank == m:
        return
    names, order = scene.row_names(), _pivots(scene, unit_rows(Phi_q))
    kept, dropped = order[:rank].tolist(), sorted(order[rank:].tolist())
    stories = [
        f"  {names[row]} depends on " + (", ".join(names[i] for i in sorted(others)[:8]) or "nothing else")
        for row, others in zip(dropped, partners(Phi_q, kept, dropped), strict=True)
    ]
    raise RedundantConstraints(
        f"{m - rank} of the {m} constraint rows are redundant, Phi_q has rank {rank}:\n"
        + "\n".join(stories)
        + "\nRemove the redundant rows, or use a joint with fewer rows. If the rows are independent elsewhere, this is "
        "a singular configuration: start from another one."
    )


def weakest_row(scene, Phi_q, redundant=0):
    """Return the name of the row of Phi_q nearest to dependence, and the smallest singular value over the largest.

    `redundant` rows, those nearest to dependence, are skipped.
    """
    if not (Phi_q.size and np.isfinite(Phi_q).all()):
        return "", 1.0
    scaled = unit_rows(Phi_q * coordinate_scales(scene.packed))
    size = singular_values(scaled)
    last = len(scaled) - 1 - redundant  # there are fewer values where rows are more than coordinates
    return scene.row_names()[_pivots(scene, scaled)[last]], size[last] / size[0]


def _pivots(scene, rows):
    """Return the rows ordered by pivoted QR, normalisations first.

    Normalisations belong to the bodies, so dependence on them is attributed to the user's constraints.
    """
    own = np.array([type(c) is EulerNormalization for c in scene.constraints for _ in range(c.rows)])
    rest, first = np.flatnonzero(~own), np.flatnonzero(own)
    basis = unit_rows(rows[first])  # of different bodies
    left = rows[rest] - (rows[rest] @ basis.T) @ basis
    return np.concatenate((first, rest[farthest_first(left)[0]])).astype(int)
