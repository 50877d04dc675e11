"""Selection of redundant rows during a run: renewed where the kept rows come close to dependence."""

import math
from typing import NamedTuple

import numpy as np

from ..jit.kernels import ANY, DEBUG, callback, caller, image_of, kernel, loader, long_kernel, vector
from ..sparse.constraint_graph import ConstraintGraph, no_graph
from .evaluation import evaluate_all, evaluate_every_row
from .independent_rows import select, weakest_of_all
from .redundant_rows import keep_every_row, leave_redundant_rows
from .row_workspace import Rows, TangentWorkspace, no_tangent_workspace
from .schur_complement import factorise_selected_rows
from .tolerances import WORSE, ZERO_PIVOT


class Choice(NamedTuple):
    """What `reselect_rows` gets by one address."""

    graph: ConstraintGraph
    tangent: TangentWorkspace


def with_reselection(graph, tangent):
    """The `TangentWorkspace` of a graph with which kernels can reselect rows."""
    if DEBUG:
        tangent.reselection[0] = 1
        return tangent
    words = len(image_of(Choice(graph, tangent)))
    whole = np.zeros(words + 2, np.int64)  # kept alive by its view `reselection`
    tangent = tangent._replace(reselection=whole[words:])
    whole[:words] = image_of(Choice(graph, tangent))
    tangent.reselection[0], tangent.reselection[1] = reselect_rows.address, whole.ctypes.data
    return tangent


load_choice = loader(Choice(no_graph(), no_tangent_workspace()))
CHOOSE = "ppdpppi"
call_choose = caller(CHOOSE)


@kernel
def _choose(graph, reals, f, rows, t, metric):
    """Renew the selection of rows; f.b, H, Y and the factors of S follow it. True if S is nonsingular."""
    # Every row, the dropped ones included, competes
    evaluate_all(graph, reals, f, rows, t)
    found = select(graph, f, rows, f.dropped[0], ZERO_PIVOT)
    leave_redundant_rows(graph, f, f.b, rows.H)
    regular = factorise_selected_rows(graph, f, rows, metric) < 0
    # The new pivots are what later ones are measured by
    if found and regular:
        f.selection.weakest = weakest_of_all(graph, rows.S)
    return regular


@callback(CHOOSE)
def reselect_rows(choice, reals, t, H, Y, S, metric):
    """Call `_choose` by address, 1 or 0: few scenes need it, and its code is as long as all other row code."""
    c = load_choice(choice)
    graph, f = c.graph, c.tangent
    m, size = graph.row.size, graph.pattern.shape[2]
    rows = Rows(vector(H, 16 * m), vector(Y, 16 * m), vector(S, size))
    return 1 if _choose(graph, vector(reals, ANY), f, rows, t, metric) else 0


if DEBUG:
    _reselect_by_address = _choose
else:

    @kernel
    def _reselect_by_address(graph, reals, f, rows, t, metric):
        return call_choose(f.reselection[0], f.reselection[1], reals, t, rows.H, rows.Y, rows.S, metric) != 0


@kernel
def doubt_selection(f):
    """Request a new selection of rows at the next chart."""
    f.selection.weakest = math.inf


@kernel
def selection_serves(graph, f, rows):
    """Return True if the selected rows are nearly as independent as at their best, judged by the factors of S.

    Another selection is also asked for, once, before a configuration would pass for one near a singular one.
    """
    if f.dropped[0] == 0:
        return True
    share, near = weakest_of_all(graph, rows.S), WORSE * f.indicator.largest
    f.selection.weakest = max(f.selection.weakest, share)  # a selection next to a singular configuration is no measure
    return share >= WORSE * f.selection.weakest and not share < near <= f.selection.weakest


@long_kernel
def factorise_rows(graph, system, f, rows, t, metric):
    """Y = W H^T and the factors of S = H W H^T, after `evaluate_rows`; return True if S is nonsingular.

    metric is DYNAMICS or METRIC. Where the kept rows come close to dependence, the selection of redundant rows is
    renewed, and f.b and H are those of the new one.
    """
    regular = factorise_selected_rows(graph, f, rows, metric) < 0
    if f.dropped[0] == 0 or f.reselection[0] == 0 or (regular and selection_serves(graph, f, rows)):
        return regular  # rows may be left out for a moment of a scene that has no redundant ones
    return _reselect_by_address(graph, system.reals, f, rows, t, metric)


@kernel
def select_rows(graph, system, f, t, least):
    """Select redundant rows at the poses: those whose pivots of S, as a share of the diagonal, are below `least`.

    Returns their number, or -1 if no independent selection was found. H is without them.
    """
    evaluate_every_row(graph, system, f, f.rows, t)
    keep_every_row(f)
    found = select(graph, f, f.rows, -1, least)
    leave_redundant_rows(graph, f, f.b, f.rows.H)
    return f.dropped[0] if found else -1
