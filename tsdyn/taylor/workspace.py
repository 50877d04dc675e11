"""The Taylor workspace: the series of one step and everything else that the kernels use."""

from typing import NamedTuple

import numpy as np

from ..jit.kernels import loader
from ..model.packed import System
from ..rows.interface import Free
from ..sparse.constraint_graph import Network
from ..workspaces.workspace import Work, plain_context

TOP, ORDERS, NEXT, LOWEST, HIGHEST, REFINED, NUMBERS = range(7)  # of Expansion.order


class Expansion(NamedTuple):
    """The series of a step; orders is what fits, from zero to two above the order of the method."""

    order: np.ndarray  # int64 (6,): TOP of omega', one less than that of r and A; room for; the next step's; bounds;
    # how many orders of lam, from zero on, are refined
    bodies: np.ndarray  # (b + 1, orders, 24)  see series_loops
    constraints: np.ndarray  # each kind's instances; constraint_series.series
    places: np.ndarray  # int64 (kinds, 3): addresses of the loops; where a kind's series begin, floats of an instance
    forces: np.ndarray  # int64 (kinds, 7): address, first of loads, instances, reals each, first in table, in reals;
    # and floats of an instance
    table: np.ndarray  # int64: the bodies of each force
    loads: np.ndarray  # each kind of force's instances
    motions: np.ndarray  # int64 (motions, 3): what runs a motion's program; its place in reals; and in constraints


class SeriesContext(NamedTuple):
    """All that the driver's kernels use."""

    system: System
    work: Work
    network: Network
    free: Free
    expansion: Expansion


def _example():
    """One of the right types."""
    line, whole, table = np.zeros(1), np.zeros(1, np.int64), np.zeros((1, 1), np.int64)
    expansion = Expansion(whole, line, line, table, table, whole, line, table)
    plain = plain_context()
    return SeriesContext(plain.system, plain.work, plain.network, plain.free, expansion)


load_series = loader(_example())
