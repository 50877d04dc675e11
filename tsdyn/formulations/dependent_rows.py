"""Redundant rows of Phi_q at one configuration of a large scene, by sparse factorisation in O(N)."""

import numpy as np

from ..elements.loops.body_poses import place_bodies
from ..jit.kernels import entry, resident
from ..model.derived import Derived
from ..model.equations import set_time
from ..rows.evaluation import run_loops
from ..rows.independent_rows import select
from ..sparse.constraint_graph import REDUCED
from ..sparse.constraint_graphs import network_of
from ..workspaces.tangent_memory import allocate_free
from ..workspaces.workspace import load_parts, parts


@entry
def _choose(context, q, t, share):
    """Choose the rows to drop, those that are left less than a share; how many they are, or -1."""
    c = load_parts(context)
    network, f = c.network, c.free
    f.dropped[0] = 0
    set_time(c.system, t)
    place_bodies(network.bodies, q, f.poses)
    run_loops(network, c.system.reals, REDUCED, f, t, f.b, f.H)
    return f.dropped[0] if select(network, f, f.H, f.Y, f.S, -1, share) else -1


def dependent_rows(packed, q, t, share):
    """Rows of Phi that are left less than a share of their diagonal entries of H W H^T by elimination, int64 (k,).

    None where no choice among them is independent. Normalisations are none of them. See independent_rows.py: of many
    rows the choice is made within blocks, and may have one too many or too few.
    """
    own, known = packed, packed.derived
    if known.dropped is None:
        if known.undropped is None:
            known.undropped = packed._replace(derived=Derived(dropped=np.zeros(0, np.int64)))
        own = known.undropped
    network = network_of(own, REDUCED)
    whole = parts(packed.system._replace(reals=packed.system.reals.copy()), network, q.size)
    free = allocate_free(network, q.size, redundant=True)
    context, *_keep = resident(whole._replace(free=free))
    count = _choose(context, q, t, share)
    return None if count < 0 else np.sort(network.row[free.dropped[1 : 1 + count]])
