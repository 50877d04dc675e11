"""Gaps of contacts, their rows, and what loads do where the bilateral rows hold: kernels, and their workspace.

J, gd = J qd + Phi_t, gdd = J qdd + gamma       rows of Phi that are gaps, times their signs
H W H^T lam = H W f,  a = W (f - H^T lam)       H: bilateral rows                                           (1)
"""

import math
import threading
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from ..elements.loops.constraint_rows import move_bodies, place_bodies, take_loads, write_accelerations
from ..errors import SingularConfiguration
from ..formulations.accelerations import accelerate_with_friction, refine_accelerations, solve_accelerations
from ..formulations.tolerances import EXACT, REFINEMENTS
from ..jit.kernels import ANY, Record, callback, caller, entry, kernel, loader, long_kernel, matrix, resident, vector
from ..maths.central_path import follow
from ..maths.complementarity import CONES
from ..maths.dense_linalg import copy, largest
from ..maths.dense_solve import KERNELS as EQUATIONS
from ..maths.root_isolation import SURVEYING
from ..maths.tolerances import LAST_PLACE, NEGLIGIBLE
from ..maths.vectors import add, spin, subtract
from ..model.equations import (
    WIDTH,
    acceleration_bias,
    constraint_jacobian,
    constraints,
    inertia_rows,
    multiply_inertia_row,
    recall,
    set_time,
    time_derivative,
    with_short_rows,
)
from ..model.joint_turns import counted_angle, find_counted_angles
from ..model.laws import calls_laws, interrupts_answered
from ..model.packed import System, no_system
from ..observables.evaluate import NO_INERTIA
from ..rows.constraint_graph import BIAS, REDUCED, graph_of
from ..rows.interface import (
    DYNAMICS,
    constrain,
    constrain_accelerations,
    evaluate_bias,
    evaluate_rows,
    factorise_rows,
    mark_redundant,
    reset_selection,
    weigh_bodies,
    with_all_rows,
)
from ..runs.group_search import SEARCHING, VALUES
from ..workspaces import Parts, load_parts, no_parts, parts
from .tolerances import JUST_OPENED


class ContactParts(NamedTuple):
    """What kernels of contacts find by one address."""

    free: Parts  # of the scene with all contacts open
    rows: System  # of the contacts alone


load_contacts = loader(ContactParts(no_parts(), no_system()))


@entry("pvmvm")
def find_gaps(context, t, q, sign, out):
    """out (k, m) = Phi of contacts, of the first rows times their sign, at times t (k,) and positions q (k, n).

    Rows of q may go on.
    """
    s = load_contacts(context).rows
    for k in range(t.size):
        find_gaps_at(s, t[k], q[k], sign, out[k])


@kernel
def find_gaps_at(s, t, q, sign, out):
    """The same at one time."""
    set_time(s, t)
    constraints(s, q, t, out)
    for i in range(sign.size):
        out[i] *= sign[i]


@entry("vwmm")
def measure_opened(t, which, start, values):
    """Divide gaps by the time since they have opened, in values (k, gaps) at times t (k,), or add rounding to them.

    start (4, opened): time, gap, rate and rounding where those of the numbers `which` have opened; without a rate the
    second. The first are rate + (gap / time - rate) / (1 + y^7), y = rounding / (rate time): the rate at once, where
    gaps are rounding, and gap / time where they close.
    """
    for k in range(t.size):
        _measure_opened(t[k], which, start, values[k])


@kernel
def _measure_opened(t, which, start, values):
    for j in range(which.size):
        begun, first, rate, rounding = start[0, j], start[1, j], start[2, j], start[3, j]
        grown, since = values[which[j]] - first, t - begun
        if not rate > 0.0:
            values[which[j]] = grown + rounding
        elif since > 0.0:
            mean, y = grown / since, rounding / (rate * since)
            if y > JUST_OPENED:  # else it would be the sign of gaps that are zero to the last digit
                square = y * y
                mean = rate + (mean - rate) / (1.0 + square * square * square * y)
            values[which[j]] = mean
        else:
            values[which[j]] = rate


class GapCounts(Record):
    """Numbers of rows of contacts, of gaps that have just opened, and of coordinates."""

    rows: int
    opened: int
    n: int


class ImpactNumbers(Record):
    """Of the impact of one gap."""

    kernel: int  # the address of `bounce_off`
    i: int  # its number
    sign: float
    e: float
    lowest: float  # m or rad; a flight that is lower is none
    p: float  # its impulse
    rate: float  # afterwards
    length: float  # sizes of the terms of the gap


class Stops(NamedTuple):
    """The gaps that are sign (angle - bound), of angles of joints."""

    gaps: np.ndarray  # int64 (stops,)  their numbers
    angles: np.ndarray  # int64 (stops,)  those of the angles
    bounds: np.ndarray  # (stops,)
    joints: np.ndarray  # int64 (4 angles,)  as of `find_counted_angles`
    frames: np.ndarray  # (angles, 9)


class OpenGaps(NamedTuple):
    """What is known of open gaps."""

    counts: GapCounts
    sign: np.ndarray  # (gaps,)  of a gap over Phi
    which: np.ndarray  # int64 (gaps,)  those that have just opened come first
    start: np.ndarray  # (4, gaps)  as of `measure_opened`
    stops: Stops


load_rows = loader(no_system())
_none = np.zeros(0, int)
_no_stops = Stops(_none, _none, np.zeros(0), _none, np.zeros((0, 9)))
load_open_gaps = loader(OpenGaps(GapCounts(), np.zeros(0), _none, np.zeros((4, 0)), _no_stops))


@kernel
def find_gaps_within(s, gaps, t, state, t0, before, near, out):  # eight: and where the step began
    """out (rows,) = the gaps first, at t and a state (3, n); near (angles,): of joints at t0 and `before`, roughly."""
    find_gaps_at(s, t, state[0], gaps.sign, out)
    stops = gaps.stops
    for k in range(stops.gaps.size):
        i, j = stops.gaps[k], stops.angles[k]
        place = stops.joints[4 * j : 4 * j + 4]
        angle = counted_angle(place, stops.frames[j], before, near[j], t - t0, state[0], state[1])
        out[i] = gaps.sign[i] * (angle - stops.bounds[k])


@callback(VALUES)
def find_open_gaps(contacts, own, t, state, out, t0, before, near):  # eight: VALUES
    """As `find_gaps_within`, and `measure_opened`."""
    gaps = load_open_gaps(own)
    values, n = vector(out, gaps.counts.rows), gaps.counts.n
    now, first = matrix(state, 3, n), matrix(before, 3, n)
    find_gaps_within(load_rows(contacts), gaps, t, now, t0, first, vector(near, ANY), values)
    _measure_opened(t, gaps.which[: gaps.counts.opened], gaps.start, values)
    return 0


@kernel
def write_rows(s, t, q, place, short, J, drift):
    """As `find_rows`."""
    set_time(s, t)
    constraint_jacobian(s, q, t, short)
    time_derivative(s, q, t, drift)
    for i in range(short.shape[0]):
        k = place[i if i < place.size else s.tails[i - place.size]]
        for half in range(2 if k >= 0 else 0):
            at = s.segments[i, 2 * half]
            for c in range(s.segments[i, 2 * half + 1]):
                J[k, at + c] += short[i, 7 * half + c]


@entry("pdvwmmv")
def find_rows(context, t, q, place, short, J, drift):
    """Rows J (k, n) of contacts, and Phi_t (m,) of all; zero on entry.

    place (m,): which row of J is that of a contact, -1 for none; short (lines, 14): scratch, zero on entry.
    """
    write_rows(load_contacts(context).rows, t, q, place, short, J, drift)


@kernel
def _refine_multipliers(graph, f, lam):
    """Refine accelerations Z as `refine_accelerations` does, and write the multipliers into lam, by rows of Phi."""
    for e in range(f.b.size):
        if graph.row[e] >= 0:
            lam[graph.row[e]] = f.b[e]
    far = largest(f.Z)
    for _ in range(REFINEMENTS if f.b.size > 0 else 0):
        more = constrain(graph, f.rows, f.gamma, f.Z, f.b)
        for e in range(f.b.size):
            if graph.row[e] >= 0:
                lam[graph.row[e]] += f.b[e]
        if more <= EXACT * far:
            break


@kernel
def _respond(c, t, q, memory, loads, out, lam, left):
    graph, s, w, f = c.graph, c.system, c.work, c.tangent
    recall(s, memory)
    set_time(s, t)
    copy(q, w.q)
    for i in range(w.qd.size):
        w.qd[i] = 0.0
    place_bodies(graph.bodies, q, f.poses)
    move_bodies(graph.bodies, q, w.qd, f.poses)
    evaluate_rows(graph, s, f, f.rows, t)
    if not factorise_rows(graph, s, f, f.rows, t, DYNAMICS):
        return 0
    # At rest inertia rows have no bias; neither has any other row here
    evaluate_bias(graph, s, f, t)
    for e in range(f.gamma.size):
        f.gamma[e] = 0.0
    for k in range(loads.shape[0]):
        take_loads(graph.bodies, q, loads[k], f.Z)
        weigh_bodies(graph, f.Z)
        alone = largest(f.Z)
        if f.b.size > 0:
            constrain_accelerations(graph, f.rows, f.gamma, f.Z, f.b)
        if k < lam.shape[0]:
            _refine_multipliers(graph, f, lam[k])
            left[k] = largest(f.Z) / alone if alone > 0.0 else 0.0
        else:
            refine_accelerations(graph, f)
        write_accelerations(graph.bodies, f.poses, f.Z, out[k])
    return 1


@entry("pdvvmmmv")
def respond(context, t, q, memory, loads, out, lam, left):
    """out (k, n): accelerations by loads (k, n), Eq. (1). The factors stay; 0 where there are none, else 1.

    lam (k or 0, m): multipliers of the bilateral rows; left (k or 0,): the shares of accelerations that these leave.
    """
    return _respond(load_contacts(context).free, t, q, memory, loads, out, lam, left)


@kernel
def _accelerate(c, t, q, qd, out, gamma, lam):
    graph, s, w, f = c.free.graph, c.free.system, c.free.work, c.free.tangent
    copy(qd, w.qd)
    move_bodies(graph.bodies, q, qd, f.poses)
    solve_accelerations(graph, s, w, f, t)
    if lam.size > 0:
        _refine_multipliers(graph, f, lam)
    else:
        refine_accelerations(graph, f)
    write_accelerations(graph.bodies, f.poses, f.Z, out)
    acceleration_bias(c.rows, q, qd, t, gamma)


@entry("pdvvvvv")
def accelerate(context, t, q, qd, out, gamma, lam):
    """Accelerations out (n,) with all contacts open, and gamma (m,) of their rows, where `respond` has been called.

    lam (m or 0,): multipliers of the bilateral rows.
    """
    _accelerate(load_contacts(context), t, q, qd, out, gamma, lam)


NO_FACTORS, BOUNCES, STAYS = 0, 1, 2


class Impact(NamedTuple):
    """The impact of one gap."""

    numbers: ImpactNumbers
    place: np.ndarray  # int64 (m,)  scratch, as of `find_rows`
    short: np.ndarray
    rows: np.ndarray  # (4, n)  J and M~ J^T of the gap, velocities and accelerations afterwards
    gamma: np.ndarray  # (2, m)  scratch
    inertias: np.ndarray  # (i, 14)  scratch for inertia rows


load_impact = loader(
    Impact(ImpactNumbers(), np.zeros(0, int), *np.zeros((4, 0, 0))),
)


@callback("ppdppp")
def bounce_off(context, impact, t, q, qd, memory):
    """Impact of the gap sign Phi_i alone, with restitution e: p = -(1 + e) gd / G.

    NO_FACTORS; BOUNCES; STAYS where velocities are rounding, or the flight afterwards would be none.
    """
    c, w = load_contacts(context), load_impact(impact)
    n = c.free.work.q.size
    q, qd, memory = vector(q, n), vector(qd, n), vector(memory, c.free.system.memory.size)
    x, rows, gamma = w.numbers, w.rows, w.gamma
    i, sign, e = x.i, x.sign, x.e
    for j in range(w.place.size):
        w.place[j] = -1
    w.place[i] = 0
    rows[:, :] = 0.0
    gamma[:, :] = 0.0
    write_rows(c.rows, t, q, w.place, w.short, rows[:1], gamma[0])
    J, response, after, qdd = rows[0], rows[1], rows[2], rows[3]
    for j in range(J.size):
        J[j] *= sign
    none = rows[:0]
    if not _respond(c.free, t, q, memory, rows[:1], rows[1:2], none, q[:0]):
        return NO_FACTORS
    rate, size, G, length = sign * gamma[0, i], abs(gamma[0, i]), 0.0, 0.0
    for j in range(J.size):
        rate += J[j] * qd[j]
        size += abs(J[j] * qd[j])
        length += abs(J[j] * q[j])
        G += J[j] * response[j]
    p = -(rate + e * rate) / G
    for j in range(J.size):
        after[j] = qd[j] + p * response[j]
    _accelerate(c, t, q, after, qdd, gamma[1], q[:0])
    gdd = sign * gamma[1, i]
    for j in range(J.size):
        gdd += J[j] * qdd[j]
    x.p, x.rate, x.length = p, -e * rate, length
    if not (G > 0.0 and rate < -NEGLIGIBLE * size):
        return STAYS
    return STAYS if gdd < 0.0 and x.rate * x.rate < -2.0 * gdd * x.lowest else BOUNCES


call_bounce = caller("ppdppp")


@entry("ppdvvv")
def bounce(context, impact, t, q, qd, memory):
    """As `bounce_off`."""
    return call_bounce(load_impact(impact).numbers.kernel, context, impact, t, q, qd, memory)


@entry("pvvvm")
def gain(context, q, before, after, h):
    """As `energy_gained`."""
    return energy_gained(load_contacts(context).free.system, q, before, after, h)


@kernel
def energy_gained(s, q, before, after, h):
    """Kinetic energy that velocities (n,) have more afterwards, J; h (i, 14): scratch for inertia rows.

    v.M v / 2 - u.M u / 2 = (v - u).M (v + u) / 2
    """
    total = 0.0
    for b in range(s.bodies.shape[0]):
        i = s.bodies[b, 0]
        for c in range(3):
            total += s.mass[b] * (after[i + c] - before[i + c]) * (after[i + c] + before[i + c])
        if s.bodies[b, 1] == 7:
            p = q[i + 3], q[i + 4], q[i + 5], q[i + 6]
            u = spin(p, (before[i + 3], before[i + 4], before[i + 5], before[i + 6]))
            v = spin(p, (after[i + 3], after[i + 4], after[i + 5], after[i + 6]))
            d, m = subtract(v, u), add(v, u)
            J = s.inertia[b]
            for j in range(3):
                total += d[j] * (J[3 * j] * m[0] + J[3 * j + 1] * m[1] + J[3 * j + 2] * m[2])
    inertia_rows(s, q, h)
    for e in range(h.shape[0]):
        u, v = multiply_inertia_row(s, h, e, before), multiply_inertia_row(s, h, e, after)
        total += (v - u) * (v + u)
    return 0.5 * total


@kernel
def _evaluate(c, t, levels):
    """Rows and factors at t and a state, levels (3 n,); False if there are no factors."""
    graph, s, w, f = c.graph, c.system, c.work, c.tangent
    n = w.q.size
    copy(levels[:n], w.q)
    copy(levels[n : 2 * n], w.qd)
    set_time(s, t)
    place_bodies(graph.bodies, w.q, f.poses)
    move_bodies(graph.bodies, w.q, w.qd, f.poses)
    evaluate_rows(graph, s, f, f.rows, t)
    return factorise_rows(graph, s, f, f.rows, t, DYNAMICS)


@kernel
def write_multipliers(c, t, levels, redundant, out):
    """out (m,): multipliers at t and a state on the manifold, levels (3 n,), by the equations of motion.

    redundant: what is written at redundant rows. NaN where there are none.
    """
    regular = _evaluate(c, t, levels)
    solve_accelerations(c.graph, c.system, c.work, c.tangent, t)
    for e in range(c.tangent.b.size):
        if c.graph.row[e] >= 0:
            out[c.graph.row[e]] = c.tangent.b[e] if regular else math.nan
    mark_redundant(c.graph, c.tangent, redundant, out)


@entry("pvmvdm")
def find_multipliers(context, t, levels, memory, redundant, out):
    """out (k, m): the same at times t (k,) and levels (k, 3 n)."""
    c = load_parts(context)
    recall(c.system, memory)
    for k in range(t.size):
        write_multipliers(c, t[k], levels[k], redundant, out[k])


@kernel
def write_reactions(c, t, levels, redundant, out):
    """As `write_multipliers`, with friction in proportion to reactions: whether there are any.

    Newton's method goes on from those that it has found before.
    """
    r = c.tangent.friction
    found = _evaluate(c, t, levels)
    found = found and accelerate_with_friction(c.graph, c.system, c.work, c.tangent, t, LAST_PLACE)
    for e in range(r.lam.size):
        if c.graph.row[e] >= 0:
            out[c.graph.row[e]] = r.lam[e] if found else math.nan
    mark_redundant(c.graph, c.tangent, redundant, out)
    return found


@kernel
def begin_reactions(c):
    """Begin as in a run that goes on from a checkpoint."""
    r = c.tangent.friction
    for e in range(r.lam.size):
        r.lam[e] = 0.0


@long_kernel
def write_lam(c, t, levels, redundant, out):
    """The same from the start, where there is such friction, or not; False where friction has no reactions."""
    if c.system.normals.size == 0:
        write_multipliers(c, t, levels, redundant, out)
        return True
    begin_reactions(c)
    return write_reactions(c, t, levels, redundant, out)


@entry("pvmvdmm")
def find_reactions(context, t, levels, memory, redundant, out, loads):
    """out (k, m): as of `write_reactions` at times t (k,) and levels (k, 3 n), and normal loads (k, frictions)."""
    c = load_parts(context)
    recall(c.system, memory)
    begin_reactions(c)
    for k in range(t.size):
        found = write_reactions(c, t[k], levels[k], redundant, out[k])
        for i in range(loads.shape[1]):
            loads[k, i] = c.tangent.friction.load[7 * i] if found else math.nan


KERNELS = (
    find_gaps, measure_opened, find_open_gaps, find_rows, respond, accelerate, bounce_off, bounce, gain,
    find_multipliers, find_counted_angles, *SURVEYING, *SEARCHING, *CONES, *EQUATIONS, follow,
)  # fmt: skip


class ReactionWorkspace:
    """Multipliers of a packed scene, by its equations of motion; one evaluation at a time.

    redundant: what stands at redundant rows.
    """

    def __init__(self, packed, redundant=0.0):
        system, self.redundant, self.graph = with_short_rows(packed), redundant, graph_of(packed, REDUCED, BIAS)
        self.n, self.m, self.count = int(system.bodies[:, 1].sum()), len(packed.system.segments), system.normals.size
        graph = self.graph if packed.derived.switched is None else with_all_rows(self.graph)
        whole = parts(system._replace(reals=system.reals.copy()), graph, self.n)
        self.address, *self._keep = resident(whole)
        self._tangent, self._reals = whole.tangent, whole.system.reals
        find = find_reactions if self.count else find_multipliers
        self._find = interrupts_answered()(find) if calls_laws(packed) else find

    def begin(self, graph, reals):
        """As if it were new, with the redundant rows of a graph and the numbers of a system."""
        self.graph, self._reals[...] = graph, reals
        reset_selection(graph, self._tangent)

    def multipliers(self, t, levels, memory):
        """Multipliers (k, m) at times t (k,), levels (k, 3, n), of normalisations zero; normal loads (k, frictions)."""
        out, loads = np.zeros((t.size, self.m)), np.zeros((t.size, self.count))
        given = self.address, t, levels.reshape(t.size, 3 * self.n), memory, self.redundant, out
        self._find(*given, *[loads] * (self.count > 0))
        return out, loads


def reaction_workspace(packed, redundant=0.0):
    """The `ReactionWorkspace` of a packed scene in this thread, for a phase that begins.

    A start may have shown that rows are redundant.
    """
    known, key = packed.derived.reactions, (threading.get_ident(), redundant == 0.0)
    graph = graph_of(packed, REDUCED, BIAS)
    if key not in known or known[key].graph.row is not graph.row:
        known[key] = ReactionWorkspace(packed, redundant)
    known[key].begin(graph, packed.system.reals)
    return known[key]


class ContactWorkspace:
    """The kernels' workspace; one evaluation at a time.

    Parameters
    ----------
    contacts : Packed
        Of the rows of all contacts alone: the bodies of the scene, nothing else.
    free : Packed
        Of the scene with all contacts open.
    """

    def __init__(self, contacts, free):
        self.n, self.m, self._free = int(contacts.system.bodies[:, 1].sum()), len(contacts.system.segments), free
        rows, self._graph = with_short_rows(contacts), None
        self._rows, self._all = rows._replace(reals=rows.reals.copy()), np.arange(self.m)
        # Addresses of the rows; scratch for them, (lines, 14), zero on entry, is `short`
        self.rows_address, self._keep_rows = resident(self._rows)
        self._bilateral = len(free.system.segments)
        spans = rows.segments, free.system.inertia_segments
        self.short, self._inertias = (np.zeros((len(x), WIDTH)) for x in spans)
        answered = interrupts_answered() if calls_laws(free) else lambda kernel: kernel
        self._accelerate, self._bounce = answered(accelerate), answered(bounce)
        self.enter()

    def enter(self):
        """Take the constraint graph as it is now: a start may have shown that bilateral rows are redundant."""
        graph = graph_of(self._free, REDUCED, BIAS)
        if graph is not self._graph:
            system = with_short_rows(self._free)
            free = parts(system._replace(reals=system.reals.copy()), graph, self.n)
            self._graph, (self.address, *self._keep) = graph, resident(ContactParts(free, self._rows))
            self.begin = partial(reset_selection, graph, free.tangent)  # as if it were new

    def gaps(self, t, q, sign):
        """Phi (k, m), of the first rows times their sign, at times t (k,), positions q (k, n); rows of q may go on."""
        out = np.zeros((t.size, self.m))
        find_gaps(self.address, t, q, sign, out)
        return out

    def rows(self, t, q, which=None):
        """J (k, n) of the rows `which`, or of all, and Phi_t (m,) of all."""
        place = self._all
        if which is not None:
            place = np.full(self.m, -1)
            place[which] = np.arange(len(which))
        J, drift = np.zeros((self.m if which is None else len(which), self.n)), np.zeros(self.m)
        find_rows(self.address, t, q, place, self.short, J, drift)
        return J, drift

    def respond(self, t, q, memory, loads):
        """Accelerations (k, n) by loads (k, n), which must be contiguous."""
        return self._respond(t, q, memory, loads, np.empty((0, 0)), np.empty(0))

    def _respond(self, t, q, memory, loads, lam, left):
        out = np.empty_like(loads)
        self.enter()
        if not respond(self.address, t, q, memory, loads, out, lam, left):
            raise SingularConfiguration(NO_INERTIA)
        return out

    def accelerations(self, t, q, qd):
        """Accelerations (n,) with all contacts open, and gamma (m,); after `respond` at these t and q."""
        qdd, gamma = np.empty(self.n), np.zeros(self.m)
        self._accelerate(self.address, t, q, qd, qdd, gamma, np.empty(0))
        return qdd, gamma

    def solve(self, t, q, qd, memory, loads):
        """Accelerations (k + 1, n) and multipliers (k + 1, m) of bilateral rows, and the shares (k,) that these leave.

        By loads (k, n), contiguous, then those of the motion with all contacts open.
        """
        lam, left, qdd = np.zeros((len(loads) + 1, self._bilateral)), np.zeros(len(loads)), np.empty(self.n)
        out = self._respond(t, q, memory, loads, lam[:-1], left)
        self._accelerate(self.address, t, q, qd, qdd, np.zeros(self.m), lam[-1])
        return np.vstack([out, qdd]), lam, left

    def bounce(self, t, q, qd, memory, *given):
        """The impact of one gap: its `ImpactNumbers` and velocities (n,) afterwards; None where it stays.

        given: the first of these numbers.
        """
        impact, address, _ = self.impact
        numbers = impact.numbers
        numbers.i, numbers.sign, numbers.e, numbers.lowest = given
        self.enter()
        found = self._bounce(self.address, address, t, q, qd, memory)
        if found == NO_FACTORS:
            raise SingularConfiguration(NO_INERTIA)
        return (numbers, impact.rows[2].copy()) if found == BOUNCES else None

    @cached_property
    def impact(self):
        """The `Impact` of kernels, its address, and what keeps that."""
        scratch = np.empty(self.m, int), self.short, np.empty((4, self.n)), np.empty((2, self.m)), self._inertias
        made = Impact(ImpactNumbers(kernel=bounce_off.address), *scratch)
        return made, *resident(made)

    def gain(self, q, before, after):
        """Kinetic energy that velocities (n,) have more afterwards, J."""
        return gain(self.address, q, before, after, self._inertias)
