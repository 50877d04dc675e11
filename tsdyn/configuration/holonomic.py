"""Check that the rows of a plug-in are holonomic: its jacobian is the derivative of its phi.

The tangent form would run a row on velocities that is given as one of phi. The forms with a basis solve for positions
with Phi and Phi_q together and silently give wrong results if one isn't the derivative of the other.
"""

import numpy as np

from ..elements.loops.template import state
from ..errors import InvalidConstraint
from ..jit.code_hash import is_ours
from ..jit.kernels import twin
from ..motions.prescribed import Motion
from ..motions.tolerances import QUOTIENT_ERROR
from ..observables.diagnostics import starts_of
from .tolerances import LEAST_X, PHI_STEPS

TRIED = 3  # instances of each kind


def demand_holonomic(packed, q, t, form):
    """Raise InvalidConstraint for a plug-in whose jacobian isn't the derivative of its phi at q (n,)."""
    if packed.derived.holonomic:
        return
    seen = {}
    for constraint, given, places in zip(packed.constraints, packed.parameters, packed.coordinates, strict=True):
        kind = type(constraint)
        seen[kind] = seen.get(kind, 0) + 1
        if is_ours(kind.__module__) or seen[kind] > TRIED or not kind.rows:
            continue
        par = [x for value in given for x in (value.value(t) if isinstance(value, Motion) else (value,))]
        par += [0.0] * kind.memory
        row = _wrong_row(constraint, par, _markers(packed, constraint, places, q), t)
        if row is not None:
            raise InvalidConstraint(
                f"{constraint.name}: row {row} of its jacobian is not the derivative of its phi: it is not holonomic, "
                f"for which {form!r} with this method gives wrong results. Correct the kernels with "
                f"ts.testing.check_primitive({kind.__name__}); make a row on velocities alone one of rate_rows."
            )
    packed.derived.holonomic = True


def _markers(packed, constraint, places, q):
    """Return the marker coordinates x of a constraint."""
    starts, parts = starts_of(packed), []
    for marker, s in zip(constraint.markers, places, strict=True):
        body, x = constraint.body_of(marker), np.zeros(marker.size)
        twin(state)(marker.code, body.dimension, starts.get(body, 0), q, np.zeros_like(q), s, x, np.zeros(marker.size))
        parts.append(x)
    return np.concatenate(parts)


def _wrong_row(constraint, par, x, t):
    """Return a row of the jacobian that no difference quotient of phi confirms; None if there is none."""
    kind = type(constraint)
    phi, jacobian = twin(kind.phi), twin(kind.jacobian)

    def value(x):
        out = np.zeros(kind.rows)
        phi(x, par, t, out)
        return out

    direction = np.random.default_rng(0).normal(size=x.size)
    Phi_x = np.zeros((kind.rows, x.size))
    try:
        jacobian(x, par, t, Phi_x)
        rate, size = Phi_x @ direction, np.abs(Phi_x) @ np.abs(direction)
        off = np.full(kind.rows, np.inf)
        for step in PHI_STEPS:
            h = step * max(np.abs(x).max(), LEAST_X) * direction
            quotient = (value(x + h) - value(x - h)) * np.abs(direction).max() / (2.0 * np.abs(h).max())
            off = np.fmin(off, np.abs(quotient - rate))
    except Exception:  # the compiled kernels report it
        return None
    wrong = np.flatnonzero(off > QUOTIENT_ERROR * size)
    return int(wrong[0]) if wrong.size else None
