"""Redundant rows of Phi_q at one configuration of a large scene, by sparse factorisation in O(N)."""

import numpy as np

from ..elements.loops.constraint_rows import place_bodies
from ..jit.kernels import entry, resident
from ..model.equations import set_time
from ..model.packed import Derived
from ..rows.constraint_graph import REDUCED, by_lengths
from ..rows.graph_builder import graph_of
from ..rows.interface import allocate_tangent, redundant_of, select_rows
from ..workspaces import load_parts, parts


@entry("pvdd")
def _choose(context, q, t, share):
    """Select redundant rows at q, those with pivots below a share; return their number, or -1."""
    c = load_parts(context)
    graph, f = c.graph, c.tangent
    set_time(c.system, t)
    place_bodies(graph.bodies, q, f.poses)
    return select_rows(graph, c.system, f, t, share)


def dependent_rows(packed, q, t, share):
    """Rows of Phi that are left less than a share of their diagonal entries of H W H^T by elimination, int64 (k,).

    None where no choice among them is independent. Normalisations are not included. See row_selection.py: of many
    rows the choice is made within blocks, and may have one too many or too few.
    """
    own, known = packed, packed.derived
    if known.redundant is None:
        if known.examined is None:
            known.examined = packed._replace(derived=Derived(redundant=np.zeros(0, np.int64)))
        own = known.examined
    graph = by_lengths(packed, graph_of(own, REDUCED))
    whole = parts(packed.system._replace(reals=packed.system.reals.copy()), graph, q.size)
    tangent = allocate_tangent(graph, q.size, redundant=True)
    context, *_keep = resident(whole._replace(tangent=tangent))
    count = _choose(context, q, t, share)
    return None if count < 0 else np.sort(graph.row[redundant_of(tangent)])
