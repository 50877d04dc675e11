"""The workspace in which a start is checked; one that is idle serves the next start of the scene."""

import numpy as np

from ..jit.kernels import resident
from ..model.lengths import is_small
from ..rows.interface import allocate_tangent, reset_selection, selection_parts, with_reselection
from ..sparse.length_metric import are_unequal, by_lengths
from ..workspaces.carving import words
from ..workspaces.workspace import parts
from .start_kernels import StartParts
from .tolerances import KEPT_FLOATS, ROUNDING


class StartWorkspace:
    """System, scratch memory and address of what the kernels of a start use; one start at a time.

    Parameters
    ----------
    packed : Packed
    graph : ConstraintGraph
    n : int
        Coordinates.
    """

    def __init__(self, packed, graph, n):
        self.graph = graph
        own = packed.system._replace(reals=packed.system.reals.copy())
        whole = parts(own, graph, n)
        if packed.derived.redundant is not None:
            whole = whole._replace(tangent=allocate_tangent(graph, n, redundant=True))
        self.reals, self.tangent, self.work, self.rates = own.reals, whole.tangent, whole.work, np.zeros(len(graph.row))
        measured = whole._replace(graph=by_lengths(packed, graph))
        if packed.derived.redundant is not None:  # rows are selected anew in the same metric
            measured = measured._replace(tangent=with_reselection(measured.graph, whole.tangent))
        self.unequal = are_unequal(packed.system)
        self.address, *self._keep = resident(StartParts(whole, measured, np.array([self.unequal], np.int64)))
        rigid = graph.bodies[graph.bodies[:, 1] == 7, 0]
        self.at, self.first_parameters = rigid[:, None] + np.arange(3, 7), rigid + 3  # Euler parameters

    def enter(self, reals, size, q, tol):
        """As if it were new, for the numbers and size of a system and a start that is checked to a tolerance."""
        tangent, control = self.tangent, self.work.control
        for array in (self.work.q.base, tangent.b, tangent.gamma, tangent.Z, tangent.a):
            array.fill(0.0)
        tangent.landing.clear()
        reset_selection(self.graph, tangent)
        self.reals[...] = reals
        control.u_tol, control.size = tol, size
        far = np.abs(q)
        if is_small(size):
            far[self.at] *= size
        control.floor = ROUNDING * (size + far.max())

    def entered(self):
        """The arrays that `enter` sets but for reals."""
        tangent = self.tangent
        arrays, records = selection_parts(tangent)
        arrays += [self.work.q.base, tangent.b, tangent.gamma, tangent.Z, tangent.a]
        return [*arrays, *map(words, (tangent.landing, *records))]


def taken(packed, graph, n):
    """Return a `StartWorkspace` of a packed scene: an idle one of this graph, or a new one."""
    try:
        found = packed.derived.start_workspaces.pop()
    except IndexError:
        found = None
    return found if found is not None and found.graph is graph else StartWorkspace(packed, graph, n)


def give(packed, workspace):
    """Take back a workspace that is no longer in use, unless it is large."""
    small = workspace.tangent.rows.S.size + workspace.tangent.rows.H.size < KEPT_FLOATS
    if small and packed.derived.redundant is None and not packed.derived.start_workspaces:
        packed.derived.start_workspaces.append(workspace)
