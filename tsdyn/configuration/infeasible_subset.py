"""Conflicting constraints: the minimal infeasible subset, joints taken as a whole.

At a minimum of |Phi|^2, Phi_q^T Phi = 0: the residuals balance like the forces of a prestressed structure, and only
constraints with a non-zero residual can conflict. Subsets of these are assembled from the sketch in order of size; with
many candidates, constraints are removed one at a time as long as the rest still fails.
"""

import time
from itertools import combinations

import numpy as np

from ..errors import InconsistentState
from .continuation import nearest
from .tolerances import LEFT_OVER

FEW = 6  # constraints of which all sets are tried
MOST = 60  # constraints among which a conflict is searched
LONGEST = 10.0  # s of search
TRIAL_SHAKES = (0.1, 0.3, 0.6, 1.0)


def refuse(scene, metric, sketch, found, tol, held=()):
    """Raise InconsistentState that names the constraints in conflict, also as `.constraints`."""
    packed = scene.packed
    members = [member for member in packed.members if not getattr(member.constraint, "normalises", False)]
    left = np.zeros(len(packed.system.segments))
    left[metric.own] = np.abs(found.Phi)
    sizes = np.array([left[member.rows].max() for member in members])
    suspects = [member for member, size in zip(members, sizes, strict=True) if size > LEFT_OVER * sizes.max()]
    trial = _Trial(metric, sketch, found.q, tol)
    conflict = False
    while len(suspects) <= MOST and not (conflict or trial.over):
        conflict = not trial.met(suspects)
        wider = suspects if conflict else _wider(suspects, members)
        if not conflict and len(wider) == len(suspects):
            break
        suspects = wider
    conflicting, minimal = smallest(suspects, trial) if conflict else (suspects, False)
    names, lines = scene.row_names(), []
    for member in sorted(conflicting, key=lambda member: -left[member.rows].max())[:8]:
        row = member.rows.start + int(np.argmax(left[member.rows]))
        lines.append(f"  {member.constraint.title}: |Phi| = {left[row]:.3g} in {names[row]}")
    if len(conflicting) > 8:
        lines.append(f"  ... and {len(conflicting) - 8} more")
    if len(conflicting) == 1:
        story = "This constraint is infeasible on its own"
    elif minimal:
        story = f"These {len(conflicting)} conflict; without any one of them, the others can be satisfied"
    elif conflict:
        story = f"These {len(conflicting)} conflict; whether fewer do was not found in {LONGEST:g} s"
    else:
        story = "These have non-zero residuals"
    where = f" with {', '.join(body.name for body in held)} held fixed" if len(held) else ""
    error = InconsistentState(
        f"no configuration that satisfies all constraints{where} was found in {found.iterations} iterations from the "
        f"sketch and from perturbed ones. {story}:\n"
        + "\n".join(lines)
        + "\nChange a length, point or axis of one of them, or remove one"
        + ("; or hold fewer bodies." if len(held) else ". If they are compatible, improve the sketch of the bodies.")
    )
    error.constraints = tuple(member.constraint for member in conflicting)
    raise error


def _wider(suspects, members):
    """Return the constraints that share a body with these: vanishing derivatives hide rows of a conflict."""
    bodies = {id(body) for member in suspects for body in (member.constraint.a, member.constraint.b)}
    bodies -= {id(None), id(suspects[0].constraint.scene.ground)}
    return [member for member in members if bodies & {id(member.constraint.a), id(member.constraint.b)}]


def smallest(suspects, trial):
    """Return a minimal infeasible subset, and True if each of its members is known to be necessary."""
    if len(suspects) <= FEW:
        for size in range(1, len(suspects)):
            for chosen in combinations(suspects, size):
                if trial.over:
                    return list(suspects), False
                if not trial.met(chosen):
                    return list(chosen), True
        return list(suspects), True
    needed, chunk = list(suspects), (len(suspects) + 1) // 2
    while True:
        at = 0
        while at < len(needed):
            if trial.over:
                return needed, False
            rest = needed[:at] + needed[at + chunk :]
            if rest and not trial.met(rest):
                needed = rest
            else:
                at += chunk
        if chunk == 1:
            break
        chunk = (chunk + 1) // 2
    return smallest(needed, trial) if len(needed) <= FEW < len(suspects) else (needed, True)


class _Trial:
    """Assemblies of some of the constraints."""

    def __init__(self, metric, sketch, q, tol):
        self.metric, self.sketch, self.also, self.tol = metric, sketch, (q,), tol
        self.until = time.monotonic() + LONGEST

    @property
    def over(self):
        """Whether the search has taken long enough: with what has been found, a user gets on."""
        return time.monotonic() > self.until

    def met(self, members):
        """Return True if the constraints can be satisfied together."""
        rows = np.concatenate([np.arange(member.rows.start, member.rows.stop) for member in members])
        return nearest(self.metric, self.sketch, self.tol, rows, TRIAL_SHAKES, self.also).met
