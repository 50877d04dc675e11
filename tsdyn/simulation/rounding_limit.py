"""The smallest attainable tolerances: cancellation in positions far from the origin bounds the error estimate."""

import copy

import numpy as np

from ..formulations.tolerances import ROUNDING
from ..sparse.massless_axes import levers
from .tolerances import FAR_LEVER

NOISE = 4.0 * ROUNDING  # direction error of a placement: rounding of a position over the lever


def within_rounding(method, packed, q):
    """Return the method with attainable tolerances, and a sentence if they were raised.

    The Taylor method accounts for the rounding of its projection itself.
    """
    if method.step is not None or method.driver != "steps":
        return method, ""
    if packed.derived.near is q:
        return method, ""
    if packed.derived.levers is None:
        packed.derived.levers = levers(packed)
    arms = packed.derived.levers
    if np.abs(q).max() < FAR_LEVER * arms.min(where=arms > 0.0, initial=np.inf):
        packed.derived.near = q
        return method, ""
    far = np.abs(q[packed.system.bodies[:, :1] + np.arange(3)]).max(axis=1)
    ratios = np.where(arms > 0.0, far / np.where(arms > 0.0, arms, 1.0), 0.0)
    worst = int(np.argmax(ratios))
    noise = NOISE * ratios[worst]
    if ratios[worst] < FAR_LEVER or min(method.step_tolerances()) >= noise:
        return method, ""
    other = copy.copy(method)
    for i, name in enumerate(("rtol", "atol")):
        while other.step_tolerances()[i] < noise:
            setattr(other, name, 2.0 * getattr(other, name))
    body = packed.bodies[worst].name
    return other, (
        f"The tolerances were raised to rtol={other.rtol:.1e} and atol={other.atol:.1e}: {body} is "
        f"{far[worst]:.3g} m from the origin, where on a lever of {arms[worst]:.3g} m no more digits are left."
    )
