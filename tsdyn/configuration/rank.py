"""Redundant rows of Phi_q: detection, and their names."""

import numpy as np

from ..constraints.euler_normalization import EulerNormalization
from ..errors import RedundantConstraints, SingularConfiguration
from ..maths.row_rank import RANK_TOL, farthest_first, singular_values, unit_rows


def check_rank(scene, Phi_q):
    """Refuse dependent rows of Phi_q, by name."""
    m = Phi_q.shape[0]
    if m == 0:
        return
    lengths = np.linalg.norm(Phi_q, axis=1)
    if not lengths.all():
        row = scene.row_names()[int(np.argmin(lengths))]
        raise SingularConfiguration(
            f"the row of {row} in Phi_q is zero in this configuration: the constraint is singular here. "
            "Start from another configuration, or use a constraint that is regular here."
        )
    scaled = Phi_q / lengths[:, None]
    size = singular_values(scaled)
    rank = int((size > RANK_TOL * size[0]).sum())
    if rank == m:
        return
    names, order = scene.row_names(), _pivots(scene, scaled)
    kept, dependent = order[:rank], order[rank:]
    stories, dependent = [], np.sort(dependent)
    every, *_ = np.linalg.lstsq(scaled[kept].T, scaled[dependent].T, rcond=None)
    for row, weights in zip(dependent, every.T, strict=True):
        partners = sorted(kept[np.abs(weights) > 1e-6])
        stories.append(f"  {names[row]} depends on " + (", ".join(names[i] for i in partners[:8]) or "nothing else"))
    raise RedundantConstraints(
        f"{m - rank} of the {m} constraint rows are redundant, Phi_q has rank {rank}:\n"
        + "\n".join(stories)
        + "\nRemove the redundant rows, or use a joint with fewer rows. If the rows are independent elsewhere, this is "
        "a singular configuration: start from another one."
    )


def weakest_row(scene, Phi_q, redundant=0):
    """Name the row of Phi_q nearest to depending on the others; and the share of its smallest singular value.

    So many redundant rows, the nearest ones, are passed over.
    """
    if not (Phi_q.size and np.isfinite(Phi_q).all()):
        return "", 1.0
    scaled = unit_rows(Phi_q)
    size = singular_values(scaled)
    last = -1 - redundant
    return scene.row_names()[_pivots(scene, scaled)[last]], size[last] / size[0]


def _pivots(scene, rows):
    """The rows in an order in which each is the farthest from those before it, the normalisations first.

    Normalisations belong to the bodies: what depends on them is for the user's constraints to mend.
    """
    own = np.array([type(c) is EulerNormalization for c in scene.constraints for _ in range(c.rows)])
    rest, first = np.flatnonzero(~own), np.flatnonzero(own)
    basis = unit_rows(rows[first])  # of different bodies
    left = rows[rest] - (rows[rest] @ basis.T) @ basis
    return np.concatenate((first, rest[farthest_first(left)[0]])).astype(int)
