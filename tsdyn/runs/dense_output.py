"""Dense output of step methods: v and vd are interpolated in the chart, then positions and velocities are solved for.

The driver uses it at the times of t_eval, in its own workspace. `Solution.at` and events use it through `read` and a
workspace of their own (reader.py), where the chart of a step is rebuilt: q0, the time and the selection of rows
determine it.
"""

from ..errors import Status
from ..jit.kernels import caller, entry, kernel, long_kernel
from ..maths.dense_linalg import copy, is_finite
from ..methods.explicit import call_accelerate, call_place
from ..methods.interpolants import call_value
from ..rows.interface import take_noted_selection
from ..workspaces.run_state import B_CHART, B_DATA, B_H, B_START, load_run
from ..workspaces.workspace import load
from .tolerances import FEW, LEGS

NOT_FINITE = int(Status.NOT_FINITE)

call_complete = caller("pp")
call_chart = caller("pdpppp")


@long_kernel
def evaluate(context, w, r, t, x, y, yd, xd):
    """q, qd, qdd, yd (and xd) at (t, x, y). Status."""
    # Positions, then velocities and accelerations, then qdd
    status = call_place(r.kernels.place, context, t, x)
    if status == 0:
        status = call_accelerate(r.kernels.accelerate, context, t, y, yd, xd)
    if status == 0:
        status = call_complete(r.kernels.complete, context, yd)
    if status == 0 and not (is_finite(w.q) and is_finite(w.qd) and is_finite(w.qdd)):
        return NOT_FINITE
    return status


@kernel
def between(context, w, r, t, block):
    """q, qd, qdd at a time within the step of this block. Status. xd, the next step's, is left alone.

    Positions are solved for twice: Newton's method starts further away than in a run, and ends closer to rounding when
    repeated from nearby.
    """
    status = _place_share(context, w, r, t, t, 1.0, block)
    return _evaluate_there(context, w, r, t, block) if status == 0 else status


@kernel
def _place_share(context, w, r, t, when, share, block):
    """Place a share of the coordinates at t, at another time if the share is not all; x and y of the step. Status."""
    # Coordinates of the chart by the interpolant
    s = (t - block[B_START]) / block[B_H]
    call_value(r.kernels.value, s, block[B_H], w.q.size, r.xs.size, r.ys.size, block[B_DATA:], r.xs, r.ys)
    if share != 1.0:
        for j in range(r.xs.size):
            r.xs[j] *= share
    return call_place(r.kernels.place, context, when, r.xs)


@kernel
def _evaluate_there(context, w, r, t, block):
    h, data = block[B_H], block[B_DATA:]
    status = evaluate(context, w, r, t, r.xs, r.ys, r.yds, r.dx)
    # Accelerations by the interpolant: the right-hand side of a stiff scene would amplify its error
    if status == 0 and r.kernels.second != 0:
        s = (t - block[B_START]) / h
        call_value(r.kernels.second, s, h, w.q.size, r.xs.size, r.ys.size, data, r.xs, r.yds)
        call_complete(r.kernels.complete, context, r.yds)
    return status


@kernel
def keep(c, store):
    """Copy what the Newton solvers start from."""
    _warm(c, store, True)


@kernel
def bring_back(c, store):
    """Put it back."""
    _warm(c, store, False)


@kernel
def _move(part, store, i, out):
    """Copy a part to its place i in the store, or back; where the next part begins."""
    for j in range(part.size):
        if out:
            store[i + j] = part[j]
        else:
            part[j] = store[i + j]
    return i + part.size


@long_kernel
def _warm(c, store, out):
    w, l, f, friction, i = c.work, c.chart, c.tangent, c.tangent.friction, 0
    # Starts of Newton's methods: u, v, multipliers and normal loads
    for part in (w.u, w.v, friction.lam, friction.load):
        i = _move(part, store, i, out)
    if c.saddle.K.size > 0:  # stages begin with the factors of N and S
        for part in (l.lower, l.upper, f.rows.S):
            i = _move(part, store, i, out)
        if out:
            store[i] = l.state.made
        else:
            l.state.made = int(store[i])
        i += 1
    # B and T of the null-space form
    for part in (w.B, w.T):
        for a in range(part.shape[0]):
            for b in range(part.shape[1]):
                if out:
                    store[i] = part[a, b]
                else:
                    part[a, b] = store[i]
                i += 1
    if out:
        store[i] = w.control.rate
    else:
        w.control.rate = store[i]


def warm_size(work, tangent, chart, saddle):
    """Floats that `keep` stores."""
    friction, factors = tangent.friction, (chart.lower, chart.upper, tangent.rows.S) if saddle.K.size else ()
    kept = work.u, work.v, friction.lam, friction.load, work.B, work.T, *factors
    return sum(part.size for part in kept) + 1 + (1 if factors else 0)


@kernel
def recall(system, block):
    """Let forces remember what a block ends with."""
    first = block.size - system.memory.size
    for j in range(system.memory.size):
        system.reals[system.memory[j]] = block[first + j]


@kernel
def put_state(w, out):
    """out (3, n) = q, qd, qdd."""
    copy(w.q, out[0])
    copy(w.qd, out[1])
    copy(w.qdd, out[2])


@entry
def read(context, run, t, rows, blocks, charts, points, out):
    """out (k, 3, n): q, qd, qdd at t (k,), each within the step blocks[rows]. Status.

    Every time starts from its chart's q0, so that it gives the same numbers whatever was asked for before it.
    """
    c, r = load(context), load_run(run)
    w, chart = c.work, -1
    for i in range(t.size):
        # Every time begins at the same state of its chart
        block = blocks[rows[i]]
        if int(block[B_CHART]) == chart:
            bring_back(c, r.warm)
        else:
            # A new chart: rebuilt at q0 with its selection of rows
            chart = int(block[B_CHART])
            copy(points[chart, : w.q.size], w.q)
            take_noted_selection(c.tangent, points[chart, w.q.size :])
            c.tangent.friction.lam[:] = 0.0
            c.tangent.friction.load[:] = 0.0
            status = call_chart(r.kernels.start_chart, context, charts[chart, 0], r.xs, r.ys, r.yds, r.dx)
            if status != 0:
                return status
            keep(c, r.warm)
        # The state at t
        recall(c.system, block)
        status = _go_to(context, c, r, t[i], charts[chart, 0], block)
        if status != 0:
            return status
        put_state(w, out[i])
    return 0


@kernel
def _go_to(context, c, r, t, began, block):
    """`between`, from the base point of the chart, in legs short enough to need no further factorisation. Status.

    Newton's method from far away may end on another branch of the constraints than that of the run.
    """
    w, status = c.work, 0
    # Fewer legs first; more where a leg needed many factorisations, a sign of a step too long
    for legs in LEGS:
        if legs > 1:
            bring_back(c, r.warm)
        status, most = 0, 0
        for leg in range(1, legs + 1):
            if status == 0:
                # Chart coordinates in proportion, at a time in proportion
                made, share = w.counters.factorizations, leg / legs
                status = _place_share(context, w, r, t, began + share * (t - began) if leg < legs else t, share, block)
                most = max(most, w.counters.factorizations - made)
        if status == 0 and most <= FEW:
            break
    return _evaluate_there(context, w, r, t, block) if status == 0 else status
