"""Runs from impact to impact by one kernel call: steps, their searches, and impacts of single gaps without friction."""

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
from ..runs.group_search import CLEAR, FOUND, StepArrays, begin_functions, call_find, load_search
from ..runs.run_log import no_log
from ..runs.run_memory import STATUSES, begin_again, call_driver, go_back, load_restart
from ..runs.tolerances import LONG_STEPS, START_ZERO
from ..workspaces import B_END, STORED, load_run
from .tolerances import ACCUMULATED, EVENTS_JUDGED, FLIGHT, PENETRATION, PUSHED, ROUNDED

# Where nothing of the user's is asked, and no gap is closed, a run is steps and impacts. What is more than the impact
# of one gap, which opens again, is left to Python: there the last step is searched once more. Python takes over the
# impacts of a call afterwards.

SLICE_DONE = int(Status.SLICE_DONE)
ROW = 7  # numbers of an impact


class FlightNumbers(Record):
    """Addresses of what a flight calls, its limits, and how it has ended."""

    driver: int
    context: int  # of the driver, and its run
    run: int
    restart: int  # `run_memory.Restart`
    search: int  # `SearchParts`
    reader: int  # contexts of what reads states
    read_run: int
    rows: int  # contexts of the functions
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


class Flight(NamedTuple):
    """What the kernel of flights has of its own."""

    numbers: FlightNumbers
    sign: np.ndarray  # (gaps,)
    restitution: np.ndarray  # (gaps,)  zero of those whose impacts are left to Python
    lengths: np.ndarray  # (gaps,)  what rounding of gaps is a part of
    hits: np.ndarray  # (gaps, 2)  time and rate of the last impact, as `_ContactRun.hits` has them; infinite before
    least: np.ndarray  # (m,)  rounding of the functions
    gaps: np.ndarray  # scratch
    before: np.ndarray  # (3, n)  q, qd, qdd where the last step began
    remembered: np.ndarray  # and what was remembered there
    struck: np.ndarray  # (4, n)  q, qd, qdd at the last impact, and qd afterwards
    noted: np.ndarray  # what was remembered there
    impacts: np.ndarray  # (impacts, ROW)  time, gap, its value, its rate afterwards, rounding, impulse, energy gained


_none = np.zeros((0, 0))
load_flight = loader(
    Flight(FlightNumbers(), *np.zeros((3, 0)), _none, *np.zeros((2, 0)), _none, np.zeros(0), _none, np.zeros(0), _none)
)


@kernel
def _end_step(r, log, t, t0, state):
    """As `Watch._end`."""
    numbers, n = r.numbers, r.now.shape[1]
    for j in range(r.joints.shape[0]):
        r.remembered[j] = angle_after(r, j, state[0], state[1], t - r.clock.t)
    r.clock.t = t
    for j in range(3):
        copy(state[j], r.now[j])
    if log.t_eval.size > 0:
        while numbers.rows > 0 and log.out[numbers.rows - 1, 0] > t:
            numbers.rows -= 1
    elif t > t0:
        row = log.out[numbers.rows - 1]
        row[0] = t
        for j in range(3):
            copy(state[j], row[1 + j * n : 1 + (j + 1) * n])
        copy(r.remembered, row[1 + 3 * n :])
    else:
        numbers.rows -= 1
    if numbers.dense == STORED:
        log.blocks[numbers.blocks - 1, B_END] = t


@kernel
def is_pushed(t, v, now, low, rate, e):  # six: two hits
    """Whether others have pushed a gap together since its last impact: in a low flight, at a rate beyond e times.

    t, v: that impact, and the largest rate since and just before; rate: now, m/s; low: of flights, m.
    """
    return e < 1.0 and t < now and v * (now - t) <= low and rate > PUSHED * e * v


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
        if j != i and f.gaps[j] <= START_ZERO * limit[j]:
            return False
    x = w.numbers
    x.i, x.sign, x.e, x.lowest = i, f.sign[i], f.restitution[i], FLIGHT * n.length
    if x.e == 0.0 or f.gaps[i] < -PENETRATION * limit[i]:
        return False
    if call_bounce(x.kernel, n.contacts, n.impact, t, q, qd, r.remembered[r.joints.shape[0] :]) != BOUNCES:
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
    r, s, at = load_run(n.run), load_search(n.search), seen(log)
    status, stiff = SLICE_DONE, r.numbers.stiff
    n.impacts, n.used, n.ended = 0, 0, 0
    while n.used < most:
        for j in range(3):
            copy(r.now[j], f.before[j])
        copy(r.remembered, f.remembered)
        copy(r.remembered[: s.near.size], s.near)
        n.t0, steps = r.clock.t, r.numbers.steps
        n.used += 1
        status = call_driver(n.driver, n.context, n.run, at, 1)
        if r.numbers.steps > steps:
            s.numbers.t0, s.numbers.t1 = n.t0, r.clock.t
            arrays = StepArrays(f.before, r.now, r.block, log.charts, log.points)
            found = call_find(s.numbers.finder, n.search, n.reader, n.read_run, n.rows, n.own, seen(arrays))
            if found == CLEAR:
                n.new = 0
            elif found != FOUND or not _strike(f, r, s, s.which[s.numbers.found], s.numbers.t):
                n.ended = UNSEARCHED
                return status
            else:
                _end_step(r, log, s.numbers.t, n.t0, s.state)
                copy(f.struck[3], r.now[1])
                copy(r.remembered, f.noted)
                if n.used >= most and log.t_eval.size == 0:  # there is no room for its output
                    n.ended = UNBEGUN
                    return SLICE_DONE
                go_back(load_restart(n.restart), r, log)
                n.used += 1
                status, n.new = call_driver(n.driver, n.context, n.run, at, -1), 1
                copy(f.least, s.noise)
                copy(r.remembered[: s.near.size], s.near)
                if r.numbers.begun == 0 or begin_functions(s, n.rows, n.own, r.clock.t, r.now, s.value) == 0:
                    n.ended = NOT_BEGUN
                    return status
        full = r.numbers.chart_rows + 2 >= log.charts.shape[0]
        if status != SLICE_DONE or full or r.numbers.stiff != stiff:
            return status
    return status


KERNELS = fly, begin_again


class Flights:
    """The flights of a run of one phase.

    Parameters
    ----------
    contacts : _ContactRun
        All gaps that are able to close are open.
    group : Group
        Their events.
    memory : Memory
    reader : Reader
    """

    def __init__(self, contacts, group, memory, reader):
        kernel, gaps, length = group.kernel, contacts.gaps, contacts.length
        workspace = gaps.workspace
        restitution = np.where(gaps.rough, 0.0, gaps.restitution)
        now, count = memory.run.now, EVENTS_JUDGED * (1 + gaps.count)
        (rows, own), where = kernel.contexts, memory.where
        kernel.numbers.reader, context, run = reader.where
        self.numbers = FlightNumbers(
            memory.driver.address, *where, memory.restart[0], kernel.address, context, run, rows, own,
            workspace.address, workspace.impact[1], length,
        )  # fmt: skip
        self.parts = Flight(
            self.numbers, gaps.sign, restitution, gaps.lengths(length), np.empty((gaps.count, 2)), group.least,
            np.zeros(workspace.m), np.zeros(now.shape), memory.run.remembered.copy(), np.zeros((4, now.shape[1])),
            memory.run.remembered.copy(), np.zeros((count, ROW)),
        )  # fmt: skip
        self.contacts, self.group, (self._at, *self._keep) = contacts, group, resident(self.parts)

    @staticmethod
    def serve(memory, group):
        """Whether Python has nothing to do in the steps of a memory, but for impacts."""
        if DEBUG or group.kernel is None or not memory.begins_again or "advance" in vars(memory):
            return False
        return memory.weight < LONG_STEPS and not memory.calls_laws

    def advance(self, log, most):
        """As `Memory.advance`; `most` rows of the log."""
        numbers, group, contacts = self.numbers, self.group, self.contacts
        numbers.last, numbers.new, workspace = contacts.t, group.is_new, contacts.gaps.workspace
        hits, known = self.parts.hits, contacts.hits
        hits.fill(np.inf)
        hits[list(known)] = list(known.values()) or np.empty((0, 2))
        workspace.enter()
        numbers.contacts = workspace.address
        numbers.most = len(self.parts.impacts) - contacts.judged[1] - 1  # at the next one progress is judged
        status = STATUSES[fly(self._at, log, most)]
        group.is_new = bool(numbers.new)
        return status

    def impacts(self):
        """The impacts of the last flight, each its numbers."""
        return self.parts.impacts[: self.numbers.impacts].tolist()
