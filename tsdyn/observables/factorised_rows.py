"""Constraint rows at given positions, factorised."""

from ..elements.loops.body_poses import place_bodies
from ..jit.kernels import kernel
from ..model.equations import set_time
from ..rows.interface import METRIC, evaluate_rows, factorise_rows


@kernel
def factorise_at(graph, s, f, t, q):
    """H, Y and the factors of S at t, q. Return True if S is nonsingular."""
    set_time(s, t)
    place_bodies(graph.bodies, q, f.poses)
    evaluate_rows(graph, s, f, f.rows, t)
    return factorise_rows(graph, s, f, f.rows, t, METRIC)
