"""Inverse dynamics: loads u of actuators, and multipliers, for a motion q, qd, qdd.

    Phi_q^T lam - B u = d,    d = Q_A + Q_v - M qdd

Q_A has the forces that are no actuators. Where actuators are more than degrees of freedom, |u| is least: see
instant.py. Many bodies take sparse matrices, so the cost is O(N) for chains and trees.
"""

from typing import NamedTuple

import numpy as np

from ..elements.joint_coordinates import AngleGeometry
from ..errors import InvalidArgument
from ..model import joint_motion
from ..model.sparse_jacobian import WIDTH, as_csr, with_short_rows
from ..observables import reactions
from ..observables.evaluate import constraint_arrays
from ..observables.friction_balance import balance, normal_loads
from ..observables.generalised_forces import force_loads, inertial_forces, velocity_forces
from ..statics.variations import named_coordinates
from .actuators import tension_given
from .instant import Instant
from .tolerances import DENSE, IDLE, LEAST_DIVISOR, MISSING, NO_EFFECT


class Loads(NamedTuple):
    """What drives a motion, at k instants."""

    u: np.ndarray  # (k, actuators)
    multipliers: np.ndarray  # (k, m) NaN for redundant rows
    normals: np.ndarray  # (k, frictions)  normal loads of friction that depends on reactions
    missing: np.ndarray  # (k, n) accelerations that the actuators can't give
    scale: np.ndarray  # (k,) m/s^2, of accelerations, that those are compared with


def given_loads(packed, t, q, qd, memory, actuators):
    """Q_A (k, n) of gravity and forces; of actuators only the law of a spring, without its tension."""
    items = {id(one.item) for one in actuators}
    system = packed.system
    own = [load.alone for load in packed.loads if load.normal < 0 and not _replaced(load, items)]
    forces = np.concatenate(own) if own else system.forces[:0]
    Q = force_loads(system._replace(forces=forces), t, q, qd, memory)
    Q[:, system.bodies[:, :1] + np.arange(3)] += system.mass[:, None] * system.gravity
    for load in packed.loads:
        for one in actuators:
            if one.item is load.force and not _replaced(load, items):
                Q[:, one.columns] -= tension_given(load, t)[:, None] * one.loads
    return Q


def _replaced(load, items):
    """Whether an actuator's load takes the place of this one wholly; a spring keeps its stiffness and damping."""
    return id(load.force) in items and not hasattr(load.force, "stiffness")


def find_loads(packed, t, q, qd, qdd, memory, actuators):
    """The `Loads` of a motion (k, n)."""
    sparse = q.shape[1] > DENSE
    system = with_short_rows(packed) if sparse else packed.system
    d = given_loads(packed, t, q, qd, memory, actuators) + velocity_forces(packed.system, q, qd)
    inertia = inertial_forces(packed.system, q, qdd)
    kept = ~np.isnan(reactions.multipliers(packed, t, q, qd, qdd, _plain(packed, t, memory)))
    kept[~kept.any(axis=1)] = True  # Phi_q has lost rank
    k, a, m = t.size, len(actuators), kept.shape[1]
    frictions = packed.system.normals.size
    found = Loads(np.zeros((k, a)), np.full((k, m), np.nan), np.zeros((k, frictions)), np.zeros_like(q), np.zeros(k))
    for i in range(k):
        Phi_q = constraint_arrays(system, q[i], qd[i], t[i], WIDTH if sparse else None)[1]
        B = (_sparse if sparse else _dense)(actuators, i, q.shape[1])
        Phi_q = as_csr(packed, Phi_q) if sparse else Phi_q
        instant = Instant(packed.system, (t[i], q[i]), Phi_q, np.flatnonzero(kept[i]), B)
        load = d[i] - inertia[i]
        if frictions:
            friction, found.normals[i] = _friction(packed, t[i], q[i], qd[i], instant, load)
            load = load + friction
        found.multipliers[i] = instant.solve(load)[q.shape[1] :]
        found.u[i], found.missing[i] = instant.u, instant.missing(load)
        found.scale[i] = max(np.abs(part / instant.root**2).max() for part in (d[i], inertia[i], instant.carried))
    if k:
        _demand_effective(instant, actuators, np.abs(found.u).max(axis=0))
    return found


def _demand_effective(instant, actuators, used):
    """Refuse an actuator whose loads the constraints take up, as along a coordinate that a motor drives.

    Only those that aren't used, (actuators,), may be such.
    """
    idle = {id(one.item) for one in actuators} - {
        id(one.item) for one, u in zip(actuators, used, strict=True) if u > IDLE * used.max()
    }
    which = [j for j, one in enumerate(actuators) if id(one.item) in idle]
    effective = {id(actuators[j].item) for j in which if instant.effect(j) > NO_EFFECT}
    for j in which:
        if id(actuators[j].item) not in effective:
            raise InvalidArgument(
                f"inverse_dynamics: the actuator {actuators[j].name} does no work on any motion that the constraints "
                "admit. If a motor prescribes its coordinate, remove the motor, and give its motion in the dict."
            )


def _friction(packed, t, q, qd, instant, load):
    """Friction that depends on reactions (n,), in balance with them, and its normal loads."""
    friction, x = balance(packed, float(t), q, qd, instant.Phi_q, lambda more: instant.solve(load + more))
    return friction, normal_loads(packed, float(t), q, qd, instant.Phi_q, np.nan_to_num(x[q.size :]))[0]


def _plain(packed, t, memory):
    """Memory with normal loads of zero: which rows are redundant doesn't depend on them."""
    return np.hstack((memory, np.zeros((t.size, packed.system.normals.size))))


def _dense(actuators, i, n):
    """B (n, actuators) at instant i."""
    B = np.zeros((n, len(actuators)))
    for j, one in enumerate(actuators):
        np.add.at(B[:, j], one.columns, one.loads[i])
    return B


def _sparse(actuators, i, n):
    """The same as a SciPy sparse array."""
    from scipy.sparse import csc_array

    columns = [one.columns for one in actuators]
    places = np.concatenate(columns), np.repeat(np.arange(len(actuators)), [c.size for c in columns])
    return csc_array((np.concatenate([one.loads[i] for one in actuators]), places), (n, len(actuators)))


def demand_produced(solution, actuators, found):
    """The share (k,) of accelerations that actuators can't give; a motion with more than rounding is refused."""
    share = np.abs(found.missing).max(axis=1, initial=0.0) / np.maximum(found.scale, LEAST_DIVISOR)
    if not share.max(initial=0.0) <= MISSING:
        i = int(np.nan_to_num(share, nan=np.inf).argmax())
        name, value = _largest_missing(solution, solution.q[i], found.missing[i])
        raise InvalidArgument(
            f"inverse_dynamics: {', '.join(one.name for one in actuators)} can't produce this motion: at t = "
            f"{solution.t[i]:.6g} s {name} gets {abs(value):.4g} of its acceleration (m/s^2 or rad/s^2) from no "
            f"actuator, {share[i]:.1e} of the largest. Add an actuator that moves it, or give a motion that it makes "
            "by itself, such as that of a Solution."
        )
    return share


def _largest_missing(solution, q, missing):
    """Name and value of the coordinate with the largest acceleration among (n,): of a joint, or else of a body."""
    handles, levels = solution.handles, (q, np.zeros_like(q), missing)
    found, named = [], named_coordinates(handles)
    for row in handles.rows:
        for name, geometry in named[id(row.item)]:
            evaluate = joint_motion.angle if isinstance(geometry, AngleGeometry) else joint_motion.displacement
            found.append((name, float(evaluate(geometry, *handles.motions(geometry, levels), 2))))
    if not found:
        at = [handles.where(body)[0] for body in handles.bodies]
        found = [
            (body.name, float(np.linalg.norm(missing[i : i + 3]))) for body, i in zip(handles.bodies, at, strict=True)
        ]
    return max(found, key=lambda pair: abs(pair[1]))
