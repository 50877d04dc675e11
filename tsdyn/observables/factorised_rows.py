"""Constraint rows at given positions, factorised."""

from ..elements.loops.body_poses import place_bodies
from ..jit.kernels import kernel
from ..model.equations import set_time
from ..rows.evaluation import factorise_rows, run_loops
from ..sparse.constraint_graph import REDUCED


@kernel
def factorise_at(network, s, f, t, q):
    """H, Y and the factors of S at t, q. Return True if S is nonsingular."""
    set_time(s, t)
    place_bodies(network.bodies, q, f.poses)
    run_loops(network, s.reals, REDUCED, f, t, f.b, f.H)
    return factorise_rows(network, s.reals, f, t, f.b, f.H, f.Y, f.S, 0)
