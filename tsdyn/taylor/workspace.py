"""The Taylor workspace: the series of one step and everything else that the kernels use."""

from typing import NamedTuple

import numpy as np

from ..elements.loops.constraint_series import BODY_ROW
from ..jit.kernels import Record, loader, records
from ..model.packed import System
from ..rows.interface import TangentWorkspace
from ..sparse.constraint_graph import ConstraintGraph
from ..workspaces.workspace import Work, plain_context
from .tables import ConstraintSeries, ForceSeries, FrictionSeries, MotionSeries, ReactionSource

# floats of a body in Expansion.low, and where those of its parts begin
LOW, L_R, L_RD, L_OMEGA, L_P = 16, 0, 4, 8, 12


class Orders(Record):
    """Orders of the series: those of omega' are one less than those of r and A; and the time that they are about."""

    top: int  # of omega', in this step
    room: int  # for so many, from zero on
    next: int  # top of the next step
    lowest: int  # bounds of top
    highest: int
    refined: int  # how many orders of lam, from zero on, are refined
    sweeps: int  # how often they are
    time: float  # about which the series are, s


class Expansion(NamedTuple):
    """The series of a step; orders is what fits, from zero to two above the order of the method."""

    order: Orders
    bodies: np.ndarray  # (b + 1, orders, 24)  see series_loops
    low: np.ndarray  # (b, 16)  what r, rd, omega' and p lack to rounding at the start of the step; step_end.py
    low_end: np.ndarray  # (b, 16)  the same at the end of the step tried
    start: np.ndarray  # (b, 4)  p at the start of the step
    low_r2: np.ndarray  # (b, 4)  what r_2 lacks to rounding; coefficients.py
    constraints: np.ndarray  # each kind's instances; constraint_series.series
    places: np.ndarray  # (kinds,) of tables.ConstraintSeries
    forces: np.ndarray  # (kinds,) of tables.ForceSeries
    table: np.ndarray  # int64: the bodies of each force
    loads: np.ndarray  # each kind of force's instances
    motions: np.ndarray  # (motions,) of tables.MotionSeries
    drives: np.ndarray  # (numbers of loads,) of tables.MotionSeries
    frictions: np.ndarray  # (frictions,) of tables.FrictionSeries
    sources: np.ndarray  # of tables.ReactionSource
    kept: np.ndarray  # (m,)  multipliers of the step's start, in scenes with joint friction; joint_friction.py


class Trial(Record):
    """The step that is tried."""

    h: float
    limit: float  # of h, but by the series
    tol: float  # that the step is held to
    own_h: float  # by the tolerance of the run: to go back to when no longer one passes a singular configuration
    own_tol: float
    own_top: int
    highest: int  # order that has been expanded
    share: float  # singularity indicator at the end of the try before; inf for none
    looser: int  # whether longer steps at looser tolerances are tried
    serves: int  # whether the own step is a good one
    failed: int  # Status of the try before
    shorter: int  # times that it was shortened, not to end near a singular configuration
    t1: float  # its end
    last: int  # whether that is the run's
    cut: int  # whether a stop cuts a fixed step
    singular: int  # whether it ends in a singular configuration
    check: int  # address of step_parts.check_laws; 0 where all laws are analytic everywhere
    sharp: int  # whether a force is sharp
    spacing: float  # s, of the places at which laws of users are compared with their series, at most
    rate: float  # 1 + the largest of its start, m/s or rad/s
    left: float  # margin of analyticity of the force laws along the step; 1 where they are analytic everywhere
    hops: int  # in close succession, over places where a law is not analytic
    hopped: float  # time of the last one
    good: float  # share of the step up to which the series of forces are those of their laws


class SeriesContext(NamedTuple):
    """All that the driver's kernels use."""

    system: System
    work: Work
    graph: ConstraintGraph
    tangent: TangentWorkspace
    expansion: Expansion
    trial: Trial


def no_series(orders, bodies, kept=0):
    """An `Expansion` with the series of bodies alone, and room for so many orders; kept: size of that array."""
    count = bodies.size // (orders * BODY_ROW)
    low, start, low_r2 = np.zeros((2, LOW * count)), *np.zeros((2, 4 * count))
    none, kinds = np.zeros(0), (records(kind, []) for kind in (ConstraintSeries, ForceSeries))
    return Expansion(
        Orders(room=orders), bodies, *low, start, low_r2, none, *kinds, np.zeros(0, np.int64), none,
        *(records(kind, []) for kind in (MotionSeries, MotionSeries, FrictionSeries, ReactionSource)), np.zeros(kept),
    )  # fmt: skip


def _example():
    """One of the right types."""
    expansion = no_series(1, np.zeros(1))
    plain = plain_context()
    return SeriesContext(plain.system, plain.work, plain.graph, plain.tangent, expansion, Trial())


load_series = loader(_example())
