"""What constraints leave free: the number of degrees of freedom, and their names."""

import numpy as np

from ..configuration.kinetic_metric import Metric, least_step
from ..errors import InconsistentState, InvalidArgument, SingularConfiguration
from ..observables.diagnostics import constraint_rows
from ..sparse.constraint_graphs import redundant_rows
from ..statics.coordinates import chosen
from ..statics.motion import Motion
from ..statics.variations import Variations
from .tolerances import CONSISTENT, DEAD, LISTED, MET, SWEEPS


def degrees_of_freedom(packed):
    """Of a packed scene whose redundant rows have been selected."""
    system = packed.system
    return int(system.bodies[:, 1].sum()) - len(system.segments) + len(redundant_rows(packed))


def demand_driven(packed, memory, t, q, who, remedy):
    """Refuse a scene with freedom, by the names of independent coordinates that are free; memory (slots,)."""
    k = degrees_of_freedom(packed)
    if k <= 0:
        return
    motion = Motion(packed, memory, t, q, np.zeros(q.size), still=True)
    names = [one.name for one in chosen(motion, Variations(motion, np.zeros(3)))]
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    raise InvalidArgument(
        f"{who}: {k} degree{'s' * (k != 1)} of freedom {'is' if k == 1 else 'are'} left: "
        f"{', '.join(names[:LISTED])}{more}. {remedy}"
    )


def driven_rates(scene, t, q, who):
    """The smallest velocities qd (n,), in the metric of lengths, with Phi_q qd + Phi_t = 0."""
    packed = scene.packed
    metric = Metric(packed, None, t, lengths=True)
    _, Phi_q, Phi_t = metric.arrays(q)
    A, drift = metric.reduced(q, Phi_q[metric.own]), Phi_t[metric.own]
    x = least_step(A, drift)
    for _ in range(SWEEPS if metric.sparse else 0):  # which is regularised
        left = A @ x + drift
        if np.abs(left).max() <= MET * (1.0 + np.abs(x).max()):
            break
        x = x + least_step(A, left)
    left = np.abs(A @ x + drift)
    if not left.max(initial=0.0) <= DEAD * (1.0 + np.abs(x).max(initial=0.0) + np.abs(drift).max(initial=0.0)):
        names = [scene.row_names()[metric.own[i]] for i in np.flatnonzero(drift)[:LISTED]]
        raise SingularConfiguration(
            f"{who}: no velocities follow the motions at t = {t:g} s ({', '.join(names)}): the mechanism is at a dead "
            "centre of what drives it, or motions contradict each other. Start elsewhere, or drive another coordinate."
        )
    return metric.rates(q, x)


def demand_consistent(scene, packed, t, q, qd, qdd):
    """Refuse a given motion (k, n) that violates constraints, by the row that is violated most."""
    levels = "position", "velocity", "acceleration"
    for level, residuals, size in zip(levels, constraint_rows(packed, t, q, qd, qdd), (q, qd, qdd), strict=True):
        share = np.abs(residuals) / (1.0 + np.abs(size).max(axis=1, keepdims=True))
        if not share.max(initial=0.0) <= CONSISTENT:
            i, row = np.unravel_index(int(np.nanargmax(share)), share.shape)
            raise InconsistentState(
                f"inverse_dynamics: the motion violates {scene.row_names()[row]} by {residuals[i, row]:.3g} "
                f"({level}) at t = {t[i]:g} s. Give a motion of this scene, such as a Solution of it."
            )
