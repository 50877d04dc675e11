"""Projection of each lane onto the constraint manifold, as formulations/projection.py has it for one case.

A lane that has landed is left as it is while others are still corrected, so none depends on its neighbours.
"""

import math

from ..elements.loops.body_poses import POSE, P, R, orient
from ..formulations.tolerances import LAND_SWEEPS, ROUNDING, ROUNDING_AT_MOST, STALLED, WALK
from ..jit.kernels import kernel, long_kernel
from ..jit.lane_masks import any_of, below, both, choose, either, every, opposite
from ..jit.simd import add, first, four, fourth, get, let, put, second, third
from ..rows.interface import (
    DYNAMICS,
    evaluate_residuals,
    evaluate_without_redundant,
    factorise_selected_rows,
    find_correction,
)
from .context import BAD, BEFORE, DONE, FLOOR, MOVED, RESIDUAL


@kernel
def _is(c, i):
    """The lanes of which it is true."""
    return below(0.5, get(c.state, i))


@kernel
def _set(c, i, mask):
    let(c.state, i, choose(mask, 1.0, get(c.state, i)))


@kernel
def _largest_residual(c):
    """The largest |b|; infinity where an entry is not finite. In small scenes pure numbers count times the lever."""
    b, turns, floor = c.tangent.b, c.graph.turns, get(c.state, FLOOR)
    worst = rest = 0.0 * floor
    for e in range(b.size):
        # Not finite: 0 x is then no zero
        size = abs(get(b, e))
        if turns.size > 0 and turns[e] == 1.0:
            size *= min(floor / ROUNDING, 1.0)
        worst, rest = max(worst, size), rest + 0.0 * size
    return choose(below(-1.0, rest), worst, math.inf)


@long_kernel
def _displace(c, mask):
    """Displace the bodies by the smallest correction of the residuals b, in the lanes of the mask."""
    graph, f = c.graph, c.tangent
    find_correction(graph, f.rows, f.b, f.Z)
    moved = get(c.state, MOVED)
    for b in range(graph.bodies.shape[0]):
        at, o = b * POSE, 8 * b
        # Largest component of the displacement, lane by lane
        dr, turn = four(f.Z, o), four(f.Z, o + 4)
        for i in range(3):
            moved = max(moved, max(abs(get(f.Z, o + i)), abs(get(f.Z, o + 4 + i))))
        put(f.poses, at + R, choose(mask, add(four(f.poses, at + R), dr), four(f.poses, at + R)))
        if graph.bodies[b, 1] == 7:
            # Lanes outside of the mask keep their pose
            x, y, z = 0.5 * first(turn), 0.5 * second(turn), 0.5 * third(turn)
            p = four(f.poses, at + P)
            e0, e1, e2, e3 = first(p), second(p), third(p), fourth(p)
            p0 = e0 - e1 * x - e2 * y - e3 * z  # p <- p o (1, dpi' / 2)
            p1 = e1 + e0 * x - e3 * y + e2 * z
            p2 = e2 + e3 * x + e0 * y - e1 * z
            p3 = e3 - e2 * x + e1 * y + e0 * z
            scale = 1.0 / math.sqrt(p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)
            e0, e1 = choose(mask, p0 * scale, e0), choose(mask, p1 * scale, e1)
            e2, e3 = choose(mask, p2 * scale, e2), choose(mask, p3 * scale, e3)
            orient(f.poses, at, e0, e1, e2, e3)
    let(c.state, MOVED, choose(mask, moved, get(c.state, MOVED)))


@long_kernel
def _factorise(c):
    evaluate_without_redundant(c.graph, c.system.reals, c.tangent, c.tangent.rows, 0.0)
    factorise_selected_rows(c.graph, c.tangent, c.tangent.rows, DYNAMICS)


@long_kernel
def land(c):
    """Project positions onto the manifold; H, Y and the factors of S are those of the result. Sets BAD and RESIDUAL."""
    s, floor = c.state, get(c.state, FLOOR)
    # Numbers of lanes begin with 0.0 * floor, an array of the right width
    let(s, RESIDUAL, 0.0 * floor)
    let(s, MOVED, 0.0 * floor)
    let(s, DONE, 0.0 * floor)
    let(s, BEFORE, 0.0 * floor + math.inf)
    for sweep in range(LAND_SWEEPS):
        if sweep == 0:
            _factorise(c)
        else:
            evaluate_residuals(c.graph, c.system, c.tangent, 0.0)
        # Lanes that are still corrected
        worst, active = _largest_residual(c), opposite(_is(c, DONE))
        let(s, RESIDUAL, choose(active, max(get(s, RESIDUAL), worst), get(s, RESIDUAL)))
        # Converged, or falling no more; failed if that is above rounding
        ends = opposite(both(below(floor, worst), opposite(below(STALLED * get(s, BEFORE), worst))))
        fails = both(ends, below(ROUNDING_AT_MOST * floor, worst))
        _set(c, BAD, both(active, either(fails, opposite(below(worst, math.inf)))))
        _set(c, DONE, ends)
        _set(c, DONE, opposite(below(worst, math.inf)))
        if every(_is(c, DONE)):
            break
        # The others take one more correction
        goes_on = opposite(_is(c, DONE))
        let(s, BEFORE, choose(goes_on, worst, get(s, BEFORE)))
        _displace(c, goes_on)
    # Sweeps are used up
    _set(c, BAD, opposite(_is(c, DONE)))
    # H and S of the result serve velocities and the next step
    _factorise(c)
    walks = below(WALK * floor, _largest_residual(c))
    if any_of(walks):
        _displace(c, walks)
