"""Steps along the branch of a scene without freedom: positions, velocities and accelerations from constraints alone.

    predicted   q0 + h qd0 + h^2 qdd0 / 2
    Phi(q, t) = 0,    Phi_q qd = -Phi_t,    Phi_q qdd = -gamma

Each is solved by S = H W H^T, in O(N) for chains and trees. A step counts if positions and velocities are near their
prediction: on another branch they are not. Otherwise it is halved.
"""

import math
from typing import NamedTuple

import numpy as np

from ..elements.loops.body_poses import (
    OMEGA,
    POSE,
    RD,
    largest_coordinate,
    place_bodies,
    write_accelerations,
    write_positions,
    write_velocities,
)
from ..errors import Status
from ..formulations.projection import find_drift, gather_speeds, land, land_velocities, move_by
from ..jit.kernels import Record, entry, kernel, loader, long_kernel
from ..maths.dense_linalg import copy, is_finite
from ..model.equations import remember, set_time
from ..model.joint_turns import count_turns
from ..model.packed import System
from ..rows.interface import TangentWorkspace, constrain, evaluate_bias, note_indicator
from ..sparse.constraint_graph import ConstraintGraph, no_graph
from ..workspaces.workspace import Work, parts, plain_context
from .tolerances import GROWTH, LARGEST_CHANGE, LARGEST_TURN, NO_CHANGE, ROUNDING, SMALL, TIME_ROUNDING

OK, NOT_FINITE, CHART_LOST = int(Status.SUCCESS), int(Status.NOT_FINITE), int(Status.CHART_LOST)
SLICE_DONE = int(Status.SLICE_DONE)


class Way(Record):
    """How far a continuation has come."""

    t: float  # of the last accepted point, s
    h: float  # length of the next step, s
    longest: float  # step, s
    least: float  # step, s; a shorter one is none
    size: float  # of the scene, m
    begun: int  # whether velocities and accelerations of the start are known
    steps: int
    rejected: int
    failed: int  # Status of the last step that was rejected


class Branch(NamedTuple):
    """What the kernels of a continuation get by one address; n coordinates, b bodies."""

    system: System
    work: Work
    graph: ConstraintGraph
    tangent: TangentWorkspace
    now: np.ndarray  # (3, n)  q, qd, qdd at the last accepted point
    speeds: np.ndarray  # (8 b,)  rd and omega' there
    gains: np.ndarray  # (8 b,)  their derivatives
    remembered: np.ndarray  # (angles + slots,)  angles of joints there, and what forces and constraints remember
    frames: np.ndarray  # (angles, 9)  see joint_turns.py
    joints: np.ndarray  # int64 (angles, 4)
    way: Way


def branch_of(system, graph, handles, n, tangent=None):
    """A `Branch` of a system of its own; tangent: with room for redundant rows."""
    b = len(graph.bodies)
    whole = parts(system, graph, n)
    tangent = whole.tangent if tangent is None else tangent
    remembered = np.zeros(handles.count + system.memory.size)
    now, speeds = np.zeros((3, n)), np.zeros((2, 8 * (b + 1)))
    frames, joints = handles.frames.copy(), handles.joints.copy()
    return Branch(system, whole.work, graph, tangent, now, *speeds, remembered, frames, joints, Way())


class _NoHandles(NamedTuple):
    count: int = 0
    frames: np.ndarray = np.zeros((0, 9))
    joints: np.ndarray = np.zeros((0, 4), np.int64)


load_branch = loader(branch_of(plain_context().system, no_graph(), _NoHandles(), 0))


@entry("pvvii")
def follow(branch, times, out, first, most):
    """Follow the branch to times[first:], in at most so many steps; rows (t, q, qd, qdd, remembered) go to out.

    Returns the number of rows that are written. way.failed is then SLICE_DONE, or the Status with which it ended.
    """
    c = load_branch(branch)
    n, way = c.work.q.size, c.way
    if way.begun == 0:
        place_bodies(c.graph.bodies, c.now[0], c.tangent.poses)
        way.failed = _solve(c, way.t)
        if way.failed != OK:
            return first
        _accept(c)
        way.begun = 1
    width, end = 1 + 3 * n + c.remembered.size, way.steps + way.rejected + most
    for i in range(first, times.size):
        while way.t != times[i]:
            if way.steps + way.rejected >= end:
                way.failed = SLICE_DONE
                return i
            if not _step(c, times[i]):
                return i
        at = i * width
        out[at] = way.t
        for level in range(3):
            for j in range(n):
                out[at + 1 + level * n + j] = c.now[level, j]
        for j in range(c.remembered.size):
            out[at + 1 + 3 * n + j] = c.remembered[j]
    way.failed = OK
    return times.size


@long_kernel
def _step(c, target):
    """Take a step towards a time, or halve the next one; False where it can't be halved any more."""
    way, left = c.way, target - c.way.t
    last = abs(left) <= way.h * (1.0 + TIME_ROUNDING)
    h = left if last else math.copysign(way.h, left)
    t = target if last else way.t + h
    place_bodies(c.graph.bodies, c.now[0], c.tangent.poses)
    status, ratio = CHART_LOST, math.inf
    if _predict(c, h) <= LARGEST_TURN:
        status = _solve(c, t)
        if status == OK:
            ratio = _change(c, h)
    if ratio <= 1.0:
        if abs(h) >= way.h:
            way.h = min(abs(h) * (GROWTH if ratio < SMALL else 1.0), way.longest)
        count_turns(c, c.work.q, c.work.qd, h)
        way.t = t
        way.steps += 1
        _accept(c)
        return True
    way.rejected += 1
    way.h = 0.5 * abs(h)
    if way.h < way.least:
        way.failed = status if status != OK else CHART_LOST
        return False
    return True


@kernel
def _predict(c, h):
    """Displace the bodies by h qd + h^2 qdd / 2; the largest rotation, rad. Leaves the displacements in tangent.a."""
    f, turn = c.tangent, 0.0
    for i in range(c.speeds.size):
        f.Z[i] = h * c.speeds[i] + 0.5 * h * h * c.gains[i]
        f.a[i] = f.Z[i]
    for b in range(c.graph.bodies.shape[0]):
        for i in range(8 * b + 4, 8 * b + 7):
            turn = max(turn, abs(f.Z[i]))
    move_by(c.graph, f)
    return turn


@long_kernel
def _solve(c, t):
    """Solve for positions near the poses, for velocities and accelerations: work.q, qd, qdd, tangent.Z. Status."""
    graph, system, w, f = c.graph, c.system, c.work, c.tangent
    if not set_time(system, t):
        return NOT_FINITE
    w.control.floor = ROUNDING * (w.control.size + largest_coordinate(graph.bodies, c.now[0], w.control.size))
    status = land(graph, system, w, f, t)
    if status != OK:
        return status
    write_positions(graph.bodies, f.poses, w.q)
    find_drift(graph, system, f, t)
    land_velocities(graph, f, True)
    write_velocities(graph.bodies, f.poses, w.qd)
    evaluate_bias(graph, system, f, t)
    for i in range(f.Z.size):
        f.Z[i] = 0.0
    for _ in range(2):
        constrain(graph, f.rows, f.gamma, f.Z, f.b)
    write_accelerations(graph.bodies, f.poses, f.Z, w.qdd)
    return OK if is_finite(w.qdd) and is_finite(w.qd) and is_finite(w.q) else NOT_FINITE


@kernel
def _change(c, h):
    """How far the step has come from its prediction, as a share of what is allowed."""
    f, worst, allowed = c.tangent, 0.0, 0.0
    for part in range(2):  # displacements, rotations
        way, off = 0.0, 0.0
        for b in range(c.graph.bodies.shape[0]):
            at, o = b * POSE + (OMEGA if part == 1 else RD), 8 * b + 4 * part
            for i in range(3):
                speed = f.poses[at + i]
                way = max(way, max(abs(f.a[o + i]), abs(h * speed)))
                off = max(off, abs(h * (speed - c.speeds[o + i] - h * c.gains[o + i])))
        most = LARGEST_CHANGE * way + NO_CHANGE * (1.0 if part == 1 else c.way.size)
        worst, allowed = max(worst, off / most), allowed + most
    return max(worst, f.landing.moved / allowed)


@kernel
def _accept(c):
    """Take the point over."""
    graph, f, w = c.graph, c.tangent, c.work
    copy(f.Z, c.gains)
    gather_speeds(graph, f)
    copy(f.Z, c.speeds)
    copy(w.q, c.now[0])
    copy(w.qd, c.now[1])
    copy(w.qdd, c.now[2])
    note_indicator(graph, f, f.rows)
    remember(c.system, w.q, w.qd, c.way.t, c.remembered[c.joints.shape[0] :])
