"""Phases by one kernel call: steps, their searches, and impacts of single gaps without friction."""

from typing import NamedTuple

import numpy as np

from ..analyses.contact_rows import (
    BOUNCES,
    call_bounce,
    energy_gained,
    find_gaps_within,
    load_contacts,
    load_impact,
    load_open_gaps,
)
from ..errors import Status
from ..jit.kernels import DEBUG, Record, entry, kernel, loader, resident, seen
from ..maths.dense_linalg import copy
from ..maths.tolerances import EPS
from ..model.joint_turns import angle_after
from ..runs.events import NOT_BEGUN, UNBEGUN, UNSEARCHED
from ..runs.group_search import CLEAR, FOUND, StepArrays, begin_functions, call_find, load_search, take_step
from ..runs.run_log import no_log
from ..runs.run_memory import STATUSES, begin_again, call_driver, end_run, end_step, go_back, is_at_stop, load_restart
from ..runs.tolerances import LONG_STEPS, START_ZERO
from ..workspaces import load_run
from .tolerances import ACCUMULATED, EVENTS_JUDGED, FLIGHT, PENETRATION, PUSHED, ROUNDED

# Where nothing of the user's is asked, a phase is steps, which are searched for its end. The impact of one gap without
# friction, which opens again, is made here, too, where it moves no body that closed contacts hold. What is more is left
# to Python, with the results of the search. Python takes over the impacts of a call afterwards.

SLICE_DONE = int(Status.SLICE_DONE)
ROW = 7  # numbers of an impact


class FlightNumbers(Record):
    """Addresses of what a flight calls, its limits, and how it has ended."""

    driver: int
    context: int  # of the driver, and its run
    run: int
    restart: int  # `run_memory.Restart`
    reader: int  # contexts of what reads states
    read_run: int
    gaps: int  # which group is that of gaps, and their contexts; -1 where no impacts are made here
    rows: int
    own: int
    contacts: int  # `ContactParts`
    impact: int  # `contact_rows.Impact`
    length: float  # m, of the scene
    most: int  # impacts at most
    last: float  # s, of the last impact
    impacts: int  # that there were
    used: int  # rows of the log
    new: int  # whether no step has been searched since the run has begun
    t0: float  # s, where the last step began
    ended: int  # see `fly`
    searched: int  # groups that the last step has been searched for, where Python is to go on


class Flight(NamedTuple):
    """What the kernel of flights has of its own."""

    numbers: FlightNumbers
    searches: np.ndarray  # int64 (groups, 3)  `SearchParts` of each group, and two contexts of its functions
    results: np.ndarray  # int64 (groups,)  of `find_first` in the last step
    sign: np.ndarray  # (gaps,)
    restitution: np.ndarray  # (gaps,)  zero of those whose impacts are left to Python
    lengths: np.ndarray  # (gaps,)  what rounding of gaps is a part of
    hits: np.ndarray  # (gaps, 2)  time and rate of the last impact, as `_ContactRun.hits` has them; infinite before
    closed: np.ndarray  # int64 (gaps,)  1 of those that are closed,
    held: np.ndarray  # int64  and coordinates of their bodies
    gaps: np.ndarray  # scratch
    after: np.ndarray  # (3, n)  scratch
    before: np.ndarray  # (3, n)  q, qd, qdd where the last step began
    remembered: np.ndarray  # and what was remembered there
    struck: np.ndarray  # (4, n)  q, qd, qdd at the last impact, and qd afterwards
    noted: np.ndarray  # what was remembered there
    impacts: np.ndarray  # (impacts, ROW)  time, gap, its value, its rate afterwards, rounding, impulse, energy gained


_none = np.zeros((0, 0))
load_flight = loader(
    Flight(
        FlightNumbers(), np.zeros((0, 0), int), np.zeros(0, int), *np.zeros((3, 0)), _none, *np.zeros((2, 0), int),
        np.zeros(0), _none, _none, np.zeros(0), _none, np.zeros(0), _none,
    )
)  # fmt: skip


@kernel
def is_pushed(t, v, now, low, rate, e):  # six: two hits
    """Whether others have pushed a gap together since its last impact: in a low flight, at a rate beyond e times.

    t, v: that impact, and the largest rate since and just before; rate: now, m/s; low: of flights, m.
    """
    return e < 1.0 and t < now and v * (now - t) <= low and rate > PUSHED * e * v


@kernel
def _leaves_others(f, t, q, rows):
    """Whether an impact, rows as of `Impact`, moves no body of a closed contact, and ends no other event's mode."""
    for j in range(f.held.size):
        if rows[1, f.held[j]] != 0.0:
            return False
    copy(q, f.after[0])
    copy(rows[2], f.after[1])
    copy(rows[3], f.after[2])
    for k in range(f.searches.shape[0]):
        s = load_search(f.searches[k, 0])
        if k != f.numbers.gaps:
            begin_functions(s, f.searches[k, 1], f.searches[k, 2], t, f.after, s.last)
            for j in range(s.last.size):
                if not s.falls[j] * s.last[j] < 0.0:
                    return False
    return True


@kernel
def _strike(f, r, s, i, t):
    """The impact of gap i at t and the state of a search, noted; False where it is more than that of one gap."""
    n, c, w, limit = f.numbers, load_contacts(f.numbers.contacts), load_impact(f.numbers.impact), f.lengths
    if n.impacts >= n.most or t - n.last <= 16.0 * EPS * max(abs(t), EPS) or not t < r.clock.t_end:
        return False
    for j in range(s.beside.size):
        if s.beside[j] != 0:
            return False
    q, qd = s.state[0], s.state[1]
    find_gaps_within(c.rows, load_open_gaps(n.own), t, s.state, n.t0, f.before, s.near, f.gaps)
    for j in range(f.sign.size):
        if j != i and f.closed[j] == 0 and f.gaps[j] <= START_ZERO * limit[j]:
            return False
    x = w.numbers
    x.i, x.sign, x.e, x.lowest = i, f.sign[i], f.restitution[i], FLIGHT * n.length
    if x.e == 0.0 or f.gaps[i] < -PENETRATION * limit[i]:
        return False
    if call_bounce(x.kernel, n.contacts, n.impact, t, q, qd, r.remembered[r.joints.shape[0] :]) != BOUNCES:
        return False
    if not _leaves_others(f, t, q, w.rows):
        return False
    hit, low = f.hits[i], ACCUMULATED * limit[i]
    if is_pushed(hit[0], hit[1], t, low, x.rate / x.e, x.e):
        return False
    hit[0], hit[1] = t, x.rate / x.e
    row, o = f.impacts[n.impacts], load_open_gaps(n.own)
    row[0], row[1], row[2], row[3], row[5] = t, i, f.gaps[i], x.rate, x.p
    row[4] = 0.25 * (EPS * max(n.length, ROUNDED * x.length))
    row[6] = energy_gained(c.free.system, q, qd, w.rows[2], w.inertias)
    n.impacts, n.last = n.impacts + 1, t
    o.counts.opened, o.which[0] = 1, i
    for j in range(4):
        o.start[j, 0] = row[0 if j == 0 else j + 1]
    for j in range(3):
        copy(s.state[j], f.struck[j])
    copy(w.rows[2], f.struck[3])
    return True


@entry("p", no_log(), "i")
def fly(flight, log, most):
    """Make steps and impacts, in up to `most` rows of the log: the Status of the driver.

    The record has how it `ended`: 0 as drivers do; UNSEARCHED after a step that is still to be searched; UNBEGUN after
    an impact, before the run has begun again; NOT_BEGUN where it could not.
    """
    f = load_flight(flight)
    n = f.numbers
    r, at = load_run(n.run), seen(log)
    status, stiff, angles = SLICE_DONE, r.numbers.stiff, r.joints.shape[0]
    n.impacts, n.used, n.ended, n.searched = 0, 0, 0, 0
    while n.used < most:
        for j in range(3):
            copy(r.now[j], f.before[j])
        copy(r.remembered, f.remembered)
        n.t0, steps = r.clock.t, r.numbers.steps
        n.used += 1
        status = call_driver(n.driver, n.context, n.run, at, 1)
        if r.numbers.steps > steps:
            if is_at_stop(r, log):  # where loads may jump
                n.ended = UNSEARCHED
                return status
            arrays = StepArrays(f.before, r.now, r.block, log.charts, log.points)
            left = False  # to Python
            for k in range(f.searches.shape[0]):
                s = load_search(f.searches[k, 0])
                copy(f.remembered[: s.near.size], s.near)
                copy(r.remembered[angles : angles + s.memory.size], s.memory)
                s.numbers.t0, s.numbers.t1, s.numbers.just, s.numbers.new = n.t0, r.clock.t, r.clock.t, n.new
                given = n.reader, n.read_run, f.searches[k, 1], f.searches[k, 2]
                f.results[k] = call_find(s.numbers.finder, f.searches[k, 0], *given, seen(arrays))
                n.searched = k + 1
                left = f.results[k] != CLEAR and (f.results[k] != FOUND or k != n.gaps)
                if left:
                    break
            s = load_search(f.searches[max(n.gaps, 0), 0])
            if not left and (n.gaps < 0 or f.results[n.gaps] == CLEAR):
                for k in range(f.searches.shape[0]):
                    take_step(load_search(f.searches[k, 0]))
                n.new, n.searched = 0, 0
            elif left or not _strike(f, r, s, s.which[s.numbers.found], s.numbers.t):
                n.ended = UNSEARCHED
                return status
            else:
                n.searched = 0
                for j in range(angles):
                    r.remembered[j] = angle_after(r, j, s.state[0], s.state[1], s.numbers.t - r.clock.t)
                end_step(r, log, s.numbers.t, n.t0, s.state)
                copy(f.struck[3], r.now[1])
                copy(r.remembered, f.noted)
                if n.used >= most and log.t_eval.size == 0:  # there is no room for its output
                    n.ended = UNBEGUN
                    return SLICE_DONE
                go_back(load_restart(n.restart), r, log)
                n.used += 1
                status, n.new = call_driver(n.driver, n.context, n.run, at, -1), 1
                for k in range(f.searches.shape[0]):
                    s = load_search(f.searches[k, 0])
                    copy(s.least, s.noise)
                    copy(r.remembered[: s.near.size], s.near)
                    s.odd[:] = 0
                    own = f.searches[k, 1], f.searches[k, 2]
                    if r.numbers.begun == 0 or begin_functions(s, *own, r.clock.t, r.now, s.value) == 0:
                        n.ended = NOT_BEGUN
                        return status
        full = r.numbers.chart_rows + 2 >= log.charts.shape[0]
        if status != SLICE_DONE or full or r.numbers.stiff != stiff:
            return status
    return status


KERNELS = fly, begin_again, end_run


class Flights:
    """The steps of a run of one phase.

    Parameters
    ----------
    contacts : _ContactRun
    groups : list of Group
        The events of its units.
    memory : Memory
    reader : Reader
    bounces : bool
        Whether impacts are made.
    """

    def __init__(self, contacts, groups, memory, reader, bounces):
        gaps, length, searches = contacts.gaps, contacts.length, [group.kernel for group in groups]
        workspace = gaps.workspace
        restitution = np.where(gaps.rough, 0.0, gaps.restitution)
        now, count = memory.run.now, EVENTS_JUDGED * (1 + gaps.count)
        for search in searches:
            search.numbers.reader, context, run = reader.where
        again = memory.restart[0], workspace.impact[1]
        place = next((k for k, group in enumerate(groups) if bounces and group.over == contacts.closing.over), -1)
        self.numbers = FlightNumbers(
            memory.driver.address, *memory.where, again[0], context, run, place, *searches[place].contexts,
            workspace.address, again[1], length,
        )  # fmt: skip
        addresses = np.array([[search.address, *search.contexts] for search in searches], int)
        which, closed = [*contacts.modes.closed, *contacts.modes.idle], np.zeros(gaps.count, int)
        held = np.zeros(0, int)
        if which and place >= 0:
            closed[which], sizes = 1, contacts.scene.system.bodies[:, 1]
            body = np.repeat(np.arange(len(sizes)), sizes)  # of each coordinate
            moved = workspace.rows(contacts.t, contacts.q, which)[0].any(axis=0)
            held = np.flatnonzero(np.isin(body, body[moved]))
        self.parts = Flight(
            self.numbers, addresses, np.zeros(len(groups), int), gaps.sign, restitution, gaps.lengths(length),
            np.empty((gaps.count, 2)), closed, held, np.zeros(workspace.m), np.zeros(now.shape), np.zeros(now.shape),
            memory.run.remembered.copy(), np.zeros((4, now.shape[1])), memory.run.remembered.copy(),
            np.zeros((count, ROW)),
        )  # fmt: skip
        self.contacts, self.groups, (self._at, *self._keep) = contacts, groups, resident(self.parts)

    @staticmethod
    def serve(memory, groups):
        """Whether Python has nothing to do in the steps of a memory, but for the ends of phases."""
        if DEBUG or any(group.kernel is None for group in groups) or "advance" in vars(memory):
            return False
        return memory.weight < LONG_STEPS and not memory.calls_laws

    def advance(self, log, most):
        """As `Memory.advance`; `most` rows of the log."""
        numbers, groups, contacts = self.numbers, self.groups, self.contacts
        numbers.last, numbers.new, workspace = contacts.t, groups[0].is_new, contacts.gaps.workspace
        hits, known = self.parts.hits, contacts.hits
        hits.fill(np.inf)
        hits[list(known)] = list(known.values()) or np.empty((0, 2))
        workspace.enter()
        numbers.contacts = workspace.address
        numbers.most = len(self.parts.impacts) - contacts.judged[1] - 1  # at the next one progress is judged
        status = STATUSES[fly(self._at, log, most)]
        for group in groups:
            group.is_new = bool(numbers.new)
        return status

    def impacts(self):
        """The impacts of the last flight, each its numbers."""
        return self.parts.impacts[: self.numbers.impacts].tolist()
