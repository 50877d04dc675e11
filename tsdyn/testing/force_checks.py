"""The check of a force plug-in: `tsdyn.testing.check_force`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..elements.force import Force
from ..errors import CheckFailed, InvalidForce
from ..jit.kernels import entry, twin
from ..model.equations import force_jacobian, set_time
from ..model.packed_forces import with_force_jacobians
from ..motions.signals import Signal
from ..observables.generalised_forces import force_loads
from ..observables.power import load_powers, marker_states
from .friction_checks import check_friction_series
from .instances import instances, maker
from .series_checks import check_force_series
from .tolerances import QUOTIENT, ROUNDED, SPACING

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..hints import AnyBody


@entry
def evaluate_force_jacobian(s, q, qd, t, Q_q, Q_qd, renew, kept):
    """Q_q, Q_qd (n, n) += the Jacobians of the forces; s is from `with_force_jacobians`."""
    set_time(s, t)
    force_jacobian(s, q, qd, t, Q_q, Q_qd, renew, kept)


def jacobians(packed, q, qd, t):
    """dQ/dq and dQ/dqd (n, n) of all forces of a packed scene, gravity has none."""
    system, size = with_force_jacobians(packed)
    system = system._replace(reals=system.reals.copy())
    Q_q, Q_qd = np.zeros((2, q.size, q.size))
    system.reals[system.normals] = 1.0
    if len(system.forces):
        evaluate_force_jacobian(system, q, qd, float(t), Q_q, Q_qd, 1, np.zeros(size))
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
