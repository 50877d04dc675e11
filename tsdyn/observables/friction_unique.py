"""Refusal of joint friction that depends on a reaction which redundant constraints leave undetermined."""

import numpy as np

from ..errors import RedundantConstraints
from ..formulations.friction_loads import normal_load
from ..jit.kernels import entry, resident, stack
from ..rows.interface import count_self_stresses, redundancy, self_stress
from ..sparse.constraint_graph import REDUCED
from ..sparse.constraint_graphs import graph_of
from ..workspaces.workspace import load_parts, parts
from .tolerances import NO_STRESS
from .uniqueness import find_rows


@entry
def _free_loads(context, t, q, whole, out):
    """out (frictions,): the largest normal load in a unit self-stress."""
    c = load_parts(context)
    graph, s, f = c.graph, c.system, c.tangent
    reaction, none, found = stack(6), stack(7), stack(7)
    find_rows(graph, s, f, q, t, whole)
    for d in range(count_self_stresses(f)):
        largest = self_stress(graph, f, whole, d)
        for i in range(out.size):
            friction = graph.frictions[i]
            for c in range(6):
                reaction[c] = 0.0
            normal_load(s, friction, q, q, t, 0, reaction, none)
            for j in range(friction.first, friction.first + friction.count):
                e, side = graph.friction_rows[j]
                at = 16 * e + 8 * side
                for c in range(3):
                    reaction[c] -= whole[at + c] * f.b[e] / largest
                    reaction[3 + c] -= whole[at + 4 + c] * f.b[e] / largest
            normal_load(s, friction, q, q, t, 0, reaction, found)
            out[i] = max(out[i], abs(found[0] - none[0]))


def demand_unique(packed, q, t):
    """Raise RedundantConstraints if a friction depends on a reaction that isn't unique at q."""
    graph = graph_of(packed, REDUCED)
    if not (redundancy(graph) and len(graph.frictions)):
        return
    system = packed.system._replace(reals=packed.system.reals.copy())
    context, *_keep = resident(parts(system, graph, q.size))
    free = np.zeros(len(graph.frictions))
    _free_loads(context, t, q, np.zeros(16 * len(graph.row)), free)
    wrong = [load.force for load in packed.loads if load.normal >= 0 and free[load.normal] > NO_STRESS]
    if wrong:
        names = ", ".join(force.name for force in wrong)
        joints = ", ".join(force.joint.name for force in wrong)
        raise RedundantConstraints(
            f"{names}: the normal load depends on a reaction of {joints} that is not unique, since constraint rows are "
            "redundant (statically indeterminate).\nUse joints with fewer rows, so that the reaction is unique "
            "(scene.mobility() names the rows), or remove the part of the friction that depends on it."
        )
