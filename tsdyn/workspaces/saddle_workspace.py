"""The workspace of the saddle-point matrix: blocks of stiffness and damping, factors, derivatives of one instance."""

from typing import NamedTuple

import numpy as np

from ..sparse.saddle_graph import BLOCK, SaddleGraph, no_saddle
from .carving import carve

LOCAL = 14  # coordinates of two bodies


class SaddleWorkspace(NamedTuple):
    """nb bodies, m rows, s unknowns, r rows of the longest constraint; of no size but for implicit methods."""

    graph: SaddleGraph
    K: np.ndarray  # (blocks * 36,)  stiffness, body by body: (r, pi'); body_stiffness.py
    C: np.ndarray  # (blocks * 36,)  damping
    B: np.ndarray  # (nb * 9,)  omega' by pi' at constant rates of chart coordinates; body_stiffness.py
    lower: np.ndarray  # factors; saddle_point.factorise
    upper: np.ndarray
    multipliers: np.ndarray  # (m,)  what the last Newton correction led to; saddle_point.solve
    before: np.ndarray  # (m,)  those of the stage before; stage_equations.py
    a: np.ndarray  # ((nb + 1) * 8,)  accelerations of bodies, the same
    x: np.ndarray  # (s,)  right-hand side and solution, in order of elimination
    r: np.ndarray  # ((nb + 1) * 8,)  tangent part of a vector of chart coordinates
    e: np.ndarray  # ((nb + 1) * 8,)  the same of an error of positions
    loads: np.ndarray  # ((nb + 1) * 8,)  forces on bodies at a stage; stage_equations.py
    z: np.ndarray  # (m,)  normal part of the velocities: xd - Y0 z; stage_equations.py
    stages: np.ndarray  # (p, 3 m)  of a collocation method's p stages: u, z, multipliers; coupled_stages.py
    last: np.ndarray  # (p, 3 m)  those of the step before
    normal: np.ndarray  # (p, m)  multipliers of the normal parts of accelerations
    right: np.ndarray  # (p, s)  right-hand sides, then corrections
    solved: np.ndarray  # (p, s)  corrections, in coefficients of the eigenvectors
    turns: np.ndarray  # (p, (nb + 1) * 4)  d of the chart at each stage
    changes: np.ndarray  # (p, (nb + 1) * 8)  corrections of the accelerations of chart coordinates
    complex_lower: np.ndarray  # (p // 2, 2 size)  factors with complex steps, numbers in pairs
    complex_upper: np.ndarray
    complex_x: np.ndarray  # (2 s,)
    q: np.ndarray  # (14,)  coordinates of an instance's two bodies
    qd: np.ndarray  # (14,)
    zero: np.ndarray  # (14,)  accelerations that its derivatives don't depend on
    R: np.ndarray  # (14,)  generalised forces
    lam: np.ndarray  # (r,)  its multipliers
    X: np.ndarray  # (14, 14)  its derivatives in these coordinates
    Xd: np.ndarray  # (14, 14)
    rows: np.ndarray  # (3 r, 14)  its rows of Phi_q, and what constraint_hessians.loop writes besides
    own: np.ndarray  # int64 (8,)  its table, as if there were no other bodies: coordinate_rows.py


def allocate_saddle(graph=None, coupled=0):
    """Lay it out for a `SaddleGraph`; `coupled` stages are solved at once."""
    wanted, graph = graph is not None, graph or no_saddle()
    nb, s, size = len(graph.body_at), int(graph.pattern.shape[0]), int(graph.pattern.shape[2])
    m, pairs = len(graph.row_at), coupled // 2
    local, most = LOCAL * wanted, int(graph.constraints["rows"].max(initial=0))
    shapes = {
        **dict.fromkeys(("K", "C"), (BLOCK * len(graph.blocks),)),
        "B": (9 * nb,),
        **dict.fromkeys(("lower", "upper"), (size,)),
        "x": (s,),
        **dict.fromkeys(("multipliers", "before", "z"), (m,)),
        **dict.fromkeys(("a", "r", "e", "loads"), (8 * (nb + 1) * wanted,)),
        **dict.fromkeys(("stages", "last"), (coupled, 3 * m)),
        "normal": (coupled, m),
        **dict.fromkeys(("right", "solved"), (coupled, s)),
        "turns": (coupled, 4 * (nb + 1)),
        "changes": (coupled, 8 * (nb + 1)),
        **dict.fromkeys(("complex_lower", "complex_upper"), (pairs, 2 * size)),
        "complex_x": (2 * s if coupled else 0,),
        **dict.fromkeys(("q", "qd", "zero", "R"), (local,)),
        "lam": (most,),
        **dict.fromkeys(("X", "Xd"), (local, local)),
        "rows": (3 * most, local),
    }
    return SaddleWorkspace(graph, **carve(shapes), own=np.array([0, 7, 0, 0, 0, 7, 0, LOCAL], np.int64))
