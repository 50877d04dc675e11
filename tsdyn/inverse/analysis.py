"""Kinematic analysis: a configuration without freedom, followed from time to time."""

from typing import NamedTuple

import numpy as np

from ..configuration.kinetic_metric import Metric
from ..errors import InvalidArgument, Status
from ..jit.compiled import clock
from ..jit.kernels import resident
from ..model import joint_motion
from ..model.handles import handles_of
from ..rows.interface import allocate_tangent
from ..sparse.constraint_graph import BIAS, DRIFT, REDUCED, VALUES
from ..sparse.constraint_graphs import graph_of
from ..statics.moves import update_memory
from .branch_steps import branch_of, follow
from .tolerances import LEAST_STEPS, SEEN, SHORTEST, SLICE


class Followed(NamedTuple):
    """How far a branch has been followed."""

    status: Status
    rows: np.ndarray  # (k, 1 + 3 n + angles + slots)  t, q, qd, qdd, remembered
    reached: float  # s
    last: np.ndarray  # (3, n)  q, qd, qdd there
    remembered: np.ndarray  # (angles + slots,)  there
    steps: int
    rejected: int
    newton_iterations: int
    factorizations: int
    seconds: float


def analyse(packed, t0, q, remembered, times, stops):
    """Follow the branch through q at t0 to times (k,), in their order; stops (s,) are ends of steps, too.

    Parameters
    ----------
    packed : Packed
        Its redundant rows have been selected, as for a run.
    t0 : float, s
    q : ndarray (n,)
        Consistent.
    remembered : ndarray (angles + slots,)
        Angles of joints, and what forces and constraints remember.
    """
    branch = _branch(packed, q, remembered)
    address, *_keep = resident(branch)
    way = branch.way
    way.t, way.size = t0, Metric(packed, None, t0).reach(q)
    span = float(np.ptp(np.append(times, t0)))
    way.longest = way.h = max(span / LEAST_STEPS, np.finfo(float).tiny)
    way.least = max(SHORTEST * span, SEEN * max(abs(t0), np.abs(times).max()))
    every, asked = _with_stops(t0, times, stops)
    out = np.zeros((every.size, 1 + 3 * q.size + remembered.size))
    started, done, status = clock(), 0, Status.SLICE_DONE
    try:
        while status is Status.SLICE_DONE:
            done = follow(address, every, out.reshape(-1), done, _slice(q.size))
            status = Status(way.failed)
    except KeyboardInterrupt:
        status = Status.INTERRUPTED
    counters = branch.work.counters
    return Followed(
        status, out[:done][asked[:done]], way.t, branch.now.copy(), branch.remembered.copy(), way.steps, way.rejected,
        counters.newton, counters.factorizations, clock() - started,
    )  # fmt: skip


def _slice(n):
    return max(SLICE // n, 10)


def _branch(packed, q, remembered):
    """The `Branch` of a packed scene, placed at q."""
    graph, handles = graph_of(packed, REDUCED, VALUES, BIAS, DRIFT), handles_of(packed)
    system = packed.system._replace(reals=packed.system.reals.copy())
    system.reals[system.memory] = remembered[handles.count :]
    redundant = packed.derived.redundant is not None
    tangent = allocate_tangent(graph, q.size, redundant=True) if redundant else None
    branch = branch_of(system, graph, handles, q.size, tangent)
    branch.now[0], branch.remembered[:] = q, remembered
    branch.work.control.size = packed.size
    return branch


def _with_stops(t0, times, stops):
    """Times with the stops between them, in the order of the way, and which of them were asked for."""
    if not stops.size:
        return np.ascontiguousarray(times), np.ones(times.size, bool)
    every, asked = [], []
    for start, end in zip([t0, *times[:-1].tolist()], times.tolist(), strict=True):
        between = stops[(stops > min(start, end)) & (stops < max(start, end))]
        every += [*(between if end >= start else between[::-1]).tolist(), end]
        asked += [False] * between.size + [True]
    return np.array(every), np.array(asked, bool)


def given(packed, times, levels, motion):
    """A motion q, qd, qdd (k, n) at times (k,), as `Followed`; angles and memory are those of `motion`, if any."""
    handles, k = handles_of(packed), times.size
    angles, memory = _attribute(motion, "angles"), _attribute(motion, "_remembers", "memory")
    slots = packed.system.memory.size
    angles = np.reshape(angles, (k, handles.count)) if np.size(angles) == k * handles.count else None
    if angles is None:
        angles = _unwrapped(handles, times[0], levels[0])
    if np.size(memory) == k * slots:
        memory = np.reshape(memory, (k, slots))
    else:
        memory = _remembering(packed, times, levels)
    rows = np.column_stack((times, *levels, angles, memory))
    last, remembered = np.stack([level[-1] for level in levels]), np.concatenate((angles[-1], memory[-1]))
    return Followed(Status.SUCCESS, rows, float(times[-1]), last, remembered, 0, 0, 0, 0, 0.0)


def _attribute(motion, *names):
    """The first of some attributes that there is; an empty array without one."""
    for name in names:
        try:
            return np.asarray(getattr(motion, name), float)
        except (AttributeError, TypeError, InvalidArgument):
            continue
    return np.full(1, np.nan)[:0]


def _unwrapped(handles, t, q):
    """Angles of joints (k, count), each on the turn nearest to the one before."""
    found, near = np.zeros((len(q), handles.count)), handles.angles_at_start(t, q[0])
    for row in handles.rows:
        for j, geometry in enumerate(row.angles, row.first):
            angle = np.unwrap(joint_motion.angle(geometry, *handles.motions(geometry, (q,)), 0))
            found[:, j] = angle + (joint_motion.counted(angle[0], near[j]) - angle[0])
    return found


def _remembering(packed, times, levels):
    """What forces and constraints remember (k, slots), if each instant follows the one before."""
    system = packed.system._replace(reals=packed.system.reals.copy())
    found = np.zeros((times.size, system.memory.size))
    for i, t in enumerate(times):
        update_memory(system, levels[0][i], levels[1][i], float(t), found[i])
    return found
