"""The workspace in which rows are evaluated and factorised after a run; one that is idle serves the next call."""

from ..jit.kernels import resident
from ..model.sparse_jacobian import with_short_rows
from ..rows.interface import redundancy
from ..sparse.constraint_graph import REDUCED
from ..sparse.constraint_graphs import graph_of
from ..workspaces.carving import arrays_of
from ..workspaces.workspace import parts
from .tolerances import KEPT_FLOATS


class RowParts:
    """`Parts` of a packed scene with short rows, and their address; one evaluation at a time.

    Parameters
    ----------
    system : System
    graph : ConstraintGraph
    n : int
        Coordinates.
    """

    def __init__(self, system, graph, n):
        self.source, self.graph = system, graph
        self.system = system._replace(reals=system.reals.copy())
        whole = parts(self.system, graph, n)
        self._images = [(array, array.copy()) for array in arrays_of((whole.work, whole.tangent)) if array.size]
        self.address, *self._keep = resident(whole)

    @property
    def size(self):
        """Floats of it."""
        return sum(array.size for array, _ in self._images)

    def enter(self):
        """As if it were new."""
        for array, image in self._images:
            array[...] = image
        self.system.reals[...] = self.source.reals


def taken(packed, n):
    """Return a `RowParts` of a packed scene, as if it were new."""
    system, graph = with_short_rows(packed), graph_of(packed, REDUCED)
    try:
        found = packed.derived.row_parts.pop()
    except IndexError:
        found = None
    if found is None or found.graph is not graph or found.source is not system:
        return RowParts(system, graph, n)
    found.enter()
    return found


def give(packed, found):
    """Take back one that is no longer in use, unless it is large, or has room to select rows anew."""
    if not packed.derived.row_parts and redundancy(found.graph) == 0 and found.size < KEPT_FLOATS:
        packed.derived.row_parts.append(found)
