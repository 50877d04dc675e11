"""Contacts with friction in the phases of a run: rows and laws of those that stick and slide, multipliers."""

import numpy as np

from ..analyses.contact_friction import share
from ..analyses.contact_problem import slip_rows
from ..analyses.shared_loads import law_of, loads_of, shares_of, sharing_groups
from ..analyses.tolerances import EVENT_ERROR, LEAST_SLIP
from ..elements.bodies import rotation_matrix
from ..elements.element import stop_waiting
from ..elements.friction import heading
from ..elements.sliding import _SlidingTogether
from ..jit.kernels import twin
from ..model.handles import index_of
from ..observables.reactions import balancing
from .phase_scenes import first_row_of
from .tolerances import SAME_WAY

# A closed contact with friction sticks or slides. Where it sticks, all its rows hold; those of the slip of a point are
# rows on positions, which hold it where it came to rest. Where it slides, the row of the gap holds, and a force in
# proportion to its reaction acts (elements/sliding.py), with a direction d near the slip; the next phase takes another
# one where the slip has turned too far. Both are among what the run remembers: d (3,), ground frame, of the length of a
# slip below which friction keeps its direction, m/s, and for each of the two rows where in b, m, the point of a is.


def items_of(gaps, modes):
    """The rows that hold closed contacts, and the forces of those that slide."""
    items, shared = [], {}
    for members, own, shares in shares_of(gaps, modes.closed, modes.dependent):
        shared |= {i: _together(gaps, members, own, i, row) for i, row in zip(members, shares, strict=True)}
    for i in modes.closed:
        gap = gaps.list[i]
        if modes.slides(i):
            items += [] if i in modes.dependent else [gap_row(gaps, modes, i)]
            items.append(shared.get(i, gap.side.grip.sliding))
        elif modes.sticks(i):
            first, *others = gap.parts
            items += [first, *(part for part, held in zip(others, modes.grips[i], strict=False) if held)]
        else:
            items.append(gap.side.row)
    return items


def _together(gaps, members, own, i, shares):
    """The friction of a contact that carries shares (r,) of the reactions of others; the same for the same ones."""
    key = i, *members, *own
    if key not in gaps.together:
        reads = [gaps.list[j].side.grip.gap for j in own] if len(own) > 1 else [_mean_row(gaps, members)]
        gaps.together[key] = _SlidingTogether(gaps.list[i].side.grip.sliding, reads, *law_of(gaps, i, own, shares))
        stop_waiting(gaps.together[key])
    return gaps.together[key]


def _mean_row(gaps, members):
    """The row of the mean of points on a plane; the same for the same ones."""
    key = tuple(members)
    if key not in gaps.together:
        row, points = gaps.list[members[0]].side.grip.gap, [gaps.list[i].side.grip.gap.point_a for i in members]
        places = {"point_a": np.mean(points, axis=0), "point_b": row.point_b, "normal_b": row.normal_b}
        gaps.together[key] = type(row)(row.a, row.b, **places)
        stop_waiting(gaps.together[key])
    return gaps.together[key]


def normal_loads(gaps, modes, first, lam):
    """Loads (k, closed), those that push positive, by the multipliers lam (k, rows) of a phase."""
    own = [i not in modes.dependent for i in modes.closed]
    rows = [first[id(gap_row(gaps, modes, i))] for i in modes.closed if i not in modes.dependent]
    found = np.zeros((len(lam), len(own)))
    found[:, own] = -gaps.sign[modes.closed][own] * lam[:, rows]
    return found @ loads_of(gaps, modes.closed, modes.dependent).T if modes.dependent else found


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
        way, others = memory[gaps.slots[i] :][:3], gaps.list[i].parts[1:]
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


def gap_row(gaps, modes, i):
    """The primitive whose first row is the gap of a closed contact in a phase."""
    gap = gaps.list[i]
    for members, own in sharing_groups(gaps, modes.closed, modes.dependent):
        if own == [i]:
            return _mean_row(gaps, members)
    return gap.side.grip.gap if modes.slides(i) else gap.side.row


def slip_columns(gap, first):
    """The rows (2,) of the slip of a contact that sticks, -1 of one that depends on others."""
    if len(gap.parts) == 1:
        return slip_rows(gap, first)
    return [first.get(id(part), -1) for part in gap.parts[1:]]


def carried(gaps, which, t, q, memory, N, T, smooth, M):
    """N (k, c) and friction (k, c, 2) of contacts that stick, where rows depend on others; M (k, d) of those `smooth`.

    Friction is shared in proportion to N, but where reactions brace each other, see `share`. Contacts without friction
    brace others where these alone don't hold.
    """
    N, T, M = N.copy(), T.copy(), M.copy()
    depend = np.isnan(T).any(axis=(1, 2)) & np.isfinite(N).all(axis=1)  # at singular configurations N is NaN, too
    c, static = len(which), np.append(gaps.static[which], np.ones(len(smooth)))
    for k in depend.nonzero()[0]:
        loads = (gaps.responses(t[k], q[k], memory[k], [*which, *smooth]) * gaps.levers(q[k])).reshape(-1, q.shape[1])
        p, _ = share(static[:c], loads[: 3 * c], np.column_stack([N[k], np.nan_to_num(T[k])]))
        if smooth and (np.hypot(*p[:, 1:].T) > (1.0 + EVENT_ERROR) * static[:c] * p[:, 0]).any():
            sizes = np.linalg.norm(loads, axis=1)[::3]
            unit = sizes[c:] / sizes[:c].max()  # reactions of stops are torques
            loads[3 * c :: 3] /= unit[:, None]
            given = np.vstack([p, np.outer(M[k] * unit, (1.0, 0.0, 0.0))])
            p, _ = share(static, loads, given)
            M[k] = p[c:, 0] / unit
        N[k], T[k] = p[:c, 0], p[:c, 1:]
    return N, T, M


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
    loads = normal_loads(gaps, modes, first, lam)
    N = loads[:, gaps.rough[modes.closed]]
    tangents = np.array([gaps.slopes(*pair, frictional) for pair in zip(t, q, strict=True)])  # (k, c, 2, n)
    rows = gaps.slip_rows[frictional]
    smooth = [i for i in modes.closed if not gaps.rough[i]]
    M = loads[:, ~gaps.rough[modes.closed]]
    sticks = [j for j, i in enumerate(frictional) if modes.sticks(i)]
    if sticks:
        T = -out[:, rows[sticks]]
        for j, i in enumerate(sticks):
            T[:, j, [k for k, held in enumerate(modes.grips[frictional[i]]) if not held]] = np.nan
        redundant, alone = np.isnan(T), np.nan_to_num(T)
        own, stuck = N[:, sticks], [frictional[j] for j in sticks]
        if modes.spread:
            T, others = alone, M
        else:
            N[:, sticks], T, others = carried(gaps, stuck, t, q, memory, own, T, smooth, M)
        if redundant.any() and not modes.spread:
            # M qdd + Phi_q^T (lam + change) = Q + J^T T    J: redundant slips
            f = np.einsum("kci,kcin->kn", np.where(redundant, T, 0.0), tangents[:, sticks])
            more = np.hstack([N[:, sticks] - own, others - M])
            if more.any():
                normals = np.array([gaps.normals(*pair, [*stuck, *smooth]) for pair in zip(t, q, strict=True)])
                f = np.einsum("kc,kcn->kn", more, normals) + np.einsum("kci,kcin->kn", T - alone, tangents[:, sticks])
            change = balancing(packed, t, q, f, memory[:, : packed.system.memory.size])
            # Near singular states that would take other normal loads: rows that hold carry the friction alone
            pushing = [first[id(gap_row(gaps, modes, i))] for i in modes.closed if i not in modes.dependent]
            moves = np.abs(change[:, pushing]).max(axis=1) > EVENT_ERROR * np.abs(N).max(axis=1)
            change[moves], T[moves], others[moves] = 0.0, alone[moves], M[moves]
            for j, i in enumerate(sticks):
                N[moves, i] = own[moves, j]
            out[:, shared[0]] += change[:, shared[1]]
        out[:, rows[sticks]] = -T
        if (N[:, sticks] != own).any():
            out[:, gaps.rows[stuck]] = -gaps.sign[stuck] * N[:, sticks]
        if (others != M).any():
            out[:, gaps.rows[smooth]] = -gaps.sign[smooth] * others
    for j, i in enumerate(frictional):
        if modes.slides(i):
            out[:, gaps.rows[i]] = -gaps.sign[i] * N[:, j]
            out[:, rows[j]] = -N[:, j, None] * _friction(gaps, i, tangents[:, j], qd, memory)
    if modes.spread:
        _add_shared(gaps, modes, packed, shared, t, q, qd, memory, out)


def _friction(gaps, i, tangents, qd, memory):
    """Friction (k, 2) along the slips (k, 2, n) of a contact that slides, for unit normal reactions."""
    d, v = gaps.across(i, tangents, memory[:, gaps.slots[i] :][:, :3]), np.einsum("kin,kn->ki", tangents, qd)
    e = twin(heading)(v[:, 0], v[:, 1], 0.0, np.column_stack([d, np.zeros(len(d))]).T, 1.0)[:2]
    return -gaps.kinetic[i] * np.array(e).T


def _add_shared(gaps, modes, packed, shared, t, q, qd, memory, out):
    """Have contacts share their reactions in out (k, m), by `UnitModes.spread`; what else holds balances them."""
    first, f, more = first_row_of(packed), np.zeros_like(q), np.zeros_like(out)
    sticks = [i for i in modes.closed if modes.sticks(i)]
    rows = np.concatenate([gaps.rows[modes.closed], gaps.slip_rows[sticks].ravel()])
    own = -out[:, rows]
    own[:, : len(modes.closed)] *= gaps.sign[modes.closed]
    for i, numbers in modes.spread.items():
        p = np.array(numbers[:3]) + own @ np.reshape(numbers[4:], (3, -1)).T
        N = p[:, 0] + gaps.sign[i] * out[:, gaps.rows[i]]
        f += N[:, None] * np.stack([gaps.normals(*pair, [i])[0] for pair in zip(t, q, strict=True)])
        more[:, gaps.rows[i]] = -gaps.sign[i] * N
        if gaps.rough[i]:
            tangents = np.stack([gaps.slopes(*pair, [i])[0] for pair in zip(t, q, strict=True)])  # (k, 2, n)
            T = p[:, 1:] + out[:, gaps.slip_rows[i]]
            if modes.slides(i):
                T = N[:, None] * _friction(gaps, i, tangents, qd, memory)
            f += np.einsum("ki,kin->kn", T, tangents)
            more[:, gaps.slip_rows[i]] = -T
    change = balancing(packed, t, q, f, memory[:, : packed.system.memory.size])
    more[:, shared[0]] += change[:, shared[1]]
    for i in modes.closed:
        if modes.slides(i):
            more[:, gaps.rows[i]] += change[:, first[id(gap_row(gaps, modes, i))]]
    out += np.nan_to_num(more)
