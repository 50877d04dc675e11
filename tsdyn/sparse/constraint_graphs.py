"""The constraint graphs of a packed scene: built once, with the loops that a kernel needs loaded."""

import numpy as np

from ..elements.element import address
from ..errors import InvalidConstraint
from .constraint_graph import DRIFT
from .graph_builder import build


def graph_of(packed, *columns):
    """The graph of a packed scene with the addresses of these loops, made and loaded once."""
    known = packed.derived
    if columns not in known.graphs:
        if known.graph is None:
            known.graph = build(packed)
        known.graphs[columns] = with_loops(*known.graph, *columns)
    return known.graphs[columns]


def set_redundant(packed, rows):
    """Discard the graphs of a scene; new ones have these redundant rows, int64 (k,), or None.

    Hubs are left whole then: elimination may end with the row of a weld, which can't be left out.
    """
    packed.derived.forget_graphs()
    packed.derived.redundant = rows


def redundant_rows(packed):
    """Redundant rows of a scene's graphs, int64 (k,)."""
    rows = packed.derived.redundant
    return np.zeros(0, np.int64) if rows is None else rows


def with_loops(graph, kinds, *columns):
    """The graph with the addresses of these loops, which are loaded now."""
    table = graph.kinds.copy()
    for i, kind in enumerate(kinds):
        for loop in columns:
            if loop != DRIFT or table[DRIFT][i] != 0:
                table[loop][i] = address(kind.kernels, loop, kind.__name__, InvalidConstraint)
    return graph._replace(kinds=table, friction_solver=np.zeros(1, np.int64))
