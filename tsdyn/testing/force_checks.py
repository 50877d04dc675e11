"""The check of a force plug-in: `tsdyn.testing.check_force`, friction in proportion to a normal load included."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..elements.force import Force
from ..errors import CheckFailed, InvalidForce
from ..jit.kernels import entry, twin
from ..maths.power_series import Truncated
from ..model.equations import applied_forces, force_jacobian, set_time
from ..model.packed import with_force_jacobians
from ..motions.signals import Signal
from ..observables.diagnostics import load_powers, marker_states
from ..observables.generalised_forces import force_loads
from ..rows.graph_builder import build
from ..taylor.layout import no_series
from .series_checks import (
    along,
    begin_motions,
    carried_back,
    check_force_series,
    coefficients_of,
    compare,
    force_coefficients,
    instances,
    labels_of,
    maker,
    objects,
    random_motion,
    random_time,
    run_truncated,
    series_context,
    write_bodies,
    zeros,
)
from .tolerances import DRAWN, ORDER, QUOTIENT, ROUNDED, SHRINK, SPACING

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..hints import AnyBody


# The check of `series` and `normal_series` in `check_force`: friction in proportion to a normal load.
#
# The reaction is a random series, too. Order zero of such friction is in the equations of motion as a whole, so the
# compiled loops are compared from order one on.


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


@entry
def evaluate_force_jacobian(s, q, qd, t, Q, Q_q, Q_qd, renew, kept):  # nine: with what is kept
    """Q (n,) += the forces, Q_q, Q_qd (n, n) += their Jacobians; s is from `with_force_jacobians`."""
    set_time(s, t)
    applied_forces(s, q, qd, t, Q)  # laws of the whole scene have derivatives where they were evaluated last
    force_jacobian(s, q, qd, t, Q_q, Q_qd, renew, kept)


def jacobians(packed, q, qd, t):
    """dQ/dq and dQ/dqd (n, n) of all forces of a packed scene, gravity has none."""
    system, size = with_force_jacobians(packed)
    system = system._replace(reals=system.reals.copy())
    Q_q, Q_qd = np.zeros((2, q.size, q.size))
    Q, kept = np.zeros(q.size), np.zeros(size)
    system.reals[system.normals] = 1.0
    if len(system.forces):
        evaluate_force_jacobian(system, q, qd, float(t), Q, Q_q, Q_qd, 1, kept)
    return Q_q, Q_qd


def check_force(kind: type[Force] | Callable[[AnyBody, AnyBody], Force], *, seed: int = 0, states: int = 3) -> None:
    """Check a force's kernels; return None, or raise naming the wrong entry.

    Parameters
    ----------
    kind : Force subclass, or callable (a, b) -> Force
        A class is checked with its `example(rng, a, b)`.
    seed, states : int
        As for `check_primitive`.

    Raises
    ------
    CheckFailed
        If the compiled force differs from the Python one, its Jacobians from differences of sixth order, dissipation is
        negative, or a force without loads gives or takes power that is in neither its potential nor its dissipation.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.testing.check_force(ts.forces.Spring, states=1)
    """
    rng = np.random.default_rng(seed)
    make = maker(kind, (Force,), InvalidForce, lambda a, b: kind.example(rng, a, b))
    for scene, force, arrangement in instances(make, rng, states):
        for body in scene.bodies:
            body.velocity, body.angular_velocity = rng.normal(size=3), 3.0 * rng.normal(size=3)
        name = f"{force._kind()} ({arrangement})"
        _check(scene, force, name, rng)
        check = check_friction_series if scene.packed.loads[0].normal >= 0 else check_force_series
        check(scene, force, name, rng)


def _check(scene, force, name, rng):
    packed, (q, qd) = scene.packed, scene.start
    (load,) = packed.loads
    t = np.array([rng.uniform(0.2, 0.8)])
    memory = np.append(np.zeros(packed.system.memory.size), np.ones(packed.system.normals.size))[None]

    def Q(q, qd):
        return force_loads(packed.system, t, q[None], qd[None], memory)[0]

    value = Q(q, qd)
    if not np.isfinite(value).all():
        raise CheckFailed(f"{name}: the force is not finite at a random state: {value}.")
    coordinates = [f"{c} of {body.name}" for body in scene.bodies for c in ("r1", "r2", "r3", "e0", "e1", "e2", "e3")]
    if force.analytic:
        _check_twin(packed, load, name, t, q, qd, value, coordinates)
    _check_jacobians(packed, name, Q, q, qd, t[0], coordinates)
    _, lost, applied = (np.broadcast_to(x, (1,))[0] for x in load_powers(packed, load, t, q[None], qd[None], memory))
    size = np.abs(value) @ np.abs(qd)
    if lost < -ROUNDED * size:
        raise CheckFailed(f"{name}: dissipation is {lost:.6g} W; it can't be negative.")
    undriven = force.conservative and all(Signal.is_zero(getattr(force, attribute)) for attribute in force.loads)
    if undriven and not abs(applied) <= ROUNDED * (1.0 + size):
        raise CheckFailed(
            f"{name}: its power {value @ qd:.15g} W is not that of its potential and dissipation, {applied:.6g} W are "
            "left over. Correct them, or name the attributes that drive it in `loads`."
        )


def _check_twin(packed, load, name, t, q, qd, value, coordinates):
    """Compare the compiled force with the Python law, transformed by xd_qd."""
    x, xd = marker_states(packed, load, q[None], qd[None])
    par = [part for p in load.parameters for part in (p.value(t[0]) if isinstance(p, Signal) else [p])]
    par += [0.0] * load.force.memory + [1.0] * (load.normal >= 0)
    f = [0.0] * len(x)
    numbers = [[float(np.squeeze(entry)) for entry in part] for part in ([jet.x for jet in x], xd)]
    twin(type(load.force).law)(*numbers, par, t[0], f)
    for j, label in enumerate(coordinates):
        direction = np.zeros_like(qd)
        direction[j] = 1.0
        _, W = marker_states(packed, load, q[None], direction[None])
        expected = sum(float(np.squeeze(a)) * b for a, b in zip(W, f, strict=True))
        _compare(name, f"compiled Q[{j}] ({label})", value[j], expected, value, ROUNDED)


def _check_jacobians(packed, name, Q, q, qd, t, coordinates):
    got = jacobians(packed, q, qd, t)
    weights = {1: 45.0 / 60.0, 2: -9.0 / 60.0, 3: 1.0 / 60.0}
    for which, matrix in zip(("q", "qd"), got, strict=True):
        for j, label in enumerate(coordinates):
            h = np.zeros_like(q)
            h[j] = SPACING
            shift = (lambda d: (q + d, qd)) if which == "q" else (lambda d: (q, qd + d))
            column = sum(w * (Q(*shift(k * h)) - Q(*shift(-k * h))) for k, w in weights.items()) / SPACING
            for i in range(q.size):
                _compare(name, f"dQ[{i}] / d{which}[{j}] ({label})", matrix[i, j], column[i], got, QUOTIENT)


def _compare(name, entry, got, expected, scale, tolerance):
    size = max(1.0, *(np.abs(part).max(initial=0.0) for part in scale))
    if not abs(got - expected) <= tolerance * size:
        raise CheckFailed(f"{name}: {entry} is {got:.15g} and should be {expected:.15g}.")
