"""Gaps of contacts, their rows, and what loads do where the bilateral rows hold: kernels, and their workspace.

J, gd = J qd + Phi_t, gdd = J qdd + gamma       rows of Phi that are gaps, times their signs
H W H^T lam = H W f,  a = W (f - H^T lam)       H: bilateral rows                                           (1)
"""

import math
import threading
from functools import partial
from typing import NamedTuple

import numpy as np

from ..elements.loops.constraint_rows import move_bodies, place_bodies, take_loads, write_accelerations
from ..errors import SingularConfiguration
from ..formulations.accelerations import accelerate_with_friction, refine_accelerations, solve_accelerations
from ..formulations.tolerances import EXACT, REFINEMENTS
from ..jit.kernels import ANY, Record, callback, entry, kernel, loader, resident, vector
from ..maths.complementarity import CONES
from ..maths.dense_linalg import copy, largest
from ..maths.root_isolation import SURVEYING
from ..maths.tolerances import LAST_PLACE
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
from ..model.joint_turns import find_counted_angles
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
        _find_gaps(s, t[k], q[k], sign, out[k])


@kernel
def _find_gaps(s, t, q, sign, out):
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
    """Numbers of rows of contacts, and of gaps that have just opened."""

    rows: int
    opened: int


class OpenGaps(NamedTuple):
    """What is known of open gaps."""

    counts: GapCounts
    sign: np.ndarray  # (gaps,)  of a gap over Phi
    which: np.ndarray  # int64 (gaps,)  those that have just opened come first
    start: np.ndarray  # (4, gaps)  as of `measure_opened`


load_rows = loader(no_system())
load_open_gaps = loader(OpenGaps(GapCounts(), np.zeros(0), np.zeros(0, int), np.zeros((4, 0))))


@callback(VALUES)
def find_open_gaps(contacts, own, t, state, out):
    """out (rows,) = the gaps first, at t and a state (3, n), as `find_gaps` and `measure_opened` have them."""
    gaps = load_open_gaps(own)
    values = vector(out, gaps.counts.rows)
    _find_gaps(load_rows(contacts), t, vector(state, ANY), gaps.sign, values)
    _measure_opened(t, gaps.which[: gaps.counts.opened], gaps.start, values)
    return 0


@kernel
def _find_rows(s, t, q, place, short, J, drift):
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
    _find_rows(load_contacts(context).rows, t, q, place, short, J, drift)


@kernel
def _write_multipliers(graph, f, lam):
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
            _write_multipliers(graph, f, lam[k])
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
        _write_multipliers(graph, f, lam)
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


@entry("pdvvvwmmmv")
def bounce(context, t, q, qd, memory, place, short, rows, gamma, numbers):
    """Impact of one gap, sign Phi_i, with restitution e: p = -(1 + e) gd / G. 0 where there are no factors, else 1.

    rows (4, n): J and M~ J^T of the gap, velocities and accelerations afterwards; gamma (2, m). rows and gamma are zero
    on entry. numbers (9,): i, sign and e; to be written: gd before, the sizes of its terms, G, p, gdd afterwards, the
    sizes of terms of the gap.
    """
    c, i, sign, e = load_contacts(context), int(numbers[0]), numbers[1], numbers[2]
    _find_rows(c.rows, t, q, place, short, rows[:1], gamma[0])
    J, response, after, qdd = rows[0], rows[1], rows[2], rows[3]
    for j in range(J.size):
        J[j] *= sign
    none = rows[:0]
    if not _respond(c.free, t, q, memory, rows[:1], rows[1:2], none, q[:0]):
        return 0
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
    numbers[3], numbers[4], numbers[5], numbers[6], numbers[7], numbers[8] = rate, size, G, p, gdd, length
    return 1


@entry("pvvvm")
def gain(context, q, before, after, h):
    """Kinetic energy that velocities (n,) have more afterwards, J; h (i, 14): scratch for inertia rows.

    v.M v / 2 - u.M u / 2 = (v - u).M (v + u) / 2
    """
    s, total = load_contacts(context).free.system, 0.0
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


@entry("pvmvdm")
def find_multipliers(context, t, levels, memory, redundant, out):
    """out (k, m): multipliers at times t (k,) and states on the manifold, levels (k, 3 n), by the equations of motion.

    redundant: what is written at redundant rows. NaN where there are none.
    """
    c = load_parts(context)
    recall(c.system, memory)
    for k in range(t.size):
        regular = _evaluate(c, t[k], levels[k])
        solve_accelerations(c.graph, c.system, c.work, c.tangent, t[k])
        for e in range(c.tangent.b.size):
            if c.graph.row[e] >= 0:
                out[k, c.graph.row[e]] = c.tangent.b[e] if regular else math.nan
        mark_redundant(c.graph, c.tangent, redundant, out[k])


@entry("pvmvdmm")
def find_reactions(context, t, levels, memory, redundant, out, loads):
    """The same with friction in proportion to reactions, and its normal loads (k, frictions)."""
    c = load_parts(context)
    recall(c.system, memory)
    r = c.tangent.friction
    for e in range(r.lam.size):  # as in a run that goes on from a checkpoint
        r.lam[e] = 0.0
    for k in range(t.size):
        found = _evaluate(c, t[k], levels[k])
        found = found and accelerate_with_friction(c.graph, c.system, c.work, c.tangent, t[k], LAST_PLACE)
        for e in range(r.lam.size):
            if c.graph.row[e] >= 0:
                out[k, c.graph.row[e]] = r.lam[e] if found else math.nan
        mark_redundant(c.graph, c.tangent, redundant, out[k])
        for i in range(loads.shape[1]):
            loads[k, i] = r.load[7 * i] if found else math.nan


@entry("pvmwwmmmvm")
def find_slips(context, t, levels, place, at, ways, short, J, drift, out):  # ten: all of the slips
    """out (k, 2 c): components of slips along ways d (c, 3), ground frame, and their sizes.

    J (2 c, n): scratch for the rows of slips, of which `place` is as of `find_rows`; at (c,): where the coordinates of
    the body at whose point the first three of a row are directions of the ground frame begin.
    """
    s, n, c = load_contacts(context).rows, J.shape[1], at.size
    for k in range(t.size):
        J[:, :] = 0.0
        _find_rows(s, t[k], levels[k, :n], place, short, J, drift)
        for i in range(c):
            along, square = 0.0, 0.0
            for r in range(2 * i, 2 * i + 2):
                v, d = 0.0, 0.0
                for j in range(n):
                    v += J[r, j] * levels[k, n + j]
                for j in range(3):
                    d += J[r, at[i] + j] * ways[i, j]
                along += v * d
                square += v * v
            out[k, i], out[k, c + i] = along, math.sqrt(square)


KERNELS = (
    find_gaps, measure_opened, find_open_gaps, find_rows, find_slips, respond, accelerate, bounce, gain,
    find_multipliers, find_counted_angles, *SURVEYING, *SEARCHING, *CONES,
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
        self.rows_address, self._keep_rows = resident(self._rows)
        self._impact = np.empty(self.m, int), np.empty((4, self.n)), np.empty((2, self.m)), np.empty(9)  # of `bounce`
        self._bilateral = len(free.system.segments)
        spans = rows.segments, free.system.inertia_segments
        self._short, self._inertias = (np.zeros((len(x), WIDTH)) for x in spans)
        answered = interrupts_answered() if calls_laws(free) else lambda kernel: kernel
        self._accelerate, self._bounce = answered(accelerate), answered(bounce)
        self._enter()

    def _enter(self):
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
        find_rows(self.address, t, q, place, self._short, J, drift)
        return J, drift

    def slips(self, t, levels, which, at, ways):
        """Components (k, c) of slips along directions (c, 3), and their sizes (k, c), as of the kernel.

        which (2 c,): rows of the slips; levels (k, ...) begin with q and qd (n,).
        """
        place, J, drift = np.full(self.m, -1), np.zeros((which.size, self.n)), np.zeros(self.m)
        place[which], out = np.arange(which.size), np.empty((t.size, which.size))
        rows = levels.reshape(t.size, math.prod(levels.shape[1:]))
        find_slips(self.address, t, rows, place, at, ways, self._short, J, drift, out)
        return out[:, : at.size], out[:, at.size :]

    def respond(self, t, q, memory, loads):
        """Accelerations (k, n) by loads (k, n), which must be contiguous."""
        return self._respond(t, q, memory, loads, np.empty((0, 0)), np.empty(0))

    def _respond(self, t, q, memory, loads, lam, left):
        out = np.empty_like(loads)
        self._enter()
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

    def bounce(self, t, q, qd, memory, i, sign, e):
        """Numbers (6,) of an impact of the gap in row i alone, as of the kernel, and velocities (n,) afterwards."""
        place, rows, gamma, numbers = self._impact
        place.fill(-1)
        rows.fill(0.0)
        gamma.fill(0.0)
        place[i], numbers[0], numbers[1], numbers[2] = 0, i, sign, e
        self._enter()
        if not self._bounce(self.address, t, q, qd, memory, place, self._short, rows, gamma, numbers):
            raise SingularConfiguration(NO_INERTIA)
        return numbers[3:].tolist(), rows[2].copy()

    def gain(self, q, before, after):
        """Kinetic energy that velocities (n,) have more afterwards, J."""
        return gain(self.address, q, before, after, self._inertias)
