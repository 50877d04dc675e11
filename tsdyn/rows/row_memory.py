"""Allocation of the workspace of constraint rows."""

import numpy as np

from ..elements.loops.body_poses import POSE
from ..jit.aligned_arrays import zeros
from ..sparse.elimination import lu_factors
from .reselection import with_reselection
from .row_workspace import Friction, Indicator, Landing, RedundantRows, Rows, Selection, TangentWorkspace
from .tolerances import MOST_ROWS


def allocate_tangent(graph, n, redundant=False, basis=False):
    """Allocate a `TangentWorkspace`; the ground's pose is set once, and a point mass has its orientation.

    Where rows may be `redundant`, there is room to select among all at once, if they aren't too many. A form with a
    basis needs room for its frictions, too.
    """
    nb, m = len(graph.bodies), len(graph.row)
    redundant = redundant or graph.dropped.size > 0
    choosing, left = redundant and m <= MOST_ROWS, m if redundant else 0
    widest = int(np.diff(graph.pattern.starts).max(initial=0))
    poses = zeros((nb + 1) * POSE)
    poses.reshape(-1, POSE)[:, [0, 5, 10, 24]] = 1.0
    tangent = TangentWorkspace(
        poses, allocate_rows(graph), zeros(m), zeros(m), zeros(8 * (nb + 1)), zeros(8 * (nb + 1)), zeros(n),
        zeros(4), Landing(), Selection(), Indicator(), RedundantRows(*(zeros(k * left) for k in (16, 1, 1))),
        *(np.zeros(size, np.int64) for size in (m + 1, m + 1, m + 1, m)),
        zeros(max(widest, m if choosing else 0) ** 2), _allocate_friction(graph, n, basis), np.zeros(2, np.int64),
    )  # fmt: skip
    reset_selection(graph, tangent)
    return with_reselection(graph, tangent) if redundant else tangent


def allocate_rows(graph):
    """Allocate `Rows`."""
    m = len(graph.row)
    return Rows(zeros(16 * m), zeros(16 * m), zeros(graph.pattern.shape[2]))


def _allocate_friction(graph, n, basis):
    k, rows = len(graph.frictions), len(graph.row) + int((graph.normals >= 0).sum())
    m, nb = (len(graph.row), len(graph.bodies)) if k else (0, -1)
    factors = lu_factors(graph.pattern) if k else (zeros(0), zeros(0))
    free = zeros(16 * k), zeros(7 * k), zeros(m), zeros(8 * (nb + 1)), zeros(16 * m), *factors
    if not basis:
        k = n = rows = 0
    matrices = np.zeros((k, n + rows)), np.zeros((k, k)), np.zeros(k, np.int64)
    return Friction(*free, *matrices, np.zeros(2 * (rows + n) + 2 * k if k else 0))


def reset_selection(graph, tangent):
    """Select the rows of the scene's first start again, and forget multipliers and singularity indicators."""
    friction, indicator = tangent.friction, tangent.indicator
    if friction.load.size:
        friction.lam.fill(0.0)
        friction.load.fill(0.0)
    set_selection(tangent, graph.dropped)
    selection = tangent.selection
    selection.weakest, selection.push, selection.twist = 1.0, 0.0, 0.0
    if tangent.redundant[0].size:
        for array in tangent.redundant:
            array.fill(0.0)
    indicator.start = indicator.end = indicator.largest = 0.0


def selection_parts(tangent):
    """The arrays and the records that `reset_selection` sets."""
    friction = tangent.friction
    return [friction.lam, friction.load, tangent.dropped, *tangent.redundant], [tangent.selection, tangent.indicator]


def set_selection(tangent, redundant):
    """Drop these rows, int64 (k,), in the order of the graph."""
    tangent.dropped[0] = count = len(redundant)
    if count:
        tangent.dropped[1 : 1 + count] = redundant


def redundant_of(tangent):
    """Rows that are dropped at present, int64 (k,), in the order of the graph."""
    return tangent.dropped[1 : 1 + tangent.dropped[0]].copy()


def redundancy(graph):
    """Number of redundant rows of a scene, which its number of degrees of freedom depends on."""
    return len(graph.dropped)
