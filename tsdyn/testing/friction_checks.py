"""The check of `series` and `normal_series` in `check_force`: friction in proportion to a normal load.

The reaction is a random series, too. Order zero of such friction is in the equations of motion as a whole, so the
compiled loops are compared from order one on.
"""

import numpy as np

from ..errors import CheckFailed
from ..jit.kernels import twin
from ..maths.power_series import Truncated
from ..sparse.graph_builder import build
from ..taylor.layout import no_series
from .series_checks import (
    along,
    begin_motions,
    carried_back,
    coefficients_of,
    compare,
    force_coefficients,
    labels_of,
    objects,
    random_motion,
    random_time,
    run_truncated,
    series_context,
    write_bodies,
    zeros,
)
from .tolerances import DRAWN, ORDER, SHRINK


def check_friction_series(scene, force, name, rng):
    """Check the kernels of a friction's series, if it has those that a run would use."""
    packed = scene.packed
    (load,), kind = packed.loads, type(force)
    if no_series(force, load.parameters):
        return
    (rng,) = rng.spawn(1)  # the next scenes are what they were
    q, t = random_motion(scene, rng), random_time(rng)
    x, xd = along(scene, force, load.coordinates, q)
    unit, f, par = zeros(len(x)), zeros(len(x)), [*load.parameters, 1.0]
    run_truncated(kind, "law", name, x, xd, par, t, unit)
    labels = [f"out[{j}] (conjugate to {c}), of a unit normal load" for j, c in enumerate(labels_of(kind))]
    for k, out, _ in coefficients_of(kind, name, (x, xd), par, (len(x),)):
        compare(name, k, labels, out, unit)
    reaction, par[-1] = _checked_load(kind, name, x, par, rng)
    run_truncated(kind, "law", name, x, xd, par, t, f)

    context, (where, *_keep) = series_context(packed, *build(packed))
    expansion = context.expansion
    context.tangent.poses[:] = write_bodies(scene, q, expansion).ravel()
    begin_motions(where, t.c[0])
    first, orders = int(expansion.frictions[0].reaction), int(expansion.order.room)
    rows = expansion.loads[first : first + 6 * orders].reshape(6, orders)
    rows[:, : ORDER + 2] = [entry.c for entry in reaction]
    expected = carried_back(scene, load, q, f)
    parts = [f"{what} {axis}" for what in ("force", "body torque") for axis in "xyz"]
    labels = [f"compiled {part} of {body.name}" for body in scene.bodies for part in parts]
    for k in range(ORDER):
        force_coefficients(where, k)
        if k > 0:
            compare(name, k, labels, context.tangent.Z.reshape(-1, 2, 4)[:-1, :, :3].ravel(), expected)


def _checked_load(kind, name, x, par, rng):
    """Check `normal_series` with random reactions, and return one and its normal load, as Truncated series.

    Where a part of the load is next to zero, terms of it cancel; a wrong series is wrong for every reaction.
    """
    for left in reversed(range(DRAWN)):
        drawn = rng.normal(size=(6, ORDER + 2)) * SHRINK ** np.arange(ORDER + 2)
        reaction = objects([Truncated(c) for c in drawn])
        try:
            return reaction, _check_load(kind, name, x, reaction, par)
        except CheckFailed:
            if left == 0:
                raise
    raise AssertionError("one is drawn")


def _load(kind, name, x, reaction, par):
    try:
        return twin(kind.normal_load)(x, reaction, par)
    except TypeError as error:
        raise CheckFailed(f"{name}: normal_load can't be run on truncated Taylor series ({error}).") from error


def _check_load(kind, name, x, reaction, par):
    """Check `normal_series`; the normal load as a Truncated series."""
    load, scratch = _load(kind, name, x, reaction, par), np.full((kind.slots, ORDER + 2), np.nan)
    for k in range(ORDER + 1):
        place, f = [c.c[k] for c in x], np.array([c.c[k] for c in reaction])
        for _ in range(2):  # what is known of an order, then the whole
            got = twin(kind.normal_series)(place, f, par, k, scratch)
        compare(name, k, ["the normal load, by normal_series,"], [got], objects([load]))
    return load
