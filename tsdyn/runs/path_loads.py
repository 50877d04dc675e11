"""Loads along the path of a step: what a user's function of the state does between the stages.

A method sees the loads at its stages, and flies over a bump, a notch or a wall between them. So the loads that users
have written are sampled along the quintic Hermite polynomial of the ends of a step, as densely as functions of time are
(motions/knots.py). Eighth differences of the samples, and of each 4th, 16th and 64th of them, must be those of a load
that a step as long resolves:

    |d| <= max(DISTINCT (atol + rtol |qd|) / (s dt), (atol + rtol) |f|)     s dt: between the samples of a difference

f is the sum of what the loads accelerate all coordinates by. A step with larger ones is rejected, and the next one ends
before them. Steps of less than the distance of samples of functions of time are left alone.
"""

import math

from ..elements.loops.coordinate_rows import call_kind
from ..jit.kernels import callback, caller, kernel, stack
from ..maths.tolerances import PIVOT_ROUNDING
from ..methods.interpolants import quintic
from ..model.equations import set_time
from ..motions.tolerances import SAMPLES
from ..workspaces import load, load_run
from .tolerances import DISTINCT, IMPLICIT_PLACES, LEAST_PLACES

WATCH = "ppdd"
ORDER = 8  # of the differences
ROOM = SAMPLES + 2
call_watch = caller(WATCH, "d")


@kernel
def _gather(s, r, q, qd, qdd, d, weights):
    """d (6, k): q, qd, qdd at both ends of the step, of all coordinates that loads act on; their weights.

    Weights 1 + 0.37 j: loads that cancel in a plain sum, such as those on both ends of a spring, don't. Those of Euler
    parameters are of angular accelerations. Returns the largest rate at the ends.
    """
    k, j, speed = weights.size, 0, 0.0
    for i in range(r.loaded.size):
        b = r.loaded[i]
        at, size = s.bodies[b, 0], s.bodies[b, 1]
        trace = s.inertia[b, 0] + s.inertia[b, 4] + s.inertia[b, 8] if size == 7 else 0.0
        for part in range(size):
            c = at + part
            for level in range(3):
                d[level * k + j] = r.now[level, c]
            d[3 * k + j], d[4 * k + j], d[5 * k + j] = q[c], qd[c], qdd[c]
            speed = max(speed, abs(r.now[1, c]), abs(qd[c]))
            per_load = 1.0 / s.mass[b] if part < 3 else (1.5 / trace if trace > 0.0 else 0.0)
            weights[j] = (1.0 + 0.37 * j) * per_load
            j += 1
    return speed


@kernel
def _sample(s, r, h, t0, places, d, weights, f):
    """f (places + 1,): the weighted sum of the loads at so many places of the step, equally far apart. The largest."""
    n, k, largest = r.now.shape[1], weights.size, 0.0
    x, xd = r.path[7 * k : 8 * k], r.path[8 * k : 9 * k]
    Q, q, qd = r.path[9 * k : 9 * k + n], r.path[9 * k + n : 9 * k + 2 * n], r.path[9 * k + 2 * n :]
    for place in range(places + 1):
        share = place / places
        quintic(share, h, k, d, x, xd)
        j = 0
        for i in range(r.loaded.size):
            at, size = s.bodies[r.loaded[i], 0], s.bodies[r.loaded[i], 1]
            for c in range(at, at + size):
                q[c], qd[c] = x[j], xd[j]
                j += 1
        set_time(s, t0 + share * h)
        for i in range(r.watched.size):
            kind = s.forces[r.watched[i]]
            table, reals = s.table[kind.table :], s.reals[kind.reals :]
            call_kind(kind.force, kind.count, kind.stride, table, reals, q, qd, t0 + share * h, Q)
        total, j = 0.0, 0
        for i in range(r.loaded.size):
            at, size = s.bodies[r.loaded[i], 0], s.bodies[r.loaded[i], 1]
            for c in range(at, at + size):
                total += weights[j] * Q[c]
                Q[c] = 0.0
                j += 1
        f[place] = total
        largest = max(largest, abs(total))
    return largest


@kernel
def _first_large(f, places, stride, limit):
    """Where the first difference begins that is above the limit, or not a number; -1 for none."""
    s = stride
    for i in range(0, places - ORDER * s + 1, s):
        outer = f[i] + f[i + 8 * s] - 8.0 * (f[i + s] + f[i + 7 * s]) + 28.0 * (f[i + 2 * s] + f[i + 6 * s])
        d = outer - 56.0 * (f[i + 3 * s] + f[i + 5 * s]) + 70.0 * f[i + 4 * s]
        if not abs(d) <= limit:
            return i
    return -1


@callback(WATCH, "d")
def watch(context, run, t1, h):
    """The share of a step of h that ends at t1 up to which its stages see its loads; 1 for all of it."""
    c, r = load(context), load_run(run)
    density, k = SAMPLES * h / (r.clock.t_end - r.clock.t_origin), 0
    if density < 1.0:
        return 1.0
    for i in range(r.loaded.size):
        k += c.system.bodies[r.loaded[i], 1]
    f, d, weights = stack(ROOM), r.path[: 6 * k], r.path[6 * k : 7 * k]
    tol = r.clock.atol + r.clock.rtol * _gather(c.system, r, c.work.q, c.work.qd, c.work.qdd, d, weights)
    places = min(max(IMPLICIT_PLACES if r.numbers.stage_at > 0 else LEAST_PLACES, math.ceil(density)), ROOM - 1)
    noise = max(PIVOT_ROUNDING, r.clock.atol + r.clock.rtol)
    noise *= _sample(c.system, r, h, t1 - h, places, d, weights, f)
    set_time(c.system, t1)
    stride = 1
    while ORDER * stride <= places:
        first = _first_large(f, places, stride, max(DISTINCT * tol * places / (stride * h), noise))
        if first >= 0:
            return (first + (ORDER - 1) * stride if first > 0 else stride) / places
        stride *= 4
    return 1.0
