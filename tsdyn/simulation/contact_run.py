"""Runs of scenes with unilateral constraints: phases between events, impacts, openings; `ts.impact`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analyses.contact_problem import Gaps, Inertia, NoSolution, closed_gaps, impulses, settle
from ..calls import fitting
from ..errors import InconsistentState, InvalidArgument, InvalidConstraint, Status, TsdynError
from ..jit.compiled import clock
from ..maths.tolerances import EPS
from ..model.packed import first_rows
from ..observables import diagnostics, reactions
from ..observables.state import RememberingState, remembered
from ..runs.arguments import interval, output_times, state_arrays
from ..runs.dense_output import StepPieces
from ..runs.events import Event
from ..runs.events import prepare as prepared_events
from ..runs.run_log import ChartLog, RunEnd, StepLog
from ..runs.task import Outcome
from ..validation import floats, listed
from .phase_scenes import NAMED, has_contacts, phase_of
from .progress import reporter, silent
from .run_options import LAWS, RunCall
from .scene_cache import Prepared, prepared
from .segments import summed
from .tolerances import CREEPING, ENDLESS, EVENTS_JUDGED, MOST_AT_AN_INSTANT, PENETRATION, ROUNDED, TOUCHING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..hints import ItemLike, Scene

# A run with contacts is a sequence of phases. A scene has units: gaps, each open or closed. A phase is a run of the
# scene with the units in their modes, the closed gaps as bilateral rows, and ends at the first zero of what a unit
# watches: of an open gap, from above, or of the reaction of a closed one. Then velocities jump by the impulses of an
# impact, where gaps close; those that are closed and at rest stay so as the complementarity problem of accelerations
# says; and the next phase begins. Closed gaps whose rows depend on others, such as that of a fourth leg, are left out
# of the rows: the others hold them.
#
# `Modes` has all that a phase follows from, beside t, q, qd and what the run remembers: a checkpoint needs no more.


class _Closing:
    """The gap of an open contact, as an event function.

    The gap of a contact that has just opened, with a rate, is divided by the time since: so its next zero is found
    however soon it comes.

    Parameters
    ----------
    gaps : Gaps
    i : int
    start : tuple
        Time, gap and rate where the contact has opened with a rate; else empty.
    """

    def __init__(self, gaps, i, start):
        self.gaps, self.i, self.start = gaps, i, start

    def over(self, states):
        """Values (k,) of states at k times."""
        return self(states.t, states)

    def __call__(self, t, state):
        """The value at a state, or values at several."""
        gap = self.gaps.value(self.i, state.q, state.angles if self.gaps.are_counted else None)
        if not self.start:
            return gap
        begun, first, rate = self.start
        since = np.where(t > begun, t - begun, 1.0)
        return np.where(t > begun, (gap - first) / since, rate)


class _Leaving:
    """The reaction of a closed contact, positive where it pushes, as an event function.

    Parameters
    ----------
    packed : Packed
        Of the phase.
    row : int
    sign : float
        Of the gap over Phi.
    seen : dict
        What is shared with the other contacts of the phase.
    """

    def __init__(self, packed, row, sign, seen):
        self.packed, self.row, self.sign, self.seen = packed, row, sign, seen

    def over(self, states):
        """Values (k,) of states at k times."""
        key = states.t.tobytes(), states.q.tobytes()
        if key not in self.seen:  # those of other contacts at the same times are found with it
            self.seen.clear()
            memory = np.tile(states.memory, (states.t.size, 1))
            levels = states.t, states.q, states.qd, states.qdd, memory
            self.seen[key] = reactions.multipliers(self.packed, *levels)
        return -self.sign * self.seen[key][:, self.row]

    def __call__(self, t, state):
        """The value at one state."""
        return -self.sign * state.multipliers[self.row]


class Phases:
    """The phases of a run that has ended: when, with which gaps closed, and where their rows are in those of the scene.

    Attributes
    ----------
    list : list of (float, float, tuple of str)
        Start, end (s) and names of the closed contacts.
    impulses : list of (float, str, float)
        Time (s), name, impulse (N s, or N m s of an angle).
    """

    def __init__(self, packed):
        self.list, self.impulses, self.starts, self.of = [], [], [], []
        self.packed, self._columns = [], []  # of each set of closed gaps
        self._rows, self._kinds = _rows_of(packed), {}

    def add(self, begin, rest, end, packed, names):
        """Add the next phase: from `begin`, s, or as `list` has it from `rest`, when flights below rounding end."""
        kind = self._kinds.setdefault(id(packed), len(self.packed))
        if kind == len(self.packed):
            own = _rows_of(packed)
            pairs = [(self._rows[part] + i, own[part] + i) for part, i in _numbered(packed) if part in self._rows]
            self.packed.append(packed)
            self._columns.append(np.array(pairs, int).reshape(-1, 2).T)
        if self.list:
            self.list[-1] = (self.list[-1][0], rest, self.list[-1][2])
        self.starts.append(begin)
        self.of.append(kind)
        self.list.append((rest, max(rest, end), names))

    def at(self, t):
        """Numbers of the phases at times t (k,); where one begins, the later one."""
        return np.maximum(np.searchsorted(self.starts, t, side="right") - 1, 0)

    def multipliers(self, numbers, m, *arrays):
        """Multipliers (k, m) of all rows of the scene: zero of open contacts; arrays as of `reactions.multipliers`."""
        out = np.zeros((len(numbers), m))
        for kind, mine, some in self._gathered(numbers, arrays):
            rows, columns = self._columns[kind]
            out[np.ix_(mine, rows)] = reactions.multipliers(self.packed[kind], *some)[:, columns]
        return out

    def constraint_error(self, numbers, *arrays):
        """The `ConstraintError` of the rows that hold."""
        out = np.zeros((3, len(numbers)))
        for kind, mine, some in self._gathered(numbers, arrays):
            out[:, mine] = diagnostics.constraint_error(self.packed[kind], *some)
        return diagnostics.ConstraintError(*out)

    def _gathered(self, numbers, arrays):
        """Yield each set of closed gaps, the entries (j,) of arrays in its phases, and these parts of the arrays."""
        kinds = np.array(self.of)[numbers]
        for kind in np.unique(kinds).tolist():
            mine = np.flatnonzero(kinds == kind)
            yield kind, mine, [None if array is None else array[mine] for array in arrays]


def _rows_of(packed):
    """The first row of each primitive, by its id."""
    return {id(part): first for part, first in first_rows(packed.constraints)}


def _numbered(packed):
    """Yield the id of the primitive of each row, and which of its rows it is."""
    for part in packed.constraints:
        yield from ((id(part), i) for i in range(part.all_rows))


class _Pieces(StepPieces):
    """Dense output of phases: where one begins, its own."""

    side = "right"


def demand_apart(gaps, q, angles, tol):
    """Raise InconsistentState where gaps are below zero."""
    values = gaps.at(q, angles)
    deep = np.flatnonzero(values < -tol * (1.0 + np.abs(q).max()))
    if deep.size:
        found = listed([f"{gaps.names[i]} {gaps.list[i].contact.excess} by {-values[i]:.3g}" for i in deep], NAMED)
        raise InconsistentState(
            f"at the start (m, or rad): {found}. Move the bodies, or have scene.assemble() close these gaps."
        )


@dataclass
class Modes:
    """The modes of the units of a scene: numbers of gaps."""

    closed: list = field(default_factory=list)  # independent rows, with reactions
    idle: list = field(default_factory=list)  # closed by what others hold
    opened: dict = field(default_factory=dict)  # time, gap and rate where a contact has just opened with a rate


class _ContactRun:
    """One run in the making.

    Parameters
    ----------
    scene : Scene
        With contacts.
    options : RunOptions
    call : RunCall
    run_of : function of a scene, options and a call
        Returns the `Run` of a phase.
    run_task : function of a task, a scene and the tolerance of its start
    instead : function of a task and a status
        Returns the method that begins again, or None.
    """

    def __init__(self, scene, options, call, run_of, run_task, instead):
        self.scene, self.options, self.call = scene, options, call
        self.run_of, self.run_task, self.instead = run_of, run_task, instead
        self.span = interval(call.t_span)
        self.times = output_times(call.t_eval, *self.span)
        self.per_step, self.taken = self.times.size == 0, 0
        kept = prepared(phase_of(scene, []))
        self._demand_served(kept)
        self.gaps = gaps = Gaps(scene.packed)
        self.count = kept.handles.count
        self.t = self.span[0]
        self.q, self.qd = scene._initial() if call.state is None else state_arrays(call.state, kept.n)
        self.remembered = remembered(call.state, kept, self.t, self.q)
        self.length = max(scene.packed.size, float(np.abs(self.q).max()))
        demand_apart(gaps, self.q, self.remembered[: self.count], options.initial_tol)
        self.users = prepared_events(options.events) or []
        self.modes, self.rest = Modes(), self.t
        self.parts, self.found, self.report = [], [[] for _ in self.users], reporter(call.progress)
        self.phases, self.counts, self.steps = Phases(scene.packed), [0] * len(self.users), 0
        self.reason, self.method, self.at_once, self.judged = "", "", 0, (self.t, 0)

    def _demand_served(self, kept):
        names = [gap for gap, given in (("store", self.call.store), ("checkpoint", self.call.checkpoint)) if given]
        if names:
            raise InvalidArgument(f"{names[0]} doesn't serve scenes with contacts yet: keep the outputs in memory.")
        if kept.sampled:
            raise InvalidArgument(
                "sampled controllers don't serve scenes with contacts yet: leave out period, for a continuous one."
            )
        if kept.rough:
            raise InvalidArgument(
                f"friction that depends on reactions ({', '.join(kept.rough)}) doesn't serve scenes with contacts yet: "
                "use friction of given magnitude, such as ViscousFriction."
            )

    def run(self):
        """Run to the end; the `Task` of the first phase and the `Outcome` of all."""
        began, first = clock(), None
        touching = closed_gaps(self.gaps, self.q, self.remembered[: self.count], self.options.initial_tol)
        status = self._settle(touching, ())
        while status is None:
            try:
                task, outcome = self._phase()
            except TsdynError as error:
                if not self.parts:
                    raise
                status, self.reason = Status.SINGULAR, str(error)
                break
            first = first or task
            self.parts.append(outcome)
            status = self._after(outcome)
        if first is None:  # nothing could begin
            raise InconsistentState(f"{status.sentence} {self.reason} {status.remedy}")
        self.report(None)
        return first._replace(prepared=Prepared(self.scene, self.scene.packed), span=self.span), self._outcome(
            status, began
        )

    # One phase

    def _phase(self):
        """Run the next phase: its task and outcome."""
        end = self.span[1]
        phase, names = self._scene(), self._names()
        call, plain = RunCall((self.t, end)), replace(self.options, events=None)
        run = self.run_of(phase, plain, call)
        run._prepare_kernels(True)
        while True:
            task = run._new_task(call, (self.q, self.qd), self.remembered)
            task = task._replace(
                events=self._events(phase), within=True, report=self._reporting(), times=self._times(),
                max_steps=self._steps_left(),
            )  # fmt: skip
            outcome = self.run_task(task, phase, self.options.initial_tol)
            other = self.instead(task, outcome.status)
            if other is None:
                self.phases.add(self.t, self.rest, outcome.end.reached, phase.packed, names)
                return task, outcome
            run = run._by(other)

    def _scene(self):
        """The scene of the present modes."""
        return phase_of(self.scene, [self.gaps.list[i].side.row for i in self.modes.closed])

    def _names(self):
        """Names of the units whose rows hold."""
        held = sorted([*self.modes.closed, *self.modes.idle])
        return tuple(dict.fromkeys(self.gaps.names[i] for i in held))

    def _events(self, phase):
        """Events of a phase: the user's, then one for each of the units `watched`."""
        pairs = zip(self.users, self.counts, strict=True)
        found = [event._replace(limit=event.limit - count) for event, count in pairs]
        watches = list(self._watches(phase.packed))
        self.watched = [None] * len(found) + [unit for unit, _ in watches]
        return found + [event for _, event in watches]

    def _watches(self, packed):
        """Yield the units that may end a phase, each with its event."""
        gaps, modes, pushes = self.gaps, self.modes, {}
        first = {id(member.constraint): member.rows.start for member in packed.members}
        for i in range(gaps.count):
            if i in modes.idle:
                continue
            row, sign = gaps.list[i].side.row, gaps.list[i].side.sign
            if i in modes.closed:
                event = _Leaving(packed, first[id(row)], sign, pushes)
            else:
                event = _Closing(gaps, i, modes.opened.get(i, ()))
            yield i, Event(event, gaps.names[i], 1.0, -1.0, i not in modes.closed)

    def _times(self):
        left = self.times[self.taken :]
        return left if left.size or self.per_step else np.array([np.inf])  # an empty array would ask for every step

    def _steps_left(self):
        most = self.options.max_steps
        return None if most is None else max(most - self.steps, 0)

    def _reporting(self):
        if self.report is silent:
            return silent
        (start, end), t, done = self.span, self.t, self.steps

        def report(fraction, at=0.0, steps=0):
            if fraction is not None:
                self.report((t + fraction * (end - t) - start) / (end - start), at, done + steps)

        return report

    # What a phase ends with

    def _after(self, outcome):
        """Take the end of a phase; the Status of the run, None if it goes on."""
        end, gaps = outcome.end, self.gaps
        self.reason, self.method = outcome.reason, outcome.method or self.method
        self.steps += end.counts["steps"]
        times, *states = outcome.events
        for i, mine in enumerate(list(zip(times, *states, strict=True))[: len(self.users)]):
            self.found[i].append(mine)
            self.counts[i] += len(mine[0])
        self.t, (self.q, self.qd, _) = end.reached, (x.copy() for x in end.last)
        self.remembered = end.remembered
        fired = [i for i, at in zip(self.watched, times, strict=True) if i is not None and at.size]
        goes_on = outcome.status is Status.EVENT and fired and self.t < self.span[1]
        rows = outcome.rows
        if not self.per_step and goes_on and len(rows) and rows[-1, 0] == self.t:  # that of the next phase counts
            self.parts[-1] = outcome._replace(rows=rows[:-1])
        self.taken += len(self.parts[-1].rows)
        values = gaps.at(self.q, self.remembered[: self.count])
        deep = [i for i in range(gaps.count) if values[i] < -PENETRATION * self.length]
        if deep:
            self.reason = (
                f"Penetration was not noticed: {listed([gaps.names[i] for i in deep], NAMED)}. Give a max_step."
            )
            return Status.CONTACT_FAILED
        if not goes_on:
            return Status.SUCCESS if outcome.status is Status.EVENT and fired else outcome.status
        self.reason = ""
        if self._is_stuck():
            return Status.CONTACT_FAILED
        near = [i for i in range(gaps.count) if values[i] <= TOUCHING * self.length]
        return self._settle(sorted({*near, *fired, *self.modes.closed, *self.modes.idle}), fired)

    def _is_stuck(self):
        """Whether events no longer let time go on; says so."""
        since, count = self.judged
        length = self.t - self.phases.starts[-1]
        self.at_once = self.at_once + 1 if length <= 16.0 * EPS * max(abs(self.t), EPS) else 0
        self.judged = since, count + 1
        if self.at_once > MOST_AT_AN_INSTANT + self.gaps.count:
            self.reason = f"There are {self.at_once} events at t = {self.t:.9g} s."
            return True
        if count + 1 >= EVENTS_JUDGED:
            if (self.span[1] - self.t) > CREEPING * (self.t - since):
                self.reason = f"The last {count + 1} events took {self.t - since:.3g} s: they accumulate."
                return True
            self.judged = self.t, 0
        return False

    def _settle(self, touching, fired):
        """Impact, then which gaps stay closed; the Status if there is no way on, else None."""
        slots, values = self.remembered[self.count :], self.gaps.at(self.q, self.remembered[: self.count])
        before, self.modes, self.rest = self.modes, Modes(), self.t
        if not touching:
            return None
        try:
            inertia = Inertia(self.gaps, self.t, self.q, self.qd, slots)
            rates = inertia.rates(self.qd)
            noise = [i for i in fired if i not in before.closed and rates[i] > 0.0]
            if noise:  # a gap that closes with a rate of rounding
                self.qd, rates = held(inertia, self.qd, noise, rates)
            if (rates[touching] < 0.0).any():
                rates = self._hit(inertia, touching, rates)
            resting = [i for i in touching if rates[i] == 0.0]
            opened = {i: (self.t, values[i], rates[i]) for i in touching if rates[i] > 0.0}
            leaving = [i for i in fired if i in before.closed]
            stay = settle(inertia, resting, self.qd, leaving)[:2] if resting else ([], [])
            self.modes = Modes(*stay, opened)
        except NoSolution:
            names = listed(list(dict.fromkeys(self.gaps.names[i] for i in touching)), NAMED)
            self.reason = f"No reactions keep these contacts from penetrating at t = {self.t:.9g} s: {names}."
            return Status.CONTACT_FAILED
        return None

    def _hit(self, inertia, touching, rates):
        """Jump of velocities at an impact; the rates (count,) afterwards."""
        e, before = self.gaps.restitution[touching].copy(), rates[touching]
        p, qd, after = self._jump(inertia, touching, before, e)
        # Impacts that are followed by flights below rounding are the last ones
        a = self._lowering(inertia, touching, qd, after)
        last = [k for k, i in enumerate(touching) if a[i] > 0.0 and p[k] > 0.0 and e[k] > 0.0]
        if last:
            flights = [2.0 * after[touching[k]] / (a[touching[k]] * (1.0 - e[k])) for k in last if e[k] < 1.0]
            self.rest = float(max([self.rest, *(self.t + T for T in flights)]))
            e[last] = 0.0
            p, qd, after = self._jump(inertia, touching, before, e)
            a = self._lowering(inertia, touching, qd, after)
        # Contacts that another impact lifts by less than rounding stay closed
        for _ in touching:
            if not a.any():
                break
            qd, after = held(inertia, qd, [i for i in touching if a[i] > 0.0 or after[i] == 0.0], after)
            if (after[touching] < 0.0).any():
                more, qd, after = self._jump(inertia, touching, after[touching], np.zeros(len(touching)), qd)
                p = p + more
            a = self._lowering(inertia, touching, qd, after)
        self.qd = qd
        named = zip(touching, p, strict=True)
        self.phases.impulses += [(self.t, self.gaps.names[i], float(x)) for i, x in named if x > 0.0]
        return after

    def _jump(self, inertia, touching, before, e, qd=None):
        """Impulses (k,) of an impact, velocities (n,) and rates (count,) after it."""
        law = self.options.law
        p = impulses(inertia, touching, before, e, law)
        return p, *jumped(inertia, self.qd if qd is None else qd, touching, before, e, p, law)

    def _lowering(self, inertia, touching, qd, rates):
        """Decelerations (count,) of the gaps that open and close again within rounding of the gap; zero of others."""
        opening = [i for i in touching if rates[i] > 0.0]
        if not opening:
            return np.zeros(self.gaps.count)
        a = -settle(inertia, [i for i in touching if rates[i] == 0.0], qd).accelerations
        rounding = EPS * np.maximum(self.length, ROUNDED * (np.abs(inertia.J) @ np.abs(self.q)))
        rounding[self.gaps.restitution == 1.0] = ENDLESS * self.length  # flights that would never get lower
        mine = np.isin(np.arange(a.size), opening)
        return np.where(mine & (a > 0.0) & (rates * rates < 2.0 * a * rounding), a, 0.0)

    # The whole

    def _outcome(self, status, began):
        parts = self.parts
        ends = [part.end for part in parts]
        last = ends[-1]
        logs = self.options.history is not False
        numbers = np.repeat(np.arange(len(parts)), [len(part.rows) for part in parts])
        events = None
        if self.options.events is not None:
            columns = [list(zip(*known, strict=True)) for known in self.found]
            events = tuple([np.concatenate(column[k]) for column in columns] for k in range(3))
        return Outcome(
            status, self.reason, np.concatenate([part.rows for part in parts]),
            RunEnd(
                last.reached, last.last, last.remembered,
                summed([end.counts for end in ends]),
                StepLog([end.steps for end in ends]) if logs else None,
                ChartLog([end.charts for end in ends]) if logs else None,
            ),
            _Pieces([part.trajectory for part in parts]) if self.options.dense_output else None,
            events, began, self.method, (self.phases, numbers),
        )  # fmt: skip


def jumped(inertia, qd, which, before, e, p, law="newton"):
    """Velocities (n,) after impulses p (k,) of the gaps `which`, and the rates (count,) of all gaps then."""
    change = inertia.free(inertia.J[which].T @ p)
    after = inertia.rates(qd + change, np.abs(qd) + np.abs(change))
    after[which] = np.maximum(after[which], 0.0)  # but for rounding
    if law == "newton":  # without rounding where the impact acts
        for k, i in enumerate(which):
            if p[k] > 0.0:
                after[i] = -e[k] * min(before[k], 0.0)
    return qd + change, after


def held(inertia, qd, which, rates):
    """Velocities (n,) and rates (count,) after the least change, by kinetic energy, that ends some rates."""
    change = inertia.hold(which, rates[which])
    after = inertia.rates(qd + change, np.abs(qd) + np.abs(change))
    after[which] = 0.0
    return qd + change, after


def run_contacts(scene, options, call, run_of, run_task, instead):
    """The `Task` and the `Outcome` of a run of a scene with contacts; the functions are those of `prepared_run`."""
    return _ContactRun(scene, options, call, run_of, run_task, instead).run()


@fitting
def impact(
    scene: Scene,
    state: Any,
    contacts: Sequence[ItemLike] | None = None,
    restitution: float | Mapping[Any, float] | None = None,
    law: str = "newton",
) -> tuple[RememberingState, dict[str, float]]:
    """Return the state after an impact of all closed contacts at once, in the metric of kinetic energy.

    Parameters
    ----------
    scene : Scene
        With unilateral constraints.
    state : State
        At the impact, such as `solution.state`; its positions are kept.
    contacts : sequence of unilateral constraints or names, optional
        Those that are closed; by default those whose gap is zero at the state, to 1e-9.
    restitution : float, or mapping of contacts or names to floats, optional
        Coefficients in place of those of the contacts.
    law : {"newton", "poisson"}
        Newton's law in Moreau's form, gd+ = -e gd- where a contact pushes; or Poisson's law: the impulse of restitution
        is e times that of compression. Both keep or lower the energy.

    Returns
    -------
    state : State
    impulses : dict of str to float
        By names of the contacts; N s, or N m s of an angle.

    Raises
    ------
    InvalidArgument
        If law, state or a coefficient is inadmissible, or the scene has no contacts.
    InvalidConstraint
        If a contact is none of the scene.
    InconsistentState
        If no impulses keep the contacts from penetrating.

    Notes
    -----
    The bilateral constraints hold during the impact. With 0 <= v+ + e v-, 0 <= p complementary, v+ is unique; the
    impulses p of redundant contacts are one of the possible solutions.

    Examples
    --------
    The first of three equal balls in contact is hit; plastic impacts leave all with the same velocity:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, 0))
    >>> balls = [scene.add_point_mass(mass=1.0, position=(0.1 * i, 0, 0), name=f"ball {i}") for i in range(3)]
    >>> balls[0].velocity = (1, 0, 0)
    >>> for i in range(2):
    ...     gap = ts.constraints.SphereContact(balls[i], balls[i + 1], radius_a=0.05, radius_b=0.05, name=f"gap {i}")
    ...     _ = scene.add(gap)
    >>> q, qd = scene.start
    >>> after, impulses = ts.impact(scene, ts.State(0.0, q, qd), restitution=0.0)
    >>> print(after.qd[::3].round(6), {name: round(p, 6) for name, p in impulses.items()})
    [0.333333 0.333333 0.333333] {'gap 0': 0.666667, 'gap 1': 0.333333}
    """
    if law not in LAWS:
        raise InvalidArgument(f"law must be 'newton' or 'poisson', got {law!r}.")
    if not has_contacts(scene):
        raise InvalidArgument("impact: the scene has no unilateral constraints, such as PlaneContact(unilateral=True).")
    gaps, kept = Gaps(scene.packed), prepared(phase_of(scene, []))
    q, qd = state_arrays(state, kept.n)
    t = float(getattr(state, "t", 0.0))
    memory = remembered(state, kept, t, q)
    angles, slots = memory[: kept.handles.count], memory[kept.handles.count :]
    near = closed_gaps(gaps, q, angles)
    which = near if contacts is None else _chosen(gaps, contacts, near)
    e = gaps.restitution.copy()
    if isinstance(restitution, dict):
        for item, value in restitution.items():
            e[_chosen(gaps, [item], None)] = _coefficient(value)
    elif restitution is not None:
        e[:] = _coefficient(restitution)
    inertia = Inertia(gaps, t, q, qd, slots)
    before = inertia.rates(qd)[which]
    try:
        p = impulses(inertia, which, before, e[which], law)
    except NoSolution as error:
        names = listed(list(dict.fromkeys(gaps.names[i] for i in which)), NAMED)
        raise InconsistentState(f"impact: no impulses keep these contacts from penetrating: {names}.") from error
    after, _ = jumped(inertia, qd, which, before, e[which], p, law)
    found = {gaps.names[i]: 0.0 for i in which}
    for i, x in zip(which, p, strict=True):
        found[gaps.names[i]] += float(x)
    anchor = getattr(state, "anchor", None)
    levels = np.zeros(kept.n), np.zeros(len(scene.packed.system.segments))
    return RememberingState.of(scene.packed, slots, anchor, t, q.copy(), after, *levels), found


def _chosen(gaps, items, near):
    """Numbers of the gaps of some contacts; of a stop with two bounds the one that is near."""
    found = []
    for item in items:
        mine = [i for i, gap in enumerate(gaps.list) if item is gap.contact or item == gap.contact.name]
        if not mine:
            raise InvalidConstraint(f"impact: {item!r} is no unilateral constraint of the scene.")
        found += mine if near is None or len(mine) == 1 else [i for i in mine if i in near]
    return sorted(set(found))


def _coefficient(value):
    e = floats(value)
    if e.shape != () or not 0.0 <= e <= 1.0:
        raise InvalidArgument(f"impact: restitution must be from 0 to 1, got {value!r}.")
    return float(e)
