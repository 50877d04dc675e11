"""Loads without derivatives at a state are refused by name: jumps, kinks, sampled loads, friction of moving joints."""

import numpy as np

from ..errors import InvalidForce
from ..observables.generalised_forces import force_loads
from .tolerances import PROBE, ROUGH, ROUNDING


def demand_continuous(packed, but=()):
    """Refuse sampled loads, which are held whatever the scene does; those of some forces don't count."""
    for load in packed.loads:
        held = getattr(load.force, "period", None) is not None
        if held and not any(load.force is force for force in but):
            raise InvalidForce(
                f"{load.force.name}: a sampled load is no function of the state, so it has neither a derivative nor an "
                "equilibrium. Take a continuous one (without period=), or remove it and name its joint as an input."
            )


def demand_smooth(motion):
    """Refuse forces that can't be linearised at a `Motion`."""
    loads = motion.packed.loads
    demand_continuous(motion.packed)
    if motion.packed.loads and _rough(motion, motion.system.forces):
        worst = [load.force.name for load in loads if _rough(motion, load.alone)]
        raise InvalidForce(
            f"{', '.join(worst) or 'the forces'}: the force has a jump or a kink at this state, so it has no "
            "derivative. Choose another state, or a smooth law."
        )


def _rough(motion, forces):
    """Whether some forces differ on both sides of the state by other than a slope."""
    system, rng = motion.system._replace(forces=forces), np.random.default_rng(0)
    size = motion.packed.size or 1.0
    scale = np.ones(motion.q.size)
    scale[(motion.system.bodies[:, :1] + np.arange(3)).ravel()] = size
    t, memory = np.full(3, motion.t), np.tile(motion.memory, (3, 1))
    for place, speed in ((1.0, 0.0), (0.0, 1.0)):
        way = PROBE * scale * rng.normal(size=motion.q.size)
        side = np.array([-1.0, 0.0, 1.0])[:, None]
        Q = force_loads(system, t, motion.q + place * side * way, motion.qd + speed * side * way, memory)
        if not np.isfinite(Q).all():
            return True
        bend, slope = np.abs(Q[0] - 2.0 * Q[1] + Q[2]).max(), np.abs(Q[2] - Q[0]).max()
        if bend > ROUGH * slope + ROUNDING * np.abs(Q).max():
            return True
    return False
