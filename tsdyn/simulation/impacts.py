"""Impacts: velocities after impacts of contacts, with friction and without; `ts.impact`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..analyses.contact_friction import strike
from ..analyses.contact_problem import Inertia, NoSolution, closed_gaps, impulses
from ..calls import fitting
from ..configuration.tolerances import INITIAL_TOL
from ..elements.element import Attachment
from ..errors import InconsistentState, InvalidArgument, InvalidConstraint
from ..observables.state import RememberingState, remembered
from ..runs.task import state_arrays
from ..validation import floats, listed
from .phase_scenes import NAMED, gaps_of, has_contacts, phase_of
from .phases import Impulse
from .run_options import LAWS
from .scene_cache import prepared

if TYPE_CHECKING:
    from ..hints import ItemLike, Mapping, Scene, Sequence


def impulse_of(inertia, i, p):
    """The `Impulse` of a gap, of its impulses p (3,) along the normal and the slips."""
    return Impulse(p[0], inertia.along(i, p[1:]).tolist() if inertia.gaps.rough[i] else (0.0, 0.0, 0.0))


def impact_of(inertia, which, qd, before, e, law="newton"):
    """Impulses (k, 3) of the gaps `which`, the change of velocities (n,), and the share of e that acts."""
    if inertia.gaps.rough[which].any():
        return strike(inertia, which, qd, before, e, law)
    p = impulses(inertia, which, before, e, law)
    return along_normals(p), inertia.pushed(which, p), 1.0


def along_normals(p):
    """Impulses (k, 3) without friction, of normal ones (k,)."""
    return np.column_stack((p, np.zeros((len(p), 2))))


def jumped(inertia, qd, change, which, before, e, p, law="newton"):
    """Velocities (n,) after the impulses p (k, 3) of the gaps `which`, and the rates (count,) of all gaps then."""
    after = inertia.rates(qd + change, np.abs(qd) + np.abs(change))
    after[which] = np.maximum(after[which], 0.0)  # but for rounding
    if law == "newton":  # without rounding where the impact acts
        for k, i in enumerate(which):
            if p[k, 0] > 0.0:
                after[i] = -e[k] * min(before[k], 0.0)
    return qd + change, after


def held(inertia, qd, which, rates):
    """Impulses (k,), velocities (n,) and rates (count,) after the least change, by kinetic energy, that ends some."""
    p = inertia.hold(which, rates[which])
    change = inertia.pushed(which, p)
    after = inertia.rates(qd + change, np.abs(qd) + np.abs(change))
    after[which] = 0.0
    return p, qd + change, after


@fitting
def impact(
    scene: Scene,
    state: Any,
    contacts: ItemLike | Sequence[ItemLike] | None = None,
    restitution: float | Mapping[Any, float] | None = None,
    law: str = "newton",
) -> tuple[RememberingState, dict[str, Impulse]]:
    """Return the state after an impact of all closed contacts at once, in the metric of kinetic energy.

    Parameters
    ----------
    scene : Scene
        With unilateral constraints.
    state : State
        At the impact, such as `solution.state`; its positions are kept.
    contacts : unilateral constraint, or name of one, or a sequence of these, optional
        Those that are closed; by default those whose gap is zero at the state, to 1e-9 of the scene.
    restitution : float, or mapping of contacts or names to floats, optional
        Coefficients in place of those of the contacts.
    law : {"newton", "poisson"}
        Newton's law in Moreau's form, gd+ = -e gd- where a contact pushes; or Poisson's law: the impulse of restitution
        is e times that of compression. Both keep or lower the energy.

    Returns
    -------
    state : State
        A start of another run; its accelerations and multipliers are zeros.
    impulses : dict of str to Impulse
        By names of the contacts; as of `solution.impulses`.

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

    With friction the tangential impulses of a contact are within the kinetic coefficient times p, and against its slip
    where that doesn't vanish; they are the `tangential` of the impulses. Coefficients of restitution are lowered
    together where the energy would grow, or no impulses would do.

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
    gaps, kept = gaps_of(scene), prepared(free := phase_of(scene, []))
    q, qd = state_arrays(state, kept.n)
    t = float(getattr(state, "t", 0.0))
    memory = remembered(state, kept, t, q)
    kept.start(free, (q, qd), t, INITIAL_TOL, memory, True)  # finds redundant bilateral rows
    angles, slots = memory[: kept.handles.count], memory[kept.handles.count :]
    near = closed_gaps(gaps, q, angles)
    which = near if contacts is None else _chosen(gaps, contacts, near)
    e = gaps.restitution.copy()
    if isinstance(restitution, dict):
        for item, value in restitution.items():
            e[_chosen(gaps, [item], None)] = _coefficient(value)
    elif restitution is not None:
        e[:] = _coefficient(restitution)
    inertia = Inertia(gaps, t, q, slots, which)
    before = inertia.rates(qd)[which]
    try:
        p, change, share = impact_of(inertia, which, qd, before, e[which], law)
    except NoSolution as error:
        names = listed(list(dict.fromkeys(gaps.names[i] for i in which)), NAMED)
        raise InconsistentState(f"impact: no impulses keep these contacts from penetrating: {names}.") from error
    after, _ = jumped(inertia, qd, change, which, before, share * e[which], p, law)
    found = {gaps.names[i]: Impulse(0.0) for i in which}
    for i, own in zip(which, p, strict=True):
        before, more = found[gaps.names[i]], impulse_of(inertia, i, own)
        found[gaps.names[i]] = Impulse(before + more, before.tangential + more.tangential)
    anchor = getattr(state, "anchor", None)
    levels = np.zeros(kept.n), np.zeros(len(scene.packed.system.segments))
    return RememberingState.of(scene.packed, slots, anchor, t, q.copy(), after, *levels), found


def _chosen(gaps, items, near):
    """Numbers of the gaps of some contacts; of a stop with two bounds the one that is near."""
    found = []
    for item in [items] if isinstance(items, (str, Attachment)) else items:
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
