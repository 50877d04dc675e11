"""Kinematic analysis: a configuration without freedom, followed from time to time on its branch."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..configuration.continuation import Metric, least_step
from ..configuration.tolerances import MOST_ROTATION
from ..constraints.angle_driver import AngleDriver
from ..constraints.dot2 import Dot2
from ..constraints.point_driver import PointDriver
from ..elements.bodies import PointMass
from ..elements.element import AngleGeometry
from ..elements.force import Force
from ..elements.loops.constraint_rows import (
    OMEGA,
    POSE,
    RD,
    largest_coordinate,
    place_bodies,
    write_accelerations,
    write_positions,
    write_velocities,
)
from ..errors import InconsistentState, InvalidArgument, SingularConfiguration, Status
from ..formulations.projection import find_drift, gather_speeds, land, land_velocities, move_by
from ..jit.compiled import clock
from ..jit.kernels import Record, entry, kernel, loader, long_kernel, resident
from ..maths.dense_linalg import copy, is_finite
from ..maths.tolerances import HALF_DIGITS, NEGLIGIBLE, ROUNDING
from ..methods.tolerances import SAME_TIME
from ..model import handles as joint_motion
from ..model.equations import remember, set_time
from ..model.handles import handles_of
from ..model.joint_turns import count_turns
from ..model.packed import System
from ..motions.elementary import Polynomial
from ..motions.prescribed import Motion
from ..motions.tables import is_data
from ..observables.diagnostics import constraint_rows
from ..rows.constraint_graph import BIAS, DRIFT, REDUCED, VALUES, ConstraintGraph, graph_of, no_graph, redundant_rows
from ..rows.interface import TangentWorkspace, allocate_tangent, constrain, evaluate_bias, note_indicator
from ..validation import listed, nearest, shown, vector3
from ..workspaces import Work, parts, plain_context
from . import tolerances as limits
from .coordinates import AXES, Variations, chosen, item_of, named_coordinates
from .moves import update_memory
from .nominal_motion import NominalMotion

# What constraints leave free: the number of degrees of freedom, and their names.


def degrees_of_freedom(packed):
    """Of a packed scene whose redundant rows have been selected."""
    system = packed.system
    return int(system.bodies[:, 1].sum()) - len(system.segments) + len(redundant_rows(packed))


def demand_driven(packed, memory, t, q, who, remedy):
    """Refuse a scene with freedom, by the names of independent coordinates that are free; memory (slots,)."""
    k = degrees_of_freedom(packed)
    if k <= 0:
        return
    motion = NominalMotion(packed, memory, t, q, np.zeros(q.size), still=True)
    names = [one.name for one in chosen(motion, Variations(motion, np.zeros(3)))]
    raise InvalidArgument(
        f"{who}: {k} degree{'s' * (k != 1)} of freedom {'is' if k == 1 else 'are'} left: {listed(names)}. {remedy}"
    )


def driven_rates(scene, t, q, who):
    """The smallest velocities qd (n,), in the metric of lengths, with Phi_q qd + Phi_t = 0."""
    packed = scene.packed
    metric = Metric(packed, None, t, lengths=True, rates=True)
    _, Phi_q, Phi_t = metric.arrays(q)
    A, drift = metric.reduced(q, Phi_q[metric.own]), Phi_t[metric.own]
    x = least_step(A, drift)
    for _ in range(limits.MOST_TRIES if metric.sparse else 0):  # which is regularised
        left = A @ x + drift
        if np.abs(left).max() <= NEGLIGIBLE * (1.0 + np.abs(x).max()):
            break
        x = x + least_step(A, left)
    left = np.abs(A @ x + drift)
    if not left.max(initial=0.0) <= HALF_DIGITS * (1.0 + np.abs(x).max(initial=0.0) + np.abs(drift).max(initial=0.0)):
        names = [scene.row_names()[metric.own[i]] for i in np.flatnonzero(drift)]
        raise SingularConfiguration(
            f"{who}: no velocities follow the motions at t = {t:g} s ({listed(names)}): the mechanism is at a dead "
            "centre of what drives it, or motions contradict each other. Start elsewhere, or drive another coordinate."
        )
    return metric.rates(q, x)


def demand_consistent(scene, packed, t, q, qd, qdd):
    """Refuse a given motion (k, n) that violates constraints, by the row that is violated most."""
    levels = "position", "velocity", "acceleration"
    for level, residuals, size in zip(levels, constraint_rows(packed, t, q, qd, qdd), (q, qd, qdd), strict=True):
        share = np.abs(residuals) / (1.0 + np.abs(size).max(axis=1, keepdims=True))
        if not share.max(initial=0.0) <= limits.CONSISTENT:
            i, row = np.unravel_index(int(np.nanargmax(share)), share.shape)
            raise InconsistentState(
                f"inverse_dynamics: the motion violates {scene.row_names()[row]} by {residuals[i, row]:.3g} "
                f"({level}) at t = {t[i]:g} s. Give a motion of this scene, such as a Solution of it."
            )


# Steps along the branch of a scene without freedom: positions, velocities and accelerations from constraints alone.
#
#     predicted   q0 + h qd0 + h^2 qdd0 / 2
#     Phi(q, t) = 0,    Phi_q qd = -Phi_t,    Phi_q qdd = -gamma
#
# Each is solved by S = H W H^T, in O(N) for chains and trees. A step counts if positions and velocities are near their
# prediction: on another branch they are not. Otherwise it is halved.

OK, NOT_FINITE, CHART_LOST = int(Status.SUCCESS), int(Status.NOT_FINITE), int(Status.CHART_LOST)
SLICE_DONE = int(Status.SLICE_DONE)


class ContinuationProgress(Record):
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
    way: ContinuationProgress


def branch_of(system, graph, handles, n, tangent=None):
    """A `Branch` of a system of its own; tangent: with room for redundant rows."""
    b = len(graph.bodies)
    whole = parts(system, graph, n)
    tangent = whole.tangent if tangent is None else tangent
    remembered = np.zeros(handles.count + system.memory.size)
    now, speeds = np.zeros((3, n)), np.zeros((2, 8 * (b + 1)))
    frames, joints = handles.frames.copy(), handles.joints.copy()
    return Branch(system, whole.work, graph, tangent, now, *speeds, remembered, frames, joints, ContinuationProgress())


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
    # The first call: velocities and accelerations at the start
    if way.begun == 0:
        place_bodies(c.graph.bodies, c.now[0], c.tangent.poses)
        way.failed = _solve(c, way.t)
        if way.failed != OK:
            return first
        _accept(c)
        way.begun = 1
    width, end = 1 + 3 * n + c.remembered.size, way.steps + way.rejected + most
    for i in range(first, times.size):
        # Steps of the continuation up to times[i]; a slice ends after `most` of them
        while way.t != times[i]:
            if way.steps + way.rejected >= end:
                way.failed = SLICE_DONE
                return i
            if not _step(c, times[i]):
                return i
        # Row i of the output
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
    last = abs(left) <= way.h * (1.0 + SAME_TIME)
    h = left if last else math.copysign(way.h, left)
    t = target if last else way.t + h
    place_bodies(c.graph.bodies, c.now[0], c.tangent.poses)
    status, ratio = CHART_LOST, math.inf
    if _predict(c, h) <= MOST_ROTATION:
        status = _solve(c, t)
        if status == OK:
            ratio = _change(c, h)
    if ratio <= 1.0:
        if abs(h) >= way.h:
            way.h = min(abs(h) * (limits.GROWTH if ratio < limits.CLOSE else 1.0), way.longest)
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
    move_by(c.graph, f, True)
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
    land_velocities(graph, f)
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
        most = limits.LARGEST_CHANGE * way + limits.NO_CHANGE * (1.0 if part == 1 else c.way.size)
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
    way.longest = way.h = max(span / limits.LEAST_STEPS, np.finfo(float).tiny)
    way.least = max(limits.SHORTEST * span, limits.SEEN * max(abs(t0), np.abs(times).max()))
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
    return max(limits.SLICE // n, 10)


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


# Drivers of a given motion: a copy of the scene in which some coordinates follow functions of time.
#
# Coordinates are joints, names such as "pin.angle", "slide.displacement" and "ball.x", bodies and points of bodies.

WHO = "inverse_dynamics"
MOST_NAMED = 10  # coordinates and bodies in a message


class Driven(NamedTuple):
    """One coordinate, or the three of a point, and its motions."""

    name: str
    geometry: object  # AngleGeometry or DisplacementGeometry; or the body
    point: np.ndarray  # body frame; None for an axis of the ground, or a joint
    axis: np.ndarray  # of the ground; None for a point, or a joint
    motions: tuple  # Motion each

    def present(self, handles, q, near):
        """Its values (1,) or (3,) at q, an angle on the turn nearest to `near`."""
        if isinstance(self.geometry, PointMass):
            at, dimension = handles.where(self.geometry)
            body = joint_motion.BodyMotion(at, dimension, (q,))
            place = np.array(body.point((0.0, 0.0, 0.0) if self.point is None else self.point.tolist(), 0))
            return place if self.axis is None else np.array([self.axis @ place])
        bodies = handles.motions(self.geometry, (q,))
        if isinstance(self.geometry, AngleGeometry):
            return np.array([joint_motion.counted(joint_motion.angle(self.geometry, *bodies, 0), near)])
        return np.array([joint_motion.displacement(self.geometry, *bodies, 0)])

    def constraint(self, scene, motions):
        """What prescribes it."""
        g, name = self.geometry, f"motion of {self.name}"
        if isinstance(g, AngleGeometry):
            (motion,) = motions
            return AngleDriver(g.own, g.other, reference_a=g.f, across_a=g.g, reference_b=g.h, angle=motion, name=name)
        if not isinstance(g, PointMass):
            points = {"point_a": g.s_own, "point_b": g.s_other}
            return Dot2(g.own, g.other, axis_a=g.e, **points, value=motions[0], name=name)
        if self.axis is None:
            return PointDriver(scene.ground, g, point_b=self.point, path=motions, name=name)
        return Dot2(scene.ground, g, axis_a=self.axis, value=motions[0], name=name)


def driven_copy(scene, motion):
    """A copy of the scene, and what is `Driven` in it by a dict of coordinates and motions."""
    if not isinstance(motion, Mapping):
        raise InvalidArgument(
            f"{WHO}: motion must be a dict of joints or coordinates and their motions, such as "
            f"{{hinge: ts.motions.Sine(0.5, 2.0)}}, or have t, q, qd and qdd, as a Solution or a State has, "
            f"got {motion!r}."
        )
    if not motion:
        raise InvalidArgument(f"{WHO}: motion is empty: give the motion of one coordinate at least.")
    twin = scene.copy()
    handles = handles_of(twin.packed)
    named = named_coordinates(handles)
    joints = [named[id(row.item)] for row in handles.rows if not isinstance(row.item, Force)]
    by_name = {name: geometry for own in joints for name, geometry in own}
    driven = [_driven(scene, twin, by_name, named, key, value) for key, value in motion.items()]
    names = [one.name for one in driven]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InvalidArgument(f"{WHO}: the motion of {twice} is given twice; give it once.")
    return twin, driven


def _driven(scene, twin, by_name, named, key, value):
    """What one entry of the dict drives, in the copy."""
    if isinstance(key, str) and key in by_name:
        return Driven(key, by_name[key], None, None, (_motion(value, key),))
    if isinstance(key, tuple) and len(key) == 2:
        key, point = key[0], key[1]
        item, _ = item_of(scene, key, scene.bodies, "body")
        point = vector3(point, f"{WHO}: point of {item.name} (m, body frame)", InvalidArgument)
        return Driven(f"{item.name}{tuple(point.tolist())}", twin[item], point, None, _path(value, item.name))
    things = [*scene.bodies, *scene.constraints]
    if isinstance(key, str) and key.removesuffix(key[-2:] if key[-2:] in AXES else "") not in {x.name for x in things}:
        known = [*by_name, *(body.name for body in scene.bodies)]
        said = f"there are {', '.join(map(repr, known[:MOST_NAMED]))}{', ...' * (len(known) > MOST_NAMED)}"
        raise InvalidArgument(f"{WHO}: no coordinate, joint or body is named {key!r}; {said}{nearest(key, known)}")
    item, axis = item_of(scene, key, things, "joint, body or coordinate")
    if isinstance(item, PointMass):
        if axis is None:
            return Driven(item.name, twin[item], np.zeros(3), None, _path(value, item.name))
        e = np.eye(3)[AXES.index(axis)]
        return Driven(item.name + axis, twin[item], None, e, (_motion(value, item.name + axis),))
    found = named.get(id(twin[item]), [])
    if len(found) != 1:
        names = ", ".join(name for name, _ in found)
        raise InvalidArgument(
            f"{WHO}: {item.name} has several coordinates: {names}; give one by its name."
            if found
            else f"{WHO}: {item.name} has no coordinate to be moved: give a joint with an angle or a displacement."
        )
    ((name, geometry),) = found
    return Driven(name, geometry, None, None, (_motion(value, name),))


def _motion(value, name):
    return Motion.always(value, f"motion of {name}")


def _path(value, name):
    """Three motions of a point."""
    what = f"motion of {name} (x, y, z)"
    if isinstance(value, (tuple, list)) and len(value) == 3:
        return tuple(Motion.always(each, what) for each in value)
    if not is_data(value):
        raise InvalidArgument(
            f"{WHO}: the {what} must be three motions, such as (ts.motions.Sine(0.1, 2.0), 0.0, 0.0), a ts.Table or a "
            f"spline of SciPy's with three values, got {shown(value)}. For one component give {name + '.x'!r}."
        )
    return tuple(Motion.always(each, what) for each in Motion.components(value, 3, what))


def drive(twin, driven):
    """Add the drivers to the copy."""
    for one in driven:
        twin.add(one.constraint(twin, one.motions))


def way_to_start(twin, driven, t):
    """The drivers of a motion over the time (0, 1) s from the present pose to the start; None where it is there."""
    handles, q = handles_of(twin.packed), twin.start[0]
    near = handles.angles_at_start(t, q)
    angles = {geometry: near[row.first + i] for row in handles.rows for i, geometry in enumerate(row.angles)}
    size, away, ways = twin.packed.size or 1.0, 0.0, []
    for one in driven:
        here = one.present(handles, q, angles.get(one.geometry, 0.0))
        there = np.array([motion.value(t)[0] for motion in one.motions])
        away = max(away, np.abs(there - here).max() / (1.0 if isinstance(one.geometry, AngleGeometry) else size))
        ways.append(tuple(Polynomial((a, b - a)) for a, b in zip(here.tolist(), there.tolist(), strict=True)))
    if away <= NEGLIGIBLE:
        return None
    return [one.constraint(twin, way) for one, way in zip(driven, ways, strict=True)]
