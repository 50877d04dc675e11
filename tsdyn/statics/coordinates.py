"""Choice of minimal coordinates: joint coordinates in the order of the joints, then displacements and rotations.

Z P Z^T, P the inverse mass of motions that the constraints admit, is a Gram matrix of candidates: its Cholesky factor
shows what of a candidate is left when those taken before it are held.
"""

import numpy as np

from ..errors import SingularConfiguration
from .tolerances import CLEAR, HELD, IN_TURN, INDEPENDENT
from .variations import stacked


def chosen(motion, variations):
    """As many independent coordinates as the motion has degrees of freedom, `Variation` each."""
    k, size = motion.freedom, motion.packed.size or 1.0
    if len(variations.joints) == k and _regular(motion, variations.joints, size):
        return list(variations.joints)  # as in trees
    found = []
    for kind in ("joints", "bodies"):
        if len(found) == k:
            break
        every = [*found, *getattr(variations, kind)]
        order = _independent(motion, every, len(found), k, size)
        found = [every[i] for i in order]
    if len(found) < k:
        raise SingularConfiguration(
            f"linearise: {k} degrees of freedom, of which {len(found)} show in displacements and rotations of bodies: "
            "the constraints are close to a singular configuration."
        )
    return found


def _regular(motion, every, size):
    """Whether as many coordinates as there are degrees of freedom are clearly independent, in O(N)."""
    from scipy.sparse import diags_array, vstack
    from scipy.sparse.linalg import splu

    lengths = np.where([one.length for one in every], size, 1.0)
    A = vstack([motion.H, diags_array(1.0 / lengths) @ stacked(every, motion.q.size)[0]]) @ diags_array(
        1.0 / motion.root
    )
    rows = np.sqrt(A.multiply(A).sum(axis=1))
    if not rows.all():
        return False
    try:
        pivots = np.abs(splu((diags_array(1.0 / rows) @ A).tocsc()).U.diagonal())
    except RuntimeError:
        return False
    return bool(pivots.min() > CLEAR * pivots.max())


def _independent(motion, every, given, k, size):
    """Indices of k coordinates at most; the first `given` are taken already."""
    Z = stacked(every, motion.q.size)[0].toarray()
    Z /= np.where([one.length for one in every], size, 1.0)[:, None]
    W = motion.solve(Z.T, np.zeros((motion.kept.size, len(every))))[0]
    left = Z @ W
    own = np.maximum(np.diagonal(left).copy(), 0.0)
    own[own <= HELD * (Z / motion.root**2 * Z).sum(axis=1)] = 0.0  # the constraints hold it
    remaining, taken = own.copy(), []

    def take(i):
        taken.append(i)
        column = left[:, i] / np.sqrt(remaining[i])
        left[:] -= np.outer(column, column)
        remaining[:] = np.where(remaining > 0.0, np.diagonal(left), 0.0)
        remaining[i] = 0.0

    for i in range(given):
        take(i)
    while len(taken) < k:
        remaining[remaining <= INDEPENDENT * own.max(initial=0.0) * 1e-3] = 0.0
        remaining[remaining <= INDEPENDENT * own] = 0.0
        most = remaining.max(initial=0.0)
        if most == 0.0:
            break
        for i in range(len(every)):
            if len(taken) < k and remaining[i] > IN_TURN * IN_TURN * most:
                take(i)
    return sorted(taken)
