"""Choice of minimal coordinates: joint coordinates in the order of the joints, then displacements and rotations.

The component of a candidate that is independent of those accepted before is a diagonal entry of Z P Z^T, P the inverse
mass of the motions that are still free. Candidates are examined in batches: those taken in earlier batches are rows of
the sparse saddle-point matrix, those of the same batch pivots of Cholesky's factor of a small Z P Z^T. So the cost is
that of a solution a candidate, and of a factorisation a batch.
"""

import numpy as np

from ..errors import SingularConfiguration
from .tolerances import BATCH, CLEAR, DENSE, HELD, IN_TURN, INDEPENDENT
from .tree_coordinates import of_tree
from .variations import stacked


def chosen(motion, variations):
    """As many independent coordinates as the motion has degrees of freedom, `Variation` each."""
    k, size = motion.freedom, motion.packed.size or 1.0
    if len(variations.joints) == k and _regular(motion, variations.joints, size):
        return list(variations.joints)  # as in trees
    if many := motion.q.size > DENSE:
        found = of_tree(motion, variations)
        if found is not None and _regular(motion, found, size):
            return found
    found = []
    for kind in ("joints", "bodies"):
        if len(found) == k:
            break
        more = getattr(variations, kind)
        if many and kind == "bodies":
            more = sorted(more, key=lambda one: one.length)  # rotations first: errors don't add up along chains
        every = [*found, *more]
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

    A = vstack([motion.H, _rows(motion, every, size)]) @ diags_array(1.0 / motion.root)
    rows = np.sqrt(A.multiply(A).sum(axis=1))
    if not rows.all():
        return False
    try:
        pivots = np.abs(splu((diags_array(1.0 / rows) @ A).tocsc()).U.diagonal())
    except RuntimeError:
        return False
    return bool(pivots.min() > CLEAR * pivots.max())


def _rows(motion, every, size):
    """Z (c, n) of some coordinates, lengths as shares of the size."""
    from scipy.sparse import diags_array

    lengths = np.where([one.length for one in every], size, 1.0)
    return (diags_array(1.0 / lengths) @ stacked(every, motion.q.size)[0]).tocsr()


def _independent(motion, every, given, k, size):
    """Indices of k coordinates at most; the first `given` are taken already."""
    Z = _rows(motion, every, size)
    taken = list(range(given))
    none, free = motion.holding(Z[:0]), motion.holding(Z[:given])
    own = _left(none, Z, np.arange(len(every)))
    weights = Z.multiply(Z) @ (1.0 / motion.root**2)
    own[own <= HELD * weights] = 0.0  # the constraints hold it
    remaining = own if not given else _left(free, Z, np.arange(len(every)))
    least = INDEPENDENT * np.maximum(own, 1e-3 * own.max(initial=0.0))
    while len(taken) < k:
        remaining = np.where(remaining > least, remaining, 0.0)
        remaining[taken] = 0.0
        most = remaining.max(initial=0.0)
        if most == 0.0:
            break
        _take_in_turn(motion, Z, taken, np.flatnonzero(remaining), IN_TURN * IN_TURN * most, least, k)
        if len(taken) < k:
            remaining = _left(motion.holding(Z[taken]), Z, np.arange(len(every)))
    return sorted(taken)


def _left(free, Z, which):
    """Diagonal entries of Z P Z^T of some rows."""
    found = np.zeros(len(which))
    for first in range(0, len(which), BATCH):
        rows = Z[which[first : first + BATCH]]
        found[first : first + BATCH] = rows.multiply(free(rows.T.toarray()).T).sum(axis=1)
    return np.maximum(found, 0.0)


def _take_in_turn(motion, Z, taken, which, share, least, k):
    """Accept candidates in order, each whose independent component exceeds a fraction of the best one's."""
    for first in range(0, len(which), BATCH):
        batch = which[first : first + BATCH]
        rows = Z[batch]
        left = rows @ motion.holding(Z[taken])(rows.T.toarray())
        for i, one in enumerate(batch):
            if len(taken) == k:
                return
            if left[i, i] > max(share, least[one]):
                taken.append(int(one))
                column = left[:, i] / np.sqrt(left[i, i])
                left -= np.outer(column, column)
