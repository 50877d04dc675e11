"""Laws of runs with contacts, stops and ropes: what holds between events, and across them."""

from itertools import pairwise

import numpy as np

from ..constraints import PlaneContact, Rope, Stop
from ..elements.bodies import turning
from ..maths.tolerances import HALF_DIGITS
from ..model.handles import index_of
from ..observables.evaluate import constraint_arrays, mass_matrix
from .findings import Finding, extent, some
from .tolerances import IMPACTED, IMPACTS, OUTPUTS, PENETRATED


def unilateral(solution):
    """No contact penetrates or pulls, and an open one has no reaction: at outputs and between them."""
    if solution._phases is None or solution._trajectory is None:
        return
    lam = solution.multipliers
    times = np.unique(np.append(solution.t[some(solution.t.size, OUTPUTS)], np.linspace(*solution.t[[0, -1]], OUTPUTS)))
    states, size = solution.at(times), _size(solution)
    loads = (body.mass * np.linalg.norm(solution.acceleration(body), axis=1) for body in solution.scene.bodies)
    largest = max(np.abs(lam).max(initial=0.0), *(load.max(initial=0.0) for load in loads)) or 1.0
    for contact, rows in _contacts(solution.packed):
        limit = PENETRATED * (1.0 if _is_angle(contact) else size)
        push = np.stack([-side.sign * lam[:, row] for side, row in zip(contact.sides, rows, strict=True)])
        is_open = _gap(contact, solution) > limit
        yield Finding("penetration", float(-_gap(contact, states).min()), limit, contact.name)
        yield Finding("reactions that pull", float(-push.min() / largest), HALF_DIGITS, contact.name)
        yield Finding("reactions of open contacts", float(np.abs(push[:, is_open]).max(initial=0.0)), 0.0, contact.name)


def impacts(solution):
    """What an impact changes are the momenta of its impulses, and of those of the bilateral constraints."""
    contacts = [] if solution._phases is None else list(_contacts(solution.packed))
    if not contacts:
        return
    system, fastest = solution.packed.system, np.abs(solution.qd).max(axis=0)
    lever = np.where(turning(system.bodies, fastest.size), 1.0 / _size(solution), 1.0)  # momenta as of positions
    rows = [row for contact, own in contacts for row in (*own, *_slips(contact, own))]
    before, after = _events(solution)
    hit = [k for k, i in enumerate(before) if any(t == solution.t[i] for t, *_ in solution.impulses)]
    for k in np.array(hit, int)[some(len(hit), IMPACTS)] if hit else ():
        i, j = before[k], after[k]
        q, t = solution.q[i], solution.t[i]
        M, Phi_q = lever[:, None] * mass_matrix(system, q), lever * constraint_arrays(system, q, solution.qd[i], t)[1]
        change = M @ (solution.qd[j] - solution.qd[i])
        for contact, own in contacts:
            found = [p for at, name, p in solution.impulses if (at, name) == (t, contact.name)]
            nearest = int(np.argmin([abs(gap[i]) for gap in _gaps(contact, solution)]))
            change = change - contact.sides[nearest].sign * Phi_q[own[nearest]] * sum(found)
            if found and _slips(contact, own):
                slips, P = Phi_q[_slips(contact, own)], sum(p.tangential for p in found)
                change = change - slips.T @ (_directions(solution.packed, contact, slips) @ P)
        B = np.delete(Phi_q, rows, axis=0)
        left = change - B.T @ np.linalg.lstsq(B.T, change, rcond=None)[0]
        share = np.abs(left).max() / ((np.abs(M) @ fastest).max() or 1.0)
        yield Finding("momenta at an impact", float(share), IMPACTED, f"t = {t:.9g} s")


def energy_of_phases(left, solution):
    """The largest change of energy less work `left` (k,) within a phase, and its largest gain at an event; J."""
    numbers, (before, after) = solution._phase_of_rows, _events(solution)
    within = max((np.ptp(left[numbers == number]) for number in np.unique(numbers)), default=0.0)
    return float(max(within, (left[after] - left[before]).max(initial=0.0)))


def _events(solution):
    """First and last outputs of each instant that outputs have more than once."""
    _, first, count = np.unique(solution.t, return_index=True, return_counts=True)
    twice = count > 1
    return first[twice], first[twice] + count[twice] - 1


def _contacts(packed):
    """Yield the contacts of a packed scene, and the rows of their gaps."""
    for member in packed.members:
        if getattr(member.constraint, "unilateral", False):
            yield member.constraint, [member.rows.start + i for i in range(len(member.constraint.sides))]


def _slips(contact, own):
    """The rows of the slips of a contact with friction, which follow that of its gap."""
    return [own[0] + 1, own[0] + 2] if getattr(contact, "has_friction", False) else []


def _directions(packed, contact, slips):
    """Directions (2, 3) of slips, ground frame, from their rows (2, n) of Phi_q."""
    body, sign = (contact.a, 1.0) if contact.a.dimension else (contact.b, -1.0)
    at = packed.system.bodies[index_of(packed, body), 0]
    return sign * slips[:, at : at + 3]


def _size(solution):
    q = solution.q[:, ~turning(solution.system.bodies, solution.q.shape[1])]
    return max(extent(solution), float(np.abs(q).max(initial=0.0))) or 1.0


def _is_angle(contact):
    return isinstance(contact, Stop) and contact.sides[0].joint is not None


def _gap(contact, states):
    """The least gap (k,) of a contact."""
    return np.min(_gaps(contact, states), axis=0)


def _gaps(contact, states):
    """Gaps (sides, k) of a contact, m or rad, from what a user measures."""
    if isinstance(contact, Stop):
        x = (states.angle if _is_angle(contact) else states.displacement)(contact.joint)
        bounds = (contact.lower, 1.0), (contact.upper, -1.0)
        return [sign * (x - bound) for bound, sign in bounds if bound is not None]
    if isinstance(contact, Rope):
        ends = [_place(states, body, s) for body, s in contact.points]
        return [contact.length - sum(np.linalg.norm(b - a, axis=-1) for a, b in pairwise(ends))]
    kind = "point" if isinstance(contact, PlaneContact) else "center"
    s_a, s_b = (getattr(contact, f"{kind}_{x}") for x in "ab")
    d, radius = _place(states, contact.a, s_a) - _place(states, contact.b, s_b), getattr(contact, "radius_a", 0.0)
    if contact.normal_b is not None:
        return [(d * _turned(states, contact.b, contact.normal_b)).sum(axis=-1) - radius]
    away = np.linalg.norm(d, axis=-1)
    return [contact.radius_b - radius - away if contact.inside else away - radius - contact.radius_b]


def _place(states, body, s):
    return np.asarray(s, float) if body.dimension == 0 else states.position(body, point=s)


def _turned(states, body, s):
    return np.asarray(s, float) if body.dimension == 0 else states.rotation(body) @ np.asarray(s, float)
