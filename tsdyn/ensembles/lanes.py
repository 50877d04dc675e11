"""The compiled loop over cases in lanes: each lane takes the next case when its own has ended, without Python."""

import contextlib
from functools import cache
from typing import NamedTuple

import numpy as np

from ..elements.loops.constraint_rows import write_positions, write_velocities
from ..errors import InvalidArgument, Status, TsdynError
from ..jit.compiled import DEBUG, load
from ..jit.kernels import Record, entry, kernel, loader, long_kernel, resident, specialised, vector
from ..motions.signals import Signal
from ..rows.constraint_graph import redundant_rows
from ..rows.interface import has_redundant_rows, refinements, singularity_indicator
from ..runs.tolerances import LONG_STEPS
from ..simulation.run_options import OPTIONS
from ..taylor.lane_stepper import (
    BAD,
    FLOOR,
    INDICATOR,
    LOST,
    NEXT,
    RUNS,
    SIZE,
    SLOW,
    STEPS,
    T_NEXT,
    WAITS,
    H,
    LaneMemory,
    T,
    accept,
    constraint_loops,
    force_loops,
    lane_loader,
    reach,
    try_step,
)
from ..taylor.layout import SHOWN, is_far, load_series
from ..taylor.step_parts import set_floor
from ..taylor.stepper import stand_at
from ..workspaces import load_run
from .case_loop import SUCCESS, Batch, FirstSlice, enter_case, load_chunk, load_plan, take_start

NOT_RUN = int(Status.NOT_RUN)


class LaneLoopNumbers(Record):
    """Where a loop is."""

    next: int  # case that enters a lane next
    end: int  # of the chunk


class LaneLoop(NamedTuple):
    """What lanes and cases have in common."""

    numbers: LaneLoopNumbers
    cases: np.ndarray  # int64 (width,)  the case in each lane, or -1
    pairs: np.ndarray  # int64 (k, 3)  address of numbers of one case, that of those of lanes, how many
    arrays: np.ndarray  # int64 (k, 3)  address of each array of lanes, that of the numbers of a lane at first, how many
    poses: np.ndarray  # (n, width)  poses of the bodies in lanes


_none = np.zeros((0, 1), np.int64)
load_loop = loader(LaneLoop(LaneLoopNumbers(), np.zeros(0, np.int64), _none, _none, np.zeros((0, 1))))
load_lanes = None  # of the width


@long_kernel
def _enter(context, c, r, plan, chunk, k):
    """Numbers and start of case k in the memory of one case; False if it has none for lanes."""
    if chunk.fits[k] == 0:
        return False
    enter_case(plan, chunk, k)
    if not take_start(plan, chunk, k, c, r):
        return False
    set_floor(c, c.work.q)
    c.expansion.low[:] = 0.0
    if stand_at(context, c, r, r.clock.t) != 0 or has_redundant_rows(c.tangent):
        return False
    c.tangent.indicator.end = singularity_indicator(c.graph, c.tangent.rows)
    return refinements(c.tangent.indicator.end) == 0


@long_kernel
def _heal(loop, l):
    """Lane l is as it was at first: what is not finite would spoil the next case, even times zero."""
    width = loop.cases.size
    for i in range(loop.arrays.shape[0]):
        address, image, count = loop.arrays[i]
        many, one = vector(address, count * width), vector(image, count)
        for j in range(count):
            many[j * width + l] = one[j]


@kernel
def _take(c, lanes, loop, l, plan, chunk, k):
    """Let lane l run the case that has been entered."""
    width, s, n = lanes.single.shape[1], lanes.single, lanes.numbers
    if s[LOST, l] != 0.0:
        _heal(loop, l)
    for i in range(loop.pairs.shape[0]):
        source, target, count = loop.pairs[i]
        one, many = vector(source, count), vector(target, count * width)
        for j in range(count):
            many[j * width + l] = one[j]
    s[T, l], s[H, l], s[NEXT, l], s[STEPS, l], s[SLOW, l] = n.t_start, 0.0, float(n.first_top), 0.0, 0.0
    s[SIZE, l], s[FLOOR, l] = c.work.control.size, c.work.control.floor
    s[INDICATOR, l], s[RUNS, l], s[LOST, l], s[WAITS, l] = c.tangent.indicator.end, 1.0, 0.0, 0.0
    loop.cases[l], chunk.status[k] = k, NOT_RUN
    q, qd, size = c.work.q, c.work.qd, c.work.q.size
    for i in range(chunk.q.shape[1] // size):  # bodies that never turn stay as they are
        for j in range(size):
            chunk.q[k, i * size + j], chunk.qd[k, i * size + j] = q[j], qd[j]
    times = plan.log.t_eval
    if plan.numbers.grid == 1 and times.size > 0 and times[0] == n.t_start:
        s[WAITS, l] = 1.0


@kernel
def _write(c, loop, l, q, qd):
    """q and qd of the poses in lane l."""
    poses = c.tangent.poses
    for i in range(poses.size):
        poses[i] = loop.poses[i, l]
    write_positions(c.graph.bodies, poses, q)
    write_velocities(c.graph.bodies, poses, qd)


@kernel
def _is_asked(lanes, plan, l, end):
    """Whether lane l has an output to give before `end`."""
    s, times = lanes.single, plan.log.t_eval
    i = int(s[WAITS, l])
    return s[RUNS, l] != 0.0 and s[LOST, l] == 0.0 and i < times.size and times[i] < end


@kernel
def _record(c, lanes, loop, chunk, l):
    """The poses in lane l are its next output."""
    s, size, k = lanes.single, c.work.q.size, loop.cases[l]
    first = int(s[WAITS, l]) * size
    _write(c, loop, l, chunk.q[k, first:], chunk.qd[k, first:])
    s[WAITS, l] += 1.0


@kernel
def _write_outputs(c, lanes, loop, plan, chunk, least, most):
    """States at the times that are asked for within the steps; the poses are those of the ends on exit."""
    s, times, within, asked = lanes.single, plan.log.t_eval, False, True
    while asked:
        asked = False
        for l in range(s.shape[1]):
            s[H, l] = s[T_NEXT, l] - s[T, l]
            if _is_asked(lanes, plan, l, s[T_NEXT, l]):
                s[H, l], asked = times[int(s[WAITS, l])] - s[T, l], True
        if asked or within:
            reach(lanes, least, most)
            for l in range(s.shape[1]):
                if s[BAD, l] != 0.0:
                    s[LOST, l] = 1.0
        within = asked
        for l in range(s.shape[1] if asked else 0):
            if _is_asked(lanes, plan, l, s[T_NEXT, l]):
                _record(c, lanes, loop, chunk, l)
    for l in range(s.shape[1]):
        if _is_asked(lanes, plan, l, s[T_NEXT, l] + 1.0) and times[int(s[WAITS, l])] == s[T_NEXT, l]:
            _record(c, lanes, loop, chunk, l)


@kernel
def _close(c, lanes, loop, plan, chunk):
    """End the cases that are at the end of the run, and leave those that are lost."""
    s, n = lanes.single, lanes.numbers
    for l in range(s.shape[1]):
        k = loop.cases[l]
        if k >= 0 and (s[LOST, l] != 0.0 or s[T, l] >= n.t_end):
            if s[LOST, l] != 0.0:
                chunk.q[k, :] = np.nan
                chunk.qd[k, :] = np.nan
            else:
                if plan.numbers.grid == 0:
                    _write(c, loop, l, chunk.q[k], chunk.qd[k])
                chunk.t[k], chunk.status[k] = s[T, l], SUCCESS
            loop.cases[l], s[RUNS, l], s[H, l], s[T_NEXT, l] = -1, 0.0, 0.0, s[T, l]


def run_lanes(context, run, where, chunk_at, lanes_at, loop_at, most):
    """Make up to `most` steps of cases in lanes; 1 once all cases of the chunk have been run, or left."""
    c, r, plan, chunk = load_series(context), load_run(run), load_plan(where), load_chunk(chunk_at)
    lanes, loop = load_lanes(lanes_at), load_loop(loop_at)
    n = loop.numbers
    for _ in range(most):
        running = False
        for l in range(loop.cases.size):
            while loop.cases[l] < 0 and n.next < n.end:
                if _enter(context, c, r, plan, chunk, n.next):
                    _take(c, lanes, loop, l, plan, chunk, n.next)
                n.next += 1
            running = running or loop.cases[l] >= 0
        if not running or chunk.stopped[0] != 0:
            return 1
        least, top = try_step(lanes)
        if plan.numbers.grid == 1:
            _write_outputs(c, lanes, loop, plan, chunk, least, top)
        accept(lanes)
        _close(c, lanes, loop, plan, chunk)
    return 0


@cache
def lane_runner(width):
    """The compiled loop for so many lanes."""
    return entry("ppppppi")(specialised(run_lanes, f"run_{width}_lanes", run_lanes, load_lanes=lane_loader(width)))


# The cases of a chunk that run in lanes, and those that lanes leave.


class LaneBatch(Batch):
    """Runs the cases of a chunk in lanes, then those that are left in the loop for one case.

    Every case that fits is run in lanes, that too which was run alone before there was a batch: so no result depends on
    how cases are shared out to threads.
    """

    def __init__(self, workspace, task, first_slice, width):
        super().__init__(workspace, task, first_slice)
        self.width, self._lanes, self._of, self._passed = width, None, None, False
        nothing = [np.zeros((0, 3), np.int64) for _ in range(2)]
        self._loop = LaneLoop(LaneLoopNumbers(), np.full(width, -1), *nothing, np.zeros((0, width)))
        self._run_lanes = lane_runner(width)

    def enter(self, chunk):
        """As of `Batch`."""
        super().enter(chunk)
        self._passed, self._status, self._messages = False, chunk.status, chunk.messages

    def run(self, k, end):
        """Run cases of the chunk; the first of all that was not."""
        if not self._passed:
            self._pass(end)
        while not self._workspace.study.stopped and (left := np.flatnonzero(self._status[:end] == NOT_RUN)).size:
            k = int(left[0])
            if super().run(k, k + 1) == k:
                return k
        left = np.flatnonzero(self._status[:end] == NOT_RUN)
        return int(left[0]) if left.size else end

    def _pass(self, end):
        """Run in lanes what can be run in them."""
        memory = self._take()
        self._passed, known = True, self._status[:end] != NOT_RUN
        if self._of is not memory:
            self._lay_out_lanes(memory)
        loop, run_lanes = self._loop, self._run_lanes
        loop.numbers.next, loop.numbers.end, loop.cases[:] = 0, end, -1
        while not run_lanes(*memory.where, self._plan, self._at, self._lanes.where, self._where, self._numbers.most):
            pass
        for k in np.flatnonzero(known & (self._status[:end] == SUCCESS)):
            self._messages.pop(int(k), None)
        self._give(memory)

    def _lay_out_lanes(self, memory):
        writer, kept = self._workspace.writer, self._workspace.kept
        self._lanes = LaneMemory(kept.series, kept.packed, memory, self.width, "inertia" in writer.written)
        self._loop = self._loop._replace(pairs=self._lanes.pairs, arrays=self._lanes.arrays, poses=self._lanes.poses)
        self._where, *self._keep_loop = resident(self._loop)
        self._of = memory


# What lanes can't serve, each part by name; the kernels of what they can.

INSTEAD = "Leave lanes out: one case at a time serves every scene and method."
PLAIN = ("formulation", "chart_interval", "redundancy")  # of which lanes have the default


def prepare_lanes(study, make_workspace):
    """Load the kernels of lanes for a study, of which `make_workspace` makes the `CaseWorkspace`.

    Raises
    ------
    InvalidArgument
        If lanes can't serve it; says what, by name.
    """
    reason = _of_options(study)
    if not reason:
        workspace = make_workspace(study)
        _examine_start(workspace)
        reason = _of_scene(workspace)
    if reason:
        raise InvalidArgument(f"lanes={study.lanes}: {reason}. {INSTEAD}")
    try:
        _load(study, workspace.kept)
    except TsdynError as error:
        raise InvalidArgument(f"lanes={study.lanes}: {error} {INSTEAD}") from error


def _of_options(study):
    """What is asked of the runs that lanes have not; empty for nothing."""
    given = study.given
    if DEBUG:
        return "TSDYN_DEBUG=1 runs kernels as plain Python, which has no lanes"
    if study.has_phases:
        return "contacts and exact friction, whose rows come and go, have no lanes"
    changed = [f"{name}={given[name]!r}" for name in PLAIN if given[name] != OPTIONS[name]]
    if changed:
        return f"{' and '.join(changed)} can't be served in lanes"
    if study.method.driver != "series":
        return f"lanes are for Taylor series, and the method is {study.method!r}"
    if study.method.step is not None:
        return "a fixed step= has no lanes"
    asked = [name for name in ("events", "dense_output", "max_steps") if given[name] not in (None, False)]
    asked += ["channels or a function keep="] * callable(study.keep) + ["assemble="] * (study.free is not None)
    asked += ["parameters that are a function of the case"] * (study.names is None)
    if asked:
        return f"{' and '.join(asked)} can't be served in lanes"
    if not FirstSlice.serves(study):
        return "steps that end at given times, such as knots of data and sampling times, have no lanes"
    return ""


def _examine_start(workspace):
    """Find the redundant rows of the scene's own start; cases may start elsewhere, so whatever is wrong is theirs."""
    with contextlib.suppress(TsdynError):
        workspace.starts.start(workspace.study.family.start)


def _of_scene(workspace):
    """The parts of a scene that have no lanes."""
    study, packed, found = workspace.study, workspace.kept.packed, []
    graph = workspace.kept.series.graph
    if not study.has_workspace or workspace.writer is None:
        return "the parameters are not all numbers that cases can share arrays for (docs/ensembles.md)"
    found += [f"{each.name} depends on time" for each in packed.constraints if each.rheonomic]
    what = {False: "counts turns", True: "remembers directions from step to step"}
    found += dict.fromkeys(f"{each.name} {what[each.begins_anew]}" for each in packed.constraints if each.memory)
    found += dict.fromkeys(f"{each.name} is a function of several joints" for each in packed.constraints if each.others)
    for force_load in packed.loads:
        force = force_load.force
        if any(isinstance(value, Signal) for value in force_load.parameters):
            found.append(f"{force.name} is a function of time")
        elif hasattr(force.kernels, "program") or force_load.law is not None:
            found.append(f"{force.name} is a function of the state")
        elif force_load.normal >= 0:
            found.append(f"{force.name} follows from a reaction")
        elif force.sharp:
            found.append(f"{force.name} changes within less than its series shows")
        elif force.positive is None:
            found.append(f"{force._kind()} doesn't say where it is analytic (`positive`)")
        elif force.memory or force.taken:
            found.append(f"{force.name} remembers a number from step to step")
    if redundant_rows(packed).size:
        found.append("some rows are redundant")
    found += [f"{force.name} adds inertia" for force in (load.force for load in packed.loads) if force.adds_inertia]
    if graph.axes.rows.shape[0]:
        found.append("a body has no inertia about an axis")
    if is_far(graph, study.method.orders()[2]) or study.n >= LONG_STEPS:
        found.append("there are too many bodies for the near caches")
    if found:
        more = [f"and {len(found) - SHOWN} more"] if len(found) > SHOWN else []
        return "; ".join(found[:SHOWN] + more)
    moved = workspace.writer.moves and (study.call.state is not None or not workspace.kept.handles.begin_at_zero)
    if moved or (workspace.writer.moves and (graph.bodies[:, 1] == 4).any()):
        return "starts differ in a scene whose joint angles count from a given value, or with locked orientations"
    return ""


def _load(study, kept):
    constraint_loops(kept.series.graph, kept.series.kinds, study.lanes)
    force_loops(kept.packed, study.lanes)
    load(lane_runner(study.lanes))
