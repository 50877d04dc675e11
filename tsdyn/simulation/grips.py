"""Contacts with friction in the phases of a run: rows and laws of those that stick and slide, events, multipliers."""

from functools import cached_property

import numpy as np

from ..analyses.contact_friction import shared
from ..analyses.contact_problem import slip_rows
from ..analyses.contact_rows import reaction_workspace
from ..analyses.tolerances import EVENT_ERROR, LEAST_SLIP
from ..elements.bodies import rotation_matrix
from ..elements.friction import heading
from ..jit.kernels import twin
from ..maths.tolerances import TINY
from ..model.handles import index_of
from ..observables.reactions import balancing
from .phase_scenes import first_row_of
from .tolerances import FASTER, SAME_WAY, SLOW, TURNED

# A closed contact with friction sticks or slides. Where it sticks, all its rows hold; those of the slip of a point are
# rows on positions, which hold it where it came to rest. Where it slides, the row of the gap holds, and a force in
# proportion to its reaction acts (elements/sliding.py), with a direction d near the slip; the next phase takes another
# one where the slip has turned too far. Both are among what the run remembers: d (3,), ground frame, of the length of a
# slip below which friction keeps its direction, m/s, and for each of the two rows where in b, m, the point of a is.


def items_of(gaps, modes):
    """The rows that hold closed contacts, and the forces of those that slide."""
    items = []
    for i in modes.closed:
        gap = gaps.list[i]
        if modes.slides(i):
            items += gap.side.grip[:2]
        elif modes.sticks(i):
            first, *others = gap.contact.parts
            items += [first, *(part for part, held in zip(others, modes.grips[i], strict=False) if held)]
        else:
            items.append(gap.side.row)
    return items


def held_point(packed, part, q):
    """Where the point of a is in the frame of b, (3,), m."""
    x = part.coordinates[0]
    for body, turn in ((part.a, lambda A, r, x: r + A @ x), (part.b, lambda A, r, x: A.T @ (x - r))):
        if body.dimension:
            at = packed.system.bodies[index_of(packed, body), 0]
            A = rotation_matrix(q[at + 3 : at + 7]) if body.dimension == 7 else np.eye(3)
            x = turn(A, q[at : at + 3], x)
    return x


def gripped(gaps, before, contacts, q, memory):
    """`grips` of the next phase; writes directions, and places of those that come to rest, into memory (slots,)."""
    grips = {}
    for i, d in contacts.grips.items():
        way, others = memory[gaps.slots[i] :][:3], gaps.list[i].contact.parts[1:]
        if d is not None:
            grips[i] = None
            if not (before.slides(i) and np.dot(way, d) > SAME_WAY * np.linalg.norm(way)):
                way[:] = contacts.slow[i] * d
            continue
        way[:] = 0.0
        grips[i] = tuple(map(int, contacts.rows.get(i, ()))) if others else (1, 1)
        if grips[i] and not before.grips.get(i):
            for k, part in enumerate(others, 1):
                memory[gaps.slots[i] + 3 * k :][:3] = held_point(gaps.packed, part, q)
    return grips


def stopping_time(inertia, which, qd, after, qdd, slow):
    """Time, s, in which slips that have been ended, at qd (n,) and no more `after`, end by accelerations qdd (n,).

    slow (count,): `ContactState.slow`; a part of these is none.
    """
    before, left, gained = (x[which] for x in (inertia.slips(qd), inertia.slips(after), inertia.tangents @ qdd))
    against = -(before * (gained + inertia.biases(qd)[which, 1:])).sum(axis=1)
    squares = (before * before).sum(axis=1)
    ended = (squares > (LEAST_SLIP * slow[which]) ** 2) & ~left.any(axis=1) & (against > 0.0)
    return float((squares[ended] / against[ended]).max(initial=0.0))


class Reactions:
    """Reactions of closed contacts, and what is left to the bounds of those that stick, as event functions.

    Parameters
    ----------
    gaps : Gaps
    modes : UnitModes
    packed : Packed
        Of the phase.
    """

    def __init__(self, gaps, modes, packed):
        self.gaps, self.packed, self.closed = gaps, packed, modes.closed
        self.sticks = [i for i in modes.closed if modes.sticks(i)]
        first = first_row_of(packed)
        self.normal = [first[id(_gap_row(gaps, modes, i))] for i in self.closed]
        self.slip = np.array([_slip_columns(gaps.list[i].contact, first) for i in self.sticks], int).reshape(-1, 2)
        self.which = [self.closed.index(i) for i in self.sticks]
        self.slack = np.array([modes.slack.get(i, 0.0) for i in modes.closed])

    @cached_property
    def workspace(self):
        """Made at the first evaluation: the start of the phase may show that rows are redundant."""
        return reaction_workspace(self.packed, np.nan)

    def over(self, states):
        """Values (k, closed and sticking) of states at k times."""
        lam, _ = self.workspace.multipliers(states.t, states.levels, states.memory)
        N = -self.gaps.sign[self.closed] * lam[:, self.normal]
        held = N[:, self.which]
        T = np.where(self.slip < 0, np.nan, -lam[:, self.slip])
        memory = np.tile(states.memory, (states.t.size, 1))
        N[:, self.which], T = carried(self.gaps, self.sticks, states.t, states.q, memory, held, T)
        N = N + self.slack
        return np.hstack([N, self.gaps.static[self.sticks] * N[:, self.which] - np.hypot(*np.moveaxis(T, 2, 0))])


def _gap_row(gaps, modes, i):
    """The primitive whose first row is the gap of a closed contact in a phase."""
    gap = gaps.list[i]
    return gap.side.grip.gap if modes.slides(i) else gap.side.row


def _slip_columns(contact, first):
    """The rows (2,) of the slip of a contact that sticks, -1 of one that depends on others."""
    if len(contact.parts) == 1:
        return slip_rows(contact, first)
    return [first.get(id(part), -1) for part in contact.parts[1:]]


def carried(gaps, which, t, q, memory, N, T):
    """N (k, c) and friction (k, c, 2) of contacts that stick, where rows depend on others.

    Friction is shared in proportion to N, but where reactions brace each other, see `braced`.
    """
    N, T = N.copy(), T.copy()
    for k in np.flatnonzero(
        np.isnan(T).any(axis=(1, 2)) & np.isfinite(N).all(axis=1)
    ):  # else at singular ones N is NaN
        loads = gaps.responses(t[k], q[k], memory[k], which)
        p = shared(gaps.static[which], loads.reshape(3 * len(which), -1), np.column_stack([N[k], np.nan_to_num(T[k])]))
        N[k], T[k] = p[:, 0], p[:, 1:]
    return N, T


class Halting:
    """Slips of contacts, as event functions: d.v - c v, zero where one ends or turns.

        c = 1/2 + w h,  w = V / (v + V),  h = u^2 / (u^2 + (TURNED v)^2 + noise^2),  u^2 = v^2 - (d.v)^2

    Here d is of unit length, and V is SLOW times the slip below which friction has this direction. A slip turns by 60
    degrees at v >> V; where it has turned at all when it is as slow as V, it takes its direction there, so that it ends
    with its own. One that hasn't been FASTER V since its phase began has h = 0.49, and turns by 8 degrees at v << V: it
    begins, or has its direction from there. Where it begins at rest, the value is divided by the time since: the slip
    may turn at once.

    Parameters
    ----------
    gaps : Gaps
    slides : list of int
        Those that slide.
    rounding : ndarray (slides,), m/s
        Of the slips: of one that others hold, nothing else is left.
    begun : dict
        Of those that begin at rest: time and acceleration there, by the numbers of gaps.
    since : dict of int to float
        Times, s, since when slips have been faster, by the numbers of gaps: found with the values.

    Attributes
    ----------
    noise : ndarray (slides,)
        Rounding of the values.
    """

    def __init__(self, gaps, slides, rounding, begun, since):
        self.gaps, self.slides, self.rounding, self.since = gaps, slides, rounding, since
        self.begun = [(k, *begun[i]) for k, i in enumerate(slides) if i in begun]
        self.noise = np.where([i in begun for i in slides], 0.0, rounding)
        self.ways = gaps.slots[slides][:, None] + np.arange(3)

    def over(self, states):
        """Values (k, slides) of states at k times."""
        ways = states.memory[self.ways]
        slow = np.maximum(np.linalg.norm(ways, axis=1), TINY)
        along, speed = self.gaps.slips(states.t, states.levels, self.slides, ways / slow[:, None])
        V = SLOW * slow
        for i, fast in zip(self.slides, (speed > FASTER * V).T, strict=True):
            if fast.any():
                self.since.setdefault(i, float(states.t[fast.argmax()]))
        late = states.t[:, None] > [self.since.get(i, np.inf) for i in self.slides]
        turned = (speed - along) * (speed + along)
        h = np.where(late, turned / (turned + (TURNED * speed) ** 2 + self.rounding**2 + TINY), 0.49)
        values = along - (0.5 + h * V / (speed + V)) * speed
        for k, begun, gain in self.begun:
            later = states.t > begun
            values[:, k] = np.where(later, values[:, k] / np.where(later, states.t - begun, 1.0), 0.01 * gain)
        return values


def losses(gaps, which, lam, t, q, qd):
    """Power (k, c), W, that contacts which slide dissipate; lam (k, m) of the scene."""
    slips = np.array([gaps.slopes(*pair, which) @ v for *pair, v in zip(t, q, qd, strict=True)])
    return (lam[:, gaps.slip_rows[which]] * slips).sum(axis=2)


def add_friction(gaps, modes, packed, shared, t, q, qd, memory, lam, out):
    """Write the multipliers of the slips in a phase into out (k, m): those of contacts that slide, and redundant ones.

    memory (k, slots) has the directions; lam (k, rows) are the multipliers of the phase, of which out has the rows
    shared[0] from shared[1]. Joints between bodies that stick carry what redundant slips share.
    """
    frictional = [i for i in modes.closed if gaps.rough[i]]
    if not frictional:
        return
    first = first_row_of(packed)
    N = np.array([-gaps.sign[i] * lam[:, first[id(_gap_row(gaps, modes, i))]] for i in frictional]).T
    tangents = np.array([gaps.slopes(*pair, frictional) for pair in zip(t, q, strict=True)])  # (k, c, 2, n)
    rows = gaps.slip_rows[frictional]
    sticks = [j for j, i in enumerate(frictional) if modes.sticks(i)]
    if sticks:
        T = -out[:, rows[sticks]]
        for j, i in enumerate(sticks):
            T[:, j, [k for k, held in enumerate(modes.grips[frictional[i]]) if not held]] = np.nan
        redundant, alone = np.isnan(T), np.nan_to_num(T)
        own = N[:, sticks]
        N[:, sticks], T = carried(gaps, [frictional[j] for j in sticks], t, q, memory, own, T)
        if redundant.any():
            # M qdd + Phi_q^T (lam + change) = Q + J^T T    J: redundant slips
            f = np.einsum("kci,kcin->kn", np.where(redundant, T, 0.0), tangents[:, sticks])
            more = N[:, sticks] - own
            if more.any():
                which = [frictional[j] for j in sticks]
                normals = np.array([gaps.normals(*pair, which) for pair in zip(t, q, strict=True)])
                f = np.einsum("kc,kcn->kn", more, normals) + np.einsum("kci,kcin->kn", T - alone, tangents[:, sticks])
            change = balancing(packed, t, q, f, memory[:, : packed.system.memory.size])
            # Near singular states that would take other normal loads: rows that hold carry the friction alone
            pushing = [first[id(_gap_row(gaps, modes, i))] for i in frictional]
            moves = np.abs(change[:, pushing]).max(axis=1) > EVENT_ERROR * np.abs(N).max(axis=1)
            change[moves], T[moves] = 0.0, alone[moves]
            for j, i in enumerate(sticks):
                N[moves, i] = own[moves, j]
            out[:, shared[0]] += change[:, shared[1]]
        out[:, rows[sticks]] = -T
        if (N[:, sticks] != own).any():
            which = [frictional[j] for j in sticks]
            out[:, gaps.rows[which]] = -gaps.sign[which] * N[:, sticks]
    slip = np.einsum("kcin,kn->kci", tangents, qd)
    for j, i in enumerate(frictional):
        if modes.slides(i):
            out[:, gaps.rows[i]] = -gaps.sign[i] * N[:, j]
            d, v = gaps.across(i, tangents[:, j], memory[:, gaps.slots[i] :][:, :3]), slip[:, j]  # (k, 2)
            e = twin(heading)(v[:, 0], v[:, 1], 0.0, np.column_stack([d, np.zeros(len(d))]).T, 1.0)[:2]
            out[:, rows[j]] = (gaps.kinetic[i] * N[:, j])[:, None] * np.array(e).T
