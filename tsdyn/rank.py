"""Rows of Phi_q that depend on each other, and directions without inertia: found, and named."""

import numpy as np

from .bodies import transform_g
from .constraints.euler_normalization import EulerNormalization
from .errors import RedundantConstraints, SingularConfiguration
from .evaluate import mass_matrix

CLEAR = 1e-3  # far above RANK_TOL: what passes needs no singular values
RANK_TOL = 1e-7  # of the singular values of Phi_q, its rows scaled to unit length; charts work with their squares


def independent(Phi_q):
    """Whether the rows, scaled to unit length, are far from depending on each other; False where that is not certain.

    Singular values above CLEAR of the largest: the squares of all, less that of CLEAR of a bound on the largest, are
    still those of a positive definite matrix.
    """
    gram = Phi_q @ Phi_q.T
    length = np.sqrt(gram.diagonal())
    if not length.all():
        return False
    gram /= length * length[:, None]
    gram.flat[:: len(gram) + 1] -= CLEAR**2 * np.abs(gram).sum(axis=1).max(initial=0.0)
    try:
        np.linalg.cholesky(gram)
    except np.linalg.LinAlgError:
        return False
    return True


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
    size = np.linalg.svd(scaled, compute_uv=False)
    rank = int((size > RANK_TOL * size[0]).sum())
    if rank == m:
        return
    names, order = scene.row_names(), _pivots(scene, scaled)
    kept, dropped = order[:rank], order[rank:]
    stories = []
    for row in sorted(dropped):
        weights, *_ = np.linalg.lstsq(scaled[kept].T, scaled[row], rcond=None)
        partners = sorted(kept[np.abs(weights) > 1e-6])
        stories.append(f"  {names[row]} depends on " + (", ".join(names[i] for i in partners[:8]) or "nothing else"))
    raise RedundantConstraints(
        f"{m - rank} of the {m} constraint rows are redundant, Phi_q has rank {rank}:\n"
        + "\n".join(stories)
        + "\nRemove the rows that say nothing new, or use a joint with fewer rows. Rows that are independent elsewhere "
        "make this a singular configuration: start from another one."
    )


def check_inertia(scene, system, q, Phi_q):
    """Refuse a direction that the constraints leave free and that carries no inertia, by body and axis."""
    J = system.inertia[system.bodies[:, 1] == 7]
    if not (np.linalg.eigvalsh(J.reshape(-1, 3, 3))[:, 0] <= 1e-12 * np.abs(J).max(axis=1)).any():
        return
    free = np.linalg.svd(Phi_q)[2][Phi_q.shape[0] :].T
    reduced = free.T @ mass_matrix(system, q) @ free
    scale = 1.0 / np.sqrt(np.maximum(np.diag(reduced), 1e-300))  # heavy and light bodies may be worlds apart
    size, ways = np.linalg.eigh(reduced * scale[:, None] * scale)
    if size.size == 0 or size[0] > 1e-12:
        return
    change = free @ (scale * ways[:, 0])
    turns = [
        2.0 * transform_g(q[at + 3 : at + 7]) @ change[at + 3 : at + 7] if length == 7 else np.zeros(3)
        for at, length in system.bodies
    ]
    worst = int(np.argmax([np.linalg.norm(turn) for turn in turns]))
    axis = np.round(turns[worst] / np.linalg.norm(turns[worst]), 3) + 0.0
    raise SingularConfiguration(
        f"{scene.bodies[worst].name}: turning about the axis {axis} of its frame is free and carries no inertia, so "
        "the accelerations are not determined. Give it inertia about that axis, or add the constraint that holds it."
    )


def weakest_row(scene, Phi_q, redundant=0):
    """Name the row of Phi_q nearest to depending on the others; and the share of its smallest singular value.

    So many redundant rows, the nearest ones, are passed over.
    """
    if not (Phi_q.size and np.isfinite(Phi_q).all()):
        return "", 1.0
    scaled = Phi_q / np.maximum(np.linalg.norm(Phi_q, axis=1), 1e-300)[:, None]
    size = np.linalg.svd(scaled, compute_uv=False)
    last = -1 - redundant
    return scene.row_names()[_pivots(scene, scaled)[last]], size[last] / size[0]


def _pivots(scene, rows):
    """The rows in an order in which each is the farthest from those before it, the normalisations first.

    Normalisations belong to the bodies: what depends on them is for the user's constraints to mend.
    """
    from scipy.linalg import qr  # imported here: it would double the time of `import tsdyn`

    own = np.array([type(c) is EulerNormalization for c in scene.constraints for _ in range(c.rows)])
    rest, first = np.flatnonzero(~own), np.flatnonzero(own)
    basis = rows[first] / np.maximum(np.linalg.norm(rows[first], axis=1), 1e-300)[:, None]  # of different bodies
    left = rows[rest] - (rows[rest] @ basis.T) @ basis
    return np.concatenate((first, rest[qr(left.T, mode="economic", pivoting=True)[2]])).astype(int)
