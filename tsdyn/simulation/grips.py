"""Contacts with friction in the phases of a run: rows and laws of those that stick and slide, events, multipliers."""

import numpy as np

from ..analyses.contact_friction import spread
from ..analyses.contact_problem import slip_rows
from ..elements.bodies import rotation_matrix
from ..elements.force import Force
from ..elements.friction import heading
from ..elements.sliding import WAY, slip_velocity
from ..elements.tolerances import AHEAD
from ..jit.kernels import twin
from ..model.handles import begins_of
from ..model.packed import Derived, index_of
from ..observables import reactions
from ..observables.diagnostics import marker_states
from .parameters import KEPT
from .phase_scenes import first_row_of, phase_of
from .scene_cache import prepared_numbers
from .tolerances import SAME_WAY, SLOW

# A closed contact with friction sticks or slides. Where it sticks, all its rows hold; those of the slip of a point are
# rows on positions, which hold it where it came to rest. Where it slides, the row of the gap holds, and a force in
# proportion to its reaction acts (elements/sliding.py), with a direction d near the slip; the next phase takes another
# one where the slip has turned too far. `grips` has for each such contact, by the number of its gap, None where it
# sticks, else d (3,), ground frame; `held` where in b, m, the point of a is that sticks, and which of the two rows of
# its slip are independent of others.


def phase_with_friction(scene, gaps, modes, holds, without=None):
    """The scene of a phase: as `phase_of`, with the directions of sliding contacts and the places of sticking ones."""
    items, numbers = [], {}
    for i in modes.closed:
        gap = gaps.list[i]
        if not gaps.rubs[i]:
            items.append(gap.side.row)
        elif modes.grips[i] is None:
            first, *others = gap.contact.parts
            kept = [part for part, held in zip(others, modes.held.get(i, ())[3:], strict=True) if held]
            items += [first, *kept]
            numbers |= {part: modes.held[i][:3] for part in kept}
        else:
            items += gap.side.grip[:2]
            numbers[gap.side.grip.sliding] = modes.grips[i]
    phase = phase_of(scene, items, holds, without)
    return _with_numbers(phase, numbers) if numbers else phase


def _with_numbers(scene, numbers):
    """The scene with other numbers (3,): of the law of sliding its direction, of a row the point of b."""
    kept = prepared_numbers(scene)
    _ = kept.refusal, kept.pays, kept.sharp, kept.slips, kept.sampled  # for `Prepared.like`
    packed, begins = scene.packed, begins_of(scene.packed)
    reals, coordinates, loads = packed.system.reals.copy(), list(packed.coordinates), list(packed.loads)
    order = {id(each): i for i, each in enumerate(packed.constraints)}
    acting = {id(load.force): i for i, load in enumerate(loads)}
    for item, value in numbers.items():
        if isinstance(item, Force):
            load, k = loads[acting[id(item)]], acting[id(item)]
            at = int(load.alone[0].reals) + 3 * len(item.markers) + WAY
            loads[k] = load._replace(parameters=(*load.parameters[:WAY], *value))
        else:
            at, k = begins[id(item)] + 3, order[id(item)]
            coordinates[k] = (coordinates[k][0], np.array(value), *coordinates[k][2:])
        reals[at : at + 3] = value
    derived = Derived()
    for name in KEPT:
        setattr(derived, name, getattr(packed.derived, name))
    found = packed._replace(
        system=packed.system._replace(reals=reals), coordinates=tuple(coordinates), loads=tuple(loads), derived=derived
    )
    other = object.__new__(type(scene))
    vars(other).update(vars(scene))
    vars(other).update(_packed=found, _prepared=kept.like(found), _start=None, _phases=None, _spare={})
    return other


def held_point(packed, part, q):
    """Where the point of a is in the frame of b, (3,), m."""
    x = part.coordinates[0]
    for body, turn in ((part.a, lambda A, r, x: r + A @ x), (part.b, lambda A, r, x: A.T @ (x - r))):
        if body.dimension:
            at = packed.system.bodies[index_of(packed, body), 0]
            A = rotation_matrix(q[at + 3 : at + 7]) if body.dimension == 7 else np.eye(3)
            x = turn(A, q[at : at + 3], x)
    return tuple(x.tolist())


def renewed(gaps, before, settled, q):
    """`grips` and `held` of the next phase: as before where a contact goes on as it was."""
    grips, held = {}, {}
    for i, d in settled.grips.items():
        old = before.grips.get(i, ())
        parts = gaps.list[i].contact.parts
        if d is None:
            if len(parts) > 1 and i in settled.rows:
                known = before.held[i][:3] if old is None and i in before.held else held_point(gaps.packed, parts[1], q)
                held[i] = (*known, *map(int, settled.rows[i]))
            grips[i] = None
        else:
            grips[i] = old if old and np.dot(old, d) > SAME_WAY else tuple(d.tolist())
    return grips, held


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
        self.sticks = [i for i in modes.closed if modes.grips.get(i, ()) is None]
        first = first_row_of(packed)
        self.normal = [first[id(_gap_row(gaps, modes, i))] for i in self.closed]
        self.slip = np.array([_slip_columns(gaps.list[i].contact, first) for i in self.sticks], int).reshape(-1, 2)
        self.which = [self.closed.index(i) for i in self.sticks]
        self.slack = np.array([modes.slack.get(i, 0.0) for i in modes.closed])

    def over(self, states):
        """Values (k, closed and sticking) of states at k times."""
        memory = np.tile(states.memory, (states.t.size, 1))
        lam = reactions.multipliers(self.packed, states.t, states.q, states.qd, states.qdd, memory)
        N = -self.gaps.sign[self.closed] * lam[:, self.normal]
        held = N[:, self.which]
        T = np.where(self.slip < 0, np.nan, -lam[:, self.slip])
        T = carried(self.gaps, self.sticks, states.t, states.q, held, T)
        N = N + self.slack
        return np.hstack([N, self.gaps.static[self.sticks] * N[:, self.which] - np.hypot(*np.moveaxis(T, 2, 0))])


def _gap_row(gaps, modes, i):
    """The primitive whose first row is the gap of a closed contact in a phase."""
    gap = gaps.list[i]
    return gap.side.grip.gap if modes.grips.get(i) is not None else gap.side.row


def _slip_columns(contact, first):
    """The rows (2,) of the slip of a contact that sticks, -1 of one that depends on others."""
    if len(contact.parts) == 1:
        return slip_rows(contact, first)
    return [first.get(id(part), -1) for part in contact.parts[1:]]


def carried(gaps, which, t, q, N, T):
    """Friction (k, c, 2) of contacts that stick, where rows depend on others shared in proportion to N (k, c)."""
    rows = np.isnan(T).any(axis=(1, 2))
    if rows.any():
        T = np.nan_to_num(T)
        tangents = np.array([gaps.slopes(t[k], q[k], which) for k in np.flatnonzero(rows)])
        T[rows] = spread(N[rows], tangents, T[rows])
    return T


class Halting:
    """Slips of contacts, as event functions: d.v - c v, c = (v + 1.98 V) / 2 (v + V), zero where one ends or turns.

    It turns by 60 degrees at v >> V, and by 8 degrees at v << V, so that it ends in a direction near d.

    Parameters
    ----------
    packed : Packed
        Of the phase.
    slides : list of Sliding
    """

    def __init__(self, packed, slides):
        self.packed, known = packed, {id(load.force): load for load in packed.loads}
        self.loads = [known[id(each)] for each in slides]

    def over(self, states):
        """Values (k, slides) of states at k times."""
        found = []
        for load in self.loads:
            x, xd = marker_states(self.packed, load, states.q, states.qd)
            v = twin(slip_velocity)([jet.x for jet in x], xd, load.parameters)
            d = load.parameters[WAY:]
            speed = np.sqrt(sum(a * a for a in v))
            along = sum(a * b for a, b in zip(v, d, strict=True))
            found.append(along - 0.5 * (speed + 1.98 * SLOW) / (speed + SLOW) * speed)
        return np.array(found).T


def losses(gaps, which, lam, t, q, qd):
    """Power (k, c), W, that contacts which slide dissipate; lam (k, m) of the scene."""
    slips = np.array([gaps.slopes(*pair, which) @ v for *pair, v in zip(t, q, qd, strict=True)])
    return (lam[:, gaps.slip_rows[which]] * slips).sum(axis=2)


def add_friction(gaps, modes, packed, t, q, qd, lam, out):
    """Write the multipliers of the slips in a phase into out (k, m): those of contacts that slide, and redundant ones.

    lam (k, rows) are the multipliers of the phase.
    """
    rubbing = [i for i in modes.closed if gaps.rubs[i]]
    if not rubbing:
        return
    first = first_row_of(packed)
    N = np.array([-gaps.sign[i] * lam[:, first[id(_gap_row(gaps, modes, i))]] for i in rubbing]).T
    tangents = np.array([gaps.slopes(*pair, rubbing) for pair in zip(t, q, strict=True)])  # (k, c, 2, n)
    rows = gaps.slip_rows[rubbing]
    sticks = [j for j, i in enumerate(rubbing) if modes.grips[i] is None]
    if sticks:
        T = -out[:, rows[sticks]]
        for j, i in enumerate(sticks):
            T[:, j, [k for k, held in enumerate(modes.held.get(rubbing[i], ())[3:]) if not held]] = np.nan
        which = [rubbing[j] for j in sticks]
        out[:, rows[sticks]] = -carried(gaps, which, t, q, N[:, sticks], T)
    slip = np.einsum("kcin,kn->kci", tangents, qd)
    for j, i in enumerate(rubbing):
        if modes.grips[i] is not None:
            out[:, gaps.rows[i]] = -gaps.sign[i] * N[:, j]
            d = gaps.across(i, tangents[:, j], modes.grips[i])  # (k, 2)
            e = np.array([twin(heading)(*v, 0.0, (*way, 0.0), AHEAD)[:2] for v, way in zip(slip[:, j], d, strict=True)])
            out[:, rows[j]] = (gaps.kinetic[i] * N[:, j])[:, None] * e
